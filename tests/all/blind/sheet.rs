//! From world, contributions and noise to the CSV text: columns, read noise, digits, missing cells.

use super::covariates::Auxiliary;
use super::dice::Dice;
use super::linear::{Span, deviation, rms};
use super::world::World;
use crate::rng::Rng;
use std::fmt::Write;

/// A column ready to be written.
struct Column {
    name: String,
    values: Vec<f64>,
    decimals: usize,
}

/// Digits that carry `step`, the finest that means anything in this column.
fn decimals(step: f64) -> usize {
    (1.0 - step.max(1e-13).log10()).ceil().clamp(1.0, 13.0) as usize
}

/// True values of a channel by its contract name.
fn truth_of<'a>(w: &'a World, name: &str) -> &'a [f64] {
    match name {
        "chamber_degc" => &w.chamber_degc,
        "die_degc" => &w.die_degc,
        "phase_rad" => &w.phase_rad,
        "freq_hz" => &w.freq_hz,
        "agc" => &w.agc,
        "quad_dps" => &w.quad_dps,
        "supply_v" => &w.supply_v,
        "accel_g" => &w.accel_g,
        "rate_dps" => &w.rate_dps,
        "time_since_power_on_s" => &w.on_s,
        other => panic!("no channel {other}"),
    }
}

/// Values and decimals of a channel as it is read: the thermometer errs by a few per cent of the noise it would make in
/// the output, other channels by a few thousandths of what of them is orthogonal to the declared model.
fn reading(w: &World, name: &str, r: &mut Rng) -> Column {
    let is_thermometer = name == w.protocol.thermometer;
    let values = if is_thermometer {
        w.reading()
    } else {
        truth_of(w, name).to_vec()
    };
    let noise = match name {
        "rate_dps" => 0.0,
        "time_since_power_on_s" => 0.0,
        _ if is_thermometer => {
            r.between(0.02, 0.1) * (w.sigma_dps / w.steepest()).min(0.1 * w.half)
        }
        "die_degc" | "chamber_degc" => r.between(0.002, 0.05),
        _ => {
            let free = rms(&Span::declared(&w.reading()).residual(&values));
            let typical = rms(&values).max(1e-3);
            r.between(0.001, 0.004)
                * free.max(if free < 1e-6 * typical {
                    0.01 * typical
                } else {
                    0.0
                })
        }
    };
    let digits = match name {
        "rate_dps" => 4,
        "time_since_power_on_s" => 3,
        _ => decimals(0.5 * noise),
    };
    Column {
        name: name.to_owned(),
        values: values.iter().map(|v| v + noise * r.gauss()).collect(),
        decimals: digits,
    }
}

/// The text of the record. `output_dps` is the column `rate_out_dps`.
pub fn csv(
    w: &World,
    channels: &[&str],
    auxiliaries: &[Auxiliary],
    output_dps: &[f64],
    r: &mut Rng,
) -> String {
    let mut columns: Vec<Column> = channels.iter().map(|name| reading(w, name, r)).collect();
    for a in auxiliaries {
        let step = 0.003 * deviation(&a.values);
        columns.push(Column {
            name: a.name.to_owned(),
            values: a.values.clone(),
            decimals: decimals(step),
        });
    }
    r.shuffle(&mut columns);
    columns.insert(
        r.range(0, columns.len() as i64) as usize,
        Column {
            name: "rate_out_dps".to_owned(),
            values: output_dps.to_vec(),
            decimals: decimals(0.1 * w.sigma_dps),
        },
    );
    let holes = if r.odds(0.15) {
        r.between(0.001, 0.01)
    } else {
        0.0
    };
    let blank = r.pick(&["", "nan"]);
    let mut text = String::new();
    if r.odds(0.3) {
        text.push_str("# thermal record, averaged readings\n");
    }
    text.push_str("time_s");
    columns.iter().for_each(|c| text.extend([",", &c.name]));
    text.push('\n');
    for k in 0..w.len() {
        let _ = write!(text, "{:.3}", w.time_s[k]);
        for c in &columns {
            let keep = c.name == "rate_dps" || c.name == "time_since_power_on_s";
            if !keep && r.odds(holes) {
                let _ = write!(text, ",{blank}");
            } else {
                let _ = write!(text, ",{:.*}", c.decimals, c.values[k]);
            }
        }
        text.push('\n');
    }
    text
}
