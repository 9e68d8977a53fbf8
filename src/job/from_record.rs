//! A measured record through the compensation alone: the thermometer's and the rate's words as
//! firmware would read them.

use super::outcome::Point;
use super::{clamped_bias, compensation, thermometer_raw};
use crate::design::{Compensation, CompensationInput, Design};
use crate::emit::views::Language;
use crate::error::{InputError, Result};
use crate::numeric::format::Format;
use crate::record::ThermalRecord;
use crate::thermal::BaselineFit;
use crate::vectors::model;
use crate::vectors::model::Model;
use crate::verify::firmware::{Built, Firmware};

/// Every usable row through every path.
///
/// # Errors
/// A rate that the firmware's word cannot hold; a driver that cannot be run.
pub fn points(
    design: &Design,
    fit: &BaselineFit,
    record: &ThermalRecord,
    firmware: &Firmware,
) -> Result<Vec<Point>> {
    let c = compensation(design)?;
    let thermometer = record.column(&fit.thermometer).unwrap_or(&[]);
    let rate_out = record.column("rate_out_dps").unwrap_or(&[]);
    let applied = record.column("rate_dps");
    // A rate that was not measured counts as none, as in the fit.
    let applied_at = |row: usize| {
        applied
            .map(|a| a[row])
            .filter(|v| v.is_finite())
            .unwrap_or(0.0)
    };
    let format = rate_format(design, c);
    check_range(design, c, format, record, rate_out)?;

    let mut thermometer_words = Vec::new();
    let mut rate_words = Vec::new();
    for &row in &fit.rows {
        thermometer_words.push(vec![thermometer_raw(design, c, thermometer[row])]);
        let raw = (rate_out[row] / (c.rate_full_scale_dps * format.lsb()) + 0.5).floor() as i128;
        rate_words.push(raw.clamp(format.min_raw(), format.max_raw()));
    }
    let models = model::models(design, &firmware.bundle.program);
    let fixed = through_model(&models, &thermometer_words, &rate_words);
    let emitted = |built: &Built| -> Result<Vec<i128>> {
        let bias = built.call("bias", &thermometer_words, 1)?;
        let inputs: Vec<Vec<i128>> = rate_words
            .iter()
            .zip(&bias)
            .map(|(rate, bias)| vec![*rate, bias[0]])
            .collect();
        Ok(built
            .call("rate", &inputs, 1)?
            .into_iter()
            .map(|r| r[0])
            .collect())
    };
    let of = |language| firmware.built(language).map(emitted).transpose();
    let (c_words, rust_words) = (of(Language::C)?, of(Language::Rust)?);
    let temperature = ["die_degc", "chamber_degc"]
        .iter()
        .find_map(|name| record.column(name));
    let lsb = c.output.format.lsb();
    let word = |words: &[i128], k: usize| words.get(k).map_or(f64::NAN, |w| *w as f64 * lsb);
    let heating = trend(&fit.rows.iter().map(|r| thermometer[*r]).collect::<Vec<_>>());
    Ok(fit
        .rows
        .iter()
        .enumerate()
        .map(|(k, &row)| Point {
            time_s: record.time_s[row],
            thermometer: thermometer[row],
            temperature_degc: temperature.map_or(f64::NAN, |t| t[row]),
            heating: heating[k],
            before_dps: rate_out[row] - applied_at(row),
            float_dps: rate_out[row] - applied_at(row) - clamped_bias(fit, thermometer[row]),
            fixed_dps: word(&fixed, k) - applied_at(row),
            c_dps: c_words
                .as_ref()
                .map(|words| word(words, k) - applied_at(row)),
            rust_dps: rust_words
                .as_ref()
                .map(|words| word(words, k) - applied_at(row)),
        })
        .collect())
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
    Err(InputError::new(format!(
        "rate_out_dps is {} deg/s, the firmware's rate word {format} ends at {full_scale:.3} deg/s",
        rate_out[row]
    ))
    .in_file(&record.source)
    .at(record.lines.get(row).copied().unwrap_or(0), 1)
    .help(match design.compensation_is_own {
        true => "raise compensation.rate_full_scale_dps or the rate's format",
        false => "give the design a [compensation] of its own with a larger rate_full_scale_dps",
    })
    .into())
}

/// The bit-accurate compensation of each row, raw.
fn through_model(models: &[Model], thermometer: &[Vec<i128>], rate: &[i128]) -> Vec<i128> {
    let named = |name: &str| models.iter().find(|m| m.name == name);
    let (Some(bias), Some(subtract)) = (named("bias"), named("rate")) else {
        return Vec::new();
    };
    let rows = thermometer.iter().zip(rate);
    rows.map(|(thermometer, rate)| {
        let (mut b, mut r) = ([0], [0]);
        bias.call(thermometer, &mut b);
        subtract.call(&[*rate, b[0]], &mut r);
        r[0]
    })
    .collect()
}

/// For each reading, whether the thermometer has been rising over the last readings; a thermometer
/// that falls when heated (a phase, a frequency) counts by its own sign.
fn trend(readings: &[f64]) -> Vec<bool> {
    const SPAN: usize = 5;
    (0..readings.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(SPAN), (k + SPAN).min(readings.len() - 1));
            readings[to] >= readings[from]
        })
        .collect()
}
