//! Which other effects of the catalogue would explain a contribution in this very experiment:
//! a dictionary of shapes for each id, from the channels that the record has, and the best multiple
//! correlation after projection off the declared model.

use super::catalogue::CATALOGUE;
use super::covariates::Auxiliary;
use super::form::{Sides, limits};
use super::heat::slope;
use super::heat_effects::{crossing, lagged, step};
use super::linear::{Span, centred, correlation, range};
use super::rate_effects::dead_zone;
use super::world::{T0_DEGC, World};

/// One way in which an id may look: columns that are fitted together.
type Shape = Vec<Vec<f64>>;

/// Log-spaced numbers.
fn spaced(low: f64, high: f64, n: usize) -> Vec<f64> {
    let ratio = (high / low).max(1.0);
    (0..n)
        .map(|k| low * ratio.powf(k as f64 / (n - 1) as f64))
        .collect()
}

/// All shapes of an id; empty where the record has not its channel.
fn shapes(id: &str, w: &World, channels: &[&str]) -> Vec<Shape> {
    let entry = super::catalogue::of(id);
    let has_clock = id == "warmup_transient";
    if entry
        .channel
        .is_some_and(|c| !has_clock && !channels.contains(&c))
    {
        return Vec::new();
    }
    let one = |v: Vec<f64>| vec![vec![v]];
    let row_s = w.clock.row_s;
    match id {
        "thermal_lag" => spaced(
            row_s.max(30.0),
            (w.length_s() / 3.0).min(2000.0).max(2.0 * row_s),
            14,
        )
        .into_iter()
        .map(|tau| {
            let late = lagged(w, tau, false);
            vec![late.iter().zip(&w.temp_degc).map(|(l, t)| l - t).collect()]
        })
        .collect(),
        "temperature_rate" => one(w.rows_of(&slope(&w.heat_degc, w.clock.fine_s))),
        "warmup_transient" => warmups(w, channels.contains(&"time_since_power_on_s")),
        "ageing_drift" => {
            let mut all = one(w.time_s.clone());
            for t0 in spaced(0.01 * w.length_s(), 2.0 * w.length_s(), 8) {
                all.push(vec![w.time_s.iter().map(|t| (t / t0).ln_1p()).collect()]);
            }
            all
        }
        "bias_third_order" => one(centred(&w.reading()).iter().map(|u| u.powi(3)).collect()),
        "mode_crossing" => crossings(w),
        "stress_jump" => jumps(w),
        "damping_bias" => one(w.agc.clone()),
        "quadrature_leakage" => one(w.quad_dps.clone()),
        "demod_phase_drift" => one(product(&w.quad_dps, &w.temp_degc, T0_DEGC)),
        "supply_sensitivity" => one(w.supply_v.clone()),
        "g_sensitivity" => one(w.accel_g.clone()),
        "g_squared_sensitivity" => one(w.accel_g.iter().map(|a| a * a).collect()),
        "amplitude_phase_coupling" => coupling(w),
        "periodic_pickup" => tones(w),
        _ => of_rate(id, w),
    }
}

/// `a (b - b0)`.
fn product(a: &[f64], b: &[f64], b0: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x * (y - b0)).collect()
}

/// Exponentials since power-on, or since the start where the record does not know of power-ons.
fn warmups(w: &World, known: bool) -> Vec<Shape> {
    let since = if known { &w.on_s } else { &w.time_s };
    spaced(
        (2.0 * w.clock.row_s).max(30.0),
        (w.length_s() / 2.0).min(4000.0),
        14,
    )
    .into_iter()
    .map(|tau| vec![since.iter().map(|t| (-t / tau).exp()).collect()])
    .collect()
}

/// Absorptive and dispersive resonances over the range of temperature.
fn crossings(w: &World) -> Vec<Shape> {
    let (low, high) = range(&w.temp_degc);
    let mut all = Vec::new();
    for k in 1..16 {
        for width in [0.02, 0.04, 0.08, 0.12] {
            let (c, s) = (
                low + (high - low) * f64::from(k) / 16.0,
                width * (high - low),
            );
            all.push(vec![
                crossing(&w.temp_degc, c, s, 0.0),
                crossing(&w.temp_degc, c, s, 1.0),
            ]);
        }
    }
    all
}

