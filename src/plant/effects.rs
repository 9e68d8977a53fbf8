//! What the device does beyond the declared model, as pure functions of an instant.
//!
//! Each effect has its equation, its source and a plausible range where it is computed. "k" marks
//! general knowledge of such gyros; ranges are those of a gyro in air with a drift of some 160 deg/s.
//! T is the structure's temperature. What an effect needs beside the instant (the lag's filter, the
//! drive gain) comes from the caller; the one effect with a memory of its own is [`StressJump`].
//! The converters' effects are in [`super::converter`].

use super::resonator::ZERO_CELSIUS_K;
use crate::design::Effects;
use std::f64::consts::TAU;

/// All that an effect on bias or rate may depend on, at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Since the run's start, s.
    pub time_s: f64,
    /// Since power-on, s.
    pub power_on_s: f64,
    /// The structure's temperature T, degC.
    pub structure_degc: f64,
    /// The electronics' temperature, degC.
    pub electronics_degc: f64,
    /// dT/dt, K/s.
    pub structure_k_per_s: f64,
    /// T through a first-order lag with the time constant of `thermal_lag`, degC; by the caller.
    pub lagged_degc: f64,
    /// The drive phase that is measured, by the declared model, rad.
    pub phase_rad: f64,
    /// Q1(T0) / Q1(T) - 1, 1: see [`quality_factor`].
    pub inverse_q: f64,
    /// The quadrature, deg/s.
    pub quadrature_dps: f64,
    /// The applied rate, deg/s.
    pub rate_dps: f64,
    /// The supply, V.
    pub supply_v: f64,
    /// The acceleration along the sensitive axis, g.
    pub accel_g: f64,
}

impl Instant {
    /// Everything at one temperature, at rest, long after power-on, at the supply that is nominal by
    /// `effects`, without quadrature; at the run's start, measured phase 0, Q1 = Q1(T0).
    pub fn equilibrium(effects: &Effects, degc: f64) -> Self {
        let supply: Option<[f64; 2]> = effects.get("supply_sensitivity");
        Instant {
            time_s: 0.0,
            power_on_s: f64::INFINITY,
            structure_degc: degc,
            electronics_degc: degc,
            structure_k_per_s: 0.0,
            lagged_degc: degc,
            phase_rad: 0.0,
            inverse_q: 0.0,
            quadrature_dps: 0.0,
            rate_dps: 0.0,
            supply_v: supply.map_or(0.0, |[_, nominal_v]| nominal_v),
            accel_g: 0.0,
        }
    }
}

/// What one effect adds to the zero-rate output, deg/s; `None` if it acts elsewhere.
///
/// | id | adds, deg/s | plausible | source |
/// |---|---|---|---|
/// | `thermal_lag` | k (T_lag - T) | 0.1 to 3 deg/s/K, 30 to 900 s | k |
/// | `temperature_rate` | k dT/dt: a gradient across the structure | 5 to 300 deg/s per K/s | k |
/// | `warmup_transient` | a exp(-t_on / tau) | 0.05 to 5 deg/s, 60 to 2000 s | Micromachines 12 (2021) 1329 |
/// | `ageing_drift` | a ln(1 + t / t0); t far below t0: a t / t0 | 0.005 to 0.5 deg/s, 1 h to 1000 h | k |
/// | `bias_third_order` | c (phi - phi_c)^3 beside eq. 9 | 10 to 500 deg/s/rad^3 | Sensors 9 (2009) 8349 (piecewise fits) |
/// | `mode_crossing` | [`mode_crossing_dps`] | | k |
/// | `damping_bias` | d (Q1(T0) / Q1(T) - 1): damping axes turned against the drive's | 1 to 50 deg/s | Weinberg and Kourepenis, JMEMS 15 (2006) 479 |
/// | `quadrature_leakage` | quadrature sin(theta) | 1 to 100 mrad | Ezekwe, ISSCC 2015 |
/// | `demod_phase_drift` | quadrature theta' (T_electronics - T_ref) | 1e-6 to 1e-3 rad/K | Pileri et al., MEMS 2025 |
/// | `supply_sensitivity` | k (V - V0) | 0.01 to 5 deg/s/V | k |
/// | `g_sensitivity` | k a | 0.005 to 0.1 deg/s/g | data sheets |
/// | `g_squared_sensitivity` | k a^2 | 1e-4 to 1e-2 deg/s/g^2 | Guan et al., Sensors 16 (2016) 468 |
/// | `periodic_pickup` | a sin(2 pi t / period + phase) | 0.05 to 5 deg/s | k |
fn added_to_bias_dps(id: &str, parameters: &[f64], at: &Instant) -> Option<f64> {
    Some(match (id, parameters) {
        ("thermal_lag", &[k, _tau_s]) => k * (at.lagged_degc - at.structure_degc),
        ("temperature_rate", &[k]) => k * at.structure_k_per_s,
        ("warmup_transient", &[a, tau_s]) => a * (-at.power_on_s / tau_s).exp(),
        ("ageing_drift", &[a, t0_s]) => a * (at.time_s / t0_s).ln_1p(),
        ("bias_third_order", &[c, center_rad]) => c * (at.phase_rad - center_rad).powi(3),
        ("mode_crossing", &[a, center_degc, half_width_k]) => {
            mode_crossing_dps(a, center_degc, half_width_k, at.structure_degc)
        }
        ("damping_bias", &[d, _exponent]) => d * at.inverse_q,
        ("quadrature_leakage", &[theta_rad]) => at.quadrature_dps * theta_rad.sin(),
        ("demod_phase_drift", &[per_k, reference_degc]) => {
            at.quadrature_dps * (per_k * (at.electronics_degc - reference_degc))
        }
        ("supply_sensitivity", &[k, nominal_v]) => k * (at.supply_v - nominal_v),
        ("g_sensitivity", &[k]) => k * at.accel_g,
        ("g_squared_sensitivity", &[k]) => k * (at.accel_g * at.accel_g),
        ("periodic_pickup", &[a, period_s, phase_rad]) => {
            a * (TAU * (at.time_s / period_s).fract() + phase_rad).sin()
        }
        _ => return None,
    })
}

