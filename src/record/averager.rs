//! Samples of an autopilot's log, averaged into the rows of a thermal record while they are read:
//! what is kept grows with the rows, not with the samples.

use super::log_bytes::Damage;
use super::thermal::{LEAST_ROWS, ThermalRecord};
use super::warning::Warning;
use super::{frozen, plausibility};
use crate::design::RecordMapping;
use crate::error::{InputError, Result};
use crate::statistics::stats;
use std::collections::BTreeMap;
use std::path::Path;

/// s of samples in a row of a log, where the design does not say.
pub(super) const AVERAGE_S: f64 = 1.0;

/// m/s^2 in one g, exact (CGPM 1901).
pub(super) const STANDARD_GRAVITY: f64 = 9.806_65;

/// A quantity of the log that can become a column of the record.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    /// The contract's column.
    pub column: &'static str,
    /// What the log calls it, such as `sensor_gyro.z`.
    pub source: String,
}

/// The sum of the samples of one channel in one row.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    count: u32,
    value: f64,
    /// us since the row's start.
    time: f64,
}

/// Averages samples into rows. Channels of one column are alternatives, the best first.
pub(super) struct Averager {
    channels: Vec<Channel>,
    period_us: u64,
    /// By number of the row, counted from power-on.
    rows: BTreeMap<u64, Vec<Sum>>,
    /// The row that samples go to at the moment.
    number: u64,
    row: Vec<Sum>,
    /// By channel: the latest time, us.
    latest: Vec<u64>,
}

/// A clock that ran backwards: from and to, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Backwards(pub f64, pub f64);

impl Averager {
    /// For these channels and the design's `average_s`.
    pub(super) fn new(channels: Vec<Channel>, mapping: &RecordMapping) -> Self {
        let period = mapping.average_s.unwrap_or(AVERAGE_S) * 1e6;
        let count = channels.len();
        Averager {
            channels,
            period_us: (period.round() as u64).max(1),
            rows: BTreeMap::new(),
            number: 0,
            row: vec![Sum::default(); count],
            latest: vec![0; count],
        }
    }

    /// Adds a sample of a channel, in the column's unit, at `time_us` since power-on. NaN is none.
    ///
    /// # Errors
    /// A clock that runs backwards by more than a row.
    pub(super) fn add(
        &mut self,
        channel: usize,
        time_us: u64,
        value: f64,
    ) -> std::result::Result<(), Backwards> {
        let Some(latest) = self.latest.get_mut(channel) else {
            return Ok(());
        };
        if time_us.saturating_add(self.period_us) < *latest {
            return Err(Backwards(*latest as f64 * 1e-6, time_us as f64 * 1e-6));
        }
        *latest = time_us.max(*latest);
        if !value.is_finite() {
            return Ok(());
        }
        let number = time_us / self.period_us;
        if number != self.number {
            self.turn_to(number);
        }
        if let Some(sum) = self.row.get_mut(channel) {
            sum.count += 1;
            sum.value += value;
            sum.time += (time_us % self.period_us) as f64;
        }
        Ok(())
    }

    /// Puts the present row away and takes the one of that number up.
    fn turn_to(&mut self, number: u64) {
        let empty = vec![Sum::default(); self.channels.len()];
        let next = self.rows.remove(&number).unwrap_or(empty);
        let done = std::mem::replace(&mut self.row, next);
        if done.iter().any(|s| s.count > 0) {
            self.rows.insert(self.number, done);
        }
        self.number = number;
    }

    /// The channel that a column is taken from: the first that holds something; a supply of 0 V is
    /// what an autopilot logs that does not measure it.
    fn chosen(&self, column: &str) -> Option<usize> {
        self.channels.iter().enumerate().position(|(i, channel)| {
            channel.column == column
                && self
                    .rows
                    .values()
                    .filter_map(|row| row.get(i))
                    .any(|sum| sum.count > 0 && (column != "supply_v" || sum.value != 0.0))
        })
    }

