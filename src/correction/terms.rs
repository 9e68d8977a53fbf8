//! The terms of a correction, compiled: constants, casts and where their state lies.

use super::curve::Curve;
use super::formats::{Formats, PRODUCT_BITS, slope_gain_dps};
pub use super::gain::Gain;
pub(super) use super::gain::{GAIN_BITS, exact, raw};
use super::plan::{Plan, Term};
use super::states::{Decay, Following, Lag, Relay, lagged_curve_bits};
use crate::numeric::arithmetic::Ring;
use crate::numeric::cast::Cast;

/// A term on the bias.
#[derive(Debug, Clone)]
pub enum OnBias {
    /// A constant.
    Constant(i128),
    /// Inputs, multiplied one after the other, and the gain.
    Product {
        /// One entry for each factor, powers as repetitions.
        inputs: Vec<usize>,
        /// After each product but the gain's.
        products: Vec<Cast>,
        /// Of the last.
        gain: Gain,
    },
    /// A first-order lag.
    Lag(Box<Lag>),
    /// gain (x - x `rows` ago).
    Slope {
        /// Position in the state.
        slot: usize,
        /// x.
        input: usize,
        /// Readings.
        rows: usize,
        /// In which the past is kept.
        ring: Ring,
        /// On the difference.
        gain: Gain,
    },
    /// A decay since power-on.
    Decay(Box<Decay>),
    /// A curve in the sum's unit.
    Curve(Box<Curve>),
    /// A relay.
    Step(Relay),
}

/// Positions in the state that are given away.
#[derive(Debug, Default)]
pub struct Slots {
    lags: usize,
    slopes: usize,
    decays: usize,
    steps: usize,
    curves: usize,
}

fn next(counter: &mut usize) -> usize {
    *counter += 1;
    *counter - 1
}

impl OnBias {
    /// Compiles a term; `None` for one on the rate.
    pub fn new(plan: &Plan, formats: &Formats, term: &Term, slots: &mut Slots) -> Option<Self> {
        let sum = formats.sum_fraction_bits;
        Some(match term {
            Term::Product { gain_dps, factors } => product(formats, *gain_dps, factors),
            Term::Lag {
                gain_dps,
                input,
                tau_s,
                kept,
            } => {
                let x = Following::input(formats, *input);
                lag(plan, formats, x, (*gain_dps, *tau_s, *kept), slots)
            }
            Term::LagOfCurve {
                gain_dps,
                input,
                values,
                tau_s,
                kept,
            } => {
                let bits = lagged_curve_bits(formats, *gain_dps);
                let x =
                    Following::curve(curve((plan, formats), *input, values, bits, slots), values);
                lag(plan, formats, x, (*gain_dps, *tau_s, *kept), slots)
            }
            Term::CurveOfLag {
                gain_dps,
                input,
                values,
                tau_s,
                kept,
            } => {
                let bits = lagged_curve_bits(formats, *gain_dps);
                let of = curve((plan, formats), *input, values, bits, slots);
                let x = Following::input(formats, *input).read_through(of, values);
                lag(plan, formats, x, (*gain_dps, *tau_s, *kept), slots)
            }
            Term::Slope {
                gain_dps_s,
                input,
                rows,
            } => {
                let bits = formats.input_bits(*input);
                let gain = slope_gain_dps(plan, *gain_dps_s, *rows);
                OnBias::Slope {
                    slot: next(&mut slots.slopes),
                    input: *input,
                    rows: *rows as usize,
                    ring: Ring::cyclic(bits as u32 + 1, bits),
                    gain: Gain::new(gain, bits, formats),
                }
            }
            Term::Decay { gain_dps, tau_s } => {
                let slot = next(&mut slots.decays);
                OnBias::Decay(Box::new(Decay::new(plan, formats, *gain_dps, *tau_s, slot)))
            }
            Term::Curve { input, values_dps } => {
                OnBias::Curve(curve((plan, formats), *input, values_dps, sum, slots))
            }
            Term::Step {
                gain_dps,
                input,
                centre,
                gap,
                once,
            } => {
                let input_bits = formats.input_bits(*input);
                OnBias::Step(Relay {
                    slot: next(&mut slots.steps),
                    input: *input,
                    input_bits,
                    on: raw(centre + gap / 2.0, input_bits),
                    off: raw(centre - gap / 2.0, input_bits),
                    centre: raw(*centre, input_bits),
                    once: *once,
                    gain: raw(*gain_dps, sum),
                })
            }
            Term::ScaleBy { .. } | Term::Cubic { .. } | Term::Even { .. } => return None,
        })
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        match self {
            OnBias::Constant(_) | OnBias::Step(_) => Vec::new(),
            OnBias::Product { products, gain, .. } => {
                products.iter_mut().chain([&mut gain.out]).collect()
            }
            OnBias::Lag(lag) => lag.casts_mut(),
            OnBias::Slope { gain, .. } => vec![&mut gain.out],
            OnBias::Decay(decay) => decay.casts_mut(),
            OnBias::Curve(curve) => curve.casts_mut(),
        }
    }
}

/// The next curve, its results with `fraction_bits`.
fn curve(
    (plan, formats): (&Plan, &Formats),
    input: usize,
    values: &[f64],
    fraction_bits: i32,
    slots: &mut Slots,
) -> Box<Curve> {
    let (number, input_bits) = (next(&mut slots.curves), formats.input_bits(input));
    let name = plan.input_names().get(input).copied().unwrap_or_default();
    let over = (input, name);
    Box::new(Curve::new(number, over, input_bits, values, fraction_bits))
}

/// The next lag: gain, deg/s, time constant, s, and whether its state outlives a restart.
fn lag(
    plan: &Plan,
    formats: &Formats,
    what: Following,
    (gain_dps, tau_s, kept): (f64, f64, bool),
    slots: &mut Slots,
) -> OnBias {
    let slot = next(&mut slots.lags);
    let mut lag = Lag::new(plan, formats, what, gain_dps, tau_s, slot);
    lag.kept = kept;
    OnBias::Lag(Box::new(lag))
}

fn product(formats: &Formats, gain_dps: f64, factors: &[(usize, u32)]) -> OnBias {
    let repeated = factors
        .iter()
        .flat_map(|(input, power)| (0..*power).map(|_| *input));
    let inputs: Vec<usize> = repeated.collect();
    let Some(first) = inputs.first() else {
        return OnBias::Constant(raw(gain_dps, formats.sum_fraction_bits));
    };
    let mut bits = formats.input_bits(*first);
    let mut products = Vec::new();
    for input in inputs.iter().skip(1) {
        let from = bits + formats.input_bits(*input);
        bits = from.min(PRODUCT_BITS);
        products.push(exact("correction.product", from, bits));
    }
    OnBias::Product {
        inputs,
        products,
        gain: Gain::new(gain_dps, bits, formats),
    }
}
