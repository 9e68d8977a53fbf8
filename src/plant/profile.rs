//! What surrounds the device over time: chamber, table, supply, acceleration, piecewise linear.

use crate::design::ThermalRun;
use crate::error::{Error, InputError, Result};
use crate::input;
use std::path::Path;

/// A corner of a profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surroundings {
    /// s since the run's start; never decreases.
    pub time_s: f64,
    /// degC.
    pub chamber_degc: f64,
    /// Rate of the table, deg/s.
    pub rate_dps: f64,
    /// V.
    pub supply_v: f64,
    /// Along the sensitive axis, g.
    pub accel_g: f64,
}

/// Temperatures that a gyro may work at, degC: beyond, the laws of the simulated one mean nothing.
pub const TEMPERATURES_DEGC: (f64, f64) = (-100.0, 250.0);

/// The supply where a profile says nothing of it, V.
pub const NOMINAL_SUPPLY_V: f64 = 5.0;

/// A profile of at least one corner; linear between corners, constant after the last.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    corners: Vec<Surroundings>,
    /// The line of each corner in its file; empty for a profile that is of none.
    lines: Vec<u64>,
    /// Which of rate, supply and acceleration it states.
    pub has: [bool; 3],
}

/// A time at which a reading is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// 0, 1, 2, ... in the order of time.
    pub index: u64,
    /// s since the run's start.
    pub time_s: f64,
    /// True while the chamber's last move was upward.
    pub heating: bool,
}

/// From the start of one reading to that of the next in a dwell, at least, s.
pub const READING_SPACING_S: f64 = 10.0;

impl Profile {
    /// The run of `[thermal_run]`: from dwell to dwell up to the stop and back, and its readings. A
    /// reading lasts `reading_s` seconds.
    pub fn of_run(run: &ThermalRun, reading_s: f64) -> (Profile, Vec<Reading>) {
        let spacing = reading_s.max(READING_SPACING_S);
        let (mut corners, mut readings) = (Vec::new(), Vec::new());
        let (mut time_s, mut last) = (0.0, run.start_degc);
        for (chamber_degc, heating) in dwells(run) {
            corners.push(at_rest(time_s, last));
            time_s += (chamber_degc - last).abs() / (run.ramp_k_per_min / 60.0);
            last = chamber_degc;
            corners.push(at_rest(time_s, last));
            time_s += run.dwell_s;
            for _ in 0..run.readings_per_dwell {
                readings.push(Reading {
                    index: readings.len() as u64,
                    time_s,
                    heating,
                });
                time_s += spacing;
            }
        }
        corners.push(at_rest(time_s, last));
        let profile = Profile {
            corners,
            lines: Vec::new(),
            has: [false; 3],
        };
        (profile, readings)
    }

    /// A chamber that stays at a temperature.
    pub fn constant(chamber_degc: f64) -> Profile {
        Profile {
            corners: vec![at_rest(0.0, chamber_degc)],
            lines: Vec::new(),
            has: [false; 3],
        }
    }

    /// Reads a CSV file with the columns `time_s` and `chamber_degc`, and, where wanted, `rate_dps`,
    /// `supply_v`, `accel_g`; other columns are not looked at.
    ///
    /// # Errors
    /// A file that cannot be read; a missing column, a cell that is no number, a time that decreases; one time in all rows.
    pub fn read(path: &Path) -> Result<Profile> {
        let bytes = input::text_bytes(
            input::open(path, "profile")?,
            path,
            "profile",
            input::MOST_OF_A_RECORD,
        )?;
        parse(&bytes, path)
    }

    /// The first corner at a temperature that no gyro works at, degC, and the line of its file, where it is of one.
    pub fn beyond(&self) -> Option<(f64, Option<u64>)> {
        let (coldest, hottest) = TEMPERATURES_DEGC;
        let is_beyond = |c: &Surroundings| !(coldest..=hottest).contains(&c.chamber_degc);
        let place = self.corners.iter().position(is_beyond)?;
        let corner = self.corners.get(place)?;
        Some((corner.chamber_degc, self.lines.get(place).copied()))
    }

    /// s, from the first to the last corner.
    pub fn duration_s(&self) -> f64 {
        self.last().time_s - self.first().time_s
    }

    /// The first corner.
    pub fn first(&self) -> Surroundings {
        self.corners.first().copied().unwrap_or(at_rest(0.0, 0.0))
    }

    /// The last corner.
    pub fn last(&self) -> Surroundings {
        self.corners.last().copied().unwrap_or(at_rest(0.0, 0.0))
    }

    /// The surroundings at a time.
    pub fn at(&self, time_s: f64) -> Surroundings {
        let after = self.corners.partition_point(|c| c.time_s <= time_s);
        let (Some(a), b) = (
            after.checked_sub(1).and_then(|k| self.corners.get(k)),
            self.corners.get(after),
        ) else {
            return self.first();
        };
        let Some(b) = b else { return self.last() };
        let share = (time_s - a.time_s) / (b.time_s - a.time_s);
        let between = |from: f64, to: f64| from + (to - from) * share;
        Surroundings {
            time_s,
            chamber_degc: between(a.chamber_degc, b.chamber_degc),
            rate_dps: between(a.rate_dps, b.rate_dps),
            supply_v: between(a.supply_v, b.supply_v),
            accel_g: between(a.accel_g, b.accel_g),
        }
    }

