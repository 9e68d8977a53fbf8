//! The integers that a polynomial's coefficients can be, and the error as a function of them.

use super::basis::Chebyshev;
use super::ellipsoid;
use super::lattice::{self, Ball};
use super::remez::Minimax;
use super::samples::Samples;
use super::wide::Wide;
use crate::error::{Error, InputError, Result};
use crate::numeric::format::{Format, pow2};

/// What one coefficient can be: `raw * 2^-fraction_bits` with `min_raw <= raw <= max_raw`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CoefficientFormat {
    /// May be negative or exceed the word's width.
    pub fraction_bits: i32,
    /// Least raw value.
    pub min_raw: i128,
    /// Greatest raw value.
    pub max_raw: i128,
}

impl From<Format> for CoefficientFormat {
    fn from(format: Format) -> Self {
        CoefficientFormat {
            fraction_bits: format.fraction_bits as i32,
            min_raw: format.min_raw(),
            max_raw: format.max_raw(),
        }
    }
}

impl CoefficientFormat {
    /// Any integer multiple of 2^-fraction_bits.
    pub fn unlimited(fraction_bits: i32) -> Self {
        CoefficientFormat {
            fraction_bits,
            min_raw: -(1 << 100),
            max_raw: 1 << 100,
        }
    }

    /// The value of one unit.
    pub fn lsb(self) -> f64 {
        pow2(-self.fraction_bits)
    }

    fn contains(self, raw: i128) -> bool {
        (self.min_raw..=self.max_raw).contains(&raw)
    }

    /// Round to nearest, refusing what the format does not hold. A value that only rounds out of
    /// the format becomes its end.
    fn nearest(self, value: Wide, exponent: u32) -> Result<i128> {
        let scaled = value.scaled(pow2(self.fraction_bits));
        let raw = scaled.round().ok_or_else(|| self.refuse(value, exponent))?;
        let clamped = raw.clamp(self.min_raw, self.max_raw);
        if raw.abs_diff(clamped) > 1 {
            return Err(self.refuse(value, exponent));
        }
        Ok(clamped)
    }

    fn refuse(self, value: Wide, exponent: u32) -> Error {
        let value = value.to_f64();
        let signed = self.min_raw < 0 || value < 0.0;
        let mut bits = u32::from(signed);
        while bits < 1000 && value.abs() >= pow2(bits as i32 - i32::from(signed)) {
            bits += 1;
        }
        let which = match (self.min_raw >= 0, signed) {
            (true, true) => "it takes a signed format and",
            _ => "it takes",
        };
        let sign = if signed { ", the sign among them" } else { "" };
        let u = if signed { "" } else { "U" };
        let help = format!(
            "{which} {bits} integer bits{sign}: {u}Q{bits}.{}",
            self.fraction_bits
        );
        InputError::new(format!(
            "the coefficient of x^{exponent} is about {value:.6}, which its format does not hold \
             ({} to {})",
            self.min_raw as f64 * self.lsb(),
            self.max_raw as f64 * self.lsb(),
        ))
        .help(help)
        .into()
    }
}

/// Integer coefficients and the largest weighted error of the polynomial evaluated without rounding.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// One a monomial, ascending exponents.
    pub raw: Vec<i128>,
    /// Largest weighted error, real arithmetic.
    pub error: f64,
    /// Root mean square of the weighted error over the points. Where a single place decides the
    /// largest error (all coefficients have one format, and p(1) is a multiple of it) many choices share
    /// it; this tells them apart.
    pub rms: f64,
}

/// Root mean square.
pub(super) fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt()
}

/// The approximation with its formats.
pub struct Problem<'s, 'a> {
    /// The function.
    pub samples: &'s Samples<'a>,
    /// Its best approximation by real coefficients.
    pub minimax: &'s Minimax,
    /// One a monomial.
    pub formats: Vec<CoefficientFormat>,
    /// The rounded minimax coefficients.
    pub rounded: Candidate,
    /// Weighted value of one unit of each coefficient at each point: `[coefficient][point]`.
    columns: Vec<Vec<Wide>>,
}

