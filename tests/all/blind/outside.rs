//! Causes that the catalogue does not have. A record with one must not get a confident name.

use super::catalogue::Need;
use super::dice::Dice;
use super::form::{Form, Plan};
use super::heat::play;
use super::linear::{centred, range};
use super::world::World;
use crate::rng::Rng;
use std::f64::consts::TAU;

/// A cause outside the catalogue.
pub struct Outsider {
    pub id: &'static str,
    pub draw: fn(&World, &mut Rng) -> Plan,
    pub needs: &'static [Need],
    /// The channel in which what is left shows, if the record has one.
    pub channel: Option<&'static str>,
    /// Ids that come near: they may be taken if `residual_structure.left` says that more is there.
    pub nearest: &'static [&'static str],
}

/// All of them.
pub const OUTSIDERS: [Outsider; 11] = [
    Outsider {
        id: "outside:supply_squared",
        draw: supply_squared,
        needs: &[Need::Supply],
        channel: Some("supply_v"),
        nearest: &["supply_sensitivity"],
    },
    Outsider {
        id: "outside:supply_times_temperature",
        draw: supply_times_temperature,
        needs: &[Need::Supply, Need::Heat],
        channel: Some("supply_v"),
        nearest: &["supply_sensitivity"],
    },
    Outsider {
        id: "outside:accel_times_rate",
        draw: accel_times_rate,
        needs: &[Need::Accel, Need::Rate],
        channel: Some("accel_g"),
        nearest: &["g_sensitivity", "g_squared_sensitivity"],
    },
    Outsider {
        id: "outside:gain_cubed",
        draw: gain_cubed,
        needs: &[Need::Damping],
        channel: Some("agc"),
        nearest: &["damping_bias"],
    },
    Outsider {
        id: "outside:quadrature_squared",
        draw: quadrature_squared,
        needs: &[Need::Quadrature],
        channel: Some("quad_dps"),
        nearest: &["quadrature_leakage"],
    },
    Outsider {
        id: "outside:play_hysteresis",
        draw: play_hysteresis,
        needs: &[Need::Heat],
        channel: None,
        nearest: &[
            "stress_jump",
            "thermal_lag",
            "temperature_rate",
            "bias_third_order",
        ],
    },
    Outsider {
        id: "outside:fringes_in_temperature",
        draw: fringes,
        needs: &[Need::Heat],
        channel: None,
        nearest: &["bias_third_order", "mode_crossing"],
    },
    Outsider {
        id: "outside:chirp",
        draw: chirp,
        needs: &[],
        channel: None,
        nearest: &["periodic_pickup"],
    },
    Outsider {
        id: "outside:telegraph",
        draw: telegraph,
        needs: &[],
        channel: None,
        nearest: &[],
    },
    Outsider {
        id: "outside:bump_in_time",
        draw: bump,
        needs: &[],
        channel: None,
        nearest: &[],
    },
    Outsider {
        id: "outside:rate_delay",
        draw: rate_delay,
        needs: &[Need::Rate],
        channel: Some("rate_dps"),
        nearest: &[],
    },
];

/// Levels that jump at times of their own: only on request, so that the draws of [`OUTSIDERS`] stay what they are.
const LEVEL_JUMPS: Outsider = Outsider {
    id: "outside:level_jumps",
    draw: level_jumps,
    needs: &[],
    channel: None,
    nearest: &[],
};

/// The cause of an id.
pub fn of(id: &str) -> &'static Outsider {
    OUTSIDERS
        .iter()
        .chain([&LEVEL_JUMPS])
        .find(|o| o.id == id)
        .unwrap_or_else(|| panic!("no cause {id}"))
}

/// One to four jumps in time, of sizes within a factor of three of each other.
fn level_jumps(w: &World, r: &mut Rng) -> Plan {
    let all = w.length_s();
    let jumps: Vec<(f64, f64)> = (0..r.range(1, 4))
        .map(|_| (all * r.between(0.1, 0.9), r.sign() * r.spread(0.6, 1.8)))
        .collect();
    let level = |t: &f64| jumps.iter().filter(|j| j.0 <= *t).map(|j| j.1).sum();
    let unit = w.time_s.iter().map(level).collect();
    Plan::with(
        "outside:level_jumps",
        Form::Linear(unit),
        &[("jumps", jumps.len() as f64)],
    )
}

/// (V - V_middle)^2.
fn supply_squared(w: &World, _: &mut Rng) -> Plan {
    let u = centred(&w.supply_v);
    Plan::of(
        "outside:supply_squared",
        Form::Linear(u.iter().map(|x| x * x).collect()),
    )
}