    /// The corners strictly between two times.
    pub fn corners_between(&self, from_s: f64, to_s: f64) -> &[Surroundings] {
        let low = self.corners.partition_point(|c| c.time_s <= from_s);
        let high = self.corners.partition_point(|c| c.time_s < to_s);
        self.corners.get(low..high.max(low)).unwrap_or(&[])
    }

    /// `count` readings, the first at the start, evenly spaced to the end.
    pub fn even_readings(&self, count: u64) -> Vec<Reading> {
        let start = self.first().time_s;
        let step = self.duration_s() / count.saturating_sub(1).max(1) as f64;
        let mut heating = true;
        let mut last = f64::NAN;
        (0..count)
            .map(|index| {
                let time_s = start + step * index as f64;
                let chamber = self.at(time_s).chamber_degc;
                heating = match chamber.partial_cmp(&last) {
                    Some(std::cmp::Ordering::Greater) => true,
                    Some(std::cmp::Ordering::Less) => false,
                    _ => heating,
                };
                last = chamber;
                Reading {
                    index,
                    time_s,
                    heating,
                }
            })
            .collect()
    }
}

fn at_rest(time_s: f64, chamber_degc: f64) -> Surroundings {
    Surroundings {
        time_s,
        chamber_degc,
        rate_dps: 0.0,
        supply_v: NOMINAL_SUPPLY_V,
        accel_g: 0.0,
    }
}

/// The dwells' temperatures, degC, and whether each was reached by heating; the top once. If the step
/// does not divide the span, the last step up is shorter.
pub fn dwells(run: &ThermalRun) -> Vec<(f64, bool)> {
    // A step that divides the span but for rounding divides it.
    let steps = ((run.stop_degc - run.start_degc) / run.step_k - 1e-9).ceil();
    let below = (0..steps.max(0.0) as u64).map(|k| run.start_degc + k as f64 * run.step_k);
    let up: Vec<f64> = below.chain([run.stop_degc]).collect();
    let heating = up.iter().map(|&t| (t, true));
    let cooling = up.iter().rev().skip(1).map(|&t| (t, false));
    heating.chain(cooling).collect()
}

/// A profile from the bytes of a CSV file.
fn parse(bytes: &[u8], path: &Path) -> Result<Profile> {
    let refuse = |message: String, line: u64, column: Option<usize>| {
        let e = InputError::new(message)
            .in_file(path)
            .at(line as usize, column.unwrap_or(1));
        e.help(
            "a profile is a CSV file with the columns time_s and chamber_degc, and, where wanted, \
             rate_dps, supply_v, accel_g",
        )
    };
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(bytes);
    let broken = |e: csv::Error| {
        let line = e.position().map_or(1, csv::Position::line);
        refuse(format!("the profile is no readable CSV: {e}"), line, None)
    };
    let header = reader.headers().map_err(broken)?.clone();
    let find = |name: &str| header.iter().position(|h| h == name);
    let need = |name: &str| {
        find(name).ok_or_else(|| {
            Error::from(refuse(
                format!(
                    "the profile has no column {name}; the file has: {}",
                    header.iter().collect::<Vec<_>>().join(", ")
                ),
                1,
                None,
            ))
        })
    };
    let places = [
        Some(need("time_s")?),
        Some(need("chamber_degc")?),
        find("rate_dps"),
        find("supply_v"),
        find("accel_g"),
    ];
    let missing = [0.0, 0.0, 0.0, NOMINAL_SUPPLY_V, 0.0];
    let mut corners: Vec<Surroundings> = Vec::new();
    let mut lines = Vec::new();
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let line = record.position().map_or(0, csv::Position::line);
        let mut values = missing;
        for (value, place) in values.iter_mut().zip(places) {
            let Some(place) = place else { continue };
            let cell = record.get(place).unwrap_or("");
            *value = match cell.parse::<f64>() {
                Ok(v) if v.is_finite() => v,
                _ => {
                    let name = header.get(place).unwrap_or("");
                    let message =
                        format!("the profile has \"{cell}\" as {name}, which is no number");
                    return Err(refuse(message, line, Some(column_of(&record, place))).into());
                }
            };
        }
        let [time_s, chamber_degc, rate_dps, supply_v, accel_g] = values;
        if chamber_degc <= -super::resonator::ZERO_CELSIUS_K {
            let message =
                format!("the profile has a chamber at {chamber_degc} degC, below absolute zero");
            return Err(refuse(message, line, None).into());
        }
        if corners.last().is_some_and(|last| time_s < last.time_s) {
            let message = format!("the profile has the time {time_s} s after a later one");
            return Err(refuse(message, line, None).into());
        }
        lines.push(line);
        corners.push(Surroundings {
            time_s,
            chamber_degc,
            rate_dps,
            supply_v,
            accel_g,
        });
    }
    let (Some(first), Some(last), Some(line)) = (corners.first(), corners.last(), lines.last())
    else {
        return Err(refuse("the profile has no rows".to_owned(), 1, None).into());
    };
    if last.time_s <= first.time_s {
        let message = format!(
            "the profile lasts no time: time_s is {} in every row",
            first.time_s
        );
        return Err(refuse(message, *line, None).into());
    }
    let has = [places[2], places[3], places[4]].map(|p| p.is_some());
    Ok(Profile {
        corners,
        lines,
        has,
    })
}

/// Where a cell starts in its line, counted from 1, if no cell before it was quoted.
fn column_of(record: &csv::StringRecord, place: usize) -> usize {
    let before = record.iter().take(place);
    before.map(|cell| cell.chars().count() + 1).sum::<usize>() + 1
}

#[cfg(test)]
#[path = "profile_tests.rs"]
mod tests;