impl<'s, 'a> Problem<'s, 'a> {
    /// Refused: a number of formats other than one or one a monomial, and a coefficient that its
    /// format does not hold (which one, and how many integer bits it takes).
    pub fn new(
        samples: &'s Samples<'a>,
        minimax: &'s Minimax,
        formats: &[CoefficientFormat],
    ) -> Result<Problem<'s, 'a>> {
        let n = samples.basis.len();
        let formats = match formats {
            [one] => vec![*one; n],
            many if many.len() == n => many.to_vec(),
            other => {
                return Err(InputError::new(format!(
                    "{} coefficient formats for {n} coefficients",
                    other.len()
                ))
                .help("give one for all, or one for each")
                .into());
            }
        };
        let mut raw = Vec::with_capacity(n);
        let exponents = &samples.basis.exponents;
        for ((&c, format), &exponent) in minimax.coefficients.iter().zip(&formats).zip(exponents) {
            raw.push(format.nearest(c, exponent)?);
        }
        let columns = formats
            .iter()
            .zip(exponents)
            .map(|(format, &exponent)| {
                let unit = |p: &super::samples::Point| {
                    Wide::from(p.x).powi(exponent).scaled(format.lsb()) * Wide::from(p.weight)
                };
                samples.points.iter().map(unit).collect()
            })
            .collect();
        let mut problem = Problem {
            samples,
            minimax,
            formats,
            rounded: Candidate {
                raw: Vec::new(),
                error: 0.0,
                rms: 0.0,
            },
            columns,
        };
        problem.rounded = problem.candidate(raw);
        Ok(problem)
    }

    /// The coefficients' values; exact up to 106 bits.
    pub fn values(&self, raw: &[i128]) -> Vec<Wide> {
        raw.iter()
            .zip(&self.formats)
            .map(|(&r, f)| Wide::from_integer(r).scaled(f.lsb()))
            .collect()
    }

    /// Largest weighted error under ideal evaluation, peaks between points interpolated.
    pub fn error(&self, raw: &[i128]) -> f64 {
        self.samples
            .supremum(&self.samples.errors(&self.values(raw)))
    }

    /// These coefficients with their errors.
    pub fn candidate(&self, raw: Vec<i128>) -> Candidate {
        let errors = self.samples.errors(&self.values(&raw));
        Candidate {
            raw,
            error: self.samples.supremum(&errors),
            rms: rms(&errors),
        }
    }

    /// The same with the function evaluated at the peaks.
    pub fn exact_error(&self, raw: &[i128]) -> f64 {
        self.samples.supremum_of(&self.values(raw)).0
    }

    /// An error that no integers avoid, because at some place every polynomial of these formats is a multiple
    /// of one number: at 0, +-1, +-1/2 and so on the finest unit among lsb_i x^i.
    pub fn lattice_bound(&self) -> f64 {
        let samples = self.samples;
        let mut places = vec![0.0];
        for k in 0..4 {
            places.extend([pow2(-k), -pow2(-k)]);
        }
        let mut bound = 0.0f64;
        for x in places {
            if !(samples.low..=samples.high).contains(&x) {
                continue;
            }
            let known = samples.points.iter().find(|p| p.x == x).copied();
            let Some(point) = known.or_else(|| samples.point_at(x)) else {
                continue;
            };
            let units = self.formats.iter().zip(&samples.basis.exponents);
            let unit = units
                .map(|(f, &e)| f.lsb() * x.abs().powi(e as i32))
                .filter(|&u| u > 0.0)
                .fold(f64::INFINITY, f64::min);
            let parts = point.value.scaled(1.0 / unit);
            if let Some(nearest) = parts.round().filter(|_| unit.is_finite()) {
                let rest = (parts - Wide::from_integer(nearest)).abs().hi * unit;
                bound = bound.max(rest * point.weight);
            }
        }
        bound
    }

    /// True if every coefficient is in its format.
    pub fn admits(&self, raw: &[i128]) -> bool {
        raw.len() == self.formats.len()
            && raw.iter().zip(&self.formats).all(|(&r, f)| f.contains(r))
    }

    /// Coordinates around `base` in which errors up to `limit` are few integer points. None if 106
    /// bits do not tell the monomials apart.
    pub(super) fn frame(
        &self,
        base: &[i128],
        limit: f64,
        transform: Option<Vec<Vec<i128>>>,
    ) -> Option<Frame> {
        let errors = self.samples.errors(&self.values(base));
        let (support, weights) = self.design(limit);
        let original: Vec<Vec<Wide>> = self
            .columns
            .iter()
            .map(|column| {
                let at = |(&k, &w): (&usize, &f64)| column[k] * Wide::from(w.sqrt());
                support.iter().zip(&weights).map(at).collect()
            })
            .collect();
        let start = transform.unwrap_or_else(|| lattice::identity(self.formats.len()));
        let reduced = lattice::reduce(&original, start)?;
        let narrow = |v: &Vec<Wide>| -> Vec<f64> { v.iter().map(|x| x.hi).collect() };
        let vectors: Vec<Vec<f64>> = reduced.vectors.iter().map(narrow).collect();
        let offset: Vec<f64> = support
            .iter()
            .zip(&weights)
            .map(|(&k, &w)| errors[k] * w.sqrt())
            .collect();
        let everywhere = lattice::combine(&self.columns, &reduced.transform);
        let rows = (0..errors.len())
            .map(|m| everywhere.iter().map(|v| v[m].hi).collect())
            .collect();
        Some(Frame {
            base: base.to_vec(),
            transform: reduced.transform,
            ball: Ball::new(&vectors, &offset),
            order: check_order(&support, &weights, errors.len()),
            errors,
            rows,
        })
    }

