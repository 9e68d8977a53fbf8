//! Two builds on the same records: McNemar's exact test for marks, the paired ratio for errors.

use crate::blind::tally::quantile;
use crate::plan::GROUPS;
use crate::sheet::Mark;
use std::fmt::Write;

/// Two-sided p-value of McNemar's exact test: `a` records changed one way, `b` the other, each way as likely.
fn mcnemar(a: usize, b: usize) -> f64 {
    let n = a + b;
    let log_choose =
        |k: usize| -> f64 { (0..k).map(|j| ((n - j) as f64 / (j + 1) as f64).ln()).sum() };
    let tail: f64 = (0..=a.min(b))
        .map(|k| (log_choose(k) - n as f64 * 2f64.ln()).exp())
        .sum();
    (2.0 * tail).min(1.0)
}

/// Geometric mean of the paired ratios, and its standard error as a factor's logarithm.
fn paired(ratios: &[f64]) -> Option<(f64, f64)> {
    let n = ratios.len() as f64;
    let logs: Vec<f64> = ratios.iter().map(|r| r.ln()).collect();
    let mean = logs.iter().sum::<f64>() / n;
    let variance = logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (ratios.len() > 2).then(|| (mean.exp(), (variance / n).sqrt()))
}

/// One line: records that only the one or only the other has right, and the ratio of errors (second over first).
fn line(title: &str, pairs: &[(&Mark, &Mark)]) -> String {
    let only = |f: &dyn Fn(&Mark) -> bool| {
        let first = pairs.iter().filter(|(a, b)| f(a) && !f(b)).count();
        let second = pairs.iter().filter(|(a, b)| !f(a) && f(b)).count();
        (first, second)
    };
    let names = only(&|m| m.right());
    let honest = only(&|m| m.honest != Some(false));
    let ratios: Vec<f64> = pairs
        .iter()
        .filter_map(|(a, b)| Some(b.over_oracle? / a.over_oracle?))
        .filter(|r| r.is_finite() && *r > 0.0)
        .collect();
    let error = paired(&ratios).map_or("-".to_owned(), |(mean, se)| {
        format!("{mean:.3} (se {:.1} %)", 100.0 * se)
    });
    let figure = |q| quantile(&ratios, q).map_or("-".to_owned(), |x| format!("{x:.3}"));
    format!(
        "| {title} | {} | {} | {} | {:.3} | {} | {} | {:.3} | {error} | {} | {} |",
        pairs.len(),
        names.0,
        names.1,
        mcnemar(names.0, names.1),
        honest.0,
        honest.1,
        mcnemar(honest.0, honest.1),
        figure(0.5),
        figure(0.9),
    )
}

/// Table of a comparison, and the records on which the two differ.
pub fn report(first: &[Mark], second: &[Mark]) -> Result<String, String> {
    let pairs: Vec<(&Mark, &Mark)> = first
        .iter()
        .filter_map(|a| Some((a, second.iter().find(|b| b.name == a.name)?)))
        .collect();
    if pairs.is_empty() {
        return Err("the two have no record in common".to_owned());
    }
    let mut text = String::from(
        "| group | records | names right: only first | only second | p | honest: only first | only second | p | error second/first, \
         mean | median | p90 |\n|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let mut add = |title: &str, keep: &dyn Fn(&Mark) -> bool| {
        let these: Vec<_> = pairs.iter().copied().filter(|(a, _)| keep(a)).collect();
        if !these.is_empty() {
            let _ = writeln!(text, "{}", line(title, &these));
        }
    };
    for group in GROUPS {
        add(group, &|m| m.group == group);
    }
    add("all", &|_| true);
    add("noise like a sensor's", &|m| m.name.ends_with("_sensor"));
    for (a, b) in pairs.iter().filter(|(a, b)| a.right() != b.right()) {
        let _ = writeln!(
            text,
            "{}: {} first {}{} second {}{}",
            a.name,
            a.planted.join("+"),
            a.answered.join("+"),
            if a.left { " (left)" } else { "" },
            b.answered.join("+"),
            if b.left { " (left)" } else { "" },
        );
    }
    Ok(text)
}
