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
use super::cordic_noise::BlockNoise;
use super::horner::Horner;
use super::node::Node;
use super::probe::Seen;
use super::quantisation::{FEW_PHASES, Moments, Spread, TableErrors, cic_noise_gain, spread};
use crate::design::{CompensationInput, Design};
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
    /// Of the white part, what may not be white.
    doubtful: f64,
    flags: Vec<&'static str>,
}

/// The phase error by bins of the phase.
#[derive(Debug, Clone, Default)]
struct PhaseError {
    /// Turns, by bin.
    bins: Vec<Moments>,
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
        // A peak entry is 2^m - 1: its products repeat the code's bits. One entry of P / 2 is a peak.
        let structured = matches!(self.spread, Spread::Coherent(period) if period < 32);
        let many = self.activity.pairs[channel / 2].count() >= ENOUGH_WORDS;
        self.product_rounding(channel).square == 0.0 || many && !structured
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
        let product_noise = rounding.variance() * product_lsb * product_lsb;
        let rounded = product_noise * self.noise_gain;
        // A line may lie where the decimator passes it whole; noise times the table error is white.
        let pass = self.gain * self.gain;
        let mut doubtful = (beside - noise).max(0.0) * pass;
        if let Spread::Coherent(period) = self.spread
            && period <= FEW_PHASES
        {
            // Equal codes round equally: part of that noise is in as many lines, and one of them is passed.
            doubtful += product_noise * self.noise_gain.max(2.0 * pass / period as f64);
        }
        let white = rounded + own.variance() * own_lsb * own_lsb + beside * self.noise_gain;
        let mean = rounding.mean * product_lsb * self.gain + own.mean * own_lsb;

        let mut flags = self.nco_flags();
        if !self.rounding_is_spread(channel) {
            flags.push("few_words");
        }
        if doubtful > DOUBTFUL * (white + following + mean * mean) {
            flags.push("carrier_lines");
        }
        let moving = self
            .node(at)
            .is_some_and(|n| n.is_active(MOVING, ENOUGH_WORDS));
        if own.square > 0.0 && !moving {
            flags.push("idle_input");
        }
        // A mean and what follows the signal have the sign of the signal in common only by chance.
        let square = white + following + mean * mean;
        set(all, at, Some(square.sqrt()), &flags);
        if let Some(p) = all.get_mut(at) {
            p.local_rms_lsb = (own.square > 0.0 && moving).then(|| own.square.sqrt());
        }
        // What is doubtful here may weigh less, or more, where the errors meet.
        flags.retain(|f| *f != "coherent_nco" && *f != "carrier_lines");
        Channel {
            white,
            mean,
            following,
            doubtful,
            flags,
        }
    }

    fn cordic(&self, all: &mut [Prediction], inputs: &[Channel; 4]) -> PhaseError {
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
        let block = BlockNoise::new(self.design, inverse_square.sqrt());
        let [a_s, b_s] = self.table.synchronous[0].map(|c| c / self.table.amplitude);
        let [a_c, b_c] = self.table.synchronous[1].map(|c| c / self.table.amplitude);
        let inverse = inverse_square.sqrt();
        let mut error = PhaseError {
            bins: vec![Moments::default(); PHASE_BINS],
            ..PhaseError::default()
        };
        let (mut phase, mut along) = (0.0, 0.0);
        let (mut across_doubt, mut along_doubt) = (0.0, 0.0);
        for (k, share) in self.bins() {
            let (sin, cos) = (bin_turns(k) * TAU).sin_cos();
            let (e_i, e_q) = (cos * a_s + sin * b_s, cos * a_c + sin * b_c);
            let mean_across = (cos * q.mean - sin * i.mean) * inverse;
            let across = cos * e_q - sin * e_i + mean_across;
            let white = cos * cos * q.white + sin * sin * i.white;
            let square = (across * across + white * inverse_square) / (TAU * TAU) + block.phase();
            if let Some(bin) = error.bins.get_mut(k) {
                *bin = Moments {
                    mean: across / TAU,
                    square,
                };
            }
            phase += share * square;
            error.following += share * across * across / (TAU * TAU);
            across_doubt += share * (cos * cos * q.doubtful + sin * sin * i.doubtful);
            along_doubt += share * (cos * cos * i.doubtful + sin * sin * q.doubtful);
            let length = square_length.sqrt();
            let shift = (cos * e_i + sin * e_q) * length + cos * i.mean + sin * q.mean;
            along += share * (shift * shift + cos * cos * i.white + sin * sin * q.white);
        }
        let mut magnitude_flags = flags.clone();
        // The angle left, and the table's roundings, are spread only if the phase moves by as much.
        let moves = self.node(at).is_some_and(|n| n.moving() >= MOVING);
        if !moves && block.angle > DOUBTFUL * phase {
            flags.push("idle_input");
        }
        if across_doubt * inverse_square / (TAU * TAU) > DOUBTFUL * phase {
            flags.push("carrier_lines");
        }
        set(all, at, Some(phase.sqrt()), &flags);
        let magnitude = along + block.magnitude(square_length);
        if along_doubt > DOUBTFUL * magnitude {
            magnitude_flags.push("carrier_lines");
        }
        set(all, at + 1, Some(magnitude.sqrt()), &magnitude_flags);
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
            let turns = phase.bins.get(k).copied().unwrap_or_default();
            let half_turns = Moments {
                mean: 2.0 * turns.mean,
                square: 4.0 * turns.square,
            };
            let errors = horner.mean_squares(p, half_turns);
            for (sum, e) in sums.iter_mut().zip(&errors) {
                *sum += share * e;
            }
            let slope = horner.slope(p);
            following += share * slope * slope * 4.0 * phase.following;
        }
        for k in 0..2 * steps {
            let moving = self
                .node(first + k)
                .is_some_and(|n| n.is_active(MOVING, ENOUGH_WORDS));
            idle |= !moving;
            set(all, first + k, sums.get(k).map(|s| s.sqrt()), &flags);
            let step = all
                .get_mut(first + k)
                .filter(|_| moving && k.is_multiple_of(2));
            if let Some(p) = step {
                p.local_rms_lsb = Some(horner.rounding(k / 2).square.sqrt()).filter(|r| *r > 0.0);
            }
        }
        let bias_moves = self
            .node(bias)
            .is_some_and(|n| n.is_active(MOVING, ENOUGH_WORDS));
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
        let moves = self
            .node(bias + 1)
            .is_some_and(|n| n.is_active(MOVING, ENOUGH_WORDS));
        let mut input_flags = sense.flags.clone();
        if own.square > 0.0 && !moves {
            input_flags.push("idle_input");
        }
        let mean = sense.mean * scale + own.mean * lsb;
        let following = sense.following * scale * scale;
        let doubtful = sense.doubtful * scale * scale;
        let square =
            sense.white * scale * scale + following + mean * mean + own.variance() * lsb * lsb;
        if doubtful > DOUBTFUL * square {
            input_flags.push("carrier_lines");
        }
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
