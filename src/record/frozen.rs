//! Channels that do not move although they should.
//!
//! Three signs are looked for: a measured channel that has one value throughout; a rate output
//! that repeats one value far longer than its own noise lets it; a thermometer that stands still
//! while another thermometer, or the bias itself, runs on.

use super::columns::{THERMOMETERS, unit_of};
use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::statistics::stats;

/// Adds a warning for each channel that stands still.
pub(super) fn check(record: &ThermalRecord, warnings: &mut Vec<Warning>) {
    for (name, values) in &record.columns {
        // Applied rate, supply, attitude and auxiliary columns may be settings that never change.
        let measured = THERMOMETERS.contains(&name.as_str())
            || matches!(name.as_str(), "rate_out_dps" | "agc" | "quad_dps");
        if let Some((low, high)) = stats::extremes(values)
            && low == high
        {
            if measured && record.measured(name) > 2 {
                warnings.push(Warning::on(
                    "frozen_channel",
                    name,
                    format!(
                        "{name} is {low} {} in every row. Nothing can be learnt from it, and the channel may be frozen. Check \
                         its sensor, or leave the column out",
                        unit_of(name)
                    ),
                ));
            }
            continue;
        }
        if name == "rate_out_dps" {
            warnings.extend(stuck_output(record, name, values));
        } else if THERMOMETERS.contains(&name.as_str()) {
            warnings.extend(stuck_thermometer(record, name, values));
        }
    }
}

/// The longest run of exactly equal measured values: (start row, number of rows).
fn longest_run(values: &[f64]) -> (usize, usize) {
    let mut best = (0, 0);
    let mut start = 0;
    while start < values.len() {
        let run = values[start..]
            .iter()
            .take_while(|v| **v == values[start])
            .count()
            .max(1);
        if run > best.1 && !values[start].is_nan() {
            best = (start, run);
        }
        start += run;
    }
    best
}

/// Where neighbours are equal with frequency q, a run of L rows is a coincidence of n q^L.
fn stuck_output(record: &ThermalRecord, name: &str, values: &[f64]) -> Option<Warning> {
    let (start, run) = longest_run(values);
    let pairs = values.len().saturating_sub(run);
    let equal = values.windows(2).filter(|w| w[0] == w[1]).count();
    let elsewhere = equal.saturating_sub(run.saturating_sub(1));
    // One pair more than was seen: a rule of succession, so that q is never 0.
    let q = (elsewhere as f64 + 1.0) / (pairs as f64 + 2.0);
    let chance = (values.len() as f64).ln() + run as f64 * q.ln();
    (run >= 10 && q < 0.7 && chance < (1e-9f64).ln()).then(|| {
        Warning::on(
            "frozen_channel",
            name,
            format!(
                "{name} stands at exactly {} for {run} rows from {}, while elsewhere {:.0} % \
                 of neighbouring rows differ: it froze, or it is clipped",
                values[start],
                record.place(start),
                100.0 * (1.0 - q)
            ),
        )
    })
}

