//! The rows of a log as a thermal record: which are whole, which belong to one stretch, what is told of the others.

use super::averager::{AVERAGE_S, Averager};
use super::corrections::Switched;
use super::log_bytes::Damage;
use super::thermal::{ENOUGH_ROWS, LEAST_ROWS, ThermalRecord};
use super::undo::Undo;
use super::warning::Warning;
use super::{dead, error_values, frozen, ignored, plausibility, shorten, stopped};
use crate::design::RecordMapping;
use crate::error::{Error, InputError, Result};
use crate::statistics::stats;
use std::collections::BTreeMap;
use std::path::Path;

/// From how many times the samples on a later source is taken before a slow one.
const FASTER: u64 = 4;

/// What of a log becomes the record.
#[derive(Debug, Default)]
pub(super) struct Choice {
    /// The channels that a column may be taken from, the best first.
    pub columns: Vec<(&'static str, Vec<usize>)>,
    /// Which gyro it is, for messages.
    pub gyro: String,
    /// What the log has of thermometers, for the message if the chosen gyro has none.
    pub thermometers: String,
    /// us since power-on at which the record ends, because the gyro does.
    pub ends_us: Option<u64>,
    /// us since power-on at which it is split, and why.
    pub cuts: Vec<(u64, String)>,
    /// A correction that is to be taken off again.
    pub undo: Option<Undo>,
    /// A correction that the parameters say was on.
    pub switched: Option<Switched>,
    pub warnings: Vec<Warning>,
}

/// See [`Averager::finish`].
pub(super) fn record(
    averager: &mut Averager,
    path: &Path,
    mapping: &RecordMapping,
    damage: Damage,
    choice: Choice,
) -> Result<(ThermalRecord, Vec<Warning>)> {
    let mut warnings = damage_warnings(damage);
    warnings.extend(unused(mapping));
    let rate = chosen(averager, &choice, "rate_out_dps", &mut warnings);
    let heat = chosen(averager, &choice, "die_degc", &mut warnings);
    warnings.extend(clocks(averager, path, [rate, heat])?);
    warnings.extend(choice.warnings.iter().cloned());
    let Some(rate) = rate else {
        return Err(refused(
            path,
            &warnings,
            format!("the log has no samples of {}", choice.gyro),
            "log the gyro (PX4: sensor_gyro or sensor_gyro_fifo; ArduPilot: IMU)",
        ));
    };
    if let Some(channel) = averager.channels.get(rate).filter(|c| c.is_dead()) {
        let mut said = dead::samples(&channel.source, channel.seen());
        if heat.is_none() {
            said += &format!("; and {}", no_thermometer(&choice).message);
        }
        return Err(refused(path, &warnings, said, dead::HELP));
    }
    let supply = chosen(averager, &choice, "supply_v", &mut Vec::new());
    for channel in [heat, supply].into_iter().flatten() {
        warnings.extend(averager.without_error_values(channel));
    }
    let heat = heat.filter(|c| averager.rows_of(*c).next().is_some());
    let rows = one_stretch(averager, rate, &choice, &mut warnings);
    let rows = whole_rows(averager, rate, heat, rows, &mut warnings);
    let span_s = averager.span_s(rate, &rows);
    if rows.len() < LEAST_ROWS
        && let Some(average_s) = mapping.average_s
        && span_s >= LEAST_ROWS as f64 * AVERAGE_S
    {
        // The samples are averaged as they are read: how many another length leaves follows from the log's.
        let of = |other_s: f64| (span_s / other_s) as usize;
        let used = (average_s, rows.len());
        return Err(shorten::too_long(mapping, path, used, span_s, of).into());
    }
    if rows.len() < LEAST_ROWS {
        return Err(refused(
            path,
            &warnings,
            format!(
                "only {} rows of {} s have a gyro reading",
                rows.len(),
                averager.period_us as f64 * 1e-6
            ),
            &format!(
                "log longer, or give a smaller `average_s` in [record]: {ENOUGH_ROWS} rows or more"
            ),
        ));
    }
    let accel = chosen(averager, &choice, "accel_g", &mut Vec::new());
    let mut columns = vec![
        ("rate_out_dps", Some(rate)),
        ("die_degc", heat),
        ("accel_g", accel),
        ("supply_v", supply),
    ];
    let names: Vec<&str> = columns
        .iter()
        .filter_map(|(name, channel)| channel.and(Some(*name)))
        .collect();
    ignored::check(mapping, path, &names)?;
    columns.retain(|(name, _)| !mapping.ignore.contains_key(*name));
    let mut record = made(averager, path, &columns, &rows);
    let sums = rows.iter().filter_map(|r| averager.rows.get(r)?.get(rate));
    let samples: u64 = sums.map(|s| u64::from(s.count)).sum();
    let all = averager.channels.get(rate).map_or(samples, |c| c.samples);
    warnings.push(averaged(averager, &record, samples, all));
    let since = record.column("time_since_power_on_s").unwrap_or(&[]);
    warnings.extend(choice.switched.as_ref().map(|s| s.said(since)));
    if let Some(undo) = &choice.undo {
        warnings.extend(undo.take_off(&mut record, path)?);
    }
    if heat.is_none() {
        warnings.push(no_thermometer(&choice));
    }
    warnings.extend(at_rest(&record));
    error_values::take(&mut record, &mut warnings);
    stopped::take(&mut record, &mut warnings);
    dead::refuse(&record, path, None)?;
    plausibility::check(&record, true, &mut warnings);
    frozen::check(&record, &mut warnings);
    Ok((record, warnings))
}

/// A log that cannot be used, with the first thing that was noticed of it.
fn refused(path: &Path, warnings: &[Warning], message: String, help: &str) -> Error {
    let message = match warnings.first() {
        Some(w) => format!("{message}; {}", w.message),
        None => message,
    };
    InputError::new(message).in_file(path).help(help).into()
}

/// The channel that the rate is taken from.
pub(super) fn rate(averager: &Averager, choice: &Choice) -> Option<usize> {
    chosen(averager, choice, "rate_out_dps", &mut Vec::new())
}

/// The channel that a column is taken from: the first that holds something (a supply of 0 V is what an autopilot logs that
/// does not measure it), but of a rate another that has many more samples.
fn chosen(
    averager: &Averager,
    choice: &Choice,
    column: &str,
    warnings: &mut Vec<Warning>,
) -> Option<usize> {
    let (_, channels) = choice.columns.iter().find(|(name, _)| *name == column)?;
    let holds = |c: &&usize| {
        averager
            .rows_of(**c)
            .any(|(_, sum)| column != "supply_v" || sum.value != 0.0)
    };
    let first = *channels.iter().find(holds)?;
    if column != "rate_out_dps" {
        return Some(first);
    }
    let of = |c: usize| averager.channels.get(c);
    let samples = |c: usize| of(c).map_or(0, |c| c.samples);
    let faster = channels
        .iter()
        .copied()
        .filter(|c| samples(*c) >= FASTER * samples(first))
        .max_by_key(|c| (samples(*c), std::cmp::Reverse(*c)));
    let Some(faster) = faster.filter(|f| *f != first) else {
        return Some(first);
    };
    if let (Some(slow), Some(fast)) = (of(first), of(faster)) {
        warnings.push(Warning::on(
            "faster_source",
            "rate_out_dps",
            format!(
                "{} has {} samples and {} has {}: the faster one was taken",
                slow.source, slow.samples, fast.source, fast.samples
            ),
        ));
    }
    Some(faster)
}

/// Wrong times of every topic told; a clock of the gyro's that began anew refused.
fn clocks(averager: &Averager, path: &Path, needed: [Option<usize>; 2]) -> Result<Vec<Warning>> {
    let mut warnings = Vec::new();
    for (number, topic) in averager.topics.iter().enumerate() {
        if topic.wrong > 0
            && let Some((time, at)) = topic.first_wrong
        {
            warnings.push(Warning::general(
                "wrong_times",
                format!(
                    "the time of {} in {} is one that later ones do not agree with (the first {time:.3} s, byte {at}): \
                     damage; left out",
                    match topic.wrong {
                        1 => "one message".to_owned(),
                        n => format!("{n} messages"),
                    },
                    topic.name
                ),
            ));
        }
        let Some((from, to, at)) = topic.restarted else {
            continue;
        };
        let topics = needed.iter().flatten();
        let mut topics = topics.filter_map(|c| averager.channels.get(*c));
        if topics.any(|c| c.topic == number) {
            return Err(InputError::new(format!(
                "the log's clock runs backwards, from {from:.3} s to {to:.3} s (byte {at})"
            ))
            .in_file(path)
            .help(
                "a record is one stretch from one power-on: cut the log there, or take another \
                 copy of it",
            )
            .into());
        }
        warnings.push(Warning::general(
            "wrong_times",
            format!(
                "the clock of {} runs backwards, from {from:.3} s to {to:.3} s (byte {at}): it was read no further",
                topic.name
            ),
        ));
    }
    Ok(warnings)
}

/// The rows with a rate, of the stretch that the record is of.
fn one_stretch(
    averager: &Averager,
    rate: usize,
    choice: &Choice,
    warnings: &mut Vec<Warning>,
) -> Vec<u64> {
    let row_of = |us: u64| us / averager.period_us;
    let mut rows: Vec<u64> = averager.rows_of(rate).map(|(number, _)| number).collect();
    if let Some(end) = choice.ends_us {
        rows.retain(|number| *number < row_of(end));
    }
    if choice.cuts.is_empty() {
        return rows;
    }
    // The row in which it happens is of neither.
    let cut_rows: Vec<u64> = choice.cuts.iter().map(|c| row_of(c.0)).collect();
    let stretch = |number: &u64| cut_rows.iter().filter(|c| *c < number).count();
    let kept: Vec<u64> = rows
        .iter()
        .copied()
        .filter(|n| !cut_rows.contains(n))
        .collect();
    let mut stretches: Vec<Vec<u64>> = vec![Vec::new(); cut_rows.len() + 1];
    for number in kept {
        if let Some(of) = stretches.get_mut(stretch(&number)) {
            of.push(number);
        }
    }
    stretches.retain(|s| !s.is_empty());
    let shown = |s: &[u64]| {
        let at =
            |n: Option<&u64>| n.copied().unwrap_or(0) as f64 * averager.period_us as f64 * 1e-6;
        format!(
            "{} rows from {:.0} s to {:.0} s",
            s.len(),
            at(s.first()),
            at(s.last())
        )
    };
    if stretches.len() < 2 {
        return stretches.pop().unwrap_or_default();
    }
    let all: Vec<String> = stretches.iter().map(|s| shown(s)).collect();
    let most = stretches.iter().map(Vec::len).max().unwrap_or(0);
    let longest = stretches.into_iter().find(|s| s.len() == most);
    let longest = longest.unwrap_or_default();
    let why: Vec<&str> = choice.cuts.iter().map(|c| c.1.as_str()).collect();
    warnings.push(Warning::general(
        "record_split",
        format!(
            "{}: what was logged before and after is of different offsets, so the log is {} records ({}); the longest was \
             taken ({}). Cut the log to read another",
            why.join("; "),
            all.len(),
            all.join(", "),
            shown(&longest)
        ),
    ));
    longest
}

/// The rows that the gyro fills to at least half of what one of the two rows beside them holds: a part of a row has less than
/// both. What is left out is told.
fn whole_rows(
    averager: &Averager,
    rate: usize,
    heat: Option<usize>,
    rows: Vec<u64>,
    warnings: &mut Vec<Warning>,
) -> Vec<u64> {
    let count = |number: Option<u64>| -> Option<u32> {
        let sum = averager.rows.get(&number?)?.get(rate)?;
        (sum.count > 0).then_some(sum.count)
    };
    let is_whole = |number: &u64| {
        let beside = [count(number.checked_sub(1)), count(number.checked_add(1))];
        let least = beside.into_iter().flatten().min();
        let own = count(Some(*number)).unwrap_or(0);
        least.is_none_or(|least| 2 * own >= least)
    };
    let (whole, parts): (Vec<u64>, Vec<u64>) = rows.into_iter().partition(is_whole);
    // The first and the last row of a log are parts, as a rule.
    let inner = parts.iter().filter(|n| {
        whole.first().is_some_and(|first| *n > first) && whole.last().is_some_and(|last| *n < last)
    });
    if inner.count() == 0 {
        return whole;
    }
    let means = parts.iter().filter_map(|n| {
        let sum = averager.rows.get(n)?.get(heat?)?;
        (sum.count > 0).then(|| sum.mean())
    });
    let means: Vec<f64> = means.collect();
    let degc = match stats::extremes(&means) {
        Some((low, high)) => format!(", {low:.1} to {high:.1} degC"),
        None => String::new(),
    };
    let samples: u64 = parts
        .iter()
        .filter_map(|n| count(Some(*n)))
        .map(u64::from)
        .sum();
    let s = |n: Option<&u64>| n.copied().unwrap_or(0) as f64 * averager.period_us as f64 * 1e-6;
    warnings.push(Warning::on(
        "rows_left_out",
        "rate_out_dps",
        format!(
            "{} rows ({samples} samples, between {:.0} and {:.0} s since power-on{degc}) hold less than half of the samples of \
             the rows beside them and were left out",
            parts.len(),
            s(parts.first()),
            s(parts.last()),
        ),
    ));
    whole
}

fn made(
    averager: &Averager,
    path: &Path,
    columns: &[(&'static str, Option<usize>)],
    rows: &[u64],
) -> ThermalRecord {
    let mean = |number: &u64, channel: usize| -> Option<(f64, f64)> {
        let sum = averager.rows.get(number)?.get(channel)?;
        (sum.count > 0).then(|| (sum.time / f64::from(sum.count), sum.mean()))
    };
    let rate = columns.first().and_then(|c| c.1).unwrap_or(0);
    let power_on_s: Vec<f64> = rows
        .iter()
        .map(|number| {
            let inside = mean(number, rate).map_or(f64::NAN, |m| m.0);
            ((number * averager.period_us) as f64 + inside) * 1e-6
        })
        .collect();
    let first = power_on_s.first().copied().unwrap_or(0.0);
    let mut record = ThermalRecord {
        source: path.to_path_buf(),
        time_s: power_on_s.iter().map(|t| t - first).collect(),
        columns: BTreeMap::new(),
        lines: (1..=rows.len()).collect(),
        renamed: BTreeMap::new(),
        units: BTreeMap::new(),
    };
    for (column, channel) in columns {
        let Some(channel) = *channel else { continue };
        let values: Vec<f64> = rows
            .iter()
            .map(|number| mean(number, channel).map_or(f64::NAN, |m| m.1))
            .collect();
        if values.iter().all(|v| v.is_nan()) {
            continue;
        }
        record.columns.insert((*column).to_owned(), values);
        if let Some(channel) = averager.channels.get(channel) {
            let source = channel.source.clone();
            record.renamed.insert((*column).to_owned(), source);
        }
    }
    record
        .columns
        .insert("time_since_power_on_s".to_owned(), power_on_s);
    record
}

/// What was averaged, and where each column is from.
fn averaged(averager: &Averager, record: &ThermalRecord, samples: u64, all: u64) -> Warning {
    let of = match all > samples {
        true => format!("{samples} of {all}"),
        false => samples.to_string(),
    };
    let from: Vec<String> = record
        .renamed
        .iter()
        .map(|(column, source)| format!("{column} from {source}"))
        .collect();
    Warning::on(
        "log_averaged",
        "rate_out_dps",
        format!(
            "{of} gyro samples were averaged into {} rows of {} s: {}",
            record.len(),
            averager.period_us as f64 * 1e-6,
            from.join(", ")
        ),
    )
}

/// Keys of `[record]` that mean nothing for a log.
fn unused(mapping: &RecordMapping) -> Option<Warning> {
    let used = mapping.columns.is_empty() && mapping.row_period_s.is_none();
    (!used).then(|| {
        Warning::general(
            "record_keys_unused",
            "[record.columns] and row_period_s are for CSV: a log names its own columns and has a \
             clock; they were not used",
        )
    })
}

/// What of the file could not be read.
pub(super) fn damage_warnings(damage: Damage) -> Vec<Warning> {
    let mut warnings = Vec::new();
    if damage.stretches > 0 {
        warnings.push(Warning::general(
            "log_damaged",
            format!(
                "{} bytes of the log in {} places could not be read and were left out, the first \
                 at byte {}",
                damage.bytes, damage.stretches, damage.first
            ),
        ));
    }
    if damage.cut {
        warnings.push(Warning::general(
            "log_cut_off",
            "the log ends within a message, as after a loss of power; all before it was read",
        ));
    }
    warnings
}

/// A gyro that is calibrated lies still: no thermal drift of an autopilot's gyro reaches 10 deg/s
/// between a twentieth and 19 twentieths of its rows, and every flight does.
fn at_rest(record: &ThermalRecord) -> Option<Warning> {
    let rate = stats::sorted(record.column("rate_out_dps")?);
    let spread = stats::quantile_sorted(&rate, 0.95) - stats::quantile_sorted(&rate, 0.05);
    (spread > 10.0).then(|| {
        Warning::on(
            "log_not_at_rest",
            "rate_out_dps",
            format!(
                "the gyro's rows spread over {spread:.1} deg/s: a flight? The bias can only be \
                 seen while the vehicle lies still; cut the log to that part"
            ),
        )
    })
}

/// A log without a temperature of the gyro that was chosen.
fn no_thermometer(choice: &Choice) -> Warning {
    Warning::on(
        "log_without_temperature",
        "die_degc",
        format!(
            "the log has no reading of the temperature of {}: {}. Log it beside the gyro (PX4: sensor_gyro or \
             vehicle_imu_status; ArduPilot: IMU with its T), or put the rows into a CSV with a thermometer of another logger",
            choice.gyro, choice.thermometers
        ),
    )
}
