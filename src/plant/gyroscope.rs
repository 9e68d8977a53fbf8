//! The gyro in motion: drive and sense resonator under the circuit's excitation, at the ADC rate.
//!
//! Lengths are scaled to what the ADCs see: the drive motion x is in LSB of the drive ADC, the sense
//! motion y in LSB of the sense ADC; u = x'/w0 and v = y'/w0 with w0 the drive's resonance at T0.
//!
//! - drive: x'' + (w1/Q1) x' + w1^2 x = g F sin(theta) (eq. 5; theta: the oscillator's phase, g: the
//!   drive gain), with F such that at resonance and nominal gain |x| is the design's drive amplitude;
//! - sense: y'' + (w2/Q2) y' + w2^2 y = K (Om x'/w0 - q x): Coriolis force and quadrature. The rate Om
//!   that acts is the applied one and the in-phase coupling, an error force in phase with the
//!   Coriolis force that is stated as a rate;
//! - drive ADC: x turned by the electronics' phase (and pulled by the amplitude, where that effect is on);
//!   sense ADC: y turned by a fixed angle, so that at T0 a rate comes out in phase with the oscillator's
//!   sine, but for the demodulation error, and by what a later sample turns it; the drive's feedthrough.
//!
//! The discretisation is exact. The excitation is the band-limited sinusoid through the oscillator's
//! phases, so that the steady state is eq. 5 to 7 without any hold's or DAC's phase. The motion is
//! that steady state P(theta) plus a deviation w that decays freely, w(t + h) = exp(A h) w(t) ([`motion`]); where
//! frequency, gain, rate or temperature change, P changes and w takes up the difference, so the motion itself
//! is continuous. In equilibrium w is 0, which is also the warm start.
//!
//! In-phase coupling: eq. 9 states what the authors measured at the *output*. A fixed-frequency
//! demodulator turns with the drive's phase, so part of that is quadrature. The coupling is what
//! has to be added to the device's quadrature so that a fixed-frequency circuit with held amplitude
//! reads eq. 9 at every temperature; a circuit that tracks the resonance sees the same device.

use super::converter::{Channel, Converter};
use super::device::Device;
use super::effects;
use super::modes::Modes;
use super::motion::{self, Couplings, Power};
use super::thermal::Temperatures;
use crate::design::{Gyro, ThermalRun};
use crate::numeric::turn;
use nalgebra::Complex;
use std::f64::consts::TAU;

type C = Complex<f64>;

/// 2^64: steps of a phase in one turn.
const TURN: f64 = 18_446_744_073_709_551_616.0;

/// All that the plant knows of the circuit beside its excitation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference {
    /// ADC sample rate, Hz.
    pub sample_rate_hz: f64,
    /// Full scale of both ADCs, LSB.
    pub full_scale_lsb: f64,
    /// The frequency of the excitation, Hz: fixed, or where a phase loop starts.
    pub excitation_hz: f64,
    /// A phase loop moves the frequency.
    pub tracking: bool,
    /// An amplitude loop moves the gain.
    pub held_amplitude: bool,
    /// The gain that gives the design's drive amplitude at resonance at T0, 0 to 1.
    pub nominal_gain: f64,
}

/// What the circuit drives the gyro with during a block of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// The oscillator's phase at the sample before the block, 2^-64 turn.
    pub phase: u64,
    /// Its advance before each sample, 2^-64 turn.
    pub step: u64,
    /// Drive gain, 0 to 1.
    pub gain: f64,
}

/// What acts on the gyro during a block of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditions {
    /// Structure and electronics.
    pub temperatures: Temperatures,
    /// The applied rate as the sensor sees it, deg/s.
    pub rate_dps: f64,
    /// What adds to the bias at the output beside eq. 9, deg/s.
    pub extra_bias_dps: f64,
    /// Quality factor of the drive mode.
    pub drive_q: f64,
    /// Relative fall of the stiffness beside kappa (T - T0).
    pub softening: f64,
}

