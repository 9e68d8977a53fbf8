//! Cells that hold an error value in place of a reading.
//!
//! A bus thermometer that fails to answer is logged as 0, 85, -127 or 65535, and so are phase, frequency, supply and
//! acceleration when their source is lost. Such a cell sets the range that the declared bias is scaled to, and looks like a
//! cause. Three rules, none of which knows a value beforehand:
//!
//! - a value that the quantity cannot have (a supply of 0 V of a gyro that runs, -127 degC) is no reading, if most others are;
//! - a value that stands apart from its neighbours in time, on both sides, by far more than the readings move, and is
//!   repeated to the last digit, is no reading, whatever its share;
//! - so is a single cell of a thermometer, for a die has a heat capacity.
//!
//! At an end of the record one neighbour alone can tell: there a value has to be half of the range away, or, of a
//! thermometer, two dozen usual steps and further than a die moves in that time.

use super::columns::{THERMOMETERS, unit_of};
use super::thermal::ThermalRecord;
use super::visits::{Visit, Visits};
use super::warning::Warning;
use crate::statistics::stats;
use std::collections::BTreeMap;

/// How many times the usual distance from its neighbours a value has to stand apart.
const APART: f64 = 8.0;

/// Least distance, as a share of the range of the other readings.
const LEAST_OF_RANGE: f64 = 0.05;

/// Share of the range that is far without any comparison.
const HALF: f64 = 0.5;

/// No die moves faster, K/s.
const FASTEST_K_PER_S: f64 = 1.5;

/// Usual steps that a value at an end of the record has to stand apart, where it is within half of the range (convention).
const DOZENS: f64 = 24.0;

/// Different readings that a channel needs beside the error values, so that its own movement is known.
const READINGS: usize = 10;

/// Share of the cells from which a value is tried as an error value on its own.
const FREQUENT: f64 = 0.1;

/// Values that are looked for one after the other.
const MOST_ROUNDS: usize = 40;

/// What is looked for in a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Kind {
    /// Readings that the quantity can have, in the column's unit.
    pub possible: (f64, f64),
    /// Whether it has a heat capacity: it never moves for one cell alone.
    pub inert: bool,
}

/// No gyro turns faster, deg/s.
const FASTEST_DPS: f64 = 20_000.0;

/// Full scales of converters of 16, 24 and 32 bits, which they give where they have no reading.
const OF_CONVERTERS: [f64; 9] = [
    -32_768.0,
    32_767.0,
    65_535.0,
    -8_388_608.0,
    8_388_607.0,
    -2_147_483_648.0,
    2_147_483_647.0,
    4_294_967_295.0,
    -2_147_483_647.0,
];

/// Error values of the output: faster than any gyro turns, in a tenth of the rows at most, each a converter's full scale or
/// repeated to the last digit. What else is so fast is in another unit.
fn of_converter(values: &[f64], kind: Kind) -> Vec<bool> {
    let beyond = |v: f64| v.is_finite() && !(kind.possible.0..=kind.possible.1).contains(&v);
    let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
    for value in values.iter().filter(|v| beyond(**v)) {
        *counts.entry(value.to_bits()).or_insert(0) += 1;
    }
    let measured = values.iter().filter(|v| v.is_finite()).count();
    let few = 10 * counts.values().sum::<usize>() <= measured;
    let is_known = |bits: u64| OF_CONVERTERS.contains(&f64::from_bits(bits));
    let are = counts
        .iter()
        .all(|(bits, count)| *count > 1 || is_known(*bits));
    values.iter().map(|v| are && few && beyond(*v)).collect()
}

/// The kind of a column; `None` for one whose values are taken as they are.
pub(super) fn kind_of(column: &str) -> Option<Kind> {
    let tiny = f64::MIN_POSITIVE;
    let turn = std::f64::consts::TAU;
    let possible = match column {
        "phase_rad" => (-turn, turn),
        "freq_hz" => (tiny, f64::MAX),
        "supply_v" => (tiny, 100.0),
        "accel_g" => (-20_000.0, 20_000.0),
        "agc" => (tiny, f64::MAX),
        "quad_dps" => (-f64::MAX, f64::MAX),
        "rate_out_dps" => (-FASTEST_DPS, FASTEST_DPS),
        _ if unit_of(column) == "degC" => (-100.0, 250.0),
        _ => return None,
    };
    let inert = THERMOMETERS.contains(&column) || unit_of(column) == "degC";
    Some(Kind { possible, inert })
}

