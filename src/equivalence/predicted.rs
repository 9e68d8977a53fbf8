//! The root mean square error of each node by the theory of quantisation, from the design and from second
//! moments of the signals; no observed error goes in.
//!
//! - **Table.** The error of each phase is known; what is predicted is its mean square over the phases that
//!   the oscillator visits ([`Spread`]).
//! - **Product.** e = code * table error + own rounding. The code's mean square at phase theta is m0 + mc cos 2
//!   theta + ms sin 2 theta (a tone and noise), weighed with the table error's. The own rounding is that of
//!   uniformly spread low bits; an entry that ends in zero bits leaves fewer.
//! - **Decimator.** What the table error has in common with the carrier turns and scales (I, Q): e_I = (I alpha
//!   + Q beta) / A, an error of the signal's own shape. The rest, if the decimator's zeros do not fall on it, and the products'
//!   roundings are white there: times the sum of the squared taps. Own rounding added.
//! - **CORDIC.** e_phase = (I e_Q - Q e_I) / (2 pi r^2) + an angle left that is uniform within +-a_(n-1) + the table's
//!   roundings + (n - 1) floors, each of variance 1/3 LSB^2 with either sign. e_magnitude likewise along r.
//! - **Compensation.** Horner's slopes from the variable's error, its casts' roundings from where they arise.
//!
//! A condition that does not hold is a flag, and the figure is left out:

use super::activity::{Activity, PHASE_BINS};
use super::node::Node;
use super::probe::Seen;
use super::quantisation::{FEW_PHASES, Moments, Spread, TableErrors, cic_noise_gain, spread};
use crate::design::{Compensation, CompensationInput, Design};
use crate::numeric::constants;
use crate::numeric::format::pow2;
use std::f64::consts::TAU;

/// What theory says of a node.
#[derive(Debug, Clone, Default)]
pub struct Prediction {
    /// rms of fixed - float, in the node's unit.
    pub rms: Option<f64>,
    /// rms of the node's own rounding, LSB.
    pub local_rms_lsb: Option<f64>,
    /// Conditions that do not hold.
    pub flags: Vec<&'static str>,
}

/// Every flag and what it means.
pub const FLAGS: [(&str, &str); 12] = [
    (
        "coherent_nco",
        "the oscillator visits few phases again and again: its table errors are lines, not noise, and products take few values",
    ),
    (
        "near_coherent_nco",
        "the phases drift slowly over few clusters, or the run is short: their spread is not known",
    ),
    (
        "few_words",
        "too few different words reach the rounding for its error to be uniform",
    ),
    (
        "carrier_lines",
        "what the table error adds beside the carrier is not small, and is not white",
    ),
    (
        "carrier_correlated",
        "errors that follow the signal reach this node on two ways, and are not independent",
    ),
    (
        "idle_input",
        "the value moves too little from sample to sample for a uniform rounding error (dead band)",
    ),
    (
        "weak_vector",
        "the drive vector is so short, or its length varies so much, that the phase error is not linear in it",
    ),
    ("closed_loop", "the phase loop feeds the error back"),
    (
        "open_loop_integral",
        "an integral of the error: it grows with time",
    ),
    ("overflow", "this node or one before it has overflowed"),
    (
        "phase_cut",
        "fixed and float phase lie on both sides of the cut at half a turn on some rows",
    ),
    (
        "few_rows",
        "fewer than 1000 words: the observed figure itself is uncertain",
    ),
];

/// Different words that make the mean square of a uniform error certain to 10 %: with n words its
/// rms has a relative deviation of 0.45 / sqrt(n); three of them and a reserve of 2 for unequal weights.
const ENOUGH_WORDS: f64 = 2000.0;
/// Words that make an observed rms certain to 10 %: 0.71 / sqrt(n) for normal errors, three deviations, reserve.
const ENOUGH_ROWS: u64 = 1000;
/// Share of a mean square that may be of doubtful whiteness: it then moves the rms by less than 5 %.
const DOUBTFUL: f64 = 0.1;
/// Share of samples that have to move.
const MOVING: f64 = 0.5;

