//! Drives a build of gyrogen over a split, as a user would: one process a record, on both cores.

use crate::blind::linear::rms;
use crate::blind::score::{self, column, oracle_residual};
use crate::blind::{BlindRecord, Class, make};
use crate::plan::{Entry, Split};
use crate::sheet::Mark;
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Does `work` for each entry on all processors; the results are in the entries' order.
pub fn each<T: Send>(entries: &[Entry], work: impl Fn(usize, &Entry) -> T + Sync) -> Vec<T> {
    let workers = std::thread::available_parallelism().map_or(1, |n| n.get());
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some((k, e)) = {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    entries.get(k).map(|e| (k, e))
                } {
                    let result = work(k, e);
                    let mut all = done.lock().expect("no worker panics with the lock");
                    all.push((k, result));
                    if std::io::stderr().is_terminal() || all.len() % 20 == 0 {
                        eprint!("\r{}/{} ", all.len(), entries.len());
                        let _ = std::io::stderr().flush();
                    }
                }
            });
        }
    });
    eprintln!();
    let mut all = done.into_inner().expect("all workers are done");
    all.sort_by_key(|(k, _)| *k);
    all.into_iter().map(|(_, t)| t).collect()
}

/// Marks of a build on a split.
pub fn score(split: Split, binary: &Path, options: &[&str]) -> Result<Vec<Mark>, String> {
    let binary = binary
        .canonicalize()
        .map_err(|e| format!("{}: {e}", binary.display()))?;
    let entries = crate::plan::records(split, &crate::donors::all());
    Ok(each(&entries, |_, e| one(e, &binary, options)))
}

/// What the build left in its folder.
struct Left {
    closure: serde_json::Value,
    residuals: String,
    seconds: f64,
}

/// Closes one record.
fn close(csv: &str, binary: &Path, options: &[&str]) -> Result<Left, String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let record = folder.path().join("record.csv");
    std::fs::write(&record, csv).map_err(|e| e.to_string())?;
    let start = Instant::now();
    let done = Command::new(binary)
        .current_dir(folder.path())
        .args(["close", "--record", "record.csv", "--out", "out"])
        .args(options)
        .stdout(Stdio::null())
        .output()
        .map_err(|e| e.to_string())?;
    let seconds = start.elapsed().as_secs_f64();
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr);
        return Err(said.lines().last().unwrap_or("failed").to_owned());
    }
    let read = |name: &str| std::fs::read_to_string(folder.path().join("out").join(name));
    let text = read("closure.json").map_err(|e| e.to_string())?;
    Ok(Left {
        closure: serde_json::from_str(&text).map_err(|e| e.to_string())?,
        residuals: read("residuals.csv").map_err(|e| e.to_string())?,
        seconds,
    })
}

/// Error on the build's held-out rows, outliers left out by the truth, over that of an oracle which knows the contributions and
/// is fitted by least squares on the other rows. None where repeated rows were averaged in reading.
fn over_oracle(record: &BlindRecord, residuals: &str) -> Option<f64> {
    let (held, after) = (
        column(residuals, "held_out"),
        column(residuals, "after_dps"),
    );
    if held.len() != record.truth.reading.len() {
        return None;
    }
    let (oracle, _) = oracle_residual(record, |k| held[k] == 0.0);
    let rows: Vec<usize> = (0..held.len())
        .filter(|k| held[*k] == 1.0 && !record.truth.outlier[*k])
        .filter(|k| after[*k].is_finite() && oracle[*k].is_finite())
        .collect();
    let on = |v: &[f64]| rms(&rows.iter().map(|k| v[*k]).collect::<Vec<_>>());
    (rows.len() > 4).then(|| on(&after) / on(&oracle))
}

/// Closes and marks a record.
fn one(entry: &Entry, binary: &Path, options: &[&str]) -> Mark {
    let mut record = make(&entry.scenario);
    let truth = record.truth.clone();
    let mut mark = Mark {
        name: entry.name.clone(),
        group: entry.group.to_owned(),
        planted: truth.planted.iter().map(|p| p.id.clone()).collect(),
        ..Mark::default()
    };
    let left = match close(&record.csv, binary, options) {
        Ok(left) => left,
        Err(why) => {
            mark.failure = Some(why);
            mark.wanted = truth.effects.len();
            mark.top1 = (truth.effects.len() == 1).then_some(false);
            return mark;
        }
    };
    mark.seconds = left.seconds;
    mark.over_oracle = over_oracle(&record, &left.residuals);
    let mut answer = score::read(&left.closure);
    mark.failure = answer.violations.first().cloned();
    mark.left = answer.left;
    // Lines belong to the noise: naming one as pickup is neither right nor wrong.
    if !truth.lines.is_empty() {
        answer.steps.retain(|s| s.0 != "periodic_pickup");
    }
    mark.answered = answer.steps.iter().map(|s| s.0.clone()).collect();
    // The scorer's singles are the records with one effect to name, of whatever group.
    if truth.effects.len() == 1 && record.truth.class != Class::Faint {
        record.truth.class = Class::Single;
    }
    let m = score::marked(&answer, &record.truth);
    mark.top1 = m.right;
    (mark.wanted, mark.found) = (m.wanted, m.found);
    (mark.named, mark.rightly) = (m.named, m.rightly);
    let clean = matches!(truth.class, Class::None | Class::NoiseOnly);
    mark.discovery = match truth.class {
        Class::None | Class::NoiseOnly | Class::HiddenChannel => Some(m.false_discovery),
        // A name outside the catalogue's truth is false unless the answer says that more is left.
        Class::Outside => Some(m.confident_wrong),
        _ => None,
    };
    let complete = mark.wanted == mark.found && mark.wanted > 0;
    mark.honest = (!clean && !complete).then_some(answer.left);
    mark
}
