//! The terms on the rate itself: their errors are functions of the true rate, and what comes in is the
//! true rate with the errors on it. So the rate is the fixed point of r = m - sum of cast(r k), k a term's
//! relative error and m what the terms on the bias leave, reached in a fixed number of passes
//! ([`passes`]) from r = m; errors are those of r held within the full scale.
//!
//! | term | k |
//! |---|---|
//! | `ScaleBy` | s0 + cast(s1 x) |
//! | `ScaleBy` with s2 | s0 + cast((s1 + cast(s2 x)) x) |
//! | `Even`, absolute | ppm 1e-6, on abs(r) |
//! | `Even` | cast(c u), c = ppm 1e-6 2^e / rate_max |
//! | `Cubic` | cast(c cast(u u)), c = ppm 1e-6 (2^e / rate_max)^2 |
//!
//! with u = r / 2^e, the rate read in the full scale of its word.

use super::formats::{Formats, PRODUCT_BITS};
use super::plan::{Plan, Term};
use super::terms::exact;
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::cast::Cast;
use crate::numeric::format::pow2;

/// A term on the rate, compiled.
#[derive(Debug, Clone)]
pub struct OnRate {
    law: Law,
    /// Fraction bits of k.
    bits: i32,
    /// The constant in k, raw.
    constant: i128,
    exponent: i32,
    /// r k to the sum's fraction bits.
    last: Cast,
}

#[derive(Debug, Clone)]
enum Law {
    /// The constant alone.
    Constant,
    /// The constant and slope * x: input, slope, rounding.
    Linear(usize, i128, Cast),
    /// The constant and (slope + curvature * x) * x: input, slope and curvature, rounding of the inner product,
    /// then of the outer.
    Quadratic(usize, [i128; 2], Box<[Cast; 2]>),
    /// The constant, on abs(r).
    Absolute,
    /// Constant * u.
    Even(Cast),
    /// Constant * u^2: rounding of u^2, then of k.
    Cubic(Box<[Cast; 2]>),
}

/// Fraction bits of k.
pub(super) fn share_bits(formats: &Formats) -> i32 {
    (formats.sum_fraction_bits + formats.rate_exponent() + 1).clamp(16, PRODUCT_BITS)
}

/// The constant of a term on the rate in k, 1; `None` for a term on the bias.
pub(super) fn constant(formats: &Formats, term: &Term) -> Option<f64> {
    let scale = pow2(formats.rate_exponent());
    Some(match term {
        Term::ScaleBy { s0, .. } => *s0,
        Term::Even {
            ppm,
            absolute: true,
            ..
        } => ppm * 1e-6,
        Term::Even {
            ppm, rate_max_dps, ..
        } => ppm * 1e-6 * (scale / rate_max_dps),
        Term::Cubic { ppm, rate_max_dps } => ppm * 1e-6 * (scale / rate_max_dps).powi(2),
        _ => return None,
    })
}

/// Most passes.
const MOST_PASSES: usize = 8;

/// What the passes may leave of the errors at full scale, of the noise.
const LEFT_SHARE: f64 = 1.0 / 16.0;

/// Contraction at full scale from which on the passes are tried one by one.
const SLOW: f64 = 0.5;

/// Rates at which they are, from rest to full scale.
const TRIED: usize = 32;

/// The error of a term at a rate of `rate_dps`, and its slope there, at most: deg/s and 1.
fn at_most(term: &Term, rate_dps: f64) -> (f64, f64) {
    let (share, power) = match term {
        Term::ScaleBy { input, s0, s1, s2 } => {
            let of_input = input.map_or(0.0, |_| s1.abs() + s2.abs());
            (s0.abs() + of_input, 1.0)
        }
        Term::Even {
            ppm,
            absolute: true,
            ..
        } => (ppm.abs() * 1e-6, 1.0),
        Term::Even {
            ppm, rate_max_dps, ..
        } => (ppm.abs() * 1e-6 * rate_dps / rate_max_dps, 2.0),
        Term::Cubic { ppm, rate_max_dps } => {
            (ppm.abs() * 1e-6 * (rate_dps / rate_max_dps).powi(2), 3.0)
        }
        _ => (0.0, 0.0),
    };
    (rate_dps * share, power * share)
}