    /// Points and weights of the ellipsoid around all polynomials with error up to `limit`.
    fn design(&self, limit: f64) -> (Vec<usize>, Vec<f64>) {
        let samples = self.samples;
        let n = samples.basis.len();
        let last = samples.points.len() - 1;
        let stride = (samples.points.len() / (8 * n)).max(1);
        let mut support: Vec<usize> = (0..=last).step_by(stride).collect();
        for &x in &self.minimax.reference {
            let after = samples.points.partition_point(|p| p.x < x).min(last);
            support.extend([after.saturating_sub(1), after]);
        }
        support.push(last);
        support.sort_unstable();
        support.dedup();
        let functions = Chebyshev::new(&samples.basis, samples.low, samples.high);
        let mut rows = Vec::with_capacity(support.len());
        let mut errors = Vec::with_capacity(support.len());
        for &k in &support {
            let p = &samples.points[k];
            rows.push(functions.at(p.x).iter().map(|v| v.hi * p.weight).collect());
            errors.push(samples.error_at(&self.minimax.coefficients, p));
        }
        let start = vec![1.0; support.len()];
        let weights = ellipsoid::weights(&rows, &errors, limit, start);
        let largest = weights.iter().fold(0.0, |m: f64, &w| m.max(w));
        let kept: Vec<(usize, f64)> = support
            .into_iter()
            .zip(weights)
            .filter(|&(_, w)| w > 1e-6 * largest)
            .collect();
        let sum: f64 = kept.iter().map(|&(_, w)| w).sum();
        kept.into_iter().map(|(k, w)| (k, w / sum)).unzip()
    }
}

/// Points of the ellipsoid first, heaviest first, then all others coarse to fine.
fn check_order(support: &[usize], weights: &[f64], count: usize) -> Vec<usize> {
    let mut heavy: Vec<(usize, f64)> = support
        .iter()
        .copied()
        .zip(weights.iter().copied())
        .collect();
    heavy.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut seen = vec![false; count];
    let mut order = Vec::with_capacity(count);
    let coarse = [32, 8, 2, 1]
        .into_iter()
        .flat_map(|s| (0..count).step_by(s));
    for k in heavy.into_iter().map(|(k, _)| k).chain(coarse) {
        if !std::mem::replace(&mut seen[k], true) {
            order.push(k);
        }
    }
    order
}

/// Lattice coordinates: `raw = base + sum of z_k transform[k]`.
pub(super) struct Frame {
    pub base: Vec<i128>,
    pub transform: Vec<Vec<i128>>,
    pub ball: Ball,
    /// Weighted errors of the base at all points.
    pub errors: Vec<f64>,
    /// Weighted values of the reduced basis: `[point][vector]`.
    pub rows: Vec<Vec<f64>>,
    /// In which order points are looked at.
    pub order: Vec<usize>,
}

impl Frame {
    /// The coefficients of a lattice point; None beyond 128 bits.
    pub fn raw(&self, z: &[i64]) -> Option<Vec<i128>> {
        let mut raw = self.base.clone();
        for (&z, row) in z.iter().zip(&self.transform) {
            for (r, &t) in raw.iter_mut().zip(row) {
                *r = r.checked_add(t.checked_mul(i128::from(z))?)?;
            }
        }
        Some(raw)
    }

    /// Errors at all points, or None as soon as one exceeds `limit`. `scratch` holds them.
    pub fn errors_within(&self, z: &[i64], limit: f64, scratch: &mut [f64]) -> Option<()> {
        for &m in &self.order {
            let mut e = self.errors[m];
            for (v, &z) in self.rows[m].iter().zip(z) {
                e -= v * z as f64;
            }
            if e.abs() > limit {
                return None;
            }
            scratch[m] = e;
        }
        Some(())
    }
}
