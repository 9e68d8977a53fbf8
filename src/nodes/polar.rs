//! The CORDIC beside atan2 and hypot, with a bound for the block.
//!
//! v is the vector (I, Q) of the fixed chain, r its length, e the bound on its distance from the
//! float chain's vector. f are the fraction bits of I and Q, g the guard bits, n the iterations, K the
//! CORDIC's gain, a_i = atan(2^-i). r0 = r 2^(f+g) is the length in LSB of x and y.
//!
//! **Input.** Two vectors at a distance of at most e make an angle of at most asin(e / r); their lengths
//! differ by at most e.
//!
//! **Floors.** Iteration 0 shifts nothing. Each later one moves x and y by less than one LSB
//! each, the vector by less than sqrt 2. After iteration 0 the vector is sqrt 2 r0 long, and later
//! ones only lengthen it, but for the floors, in all at most 1.05 sqrt 2 (n - 1); so it is at least
//! L = sqrt 2 r0 - 1.05 sqrt 2 (n - 1) long and the floors turn it by at most P = (n - 1) asin(sqrt 2 / L).
//!
//! **Residual angle.** Without floors the angle left at the end is at most a_(n-1) (Walther 1971: a_i is at
//! most the sum of the later ones and a_(n-1)); with them at most a_(n-1) + P. So z errs by at most
//! a_(n-1) + 2 P, and by the rounding of each table entry, added up.
//!
//! **Length.** x_n = length * cos(angle left): off K r0 by at most 1.05 sqrt 2 (n - 1) + K r0 (a_(n-1) + P)^2 / 2.
//! The constant's relative error and half an LSB of the result's rounding are added.
//!
//! **Width.** Where x or y may leave `width`, the same block with a wide register runs beside it, and the
//! distance between their phases, and of the magnitude from r, are added: the wrap's actual effect.

use crate::circuit::cordic::Vectoring;
use crate::design::{Circuit, Design};
use crate::numeric::arithmetic::{Arithmetic, Block};
use crate::numeric::constants;
use crate::numeric::fixed::Fixed;
use crate::numeric::float::Float;
use crate::numeric::lane::Lane;
use crate::numeric::paired::{Pair, exp2i};
use std::f64::consts::{SQRT_2, TAU};

/// The block with what bounds it.
#[derive(Debug, Clone)]
pub struct Polar {
    block: Vectoring,
    wide: Vectoring,
    /// The block's words fit 64-bit lanes.
    narrow: bool,
    width: u32,
    iterations: f64,
    /// f + g.
    vector_fraction_bits: i32,
    /// f.
    fraction_bits: i32,
    angle_bits: i32,
    /// a_(n-1), rad.
    last_angle_rad: f64,
    /// Rounding of the table's entries, added up, turns.
    table_turns: f64,
    /// K.
    gain: f64,
    /// |constant * K - 1|.
    gain_error: f64,
}

/// What the block made of a vector.
#[derive(Debug, Clone, Copy)]
pub struct Outcome<W> {
    /// Turns.
    pub phase: Pair<W>,
    /// In the unit of I and Q.
    pub magnitude: Pair<W>,
    /// Set if x or y left their width: the bits that they need.
    pub needed_width: Option<u32>,
    /// r.
    pub length: f64,
}

impl Polar {
    /// From the design's `[circuit.cordic]`.
    pub fn new(design: &Design) -> Self {
        let circuit = &design.circuit;
        let cordic = &circuit.cordic;
        let f = circuit.decimator.output.format.fraction_bits as i32;
        let angles = constants::arc_tangents(cordic.iterations, cordic.angle_bits);
        let lsb = exp2i(-(cordic.angle_bits as i32));
        let angle_rad = |i: u32| exp2i(-(i as i32)).atan();
        let table_turns = angles
            .iter()
            .zip(0..)
            .map(|(raw, i)| (*raw as f64 * lsb - angle_rad(i) / TAU).abs() + f64::EPSILON)
            .sum();
        let gain: f64 = (0..cordic.iterations)
            .map(|i| (1.0 + exp2i(-2 * i as i32)).sqrt())
            .product();
        let constant = constants::cordic_gain(cordic.iterations, cordic.gain_bits) as f64
            * exp2i(-(cordic.gain_bits as i32));
        let last = cordic.iterations.saturating_sub(1);
        Polar {
            block: Vectoring::new(circuit),
            wide: Vectoring::new(&widened(circuit)),
            narrow: cordic.width + cordic.gain_bits < 62,
            width: cordic.width,
            iterations: f64::from(last),
            vector_fraction_bits: f + cordic.guard_bits as i32,
            fraction_bits: f,
            angle_bits: cordic.angle_bits as i32,
            last_angle_rad: angle_rad(last),
            table_turns,
            gain,
            gain_error: (constant * gain - 1.0).abs() + 4.0 * f64::EPSILON,
        }
    }