/// V T, both centred: a reference whose temperature coefficient depends on the supply.
fn supply_times_temperature(w: &World, _: &mut Rng) -> Plan {
    let (v, t) = (centred(&w.supply_v), w.warmth());
    Plan::of(
        "outside:supply_times_temperature",
        Form::Linear(v.iter().zip(&t).map(|(a, b)| a * b).collect()),
    )
}

/// a rate: acceleration changes the gap and with it the scale factor.
fn accel_times_rate(w: &World, _: &mut Rng) -> Plan {
    let unit = w
        .accel_g
        .iter()
        .zip(&w.rate_dps)
        .map(|(a, o)| a * o)
        .collect();
    Plan::of("outside:accel_times_rate", Form::Linear(unit))
}

/// Cube of the gain about its middle.
fn gain_cubed(w: &World, _: &mut Rng) -> Plan {
    let unit = centred(&w.agc)
        .iter()
        .map(|g| g.powi(3) - 0.6 * g)
        .collect();
    Plan::of("outside:gain_cubed", Form::Linear(unit))
}

/// Square of the quadrature about its middle.
fn quadrature_squared(w: &World, _: &mut Rng) -> Plan {
    let unit = centred(&w.quad_dps).iter().map(|q| q * q).collect();
    Plan::of("outside:quadrature_squared", Form::Linear(unit))
}

/// Rate-independent hysteresis of glue: play operator of the temperature.
fn play_hysteresis(w: &World, r: &mut Rng) -> Plan {
    let (low, high) = range(&w.temp_degc);
    let half = r.between(0.08, 0.25) * (high - low);
    let unit = w.rows_of(&play(&w.heat_degc, half));
    Plan::with(
        "outside:play_hysteresis",
        Form::Linear(unit),
        &[("half_width_k", half)],
    )
}

/// sin(2 pi T / period): standing wave, 2.5 to 6 fringes over the range.
fn fringes(w: &World, r: &mut Rng) -> Plan {
    let (n, lead) = (r.between(2.5, 6.0), r.unit());
    let unit = w
        .warmth()
        .iter()
        .map(|u| (TAU * (0.5 * n * u + lead)).sin())
        .collect();
    Plan::with(
        "outside:fringes_in_temperature",
        Form::Linear(unit),
        &[("fringes", n)],
    )
}

/// A tone whose frequency grows with time by a factor of 3 to 6.
fn chirp(w: &World, r: &mut Rng) -> Plan {
    let (first, grow, all) = (r.between(3.0, 6.0), r.between(3.0, 6.0), w.length_s());
    let unit = w
        .time_s
        .iter()
        .map(|t| {
            let x = t / all;
            (TAU * first * (x + 0.5 * (grow - 1.0) * x * x)).sin()
        })
        .collect();
    Plan::with(
        "outside:chirp",
        Form::Linear(unit),
        &[("turns_first", first), ("grows", grow)],
    )
}

/// Two states of a trap, exponential dwell times, nothing measured.
fn telegraph(w: &World, r: &mut Rng) -> Plan {
    let mean_rows = r.between(0.03, 0.1) * w.protocol.rows as f64;
    let (mut state, mut left) = (0.0, 0.0);
    let mut raw = Vec::with_capacity(w.protocol.rows);
    for _ in 0..w.protocol.rows {
        if left <= 0.0 {
            state = 1.0 - state;
            left = -mean_rows * (1.0 - r.unit()).ln();
        }
        left -= 1.0;
        raw.push(state);
    }
    let unit = w.grid.iter().map(|k| raw[*k]).collect();
    Plan::with(
        "outside:telegraph",
        Form::Linear(unit),
        &[("mean_rows", mean_rows)],
    )
}

/// A disturbance that comes and goes once: exp(-(t - t0)^2 / (2 s^2)).
fn bump(w: &World, r: &mut Rng) -> Plan {
    let all = w.length_s();
    let (t0, s) = (all * r.between(0.2, 0.8), all * r.between(0.03, 0.1));
    let unit = w
        .time_s
        .iter()
        .map(|t| (-0.5 * ((t - t0) / s).powi(2)).exp())
        .collect();
    Plan::with(
        "outside:bump_in_time",
        Form::Linear(unit),
        &[("at_s", t0), ("width_s", s)],
    )
}

/// The output follows the rate late, so that it errs where the rate has just changed.
fn rate_delay(w: &World, r: &mut Rng) -> Plan {
    let rows = r.between(0.6, 2.5);
    let late = super::heat::lag_stepwise(&w.rate_dps, 1.0, rows);
    let unit = late.iter().zip(&w.rate_dps).map(|(l, o)| l - o).collect();
    Plan::with("outside:rate_delay", Form::Linear(unit), &[("rows", rows)])
}