/// Error values become holes; each column says which, how many and where.
pub(super) fn take(record: &mut ThermalRecord, warnings: &mut Vec<Warning>) {
    let names: Vec<String> = record.columns.keys().cloned().collect();
    for name in names {
        let (Some(kind), Some(values)) = (kind_of(&name), record.columns.get(&name)) else {
            continue;
        };
        let marks = match name == "rate_out_dps" {
            true => of_converter(values, kind),
            false => marks(&record.time_s, values, kind),
        };
        if !marks.contains(&true) {
            continue;
        }
        let rows: Vec<usize> = (0..marks.len()).filter(|row| marks[*row]).collect();
        let marked: Vec<f64> = rows.iter().map(|row| values[*row]).collect();
        let measured = record.measured(&name);
        let kept = values
            .iter()
            .zip(&marks)
            .filter(|(v, mark)| !**mark && marked.contains(v))
            .count();
        let places = record.places(&rows);
        warnings.push(told(&name, &marked, &places, measured, kept));
        if let Some(values) = record.columns.get_mut(&name) {
            let cells = values.iter_mut().zip(&marks).filter(|(_, mark)| **mark);
            cells.for_each(|(value, _)| *value = f64::NAN);
        }
    }
}

/// What is said of the cells of a column, and where they are.
fn told(name: &str, marked: &[f64], places: &str, measured: usize, kept: usize) -> Warning {
    let doubtful = match kept {
        0 => String::new(),
        n => format!(
            "; {n} more cells of such a value lie within reach of their neighbours and are kept"
        ),
    };
    Warning::on(
        "error_values",
        name,
        format!(
            "{} of {measured} cells of {name} hold {}, out of reach of the readings before and after them. These are \
             error values, not readings. They count as not measured ({places}){doubtful}",
            marked.len(),
            values_of(marked.iter().copied(), unit_of(name)),
        ),
    )
}

/// "0 degC (3 times), -127 degC": the most frequent first, at most four.
pub(super) fn values_of(cells: impl Iterator<Item = f64>, unit: &str) -> String {
    let mut counts: BTreeMap<u64, (usize, f64)> = BTreeMap::new();
    for value in cells {
        counts.entry(value.to_bits()).or_insert((0, value)).0 += 1;
    }
    let mut counts: Vec<(usize, f64)> = counts.into_values().collect();
    counts.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)));
    let unit = if unit == "1" {
        String::new()
    } else {
        format!(" {unit}")
    };
    let shown: Vec<String> = counts
        .iter()
        .take(4)
        .map(|(n, value)| match n {
            1 => format!("{value}{unit}"),
            n => format!("{value}{unit} ({n} times)"),
        })
        .collect();
    let more = match counts.len().saturating_sub(4) {
        0 => String::new(),
        n => format!(" and {n} other values"),
    };
    format!("{}{more}", shown.join(", "))
}

/// Which cells hold an error value; NaN (not measured) never does. Times in s, values in the column's unit.
pub(super) fn marks(time_s: &[f64], values: &[f64], kind: Kind) -> Vec<bool> {
    let mut marks = vec![false; values.len()];
    let possible = |v: f64| (kind.possible.0..=kind.possible.1).contains(&v);
    let measured = values.iter().filter(|v| v.is_finite());
    let wrong = measured.clone().filter(|v| !possible(**v)).count();
    if 2 * wrong < measured.count() {
        for (mark, v) in marks.iter_mut().zip(values) {
            *mark = v.is_finite() && !possible(*v);
        }
    }
    // Cells of an error value that their neighbours do not contradict: kept, and no witnesses of others.
    let mut aside = marks.clone();
    // A value that is most of the cells hides how the others move: those are looked at without it first.
    for value in frequent(values, &marks) {
        let others = |i: usize| values[i].is_finite() && !aside[i] && values[i] != value;
        let rest: Vec<usize> = (0..values.len()).filter(|i| others(*i)).collect();
        let Some(scale) = Scale::of(time_s, values, &rest) else {
            continue;
        };
        let cells: Vec<usize> = (0..values.len())
            .filter(|i| values[*i].is_finite() && !aside[*i])
            .collect();
        let visits = Visits::of(time_s, values, &cells);
        let of_value: Vec<Visit> = visits.iter().filter(|v| v.value == value).collect();
        let known = of_value.iter().any(|v| v.inner && scale.is_far(v, true));
        let far = |v: &&Visit| scale.is_far(v, known);
        let count = of_value.iter().filter(far).count();
        if 2 * count >= of_value.len() && count > 0 {
            let far = of_value.iter().filter(far);
            far.for_each(|v| v.cells.clone().for_each(|k| marks[cells[k]] = true));
            put_aside(values, value, &mut aside);
        }
    }
    // A reading between two errors stands apart as they do: the plainest error goes first, then all are seen anew.
    for _ in 0..MOST_ROUNDS {
        let more = apart(time_s, values, &aside, kind.inert);
        if more.is_empty() {
            break;
        }
        let mut last = f64::NAN;
        for i in more {
            marks[i] = true;
            if !aside[i] && values[i] != last {
                last = values[i];
                put_aside(values, last, &mut aside);
            }
        }
    }
    marks
}