    /// The record, checked like any other; `found` says what the log holds, for the message if
    /// it holds no gyro.
    ///
    /// # Errors
    /// No gyro of that instance, too few rows.
    pub(super) fn finish(
        mut self,
        path: &Path,
        mapping: &RecordMapping,
        damage: Damage,
        found: &str,
    ) -> Result<(ThermalRecord, Vec<Warning>)> {
        self.turn_to(u64::MAX);
        let mut warnings = damage_warnings(damage);
        warnings.extend(unused(mapping));
        let refused = |message: String, help: &str| {
            let message = match warnings.first() {
                Some(w) => format!("{message}; {}", w.message),
                None => message,
            };
            InputError::new(message).in_file(path).help(help)
        };
        let Some(rate) = self.chosen("rate_out_dps") else {
            return Err(refused(
                format!(
                    "the log has no samples of gyro {}: {found}",
                    mapping.instance.unwrap_or(0)
                ),
                "choose another `instance` in [record], or log the gyro (PX4: sensor_gyro; \
                 ArduPilot: IMU)",
            )
            .into());
        };
        let (rows, samples) = self.whole_rows(rate);
        if rows.len() < LEAST_ROWS {
            return Err(refused(
                format!(
                    "only {} rows of {} s have a gyro reading",
                    rows.len(),
                    self.period_us as f64 * 1e-6
                ),
                "at least 10 are needed: log longer, or give a smaller `average_s` in [record]",
            )
            .into());
        }
        let record = self.record(path, rate, &rows);
        warnings.push(self.told(&record, samples));
        warnings.extend(at_rest(&record));
        plausibility::check(&record, &mut warnings);
        frozen::check(&record, &mut warnings);
        Ok((record, warnings))
    }

    /// The rows that the gyro fills to at least half of what the median row holds (the first and
    /// the last are parts of a row), and their number of samples.
    fn whole_rows(&self, rate: usize) -> (Vec<u64>, u64) {
        let counted: Vec<(u64, u32)> = self
            .rows
            .iter()
            .filter_map(|(number, row)| Some((*number, row.get(rate)?.count)))
            .filter(|(_, count)| *count > 0)
            .collect();
        let counts: Vec<f64> = counted.iter().map(|(_, n)| f64::from(*n)).collect();
        let half = 0.5 * stats::median(&counts);
        let whole = counted.into_iter().filter(|(_, n)| f64::from(*n) >= half);
        let samples = whole.clone().map(|(_, n)| u64::from(n)).sum();
        (whole.map(|(number, _)| number).collect(), samples)
    }

    fn record(&self, path: &Path, rate: usize, rows: &[u64]) -> ThermalRecord {
        let mean = |number: &u64, channel: usize| -> Option<(f64, f64)> {
            let sum = self.rows.get(number)?.get(channel)?;
            let n = f64::from(sum.count);
            (sum.count > 0).then(|| (sum.time / n, sum.value / n))
        };
        let power_on_s: Vec<f64> = rows
            .iter()
            .map(|number| {
                let inside = mean(number, rate).map_or(f64::NAN, |m| m.0);
                ((number * self.period_us) as f64 + inside) * 1e-6
            })
            .collect();
        let first = power_on_s.first().copied().unwrap_or(0.0);
        let mut record = ThermalRecord {
            source: path.to_path_buf(),
            time_s: power_on_s.iter().map(|t| t - first).collect(),
            columns: BTreeMap::new(),
            lines: (1..=rows.len()).collect(),
            renamed: BTreeMap::new(),
        };
        for column in ["rate_out_dps", "die_degc", "accel_g", "supply_v"] {
            let Some(channel) = self.chosen(column) else {
                continue;
            };
            let values: Vec<f64> = rows
                .iter()
                .map(|number| mean(number, channel).map_or(f64::NAN, |m| m.1))
                .collect();
            if values.iter().all(|v| v.is_nan()) {
                continue;
            }
            record.columns.insert(column.to_owned(), values);
            if let Some(channel) = self.channels.get(channel) {
                record
                    .renamed
                    .insert(column.to_owned(), channel.source.clone());
            }
        }
        record
            .columns
            .insert("time_since_power_on_s".to_owned(), power_on_s);
        record
    }

    /// What was averaged, and where each column is from.
    fn told(&self, record: &ThermalRecord, samples: u64) -> Warning {
        let from: Vec<String> = record
            .renamed
            .iter()
            .map(|(column, source)| format!("{column} from {source}"))
            .collect();
        Warning::on(
            "log_averaged",
            "rate_out_dps",
            format!(
                "{samples} gyro samples were averaged into {} rows of {} s: {}",
                record.len(),
                self.period_us as f64 * 1e-6,
                from.join(", ")
            ),
        )
    }
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
fn damage_warnings(damage: Damage) -> Vec<Warning> {
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
