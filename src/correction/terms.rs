//! The terms of a correction, compiled: constants, casts and where their state lies.

use super::curve::Curve;
use super::formats::{Formats, PRODUCT_BITS, bits_for, slope_gain_dps};
use super::plan::{Plan, Term};
use crate::numeric::arithmetic::{Arithmetic, Ring};
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::{Rounding, pow2};

/// Fewest significant bits of a state's rate of decay.
const RATE_BITS: i32 = 16;
/// Fraction bits that a gain has beyond those of the sum.
pub(super) const GAIN_BITS: i32 = 2;

/// A cast to so many fraction bits, to nearest, that never limits: proved ranges give the width.
pub(super) fn exact(label: &'static str, from: i32, to: i32) -> Cast {
    let target = Target::signed(127, to);
    Cast::new(Label::of(label), from, 0, target, Rounding::HalfUp, None)
}

/// The integer nearest to `value` in LSBs of 2^-`fraction_bits`.
fn raw(value: f64, fraction_bits: i32) -> i128 {
    (value * pow2(fraction_bits)).round() as i128
}

/// A constant times a word, in the sum's unit.
#[derive(Debug, Clone)]
pub struct Gain {
    raw: i128,
    fraction_bits: i32,
    pub(super) out: Cast,
}

impl Gain {
    /// `value` times a word with `word_bits` fraction bits.
    fn new(value: f64, word_bits: i32, formats: &Formats) -> Self {
        let sum = formats.sum_fraction_bits;
        let fraction_bits = sum + GAIN_BITS;
        Gain {
            raw: raw(value, fraction_bits),
            fraction_bits,
            out: exact("correction.gain", fraction_bits + word_bits, sum),
        }
    }

    /// The product, rounded once.
    #[inline(always)]
    pub fn times<A: Arithmetic>(&self, ar: &A, word: A::Word) -> A::Word {
        let product = ar.mul(ar.constant(self.raw, self.fraction_bits), word);
        ar.cast(product, &self.out, &[word])
    }
}

/// How fast a state approaches its input in one period: 1 - exp(-T / tau).
#[derive(Debug, Clone, Copy)]
pub struct Approach {
    /// 1 - exp(-T / tau), raw.
    pub a: i128,
    /// 1 - (tau / T) (1 - exp(-T / tau)), raw: the share of the input's own step over the period, if
    /// it is linear in between.
    pub b: i128,
    /// Fraction bits of both.
    pub fraction_bits: i32,
    /// Fraction bits of the state.
    pub state_bits: i32,
}

impl Approach {
    /// For a state of which `gain_dps` goes into the rate. Its word is so fine that neither rounding,
    /// which a state at rest accumulates to half an LSB over a, nor the rounding of a and b shows.
    pub fn new(plan: &Plan, formats: &Formats, tau_s: f64, gain_dps: f64) -> Self {
        let (a, b) = shares(plan.period_s / tau_s);
        let allowed = formats.sum_lsb_dps() / gain_dps.abs().max(f64::MIN_POSITIVE);
        let significant = bits_for(allowed / 4.0).clamp(RATE_BITS, 24);
        let fraction_bits = significant + bits_for(a);
        Approach {
            a: raw(a, fraction_bits).max(1),
            b: raw(b, fraction_bits),
            fraction_bits,
            state_bits: bits_for(allowed * 2.0 * a).clamp(RATE_BITS, 40),
        }
    }
}

/// 1 - exp(-h) and 1 - (1 - exp(-h)) / h.
pub(super) fn shares(h: f64) -> (f64, f64) {
    let a = -(-h).exp_m1();
    // Below, the difference of two numbers close to 1 would lose its digits.
    let b = if h < 1e-3 {
        h * (0.5 - h * (1.0 / 6.0 - h / 24.0))
    } else {
        1.0 - a / h
    };
    (a, b)
}