/// Sets all cells of a value aside.
fn put_aside(values: &[f64], value: f64, aside: &mut [bool]) {
    let cells = aside.iter_mut().zip(values);
    cells.for_each(|(aside, v)| *aside |= *v == value);
}

/// Values that many cells have to the last digit, the most frequent first.
fn frequent(values: &[f64], marks: &[bool]) -> Vec<f64> {
    let mut kept: Vec<f64> = values
        .iter()
        .zip(marks)
        .filter(|(v, mark)| v.is_finite() && !**mark)
        .map(|(v, _)| *v)
        .collect();
    kept.sort_unstable_by(f64::total_cmp);
    let least = ((FREQUENT * kept.len() as f64) as usize).max(3);
    let mut runs: Vec<(usize, f64)> = kept
        .chunk_by(|a, b| a == b)
        .filter_map(|run| Some((run.len(), *run.first()?)))
        .filter(|(count, _)| *count >= least)
        .collect();
    runs.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)));
    runs.into_iter().map(|(_, value)| value).take(4).collect()
}

/// How the readings of a channel move.
struct Scale {
    /// Distance from the neighbours that three quarters of the different readings do not exceed.
    usual: f64,
    /// Their range.
    range: f64,
}

impl Scale {
    /// Of the given cells; `None` where they are too few to tell.
    fn of(time_s: &[f64], values: &[f64], cells: &[usize]) -> Option<Scale> {
        Scale::of_visits(&Visits::of(time_s, values, cells))
    }

    /// Each different value counts once: readings have many, errors few.
    fn of_visits(visits: &Visits) -> Option<Scale> {
        let mut by_value: Vec<(f64, f64)> = visits.iter().map(|v| (v.value, v.per_row)).collect();
        by_value.retain(|v| v.1.is_finite());
        by_value.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let each: Vec<f64> = by_value
            .chunk_by(|a, b| a.0 == b.0)
            .filter_map(|of_one| of_one.get(of_one.len() / 2))
            .map(|v| v.1)
            .collect();
        if each.len() < READINGS {
            return None;
        }
        let distinct: Vec<f64> = by_value
            .chunk_by(|a, b| a.0 == b.0)
            .filter_map(|of_one| of_one.first())
            .map(|v| v.0)
            .collect();
        let quantile = |p| stats::quantile_sorted(&distinct, p);
        Some(Scale {
            usual: stats::quantile_sorted(&stats::sorted(&each), 0.75),
            range: quantile(0.95) - quantile(0.05),
        })
    }

    /// `known`: the value is one of an error elsewhere.
    fn is_far(&self, visit: &Visit, known: bool) -> bool {
        // At an end of the record one side alone can tell: a die that is switched off cools fast.
        let share = match visit.inner || known {
            true => LEAST_OF_RANGE,
            false => HALF,
        };
        visit.distance.is_finite()
            && visit.per_row > APART * self.usual
            && visit.distance > share * self.range
    }

    /// Whether a thermometer's value at an end of the record, where one neighbour alone can tell, is two dozen usual steps
    /// from it and further than a die moves in that time; of `all` cells it has a tenth at most.
    fn is_cut_off(&self, visit: &Visit, all: usize) -> bool {
        !visit.inner
            && visit.distance.is_finite()
            && 10 * visit.cells.len() <= all
            && visit.per_row > DOZENS * self.usual
            && visit.distance > LEAST_OF_RANGE * self.range
            && self.is_out_of_reach(visit)
    }

    /// Whether no die gets there and back in the time; half of the range is out of reach in any time.
    fn is_out_of_reach(&self, visit: &Visit) -> bool {
        visit.distance > (FASTEST_K_PER_S * visit.way_s).min(HALF * self.range)
    }
}

