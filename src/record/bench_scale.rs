//! What the columns of a bench capture are in: the scale from volts to codes, and the sample rate from a column of times.

use super::bench_cells::Named;
use super::bench_keys::Scale;
use super::bench_rows::ROWS_OF_A_TABLE;
use super::capture_meta::sidecar_name;
use crate::error::{InputError, Result};
use std::path::Path;

/// Mean distance from whole codes, codes, above which a scale is doubted: uniform ones have 0.25 (convention).
const BETWEEN_CODES: f64 = 0.1;
/// Cells without which no distance is told (convention).
const LEAST_CELLS: usize = 64;

/// The scale in the columns' own unit: both are in volts, or in millivolts.
pub(super) fn in_unit(path: &Path, scale: Scale, named: &Named, used: [usize; 2]) -> Result<Scale> {
    let [drive, sense] = used.map(|k| named.volts(k).unwrap_or(1.0));
    if drive != sense {
        return Err(InputError::new("drive and sense are in different units")
            .in_file(path)
            .help("write both in volts: `volts_per_code` holds for both")
            .into());
    }
    Ok(Scale {
        volts_per_code: scale.volts_per_code / drive,
        volts_at_code_0: scale.volts_at_code_0 / drive,
    })
}

/// An error that asks for the scale, without the place of `what`, which is no code; with the step that the values stand on, where
/// they do.
pub(super) fn no_scale(
    (path, what): (&Path, &str),
    named: &Named,
    used: [usize; 2],
    rows: &[Vec<f64>],
) -> InputError {
    let unit = named.volts(used[0]).unwrap_or(1.0);
    let seen = step(used, rows).map_or(String::new(), |step| {
        format!("; the values stand on steps of about {:.5e} V", step * unit)
    });
    InputError::new(format!("{what}, and the capture does not say what a code is"))
        .in_file(path)
        .help(format!(
            "codes are integers; for voltages write `volts_per_code = 0.0001` (the ADC's volts for one code; and `volts_at_code_0 = 0.0` where that is not 0) into {} \
             beside it, or as `# key = value` lines before the header{seen}",
            sidecar_name(path)
        ))
}

/// The smallest distance between the values, where all distances are whole multiples of it.
pub(super) fn step(used: [usize; 2], rows: &[Vec<f64>]) -> Option<f64> {
    let mut values: Vec<f64> = rows
        .iter()
        .flat_map(|row| used.map(|k| row.get(k).copied().unwrap_or(0.0)))
        .collect();
    values.sort_by(f64::total_cmp);
    let largest = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let gaps: Vec<f64> = values
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|d| *d > 1e-9 * largest)
        .collect();
    let least = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let on_it = |d: &f64| (d / least - (d / least).round()).abs() < 0.1;
    (gaps.len() >= LEAST_CELLS && gaps.iter().all(on_it)).then_some(least)
}

/// What is said where the values lie between the codes of a scale.
pub(super) fn between(scale: Scale, used: [usize; 2], rows: &[Vec<f64>]) -> Option<String> {
    let off: Vec<f64> = rows
        .iter()
        .flat_map(|row| used.map(|k| row.get(k).copied()))
        .flatten()
        .map(|v| scale.unrounded(v))
        .map(|c| (c - c.round()).abs())
        .collect();
    let mean = off.iter().sum::<f64>() / off.len().max(1) as f64;
    (off.len() >= LEAST_CELLS && mean > BETWEEN_CODES).then(|| {
        format!(
            "the values lie between the codes that `volts_per_code` makes ({mean:.2} codes from the nearest on average): if an ADC \
             of this scale wrote them, the scale or `volts_at_code_0` is wrong; otherwise they are quantised here"
        )
    })
}

/// The sample rate, Hz, from a column of times, to the digits that its steps agree on; and the column.
pub(super) fn sample_rate(named: &Named, rows: &[Vec<f64>]) -> Option<(f64, String)> {
    let column = (0..named.names.len()).find(|k| named.seconds(*k).is_some())?;
    let unit = named.seconds(column)?;
    let times: Vec<f64> = rows.iter().filter_map(|r| r.get(column).copied()).collect();
    let span = (times.last()? - times.first()?) * unit;
    let hz = (times.len() - 1) as f64 / span;
    (times.len() >= ROWS_OF_A_TABLE && hz.is_finite() && hz > 0.0)
        .then(|| (rounded(hz), named.shown(column)))
}

/// A number to twelve digits: what a product of decimals leaves behind them is no part of it.
pub(super) fn shown(value: f64) -> String {
    let value: f64 = format!("{value:.11e}").parse().unwrap_or(value);
    match value == 0.0 || (1e-3..1e7).contains(&value.abs()) {
        true => format!("{value}"),
        false => format!("{value:e}"),
    }
}

/// To six digits: printed times carry no more.
pub(super) fn rounded(hz: f64) -> f64 {
    format!("{hz:.5e}").parse().unwrap_or(hz)
}