/// A gyro in motion.
#[derive(Debug, Clone)]
pub struct Gyroscope {
    device: Device,
    reference: Reference,
    /// Force per mass at gain 1, LSB rad^2/s^2.
    force: f64,
    /// K, sense force per deg/s and LSB of drive motion.
    coupling: f64,
    /// Quadrature, deg/s.
    quadrature_dps: f64,
    /// LSB of the sense ADC in a deg/s.
    lsb_per_dps: f64,
    /// By which the sense channel is turned, rad.
    sense_turn_rad: f64,
    /// For its latency and the drive's feedthrough.
    sense_adc: Converter,
    conditions: Conditions,
    modes: Modes,
    /// Their motion, by sample of a block.
    tables: motion::Tables,
    /// What the steady state takes from modes and frequency; `None` after a change of the modes.
    tuned: Option<Tuned>,
    /// Steady state at the drive at hand.
    steady: Steady,
    drive: Drive,
    /// Sine and cosine of a phase, 2^-64 turn: the last that was asked for.
    carrier: (u64, (f64, f64)),
    /// Deviation from the steady state: x, u, y, v.
    deviation: [f64; 4],
}

/// What the steady motion takes from modes and frequency alone.
#[derive(Debug, Clone, Copy)]
struct Tuned {
    /// Of the drive, 2^-64 turn a sample.
    step: u64,
    /// i w / w0, from x to u and from y to v.
    ratio: C,
    /// x at gain 1, LSB.
    drive: C,
    /// From a force on the sense mode to what its ADC sees.
    sense: C,
    /// Takes the sense channel's turn back.
    untwisted: C,
    /// w0 / w: a phase is a time; of what stands still it shows nothing.
    per_velocity: f64,
    sense_row: [f64; 2],
    /// What the drive channel is turned by, rad, and its row.
    drive_turn_rad: f64,
    drive_row: [f64; 2],
}

/// The steady motion under a drive, as phasors of exp(i theta), sin(theta) being the imaginary part.
#[derive(Debug, Clone, Copy, Default)]
struct Steady {
    state: [C; 4],
    /// What both ADCs see.
    outputs: [C; 2],
    /// Outputs of the deviation: rows on (x, u) and (y, v).
    drive_row: [f64; 2],
    sense_row: [f64; 2],
    /// The rate that acts, deg/s.
    rate_dps: f64,
}

impl Gyroscope {
    /// The gyro `gyro` with amplitudes as in `run`, at rest at T0.
    pub fn new(gyro: &Gyro, run: &ThermalRun, reference: Reference) -> Self {
        let device = Device::new(gyro);
        let (w0, w2) = (TAU * gyro.drive_frequency_hz, TAU * gyro.sense_frequency_hz);
        let amplitude_lsb = reference.full_scale_lsb * run.drive_amplitude;
        let lsb_per_dps = reference.full_scale_lsb / run.sense_full_scale_dps;
        let modes = Modes {
            w: [w0, w2],
            width: [w0 / gyro.drive_q, w2 / gyro.sense_q],
            electronics_rad: 0.0,
            in_phase_dps: 0.0,
        };
        let sense = modes.sense(w0);
        let error = gyro.demodulation_error_rad;
        let t0 = gyro.reference_temperature_k - super::resonator::ZERO_CELSIUS_K;
        let temperatures = Temperatures {
            chamber_degc: t0,
            structure_degc: t0,
            electronics_degc: t0,
            lagged_degc: t0,
            structure_k_per_s: 0.0,
        };
        let conditions = Conditions {
            temperatures,
            rate_dps: 0.0,
            extra_bias_dps: 0.0,
            drive_q: gyro.drive_q,
            softening: 0.0,
        };
        let mut gyroscope = Gyroscope {
            force: amplitude_lsb * w0 * w0 / (gyro.drive_q * reference.nominal_gain),
            coupling: lsb_per_dps / (error.cos() * amplitude_lsb * sense.norm()),
            quadrature_dps: run.quadrature_dps * error.cos(),
            lsb_per_dps,
            sense_turn_rad: error - sense.arg(),
            sense_adc: Converter::new(&gyro.effects, Channel::Sense, 2),
            conditions,
            modes,
            tables: motion::Tables::new(Power::identity()),
            tuned: None,
            steady: Steady::default(),
            drive: Drive {
                phase: 0,
                step: 0,
                gain: 0.0,
            },
            carrier: (0, turn::sin_cos(0)),
            deviation: [0.0; 4],
            device,
            reference,
        };
        gyroscope.set_modes();
        gyroscope
    }

