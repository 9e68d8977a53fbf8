//! Marks of records, kept as JSON, and their table.

use crate::blind::tally::quantile;
use crate::plan::{GROUPS, Split};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// The marks of one answer.
#[derive(Clone, Debug, Default)]
pub struct Mark {
    pub name: String,
    pub group: String,
    pub planted: Vec<String>,
    pub answered: Vec<String>,
    /// The build broke off, or its answer breaks the contract.
    pub failure: Option<String>,
    /// One effect to name: the first name is right.
    pub top1: Option<bool>,
    /// Effects to find, found, named, and named rightly.
    pub wanted: usize,
    pub found: usize,
    pub named: usize,
    pub rightly: usize,
    /// Nothing to name: there is a name (outside causes: a name without `left`).
    pub discovery: Option<bool>,
    /// Something is there and not named: `left` says so.
    pub honest: Option<bool>,
    pub left: bool,
    /// Held-out error over the oracle's.
    pub over_oracle: Option<f64>,
    pub seconds: f64,
}

impl Mark {
    /// Whether the names are right: all that is to be named, nothing else.
    pub fn right(&self) -> bool {
        self.failure.is_none()
            && match self.discovery {
                Some(named) => !named,
                None => self.found == self.wanted && self.named == self.rightly,
            }
    }
}

/// A share with two digits; "-" of nothing.
fn share(part: usize, whole: usize) -> String {
    if whole == 0 {
        "-".to_owned()
    } else {
        format!("{:.2}", part as f64 / whole as f64)
    }
}

/// One row of the table.
fn row(title: &str, marks: &[&Mark]) -> String {
    let count = |f: &dyn Fn(&Mark) -> Option<bool>| {
        let all: Vec<bool> = marks.iter().filter_map(|m| f(m)).collect();
        share(all.iter().filter(|x| **x).count(), all.len())
    };
    let total = |f: &dyn Fn(&Mark) -> usize| marks.iter().map(|m| f(m)).sum::<usize>();
    let wanted = total(&|m| m.wanted);
    let named = if wanted > 0 { total(&|m| m.named) } else { 0 };
    let ratios: Vec<f64> = marks.iter().filter_map(|m| m.over_oracle).collect();
    let seconds: Vec<f64> = marks.iter().map(|m| m.seconds).collect();
    let figure = |v: &[f64], q, digits: usize| {
        quantile(v, q).map_or("-".to_owned(), |x| format!("{x:.digits$}"))
    };
    format!(
        "| {title} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
        marks.len(),
        count(&|m| m.top1),
        share(total(&|m| m.found), wanted),
        share(total(&|m| m.rightly), named),
        count(&|m| m.discovery),
        count(&|m| m.honest),
        figure(&ratios, 0.5, 3),
        figure(&ratios, 0.9, 3),
        figure(&seconds, 0.5, 2),
        figure(&seconds, 1.0, 1),
        marks.iter().filter(|m| m.failure.is_some()).count(),
    )
}

/// The table: a row a group, then all, those with a sensor's noise, and the others.
pub fn table(marks: &[Mark]) -> String {
    let mut text = String::from(
        "| group | records | top-1 | recall | precision | false discoveries | left, where not all is named | error over \
         oracle, median | p90 | s, median | s, most | failures |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let mut add = |title: &str, keep: &dyn Fn(&Mark) -> bool| {
        let these: Vec<&Mark> = marks.iter().filter(|m| keep(m)).collect();
        if !these.is_empty() {
            let _ = writeln!(text, "{}", row(title, &these));
        }
    };
    for group in GROUPS {
        add(group, &|m| m.group == group);
    }
    let sensor = |m: &Mark| m.name.ends_with("_sensor");
    add("all", &|_| true);
    add("noise like a sensor's", &sensor);
    add("noise of the generators", &|m| !sensor(m));
    text
}

/// The records whose names are wrong.
pub fn misses(marks: &[Mark]) -> String {
    let mut text = String::new();
    for m in marks.iter().filter(|m| !m.right()) {
        let _ = writeln!(
            text,
            "{}: {} -> {}{}{}",
            m.name,
            m.planted.join("+"),
            m.answered.join("+"),
            if m.left { " (left)" } else { "" },
            m.failure
                .as_ref()
                .map_or(String::new(), |f| format!(" FAILED: {f}")),
        );
    }
    text
}

/// Keeps the marks; of locked records not what was planted and answered.
pub fn save(path: &Path, split: Split, marks: &[Mark]) -> Result<(), String> {
    let open = split != Split::Locked;
    let all: Vec<Value> = marks
        .iter()
        .map(|m| {
            json!({
                "name": m.name, "group": m.group, "failure": m.failure, "top1": m.top1, "wanted": m.wanted,
                "found": m.found, "named": m.named, "rightly": m.rightly, "discovery": m.discovery,
                "honest": m.honest, "left": m.left, "over_oracle": m.over_oracle, "seconds": m.seconds,
                "planted": if open { m.planted.clone() } else { Vec::new() },
                "answered": if open { m.answered.clone() } else { Vec::new() },
            })
        })
        .collect();
    let text = json!({"split": format!("{split:?}"), "marks": all}).to_string();
    std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}

/// Reads what [`save`] wrote.
pub fn load(path: &Path) -> Result<Vec<Mark>, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let v: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let all = v["marks"].as_array().ok_or("no marks")?;
    let words = |v: &Value| -> Vec<String> {
        let list = v.as_array().cloned().unwrap_or_default();
        list.iter()
            .filter_map(Value::as_str)
            .map(str::to_owned)
            .collect()
    };
    let number = |v: &Value| v.as_u64().unwrap_or(0) as usize;
    Ok(all
        .iter()
        .map(|m| Mark {
            name: m["name"].as_str().unwrap_or("").to_owned(),
            group: m["group"].as_str().unwrap_or("").to_owned(),
            planted: words(&m["planted"]),
            answered: words(&m["answered"]),
            failure: m["failure"].as_str().map(str::to_owned),
            top1: m["top1"].as_bool(),
            wanted: number(&m["wanted"]),
            found: number(&m["found"]),
            named: number(&m["named"]),
            rightly: number(&m["rightly"]),
            discovery: m["discovery"].as_bool(),
            honest: m["honest"].as_bool(),
            left: m["left"].as_bool().unwrap_or(false),
            over_oracle: m["over_oracle"].as_f64(),
            seconds: m["seconds"].as_f64().unwrap_or(0.0),
        })
        .collect())
}