/// Steps over the range of temperature, with several gaps.
fn jumps(w: &World) -> Vec<Shape> {
    let (low, high) = range(&w.temp_degc);
    let mut all = Vec::new();
    for k in 2..23 {
        for gap in [0.0, 0.05, 0.12, 0.25] {
            let c = low + (high - low) * f64::from(k) / 24.0;
            all.push(vec![w.rows_of(&step(
                &w.heat_degc,
                c,
                gap * (high - low),
                false,
            ))]);
        }
    }
    all
}

/// Slope of the declared bias times the gain.
fn coupling(w: &World) -> Vec<Shape> {
    if w.protocol.thermometer != "phase_rad" {
        return Vec::new();
    }
    let u: Vec<f64> = w
        .reading()
        .iter()
        .map(|p| (p - w.middle) / w.half)
        .collect();
    let slope = |u: &f64| w.bias_dps[1] + 2.0 * w.bias_dps[2] * u;
    vec![vec![
        u.iter()
            .zip(&w.agc)
            .map(|(u, g)| slope(u) * (g - 1.0))
            .collect(),
    ]]
}

/// Sine and cosine at three to a hundred turns over the run.
fn tones(w: &World) -> Vec<Shape> {
    let most = (w.protocol.rows as f64 / 3.0).min(80.0);
    let count = ((most - 3.0) * 2.0).max(1.0) as usize;
    (0..count)
        .map(|k| {
            let period = w.length_s() / (3.0 + 0.5 * k as f64);
            vec![w.sine(period, 0.0), w.sine(period, 0.25)]
        })
        .collect()
}

/// Laws of the applied rate, and clipping.
fn of_rate(id: &str, w: &World) -> Vec<Shape> {
    let (low, high) = range(&w.rate_dps);
    let top = low.abs().max(high.abs());
    let law = |f: &dyn Fn(f64) -> f64| vec![w.rate_dps.iter().map(|o| f(*o)).collect::<Vec<f64>>()];
    if top == 0.0 && id != "output_saturation" {
        return Vec::new();
    }
    match id {
        "scale_factor_temperature" => vec![vec![
            w.rate_dps.clone(),
            product(&w.rate_dps, &w.temp_degc, T0_DEGC),
        ]],
        "scale_factor_nonlinearity" => vec![law(&|o| (o / top).powi(3))],
        "scale_factor_asymmetry" => vec![law(&|o| o * o), law(&|o| o.abs())],
        "output_deadband" => spaced(0.01, 0.6, 8)
            .into_iter()
            .flat_map(|s| [true, false].map(|j| law(&|o| dead_zone(o, s * top, j) - o)))
            .collect(),
        _ => {
            let total: Vec<f64> = (0..w.len())
                .map(|k| w.rate_dps[k] + w.bias_at(w.p[k]))
                .collect();
            let mut all = Vec::new();
            for sides in [Sides::Symmetric, Sides::Upper, Sides::Lower] {
                for s in [0.02, 0.1, 0.3, 0.6] {
                    let (a, b) = limits(sides, &total, s);
                    all.push(vec![total.iter().map(|x| x.clamp(a, b) - x).collect()]);
                }
            }
            all
        }
    }
}

/// Every other id (and every auxiliary column, as a cubic) with its best correlation with `target` once the declared
/// model and `others` (what else is planted) are projected away; largest first.
pub fn rivals(
    w: &World,
    own: &str,
    target: &[f64],
    others: &[&[f64]],
    channels: &[&str],
    auxiliaries: &[Auxiliary],
) -> Vec<(String, f64)> {
    let mut base = Span::declared(&w.reading());
    others.iter().for_each(|c| base.add(c));
    let best = |all: Vec<Shape>| {
        let of = |s: &Shape| correlation(&base, s, target);
        all.iter().map(of).fold(0.0, f64::max)
    };
    let mut out: Vec<(String, f64)> = CATALOGUE
        .iter()
        .filter(|e| e.id != own)
        .map(|e| (e.id.to_owned(), best(shapes(e.id, w, channels))))
        .collect();
    for a in auxiliaries {
        let id = format!("covariate:{}", a.name);
        if id != own {
            let u = centred(&a.values);
            let powers = [1, 2, 3].map(|k| u.iter().map(|x| x.powi(k)).collect());
            out.push((id, best(vec![powers.to_vec()])));
        }
    }
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out
}
