//! Predicted rms behind the CORDIC: phase, magnitude, bias, rate.

use super::cordic_noise::BlockNoise;
use super::front_noise::{Channel, with_sign};
use super::horner::Horner;
use super::predicted::{DOUBTFUL, ENOUGH_ROWS, MOVING, Prediction, Theory, bin_turns, set};
use crate::design::CompensationInput;
use crate::nodes::activity::PHASE_BINS;
use crate::nodes::quantisation::Moments;
use std::f64::consts::TAU;

/// The phase error by bins of the phase.
#[derive(Debug, Clone, Default)]
pub(super) struct PhaseError {
    /// Turns, by bin.
    bins: Vec<Moments>,
    flags: Vec<&'static str>,
}

/// The bias's error.
#[derive(Debug, Clone, Copy, Default)]
struct BiasError {
    /// Mean square, (deg/s)^2.
    square: f64,
    /// Mean of its product with the rate input's error.
    with_input: f64,
}

/// E[1/r^2] E[r^2] up to which all vectors count as equally long: it is 1 for equal ones, and their
/// stretching weighs by r^2.
const EVEN_LENGTH: f64 = 1.05;

/// The phase's error from [`Lines`](super::table_noise::Lines), rad: u' x.
fn across(turns: f64) -> [f64; 4] {
    let (sin, cos) = (turns * TAU).sin_cos();
    [-sin * cos, -sin * sin, cos * cos, sin * cos]
}

/// The relative magnitude's.
fn along(turns: f64) -> [f64; 4] {
    let (sin, cos) = (turns * TAU).sin_cos();
    [cos * cos, sin * cos, sin * cos, sin * sin]
}

