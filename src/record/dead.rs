//! A gyro that does not move: nothing can be judged of it.

use super::columns::unit_of;
use super::thermal::ThermalRecord;
use crate::error::{InputError, Result};
use crate::statistics::stats;
use std::path::Path;

/// What helps.
pub(super) const HELP: &str = "a gyro at rest shows its own noise: look for a sensor that is not there, a column of another \
                               quantity, or an export with too few digits";

/// Share of the size of the values below which they are the same number, summed in another order.
const SAME: f64 = 1e-12;

/// Refuses a record whose output is one value, or steps between two: its noise is less than one LSB, so that neither noise
/// nor drift can be told.
///
/// # Errors
/// Such a record; `line` is where it begins.
pub(super) fn refuse(record: &ThermalRecord, path: &Path, line: Option<usize>) -> Result<()> {
    let output = record.column("rate_out_dps").unwrap_or(&[]);
    let Some((low, high)) = stats::extremes(output) else {
        return Ok(());
    };
    let size = low.abs().max(high.abs());
    let mut different: Vec<f64> = output.iter().copied().filter(|v| !v.is_nan()).collect();
    different.sort_unstable_by(f64::total_cmp);
    different.dedup_by(|a, b| (*a - *b).abs() <= SAME * size);
    if different.len() > 2 {
        return Ok(());
    }
    let mut error = InputError::new(samples("rate_out_dps", &different))
        .in_file(path)
        .help(HELP);
    if let Some(line) = line {
        error = error.at(line, 1);
    }
    Err(error.into())
}

/// What is said of a channel with these different values, one or two.
pub(super) fn samples(name: &str, different: &[f64]) -> String {
    let unit = unit_of("rate_out_dps");
    match different {
        [low, high] => format!(
            "{name} takes two values alone, {low} and {high} {unit}: its noise is below one LSB, so nothing can be judged"
        ),
        _ => {
            let value = different.first().copied().unwrap_or(0.0);
            format!("{name} is {value} {unit} throughout: a dead channel, so nothing can be judged")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::thermal::parse;
    use crate::design::RecordMapping;
    use std::path::Path;

    fn refused(output: impl Fn(usize) -> String) -> Option<String> {
        let rows = (0..60).map(|k| format!("{k},{},{}\n", output(k), 20 + k));
        let text = "time_s,rate_out_dps,die_degc\n".to_owned() + &rows.collect::<String>();
        let parsed = parse(
            text.as_bytes(),
            Path::new("r.csv"),
            &RecordMapping::default(),
        );
        parsed.err().map(|e| {
            assert_eq!(e.exit_status(), 2);
            e.to_string()
        })
    }

    #[test]
    fn an_output_that_does_not_move_is_refused() {
        for value in ["0", "0.0", "-1.25", "5e-324"] {
            let said = refused(|_| value.to_owned()).unwrap();
            assert!(
                said.contains("throughout") && said.contains("nothing can be judged"),
                "{said}"
            );
        }
        let said = refused(|k| ["0.061", "0.122"][k % 7 / 6].to_owned()).unwrap();
        assert!(said.contains("below one LSB"), "{said}");
        assert!(refused(|k| ["", "0"][k % 2].to_owned()).is_some());
        // Three steps are little, but they are something.
        assert_eq!(refused(|k| ["0", "0.061", "0.122"][k % 3].to_owned()), None);
    }
}
