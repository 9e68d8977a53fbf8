//! Where the loops come to rest, and how fast: the closed loop linearised around its steady state.

use crate::circuit::chain::Held;
use crate::circuit::scale::{amplitude_lsb_per_magnitude, oscillator_hz};
use crate::design::Design;
use crate::error::{InputError, Result};
use crate::numeric::format::pow2;
use crate::plant::Gyroscope;
use crate::text::number;
use std::f64::consts::TAU;

/// The steady state of the closed loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest {
    /// Excitation, Hz.
    pub hz: f64,
    /// Drive gain, 0 to 1.
    pub gain: f64,
    /// The same as the loops' outputs.
    pub held: Held,
}

/// The drive gain that gives the design's drive amplitude at resonance at T0: where the amplitude
/// loop starts, or 1 without one.
pub fn nominal_gain(design: &Design) -> f64 {
    match &design.circuit.amplitude_loop {
        Some(l) => {
            let raw = (l.initial_raw >> l.integrator_shift).max(1);
            raw as f64 * pow2(1 - l.gain_bits as i32)
        }
        None => 1.0,
    }
}

/// The steady state under the conditions that the gyroscope has.
///
/// # Errors
/// A phase loop whose setpoint is no phase of the resonance.
pub fn rest(design: &Design, gyroscope: &Gyroscope) -> Result<Rest> {
    let circuit = &design.circuit;
    let given_hz = oscillator_hz(design);
    let gain_at = |hz: f64| match &circuit.amplitude_loop {
        None => nominal_gain(design),
        Some(l) => {
            let magnitude = l.setpoint_raw as f64 * circuit.decimator.output.format.lsb();
            let amplitude_lsb = magnitude * amplitude_lsb_per_magnitude(design);
            let largest = l.gain_limit() as f64 * pow2(1 - l.gain_bits as i32);
            gyroscope.gain_for(amplitude_lsb, hz).clamp(0.0, largest)
        }
    };
    let hz = match &circuit.phase_loop {
        None => given_hz,
        Some(l) => {
            let turns = l.setpoint_raw as f64 * pow2(-(circuit.cordic.angle_bits as i32));
            // The amplitude may pull the phase, and the frequency moves the gain: a weak coupling.
            let locked = |gain: f64| gyroscope.locked_hz(turns * TAU, gain);
            let first = locked(nominal_gain(design));
            let second = first.and_then(|hz| locked(gain_at(hz)));
            second.and_then(|hz| locked(gain_at(hz))).ok_or_else(|| {
                InputError::new(format!(
                    "the phase loop's setpoint is {:.2} deg, which the drive's resonance cannot have: its phase runs from 0 to -180 deg",
                    turns * 360.0
                ))
                .help(format!(
                    "set circuit.phase_loop.setpoint_raw to {}, minus a quarter turn, for the resonance",
                    -(1i128 << (circuit.cordic.angle_bits - 2))
                ))
            })?
        }
    };
    let gain = gain_at(hz);
    let step_hz = circuit.sample_rate_hz * pow2(-(circuit.nco.phase_bits as i32));
    Ok(Rest {
        hz,
        gain,
        held: Held {
            correction_steps: (hz - given_hz) / step_hz,
            gain,
        },
    })
}

/// A PI loop around a first-order lag, linearised: lag s^2 + (1 + P) s + I = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linearised {
    /// Time constant of the resonator's envelope, 2 Q1 / w1, s.
    pub lag_s: f64,
    /// Loop gain of the proportional part, 1.
    pub proportional: f64,
    /// Loop gain of the integral part, 1/s.
    pub integral_per_s: f64,
}

impl Linearised {
    /// The slowest time constant of the closed loop, s; infinite if it does not settle.
    pub fn slowest_s(&self) -> f64 {
        let (a, b, c) = (self.lag_s, 1.0 + self.proportional, self.integral_per_s);
        if b <= 0.0 || c <= 0.0 {
            return f64::INFINITY;
        }
        let discriminant = b * b - 4.0 * a * c;
        // The root nearest to the imaginary axis.
        let decay = if discriminant > 0.0 {
            (b - discriminant.sqrt()) / (2.0 * a)
        } else {
            b / (2.0 * a)
        };
        1.0 / decay
    }
}