/// What adds to the zero-rate output at nominal scale factor, deg/s: the sum of
/// the effects on the bias; that of `stress_jump` comes from [`StressJump`].
pub fn bias_dps(effects: &Effects, at: &Instant) -> f64 {
    let on = effects.iter();
    on.filter_map(|(kind, values)| added_to_bias_dps(kind.id, values, at))
        .fold(0.0, |sum, term| sum + term)
}

/// What one effect adds to the rate `sensed_dps` (what the dead band leaves), deg/s; `None` if it
/// acts elsewhere.
///
/// | id | adds, deg/s | plausible | source |
/// |---|---|---|---|
/// | `scale_factor_temperature` | s (T - T_ref) Omega | 1e-5 to 1e-3 1/K | Cao et al. (scale factor against mode split) |
/// | `scale_factor_nonlinearity` | n (Omega / fs)^2 Omega | 2e-5 to 5e-3 | data sheets: 25 to 178 ppm in good parts |
/// | `scale_factor_asymmetry` | k abs(Omega) | 1e-5 to 2e-3 | k; IEEE Std 528 for the term |
fn added_to_rate_dps(id: &str, parameters: &[f64], at: &Instant, sensed_dps: f64) -> Option<f64> {
    Some(match (id, parameters) {
        ("scale_factor_temperature", &[per_k, reference_degc]) => {
            per_k * (at.structure_degc - reference_degc) * sensed_dps
        }
        ("scale_factor_nonlinearity", &[n, full_scale_dps]) => {
            n * (sensed_dps / full_scale_dps).powi(2) * sensed_dps
        }
        ("scale_factor_asymmetry", &[k]) => k * sensed_dps.abs(),
        _ => return None,
    })
}

/// `output_deadband`: 0 within the half width (its ends included), unchanged beyond it. 0.01 to
/// 1 deg/s are plausible (k); IEEE Std 528 names the term.
fn beyond_deadband_dps(effects: &Effects, rate_dps: f64) -> f64 {
    match effects.get("output_deadband") {
        Some([half_width_dps]) if rate_dps.abs() <= half_width_dps => 0.0,
        _ => rate_dps,
    }
}

/// The applied rate as the sensor gives it at nominal scale factor, deg/s: the dead band first, then the
/// sum of the scale factor's errors at what it leaves. The applied rate itself without effects.
pub fn rate_dps(effects: &Effects, at: &Instant) -> f64 {
    let sensed = beyond_deadband_dps(effects, at.rate_dps);
    let errors = effects
        .iter()
        .filter_map(|(kind, values)| added_to_rate_dps(kind.id, values, at, sensed));
    errors.fold(sensed, |sum, error| sum + error)
}

/// `output_saturation`: the total of rate and bias, deg/s, limited to `low_dps ..= high_dps`.
/// Limits of 75 to 2000 deg/s are common; they differ where the output's zero is off centre (k).
pub fn limit_dps(effects: &Effects, total_dps: f64) -> f64 {
    match effects.get("output_saturation") {
        Some([low_dps, high_dps]) => total_dps.max(low_dps).min(high_dps),
        None => total_dps,
    }
}

