//! Effects of temperature, its history, and time.

use super::dice::Dice;
use super::form::{Form, Plan};
use super::heat::{lag_runge_kutta, lag_stepwise, slope};
use super::linear::{centred, range};
use super::world::World;
use crate::rng::Rng;

/// A temperature that lags the thermometer's by `tau_s`, on the rows, degC.
pub fn lagged(w: &World, tau_s: f64, smooth: bool) -> Vec<f64> {
    let f = if smooth {
        lag_runge_kutta
    } else {
        lag_stepwise
    };
    w.rows_of(&f(&w.heat_degc, w.clock.fine_s, tau_s))
}

/// Part of the bias follows a lagging temperature: tau dT_l/dt = T - T_l, and either
/// k (T_l - T) or a (B(T_l) - B(T)) with the device's own bias curve B. effects.md, section A: tau 30..900 s.
pub fn thermal_lag(w: &World, r: &mut Rng) -> Option<Plan> {
    let fastest = (3.0 * w.clock.row_s).max(30.0);
    let slowest = (w.length_s() / 6.0).min(900.0);
    if slowest < 1.5 * fastest {
        return None;
    }
    let tau_s = r.spread(fastest, slowest);
    let late = lagged(w, tau_s, r.odds(0.5));
    let unit = if r.odds(0.6) {
        late.iter().zip(&w.temp_degc).map(|(l, t)| l - t).collect()
    } else {
        let (low, high) = range(&w.temp_degc);
        let (mid, half) = (0.5 * (low + high), 0.5 * (high - low));
        let [_, b, c] = w.bias_dps;
        let curve = |t: f64| (b + c * (t - mid) / half) * (t - mid) / half;
        late.iter()
            .zip(&w.temp_degc)
            .map(|(l, t)| curve(*l) - curve(*t))
            .collect()
    };
    Some(Plan::with(
        "thermal_lag",
        Form::Linear(unit),
        &[("tau_s", tau_s)],
    ))
}

/// k dT/dt: a gradient across the die bends it. K/s.
pub fn temperature_rate(w: &World, _: &mut Rng) -> Option<Plan> {
    let rate = w.rows_of(&slope(&w.heat_degc, w.clock.fine_s));
    Some(Plan::of("temperature_rate", Form::Linear(rate)))
}

/// exp(-t_on / tau) after each power-on; a short rest leaves part of the heat:
/// the start is 1 - exp(-t_off / tau). effects.md: tau 60..2000 s.
pub fn warmup_transient(w: &World, r: &mut Rng) -> Option<Plan> {
    let cycle_s = w.length_s() / w.protocol.power_cycles as f64;
    let (fastest, slowest) = ((4.0 * w.clock.row_s).max(30.0), (cycle_s / 3.0).min(2000.0));
    if slowest < 1.3 * fastest {
        return None;
    }
    let tau_s = r.spread(fastest, slowest);
    let partly = r.odds(0.3);
    let unit = (0..w.len())
        .map(|k| {
            let rest = w.clock.off_before_s[w.at[k]];
            let start = if partly {
                1.0 - (-4.0 * rest / tau_s).exp()
            } else {
                1.0
            };
            start * (-w.on_s[k] / tau_s).exp()
        })
        .collect();
    Some(Plan::with(
        "warmup_transient",
        Form::Linear(unit),
        &[("tau_s", tau_s)],
    ))
}

/// t, or ln(1 + t / t0): creep and settling of stress.
pub fn ageing_drift(w: &World, r: &mut Rng) -> Option<Plan> {
    let all = w.length_s();
    let (unit, t0) = if r.odds(0.5) {
        (w.time_s.iter().map(|t| t / all).collect(), f64::INFINITY)
    } else {
        let t0 = all * r.spread(0.02, 1.0);
        (w.time_s.iter().map(|t| (t / t0).ln_1p()).collect(), t0)
    };
    Some(Plan::with(
        "ageing_drift",
        Form::Linear(unit),
        &[("t0_s", t0)],
    ))
}

/// (u - u0)^3 in the thermometer reading u, scaled to -1..1.
pub fn bias_third_order(w: &World, r: &mut Rng) -> Option<Plan> {
    let from = r.between(-0.3, 0.3);
    let unit = centred(&w.reading())
        .iter()
        .map(|u| (u - from).powi(3))
        .collect();
    Some(Plan::with(
        "bias_third_order",
        Form::Linear(unit),
        &[("centre", from)],
    ))
}

/// Where a parasitic mode's frequency crosses the drive's: energy goes to it as 1 / (1 + x^2), or the drive is
/// pulled to and fro as 2 x / (1 + x^2), or a mixture, with x = (T - T_c) / width.
pub fn mode_crossing(w: &World, r: &mut Rng) -> Option<Plan> {
    let (low, high) = range(&w.temp_degc);
    let centre = low + (high - low) * r.between(0.2, 0.8);
    let width = (high - low) * r.between(0.02, 0.12);
    let turn = r.pick(&[0.0, 0.0, 1.0, 0.5]);
    let unit: Vec<f64> = crossing(&w.temp_degc, centre, width, turn);
    let touched = w
        .temp_degc
        .iter()
        .filter(|t| (*t - centre).abs() < width)
        .count();
    // Fewer rows are outliers to anybody.
    let parameters = [
        ("centre_degc", centre),
        ("width_k", width),
        ("dispersive", turn),
    ];
    (touched >= 12).then(|| Plan::with("mode_crossing", Form::Linear(unit), &parameters))
}

/// Resonance shape: absorptive for `turn` 0, dispersive for 1.
pub fn crossing(temp: &[f64], centre: f64, width: f64, turn: f64) -> Vec<f64> {
    temp.iter()
        .map(|t| {
            let x = (t - centre) / width;
            ((1.0 - turn) + turn * 2.0 * x) / (1.0 + x * x)
        })
        .collect()
}

/// A step where the temperature crosses: 0 below, 1 above, going up at `centre + gap / 2`, back at `centre - gap / 2`;
/// `once`: it never goes back. On the fine grid.
pub fn step(heat: &[f64], centre: f64, gap: f64, once: bool) -> Vec<f64> {
    let mut high = heat.first().is_some_and(|t| *t > centre);
    heat.iter()
        .map(|t| {
            if *t > centre + 0.5 * gap {
                high = true;
            } else if *t < centre - 0.5 * gap && !once {
                high = false;
            }
            f64::from(u8::from(high))
        })
        .collect()
}

/// Stress that lets go at a temperature: sharp, with or without hysteresis; seldom a step that stays.
pub fn stress_jump(w: &World, r: &mut Rng) -> Option<Plan> {
    let (low, high) = range(&w.temp_degc);
    let centre = low + (high - low) * r.between(0.2, 0.8);
    let gap = if r.odds(0.5) {
        0.0
    } else {
        r.between(0.03, 0.25) * (high - low)
    };
    let once = r.odds(0.12);
    let unit = w.rows_of(&step(&w.heat_degc, centre, gap, once));
    let above = unit.iter().sum::<f64>() / unit.len() as f64;
    let parameters = [
        ("centre_degc", centre),
        ("gap_k", gap),
        ("once", f64::from(u8::from(once))),
    ];
    (0.08..=0.92)
        .contains(&above)
        .then(|| Plan::with("stress_jump", Form::Linear(unit), &parameters))
}
