//! The terms with a state that is a number: lags, decays, relays.

use super::curve::Curve;
use super::formats::{Formats, PRODUCT_BITS, bits_for, largest, steepest};
use super::plan::Plan;
use super::terms::{Gain, exact, raw};
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::cast::Cast;

/// Fewest significant bits of a state's rate of decay.
const RATE_BITS: i32 = 16;

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
    Curve(Box<Curve>),
}

/// What a lag follows, with its word, and what of it goes into the rate.
#[derive(Debug, Clone)]
pub struct Following {
    /// What.
    pub of: Followed,
    /// Fraction bits.
    pub from: i32,
    /// The least and the largest word, raw.
    pub limits: (i128, i128),
    /// What the gain is multiplied by where the state's word is chosen: how much an error of the state is
    /// before the gain. It grows with the range of the state, or with the slope of a curve of it.
    pub weight: f64,
    /// The curve of x and y whose difference is taken, in place of theirs.
    pub through: Option<Box<Curve>>,
}

impl Following {
    /// An input.
    pub fn input(formats: &Formats, input: usize) -> Self {
        let from = formats.input_bits(input);
        Following {
            of: Followed::Input(input),
            from,
            limits: (-(1i128 << from), (1i128 << from) - 1),
            weight: 1.0,
            through: None,
        }
    }

    /// A curve through these values.
    pub fn curve(curve: Box<Curve>, values: &[f64]) -> Self {
        Following {
            from: curve.fraction_bits(),
            limits: curve.range(),
            of: Followed::Curve(curve),
            weight: largest(values).max(1.0),
            through: None,
        }
    }

    /// The same, the difference taken of a curve through these values.
    pub fn read_through(self, curve: Box<Curve>, values: &[f64]) -> Self {
        Following {
            weight: steepest(values),
            through: Some(curve),
            ..self
        }
    }
}

/// What the gain of a lag is on.
#[derive(Debug, Clone)]
pub enum Taken {
    /// x - y, to at most [`PRODUCT_BITS`] fraction bits.
    Difference(Cast),
    /// c(x) - c(y).
    OfCurve {
        /// c.
        curve: Box<Curve>,
        /// y to the word of x, which c reads.
        reading: Cast,
    },
}

impl Taken {
    /// For a state with `state` fraction bits.
    fn new(through: Option<Box<Curve>>, state: i32, from: i32) -> Self {
        match through {
            None => Taken::Difference(exact(
                "correction.lag_difference",
                state,
                state.min(PRODUCT_BITS),
            )),
            Some(curve) => Taken::OfCurve {
                curve,
                reading: exact("correction.lag_reading", state, from),
            },
        }
    }

    /// Fraction bits of the result.
    fn fraction_bits(&self) -> i32 {
        match self {
            Taken::Difference(cast) => cast.target.fraction_bits,
            Taken::OfCurve { curve, .. } => curve.fraction_bits(),
        }
    }

    fn casts_mut(&mut self) -> Vec<&mut Cast> {
        match self {
            Taken::Difference(cast) => vec![cast],
            Taken::OfCurve { curve, reading } => {
                let mut casts = curve.casts_mut();
                casts.push(reading);
                casts
            }
        }
    }

    /// The result for x, the same x with the state's fraction bits, and y.
    #[inline(always)]
    fn of<A: Arithmetic>(&self, ar: &A, x: A::Word, [aligned, y]: [A::Word; 2]) -> A::Word {
        match self {
            Taken::Difference(cast) => {
                let rest = ar.sub(aligned, y);
                ar.cast(rest, cast, &[rest])
            }
            Taken::OfCurve { curve, reading } => {
                // y is held within the range of x, so that its word is one of x.
                let behind = ar.cast(y, reading, &[y]);
                ar.sub(curve.value(ar, x), curve.value(ar, behind))
            }
        }
    }
}

/// Fraction bits of a curve that a lag follows or is read through: finer than the sum once the gain is on it.
pub(super) fn lagged_curve_bits(formats: &Formats, gain_dps: f64) -> i32 {
    let wanted = formats.sum_fraction_bits + 2 - bits_for(gain_dps.abs());
    wanted.clamp(RATE_BITS, PRODUCT_BITS)
}

/// gain (x - y) or gain (c(x) - c(y)); y' = y + cast(a (x0 - y) + b (x - x0)), x0 the input before.
#[derive(Debug, Clone)]
pub struct Lag {
    /// Position in the state.
    pub slot: usize,
    /// x.
    pub of: Followed,
    /// Whether the state outlives a restart.
    pub kept: bool,
    /// The least and the largest state, raw: those of x.
    pub limits: (i128, i128),
    /// The input to the state's fraction bits.
    align: Cast,
    approach: Approach,
    /// What is added to the state.
    update: Cast,
    taken: Taken,
    gain: Gain,
}