/// The error of a term on the rate, deg/s, with its input at `x`.
fn error_dps(term: &Term, rate_dps: f64, x: f64) -> f64 {
    let over = |rate_max_dps: &f64| rate_dps / rate_max_dps;
    match term {
        Term::ScaleBy { input, s0, s1, s2 } => {
            rate_dps * (s0 + input.map_or(0.0, |_| (s1 + s2 * x) * x))
        }
        Term::Even {
            ppm,
            absolute: true,
            ..
        } => ppm * 1e-6 * rate_dps.abs(),
        Term::Even {
            ppm, rate_max_dps, ..
        } => ppm * 1e-6 * rate_dps * over(rate_max_dps),
        Term::Cubic { ppm, rate_max_dps } => ppm * 1e-6 * rate_dps * over(rate_max_dps).powi(2),
        _ => 0.0,
    }
}

/// How often the errors are taken off: each pass leaves at most the errors' slope times what the one
/// before it left, and what is left at full scale in the end is far below the noise. Where that slope is large, as
/// often as leaves least of any reading within the full scale: the slope at the true rate, which is less than the
/// reading, may be smaller.
pub(super) fn passes(plan: &Plan, formats: &Formats) -> usize {
    let full_scale = plan.full_scale_dps;
    let sum = |(e, q), term| {
        let (error, slope) = at_most(term, full_scale);
        (e + error, q + slope)
    };
    let (error, slope) = plan.terms.iter().fold((0.0, 0.0), sum);
    let enough = LEFT_SHARE * formats.noise_dps;
    if slope >= SLOW {
        return tried(plan, enough);
    }
    let mut left = error * slope;
    let mut passes = 1;
    while left > enough && passes < MOST_PASSES {
        left *= slope;
        passes += 1;
    }
    passes
}

/// The x between the ends at which the error of a term on the rate is largest or smallest, if any.
fn vertex(term: &Term) -> Option<f64> {
    match term {
        Term::ScaleBy {
            input: Some(_),
            s1,
            s2,
            ..
        } if *s2 != 0.0 => Some(-s1 / (2.0 * s2)).filter(|x| x.abs() < 1.0),
        _ => None,
    }
}

/// The fewest passes that leave no more than `enough`, deg/s, else those that leave least: over readings within the
/// full scale, every input at either end, or where a term's error turns.
fn tried(plan: &Plan, enough: f64) -> usize {
    let most = plan.full_scale_dps;
    let errors = |rate_dps: f64, x: f64| -> f64 {
        let held = rate_dps.clamp(-most, most);
        plan.terms.iter().map(|t| error_dps(t, held, x)).sum()
    };
    let mut worst = [0.0f64; MOST_PASSES];
    let turns = plan.terms.iter().filter_map(vertex);
    for x in [-1.0, 1.0].into_iter().chain(turns) {
        for k in 0..=2 * TRIED {
            let true_dps = most * (k as f64 / TRIED as f64 - 1.0);
            let measured = true_dps + errors(true_dps, x);
            if measured.abs() > most {
                continue;
            }
            let mut rate_dps = measured;
            for left in &mut worst {
                rate_dps = measured - errors(rate_dps, x);
                *left = left.max((rate_dps - true_dps).abs());
            }
        }
    }
    let least = worst.iter().fold(f64::INFINITY, |m: f64, l| m.min(*l));
    let first = worst.iter().position(|left| *left <= enough.max(least));
    first.map_or(1, |k| k + 1)
}

impl Formats {
    /// How often the errors on the rate are taken off.
    pub fn passes(&self, plan: &Plan) -> usize {
        passes(plan, self)
    }
}

