//! The bit-accurate evaluation of a polynomial as the search of its coefficients sees it.

use super::request::Weight;
use crate::approx::form::measure::Reference;
use crate::approx::form::polynomial::{Formats, Monomials, Polynomial};
use crate::approx::form::{Codes, Form, Settled, run_in};
use crate::approx::minimax::{Datapath, Slab, Slabs};
use crate::approx::reference::Function;
use std::cell::RefCell;

/// Codes that are run at most; of more, a part in equal steps.
const MOST_CODES: u128 = 1 << 16;
/// Codes of the sample.
const SAMPLE: usize = 1024;
/// Codes kept where candidates were worst.
const WORST: usize = 64;
/// Words of up to so many bits leave 64-bit lanes room for coefficients that are a little larger.
const NARROW_BITS: u32 = 62;

/// A polynomial's evaluation in given formats, for any coefficients.
pub(super) struct Evaluation {
    formats: Formats,
    monomials: Monomials,
    degree: usize,
    narrow: bool,
    /// Code, function, factor of the error.
    points: Vec<(i128, f64, f64)>,
    /// The largest of the factors.
    most_factor: f64,
    /// Places in `points` to look at first.
    worst: RefCell<Vec<usize>>,
}

impl Evaluation {
    /// The evaluation; `settled` is that of some coefficients in the same formats.
    pub(super) fn new(
        function: &Function,
        settled: &Settled,
        formats: Formats,
        monomials: Monomials,
        degree: usize,
        weight: Weight,
    ) -> Self {
        let codes: Codes = formats.codes;
        let stride = (codes.count() / MOST_CODES).max(1);
        let mut points: Vec<(i128, f64, f64)> = Vec::new();
        for code in (codes.low..=codes.high).step_by(stride as usize) {
            let value = function.at(codes.real(code)).0;
            let factor = match weight {
                Weight::Absolute => 1.0,
                Weight::Relative if value != 0.0 => 1.0 / value.abs(),
                Weight::Relative => continue,
            };
            points.push((code, value, factor));
        }
        Evaluation {
            formats,
            monomials,
            degree,
            narrow: settled.bits <= NARROW_BITS,
            most_factor: points.iter().map(|p| p.2).fold(0.0, f64::max),
            points,
            worst: RefCell::new(Vec::new()),
        }
    }

    fn form(&self, raw: &[i128]) -> Option<Form> {
        let mut all = vec![0; self.degree + 1];
        for (value, order) in raw.iter().zip(self.monomials.exponents(self.degree)) {
            all[order] = *value;
        }
        let form = Polynomial::new(self.formats, self.monomials, all).ok()?;
        Some(Form::Polynomial(Box::new(form)))
    }

    fn error(&self, form: &Form, k: usize) -> f64 {
        let (code, value, factor) = self.points[k];
        let word = match self.narrow {
            true => run_in::<i64>(form, code as i64) as f64,
            false => run_in::<i128>(form, code) as f64,
        };
        (word * self.formats.output.lsb() - value).abs() * factor
    }

    /// The largest error and its place, or nothing beyond the limit.
    fn largest(
        &self,
        form: &Form,
        places: impl Iterator<Item = usize>,
        limit: f64,
    ) -> Result<f64, usize> {
        let mut largest = 0.0f64;
        for k in places {
            let error = self.error(form, k);
            if error > limit {
                return Err(k);
            }
            largest = largest.max(error);
        }
        Ok(largest)
    }

    fn remember(&self, k: usize) {
        let mut worst = self.worst.borrow_mut();
        worst.retain(|other| *other != k);
        worst.insert(0, k);
        worst.truncate(WORST);
    }

    fn judge(&self, raw: &[i128], limit: f64, stride: usize) -> Option<f64> {
        let form = self.form(raw)?;
        let first = self.worst.borrow().clone();
        let places = first
            .into_iter()
            .chain((0..self.points.len()).step_by(stride));
        match self.largest(&form, places, limit) {
            Ok(error) => Some(error),
            Err(place) => {
                self.remember(place);
                None
            }
        }
    }
}

impl Datapath for Evaluation {
    fn max_error(&self, raw: &[i128], limit: f64) -> Option<f64> {
        self.judge(raw, limit, 1)
    }

    fn sample_error(&self, raw: &[i128], limit: f64) -> Option<f64> {
        self.judge(raw, limit, (self.points.len() / SAMPLE).max(1))
    }

    fn evaluation_bound(&self, raw: &[i128]) -> f64 {
        let Some(Form::Polynomial(form)) = self.form(raw) else {
            return f64::INFINITY;
        };
        let codes = self.formats.codes;
        let steps = form.evaluation_bound(codes.low, codes.high);
        (steps + 0.5 * self.formats.output.lsb()) * self.most_factor
    }

    fn slabs(&self, raw: &[i128], limit: f64, count: usize) -> Slabs {
        let Some(Form::Polynomial(form)) = self.form(raw) else {
            return Slabs::Some(Vec::new());
        };
        let codes = self.formats.codes;
        let evaluation = 1.05 * form.evaluation_bound(codes.low, codes.high);
        // Places lie densest towards the ends, as those of a polynomial's greatest errors do.
        let bins = (count / 2).max(1);
        let bin = |code: i128| {
            let along = (code - codes.low) as f64 / (codes.count() - 1).max(1) as f64;
            let angle = (1.0 - 2.0 * along).clamp(-1.0, 1.0).acos();
            ((angle / std::f64::consts::PI * bins as f64) as usize).min(bins - 1)
        };
        // The tightest slab from above and from below in each bin.
        let mut tightest: Vec<[Option<(f64, Slab)>; 2]> = vec![[None; 2]; bins];
        for &(code, value, factor) in &self.points {
            let Some((low, high)) = self.allowed(value, limit / factor) else {
                return Slabs::Impossible;
            };
            let slab = Slab {
                x: codes.real(code),
                low: low - evaluation,
                high: high + evaluation,
            };
            let Some(best) = tightest.get_mut(bin(code)) else {
                continue;
            };
            for (best, room) in best.iter_mut().zip([high - value, value - low]) {
                let room = room * factor;
                if slab.low.is_finite()
                    && slab.high.is_finite()
                    && best.is_none_or(|(other, _)| room < other)
                {
                    *best = Some((room, slab));
                }
            }
        }
        let all = tightest.into_iter().flatten().flatten();
        Slabs::Some(all.map(|(_, slab)| slab).collect())
    }
}

impl Evaluation {
    /// Between which values a word before the output's rounding lies if the result is at most `most`
    /// from `value`; infinite where the output's limits act. None if no output code is that near.
    fn allowed(&self, value: f64, most: f64) -> Option<(f64, f64)> {
        let output = self.formats.output;
        let lsb = output.lsb();
        let (bottom, top) = (output.min_raw() as f64, output.max_raw() as f64);
        // A double's rounding may count for the candidate.
        let slack = 4.0 * f64::EPSILON * value.abs();
        let least = ((value - most - slack) / lsb).ceil().max(bottom);
        let greatest = ((value + most + slack) / lsb).floor().min(top);
        (least <= greatest).then(|| {
            let low = match least > bottom {
                true => (least - 0.5) * lsb,
                false => f64::NEG_INFINITY,
            };
            let high = match greatest < top {
                true => (greatest + 0.5) * lsb,
                false => f64::INFINITY,
            };
            (low, high)
        })
    }
}
