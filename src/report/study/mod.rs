//! The page of `study`: front, budget, what each word does, sensitivity, all points at once.

mod figures;

use super::figure::{Figure, both, one};
use super::narrow::rendered;
use super::text::significant;
use crate::error::Result;
use crate::study::outcome::{Point, Quarter, Study};
use askama::Template;

/// The page.
#[derive(Debug, Template)]
#[template(path = "report/study.html")]
struct Page {
    headline: String,
    finding: String,
    chosen: Vec<[String; 2]>,
    required: Vec<[String; 5]>,
    targets: Vec<String>,
    points: Vec<Row>,
    fronts: Vec<Figure>,
    budget: Figure,
    budget_rows: Vec<[String; 9]>,
    words: Vec<Figure>,
    word_rows: Vec<[String; 5]>,
    tornados: Vec<Figure>,
    parallel: Figure,
    notes: Vec<String>,
    provenance: Vec<[String; 2]>,
}

/// A point in the table.
#[derive(Debug)]
struct Row {
    name: String,
    fronts: String,
    prices: Vec<String>,
    figures: Vec<String>,
    limited_by: String,
    shown: &'static str,
    file: String,
    changes: String,
}

/// The report as one HTML file.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub fn html(s: &Study) -> Result<String> {
    let targets: Vec<String> = s.reference.price.keys().cloned().collect();
    let all = std::iter::once(&s.reference);
    let all = all.chain(&s.front).chain(&s.nearest);
    let page = Page {
        headline: headline(s),
        finding: format!(
            "{} designs were considered and {} run bit for bit ({}); {} undominated points were run again with other noise \
             over {} temperatures, and their ranges proved. A merit of at most 1, by the estimates: {}. A point is shown to hold what is \
             asked if the whole of its bounds does; only such a point is chosen. Bounds in study.json hold at once for all {} \
             figures with {} % confidence ({}). {}",
            s.designs_considered,
            s.designs_simulated,
            s.method,
            s.front.len(),
            s.conditions.temperatures[1],
            s.limits_from,
            s.confidence.intervals,
            significant(100.0 * s.confidence.joint, 3),
            s.confidence.correction,
            none_a_quarter_less(&s.quarter_less).join(" ")
        ),
        chosen: s
            .chosen
            .iter()
            .map(|c| [c.target.clone(), answer(c.point, &c.reason)])
            .collect(),
        required: s.required.iter().map(required).collect(),
        points: all
            .map(|p| {
                let mut row = row(p, &targets);
                if s.chosen.iter().any(|c| c.nearest == Some(p.number)) {
                    row.name += " (! nearest)";
                }
                row
            })
            .collect(),
        fronts: both(|width| {
            targets
                .iter()
                .map(|t| figures::front(s, t, width))
                .collect()
        }),
        targets,
        budget: one(|width| figures::budget(s, width)),
        budget_rows: budget_rows(s),
        words: figures::words(s),
        word_rows: word_rows(s),
        tornados: both(|width| {
            let chosen = s.chosen.iter();
            chosen
                .filter_map(|c| figures::tornado(s, c, width))
                .collect()
        }),
        parallel: one(|width| figures::parallel(s, width)),
        notes: s.notes.clone(),
        provenance: vec![
            ["command".to_owned(), s.command.clone()],
            ["version".to_owned(), s.version.to_owned()],
            ["design's SHA-256".to_owned(), s.design_sha256.clone()],
            [
                "combinations of lengths".to_owned(),
                significant(s.space, 3),
            ],
            [
                "largest rate applied, deg/s".to_owned(),
                significant(s.conditions.full_rate_dps, 4),
            ],
            [
                "detuned oscillator, Hz".to_owned(),
                s.conditions
                    .detuned_hz
                    .map_or("–".to_owned(), |hz| significant(hz, 3)),
            ],
        ],
    };
    rendered(&page)
}

/// A sentence for each target on which no design costs a quarter less. Where one does, the chosen point says what it costs.
pub fn none_a_quarter_less(known: &[Quarter]) -> Vec<String> {
    let none = known.iter().filter(|q| q.proved_none);
    none
        .map(|q| {
            let target = &q.target;
            let less = significant(100.0 * (1.0 - q.share), 3);
            let words: Vec<&str> = q.words.iter().map(|w| w.name).collect();
            let best = match (q.best_merit, q.best_limited_by) {
                (Some(merit), Some(by)) => {
                    format!(", the best of which has a merit of {} by {by}", significant(merit, 3))
                }
                _ => String::new(),
            };
            let cheap = q
                .cheap_enough
                .map_or(String::new(), |n| format!(", {n} of them cheap enough{best}"));
            format!(
                "{target}: no design costs {less} % less with no figure of the data sheet more than one percent worse, in all {} combinations of {}{cheap}.",
                q.designs,
                words.join(", ")
            )
        })
        .collect()
}