impl OnRate {
    /// Compiles a term; `None` for one on the bias.
    pub fn new(formats: &Formats, term: &Term) -> Option<Self> {
        let constant = constant(formats, term)?;
        let bits = share_bits(formats);
        let (sum, exponent) = (formats.sum_fraction_bits, formats.rate_exponent());
        // u has so many fraction bits.
        let u = sum + exponent;
        let square = (2 * u).min(PRODUCT_BITS);
        let law = match term {
            Term::ScaleBy {
                input: Some(input),
                s1,
                s2,
                ..
            } => {
                let [slope, curvature] = [s1, s2].map(|s| (s * pow2(bits)).round() as i128);
                let product = |label| exact(label, bits + formats.input_bits(*input), bits);
                let outer = product("correction.scale");
                match curvature {
                    0 => Law::Linear(*input, slope, outer),
                    _ => {
                        let casts = Box::new([product("correction.scale_slope"), outer]);
                        Law::Quadratic(*input, [slope, curvature], casts)
                    }
                }
            }
            Term::Even { absolute: true, .. } => Law::Absolute,
            Term::Even { .. } => Law::Even(exact("correction.even", bits + u, bits)),
            Term::Cubic { .. } => Law::Cubic(Box::new([
                exact("correction.square", 2 * u, square),
                exact("correction.cubic", bits + square, bits),
            ])),
            _ => Law::Constant,
        };
        Some(OnRate {
            law,
            bits,
            constant: (constant * pow2(bits)).round() as i128,
            exponent,
            last: exact("correction.rate_term", sum + bits, sum),
        })
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        let mut casts = match &mut self.law {
            Law::Constant | Law::Absolute => Vec::new(),
            Law::Linear(_, _, cast) | Law::Even(cast) => vec![cast],
            Law::Quadratic(_, _, casts) | Law::Cubic(casts) => casts.iter_mut().collect(),
        };
        casts.push(&mut self.last);
        casts
    }

    /// The error at a rate, in the sum's unit.
    #[inline(always)]
    pub fn error<A: Arithmetic>(&self, ar: &A, r: A::Word, inputs: &[A::Word]) -> A::Word {
        let constant = ar.constant(self.constant, self.bits);
        let u = ar.read_as(r, -self.exponent);
        let mut on = r;
        let k = match &self.law {
            Law::Constant => constant,
            Law::Linear(input, slope, cast) => match inputs.get(*input) {
                Some(x) => {
                    let product = ar.mul(ar.constant(*slope, self.bits), *x);
                    ar.add(constant, ar.cast(product, cast, &[*x]))
                }
                // The plan was checked: every input exists.
                None => constant,
            },
            Law::Quadratic(input, [slope, curvature], casts) => match inputs.get(*input) {
                Some(x) => {
                    let [inner, outer] = casts.as_ref();
                    let product = ar.mul(ar.constant(*curvature, self.bits), *x);
                    let bend = ar.cast(product, inner, &[*x]);
                    let slope = ar.add(ar.constant(*slope, self.bits), bend);
                    let product = ar.mul(slope, *x);
                    ar.add(constant, ar.cast(product, outer, &[slope, *x]))
                }
                // As above.
                None => constant,
            },
            Law::Absolute => {
                on = ar.select(ar.is_negative(r), ar.neg(r), r);
                constant
            }
            Law::Even(cast) => {
                let product = ar.mul(constant, u);
                ar.cast(product, cast, &[u])
            }
            Law::Cubic(casts) => {
                let [square, cast] = casts.as_ref();
                let u2 = ar.cast(ar.mul(u, u), square, &[u]);
                ar.cast(ar.mul(constant, u2), cast, &[u2])
            }
        };
        ar.cast(ar.mul(on, k), &self.last, &[on, k])
    }
}

#[cfg(test)]
#[path = "rate_tests.rs"]
mod tests;
