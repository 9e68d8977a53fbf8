//! Marks of many records, added up and printed as Markdown tables.

use super::score::{Mark, score};
use super::{BlindRecord, CLASSES, Class, Scenario, make};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Puts every scenario's record to `close`, which gives the answer and the rows that it held out, or says why not. On all
/// processors; the marks are in the order of the scenarios.
pub fn run(
    scenarios: &[Scenario],
    close: impl Fn(&str) -> Result<(Value, Vec<bool>), String> + Sync,
) -> Vec<Mark> {
    let one = |s: &Scenario| {
        let record: BlindRecord = make(s);
        match close(&record.csv) {
            Ok((answer, heldout)) => score(&record, &answer, &heldout),
            Err(why) => Mark::crashed(&record.truth, why),
        }
    };
    let workers = std::thread::available_parallelism().map_or(1, |n| n.get());
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(scenarios.len()));
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some((k, s)) = {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    scenarios.get(k).map(|s| (k, s))
                } {
                    let mark = one(s);
                    done.lock()
                        .expect("no worker panics with the lock")
                        .push((k, mark));
                }
            });
        }
    });
    let mut marks = done.into_inner().expect("all workers are done");
    marks.sort_by_key(|(k, _)| *k);
    marks.into_iter().map(|(_, m)| m).collect()
}

/// A share in per cent; None of nothing.
fn percent(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| 100.0 * part as f64 / whole as f64)
}

/// The `q` quantile by nearest rank; None of nothing.
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let at = (q * sorted.len() as f64).ceil().max(1.0) as usize - 1;
    sorted.get(at).copied()
}

/// The figures of one class.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    pub records: usize,
    /// Per cent; None where the class has no such mark.
    pub right: Option<f64>,
    pub recall: Option<f64>,
    pub precision: Option<f64>,
    pub false_discoveries: Option<f64>,
    pub confident_wrong: Option<f64>,
    pub admitted: Option<f64>,
    /// Held-out rms over the oracle's.
    pub over_oracle_median: Option<f64>,
    pub over_oracle_p90: Option<f64>,
    /// Records whose held-out rms is above 1.02 times that before.
    pub worse: usize,
    /// Largest firmware over float.
    pub firmware_worst: Option<f64>,
    pub violations: usize,
}

/// Adds up the marks of one class.
pub fn figures(marks: &[&Mark]) -> Figures {
    let n = marks.len();
    let count = |f: &dyn Fn(&Mark) -> bool| marks.iter().filter(|m| f(m)).count();
    let total = |f: &dyn Fn(&Mark) -> usize| marks.iter().map(|m| f(m)).sum::<usize>();
    let judged = count(&|m| m.right.is_some());
    let outside = count(&|m| m.admitted.is_some());
    let nothing = count(&|m| m.wanted == 0 && m.admitted.is_none());
    let ratios: Vec<f64> = marks.iter().filter_map(|m| m.over_oracle).collect();
    let firmware: Vec<f64> = marks.iter().filter_map(|m| m.firmware_over_float).collect();
    let wanted = total(&|m| m.wanted);
    let named = if wanted > 0 { total(&|m| m.named) } else { 0 };
    Figures {
        records: n,
        right: percent(count(&|m| m.right == Some(true)), judged),
        recall: percent(total(&|m| m.found), wanted),
        precision: percent(total(&|m| m.rightly), named),
        false_discoveries: percent(count(&|m| m.false_discovery), nothing),
        confident_wrong: percent(count(&|m| m.confident_wrong), outside),
        admitted: percent(count(&|m| m.admitted == Some(true)), outside),
        over_oracle_median: quantile(&ratios, 0.5),
        over_oracle_p90: quantile(&ratios, 0.9),
        worse: count(&|m| m.after_over_before.is_some_and(|r| r > 1.02)),
        firmware_worst: quantile(&firmware, 1.0),
        violations: count(&|m| !m.violations.is_empty()),
    }
}

/// The marks of a class.
pub fn of_class(marks: &[Mark], class: Class) -> Vec<&Mark> {
    marks.iter().filter(|m| m.class == class).collect()
}

/// One row a class.
pub fn table(marks: &[Mark]) -> String {
    let mut text = String::from(
        "| class | records | right % | recall % | precision % | false discoveries % | confident wrong % | admitted % \
         | over oracle median | p90 | worse than before | firmware/float worst | violations |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let show =
        |v: Option<f64>, digits: usize| v.map_or("-".to_owned(), |x| format!("{x:.digits$}"));
    for class in CLASSES {
        let these = of_class(marks, class);
        if these.is_empty() {
            continue;
        }
        let f = figures(&these);
        let _ = writeln!(
            text,
            "| {class:?} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            f.records,
            show(f.right, 1),
            show(f.recall, 1),
            show(f.precision, 1),
            show(f.false_discoveries, 1),
            show(f.confident_wrong, 1),
            show(f.admitted, 1),
            show(f.over_oracle_median, 3),
            show(f.over_oracle_p90, 3),
            f.worse,
            show(f.firmware_worst, 3),
            f.violations,
        );
    }
    text
}

/// Records, right answers, and what was said instead.
type Confusion<'a> = (usize, usize, BTreeMap<&'a str, usize>);

/// What was planted, how often it was answered rightly, and what was answered instead.
pub fn confusion(marks: &[Mark]) -> String {
    let mut rows: BTreeMap<(Class, &str), Confusion<'_>> = BTreeMap::new();
    for m in marks {
        let row = rows.entry((m.class, m.planted.as_str())).or_default();
        row.0 += 1;
        let nothing = m.wanted == 0 && !m.false_discovery && !m.confident_wrong;
        let right = m
            .right
            .unwrap_or(nothing || (m.wanted > 0 && m.found == m.wanted && m.named == m.rightly));
        if right {
            row.1 += 1;
        } else {
            let said = if m.answered.is_empty() {
                "(nothing)"
            } else {
                m.answered.as_str()
            };
            *row.2.entry(said).or_default() += 1;
        }
    }
    let mut text =
        String::from("| class | planted | records | right | instead |\n|---|---|---|---|---|\n");
    for ((class, planted), (all, right, instead)) in rows {
        let planted = if planted.is_empty() {
            "(nothing)"
        } else {
            planted
        };
        let said: Vec<String> = instead.iter().map(|(k, n)| format!("{k} x{n}")).collect();
        let _ = writeln!(
            text,
            "| {class:?} | {planted} | {all} | {right} | {} |",
            said.join(", ")
        );
    }
    text
}