fn answer(point: Option<usize>, reason: &str) -> String {
    match point {
        Some(point) => format!("point {point}: {reason}"),
        None => reason.to_owned(),
    }
}

fn headline(s: &Study) -> String {
    let said: Vec<String> = s
        .chosen
        .iter()
        .filter_map(|c| {
            let point = s.front.iter().find(|p| Some(p.number) == c.point)?;
            let part = point.price_of_given.get(&c.target)?;
            Some(format!(
                "{}: {} % of the given design's cost",
                c.target,
                significant(100.0 * part, 3)
            ))
        })
        .collect();
    if said.is_empty() {
        return "No design meets what is required.".to_owned();
    }
    format!(
        "The cheapest design that holds what is asked costs, on {}.",
        said.join(", on ")
    )
}

fn required(r: &crate::study::outcome::Required) -> [String; 5] {
    [
        r.name.to_owned(),
        significant(r.limit, 3),
        significant(r.best, 3),
        if r.can_be_met { "yes" } else { "no" }.to_owned(),
        r.limited_by.unwrap_or("–").to_owned(),
    ]
}

fn row(p: &Point, targets: &[String]) -> Row {
    let prices = targets.iter().map(|t| {
        let part = p.price_of_given.get(t).copied().unwrap_or(f64::NAN);
        significant(100.0 * part, 3)
    });
    let changes: Vec<String> = p
        .changes
        .iter()
        .map(|(k, v)| format!("{k} = {v}"))
        .collect();
    Row {
        name: name(p),
        fronts: p.targets.join(", "),
        prices: prices.collect(),
        figures: [
            p.bias_error_dps,
            p.drift_residual_dps,
            p.noise_dps_rthz,
            p.arw_deg_rth,
            p.scale_factor_ppm,
            p.spur_dps,
            p.merit,
        ]
        .map(|v| significant(v, 3))
        .to_vec(),
        limited_by: p.limited_by.to_owned(),
        shown: if p.shown { "yes" } else { "no" },
        file: p.design.clone().unwrap_or_default(),
        changes: changes.join("\n"),
    }
}

fn name(p: &Point) -> String {
    if p.number == 0 {
        "given".to_owned()
    } else {
        p.number.to_string()
    }
}

fn budget_rows(s: &Study) -> Vec<[String; 9]> {
    let shown = |v: Option<f64>| v.map_or("–".to_owned(), |v| significant(v, 3));
    let rows = s.budget.lines.iter().map(|l| {
        let on = l.alone_on;
        [
            l.name.to_owned(),
            l.length.to_string(),
            shown(l.predicted_rms_dps),
            shown(l.measured_rms_dps),
            shown(on.map(|f| f.bias_dps)),
            shown(on.map(|f| f.drift_dps)),
            shown(on.map(|f| f.noise_dps_rthz)),
            shown(l.alone_off.map(|f| f.noise_dps_rthz)),
            l.flags.join(", "),
        ]
    });
    rows.collect()
}

fn word_rows(s: &Study) -> Vec<[String; 5]> {
    let shown = |l: Option<u32>| l.map_or("–".to_owned(), |l| l.to_string());
    let pairs = s.sweeps.iter().zip(&s.parameters);
    pairs
        .map(|(sweep, p)| {
            [
                sweep.name.to_owned(),
                p.given.to_string(),
                format!("{} to {}", p.low, p.high),
                shown(sweep.first_that_hurts),
                shown(sweep.last_that_helps),
            ]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::outcome::WordLengths;

    #[test]
    fn a_quarter_less_is_told_where_it_is_proved_that_there_is_none() {
        let mut quarter = Quarter {
            target: "fpga".to_owned(),
            share: 0.75,
            point: Some(14),
            proved_none: false,
            words: Vec::new(),
            others: WordLengths::new(),
            designs: 12,
            cheap_enough: None,
            best_merit: None,
            best_limited_by: None,
        };
        // The sentence about the chosen point has the figure.
        assert!(none_a_quarter_less(std::slice::from_ref(&quarter)).is_empty());
        (quarter.point, quarter.proved_none) = (None, true);
        let told = none_a_quarter_less(&[quarter]).concat();
        assert!(
            told.starts_with("fpga: no design costs 25.0 % less "),
            "{told}"
        );
    }
}