impl Lag {
    /// Chooses the state's word for the gain, and the rates for what the whole range does.
    pub fn new(
        plan: &Plan,
        formats: &Formats,
        what: Following,
        gain_dps: f64,
        tau_s: f64,
        slot: usize,
    ) -> Self {
        let mut approach = Approach::new(plan, formats, tau_s, gain_dps * what.weight);
        approach.state_bits = approach.state_bits.max(what.from);
        let state = approach.state_bits;
        let shift = state - what.from;
        let taken = Taken::new(what.through, state, what.from);
        Lag {
            slot,
            of: what.of,
            kept: false,
            align: exact("correction.lag_input", what.from, state),
            approach,
            update: exact("correction.lag", state + approach.fraction_bits, state),
            limits: (what.limits.0 << shift, what.limits.1 << shift),
            gain: Gain::new(gain_dps, taken.fraction_bits(), formats),
            taken,
        }
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        let mut casts = match &mut self.of {
            Followed::Curve(curve) => curve.casts_mut(),
            Followed::Input(_) => Vec::new(),
        };
        casts.extend([&mut self.align, &mut self.update]);
        casts.extend(self.taken.casts_mut());
        casts.push(&mut self.gain.out);
        casts
    }

    /// The term for x; `lag` is y and x0. At a fresh start y = x0 = x.
    #[inline(always)]
    pub fn term<A: Arithmetic>(
        &self,
        ar: &A,
        lag: &mut [A::Word; 2],
        fresh: A::Truth,
        x: A::Word,
    ) -> A::Word {
        let both = self.follow(ar, lag, fresh, x);
        self.gain.times(ar, self.taken.of(ar, x, both))
    }

    /// Moves the state to x; x and y with the state's fraction bits.
    #[inline(always)]
    fn follow<A: Arithmetic>(
        &self,
        ar: &A,
        lag: &mut [A::Word; 2],
        fresh: A::Truth,
        x: A::Word,
    ) -> [A::Word; 2] {
        let x = ar.cast(x, &self.align, &[x]);
        let [y, before] = lag.map(|word| ar.select(fresh, x, word));
        let bits = self.approach.fraction_bits;
        let to_input = ar.mul(ar.constant(self.approach.a, bits), ar.sub(before, y));
        let with_input = ar.mul(ar.constant(self.approach.b, bits), ar.sub(x, before));
        let moved = ar.add(to_input, with_input);
        let moved = ar.cast(moved, &self.update, &[to_input, with_input]);
        // The state is a mean of inputs; the limit only holds what rounding adds at the ends.
        let (low, high) = self.limits;
        let y = ar.limit(ar.add(y, moved), low, high, self.approach.state_bits);
        *lag = [y, x];
        [x, y]
    }
}

/// gain d; d' = d - cast(a d), 1 at power-on.
#[derive(Debug, Clone)]
pub struct Decay {
    /// Position in the state.
    pub slot: usize,
    approach: Approach,
    /// What is taken from the state.
    update: Cast,
    /// d to at most [`PRODUCT_BITS`] fraction bits.
    reading: Cast,
    gain: Gain,
}

impl Decay {
    /// Chooses the state's word for the gain.
    pub fn new(plan: &Plan, formats: &Formats, gain_dps: f64, tau_s: f64, slot: usize) -> Self {
        let approach = Approach::new(plan, formats, tau_s, gain_dps);
        let state = approach.state_bits;
        let read = state.min(PRODUCT_BITS);
        Decay {
            slot,
            approach,
            update: exact("correction.decay", state + approach.fraction_bits, state),
            reading: exact("correction.decay_reading", state, read),
            gain: Gain::new(gain_dps, read, formats),
        }
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        vec![&mut self.update, &mut self.reading, &mut self.gain.out]
    }

    /// The largest state, raw: 1.
    pub fn one(&self) -> i128 {
        1 << self.approach.state_bits
    }

    /// The term, and one step of `d`.
    #[inline(always)]
    pub fn step<A: Arithmetic>(&self, ar: &A, d: &mut A::Word, fresh: A::Truth) -> A::Word {
        let a = ar.constant(self.approach.a, self.approach.fraction_bits);
        let loss = ar.cast(ar.mul(a, *d), &self.update, &[*d]);
        let one = ar.constant(self.one(), self.approach.state_bits);
        let next = ar.select(fresh, one, ar.sub(*d, loss));
        // a is at most 1, so that d never leaves 0 to 1: what intervals lose.
        *d = ar.within(next, 0, self.one());
        self.gain.times(ar, ar.cast(*d, &self.reading, &[*d]))
    }
}

/// A relay.
#[derive(Debug, Clone)]
pub struct Relay {
    /// Position in the state.
    pub slot: usize,
    /// x.
    pub input: usize,
    /// Its fraction bits.
    pub input_bits: i32,
    /// On from here, raw.
    pub on: i128,
    /// Off below, raw.
    pub off: i128,
    /// At power-on, on from here, raw.
    pub centre: i128,
    /// Never off again.
    pub once: bool,
    /// In the sum's unit, raw.
    pub gain: i128,
}

impl Relay {
    /// The relay (1 = on) once the input is x.
    #[inline(always)]
    pub fn moved<A: Arithmetic>(
        &self,
        ar: &A,
        relay: A::Word,
        fresh: A::Truth,
        x: A::Word,
    ) -> A::Word {
        let (zero, one) = (ar.constant(0, 0), ar.constant(1, 0));
        let below = |level| ar.is_negative(ar.sub(x, ar.constant(level, self.input_bits)));
        if self.once {
            return ar.select(below(self.on), relay, one);
        }
        let at_start = ar.select(below(self.centre), zero, one);
        let before = ar.select(fresh, at_start, relay);
        let held = ar.select(below(self.on), before, one);
        ar.select(below(self.off), zero, held)
    }
}
