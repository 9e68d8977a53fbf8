//! The device: what its measured drive phase and its bias are at a temperature.

use super::resonator::Resonator;
use crate::design::{Effects, ElectronicsPhase, Gyro, ModeCrossing};

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

    /// What the effects that are switched on add to the bias, deg/s.
    pub fn effects_dps(&self, degc: f64) -> f64 {
        let crossing = self.effects.mode_crossing.as_ref();
        crossing.map_or(0.0, |m| mode_crossing_dps(m, degc))
    }

    /// The bias that the device has: eq. 9 and the effects, deg/s.
    pub fn bias_dps(&self, degc: f64) -> f64 {
        self.declared_bias_dps(degc) + self.effects_dps(degc)
    }
}

/// The bias, deg/s, of a parasitic mode that crosses the drive in temperature.
///
/// Another mode of the structure has its own stiffness coefficient, so at one temperature (the
/// centre) its resonance passes the fixed excitation; near it, it is driven too. Its motion has a part in
/// phase with the excitation, the dispersive part of a Lorentzian (through zero at the crossing,
/// one sign on either side), and one in quadrature, the absorptive part. The demodulator rejects
/// the latter; the former leaks into the rate channel. The detuning in half widths,
/// u = (T - centre) / half width, is linear in temperature, and the bump is
/// amplitude * 2u / (1 + u^2): exactly +-amplitude at u = +-1, its extremes, and falling as 2/u.
/// A mode of quality factor Qp whose frequency moves by a (1/K, relative) against the
/// excitation has the half width 1 / (2 Qp |a|) K.
pub fn mode_crossing_dps(crossing: &ModeCrossing, degc: f64) -> f64 {
    let u = (degc - crossing.center_degc) / crossing.half_width_k;
    crossing.amplitude_dps * (2.0 * u / (1.0 + u * u))
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
    fn the_bump_has_its_extremes_at_one_half_width() {
        let m = ModeCrossing {
            amplitude_dps: 4.7,
            center_degc: 31.25,
            half_width_k: 6.5,
        };
        let at = |u: f64| mode_crossing_dps(&m, m.center_degc + u * m.half_width_k);
        assert_eq!((at(1.0), at(-1.0), at(0.0)), (4.7, -4.7, 0.0));
        assert!((-1000..=1000).all(|i| at(f64::from(i) / 50.0).abs() <= 4.7));
        assert!((at(100.0) - 4.7 * 0.02).abs() < 1e-4);
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
