//! A measured record through the compensation alone: the thermometer's and the rate's words as
//! firmware would read them.

use super::points::{Point, Points};
use super::{clamped_bias, compensation, thermometer_raw};
use crate::design::{Compensation, CompensationInput, Design};
use crate::emit::views::Language;
use crate::error::{InputError, Result};
use crate::numeric::format::Format;
use crate::numeric::rows::WordRows;
use crate::record::ThermalRecord;
use crate::thermal::BaselineFit;
use crate::vectors::model;
use crate::vectors::model::Model;
use crate::verify::firmware::{Built, Firmware};
use std::collections::BTreeMap;

/// Rows that go through the emitted code in one call, which holds their words in memory (convention).
const ROWS_AT_ONCE: usize = 1 << 16;

/// Every usable row of a record through every path.
///
/// # Errors
/// A rate that the firmware's word cannot hold; a driver that cannot be run.
pub fn points(
    design: &Design,
    fit: &BaselineFit,
    mut record: ThermalRecord,
    firmware: &Firmware,
) -> Result<Points> {
    let c = compensation(design)?;
    let format = rate_format(design, c);
    let rate_out = record.column("rate_out_dps").unwrap_or(&[]);
    check_range(design, c, format, &record, rate_out)?;
    let thermometer = record.column(&fit.thermometer).unwrap_or(&[]);
    let models = model::models(design, &firmware.bundle.program);
    let builds = [Language::C, Language::Rust].map(|language| firmware.built(language));
    let mut fixed = Vec::with_capacity(fit.rows.len());
    let mut other_words = builds.map(|built| built.map(|_| BTreeMap::new()));
    for rows in fit.rows.chunks(ROWS_AT_ONCE) {
        let mut thermometer_words = WordRows::new(1);
        let mut rate_words = Vec::with_capacity(rows.len());
        for &row in rows {
            thermometer_words.push([thermometer_raw(design, c, thermometer[row])]);
            let raw = rate_out[row] / (c.rate_full_scale_dps * format.lsb());
            let raw = (raw + 0.5).floor() as i128;
            rate_words.push(raw.clamp(format.min_raw(), format.max_raw()) as i64);
        }
        let due = through_model(&models, &thermometer_words, &rate_words);
        for (built, others) in builds.iter().zip(&mut other_words) {
            let (Some(built), Some(others)) = (built, others) else {
                continue;
            };
            let words = emitted(built, &thermometer_words, &rate_words)?;
            let differing = words.into_iter().zip(&due).enumerate();
            let differing = differing.filter(|(_, (word, due))| word != *due);
            others.extend(differing.map(|(k, (word, _))| (fixed.len() + k, word)));
        }
        fixed.extend(due);
    }

    let heating = trend(&fit.rows, thermometer);
    let bias: Vec<f64> = (fit.rows.iter())
        .map(|row| clamped_bias(fit, thermometer[*row]))
        .collect();
    let rows = (fit.rows.len() < record.len()).then(|| fit.rows.clone());
    let lsb = c.output.format.lsb();
    let degc = ["die_degc", "chamber_degc"];
    let degc = degc.into_iter().find(|name| record.column(name).is_some());
    let degc_is_thermometer = degc == Some(fit.thermometer.as_str());
    let mut taken = |name: &str| record.columns.remove(name).unwrap_or_default();
    let (rate_out, applied) = (taken("rate_out_dps"), taken("rate_dps"));
    let thermometer = taken(&fit.thermometer);
    let other_degc = degc.filter(|_| !degc_is_thermometer).map(taken);
    let time_s = record.time_s;
    Ok(Points::new(fit.rows.len(), move |k| {
        let row = rows.as_ref().map_or(k, |rows| rows[k]);
        // A rate that was not measured counts as none, as in the fit.
        let is_measured = |v: &&f64| v.is_finite();
        let applied_dps = *applied.get(row).filter(is_measured).unwrap_or(&0.0);
        let word_dps =
            |word: Option<&i64>| word.map_or(f64::NAN, |w| *w as f64 * lsb) - applied_dps;
        let emitted_dps = |others: &Option<BTreeMap<usize, i64>>| {
            let others = others.as_ref()?;
            Some(word_dps(others.get(&k).or(fixed.get(k))))
        };
        let before_dps = rate_out[row] - applied_dps;
        Point {
            time_s: time_s[row],
            thermometer: thermometer[row],
            temperature_degc: match &other_degc {
                Some(degc) => degc[row],
                None if degc_is_thermometer => thermometer[row],
                None => f64::NAN,
            },
            heating: heating[k],
            before_dps,
            float_dps: before_dps - bias[k],
            fixed_dps: word_dps(fixed.get(k)),
            c_dps: emitted_dps(&other_words[0]),
            rust_dps: emitted_dps(&other_words[1]),
        }
    }))
}