/// What a lag follows.
#[derive(Debug, Clone)]
pub enum Followed {
    /// An input.
    Input(usize),
    /// A curve of one.
    Curve(Curve),
}

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
    /// gain (x - y); y' = y + cast(a (x0 - y) + b (x - x0)), x0 the input before.
    Lag {
        /// Position in the state.
        slot: usize,
        /// x.
        of: Followed,
        /// The input to the state's fraction bits.
        align: Cast,
        /// The constants.
        approach: Approach,
        /// What is added to the state.
        update: Cast,
        /// x - y to at most [`PRODUCT_BITS`] fraction bits.
        difference: Cast,
        /// The state's limits, raw: those of x.
        limits: (i128, i128),
        /// The gain.
        gain: Gain,
    },
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
    /// gain d; d' = d - cast(a d), 1 at power-on.
    Decay {
        /// Position in the state.
        slot: usize,
        /// The constants.
        approach: Approach,
        /// What is taken from the state.
        update: Cast,
        /// d to at most [`PRODUCT_BITS`] fraction bits.
        reading: Cast,
        /// The gain.
        gain: Gain,
    },
    /// A curve in the sum's unit.
    Curve(Curve),
    /// A relay.
    Step {
        /// Position in the state.
        slot: usize,
        /// x.
        input: usize,
        /// Its fraction bits.
        input_bits: i32,
        /// On from here, raw.
        on: i128,
        /// Off below, raw.
        off: i128,
        /// At power-on, on from here, raw.
        centre: i128,
        /// Never off again.
        once: bool,
        /// In the sum's unit.
        gain: i128,
    },
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
            } => {
                let from = formats.input_bits(*input);
                let limits = (-(1i128 << from), (1i128 << from) - 1);
                let lag = Lagging {
                    of: Followed::Input(*input),
                    from,
                    limits,
                    size: 1.0,
                };
                lag.compile(plan, formats, *gain_dps, *tau_s, slots)
            }
            Term::LagOfCurve {
                gain_dps,
                input,
                values,
                tau_s,
            } => {
                let size = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                // Twice as fine as the sum once the gain is on it.
                let from = (sum + 2 - bits_for(gain_dps.abs())).clamp(RATE_BITS, PRODUCT_BITS);
                let number = next(&mut slots.curves);
                let input_bits = formats.input_bits(*input);
                let curve = Curve::new(number, *input, input_bits, values, from);
                let lag = Lagging {
                    limits: curve.range(),
                    of: Followed::Curve(curve),
                    from,
                    size,
                };
                lag.compile(plan, formats, *gain_dps, *tau_s, slots)
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
                let approach = Approach::new(plan, formats, *tau_s, *gain_dps);
                let state = approach.state_bits;
                let read = state.min(PRODUCT_BITS);
                OnBias::Decay {
                    slot: next(&mut slots.decays),
                    approach,
                    update: exact("correction.decay", state + approach.fraction_bits, state),
                    reading: exact("correction.decay_reading", state, read),
                    gain: Gain::new(*gain_dps, read, formats),
                }
            }
            Term::Curve { input, values_dps } => {
                let number = next(&mut slots.curves);
                let bits = formats.input_bits(*input);
                OnBias::Curve(Curve::new(number, *input, bits, values_dps, sum))
            }
            Term::Step {
                gain_dps,
                input,
                centre,
                gap,
                once,
            } => {
                let input_bits = formats.input_bits(*input);
                OnBias::Step {
                    slot: next(&mut slots.steps),
                    input: *input,
                    input_bits,
                    on: raw(centre + gap / 2.0, input_bits),
                    off: raw(centre - gap / 2.0, input_bits),
                    centre: raw(*centre, input_bits),
                    once: *once,
                    gain: raw(*gain_dps, sum),
                }
            }
            Term::ScaleBy { .. } | Term::Cubic { .. } | Term::Even { .. } => return None,
        })
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        match self {
            OnBias::Constant(_) | OnBias::Step { .. } => Vec::new(),
            OnBias::Product { products, gain, .. } => {
                products.iter_mut().chain([&mut gain.out]).collect()
            }
            OnBias::Lag {
                of,
                align,
                update,
                difference,
                gain,
                ..
            } => {
                let mut casts = match of {
                    Followed::Curve(curve) => curve.casts_mut(),
                    Followed::Input(_) => Vec::new(),
                };
                casts.extend([align, update, difference, &mut gain.out]);
                casts
            }
            OnBias::Slope { gain, .. } => vec![&mut gain.out],
            OnBias::Decay {
                update,
                reading,
                gain,
                ..
            } => vec![update, reading, &mut gain.out],
            OnBias::Curve(curve) => curve.casts_mut(),
        }
    }
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

/// A lag before its words are chosen.
struct Lagging {
    of: Followed,
    /// Fraction bits of what it follows.
    from: i32,
    /// Of what it follows, raw.
    limits: (i128, i128),
    /// The largest magnitude of it.
    size: f64,
}

impl Lagging {
    fn compile(
        self,
        plan: &Plan,
        formats: &Formats,
        gain_dps: f64,
        tau_s: f64,
        slots: &mut Slots,
    ) -> OnBias {
        // The state's word is chosen for the gain, its rate for what the whole range does.
        let mut approach = Approach::new(plan, formats, tau_s, gain_dps * self.size.max(1.0));
        approach.state_bits = approach.state_bits.max(self.from);
        let state = approach.state_bits;
        let read = state.min(PRODUCT_BITS);
        let (low, high) = self.limits;
        let shift = state - self.from;
        OnBias::Lag {
            slot: next(&mut slots.lags),
            of: self.of,
            align: exact("correction.lag_input", self.from, state),
            approach,
            update: exact("correction.lag", state + approach.fraction_bits, state),
            difference: exact("correction.lag_difference", state, read),
            limits: (low << shift, high << shift),
            gain: Gain::new(gain_dps, read, formats),
        }
    }
}
