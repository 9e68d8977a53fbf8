//! Effects of supply, acceleration, and interference.

use super::dice::Dice;
use super::form::{Form, Plan};
use super::world::World;
use crate::rng::Rng;

/// k_v (V - V0).
pub fn supply_sensitivity(w: &World, _: &mut Rng) -> Option<Plan> {
    let v0 = w.supply_v[0];
    let unit = w.supply_v.iter().map(|v| v - v0).collect();
    Some(Plan::of("supply_sensitivity", Form::Linear(unit)))
}

/// g1 a.
pub fn g_sensitivity(w: &World, _: &mut Rng) -> Option<Plan> {
    Some(Plan::of("g_sensitivity", Form::Linear(w.accel_g.clone())))
}

/// g2 a^2.
pub fn g_squared_sensitivity(w: &World, _: &mut Rng) -> Option<Plan> {
    let unit = w.accel_g.iter().map(|a| a * a).collect();
    Some(Plan::of("g_squared_sensitivity", Form::Linear(unit)))
}

/// A sine in time, 6 to 60 periods of at least 3.3 rows. A tone far above the row rate looks the same on evenly
/// spaced rows: f = n / row period + 1 / period.
pub fn periodic_pickup(w: &World, r: &mut Rng) -> Option<Plan> {
    let all = w.length_s();
    let shortest = (3.3 * w.clock.row_s).max(all / 60.0);
    let longest = all / 6.0;
    if shortest > longest {
        return None;
    }
    let period_s = r.spread(shortest, longest);
    let spacing = super::chamber::PER_ROW;
    let even = w.clock.rows.windows(2).all(|p| p[1] - p[0] == spacing);
    let order = if even {
        r.pick(&[0.0, 0.0, 1.0, 7.0])
    } else {
        0.0
    };
    let f_hz = 1.0 / period_s + order / w.clock.row_s;
    let unit = w.sine(1.0 / f_hz, r.unit());
    Some(Plan::with(
        "periodic_pickup",
        Form::Linear(unit),
        &[("frequency_hz", f_hz), ("seen_period_s", period_s)],
    ))
}
