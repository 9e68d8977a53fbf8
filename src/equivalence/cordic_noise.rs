//! The CORDIC's own errors, as noise.

use crate::design::Design;
use crate::numeric::constants;
use crate::numeric::format::pow2;
use std::f64::consts::TAU;

/// Variances and means of what the block adds.
///
/// - The angle left is uniform within +-a, a = a_(n-1): a^2 / 3; it shortens x by K r phi^2 / 2, of mean a^2 / 6
///   and mean square a^4 / 20.
/// - y loses the fraction of x >> i, uniform, in either direction: 1/3 LSB^2 each, as long as x >> i is not 0.
/// - x loses the fraction of y >> i. y is about x 2^-i then: while y >> i is not 0, likewise; after that
///   a negative y still gives -1, which adds 1 to x: mean 1/2, variance 1/4.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockNoise {
    /// Mean square of the angle left and of the table's roundings, turns^2.
    pub(super) angle: f64,
    /// Of the floors, turns^2, times the vectors' mean square length.
    floors: f64,
    /// Mean and variance of x, in the output's unit, but for the angle left.
    along: (f64, f64),
    last_rad: f64,
    gain_error: f64,
}

impl BlockNoise {
    /// For vectors of a length whose inverse is given.
    pub(super) fn new(design: &Design, inverse_length: f64) -> Self {
        let circuit = &design.circuit;
        let cordic = &circuit.cordic;
        let later = f64::from(cordic.iterations.saturating_sub(1));
        let last_rad = pow2(1 - cordic.iterations as i32).atan();
        let lsb = circuit.decimator.output.format.lsb();
        let fine = lsb * pow2(-(cordic.guard_bits as i32));
        let gain: f64 = (0..cordic.iterations as i32)
            .map(|k| (1.0 + pow2(-2 * k)).sqrt())
            .product();
        let constant = constants::cordic_gain(cordic.iterations, cordic.gain_bits) as f64
            * pow2(-(cordic.gain_bits as i32));
        let bits = (gain / (fine * inverse_length)).log2().max(0.0);
        let (across, along) = (later.min(bits), later.min(bits / 2.0));
        let late = later - along;
        let angles = constants::arc_tangents(cordic.iterations, cordic.angle_bits);
        let turn = pow2(-(cordic.angle_bits as i32));
        let table: f64 = angles
            .iter()
            .zip(0..)
            .map(|(raw, k)| (*raw as f64 * turn - pow2(-k).atan() / TAU).powi(2))
            .sum();
        let unit = fine / gain;
        BlockNoise {
            angle: (last_rad / TAU).powi(2) / 3.0 + table,
            // The vector is on the average 1.6 times as long while it is turned.
            floors: across / 3.0 * (fine / (1.6 * TAU)).powi(2),
            along: (
                late / 2.0 * unit,
                (along / 3.0 + late / 4.0) * unit * unit + lsb * lsb / 12.0,
            ),
            last_rad,
            gain_error: constant * gain - 1.0,
        }
    }

    /// Mean square of the phase's error, turns^2, given the mean of 1 / length^2.
    pub(super) fn phase(&self, inverse_square: f64) -> f64 {
        self.angle + self.floors * inverse_square
    }

    /// Mean of what the block adds to a magnitude.
    pub(super) fn along_mean(&self, length: f64) -> f64 {
        self.along.0 + length * (self.gain_error - self.last_rad * self.last_rad / 6.0)
    }

    /// Variance of it, given the vectors' mean square length.
    pub(super) fn along_variance(&self, square_length: f64) -> f64 {
        let a2 = self.last_rad * self.last_rad;
        self.along.1 + square_length * a2 * a2 * (1.0 / 20.0 - 1.0 / 36.0)
    }
}