/// The time constant of the drive's envelope at T0, s.
pub fn envelope_s(design: &Design) -> f64 {
    design.gyro.drive_q / (TAU / 2.0 * design.gyro.drive_frequency_hz)
}

/// Decimated samples per second.
pub fn rows_per_s(design: &Design) -> f64 {
    design.circuit.sample_rate_hz / f64::from(design.circuit.decimator.ratio)
}

/// Phase of the motion that a tuning word step makes at resonance, LSB of the phase a step:
/// 2 Q1 / w1 rad per rad/s.
pub fn phase_lsb_per_step(design: &Design) -> f64 {
    let circuit = &design.circuit;
    let hz_per_step = circuit.sample_rate_hz * pow2(-(circuit.nco.phase_bits as i32));
    envelope_s(design) * hz_per_step * pow2(circuit.cordic.angle_bits as i32)
}

/// Magnitude that a gain LSB makes at resonance, LSB of the magnitude a gain LSB.
pub fn magnitude_lsb_per_gain_lsb(design: &Design) -> f64 {
    let Some(l) = &design.circuit.amplitude_loop else {
        return 0.0;
    };
    let full_scale_lsb = pow2(design.circuit.adc.format.bits() as i32 - 1);
    let nominal_lsb = full_scale_lsb * design.thermal_run.drive_amplitude;
    let magnitude = nominal_lsb / amplitude_lsb_per_magnitude(design);
    let gain_lsb = nominal_gain(design) * pow2(l.gain_bits as i32 - 1);
    magnitude / design.circuit.decimator.output.format.lsb() / gain_lsb
}

/// The phase loop, linearised at resonance.
pub fn phase_loop(design: &Design) -> Option<Linearised> {
    let l = design.circuit.phase_loop.as_ref()?;
    let per_step = phase_lsb_per_step(design);
    let gain = |g: crate::design::LoopGain| g.raw as f64 * pow2(-(g.shift as i32));
    Some(Linearised {
        lag_s: envelope_s(design),
        proportional: gain(l.proportional) * per_step,
        integral_per_s: gain(l.integral) * per_step * rows_per_s(design),
    })
}

/// The amplitude loop, linearised.
pub fn amplitude_loop(design: &Design) -> Option<Linearised> {
    let l = design.circuit.amplitude_loop.as_ref()?;
    let per_lsb = magnitude_lsb_per_gain_lsb(design);
    Some(Linearised {
        lag_s: envelope_s(design),
        proportional: per_lsb * pow2(-(l.error_shift as i32)),
        integral_per_s: per_lsb * pow2(-(l.integrator_shift as i32)) * rows_per_s(design),
    })
}

/// Rows after which a change of the conditions has died out to 2e-9 of its size (20 of the slowest
/// time constants), the decimator's memory included.
///
/// # Errors
/// A loop that does not settle.
pub fn settling_rows(design: &Design) -> Result<usize> {
    let mut slowest = envelope_s(design);
    for (name, l) in [
        ("phase_loop", phase_loop(design)),
        ("amplitude_loop", amplitude_loop(design)),
    ] {
        let Some(l) = l else { continue };
        let constant_s = l.slowest_s();
        if constant_s > 10.0 {
            return Err(InputError::new(format!(
                "circuit.{name} takes {constant_s:.0} s to settle, or never does: its loop gains are {} (proportional) and {}/s (integral)",
                number(l.proportional, 3), number(l.integral_per_s, 3)))
            .help("both gains have to be positive; raise `integral`, or lower its shift")
            .into());
        }
        slowest = slowest.max(constant_s);
    }
    let decimator = &design.circuit.decimator;
    let memory = (decimator.stages * decimator.differential_delay) as usize;
    Ok(memory + (20.0 * slowest * rows_per_s(design)).ceil() as usize)
}
