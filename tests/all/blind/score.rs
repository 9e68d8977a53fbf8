//! What an answer (`closure.json` of the record contract) is worth against the truth.

use super::linear::{least_squares, rms};
use super::{BlindRecord, Class, Truth};
use serde_json::Value;

/// What the scorer reads of an answer.
#[derive(Clone, Debug, Default)]
pub struct Answer {
    /// (effect, indistinguishable_from), in the order of the steps.
    pub steps: Vec<(String, Vec<String>)>,
    pub left: bool,
    pub strongest_channel: Option<String>,
    pub before_rms: Option<f64>,
    pub after_rms: Option<f64>,
    /// None where not compensable.
    pub firmware_rms: Option<f64>,
    /// What breaks the contract.
    pub violations: Vec<String>,
}

/// Reads an answer; what is missing or contradicts itself becomes a violation.
pub fn read(v: &Value) -> Answer {
    let mut a = Answer::default();
    let mut broken = Vec::new();
    if v["schema"] != "gyrogen.closure/1" {
        broken.push(format!("schema {}", v["schema"]));
    }
    match v["steps"].as_array() {
        None => broken.push("no steps".to_owned()),
        Some(steps) => {
            for s in steps {
                let like = s["indistinguishable_from"].as_array();
                let like: Vec<String> = like
                    .into_iter()
                    .flatten()
                    .filter_map(Value::as_str)
                    .map(str::to_owned)
                    .collect();
                if like.len() > 4 {
                    broken.push("more than four indistinguishable".to_owned());
                }
                match s["effect"].as_str() {
                    Some(e) => a.steps.push((e.to_owned(), like)),
                    None => broken.push("a step without effect".to_owned()),
                }
            }
        }
    }
    match v["residual_structure"]["left"].as_bool() {
        Some(left) => a.left = left,
        None => broken.push("no residual_structure.left".to_owned()),
    }
    a.strongest_channel = v["residual_structure"]["strongest_channel"]
        .as_str()
        .map(str::to_owned);
    a.before_rms = v["before"]["heldout_rms"].as_f64();
    a.after_rms = v["after"]["heldout_rms"].as_f64();
    a.firmware_rms = v["firmware"]["heldout_rms"].as_f64();
    if a.before_rms.is_none() || a.after_rms.is_none() || v["noise_floor_rms"].as_f64().is_none() {
        broken.push("a figure is missing".to_owned());
    }
    let expected = match (a.steps.is_empty(), a.left) {
        (true, false) => "complete",
        (false, false) => "explained",
        (false, true) => "partly_explained",
        (true, true) => "unexplained",
    };
    if v["verdict"] != expected {
        broken.push(format!("verdict {} where {expected} follows", v["verdict"]));
    }
    a.violations = broken;
    a
}

/// The marks of one answer.
#[derive(Clone, Debug)]
pub struct Mark {
    pub class: Class,
    /// Planted ids, joined.
    pub planted: String,
    /// Named ids, joined.
    pub answered: String,
    /// The answer broke off, or breaks the contract: why.
    pub violations: Vec<String>,
    /// Singles, covariates: the first name is right. Confounded: the truth is named or listed.
    pub right: Option<bool>,
    /// Effects to find, found, named, and named rightly.
    pub wanted: usize,
    pub found: usize,
    pub named: usize,
    pub rightly: usize,
    /// A name where nothing is to be named (none, noise, hidden channel, unexcited).
    pub false_discovery: bool,
    /// A name outside the catalogue's truth without the word that more is left.
    pub confident_wrong: bool,
    /// Outside: what is left is admitted, with the right channel where there is one.
    pub admitted: Option<bool>,
    /// Held-out rms over the oracle's.
    pub over_oracle: Option<f64>,
    /// Held-out rms after over before.
    pub after_over_before: Option<f64>,
    /// Firmware over float.
    pub firmware_over_float: Option<f64>,
}

impl Mark {
    /// The mark of an answer that never came.
    pub fn crashed(truth: &Truth, why: String) -> Self {
        let mut mark = marked(&Answer::default(), truth);
        mark.violations = vec![why];
        mark
    }
}

/// True if the step names `id`, or lists it while the two are in fact inseparable in this record.
fn hits(step: &(String, Vec<String>), id: &str, truth: &Truth) -> bool {
    let same = |other: &str| {
        truth
            .alternatives
            .iter()
            .any(|(p, o, _)| p == id && o == other)
    };
    step.0 == id || (same(&step.0) && step.1.iter().any(|l| l == id))
}

