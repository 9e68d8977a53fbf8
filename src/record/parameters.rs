//! Parameters of an autopilot's log, with the times at which they change.

use std::collections::BTreeMap;

/// Beginnings of the names that are kept.
const KEPT: [&str; 6] = [
    "TC_G",
    "CAL_GYRO",
    "IMU_GYRO_CAL_EN",
    "SENS_BOARD_ROT",
    "INS_TCAL",
    "INS_GYR",
];

/// Parameters of a log, each with its values in their order.
#[derive(Debug, Default)]
pub(super) struct Parameters {
    /// (us since power-on, value); only changes.
    values: BTreeMap<String, Vec<(u64, f64)>>,
}

impl Parameters {
    /// Takes a parameter that a message says.
    pub(super) fn set(&mut self, name: &str, time_us: u64, value: f64) {
        if !KEPT.iter().any(|k| name.starts_with(k)) || !value.is_finite() {
            return;
        }
        let values = self.values.entry(name.to_owned()).or_default();
        if values.last().is_none_or(|(_, last)| *last != value) {
            values.push((time_us, value));
        }
    }

    /// The value that it had last.
    pub(super) fn last(&self, name: &str) -> Option<f64> {
        Some(self.values.get(name)?.last()?.1)
    }

    /// The value that holds at a time; before the first that the log says, that one.
    pub(super) fn at(&self, name: &str, time_us: u64) -> Option<f64> {
        let values = self.all(name);
        let since = values.partition_point(|(from, _)| *from <= time_us);
        Some(values.get(since.saturating_sub(1))?.1)
    }

    /// Whether it is 1, from when on: us since power-on; the first from the start. Empty for one that the log does not say.
    pub(super) fn switched(&self, name: &str) -> Vec<(u64, bool)> {
        let values = self.all(name).iter().enumerate();
        let each = values.map(|(i, (from, value))| (if i == 0 { 0 } else { *from }, *value == 1.0));
        each.collect()
    }

    /// "NAME = 0 from the start, 1 from 101.0 s since power-on".
    pub(super) fn course(&self, name: &str) -> String {
        let each: Vec<String> = self
            .all(name)
            .iter()
            .enumerate()
            .map(|(i, (from, value))| match i {
                0 => format!("{name} = {value} from the start"),
                _ => format!("{value} from {:.1} s since power-on", *from as f64 * 1e-6),
            })
            .collect();
        each.join(", ")
    }

    pub(super) fn all(&self, name: &str) -> &[(u64, f64)] {
        self.values.get(name).map_or(&[], Vec::as_slice)
    }

    /// "NAME = 1 (from the start)", if it ever was one of these values.
    pub(super) fn on(&self, name: &str, values: &[f64]) -> Option<String> {
        let (time_us, value) = self.all(name).iter().find(|(_, v)| values.contains(v))?;
        let first = self.all(name).first() == Some(&(*time_us, *value));
        let when = match first {
            true => "from the start".to_owned(),
            false => format!("from {:.1} s since power-on", *time_us as f64 * 1e-6),
        };
        Some(format!("{name} = {value} ({when})"))
    }

    /// Where it changes: us since power-on, before and after.
    pub(super) fn changes(&self, name: &str) -> impl Iterator<Item = (u64, f64, f64)> + '_ {
        let values = self.all(name).windows(2);
        values.map(|w| (w[1].0, w[0].1, w[1].1))
    }
}