    /// The declared model.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Where a phase loop with this setpoint comes to rest at a drive gain, Hz, if the resonance has such a phase.
    ///
    /// Eq. 7 solved for the excitation: with a = -phase of the motion in (0, pi), w^2 + w (w1/Q1) cot a -
    /// w1^2 = 0.
    pub fn locked_hz(&self, setpoint_rad: f64, gain: f64) -> Option<f64> {
        let pull = self.modes.electronics_rad + self.phase_pull_rad(gain);
        let lag = (pull - setpoint_rad).rem_euclid(TAU);
        let inside = lag > 1e-3 && lag < TAU / 2.0 - 1e-3;
        let (w1, width) = (self.modes.w[0], self.modes.width[0]);
        let b = width / lag.tan();
        inside.then(|| ((b * b + 4.0 * w1 * w1).sqrt() - b) / 2.0 / TAU)
    }

    /// The drive gain at which the drive ADC sees `amplitude_lsb` at an excitation of `hz`.
    pub fn gain_for(&self, amplitude_lsb: f64, hz: f64) -> f64 {
        let w = TAU * hz;
        let x = self.modes.drive(w);
        amplitude_lsb / (self.force * x.norm())
    }

    /// Sense I per deg/s of rate relative to nominal in the steady state at hand, 1.
    pub fn scale_factor(&self) -> f64 {
        let u = self.steady.state[1];
        let sense = self.sense_response(&self.modes, self.omega(self.drive.step));
        self.rate_phasor(sense, u).re / self.lsb_per_dps
    }

    /// An advance in 2^-64 turn a sample as an angular frequency, rad/s.
    fn omega(&self, step: u64) -> f64 {
        step as i64 as f64 / TURN * TAU * self.reference.sample_rate_hz
    }

    /// Sets what acts from the next block on. The motion stays continuous.
    pub fn set(&mut self, conditions: Conditions) {
        let before = &self.conditions;
        let same_modes = before.temperatures == conditions.temperatures
            && (before.drive_q, before.softening) == (conditions.drive_q, conditions.softening);
        self.conditions = conditions;
        if !same_modes {
            self.set_modes();
        }
        self.move_to(self.drive);
    }

    /// Puts the gyro into the steady state under a drive.
    pub fn settle(&mut self, drive: Drive) {
        self.move_to(drive);
        self.deviation = [0.0; 4];
    }

    /// Stops all motion.
    pub fn stop(&mut self) {
        let (sin, cos) = self.carrier();
        self.deviation = self.steady.state.map(|p| -(p.re * sin + p.im * cos));
    }

    /// The drive's samples of a block, before any noise or converter: drive and sense input, LSB.
    pub fn block(&mut self, drive: Drive, drive_lsb: &mut [f64], sense_lsb: &mut [f64]) {
        if drive != self.drive {
            self.move_to(drive);
        }
        let couplings = Couplings {
            velocity: self.coupling * self.steady.rate_dps,
            position: -self.coupling * self.quadrature_dps,
        };
        let rows = [self.steady.drive_row, self.steady.sense_row];
        let pieces = drive_lsb.chunks_mut(motion::PIECE);
        for (drive_lsb, sense_lsb) in pieces.zip(sense_lsb.chunks_mut(motion::PIECE)) {
            let (sin, cos) = self.carrier();
            // Re sin(theta + n step) + Im cos(theta + n step), by cosine and sine of n step.
            let carried = |p: &C| [p.re * sin + p.im * cos, p.re * cos - p.im * sin];
            let steady = self.steady.outputs.each_ref().map(carried);
            let samples = drive_lsb.len() as u64;
            self.tables.piece(
                drive.step,
                steady,
                rows,
                couplings,
                &mut self.deviation,
                drive_lsb,
                sense_lsb,
            );
            let advance = drive.step.wrapping_mul(samples);
            self.drive.phase = self.drive.phase.wrapping_add(advance);
        }
    }

