//! The device: what its measured drive phase and its bias are at a temperature.

use super::effects::{self, Instant};
use super::resonator::Resonator;
use crate::design::{Effects, ElectronicsPhase, Gyro};

/// A gyro in thermal equilibrium.
#[derive(Debug, Clone, PartialEq)]
pub struct Device {
    /// The drive mode.
    pub drive: Resonator,
    /// The sense mode.
    pub sense: Resonator,
    /// The fixed frequency of the excitation, Hz.
    pub excitation_hz: f64,
    /// What the electronics add to the measured phase.
    pub electronics: ElectronicsPhase,
    /// Eq. 9: deg/s, deg/s/rad, deg/s/rad^2.
    pub bias_dps: [f64; 3],
    /// What is beyond eq. 9.
    pub effects: Effects,
}

impl Device {
    /// From `[gyro]`; the excitation at the drive's resonance at T0.
    pub fn new(gyro: &Gyro) -> Self {
        let mode = |frequency_hz, q| Resonator {
            frequency_hz,
            q,
            reference_k: gyro.reference_temperature_k,
            tempco_per_k: gyro.stiffness_tempco_per_k,
            law: gyro.stiffness_law,
        };
        Device {
            drive: mode(gyro.drive_frequency_hz, gyro.drive_q),
            sense: mode(gyro.sense_frequency_hz, gyro.sense_q),
            excitation_hz: gyro.drive_frequency_hz,
            electronics: gyro.electronics.clone(),
            bias_dps: gyro.bias_dps,
            effects: gyro.effects.clone(),
        }
    }

    /// The drive motion's phase relative to the excitation (eq. 7), rad.
    pub fn structural_phase_rad(&self, degc: f64) -> f64 {
        self.drive.response(degc, self.excitation_hz).phase_rad
    }

    /// What the electronics at a temperature add to the measured phase, rad.
    pub fn electronics_phase_rad(&self, degc: f64) -> f64 {
        let e = &self.electronics;
        e.phase_offset_rad + e.phase_slope_rad_per_k * (degc - e.reference_temperature_degc)
    }

    /// The measured drive phase, structure and electronics at one temperature, rad: the virtual
    /// thermometer.
    pub fn measured_phase_rad(&self, degc: f64) -> f64 {
        self.structural_phase_rad(degc) + self.electronics_phase_rad(degc)
    }

    /// Eq. 9 at a measured drive phase, deg/s.
    pub fn bias_at_phase_dps(&self, phase_rad: f64) -> f64 {
        let [offset, linear, quadratic] = self.bias_dps;
        offset + phase_rad * (linear + phase_rad * quadratic)
    }

    /// The bias by the declared model, eq. 9 in the measured phase, deg/s.
    pub fn declared_bias_dps(&self, degc: f64) -> f64 {
        self.bias_at_phase_dps(self.measured_phase_rad(degc))
    }

    /// What the effects see in equilibrium at a temperature: see [`Instant::equilibrium`].
    pub fn equilibrium(&self, degc: f64) -> Instant {
        let (q0, reference_k) = (self.drive.q, self.drive.reference_k);
        Instant {
            phase_rad: self.measured_phase_rad(degc),
            inverse_q: q0 / effects::quality_factor(&self.effects, q0, degc, reference_k) - 1.0,
            ..Instant::equilibrium(&self.effects, degc)
        }
    }

    /// What the effects that are switched on add to the bias in equilibrium, deg/s.
    pub fn effects_dps(&self, degc: f64) -> f64 {
        effects::bias_dps(&self.effects, &self.equilibrium(degc))
    }

    /// The bias that the device has in equilibrium: eq. 9 and the effects, deg/s.
    pub fn bias_dps(&self, degc: f64) -> f64 {
        self.declared_bias_dps(degc) + self.effects_dps(degc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::template::default_design;

    #[test]
    fn the_structure_alone_drifts_by_33_2_and_with_the_electronics_by_160() {
        let mut device = Device::new(&default_design().unwrap().gyro);
        let drift = |d: &Device| d.declared_bias_dps(70.0) - d.declared_bias_dps(0.0);
        assert!((drift(&device) - 160.0).abs() < 0.01, "{}", drift(&device));
        assert!((device.measured_phase_rad(70.0) + 2.1328).abs() < 5e-5);
        device.electronics.phase_slope_rad_per_k = 0.0;
        assert!((drift(&device) - 33.2).abs() < 0.05, "{}", drift(&device));
        assert!((device.declared_bias_dps(0.0) - 53.8).abs() < 0.05);
        assert!((device.declared_bias_dps(70.0) - 86.9).abs() < 0.05);
        assert!((device.measured_phase_rad(0.0) + 1.5046).abs() < 5e-5);
        assert!((device.measured_phase_rad(70.0) + 1.6770).abs() < 5e-5);
    }

    #[test]
    fn effects_add_to_the_declared_bias_and_can_be_off() {
        let mut device = Device::new(&default_design().unwrap().gyro);
        assert_ne!(device.effects_dps(40.0), 0.0);
        let with = device.bias_dps(40.0);
        assert_eq!(
            with,
            device.declared_bias_dps(40.0) + device.effects_dps(40.0)
        );
        device.effects = Effects::default();
        assert_eq!(device.bias_dps(40.0), device.declared_bias_dps(40.0));
    }
}
