//! Effects of drive loop, damping, and demodulation.

use super::dice::Dice;
use super::form::{Form, Plan};
use super::world::{T0_DEGC, World};
use crate::rng::Rng;

/// Anisotropic damping: bias k (1/Q - 1), Q relative; or the bending of the measured phase by the changing Q
/// (eq. 7 with Q(T, t) in place of Q), which the declared quadratic does not know; or both as one.
pub fn damping_bias(w: &World, r: &mut Rng) -> Option<Plan> {
    if w.protocol.thermometer == "phase_rad" && r.odds(0.5) {
        let bent = (0..w.len())
            .map(|k| {
                let t = w.temp_degc[k];
                w.drive.phase_rad(t, w.drive.q * w.relative_q[k]) - w.drive.phase_rad(t, w.drive.q)
            })
            .collect();
        return Some(Plan::with(
            "damping_bias",
            Form::Pull(bent),
            &[("bends_phase", 1.0)],
        ));
    }
    let unit = w.relative_q.iter().map(|q| 1.0 / q - 1.0).collect();
    Some(Plan::of("damping_bias", Form::Linear(unit)))
}

/// sin(theta) times the quadrature, theta constant.
pub fn quadrature_leakage(w: &World, _: &mut Rng) -> Option<Plan> {
    Some(Plan::of(
        "quadrature_leakage",
        Form::Linear(w.quad_dps.clone()),
    ))
}

/// theta_1 (T - T_ref) times the quadrature; the phase is trimmed to zero at T_ref.
pub fn demod_phase_drift(w: &World, r: &mut Rng) -> Option<Plan> {
    let trimmed = r.pick(&[T0_DEGC, 25.0, 20.0]);
    let unit = w
        .quad_dps
        .iter()
        .zip(&w.temp_degc)
        .map(|(q, t)| q * (t - trimmed))
        .collect();
    Some(Plan::with(
        "demod_phase_drift",
        Form::Linear(unit),
        &[("trimmed_at_degc", trimmed)],
    ))
}

/// Duffing: the resonance moves by (3/8)(k3/k1) A^2 and the measured phase with it, so that the reading errs by
/// k (g^n - 1), g the drive gain or the amplitude, n = 1 or 2.
pub fn amplitude_phase_coupling(w: &World, r: &mut Rng) -> Option<Plan> {
    if w.protocol.thermometer != "phase_rad" {
        return None;
    }
    let by_gain = r.odds(0.75);
    let power = rng_power(r);
    let source = if by_gain { &w.agc } else { &w.amplitude };
    let unit = source.iter().map(|a| a.powi(power) - 1.0).collect();
    let parameters = [
        ("power", f64::from(power)),
        ("by_gain", f64::from(u8::from(by_gain))),
    ];
    Some(Plan::with(
        "amplitude_phase_coupling",
        Form::Pull(unit),
        &parameters,
    ))
}

/// 1 or 2.
fn rng_power(r: &mut Rng) -> i32 {
    if r.odds(0.5) { 1 } else { 2 }
}
