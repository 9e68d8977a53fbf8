//! How far a fixed-point reading can be from the plan in real numbers.
//!
//! Term by term, every rounding at its worst, to first order in the errors (a factor below covers their
//! products). Notation: h = half an LSB of the sum; g = half an LSB of a gain; d = one LSB of an input
//! (its rounding, or 1 held at the largest word).
//!
//! | term | at most |
//! |---|---|
//! | constant, step | h |
//! | product of m factors | g + abs(gain) (m d + (m - 1) 2^-31) + h |
//! | lag of c, size S | 2 S g + abs(gain) (2 e + s / a + 2 S (q + q) / a + 2^-31) + h; e: error of c; s: half an LSB of the state, which decays by a a step and so sums up to s / a; q: half an LSB of a and b |
//! | curve of a lag, c of size S and slope k | 2 S g + abs(gain) (2 k d + 2 e + k (s / a + 4 q / a + d / 2)) + h; e: knots and between them; d / 2: y to the input's word |
//! | curve | slope d + h (knots) + h (between them) |
//! | slope | 2 g + 2 abs(gain) d + h |
//! | decay | g + abs(gain) (s / a + q / a + 2^-31) + h |
//! | on the rate, error k r | in each pass R (error of k) + h, R the full scale, and 3 K times what the pass before it was off by, K the largest k |

use super::formats::{Formats, PRODUCT_BITS, largest, slope_dps, steepest};
use super::plan::{Plan, Term};
use super::rate_terms::{constant, share_bits};
use super::states::{Approach, lagged_curve_bits};
use super::terms::GAIN_BITS;
use crate::numeric::format::pow2;

/// Covers products of errors.
const SECOND_ORDER: f64 = 1.01;

/// The bound for readings within the words, deg/s.
pub(super) fn bound_dps(plan: &Plan, formats: &Formats) -> f64 {
    let rate_lsb = formats.rate.lsb();
    let mut bound = rate_lsb / 2.0;
    for term in &plan.terms {
        bound += on_bias(plan, formats, term);
    }
    let largest = plan.full_scale_dps;
    let measured = bound;
    for _ in 0..formats.passes(plan) {
        let mut next = measured;
        for term in plan.terms.iter().filter(|t| t.is_on_rate()) {
            let (share, error) = on_rate(formats, term, largest);
            next += bound * 3.0 * share + largest * error + formats.sum_lsb_dps() / 2.0;
        }
        bound = next;
    }
    (bound + rate_lsb / 2.0) * SECOND_ORDER
}

fn on_bias(plan: &Plan, formats: &Formats, term: &Term) -> f64 {
    let half = formats.sum_lsb_dps() / 2.0;
    let gain_half = half * pow2(-GAIN_BITS);
    let half_of = |bits: i32| pow2(-bits - 1);
    let product_half = half_of(PRODUCT_BITS);
    let d = |input: usize| pow2(-formats.input_bits(input));
    let inputs: f64 = {
        let one = Plan {
            terms: vec![term.clone()],
            ..plan.clone()
        };
        let all = 0..plan.inputs.len();
        all.map(|k| slope_dps(&one, k) * d(k)).sum()
    };
    // What a state and its rates add: s / a, and what q does, for a range of 2 `size`; and `read`, the
    // rounding of what is read from it.
    let state = |gain: f64, tau_s: f64, size: f64, from: i32, read: f64| {
        let approach = Approach::new(plan, formats, tau_s, gain * size.max(1.0));
        let a = approach.a as f64 * pow2(-approach.fraction_bits);
        let s = half_of(approach.state_bits.max(from));
        let q = half_of(approach.fraction_bits);
        gain.abs() * (s / a + 4.0 * size * q / a + read)
    };
    // Knot and blend, on x and on y.
    let curves = |gain: f64| gain.abs() * 2.0 * pow2(-lagged_curve_bits(formats, gain));
    match term {
        Term::Product { factors, gain_dps } => {
            let count: u32 = factors.iter().map(|(_, p)| *p).sum();
            let rounded = gain_dps.abs() * f64::from(count.saturating_sub(1)) * product_half;
            gain_half + inputs + rounded + half
        }
        Term::Lag {
            gain_dps,
            input,
            tau_s,
            ..
        } => {
            let from = formats.input_bits(*input);
            2.0 * gain_half + inputs + state(*gain_dps, *tau_s, 1.0, from, product_half) + half
        }
        Term::LagOfCurve {
            gain_dps,
            values,
            tau_s,
            ..
        } => {
            let size = largest(values);
            let from = lagged_curve_bits(formats, *gain_dps);
            let own = state(*gain_dps, *tau_s, size, from, product_half);
            2.0 * size * gain_half + inputs + curves(*gain_dps) + own + half
        }
        Term::CurveOfLag {
            gain_dps,
            input,
            values,
            tau_s,
            ..
        } => {
            let from = formats.input_bits(*input);
            // What y is off by, c(y) is by at most its steepest slope times that.
            let gain = gain_dps * steepest(values);
            let own = state(gain, *tau_s, 1.0, from, half_of(from));
            2.0 * largest(values) * gain_half + inputs + curves(*gain_dps) + own + half
        }
        Term::Slope { .. } => 2.0 * gain_half + inputs + half,
        Term::Decay { gain_dps, tau_s } => {
            gain_half + state(*gain_dps, *tau_s, 1.0, 0, product_half) + half
        }
        Term::Curve { values_dps, input } => steepest(values_dps) * d(*input) + 2.0 * half,
        Term::Step { .. } => half,
        Term::ScaleBy { .. } | Term::Cubic { .. } | Term::Even { .. } => 0.0,
    }
}

/// The largest k of a term on the rate, and its error.
fn on_rate(formats: &Formats, term: &Term, largest: f64) -> (f64, f64) {
    let c = constant(formats, term).unwrap_or(0.0).abs();
    let half = pow2(-share_bits(formats) - 1);
    let u = largest * pow2(-formats.rate_exponent());
    match term {
        Term::ScaleBy {
            input: Some(input),
            s1,
            s2,
            ..
        } => {
            // Coefficients and casts: two for each power of x, and s0.
            let roundings = if *s2 == 0.0 { 3.0 } else { 5.0 };
            let x = (s1.abs() + 2.0 * s2.abs()) * pow2(-formats.input_bits(*input));
            (c + (s1.abs() + s2.abs()), roundings * half + x)
        }
        Term::Even {
            absolute: false, ..
        } => (c * u, half * (1.0 + u)),
        Term::Cubic { .. } => {
            let square = pow2(-PRODUCT_BITS - 1);
            (c * u * u, half * (1.0 + u * u) + c * square)
        }
        _ => (c, half),
    }
}
