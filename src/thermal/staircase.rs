//! The phase word as a function of the phase: what the design's CORDIC, run bit for bit, makes of it.
//!
//! The angles of the micro-rotations are rounded to the word and end before the word does, so that the steps of the
//! reading are neither even nor centred on what they stand for (Hu 1992, "The quantization effects of the CORDIC
//! algorithm").

use crate::circuit::cordic::Vectoring;
use crate::design::Design;
use crate::numeric::arithmetic::{Arithmetic, Block};
use crate::numeric::fixed::Fixed;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Points in a step.
const POINTS: f64 = 64.0;

/// Most points, and so the finest steps that are looked at.
const MOST_POINTS: f64 = 2e5;

/// For each phase word the phases that give it.
#[derive(Debug, Clone, PartialEq)]
pub struct Staircase {
    lsb_rad: f64,
    words: i64,
    cells: BTreeMap<i64, (f64, f64)>,
}

impl Staircase {
    /// Of a design, for phases from `low_rad` to `high_rad` in steps of about `step_rad`; `None` where that is too
    /// fine to follow.
    pub fn new(design: &Design, low_rad: f64, high_rad: f64, step_rad: f64) -> Option<Self> {
        let circuit = &design.circuit;
        let count = (high_rad - low_rad) / step_rad * POINTS;
        if !(1.0..MOST_POINTS).contains(&count) {
            return None;
        }
        let fraction_bits = circuit.decimator.output.format.fraction_bits as i32;
        // The magnitude that the amplitude loop holds, or half of the range.
        let held = circuit
            .amplitude_loop
            .as_ref()
            .map(|l| l.setpoint_raw as f64);
        let magnitude = held.unwrap_or_else(|| 2f64.powi(fraction_bits - 1));
        let vectoring = Vectoring::new(circuit);
        let mut out = Staircase {
            lsb_rad: TAU * 2f64.powi(-(circuit.cordic.angle_bits as i32)),
            words: 1i64.checked_shl(circuit.cordic.angle_bits)?,
            cells: BTreeMap::new(),
        };
        for k in 0..=count as usize {
            let phase_rad = low_rad + k as f64 * step_rad / POINTS;
            let word = phase_word(&vectoring, magnitude, fraction_bits, phase_rad);
            let cell = out.cells.entry(word).or_insert((phase_rad, phase_rad));
            cell.1 = phase_rad;
        }
        Some(out)
    }

    /// The phases, rad, that a reading stands for; `None` if it is no phase word (a mean of several is none).
    pub fn cell(&self, reading_rad: f64) -> Option<(f64, f64)> {
        let word = reading_rad / self.lsb_rad;
        if (word - word.round()).abs() > 0.05 {
            return None;
        }
        let half = self.words / 2;
        let wrapped = (word.round() as i64 + half).rem_euclid(self.words) - half;
        self.cells.get(&wrapped).copied()
    }
}

/// The word for one phase.
fn phase_word(vectoring: &Vectoring, magnitude: f64, fraction_bits: i32, phase_rad: f64) -> i64 {
    let ar = Fixed::<i128, i128>::new();
    let raw = |part: f64| ar.constant((magnitude * part).round() as i128, fraction_bits);
    let vector = [raw(phase_rad.cos()), raw(phase_rad.sin())];
    let [word, _] = Block::<Fixed<i128, i128>, 2, 2>::step(vectoring, &ar, &mut (), vector);
    word as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::reader;

    #[test]
    fn cells_hold_the_phases_that_give_their_words() {
        let mut design = reader::read(None).unwrap();
        for (iterations, angle_bits) in [(9, 12), (14, 12), (6, 16)] {
            design.circuit.cordic.iterations = iterations;
            design.circuit.cordic.angle_bits = angle_bits;
            let step = 2.0 * 2f64.powi(1 - iterations as i32).max(TAU * 2f64.powi(-13));
            let stairs = Staircase::new(&design, -2.2, -1.4, step).unwrap();
            let vectoring = Vectoring::new(&design.circuit);
            let magnitude = design.circuit.amplitude_loop.as_ref().unwrap().setpoint_raw as f64;
            let fraction_bits = design.circuit.decimator.output.format.fraction_bits as i32;
            let lsb_rad = TAU * 2f64.powi(-(angle_bits as i32));
            for k in 0..300 {
                let phase_rad = -2.19 + 0.0026 * f64::from(k);
                let word = phase_word(&vectoring, magnitude, fraction_bits, phase_rad);
                // The word is the phase, but for the last micro-rotation and half an LSB of each angle (Hu 1992).
                let off = word as f64 * lsb_rad - phase_rad;
                let rounded = 0.5 * lsb_rad * f64::from(iterations);
                let bound = 2f64.powi(1 - iterations as i32) + rounded;
                assert!(off.abs() < bound, "{iterations} {phase_rad}: {off}");
                let (low, high) = stairs.cell(word as f64 * lsb_rad).unwrap();
                let slack = 1.01 * step / POINTS;
                assert!(
                    (low - slack..=high + slack).contains(&phase_rad),
                    "{iterations} {phase_rad}"
                );
                // A turn more is the same phase; a mean of two words is none.
                assert!(stairs.cell(word as f64 * lsb_rad + TAU).is_some());
                assert!(stairs.cell((word as f64 + 0.5) * lsb_rad).is_none());
            }
        }
    }

    #[test]
    fn a_fine_word_is_not_followed() {
        let design = reader::read(None).unwrap();
        assert!(Staircase::new(&design, -2.2, -1.4, TAU * 2f64.powi(-24)).is_none());
    }
}
