//! Effects of the applied rate and of the output stage.

use super::dice::Dice;
use super::form::{Form, Plan, Sides};
use super::linear::range;
use super::world::World;
use crate::rng::Rng;

/// Largest magnitude of the applied rate, deg/s; None at rest.
fn full_scale(w: &World) -> Option<f64> {
    let (low, high) = range(&w.rate_dps);
    let top = low.abs().max(high.abs());
    (top > 0.0).then_some(top)
}

/// rate times s1 (T - T_ref).
pub fn scale_factor_temperature(w: &World, r: &mut Rng) -> Option<Plan> {
    full_scale(w)?;
    let exact_at = r.between(15.0, 30.0);
    let unit = w
        .rate_dps
        .iter()
        .zip(&w.temp_degc)
        .map(|(o, t)| o * (t - exact_at))
        .collect();
    Some(Plan::with(
        "scale_factor_temperature",
        Form::Linear(unit),
        &[("exact_at_degc", exact_at)],
    ))
}

/// Odd in rate: n3 (rate / full scale)^3; seldom sin(x) - x of a spring that stiffens, cubic to leading order.
pub fn scale_factor_nonlinearity(w: &World, r: &mut Rng) -> Option<Plan> {
    let top = full_scale(w)?;
    let bent = r.odds(0.2);
    let law = |x: f64| if bent { x.sin() - x } else { x.powi(3) };
    let unit = w.rate_dps.iter().map(|o| law(o / top)).collect();
    Some(Plan::with(
        "scale_factor_nonlinearity",
        Form::Linear(unit),
        &[("sine", f64::from(u8::from(bent)))],
    ))
}

/// Even in rate: rate^2, or |rate| (two slopes).
pub fn scale_factor_asymmetry(w: &World, r: &mut Rng) -> Option<Plan> {
    let top = full_scale(w)?;
    let slopes = r.odds(0.5);
    let law = |x: f64| if slopes { x.abs() } else { x * x };
    let unit = w.rate_dps.iter().map(|o| law(o / top)).collect();
    Some(Plan::with(
        "scale_factor_asymmetry",
        Form::Linear(unit),
        &[("two_slopes", f64::from(u8::from(slopes)))],
    ))
}

/// Response to `rate` with a dead zone of half width `d`: beyond it the full rate (`jumps`), or what is left of it.
pub fn dead_zone(rate: f64, d: f64, jumps: bool) -> f64 {
    if rate.abs() <= d {
        0.0
    } else if jumps {
        rate
    } else {
        rate - d * rate.signum()
    }
}

/// Dead zone of the applied rate, before the bias is added.
pub fn output_deadband(w: &World, r: &mut Rng) -> Option<Plan> {
    let top = full_scale(w)?;
    let jumps = r.odds(0.5);
    let rate = w.rate_dps.clone();
    let at = move |s: f64| {
        rate.iter()
            .map(|o| dead_zone(*o, 0.7 * top * s, jumps) - o)
            .collect()
    };
    Some(Plan::with(
        "output_deadband",
        Form::Tuned(Box::new(at)),
        &[
            ("jumps", f64::from(u8::from(jumps))),
            ("range_dps", 0.7 * top),
        ],
    ))
}

/// Clipping of the total output: both ends at one magnitude, at two, or one end.
pub fn output_saturation(_: &World, r: &mut Rng) -> Option<Plan> {
    let later = r.between(1.2, 3.0);
    let sides = r.pick(&[
        Sides::Symmetric,
        Sides::Symmetric,
        Sides::Upper,
        Sides::Lower,
        Sides::Uneven(later),
    ]);
    Some(Plan::of("output_saturation", Form::Clip(sides)))
}