/// Predictions for every node of a run, in its order.
pub fn predict(design: &Design, seen: &Seen) -> Vec<Prediction> {
    let theory = Theory::new(design, seen);
    let mut all = vec![Prediction::default(); seen.nodes.len()];
    theory.fast(&mut all);
    let inputs = theory.decimators(&mut all);
    let phase = theory.cordic(&mut all, &inputs);
    theory.compensation(&mut all, &inputs, &phase);
    theory.loops(&mut all);
    theory.general(&mut all);
    all
}

/// Mean square errors of a value with what of it follows the signal.
#[derive(Debug, Clone, Default)]
struct Channel {
    /// White part, variance.
    white: f64,
    /// Mean.
    mean: f64,
    /// Mean square of the part that follows the signal.
    following: f64,
    flags: Vec<&'static str>,
}

/// The phase error by bins of the phase.
#[derive(Debug, Clone, Default)]
struct PhaseError {
    /// Mean square, turns^2, by bin.
    square: Vec<f64>,
    /// Mean square of the part that follows the signal, turns^2.
    following: f64,
    flags: Vec<&'static str>,
}

struct Theory<'a> {
    design: &'a Design,
    seen: &'a Seen,
    activity: &'a Activity,
    spread: Spread,
    table: TableErrors,
    /// g' = (R M)^N / 2^G.
    gain: f64,
    /// Sum of the squared taps, all taps adding up to g'.
    noise_gain: f64,
}

