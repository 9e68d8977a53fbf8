//! What happens after every R samples: the channels become a row, and the loops act.

use super::amplitude_loop::{AmplitudeLoop, AmplitudeLoopState};
use super::compensation::{Bias, Rate};
use super::cordic::Vectoring;
use super::in_range::InRange;
use super::nco::{Detuning, Oscillator, OscillatorState, Retune};
use super::phase_loop::{PhaseLoop, PhaseLoopState};
use crate::numeric::arithmetic::Arithmetic;

/// What changes after every R samples only.
#[derive(Debug, Clone, Copy)]
pub struct SlowState<W> {
    /// The phase loop's.
    pub phase_loop: Option<PhaseLoopState<W>>,
    /// The amplitude loop's.
    pub amplitude_loop: Option<AmplitudeLoopState<W>>,
}

/// The words of one decimated sample.
#[derive(Debug, Clone, Copy)]
pub struct Row<W> {
    /// Drive I, drive Q, sense I, sense Q.
    pub channels: [W; 4],
    /// Drive phase.
    pub phase: W,
    /// Drive magnitude.
    pub magnitude: W,
    /// Bias and compensated rate.
    pub compensation: Option<[W; 2]>,
    /// 1 where the thermometer is inside the calibrated range, else 0.
    pub in_range: Option<W>,
    /// Drive gain.
    pub gain: Option<W>,
}

/// Where the loops rest: what a warm start puts into them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    /// What the phase loop adds to the design's tuning word, steps.
    pub correction_steps: f64,
    /// Drive gain, 0 to 1.
    pub gain: f64,
}

/// What works on the channels of a decimated sample. It is the same for every number of stages, so that it is compiled once.
pub(super) struct RowBlocks<'a> {
    pub nco: &'a Oscillator,
    pub cordic: &'a Vectoring,
    pub compensation: Option<&'a (Bias, Rate)>,
    pub in_range: Option<&'a InRange>,
    pub by_tuning_word: bool,
    pub phase_loop: Option<&'a PhaseLoop>,
    pub amplitude_loop: Option<&'a AmplitudeLoop>,
}

impl RowBlocks<'_> {
    /// Puts the loops where they hold a tuning word correction (steps) and a drive gain (0 to 1)
    /// with no error, and the oscillator at that tuning word; gives the gain that is then put out.
    pub(super) fn hold<A: Arithmetic>(
        &self,
        ar: &A,
        oscillator: &mut OscillatorState<A::Residue>,
        slow: &mut SlowState<A::Word>,
        held: Held,
    ) -> Option<A::Word> {
        if let (Some(block), Some(state)) = (self.phase_loop, &mut slow.phase_loop) {
            *state = block.holding(ar, held.correction_steps);
            // A step at the setpoint has no error: it leaves the integrator and puts out the rest.
            let [correction] = ar.call(block, "phase_loop", state, [block.setpoint(ar)]);
            let [] = ar.call(&Retune(self.nco), "nco", oscillator, [correction]);
        }
        let (block, state) = (self.amplitude_loop?, &mut slow.amplitude_loop);
        let state = state.as_mut()?;
        *state = block.holding(ar, held.gain);
        let [gain] = ar.call(block, "amplitude_loop", state, [block.setpoint(ar)]);
        Some(gain)
    }

    /// The row of these channels, after which the loops act.
    pub(super) fn row<A: Arithmetic>(
        &self,
        ar: &A,
        channels: [A::Word; 4],
        oscillator: &mut OscillatorState<A::Residue>,
        slow: &mut SlowState<A::Word>,
    ) -> Row<A::Word> {
        let [drive_i, drive_q, sense_i, _] = channels;
        let [phase, magnitude] = ar.call(self.cordic, "", &mut (), [drive_i, drive_q]);
        let thermometer = if self.compensation.is_some() && self.by_tuning_word {
            ar.call(&Detuning(self.nco), "nco", oscillator, [])
        } else {
            [phase]
        };
        let blocks = (self.compensation, self.in_range);
        let (compensation, in_range) = compensated(ar, blocks, sense_i, thermometer);
        if let (Some(block), Some(state)) = (self.phase_loop, &mut slow.phase_loop) {
            let [correction] = ar.call(block, "phase_loop", state, [phase]);
            let [] = ar.call(&Retune(self.nco), "nco", oscillator, [correction]);
        }
        let gain = match (self.amplitude_loop, &mut slow.amplitude_loop) {
            (Some(block), Some(state)) => {
                let [gain] = ar.call(block, "amplitude_loop", state, [magnitude]);
                Some(gain)
            }
            _ => None,
        };
        Row {
            channels,
            phase,
            magnitude,
            compensation,
            in_range,
            gain,
        }
    }
}

/// Bias and compensated rate, and whether the thermometer is inside the calibrated range, where
/// the design asks for them.
#[inline(always)]
pub fn compensated<A: Arithmetic>(
    ar: &A,
    (compensation, in_range): (Option<&(Bias, Rate)>, Option<&InRange>),
    sense_i: A::Word,
    thermometer: [A::Word; 1],
) -> (Option<[A::Word; 2]>, Option<A::Word>) {
    let Some((bias, rate)) = compensation else {
        return (None, None);
    };
    let [bias] = ar.call(bias, "", &mut (), thermometer);
    let [rate] = ar.call(rate, "", &mut (), [sense_i, bias]);
    let in_range = in_range.map(|block| {
        let [inside] = ar.call(block, "", &mut (), thermometer);
        inside
    });
    (Some([bias, rate]), in_range)
}
