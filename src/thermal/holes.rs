//! Rows in which a reading is missing that its neighbours do not give.
//!
//! Channels are filled between measured rows (`channels::filled`), for what depends on their past needs them whole. A filled
//! cell of a thermometer is an error of the declared bias, and one of a channel that changes from row to row is no
//! reading at all: an output beside it says nothing of any model.

use crate::record::{ThermalRecord, Warning};
use std::collections::BTreeMap;

/// Error of a straight line between a reading's neighbours, rms over the channel's deviation, up to which it gives a
/// missing one.
const NEAR: f64 = 0.01;

/// Share of the rows that may be missing: a channel that is read seldom is filled all the same.
const SELDOM: f64 = 0.2;

/// Columns whose holes have rules of their own.
const APART: [&str; 4] = [
    "time_s",
    "time_since_power_on_s",
    "rate_out_dps",
    "rate_dps",
];

/// Takes the output from rows in which the thermometer, or another channel that its neighbours do not give, was not
/// measured.
pub(super) fn take(
    record: &ThermalRecord,
    columns: &mut BTreeMap<String, Vec<f64>>,
    thermometer: &str,
) -> Option<Warning> {
    let time_s = &record.time_s;
    let mut lost = vec![false; time_s.len()];
    let mut names = Vec::new();
    for (name, values) in columns.iter() {
        let holes = values.iter().filter(|v| v.is_nan()).count();
        let few = holes > 0 && holes as f64 <= SELDOM * values.len() as f64;
        if APART.contains(&name.as_str()) {
            continue;
        }
        if !few {
            if name == thermometer && holes > 0 && long_gaps(values, &mut lost) {
                names.push(name.as_str());
            }
            continue;
        }
        if name == thermometer || !is_given(time_s, values) {
            names.push(name.as_str());
            lost.iter_mut()
                .zip(values)
                .for_each(|(l, v)| *l |= v.is_nan());
        }
    }
    let names = names.join(", ");
    let output = columns.get_mut("rate_out_dps")?;
    let mut rows = Vec::new();
    for (row, (value, is_lost)) in output.iter_mut().zip(&lost).enumerate() {
        if *is_lost && !value.is_nan() {
            *value = f64::NAN;
            rows.push(row);
        }
    }
    (!rows.is_empty()).then(|| {
        let said = format!(
            "{} of {} rows {} no reading of {names} ({}). None is interpolated, for its error would count as one of the gyro's: \
             such a row takes no part in any fit or figure",
            rows.len(),
            time_s.len(),
            if rows.len() == 1 { "has" } else { "have" },
            record.places(&rows)
        );
        Warning::general("rows_with_holes", said)
    })
}

/// Times the usual distance of two readings from which a gap between them is one that no line fills.
const LONG: usize = 3;

/// Marks the rows in the gaps of a channel that is read seldom which are longer than its readings are apart as a rule (and at
/// its ends); true if there are any.
fn long_gaps(values: &[f64], lost: &mut [bool]) -> bool {
    let known: Vec<usize> = (0..values.len())
        .filter(|i| values[*i].is_finite())
        .collect();
    let mut apart: Vec<usize> = known.windows(2).map(|w| w[1] - w[0]).collect();
    apart.sort_unstable();
    let Some(usual) = apart.get(apart.len() / 2).copied() else {
        return false;
    };
    let (first, last) = (known.first().copied(), known.last().copied());
    let ends = first.map(|f| (0, f)).into_iter();
    let ends = ends.chain(last.map(|l| (l + 1, values.len())));
    let inner = known.windows(2).map(|w| (w[0] + 1, w[1]));
    let mut any = false;
    for (from, to) in inner.chain(ends) {
        // Readings every n rows leave up to n - 1 before the first and behind the last.
        if to - from + 1 > LONG * usual {
            lost[from..to].fill(true);
            any = true;
        }
    }
    any
}