/// A thermometer whose longest run of one value spans a time in which another thermometer moves
/// by a fifth of its range, or the error signal by more than half of its.
fn stuck_thermometer(record: &ThermalRecord, name: &str, values: &[f64]) -> Option<Warning> {
    let (start, run) = longest_run(values);
    if run < 10 || stats::distinct(values) < 5 {
        return None;
    }
    let rows = start..start + run;
    let moved = |other: &[f64]| -> Option<f64> {
        // Medians of nine rows, so that noise and glitches do not count as movement.
        let smooth = |v: &[f64]| -> Vec<f64> { v.chunks(9).map(stats::median).collect() };
        let (low, high) = stats::extremes(&smooth(other))?;
        let (a, b) = stats::extremes(&smooth(other.get(rows.clone())?))?;
        (high > low).then(|| (b - a) / (high - low))
    };
    let from = record.place(start);
    let stands = format!(
        "{name} stands at exactly {} {} for {run} rows from {from}, while",
        values[start],
        unit_of(name)
    );
    for other in THERMOMETERS.iter().filter(|o| **o != name) {
        let Some(column) = record.column(other) else {
            continue;
        };
        if let Some(part) = moved(column)
            && part > 0.2
        {
            return Some(Warning::on(
                "frozen_channel",
                name,
                format!(
                    "{stands} {other} moves by {:.0} % of its range",
                    100.0 * part
                ),
            ));
        }
    }
    let error = record.error_dps();
    // Only where the drift is well above the noise can its movement tell anything.
    let (low, high) = stats::extremes(&error)?;
    if high - low < 20.0 * stats::difference_noise(&error) {
        return None;
    }
    moved(&error).filter(|part| *part > 0.5).map(|part| {
        Warning::on(
            "frozen_channel",
            name,
            format!(
                "{stands} the error signal moves by {:.0} % of its range",
                100.0 * part
            ),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::super::thermal::parse;
    use crate::design::RecordMapping;
    use std::path::Path;

    /// The columns with a `frozen_channel` warning, and the codes of all other warnings.
    fn found(header: &str, rows: impl Iterator<Item = String>) -> Vec<String> {
        let text = format!("{header}\n{}\n", rows.collect::<Vec<_>>().join("\n"));
        let mapping = RecordMapping::default();
        let (_, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
        warnings
            .into_iter()
            .map(|w| match (w.code, w.column) {
                ("frozen_channel", Some(column)) => column,
                (code, _) => code.to_owned(),
            })
            .collect()
    }

    fn noise(k: usize) -> f64 {
        let x = (k as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        ((x ^ (x >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 40) as f64 / 16_777_216.0 - 0.5
    }

    #[test]
    fn constant_channels_are_named_and_settings_are_not() {
        let header = "time_s,rate_out_dps,rate_dps,die_degc,agc,supply_v";
        let rows = (0..50).map(|k| format!("{k},{:.4},0,25.5,1.0,3.3", noise(k)));
        assert_eq!(found(header, rows), ["agc", "die_degc"]);
    }

    #[test]
    fn an_output_that_sticks_is_seen_and_a_coarse_one_is_not() {
        let header = "time_s,rate_out_dps,die_degc";
        let rows = (0..200).map(|k| {
            let at = if (80..120).contains(&k) { 80 } else { k };
            format!("{k},{:.4},{}", noise(at), 20.0 + k as f64 * 0.1)
        });
        assert_eq!(found(header, rows), ["rate_out_dps"]);
        // Steps as large as the noise: neighbours are often equal, and that is all.
        let rows =
            (0..2000).map(|k| format!("{k},{:.0},{}", 1.2 * noise(k), 20.0 + k as f64 * 0.02));
        assert!(found(header, rows).is_empty());
    }

    #[test]
    fn a_thermometer_that_stops_is_seen_and_a_dwell_is_not() {
        let ramp = |k: usize| if k < 100 { 0.5 * k as f64 } else { 50.0 };
        let header = "time_s,rate_out_dps,die_degc,chamber_degc";
        // Both dwell: nothing. The die's thermometer stops while the chamber runs on: seen.
        let rows = (0..200).map(|k| format!("{k},{:.4},{},{}", noise(k), ramp(k), ramp(k) + 1.0));
        assert!(found(header, rows).is_empty());
        let rows = (0..200).map(|k| format!("{k},{:.4},{},{}", noise(k), ramp(k), 0.5 * k as f64));
        assert_eq!(found(header, rows), ["die_degc"]);
        // Alone, it is betrayed by the bias, if that runs on.
        let header = "time_s,rate_out_dps,die_degc";
        let rows =
            (0..200).map(|k| format!("{k},{:.4},{}", k as f64 + noise(k), ramp(k).min(40.0)));
        assert_eq!(found(header, rows), ["die_degc"]);
        let rows = (0..200).map(|k| format!("{k},{:.4},{}", ramp(k) + noise(k), ramp(k)));
        assert!(found(header, rows).is_empty());
    }
}
