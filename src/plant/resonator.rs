//! One vibration mode whose stiffness falls linearly with temperature (seed paper, eq. 1 to 8).

pub use crate::design::StiffnessLaw;
use std::f64::consts::FRAC_PI_2;

/// 0 degC in K.
pub const ZERO_CELSIUS_K: f64 = 273.15;

/// A mode: a torsional or linear oscillator with viscous damping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resonator {
    /// omega_n(T0) / 2 pi, Hz.
    pub frequency_hz: f64,
    /// Quality factor Q, 1.
    pub q: f64,
    /// T0, K.
    pub reference_k: f64,
    /// kappa, relative fall of the stiffness, 1/K (eq. 1, 2).
    pub tempco_per_k: f64,
    /// Eq. 3 or eq. 4.
    pub law: StiffnessLaw,
}

/// The steady state of a driven mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Eq. 6 in units of F / omega_e^2 (F a force per mass, or a torque per inertia), 1.
    pub amplitude: f64,
    /// Eq. 7, of the motion relative to the excitation, rad, in [-pi, 0].
    pub phase_rad: f64,
}

impl Resonator {
    /// T - T0, K.
    fn above_reference_k(&self, degc: f64) -> f64 {
        degc + ZERO_CELSIUS_K - self.reference_k
    }

    /// omega_n(T) / 2 pi, Hz, by eq. 3 or 4; 0 where the law has no stiffness left.
    pub fn natural_frequency_hz(&self, degc: f64) -> f64 {
        self.softened_frequency_hz(degc, 0.0)
    }

    /// The same where the stiffness has fallen by `more` (relative) beside kappa (T - T0).
    pub fn softened_frequency_hz(&self, degc: f64, more: f64) -> f64 {
        let fall = self.tempco_per_k * self.above_reference_k(degc) + more;
        let ratio = match self.law {
            StiffnessLaw::SquareRoot => (1.0 - fall).max(0.0).sqrt(),
            StiffnessLaw::Linear => (1.0 - fall / 2.0).max(0.0),
        };
        self.frequency_hz * ratio
    }

    /// Amplitude and phase under a harmonic force of `excitation_hz` (eq. 5 to 7).
    ///
    /// With r = omega_n / omega_e the amplitude is 1 / sqrt((r^2 - 1)^2 + (r/Q)^2) and the phase
    /// -atan2(r/Q, r^2 - 1): eq. 7 with a quadrant-aware arctangent, continuous through resonance.
    pub fn response(&self, degc: f64, excitation_hz: f64) -> Response {
        let r = self.natural_frequency_hz(degc) / excitation_hz;
        let (stiff, damped) = (r * r - 1.0, r / self.q);
        Response {
            amplitude: 1.0 / stiff.hypot(damped),
            phase_rad: -damped.atan2(stiff),
        }
    }