/// The rates that emitted code makes of thermometer and rate words.
fn emitted(built: &Built, thermometer: &WordRows, rates: &[i64]) -> Result<Vec<i64>> {
    let bias = built.call("bias", thermometer)?;
    let mut inputs = WordRows::new(2);
    for (rate, bias) in rates.iter().zip(bias) {
        inputs.push([i128::from(*rate), i128::from(bias)]);
    }
    built.call("rate", &inputs)
}

/// The word in which firmware reads the uncompensated rate.
fn rate_format(design: &Design, c: &Compensation) -> Format {
    match &c.input {
        CompensationInput::Phase | CompensationInput::TuningWord(_) => {
            design.circuit.decimator.output.format
        }
        CompensationInput::Channel(channel) => channel.rate_format,
    }
}

fn check_range(
    design: &Design,
    c: &Compensation,
    format: Format,
    record: &ThermalRecord,
    rate_out: &[f64],
) -> Result<()> {
    let full_scale = format.max_raw() as f64 * format.lsb() * c.rate_full_scale_dps;
    let beyond = rate_out.iter().position(|r| r.abs() > full_scale);
    let Some(row) = beyond else {
        return Ok(());
    };
    let error = InputError::new(format!(
        "rate_out_dps is {} deg/s {}, the firmware's rate word {format} ends at {full_scale:.3} deg/s",
        rate_out[row],
        record.at_place(row)
    ))
    .in_file(&record.source)
    .help(match design.compensation_is_own {
        true => "raise compensation.rate_full_scale_dps or the rate's format",
        false => "give the design a [compensation] of its own with a larger rate_full_scale_dps",
    });
    // A log has no lines.
    Err(match record.is_of_log() {
        true => error.into(),
        false => {
            let line = record.lines.get(row).copied().unwrap_or(0);
            error.at(line, 1).into()
        }
    })
}

/// The bit-accurate compensation of each row, raw.
fn through_model(models: &[Model], thermometer: &WordRows, rate: &[i64]) -> Vec<i64> {
    let named = |name: &str| models.iter().find(|m| m.name == name);
    let (Some(bias), Some(subtract)) = (named("bias"), named("rate")) else {
        return Vec::new();
    };
    let rows = thermometer.iter().zip(rate);
    rows.map(|(thermometer, rate)| {
        let (mut b, mut r) = ([0], [0]);
        bias.call(&[i128::from(thermometer[0])], &mut b);
        subtract.call(&[i128::from(*rate), b[0]], &mut r);
        r[0] as i64
    })
    .collect()
}

/// For each reading, whether the thermometer has been rising over the last readings; a thermometer
/// that falls when heated (a phase, a frequency) counts by its own sign.
fn trend(rows: &[usize], readings: &[f64]) -> Vec<bool> {
    const SPAN: usize = 5;
    let rises = |k: usize| {
        let (from, to) = (k.saturating_sub(SPAN), (k + SPAN).min(rows.len() - 1));
        readings[rows[to]] >= readings[rows[from]]
    };
    (0..rows.len()).map(rises).collect()
}
