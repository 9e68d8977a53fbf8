//! Rows whose applied rate was not measured.
//!
//! A table that stands may leave `rate_dps` empty, and a log may lose a cell while it turns. Where the log has zeros, it says
//! so itself when the table stands; else the output of several rows in a row tells: it is near to what it is at rest, or it
//! is not. Of a row whose rate is not known the error is not known either.

use super::thermal::ThermalRecord;
use super::warning::Warning;

/// Share of the largest rate by which the output at rest may differ from the error of the row before (or after), at most,
/// and how many times what all but one in twenty neighbouring rows differ by.
const NEAR: f64 = 0.1;
const USUAL: f64 = 0.95;
const TIMES: f64 = 4.0;

/// Share of the largest rate below which a rate is none, and the fewest empty cells in a row that are no loss.
const STANDS: f64 = 1e-6;
const REST: usize = 3;

/// Empty cells of an applied rate become 0 where the table stands; the other rows lose their output.
pub(super) fn take(record: &mut ThermalRecord, warnings: &mut Vec<Warning>) {
    let (Some(rate), Some(output)) = (record.column("rate_dps"), record.column("rate_out_dps"))
    else {
        return;
    };
    let (mut rate, mut output) = (rate.to_vec(), output.to_vec());
    if rate.iter().all(|r| r.is_nan()) || rate.iter().all(|r| !r.is_nan()) {
        return;
    }
    let forth = at_rest(&rate, &output, 0..rate.len());
    let back = at_rest(&rate, &output, (0..rate.len()).rev());
    let mut unknown = 0;
    let rest = where_rest_may_be(&rate);
    for row in 0..rate.len() {
        if !rate[row].is_nan() || output[row].is_nan() {
            continue;
        }
        let stands = match rest[row] {
            Rest::Surely => true,
            Rest::Perhaps => forth[row] || back[row],
            Rest::No => false,
        };
        if stands {
            rate[row] = 0.0;
        } else {
            output[row] = f64::NAN;
            unknown += 1;
        }
    }
    let rows = rate.len();
    record.columns.insert("rate_dps".to_owned(), rate);
    record.columns.insert("rate_out_dps".to_owned(), output);
    if unknown > 0 {
        warnings.push(Warning::on(
            "rows_without_applied_rate",
            "rate_dps",
            format!(
                "{unknown} of {rows} rows have no rate_dps, and nothing says that the table stands; they take no part in any fit"
            ),
        ));
    }
}

/// What the cells about an empty one say of it.
#[derive(Clone, Copy, PartialEq)]
enum Rest {
    Surely,
    Perhaps,
    No,
}

/// Between cells that say that the table stands it does; where no cell says so, it may where several are empty.
fn where_rest_may_be(rate: &[f64]) -> Vec<Rest> {
    let most_dps = rate.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
    let stands = |r: &f64| r.abs() <= STANDS * most_dps;
    let says_so = rate.iter().any(stands);
    let mut out = vec![Rest::No; rate.len()];
    let mut start = 0;
    while start < rate.len() {
        let end = start + rate[start..].iter().take_while(|r| r.is_nan()).count();
        let mut beside = [start.checked_sub(1), (end < rate.len()).then_some(end)]
            .into_iter()
            .flatten();
        let run = if beside.all(|row| stands(&rate[row])) {
            Rest::Surely
        } else if !says_so && end - start >= REST {
            Rest::Perhaps
        } else {
            Rest::No
        };
        out[start..end].fill(run);
        start = end + 1;
    }
    out
}

/// The rows without a rate whose output follows on from the error of the rows before them, in the order of `rows`: the bias
/// may go far while the table stands, but not from row to row.
fn at_rest(rate: &[f64], output: &[f64], rows: impl Iterator<Item = usize>) -> Vec<bool> {
    let within_dps = usual_change(rate, output);
    let mut out = vec![false; rate.len()];
    let mut error_dps: Option<f64> = None;
    for row in rows {
        if output[row].is_nan() {
            continue;
        }
        if !rate[row].is_nan() {
            error_dps = Some(output[row] - rate[row]);
        } else if error_dps.is_some_and(|e| (output[row] - e).abs() <= within_dps) {
            out[row] = true;
            error_dps = Some(output[row]);
        }
    }
    out
}