    /// Eq. 8: the phase linearised at T0 for excitation at omega_n(T0), -pi/2 - kappa Q (T - T0), rad.
    pub fn linear_phase_rad(&self, degc: f64) -> f64 {
        -FRAC_PI_2 - self.tempco_per_k * self.q * self.above_reference_k(degc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(frequency_hz: f64, q: f64, tempco_per_k: f64, law: StiffnessLaw) -> Resonator {
        Resonator {
            frequency_hz,
            q,
            reference_k: 300.0,
            tempco_per_k,
            law,
        }
    }

    /// Largest less smallest over -10..70 degC in steps of 0.01 K.
    fn swing(f: impl Fn(f64) -> f64) -> f64 {
        let values = (-1000..=7000).map(|i| f(f64::from(i) / 100.0));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
        high - low
    }

    #[test]
    fn the_golden_table_is_reproduced_to_its_printed_digits() {
        // Seed facts, section 7: degC, f_n1, f_n2, drive phase, sense phase, amplitude over its
        // peak, sense amplitude.
        let table = [
            [
                -10.0, 1751.592, 2001.820, -84.803, -51.024, 0.99498, 2.03886,
            ],
            [0.0, 1751.160, 2001.326, -86.208, -51.076, 0.99715, 2.04085],
            [
                26.85, 1750.000, 2000.000, -90.000, -51.216, 1.00000, 2.04621,
            ],
            [70.0, 1748.135, 1997.869, -96.085, -51.441, 0.99543, 2.05485],
        ];
        let drive = mode(1750.0, 50.0, 4.9388e-5, StiffnessLaw::Linear);
        let sense = mode(2000.0, 3.0, 4.9388e-5, StiffnessLaw::Linear);
        // The table has 1.00000 at T0: its peak is the value at resonance, Q.
        let peak = drive.response(26.85, 1750.0).amplitude;
        assert!((peak - 50.0).abs() < 1e-9);
        for [degc, f1, f2, p1, p2, a1, a2] in table {
            let (d, s) = (drive.response(degc, 1750.0), sense.response(degc, 1750.0));
            let same = |value: f64, printed: f64, digits: i32| {
                let half = 0.5 * 10f64.powi(-digits) * (1.0 + 1e-6);
                assert!(
                    (value - printed).abs() <= half,
                    "{degc} degC: {value}, printed {printed}"
                );
            };
            same(drive.natural_frequency_hz(degc), f1, 3);
            same(sense.natural_frequency_hz(degc), f2, 3);
            same(d.phase_rad.to_degrees(), p1, 3);
            same(s.phase_rad.to_degrees(), p2, 3);
            same(d.amplitude / peak, a1, 5);
            same(s.amplitude, a2, 5);
        }
    }

    #[test]
    fn the_linear_phase_errs_by_the_published_0_0364_deg_and_0_32_percent() {
        for (kappa, law) in [
            (4.939e-5, StiffnessLaw::Linear),
            (4.978e-5, StiffnessLaw::SquareRoot),
        ] {
            let drive = mode(1750.0, 50.0, kappa, law);
            let exact = |t: f64| drive.response(t, 1750.0).phase_rad.to_degrees();
            let error = swing(|t| drive.linear_phase_rad(t).to_degrees() - exact(t));
            assert!((error - 0.0364).abs() < 5e-5, "{law:?}: {error}");
            // Two digits, whichever swing it is related to.
            for whole in [
                swing(exact),
                swing(|t| drive.linear_phase_rad(t).to_degrees()),
            ] {
                let percent = 100.0 * error / whole;
                assert!((percent - 0.32).abs() < 5e-3, "{law:?}: {percent}");
            }
        }
    }

    #[test]
    fn the_sense_mode_moves_by_0_78_percent_and_0_417_deg() {
        let sense = mode(2000.0, 3.0, 4.939e-5, StiffnessLaw::Linear);
        let amplitude = |t: f64| sense.response(t, 1750.0).amplitude;
        let percent = 100.0 * swing(amplitude) / amplitude(70.0);
        assert!((percent - 0.78).abs() < 5e-3 && percent < 0.78, "{percent}");
        let degrees = swing(|t| sense.response(t, 1750.0).phase_rad.to_degrees());
        assert!((degrees - 0.417).abs() < 5e-4, "{degrees}");
    }

    #[test]
    fn the_laws_differ_by_the_second_order() {
        let laws = [StiffnessLaw::SquareRoot, StiffnessLaw::Linear];
        let [exact, first] =
            laws.map(|l| mode(1750.0, 50.0, 4.939e-5, l).natural_frequency_hz(70.0));
        assert!(((first - exact) / exact - 5.7e-7).abs() < 1e-8);
        // No stiffness left, and no NaN either.
        assert_eq!(
            mode(1.0, 1.0, 1e-3, laws[0]).natural_frequency_hz(2000.0),
            0.0
        );
    }

    #[test]
    fn the_phase_is_continuous_through_resonance() {
        let drive = mode(1750.0, 50.0, 4.939e-5, StiffnessLaw::Linear);
        let phase = |t: f64| drive.response(t, 1750.0).phase_rad;
        assert!((phase(26.85) + FRAC_PI_2).abs() < 1e-9);
        assert!(phase(26.84) > phase(26.86) && phase(26.84) - phase(26.86) < 1e-4);
        assert!(drive.response(20.0, 1e-3).phase_rad.abs() < 1e-6);
    }
}
