//! Prints a thermal record as it was read: `record_rows FILE [INSTANCE [AXIS]]`.
//!
//! One CSV with all digits, each warning as a comment before it: for comparisons with other readers
//! (`python/compare_logs.py`).

use gyrogen::design::{LogAxis, RecordMapping};
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let Some(path) = arguments.next() else {
        eprintln!("usage: record_rows FILE [INSTANCE [AXIS]]");
        return ExitCode::from(2);
    };
    let instance = arguments.next().and_then(|i| i.parse().ok());
    let axis = match arguments.next().as_deref() {
        Some("x") => LogAxis::X,
        Some("y") => LogAxis::Y,
        _ => LogAxis::Z,
    };
    let mapping = RecordMapping {
        instance,
        axis,
        ..RecordMapping::default()
    };
    let (record, warnings) = match gyrogen::record::read_any(path.as_ref(), &mapping) {
        Ok(read) => read,
        Err(e) => {
            eprintln!("{e}");
            return ExitCode::from(2);
        }
    };
    let mut text = String::new();
    for warning in &warnings {
        text += &format!("# {}: {}\n", warning.code, warning.message);
    }
    text += "time_s";
    for name in record.columns.keys() {
        text += &format!(",{name}");
    }
    text += "\n";
    for (row, time_s) in record.time_s.iter().enumerate() {
        text += &time_s.to_string();
        for values in record.columns.values() {
            text += &format!(",{}", values.get(row).copied().unwrap_or(f64::NAN));
        }
        text += "\n";
    }
    match std::io::stdout().write_all(text.as_bytes()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::FAILURE,
    }
}