impl Theory<'_> {
    pub(super) fn cordic(&self, all: &mut [Prediction], inputs: &[Channel; 4]) -> PhaseError {
        let at = self.seen.places.phase;
        let [i, q, ..] = inputs;
        let rows = self.activity.rows.max(1) as f64;
        let inverse_square = self.activity.inverse_square / rows;
        let square_length = self.mean_square(at + 1);
        let mut flags = i.flags.clone();
        flags.extend(q.flags.iter().filter(|f| !i.flags.contains(f)));
        // Few short vectors must not make the mean of 1 / r^2.
        let enough = ENOUGH_ROWS as f64 / 3.0 * self.activity.inverse_fourth;
        let strong = self.activity.inverse_square.powi(2) > enough;
        if !strong || i.white * inverse_square > 0.01 {
            flags.push("weak_vector");
        }
        flags.extend(self.nco_flags());
        let block = BlockNoise::new(self.design, inverse_square.sqrt());
        let (lines, stretch) = (&self.table.lines, &self.table.stretch);
        let mut error = PhaseError {
            bins: vec![Moments::default(); PHASE_BINS],
            ..PhaseError::default()
        };
        let (mut phase, mut magnitude) = (0.0, 0.0);
        let (mut across_doubt, mut along_doubt) = (0.0, 0.0);
        for (k, share) in self.bins() {
            let (sin, cos) = (bin_turns(k) * TAU).sin_cos();
            let u = across(bin_turns(k));
            let inverse_square = self.inverse_square_of(k);
            let inverse = inverse_square.sqrt();
            let own = (cos * q.mean - sin * i.mean) * inverse;
            let mean = lines.mean_of(u) + own;
            let white = cos * cos * q.white + sin * sin * i.white;
            let square = lines.product_of(u, u) + own * (2.0 * mean - own) + white * inverse_square;
            // A vector turned by a small angle d, without getting longer along itself, is longer by d^2 / 2; what
            // turns all alike is in `stretch`.
            let turned = (square - lines.turn_square).max(0.0) / 2.0;
            let square = square / (TAU * TAU) + block.phase(inverse_square);
            if let Some(bin) = error.bins.get_mut(k) {
                let mean = mean / TAU;
                *bin = Moments { mean, square };
            }
            phase += share * square;
            across_doubt += share * (cos * cos * q.doubtful + sin * sin * i.doubtful);
            along_doubt += share * (cos * cos * i.doubtful + sin * sin * q.doubtful);
            let v = along(bin_turns(k));
            let length = square_length.sqrt();
            let own = cos * i.mean + sin * q.mean + block.along_mean(length) + turned * length;
            magnitude += share
                * (stretch.product_of(v, v) * square_length
                    + own * (2.0 * stretch.mean_of(v) * length + own)
                    + cos * cos * i.white
                    + sin * sin * q.white);
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
        magnitude += block.along_variance(square_length);
        if along_doubt > DOUBTFUL * magnitude {
            magnitude_flags.push("carrier_lines");
        }
        // The mean square length stands for the length of every row.
        if inverse_square * square_length > EVEN_LENGTH && !magnitude_flags.contains(&"weak_vector")
        {
            magnitude_flags.push("weak_vector");
        }
        set(all, at + 1, Some(magnitude.sqrt()), &magnitude_flags);
        error.flags = flags;
        error
    }

    pub(super) fn compensation(
        &self,
        all: &mut [Prediction],
        inputs: &[Channel; 4],
        phase: &PhaseError,
    ) {
        let Some(c) = &self.design.compensation else {
            return;
        };
        let (Some((first, steps)), Some(bias)) = (self.seen.places.horner, self.seen.places.bias)
        else {
            return;
        };
        if c.form.is_some() {
            for node in bias..bias + 3 {
                set(all, node, None, &["other_form"]);
            }
            return;
        }
        if c.input != CompensationInput::Phase {
            return;
        }
        let mut flags = phase.flags.clone();
        let nodes = self.seen.nodes.get(first..).unwrap_or_default();
        let horner = Horner::new(self.design, c, nodes);
        let mut sums = vec![0.0; 2 * steps + 1];
        let mut error = BiasError::default();
        let input_mean = self.rate_input_mean(&inputs[2]);
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
            let sense = self.sense_of(k).map(|w| w * c.rate_full_scale_dps);
            let follows = self.table.lines.product_of(across(bin_turns(k)), sense) / TAU;
            let input = self.table.lines.mean_of(sense) + input_mean;
            let slope = 2.0 * horner.slope(p);
            // Through the phase the lines go together; what Horner adds by itself has a mean at most.
            let own = horner.mean(p, half_turns.mean) - slope * turns.mean;
            let by_phase = slope * (follows + turns.mean * input_mean);
            error.with_input += share * (by_phase + own * input);
        }
        for k in 0..2 * steps {
            let moving = self.moves(first + k);
            idle |= !moving;
            set(all, first + k, sums.get(k).map(|s| s.sqrt()), &flags);
            let step = all
                .get_mut(first + k)
                .filter(|_| moving && k.is_multiple_of(2));
            if let Some(p) = step {
                p.local_rms_lsb = Some(horner.rounding(k / 2).square.sqrt()).filter(|r| *r > 0.0);
            }
        }
        let bias_moves = self.moves(bias);
        if idle || !bias_moves {
            flags.push("idle_input");
        }
        error.square = sums.last().copied().unwrap_or(0.0);
        set(all, bias, Some(error.square.sqrt()), &flags);
        let own = horner.output;
        if let Some(p) = all.get_mut(bias) {
            p.local_rms_lsb = (own.square > 0.0 && bias_moves).then(|| own.square.sqrt());
        }
        self.rate(all, bias, &inputs[2], error, &flags);
    }

    /// Mean of 1 / r^2 over the rows of a phase bin.
    fn inverse_square_of(&self, bin: usize) -> f64 {
        let rows = self.activity.phase_rows.get(bin).copied().unwrap_or(0);
        let sum = self.activity.phase_inverse.get(bin).copied();
        sum.unwrap_or(0.0) / rows.max(1) as f64
    }

    /// What a phase bin's mean sense vector makes of the table's lines: the error of sense I is w' x.
    fn sense_of(&self, bin: usize) -> [f64; 4] {
        let rows = self
            .activity
            .phase_rows
            .get(bin)
            .copied()
            .unwrap_or(0)
            .max(1) as f64;
        let [i, q] = self
            .activity
            .phase_sense
            .get(bin)
            .copied()
            .unwrap_or_default();
        [i / rows, q / rows, 0.0, 0.0]
    }

    /// The rate's own rounding, LSB.
    fn rate_rounding(&self, at: usize) -> Moments {
        let Some(c) = &self.design.compensation else {
            return Moments::default();
        };
        let from = self.design.circuit.decimator.output.format.fraction_bits as i32
            - c.rate_full_scale_exponent();
        let bits = from - c.output.format.fraction_bits as i32;
        let own = Moments::of_rounding(c.output.rounding, bits);
        with_sign(own, c.output.rounding, self.node(at))
    }

    /// Mean of the roundings in the rate's input, deg/s.
    fn rate_input_mean(&self, sense: &Channel) -> f64 {
        let (Some(c), Some(bias)) = (&self.design.compensation, self.seen.places.bias) else {
            return 0.0;
        };
        let own = self.rate_rounding(bias + 1).mean * c.output.format.lsb();
        sense.mean * c.rate_full_scale_dps + own
    }

    /// The rate's input (sense I) and the rate.
    fn rate(
        &self,
        all: &mut [Prediction],
        bias: usize,
        sense: &Channel,
        error: BiasError,
        flags: &[&'static str],
    ) {
        let Some(c) = &self.design.compensation else {
            return;
        };
        let scale = c.rate_full_scale_dps;
        let own = self.rate_rounding(bias + 1);
        let lsb = c.output.format.lsb();
        let moves = self.moves(bias + 1);
        let mut input_flags = sense.flags.clone();
        input_flags.extend(self.nco_flags());
        if own.square > 0.0 && !moves {
            input_flags.push("idle_input");
        }
        let mean = self.rate_input_mean(sense);
        let square = (sense.white + sense.following) * scale * scale
            + mean * mean
            + own.variance() * lsb * lsb;
        if sense.doubtful * scale * scale > DOUBTFUL * square {
            input_flags.push("carrier_lines");
        }
        set(all, bias + 1, Some(square.sqrt()), &input_flags);
        if let Some(p) = all.get_mut(bias + 1) {
            p.local_rms_lsb = (own.square > 0.0 && moves).then(|| own.square.sqrt());
        }
        input_flags.extend(flags.iter().filter(|f| !sense.flags.contains(f)));
        let total = (square + error.square - 2.0 * error.with_input).max(0.0);
        set(all, bias + 2, Some(total.sqrt()), &input_flags);
    }
}