/// Whether measured readings lie on the line between their neighbours.
fn is_given(time_s: &[f64], values: &[f64]) -> bool {
    let known: Vec<usize> = (0..values.len())
        .filter(|i| values[*i].is_finite())
        .collect();
    let count = known.len().max(1) as f64;
    let mean = known.iter().map(|i| values[*i]).sum::<f64>() / count;
    let square = known
        .iter()
        .map(|i| (values[*i] - mean).powi(2))
        .sum::<f64>()
        / count;
    let off = known.windows(3).map(|w| {
        let [a, i, b] = [w[0], w[1], w[2]];
        let width_s = time_s[b] - time_s[a];
        let share = match width_s > 0.0 {
            true => (time_s[i] - time_s[a]) / width_s,
            false => 0.5,
        };
        (values[i] - values[a] - share * (values[b] - values[a])).powi(2)
    });
    off.sum::<f64>() / count <= NEAR.powi(2) * square
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::synthetic::record;

    /// Which of 200 rows lose their output with holes in a column, and whether that is said.
    fn kept(name: &str, value: impl Fn(usize) -> f64, holes: &[usize]) -> (Vec<usize>, bool) {
        let (lost, said) = lost(name, value, holes);
        (lost, said.is_some())
    }

    /// The same with what is said.
    fn lost(
        name: &str,
        value: impl Fn(usize) -> f64,
        holes: &[usize],
    ) -> (Vec<usize>, Option<String>) {
        let mut record = record("die_degc", &[0.0; 200], &[0.0; 200]);
        record.time_s = (0..200).map(|k| 10.0 * k as f64).collect();
        let read = |k: usize| {
            if holes.contains(&k) {
                f64::NAN
            } else {
                value(k)
            }
        };
        let mut columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), vec![1.0; 200]),
            (name.to_owned(), (0..200).map(read).collect()),
        ]);
        let warning = take(&record, &mut columns, "die_degc");
        let output = &columns["rate_out_dps"];
        let lost = (0..200).filter(|k| output[*k].is_nan()).collect();
        let said = warning.filter(|w| w.code == "rows_with_holes");
        (lost, said.map(|w| w.message))
    }

    #[test]
    fn rows_with_holes_are_told_with_their_lines() {
        for (holes, part) in [
            (
                &[5][..],
                "1 of 200 rows has no reading of die_degc (line 7). None is interpolated",
            ),
            (
                &[5, 50],
                "2 of 200 rows have no reading of die_degc (line 7, 52). None is",
            ),
        ] {
            let (_, said) = lost("die_degc", |k| k as f64, holes);
            assert!(
                said.as_ref().is_some_and(|said| said.starts_with(part)),
                "{said:?}"
            );
        }
    }

    #[test]
    fn a_row_without_what_its_neighbours_do_not_give_has_no_error() {
        let slow = |k: usize| (k as f64 / 40.0).sin();
        let fast = |k: usize| (1.7 * k as f64).sin();
        let nothing = (Vec::new(), false);
        assert_eq!(kept("agc", slow, &[5, 50, 51]), nothing);
        assert_eq!(kept("agc", fast, &[5, 50, 51]), (vec![5, 50, 51], true));
        assert_eq!(
            kept("die_degc", slow, &[5, 50, 51]),
            (vec![5, 50, 51], true)
        );
        assert_eq!(kept("agc", |_| 1.0, &[5]), nothing);
        assert_eq!(kept("agc", fast, &[]), nothing);
        // Their holes have other rules.
        assert_eq!(kept("rate_dps", fast, &[5]), nothing);
        // One row in three.
        let seldom: Vec<usize> = (0..200).filter(|k| k % 3 > 0).collect();
        assert_eq!(kept("chamber_degc", fast, &seldom), nothing);
    }

    #[test]
    fn a_gap_longer_than_three_of_the_usual_is_no_reading() {
        let slow = |k: usize| (k as f64 / 40.0).sin();
        // A thermometer that is read in every fifth row, and for a while is not.
        let without = |gap: std::ops::Range<usize>| -> Vec<usize> {
            (0..200).filter(|k| k % 5 > 0 || gap.contains(k)).collect()
        };
        assert_eq!(kept("die_degc", slow, &without(0..0)), (Vec::new(), false));
        // Two readings are missing: fifteen rows from one to the next, three times the usual.
        assert_eq!(
            kept("die_degc", slow, &without(91..100)),
            (Vec::new(), false)
        );
        // Three are: the rows between the readings 90 and 110 have no temperature.
        assert_eq!(
            kept("die_degc", slow, &without(91..110)),
            ((91..110).collect(), true)
        );
        // At the ends as well, where no reading stands on the other side.
        assert_eq!(
            kept("die_degc", slow, &without(0..20)),
            ((0..20).collect(), true)
        );
        assert_eq!(
            kept("die_degc", slow, &without(180..200)),
            ((176..200).collect(), true)
        );
        // Another channel than the thermometer is filled all the same.
        assert_eq!(kept("agc", slow, &without(91..110)), (Vec::new(), false));
        // One without any reading loses nothing here: it is refused elsewhere.
        assert_eq!(kept("die_degc", |_| f64::NAN, &[]), (Vec::new(), false));
    }
}
