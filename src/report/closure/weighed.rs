//! What was close and lost, and what to measure where something is left.

use crate::report::axis::{Axis, Interval};
use crate::report::figure::{Figure, one};
use crate::report::svg::{Svg, Swatch};
use crate::report::text::fixed;
use crate::thermal::checks::LOOP_EXPERIMENT;
use crate::verdict::{Closure, Evidence, Fate};
use std::collections::BTreeMap;

/// Candidates that are drawn, the best ones.
const DRAWN: usize = 12;

/// Gain in log-likelihood of the candidates that came nearest, before any step; `None` where none was scored.
pub fn figure(c: &Closure) -> Option<Figure> {
    let mut scored: Vec<(&Evidence, f64)> = c
        .evidence
        .iter()
        .filter_map(|e| Some((e, e.gain?)))
        .collect();
    scored.retain(|(_, gain)| gain.is_finite());
    // Stable: among equals the order is the search's own.
    scored.sort_by(|a, b| b.1.total_cmp(&a.1));
    scored.truncate(DRAWN);
    (!scored.is_empty()).then(|| one(|width| drawn(&scored, super::tables::base(c), width)))
}

fn drawn(scored: &[(&Evidence, f64)], base: &str, width: f64) -> Figure {
    let names: Vec<String> = scored.iter().map(|(e, _)| e.effect.clone()).collect();
    let ends = scored.iter().map(|s| s.1).chain([0.0]);
    let interval = Interval::of(ends);
    let mut svg = Svg::new(width);
    let x = Axis {
        // Room for what stands beside the bars.
        interval: Interval {
            low: interval.low,
            high: interval.high + 0.45 * (interval.high - interval.low),
        },
        quantity: "gain of log-likelihood, alone".to_owned(),
        unit: String::new(),
    };
    svg.legend([
        ("bar-of", Swatch::Area, "taken".to_owned()),
        ("bar-of second", Swatch::Area, "explains as much".to_owned()),
        ("bar-of third", Swatch::Area, "not taken".to_owned()),
    ]);
    let mut frame = svg.rows(26.0, &names, x);
    for (k, (e, gain)) in scored.iter().enumerate() {
        let middle = (scored.len() - k) as f64;
        let class = match e.fate {
            Fate::Taken => "bar-of",
            Fate::Confounded => "bar-of second",
            _ => "bar-of third",
        };
        let low = if svg.is_roomy() { 0.3 } else { 0.36 };
        let high = if svg.is_roomy() { 0.3 } else { -0.02 };
        frame.band(
            class,
            &[
                (0.0, middle - low, middle + high),
                (*gain, middle - low, middle + high),
            ],
        );
        let p = e.p_value.map_or("–".to_owned(), super::tables::probability);
        let at = if svg.is_roomy() {
            middle - 0.17
        } else {
            middle - 0.36
        };
        frame.note(
            "tick",
            (gain.max(0.0) + 0.012 * interval.high, at),
            "start",
            &format!("p {p}"),
        );
        let said = format!(
            "{}: gain {}, p {p}\n{}",
            e.effect,
            fixed(*gain, 1),
            e.remark
        );
        frame.hint(9.0, (*gain, middle - 0.5 * (low - high)), &said);
    }
    svg.add(&frame);
    svg.figure(
        "What was close, and what lost",
        format!(
            "Each candidate alone beside the {base}, before any cause is in. A larger gain means that the record is likelier \
             with the candidate, by a factor of e (2.7) for each 1 of it; p is the chance that the best of all candidates does \
             as well where there is nothing. The table says why one was not taken."
        ),
    )
}

/// What to measure next where structure is left: a sentence each. `has_others` is whether the record has a channel besides its
/// thermometer and time: else these were changed by themselves already.
pub fn measure_next(c: &Closure, has_others: bool) -> Vec<String> {
    if !c.residual_structure.left {
        return Vec::new();
    }
    let mut out = Vec::new();
    if let (Some(channel), true) = (&c.residual_structure.strongest_channel, has_others) {
        out.push(format!(
            "Repeat the run with {channel} changed by itself, all else held: what is left shows most there."
        ));
    }
    if c.loops_in().is_some() {
        out.push(format!("{LOOP_EXPERIMENT}."));
    }
    let mut missing: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for e in c.evidence.iter().filter(|e| e.fate == Fate::NoChannel) {
        if let Some(column) = e.remark.rsplit(' ').next() {
            missing.entry(column).or_default().push(&e.effect);
        }
    }
    for (column, effects) in missing {
        out.push(format!(
            "Log {column} with the record. It decides {}.",
            effects.join(", ")
        ));
    }
    for e in c.evidence.iter().filter(|e| e.fate == Fate::NotExcited) {
        out.push(format!(
            "For {}: {}.",
            e.effect,
            e.remark.trim_end_matches('.')
        ));
    }
    for step in &c.steps {
        if let Some(experiment) = &step.separating_experiment {
            let rivals = step.indistinguishable_from.join(", ");
            out.push(format!(
                "To tell {} from {rivals}: {experiment}.",
                step.effect
            ));
        }
    }
    out
}