/// What the error may differ by from row to row, deg/s.
fn usual_change(rate: &[f64], output: &[f64]) -> f64 {
    let errors: Vec<f64> = output.iter().zip(rate).map(|(o, r)| o - r).collect();
    let mut changes: Vec<f64> = errors.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    changes.retain(|c| !c.is_nan());
    changes.sort_by(f64::total_cmp);
    let usual = changes.get((USUAL * changes.len() as f64) as usize);
    let most_dps = rate.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
    let near_dps = NEAR * most_dps;
    // Decimals of a bias that stands still round.
    usual.map_or(near_dps, |u| near_dps.min(TIMES * u + 1e-6 * most_dps))
}

#[cfg(test)]
mod tests {
    use crate::design::RecordMapping;
    use crate::record::thermal::parse;
    use std::f64::consts::TAU;
    use std::path::Path;

    /// The errors of a record whose rate is `rate` and is not logged in the rows of `lost`, and its warnings. The bias is
    /// 0.1 deg/s a row, from 5 on.
    fn errors(rate: impl Fn(usize) -> f64, lost: impl Fn(usize) -> bool) -> (Vec<f64>, usize) {
        let mut text = String::from("time_s,rate_out_dps,rate_dps,die_degc\n");
        for k in 0..120 {
            let output = rate(k) + 5.0 + 0.1 * k as f64;
            let logged = if lost(k) {
                String::new()
            } else {
                format!("{:.6}", rate(k))
            };
            text.push_str(&format!(
                "{k},{output:.6},{logged},{}\n",
                20.0 + 0.3 * k as f64
            ));
        }
        let mapping = RecordMapping::default();
        let (record, warnings) = parse(text.as_bytes(), Path::new("made.csv"), &mapping).unwrap();
        let told = warnings
            .iter()
            .filter(|w| w.code == "rows_without_applied_rate");
        (record.error_dps(), told.count())
    }

    /// Every error is the bias or, in these rows, not known.
    fn are_the_bias_but_in(errors: &[f64], unknown: &[usize]) {
        for (k, error) in errors.iter().enumerate() {
            assert_eq!(error.is_nan(), unknown.contains(&k), "{k}");
            assert!(
                error.is_nan() || (error - 5.0 - 0.1 * k as f64).abs() < 1e-4,
                "{k}: {error}"
            );
        }
    }

    #[test]
    fn a_lost_cell_of_a_turning_table_is_not_rest() {
        let sine = |k: usize| 60.0 * (TAU * k as f64 / 40.0).sin();
        let (errors, told) = errors(sine, |k| [7, 48, 49, 73].contains(&k));
        are_the_bias_but_in(&errors, &[7, 48, 49, 73]);
        assert_eq!(told, 1);
    }

    #[test]
    fn a_lost_cell_between_two_rates_is_not_rest_though_its_output_is_the_smaller() {
        let steps = |k: usize| [44.0, -74.0, -166.0, 90.0, 21.0][k % 5];
        let (errors, told) = errors(steps, |k| [1, 4, 61, 79].contains(&k));
        are_the_bias_but_in(&errors, &[1, 4, 61, 79]);
        assert_eq!(told, 1);
    }

    #[test]
    fn a_lost_cell_of_a_slow_rate_is_not_rest_though_its_output_may_be() {
        // About its zeros the sine is within a tenth of what it is at most.
        let sine = |k: usize| 60.0 * (TAU * (k as f64 + 0.3) / 90.0).sin();
        let (errors, told) = errors(sine, |k| [1, 44, 45, 88, 90].contains(&k));
        are_the_bias_but_in(&errors, &[1, 44, 45, 88, 90]);
        assert_eq!(told, 1);
    }

    #[test]
    fn where_the_log_has_zeros_they_decide() {
        let steps = |k: usize| [0.0, 3.0, 0.0, -60.0][k / 30];
        // Within a stand; four within the slow rate; at its border.
        let lost = |k: usize| [4, 5, 40, 41, 42, 43, 60].contains(&k);
        let (errors, told) = errors(steps, lost);
        are_the_bias_but_in(&errors, &[40, 41, 42, 43, 60]);
        assert_eq!(told, 1);
    }

    #[test]
    fn empty_cells_of_a_table_that_stands_are_rest() {
        let steps = |k: usize| match k {
            20..40 => 50.0,
            70..90 => -50.0,
            _ => 0.0,
        };
        let (errors, told) = errors(steps, |k| steps(k) == 0.0);
        are_the_bias_but_in(&errors, &[]);
        assert_eq!(told, 0);
    }
}