/// How often a value is visited, and how far from its neighbours.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    visits: usize,
    /// Visits that are far, those of them with neighbours on both sides, and their cells.
    far: usize,
    inner: usize,
    far_cells: usize,
    farthest: f64,
}

/// The visits by the bits of their value; `is_far` is told whether the value is one of an error elsewhere.
fn seen(visits: &Visits, is_far: impl Fn(&Visit, bool) -> bool) -> BTreeMap<u64, Seen> {
    let mut out: BTreeMap<u64, Seen> = BTreeMap::new();
    for inner in [true, false] {
        for visit in visits.iter().filter(|v| v.inner == inner) {
            let seen = out.entry(visit.value.to_bits()).or_default();
            seen.visits += 1;
            if is_far(&visit, seen.inner > 0) {
                seen.far += 1;
                seen.inner += usize::from(inner);
                seen.far_cells += visit.cells.len();
                seen.farthest = seen.farthest.max(visit.distance);
            }
        }
    }
    out
}

/// Cells that are not set aside and stand apart from those beside them.
fn apart(time_s: &[f64], values: &[f64], aside: &[bool], inert: bool) -> Vec<usize> {
    let cells: Vec<usize> = (0..values.len())
        .filter(|i| values[*i].is_finite() && !aside[*i])
        .collect();
    let visits = Visits::of(time_s, values, &cells);
    let Some(scale) = Scale::of_visits(&visits) else {
        return few_readings(values, &cells);
    };
    let is_far = |v: &Visit, known: bool| {
        scale.is_far(v, known) || (inert && scale.is_cut_off(v, cells.len()))
    };
    let seen = seen(&visits, is_far);
    let of = |v: &Visit| seen.get(&v.value.to_bits()).copied().unwrap_or_default();
    let far = |v: &Visit| is_far(v, of(v).inner > 0);
    // Of the values that are repeated, the one that stands apart most often; single cells when there is none.
    let repeated = seen
        .iter()
        .filter(|(_, s)| s.far_cells >= 2 && 2 * s.far >= s.visits);
    let repeated = repeated.max_by(|a, b| {
        let often = a.1.far.cmp(&b.1.far);
        often.then(a.1.farthest.total_cmp(&b.1.farthest))
    });
    let single = |v: &Visit| {
        let alone = of(v).far_cells == 1;
        inert && alone && far(v) && scale.is_out_of_reach(v)
    };
    let most = visits
        .iter()
        .filter(single)
        .map(|v| v.distance)
        .fold(0.0, f64::max);
    let found = visits.iter().filter(|v| match repeated {
        Some((value, _)) => v.value.to_bits() == *value && far(v),
        None => single(v) && 2.0 * v.distance >= most,
    });
    let found: Vec<usize> = found
        .flat_map(|v| cells.get(v.cells).unwrap_or(&[]))
        .copied()
        .collect();
    // Where so much stands apart it is how the record is.
    if cells.len() - found.len() < READINGS {
        return Vec::new();
    }
    found
}

/// A channel that has hardly moved: a value that is repeated and lies further from all others than three times their
/// range, in at most one cell of ten.
fn few_readings(values: &[f64], cells: &[usize]) -> Vec<usize> {
    let known: Vec<f64> = cells.iter().map(|i| values[*i]).collect();
    let middle = stats::median(&known);
    let mut apart: Vec<f64> = known.iter().map(|v| (v - middle).abs()).collect();
    apart.sort_unstable_by(f64::total_cmp);
    let usual = stats::quantile_sorted(&apart, 0.9);
    // Nothing is known of a channel that stands still, but that it is not at zero as a lost one is.
    let limit = if usual > 0.0 {
        6.0 * usual
    } else {
        0.9 * middle.abs()
    };
    let far = |i: &&usize| (values[**i] - middle).abs() > limit && limit > 0.0;
    let found: Vec<usize> = cells.iter().filter(far).copied().collect();
    let repeated = |i: &usize| found.iter().filter(|j| values[**j] == values[*i]).count() > 1;
    let scattered = found.windows(4).all(|w| w[3] - w[0] > 3);
    match found.len() >= 2 && 10 * found.len() <= cells.len() && scattered {
        true => found.iter().filter(|i| repeated(i)).copied().collect(),
        false => Vec::new(),
    }
}

#[cfg(test)]
#[path = "error_values_tests.rs"]
mod tests;
