//! How an effect enters the output, and how its size is set.

use super::linear::{Span, deviation, range, rms};
use super::world::World;

/// A contribution whose size is one number.
pub enum Form {
    /// k times this, added to the output (deg/s).
    Linear(Vec<f64>),
    /// The thermometer reading is moved by k times this; the bias stays what it was.
    Pull(Vec<f64>),
    /// A contribution that is no multiple of a fixed shape; the number runs over 0..1.
    Tuned(Box<dyn Fn(f64) -> Vec<f64>>),
    /// Clipping of the total output.
    Clip(Sides),
}

/// Which ends of the output clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sides {
    /// At +L and -L.
    Symmetric,
    Upper,
    Lower,
    /// At two levels of different magnitude: the lower end is reached by this factor later.
    Uneven(f64),
}

/// An effect before its size is known.
pub struct Plan {
    /// Id of the record contract.
    pub id: String,
    pub form: Form,
    /// The non-linear parameters, for the eye.
    pub parameters: Vec<(&'static str, f64)>,
}

impl Plan {
    /// A plan without parameters to show.
    pub fn of(id: &str, form: Form) -> Self {
        Self::with(id, form, &[])
    }

    /// A plan with its parameters.
    pub fn with(id: &str, form: Form, parameters: &[(&'static str, f64)]) -> Self {
        Self {
            id: id.to_owned(),
            form,
            parameters: parameters.to_vec(),
        }
    }
}

/// An effect in the record.
#[derive(Clone, Debug)]
pub struct Planted {
    pub id: String,
    /// Noiseless contribution, deg/s, one a row.
    pub contribution: Vec<f64>,
    /// rms of the part orthogonal to {1, p, p^2}, deg/s.
    pub orthogonal_rms: f64,
    /// That part over the whole (about its mean).
    pub surviving: f64,
    /// Size and other parameters.
    pub parameters: Vec<(&'static str, f64)>,
}

/// Output limits (lower, upper) for a clip of depth `s` (0 none, 1 at the quartiles) of `total`.
pub fn limits(sides: Sides, total: &[f64], s: f64) -> (f64, f64) {
    let (low, high) = range(total);
    let mut sorted = total.to_vec();
    sorted.sort_by(f64::total_cmp);
    let quartile = |q: f64| sorted[((sorted.len() - 1) as f64 * q) as usize];
    let upper = high - s * (high - quartile(0.6));
    let lower = low + s * (quartile(0.4) - low);
    match sides {
        Sides::Upper => (f64::NEG_INFINITY, upper),
        Sides::Lower => (lower, f64::INFINITY),
        Sides::Symmetric => {
            let top = high.abs().max(low.abs());
            let level = top * (1.0 - 0.8 * s);
            (-level, level)
        }
        Sides::Uneven(factor) => (low + (s / factor) * (quartile(0.4) - low), upper),
    }
}

/// `clip(total) - total`.
fn clipped(sides: Sides, total: &[f64], s: f64) -> Vec<f64> {
    let (low, high) = limits(sides, total, s);
    total.iter().map(|x| x.clamp(low, high) - x).collect()
}

/// Puts a plan into the world with its orthogonal part at `target_rms` deg/s; `before` is the total
/// output so far (a clip acts on it). `sign` is the sign of a linear effect. None where the effect
/// cannot be that large.
pub fn plant(
    w: &mut World,
    plan: Plan,
    target_rms: f64,
    sign: f64,
    before: &[f64],
) -> Option<Planted> {
    let measure = |w: &World, c: &[f64], extra: Option<(&[f64], f64)>| {
        let mut p = w.reading();
        if let Some((unit, k)) = extra {
            p.iter_mut().zip(unit).for_each(|(a, b)| *a += k * b);
        }
        rms(&Span::declared(&p).residual(c))
    };
    let mut parameters = plan.parameters;
    let contribution = match plan.form {
        Form::Linear(unit) => {
            let size = measure(w, &unit, None);
            if size <= 1e-9 * rms(&unit) {
                return None;
            }
            let k = sign * target_rms / size;
            parameters.push(("gain", k));
            super::linear::scaled(&unit, k)
        }
        Form::Pull(unit) => {
            let old = w.reading();
            let shift = |k: f64| -> Vec<f64> {
                old.iter()
                    .zip(&unit)
                    .map(|(p, u)| w.bias_at(*p) - w.bias_at(p + k * u))
                    .collect()
            };
            // The unit of a bend is that of Q itself: physics gives its sign.
            let bends = parameters.iter().any(|p| p.0 == "bends_phase");
            let sign = if bends { sign.abs() } else { sign };
            let largest = sign * 0.3 / unit.iter().map(|u| u.abs()).fold(1e-12, f64::max);
            let k = largest
                * reach(target_rms, |s| {
                    measure(w, &shift(s * largest), Some((&unit, s * largest)))
                })?;
            let c = shift(k);
            w.pull.iter_mut().zip(&unit).for_each(|(a, b)| *a += k * b);
            parameters.push(("pull_rad", k));
            c
        }
        Form::Tuned(at) => {
            let s = reach(target_rms, |s| measure(w, &at(s), None))?;
            parameters.push(("depth", s));
            at(s)
        }
        Form::Clip(sides) => {
            let s = reach(target_rms, |s| measure(w, &clipped(sides, before, s), None))?;
            let (low, high) = limits(sides, before, s);
            parameters.extend([("lower_dps", low), ("upper_dps", high)]);
            clipped(sides, before, s)
        }
    };
    let orthogonal_rms = measure(w, &contribution, None);
    Some(Planted {
        id: plan.id,
        surviving: orthogonal_rms / deviation(&contribution).max(1e-300),
        orthogonal_rms,
        contribution,
        parameters,
    })
}

/// The number in 0..1 where the rising `size` meets `target`, by scan and bisection, from whichever side is nearer where
/// it jumps (a dead band swallows whole rows); None where it misses by more than 10 %.
fn reach(target: f64, size: impl Fn(f64) -> f64) -> Option<f64> {
    let steps = 64;
    // Finer near 0: a small effect may need a thousandth of the range.
    let grid = |k: usize| 10f64.powf(-5.0 * (1.0 - k as f64 / steps as f64));
    let above = (0..=steps).find(|k| size(grid(*k)) >= target)?;
    let mut low = if above == 0 { 0.0 } else { grid(above - 1) };
    let mut high = grid(above);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if size(middle) < target {
            low = middle;
        } else {
            high = middle;
        }
    }
    let miss = |s: f64| (size(s) / target - 1.0).abs();
    let best = if miss(low) < miss(high) { low } else { high };
    (miss(best) < 0.1).then_some(best)
}