    /// Phase and magnitude of (i, q).
    pub fn run<W: Lane>(&self, i: &Pair<W>, q: &Pair<W>) -> Outcome<W> {
        let codes = [i.raw.wide(), q.raw.wide()];
        let [phase, magnitude] = self.block_result(codes);
        let length = i.value().hypot(q.value());
        let steps = length * exp2i(self.vector_fraction_bits);
        let turned_rad = self.floors_rad(steps);
        // A vector of a few LSB may point anywhere.
        let left_rad = (self.last_angle_rad + turned_rad).min(2.0);
        let scale = exp2i(-self.vector_fraction_bits) / self.gain * (1.0 + self.gain_error);
        let mut block_length = scale
            * (1.05 * SQRT_2 * self.iterations + self.gain * steps * left_rad * left_rad / 2.0)
            + length * (self.gain_error + 4.0 * f64::EPSILON)
            + 0.5 * exp2i(-self.fraction_bits);
        let (mut phase_off, mut needed_width) = (0.0, None);
        let reach = self.gain * steps + 1.5 * self.iterations + 4.0;
        if reach >= exp2i(self.width as i32 - 1) {
            let turns = (phase - self.wide_phase(codes)) as f64 * exp2i(-self.angle_bits);
            phase_off = (turns - turns.round()).abs();
            let off = (magnitude as f64 * exp2i(-self.fraction_bits) - length).abs();
            if phase_off > 0.0 || off > block_length {
                block_length += off;
                needed_width = Some(reach.log2().floor() as u32 + 2);
            }
        }

        let real = Float.ideal_polar(i.real, q.real);
        let [real_phase, real_magnitude] = real.unwrap_or_default();
        let own = i.bound.hypot(q.bound);
        let total = (i.bound + i.phase_bound).hypot(q.bound + q.phase_bound);
        let block_turns = (self.last_angle_rad + 2.0 * turned_rad) / TAU
            + self.table_turns
            + phase_off
            + 4.0 * f64::EPSILON;
        let own_turns = (angle_turns(own, length) + block_turns).min(0.5);
        let total_turns = (angle_turns(total, length) + block_turns).min(0.5);
        Outcome {
            phase: Pair {
                raw: W::low(phase),
                real: real_phase,
                bound: own_turns,
                phase_bound: total_turns - own_turns,
                fraction_bits: self.angle_bits,
                cyclic: true,
            },
            magnitude: Pair {
                raw: W::low(magnitude),
                real: real_magnitude,
                bound: own + block_length + 2.0 * real_magnitude * f64::EPSILON,
                phase_bound: total - own,
                fraction_bits: self.fraction_bits,
                cyclic: false,
            },
            needed_width,
            length,
        }
    }

    /// P: what the floors turn a vector of `steps` LSB by, rad.
    fn floors_rad(&self, steps: f64) -> f64 {
        let shortest = SQRT_2 * (steps - 1.05 * self.iterations);
        if shortest <= 2.0 {
            return TAU;
        }
        self.iterations * (SQRT_2 / shortest).asin()
    }

    fn block_result(&self, codes: [i128; 2]) -> [i128; 2] {
        if self.narrow {
            let codes = codes.map(|code| code as i64);
            let words = self.block.step(&Fixed::<i64, i64>::new(), &mut (), codes);
            return words.map(i128::from);
        }
        self.block.step(&Fixed::<i128, i128>::new(), &mut (), codes)
    }

    fn wide_phase(&self, codes: [i128; 2]) -> i128 {
        let arithmetic = Fixed::<i128, i128>::new();
        let [phase, _] = self.wide.step(&arithmetic, &mut (), codes);
        phase
    }
}

/// The largest angle between two vectors at a distance, one of a given length; turns.
fn angle_turns(distance: f64, length: f64) -> f64 {
    // Written so that 0 / 0 is half a turn.
    if distance < length {
        (distance / length).asin() / TAU
    } else {
        0.5
    }
}

/// The circuit with x and y as wide as they can need. (Its magnitude may then leave 127 bits, and is
/// not looked at.)
fn widened(circuit: &Circuit) -> Circuit {
    let mut circuit = circuit.clone();
    let output = circuit.decimator.output.format;
    let needed = output.signed_bits() + circuit.cordic.guard_bits + 2;
    circuit.cordic.width = needed.max(circuit.cordic.width);
    circuit
}