    /// Sine and cosine of the oscillator's phase at the sample before.
    fn carrier(&mut self) -> (f64, f64) {
        if self.carrier.0 != self.drive.phase {
            self.carrier = (self.drive.phase, turn::sin_cos(self.drive.phase));
        }
        self.carrier.1
    }

    /// Takes up the difference of two steady states, so that the motion is continuous.
    fn move_to(&mut self, drive: Drive) {
        let before = self.steady;
        self.drive = drive;
        self.steady = self.steady_at(drive);
        let (sin, cos) = self.carrier();
        for (k, w) in self.deviation.iter_mut().enumerate() {
            let change = before.state[k] - self.steady.state[k];
            *w += change.re * sin + change.im * cos;
        }
    }

    /// The sense ADC's phasor for a rate of 1 deg/s under the drive velocity u, given the sense mode's response.
    fn rate_phasor(&self, sense: C, u: C) -> C {
        u * self.coupling * sense
    }

    /// The sense ADC's phasor of the quadrature under the drive motion x.
    fn quadrature_phasor(&self, sense: C, x: C) -> C {
        x * -self.coupling * self.quadrature_dps * sense
    }

    /// From a force on the sense mode to what its ADC sees.
    fn sense_response(&self, modes: &Modes, w: f64) -> C {
        modes.sense(w) * C::cis(self.sense_turn_rad)
    }

    /// What modes and frequency make of a steady state; the drive's row is that without any turn.
    fn tuned_to(&self, step: u64) -> Tuned {
        let w = self.omega(step);
        let w0 = TAU * self.device.drive.frequency_hz;
        let per_velocity = if w == 0.0 { 0.0 } else { w0 / w };
        let later = w / self.reference.sample_rate_hz * self.sense_adc.latency_samples();
        Tuned {
            step,
            ratio: C::new(0.0, w / w0),
            drive: self.modes.drive(w) * self.force,
            sense: self.sense_response(&self.modes, w),
            untwisted: C::cis(-self.sense_turn_rad),
            per_velocity,
            sense_row: turned(self.sense_turn_rad + later, per_velocity),
            drive_turn_rad: 0.0,
            drive_row: turned(0.0, per_velocity),
        }
    }

    fn steady_at(&mut self, drive: Drive) -> Steady {
        let known = self.tuned.filter(|t| t.step == drive.step);
        let mut tuned = known.unwrap_or_else(|| self.tuned_to(drive.step));
        let drive_turn = self.modes.electronics_rad + self.phase_pull_rad(drive.gain);
        if tuned.drive_turn_rad != drive_turn {
            tuned.drive_turn_rad = drive_turn;
            tuned.drive_row = turned(drive_turn, tuned.per_velocity);
        }
        self.tuned = Some(tuned);
        let c = &self.conditions;
        let x = tuned.drive * drive.gain;
        let u = tuned.ratio * x;
        let per_dps = self.rate_phasor(tuned.sense, u);
        // An effect states what it adds to the output; the force that does so is larger where the
        // output is less sensitive. Without motion there is no output at all.
        let sensitivity = per_dps.re / self.lsb_per_dps;
        let extra = if sensitivity > 1e-3 {
            c.extra_bias_dps / sensitivity
        } else {
            0.0
        };
        let rate_dps = c.rate_dps + self.modes.in_phase_dps + extra;
        let quadrature = self.quadrature_phasor(tuned.sense, x);
        let y = (per_dps * rate_dps + quadrature) * tuned.untwisted;
        let v = tuned.ratio * y;
        let (drive_row, sense_row) = (tuned.drive_row, tuned.sense_row);
        Steady {
            state: [x, u, y, v],
            outputs: [
                x * drive_row[0] + u * drive_row[1],
                y * sense_row[0] + v * sense_row[1] + self.feedthrough(drive.gain),
            ],
            drive_row,
            sense_row,
            rate_dps,
        }
    }