fn set(all: &mut [Prediction], at: usize, rms: Option<f64>, flags: &[&'static str]) {
    if let Some(p) = all.get_mut(at) {
        for flag in flags {
            if !p.flags.contains(flag) {
                p.flags.push(flag);
            }
        }
        p.rms = rms.filter(|_| {
            flags
                .iter()
                .all(|f| *f == "coherent_nco" || *f == "few_rows")
        });
    }
}

impl<'a> Theory<'a> {
    fn new(design: &'a Design, seen: &'a Seen) -> Self {
        let d = &design.circuit.decimator;
        let samples = seen.nodes.get(seen.places.sine).map_or(0, |n| n.count);
        let spread = spread(design, samples);
        let width = d.ratio as usize * d.differential_delay as usize;
        let gain = (width as f64).powi(d.stages as i32) * pow2(-(d.gain_bits() as i32));
        Theory {
            design,
            seen,
            activity: &seen.activity,
            spread,
            table: TableErrors::new(design, spread),
            gain,
            noise_gain: cic_noise_gain(d.stages, width) * gain * gain,
        }
    }

    fn node(&self, at: usize) -> Option<&Node> {
        self.seen.nodes.get(at)
    }

    fn mean_square(&self, at: usize) -> f64 {
        self.node(at).map_or(0.0, Node::mean_square_value)
    }

    fn nco_flags(&self) -> Vec<&'static str> {
        match self.spread {
            Spread::Coherent(period) if period <= FEW_PHASES => vec!["coherent_nco"],
            Spread::Coherent(_) | Spread::Uniform => Vec::new(),
            Spread::Unknown => vec!["near_coherent_nco"],
        }
    }

    /// Mean square of a product's error but its own rounding: code * table error; and its mean.
    fn carried(&self, channel: usize) -> (f64, f64) {
        let pair = channel / 2;
        let at = self.seen.places.product + 2 * pair;
        let a2 = self.table.amplitude * self.table.amplitude;
        let (i, q) = (self.mean_square(at), self.mean_square(at + 1));
        let count = self.node(at).map_or(1, |n| n.count).max(1) as f64;
        let cross = self.activity.product_cross[pair] / count;
        // E[d^2 | theta] = m0 + mc cos 2 theta + ms sin 2 theta, from E[d^2 sin^2] = i / A^2 and so on.
        let (m0, mc, ms) = ((i + q) / a2, 2.0 * (q - i) / a2, 4.0 * cross / a2);
        let e = self.table.square[channel % 2];
        let square = (m0 * e[0] + mc * e[1] + ms * e[2]).max(0.0);
        (square, m0)
    }

    /// Own rounding of a product, in its unit.
    fn product_rounding(&self, channel: usize) -> Moments {
        let circuit = &self.design.circuit;
        let product = circuit.demodulator.product;
        let exact = circuit.adc.format.fraction_bits + circuit.nco.table.fraction_bits;
        let bits = exact as i32 - product.format.fraction_bits as i32;
        self.table
            .product_rounding(channel % 2, product.rounding, bits)
    }

    fn rounding_is_spread(&self, channel: usize) -> bool {
        self.product_rounding(channel).square == 0.0
            || self.activity.different_words(channel / 2) >= ENOUGH_WORDS
    }

    fn fast(&self, all: &mut [Prediction]) {
        let places = self.seen.places;
        let nco = self.nco_flags();
        for part in 0..2 {
            set(all, places.sine + part, Some(self.table.rms(part)), &nco);
        }
        let lsb = self.design.circuit.demodulator.product.format.lsb();
        for channel in 0..4 {
            let at = places.product + channel;
            let own = self.product_rounding(channel);
            let mut flags = nco.clone();
            let spread = self.rounding_is_spread(channel);
            if !spread {
                flags.push("few_words");
            }
            let square = self.carried(channel).0 + own.square * lsb * lsb;
            set(all, at, Some(square.sqrt()), &flags);
            if let Some(p) = all.get_mut(at) {
                p.local_rms_lsb = (spread && own.square > 0.0).then(|| own.square.sqrt());
            }
        }
    }

    /// [mean I^2, mean Q^2, mean I Q] of a pair's float outputs.
    fn outputs(&self, pair: usize) -> [f64; 3] {
        let at = self.seen.places.decimator + 2 * pair;
        let count = self.node(at).map_or(1, |n| n.count).max(1) as f64;
        [
            self.mean_square(at),
            self.mean_square(at + 1),
            self.activity.output_cross[pair] / count,
        ]
    }

    fn decimators(&self, all: &mut [Prediction]) -> [Channel; 4] {
        std::array::from_fn(|channel| self.decimator(all, channel))
    }

    fn decimator(&self, all: &mut [Prediction], channel: usize) -> Channel {
        let circuit = &self.design.circuit;
        let at = self.seen.places.decimator + channel;
        let output = circuit.decimator.output;
        let product = circuit.demodulator.product.format;
        let (own_lsb, product_lsb) = (output.format.lsb(), product.lsb());
        let rounding = self.product_rounding(channel);
        let bits = product.fraction_bits as i32 + circuit.decimator.gain_bits() as i32
            - output.format.fraction_bits as i32;
        let own = Moments::of_rounding(output.rounding, bits);

        let [ii, qq, iq] = self.outputs(channel / 2);
        let amplitude = self.table.amplitude;
        let [alpha, beta] = self.table.synchronous[channel % 2].map(|c| c / amplitude);
        let following = alpha * alpha * ii + beta * beta * qq + 2.0 * alpha * beta * iq;
        // The tone's power in the codes, from the outputs: I = A a g' / 2.
        let (carried, code_square) = self.carried(channel);
        let tone = 2.0 * (ii + qq) / (amplitude * self.gain).powi(2);
        let noise = (code_square - tone).max(0.0) * self.table.square[channel % 2][0];
        let step = i128::from(circuit.nco.tuning_word) * i128::from(circuit.decimator.ratio);
        let in_zeros = step.rem_euclid(1i128 << circuit.nco.phase_bits) == 0;
        let beside = if in_zeros {
            noise
        } else {
            (carried - following / (self.gain * self.gain)).max(0.0)
        };
        let doubtful = beside * self.noise_gain;
        let white = rounding.variance() * product_lsb * product_lsb * self.noise_gain
            + own.variance() * own_lsb * own_lsb
            + doubtful;
        let mean = rounding.mean * product_lsb * self.gain + own.mean * own_lsb;

        let mut flags = self.nco_flags();
        if !self.rounding_is_spread(channel) {
            flags.push("few_words");
        }
        if doubtful > DOUBTFUL * (white + following + mean * mean) {
            flags.push("carrier_lines");
        }
        let moving = self.node(at).is_some_and(|n| n.moving() >= MOVING);
        if own.square > 0.0 && !moving {
            flags.push("idle_input");
        }
        // A mean and what follows the signal have the sign of the signal in common only by chance.
        let square = white + following + mean * mean;
        set(all, at, Some(square.sqrt()), &flags);
        if let Some(p) = all.get_mut(at) {
            p.local_rms_lsb = (own.square > 0.0 && moving).then(|| own.square.sqrt());
        }
        flags.retain(|f| *f != "coherent_nco");
        Channel {
            white,
            mean,
            following,
            flags,
        }
    }

    fn cordic(&self, all: &mut [Prediction], inputs: &[Channel; 4]) -> PhaseError {
        let circuit = &self.design.circuit;
        let cordic = &circuit.cordic;
        let at = self.seen.places.phase;
        let [i, q, ..] = inputs;
        let rows = self.activity.rows.max(1) as f64;
        let inverse_square = self.activity.inverse_square / rows;
        let square_length = self.mean_square(at + 1);
        let mut flags = i.flags.clone();
        flags.extend(q.flags.iter().filter(|f| !i.flags.contains(f)));
        // E[1/r^2] E[r^2] is 1 for a constant length.
        if !(inverse_square * square_length < 1.1) || i.white * inverse_square > 0.01 {
            flags.push("weak_vector");
        }
        let n = f64::from(cordic.iterations - 1);
        let last_rad = pow2(-(cordic.iterations as i32 - 1)).atan();
        let lsb = circuit.decimator.output.format.lsb();
        let fine = lsb * pow2(-(cordic.guard_bits as i32));
        // The vector is on the average 1.6 times as long while it is turned.
        let floors = n / 3.0 * fine * fine / (1.6 * 1.6);
        let angles = constants::arc_tangents(cordic.iterations, cordic.angle_bits);
        let turn = pow2(-(cordic.angle_bits as i32));
        let table: f64 = angles
            .iter()
            .zip(0..)
            .map(|(raw, k)| (*raw as f64 * turn - pow2(-k).atan() / TAU).powi(2))
            .sum();
        let own = (last_rad / TAU).powi(2) / 3.0 + table + floors * inverse_square / (TAU * TAU);
        let steady = self.node(at).is_none_or(|node| {
            let needed = (last_rad / TAU / turn).max(1.0) * 0.25;
            needed > 1.0 && node.moving() < MOVING || node.moving() < MOVING
        });
        if steady {
            flags.push("idle_input");
        }

        let [a_s, b_s] = self.table.synchronous[0].map(|c| c / self.table.amplitude);
        let [a_c, b_c] = self.table.synchronous[1].map(|c| c / self.table.amplitude);
        let inverse = inverse_square.sqrt();
        let mut error = PhaseError {
            square: vec![0.0; PHASE_BINS],
            ..PhaseError::default()
        };
        let (mut phase, mut along) = (0.0, 0.0);
        for (k, share) in self.bins() {
            let (sin, cos) = (bin_turns(k) * TAU).sin_cos();
            let (e_i, e_q) = (cos * a_s + sin * b_s, cos * a_c + sin * b_c);
            let mean_across = (cos * q.mean - sin * i.mean) * inverse;
            let across = cos * e_q - sin * e_i + mean_across;
            let white = cos * cos * q.white + sin * sin * i.white;
            let square = (across * across + white * inverse_square) / (TAU * TAU) + own;
            if let Some(bin) = error.square.get_mut(k) {
                *bin = square;
            }
            phase += share * square;
            error.following += share * across * across / (TAU * TAU);
            let length = square_length.sqrt();
            let shift = (cos * e_i + sin * e_q) * length + cos * i.mean + sin * q.mean;
            along += share * (shift * shift + cos * cos * i.white + sin * sin * q.white);
        }
        set(all, at, Some(phase.sqrt()), &flags);
        let gain: f64 = (0..cordic.iterations as i32)
            .map(|k| (1.0 + pow2(-2 * k)).sqrt())
            .product();
        let constant = constants::cordic_gain(cordic.iterations, cordic.gain_bits) as f64
            * pow2(-(cordic.gain_bits as i32));
        let scale = constant * gain - 1.0;
        let magnitude = along
            + scale * scale * square_length
            + n / 3.0 * (fine / gain).powi(2)
            + lsb * lsb / 12.0;
        set(all, at + 1, Some(magnitude.sqrt()), &flags);
        error.flags = flags;
        error
    }

    /// Phase bins that have rows, with their share.
    fn bins(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let rows = self.activity.rows.max(1) as f64;
        let bins = self.activity.phase_rows.iter().enumerate();
        bins.filter(|(_, n)| **n > 0)
            .map(move |(k, n)| (k, *n as f64 / rows))
    }

    fn compensation(&self, all: &mut [Prediction], inputs: &[Channel; 4], phase: &PhaseError) {
        let Some(c) = &self.design.compensation else {
            return;
        };
        let (Some((first, steps)), Some(bias)) = (self.seen.places.horner, self.seen.places.bias)
        else {
            return;
        };
        if c.input != CompensationInput::Phase {
            return;
        }
        let mut flags = phase.flags.clone();
        let horner = Horner::new(self.design, c);
        let mut sums = vec![0.0; 2 * steps + 1];
        let mut following = 0.0;
        let mut idle = false;
        for (k, share) in self.bins() {
            let p = horner.variable(bin_turns(k));
            let square = phase.square.get(k).copied().unwrap_or(0.0);
            let errors = horner.mean_squares(p, 4.0 * square);
            for (sum, e) in sums.iter_mut().zip(&errors) {
                *sum += share * e;
            }
            let slope = horner.slope(p);
            following += share * slope * slope * 4.0 * phase.following;
        }
        for k in 0..2 * steps {
            let moving = self.node(first + k).is_some_and(|n| n.moving() >= MOVING);
            idle |= !moving;
            set(all, first + k, sums.get(k).map(|s| s.sqrt()), &flags);
            let step = all
                .get_mut(first + k)
                .filter(|_| moving && k.is_multiple_of(2));
            if let Some(p) = step {
                p.local_rms_lsb = Some(horner.rounding(k / 2).square.sqrt()).filter(|r| *r > 0.0);
            }
        }
        let bias_moves = self.node(bias).is_some_and(|n| n.moving() >= MOVING);
        if idle || !bias_moves {
            flags.push("idle_input");
        }
        let bias_square = sums.last().copied().unwrap_or(0.0);
        set(all, bias, Some(bias_square.sqrt()), &flags);
        let own = horner.output;
        if let Some(p) = all.get_mut(bias) {
            p.local_rms_lsb = (own.square > 0.0 && bias_moves).then(|| own.square.sqrt());
        }
        self.rate(all, bias, &inputs[2], (bias_square, following, own), &flags);
    }

    /// The rate's input (sense I) and the rate.
    fn rate(
        &self,
        all: &mut [Prediction],
        bias: usize,
        sense: &Channel,
        (bias_square, bias_following, bias_own): (f64, f64, Moments),
        flags: &[&'static str],
    ) {
        let Some(c) = &self.design.compensation else {
            return;
        };
        let scale = c.rate_full_scale_dps;
        let from = self.design.circuit.decimator.output.format.fraction_bits as i32
            - c.rate_full_scale_exponent();
        let own = Moments::of_rounding(
            c.output.rounding,
            from - c.output.format.fraction_bits as i32,
        );
        let lsb = c.output.format.lsb();
        let moves = self.node(bias + 1).is_some_and(|n| n.moving() >= MOVING);
        let mut input_flags = sense.flags.clone();
        if own.square > 0.0 && !moves {
            input_flags.push("idle_input");
        }
        let mean = sense.mean * scale + own.mean * lsb;
        let following = sense.following * scale * scale;
        let square =
            sense.white * scale * scale + following + mean * mean + own.variance() * lsb * lsb;
        set(all, bias + 1, Some(square.sqrt()), &input_flags);
        if let Some(p) = all.get_mut(bias + 1) {
            p.local_rms_lsb = (own.square > 0.0 && moves).then(|| own.square.sqrt());
        }
        input_flags.extend(flags.iter().filter(|f| !sense.flags.contains(f)));
        // Means and following parts of both may add or cancel.
        let total = square + bias_square;
        let bias_mean = bias_own.mean * lsb;
        let shared = ((following + mean * mean) * (bias_following + bias_mean * bias_mean)).sqrt();
        if 2.0 * shared > DOUBTFUL * total {
            input_flags.push("carrier_correlated");
        }
        set(all, bias + 2, Some(total.sqrt()), &input_flags);
    }

    fn loops(&self, all: &mut [Prediction]) {
        let places = self.seen.places;
        if let Some(at) = places.amplitude_loop {
            set(all, at, None, &["open_loop_integral"]);
            set(all, at + 1, None, &["open_loop_integral"]);
        }
        if places.phase_loop.is_some() {
            for k in 0..all.len() {
                set(all, k, None, &["closed_loop"]);
            }
        }
    }

    fn general(&self, all: &mut [Prediction]) {
        let places = self.seen.places;
        let overflowed = self.seen.nodes.iter().position(|n| n.overflows > 0);
        for (k, node) in self.seen.nodes.iter().enumerate() {
            if overflowed.is_some_and(|first| k >= first) {
                set(all, k, None, &["overflow"]);
            }
            if self.seen.cut_rows > 0 && k >= places.phase + 2 {
                set(all, k, None, &["phase_cut"]);
            }
            if node.count < ENOUGH_ROWS {
                set(all, k, None, &["few_rows"]);
            }
        }
    }
}

/// The middle of a phase bin, turns.
fn bin_turns(bin: usize) -> f64 {
    (bin as f64 + 0.5) / PHASE_BINS as f64 - 0.5
}

/// The polynomial with its casts.
struct Horner {
    /// Lowest order first, deg/s.
    coefficients: Vec<f64>,
    clamp: Option<(f64, f64)>,
    accumulator_lsb: f64,
    first: Moments,
    inner: Moments,
    output: Moments,
    output_lsb: f64,
}

impl Horner {
    fn new(design: &Design, c: &Compensation) -> Self {
        let p_bits = design.circuit.cordic.angle_bits as i32 - 1;
        let lsb = c.coefficient_format.lsb();
        let (coarse, fine) = (
            c.coefficient_format.fraction_bits as i32,
            c.accumulator.format.fraction_bits as i32,
        );
        let last = if c.coefficients_raw.len() > 1 {
            fine
        } else {
            coarse
        };
        let rounding = c.accumulator.rounding;
        Horner {
            coefficients: c
                .coefficients_raw
                .iter()
                .map(|raw| *raw as f64 * lsb)
                .collect(),
            clamp: c
                .clamp_raw
                .map(|(low, high)| (low as f64 * pow2(-p_bits), high as f64 * pow2(-p_bits))),
            accumulator_lsb: c.accumulator.format.lsb(),
            first: Moments::of_rounding(rounding, coarse + p_bits - fine),
            inner: Moments::of_rounding(rounding, p_bits),
            output: Moments::of_rounding(
                c.output.rounding,
                last - c.output.format.fraction_bits as i32,
            ),
            output_lsb: c.output.format.lsb(),
        }
    }

    /// The polynomial's variable, half turns.
    fn variable(&self, turns: f64) -> f64 {
        2.0 * turns
    }

    fn limited(&self, p: f64) -> (f64, f64) {
        match self.clamp {
            Some((low, _)) if p < low => (low, 0.0),
            Some((_, high)) if p > high => (high, 0.0),
            _ => (p, 1.0),
        }
    }

    /// Rounding of the product of a step, LSB.
    fn rounding(&self, step: usize) -> Moments {
        if step == 0 { self.first } else { self.inner }
    }

    /// The polynomial's derivative.
    fn slope(&self, p: f64) -> f64 {
        let (p, factor) = self.limited(p);
        let (mut t, mut slope) = (0.0, 0.0);
        for c in self.coefficients.iter().rev() {
            slope = t + p * slope;
            t = c + p * t;
        }
        slope * factor
    }

    /// Mean squares of the error after each cast (inner, outer, inner, ...) and of the bias, given that of p.
    fn mean_squares(&self, p: f64, square: f64) -> Vec<f64> {
        let (p, factor) = self.limited(p);
        let mut orders = self.coefficients.iter().rev();
        let mut t = orders.next().copied().unwrap_or(0.0);
        // The error of t is slope * e_p plus roundings: variance, mean.
        let (mut slope, mut variance, mut mean) = (0.0, 0.0, 0.0);
        let lsb = self.accumulator_lsb;
        let mut all = Vec::new();
        for (step, c) in orders.enumerate() {
            slope = t * factor + p * slope;
            let own = self.rounding(step);
            variance = p * p * variance + own.variance() * lsb * lsb;
            mean = p * mean + own.mean * lsb;
            t = c + p * t;
            let of = slope * slope * square + variance + mean * mean;
            all.extend([of, of]);
        }
        variance += self.output.variance() * self.output_lsb * self.output_lsb;
        mean += self.output.mean * self.output_lsb;
        all.push(slope * slope * square + variance + mean * mean);
        all
    }
}