/// Names against truth, without figures.
pub fn marked(a: &Answer, truth: &Truth) -> Mark {
    let wanted = &truth.effects;
    let found = wanted
        .iter()
        .filter(|id| a.steps.iter().any(|s| hits(s, id, truth)))
        .count();
    let rightly = a
        .steps
        .iter()
        .filter(|s| wanted.iter().any(|id| hits(s, id, truth)))
        .count();
    let listed = |id: &String| a.steps.iter().any(|s| s.0 == *id || s.1.contains(id));
    let right = match truth.class {
        Class::Single | Class::Faint | Class::Covariate => Some(
            a.steps
                .first()
                .is_some_and(|s| wanted.iter().any(|id| hits(s, id, truth))),
        ),
        // More than four alternatives: the record decides nothing, and saying so is right.
        Class::Confounded => {
            let many = truth.alternatives.len() > 4 && a.steps.is_empty() && a.left;
            Some(wanted.iter().any(listed) || many)
        }
        _ => None,
    };
    let false_discovery = match truth.class {
        Class::None | Class::NoiseOnly | Class::Unexcited => !a.steps.is_empty(),
        // Its own name, found another way (a warm-up by the clock that starts with the record), is not wrong.
        Class::HiddenChannel => {
            let hidden = |id: &String| truth.planted.iter().any(|p| p.id == *id);
            a.steps.iter().any(|s| !hidden(&s.0))
        }
        _ => false,
    };
    let outside = truth.class == Class::Outside;
    let channel = truth
        .outside_channel
        .is_none_or(|c| a.strongest_channel.as_deref() == Some(c));
    Mark {
        class: truth.class,
        planted: truth
            .planted
            .iter()
            .map(|p| p.id.as_str())
            .collect::<Vec<_>>()
            .join("+"),
        answered: a
            .steps
            .iter()
            .map(|s| s.0.as_str())
            .collect::<Vec<_>>()
            .join("+"),
        violations: a.violations.clone(),
        right,
        wanted: wanted.len(),
        found,
        named: a.steps.len(),
        rightly,
        false_discovery,
        confident_wrong: outside && !a.steps.is_empty() && !a.left,
        admitted: outside.then_some(a.left && channel),
        over_oracle: None,
        after_over_before: None,
        firmware_over_float: None,
    }
}

/// Scores an answer. `heldout` has one value a row of the CSV: true where the answer's held-out figures
/// were taken; empty if the answer does not say (then there is no comparison with the oracle).
pub fn score(record: &BlindRecord, answer: &Value, heldout: &[bool]) -> Mark {
    let a = read(answer);
    let mut m = marked(&a, &record.truth);
    if heldout.len() == record.truth.reading.len() && heldout.iter().any(|h| *h) {
        let oracle = oracle_rms(record, heldout);
        m.over_oracle = a.after_rms.map(|x| x / oracle);
    } else if !heldout.is_empty() {
        m.violations.push(format!(
            "{} held-out marks for {} rows",
            heldout.len(),
            record.truth.reading.len()
        ));
    }
    m.after_over_before = a.after_rms.zip(a.before_rms).map(|(x, y)| x / y);
    m.firmware_over_float = a.firmware_rms.zip(a.after_rms).map(|(x, y)| x / y);
    m
}

/// A column of the CSV; NaN where empty or `nan`. Empty if there is no such column.
pub fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines().filter(|l| !l.starts_with('#'));
    let at = lines
        .next()
        .and_then(|h| h.split(',').position(|n| n == name));
    let cell = |l: &str| {
        at.and_then(|k| l.split(',').nth(k))
            .and_then(|c| c.parse().ok())
    };
    match at {
        Some(_) => lines.map(|l| cell(l).unwrap_or(f64::NAN)).collect(),
        None => Vec::new(),
    }
}

/// Held-out rms of the oracle: {1, p, p^2} with the measured thermometer and the exact contributions, fitted on all
/// other rows without the outliers (which it knows), judged on all held-out rows that have an output.
pub fn oracle_rms(record: &BlindRecord, heldout: &[bool]) -> f64 {
    let (residual, _) = oracle_residual(record, |k| !heldout[k]);
    rms(&(0..heldout.len())
        .filter(|k| heldout[*k])
        .map(|k| residual[k])
        .filter(|r| r.is_finite())
        .collect::<Vec<_>>())
}

/// The oracle's residual on every row (NaN where not measured) and its coefficients (1, u, u^2, effects), fitted on the rows
/// that `train` keeps.
pub fn oracle_residual(
    record: &BlindRecord,
    train: impl Fn(usize) -> bool,
) -> (Vec<f64>, Vec<f64>) {
    let t = &record.truth;
    let out = column(&record.csv, "rate_out_dps");
    let rate = column(&record.csv, "rate_dps");
    let p = column(&record.csv, t.thermometer);
    let p: Vec<f64> = p
        .iter()
        .zip(&t.reading)
        .map(|(m, r)| if m.is_nan() { *r } else { *m })
        .collect();
    let error: Vec<f64> = (0..out.len())
        .map(|k| out[k] - rate.get(k).copied().unwrap_or(0.0))
        .collect();
    let u = super::linear::centred(&p);
    let mut columns = vec![
        vec![1.0; u.len()],
        u.clone(),
        u.iter().map(|x| x * x).collect(),
    ];
    columns.extend(t.oracle.iter().cloned());
    let rows: Vec<usize> = (0..error.len())
        .filter(|k| train(*k) && !t.outlier[*k] && error[*k].is_finite())
        .collect();
    let on_rows = |v: &[f64]| rows.iter().map(|k| v[*k]).collect::<Vec<f64>>();
    let picked: Vec<Vec<f64>> = columns.iter().map(|c| on_rows(c)).collect();
    let k = least_squares(&picked, &on_rows(&error));
    let residual = (0..error.len())
        .map(|row| error[row] - columns.iter().zip(&k).map(|(c, k)| c[row] * k).sum::<f64>())
        .collect();
    (residual, k)
}