    /// What the amplitude adds to the measured phase, rad.
    fn phase_pull_rad(&self, gain: f64) -> f64 {
        let relative = gain / self.reference.nominal_gain;
        effects::phase_pull_rad(&self.device.effects, relative - 1.0)
    }

    /// What the drive voltage puts into the sense ADC, LSB.
    fn feedthrough(&self, gain: f64) -> C {
        let Some([dps, phase_rad]) = self.sense_adc.drive_feedthrough() else {
            return C::default();
        };
        let relative = gain / self.reference.nominal_gain;
        C::from_polar(dps * self.lsb_per_dps * relative, phase_rad)
    }

    /// What both ADCs see of a spur of the excitation (`nco_spur`): its frequency, Hz, and its phasors, LSB.
    pub fn spur(&self) -> Option<(f64, [C; 2])> {
        let [relative, hz] = self.device.effects.get("nco_spur")?;
        let w = TAU * hz;
        let m = &self.modes;
        let x = m.drive(w) * self.force * self.drive.gain * relative;
        let u = C::new(0.0, hz / self.device.drive.frequency_hz) * x;
        let response = self.sense_response(m, w);
        let sense = self.rate_phasor(response, u) * self.steady.rate_dps;
        let drive = x * C::cis(m.electronics_rad);
        Some((hz, [drive, sense + self.quadrature_phasor(response, x)]))
    }

    /// Takes the modes from the conditions.
    fn set_modes(&mut self) {
        let c = &self.conditions;
        let t = &c.temperatures;
        let soft = |mode: &super::Resonator| {
            TAU * mode.softened_frequency_hz(t.structure_degc, c.softening)
        };
        let w = [soft(&self.device.drive), soft(&self.device.sense)];
        let width = [w[0] / c.drive_q, w[1] / self.device.sense.q];
        let w0 = TAU * self.device.drive.frequency_hz;
        let h = 1.0 / self.reference.sample_rate_hz;
        let electronics = self.device.electronics_phase_rad(t.electronics_degc);
        let share = if self.reference.tracking {
            self.device.electronics.loop_share
        } else {
            1.0
        };
        self.modes = Modes {
            w,
            width,
            electronics_rad: electronics * share,
            in_phase_dps: 0.0,
        };
        self.modes.in_phase_dps = self.in_phase_coupling_dps(&self.modes, electronics);
        self.tables.set(self.modes.moved_by(h, w0));
        self.tuned = None;
    }

    /// The in-phase coupling at the modes' temperature: what makes a fixed-frequency circuit read
    /// eq. 9 (module documentation), deg/s.
    fn in_phase_coupling_dps(&self, modes: &Modes, electronics_rad: f64) -> f64 {
        let reference = &self.reference;
        let w0 = TAU * self.device.drive.frequency_hz;
        let w = if reference.tracking {
            w0
        } else {
            TAU * reference.excitation_hz
        };
        let mut x = modes.drive(w);
        let measured_rad = x.arg() + electronics_rad;
        let nominal_lsb = self.force * reference.nominal_gain * self.device.drive.q / (w0 * w0);
        if reference.tracking || reference.held_amplitude {
            x *= nominal_lsb / x.norm();
        } else {
            x *= self.force * reference.nominal_gain;
        }
        let u = C::new(0.0, w / w0) * x;
        let wanted_lsb = self.device.bias_at_phase_dps(measured_rad) * self.lsb_per_dps;
        let sense = self.sense_response(modes, w);
        let gain = self.rate_phasor(sense, u).re;
        if gain.abs() < 1e-9 * self.lsb_per_dps {
            // No motion to speak of: no rate, and nothing that could stand for one.
            return 0.0;
        }
        (wanted_lsb - self.quadrature_phasor(sense, x).re) / gain
    }
}

/// What an ADC whose channel is turned by an angle sees of displacement and velocity.
fn turned(angle: f64, per_velocity: f64) -> [f64; 2] {
    [angle.cos(), per_velocity * angle.sin()]
}

#[cfg(test)]
#[path = "gyroscope_tests.rs"]
mod tests;