/// `amplitude_phase_coupling`: what adds to the measured phase, rad, k (g - 1) at the drive gain g
/// relative to nominal.
///
/// A cubic stiffness shifts the resonance by delta f / f = 3/8 (k3/k1) A^2 (10 to 1000 ppm), which at
/// fixed frequency is a phase of 2 Q delta f / f; for small changes of the amplitude that is linear.
/// 1e-3 to 0.1 rad are plausible (Landau and Lifshitz, Mechanics, section 28-29; range k).
pub fn phase_pull_rad(effects: &Effects, agc_minus_1: f64) -> f64 {
    match effects.get("amplitude_phase_coupling") {
        Some([rad]) => rad * agc_minus_1,
        None => 0.0,
    }
}

/// The drive's quality factor at a temperature: with `damping_bias`, Q = `q0` (T/T0)^-gamma, T and T0
/// in K; else `q0`.
///
/// gamma is 0.5 for free molecular flow, 0.7 for viscous damping, 1 to 4 for thermoelastic damping
/// (Kim et al., MEMS 2006, 10.1109/MEMSYS.2006.1627868, measured up to 1 %/K).
pub fn quality_factor(effects: &Effects, q0: f64, structure_degc: f64, reference_k: f64) -> f64 {
    match effects.get("damping_bias") {
        Some([_, gamma]) => q0 * ((structure_degc + ZERO_CELSIUS_K) / reference_k).powf(-gamma),
        None => q0,
    }
}

/// `stiffness_second_order`: b (T - T0)^2, 1, the relative fall of the stiffness beside the
/// kappa (T - T0) of eq. 1. 20e-9 to 100e-9 1/K^2 for silicon (Jaakkola et al. 2014, arXiv 1401.1363).
pub fn stiffness_extra(effects: &Effects, above_reference_k: f64) -> f64 {
    match effects.get("stiffness_second_order") {
        Some([per_k2]) => per_k2 * (above_reference_k * above_reference_k),
        None => 0.0,
    }
}

/// What each effect that is on contributes at an instant, deg/s, in the catalogue's order: those on
/// the bias, and on the rate the part of [`rate_dps`] beyond the applied rate. They sum up to
/// `bias_dps + rate_dps - applied rate`. Effects with a memory (`stress_jump`), on the total
/// (`output_saturation`), on the structure or in the converters are not in it.
pub fn contributions(effects: &Effects, at: &Instant) -> Vec<(&'static str, f64)> {
    let sensed = beyond_deadband_dps(effects, at.rate_dps);
    let one = |id: &str, values: &[f64]| match id {
        "output_deadband" => Some(sensed - at.rate_dps),
        _ => {
            added_to_bias_dps(id, values, at).or_else(|| added_to_rate_dps(id, values, at, sensed))
        }
    };
    let on = effects.iter();
    on.filter_map(|(kind, values)| Some((kind.id, one(kind.id, values)?)))
        .collect()
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
pub fn mode_crossing_dps(
    amplitude_dps: f64,
    center_degc: f64,
    half_width_k: f64,
    degc: f64,
) -> f64 {
    let u = (degc - center_degc) / half_width_k;
    amplitude_dps * (2.0 * u / (1.0 + u * u))
}

/// `stress_jump`: a step of the bias where the structure passes a temperature, with its memory.
///
/// The stress of die attach or solder releases at the temperature plus half the hysteresis when it
/// warms, and returns at the temperature less half of it when it cools: a relay. A hysteresis wider
/// than the run makes a jump that stays. 0.05 to 5 deg/s, 0 to 40 K are plausible (k; jumps of
/// this kind: lead frames, InterPACK 2007).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StressJump {
    height_dps: f64,
    up_degc: f64,
    down_degc: f64,
    released: bool,
}

impl StressJump {
    /// The effect of `effects` in a structure that came to `degc` from the cold; `None` if it is off.
    pub fn new(effects: &Effects, degc: f64) -> Option<Self> {
        let [height_dps, temperature_degc, hysteresis_k] = effects.get("stress_jump")?;
        let half = hysteresis_k / 2.0;
        let (up_degc, down_degc) = (temperature_degc + half, temperature_degc - half);
        Some(StressJump {
            height_dps,
            up_degc,
            down_degc,
            released: degc >= up_degc,
        })
    }

    /// The bias that it adds, deg/s, once the structure has come to `degc`.
    pub fn step(&mut self, degc: f64) -> f64 {
        if degc >= self.up_degc {
            self.released = true;
        } else if degc < self.down_degc {
            self.released = false;
        }
        if self.released { self.height_dps } else { 0.0 }
    }
}

#[cfg(test)]
#[path = "effects_tests.rs"]
mod tests;
