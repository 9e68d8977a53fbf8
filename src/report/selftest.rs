//! The page of a self-test.

use super::axis::{Axis, Interval};
use super::figure::{Figure, SMALL};
use super::narrow::rendered;
use super::svg::{Shape, Svg, Swatch};
use super::text::{percent, significant};
use crate::error::Result;
use crate::selftest::outcome::{EffectScore, Outcome};
use askama::Template;

/// The page.
#[derive(Debug, Template)]
#[template(path = "report/selftest.html")]
struct Page {
    headline: String,
    finding: String,
    holds: bool,
    failures: Vec<String>,
    sizes: Vec<String>,
    effects: Vec<Row>,
    figures: Vec<Figure>,
    /// Noise, records, alarms.
    clean: Vec<[String; 3]>,
    provenance: Vec<[String; 2]>,
}

/// An effect in the table.
#[derive(Debug)]
struct Row {
    effect: String,
    experiment: String,
    found: Vec<String>,
    wrong: String,
    least: String,
    own: String,
}

/// The report as one HTML file.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub fn html(o: &Outcome) -> Result<String> {
    let a = &o.false_alarms;
    let tested: Vec<&EffectScore> = o
        .effects
        .iter()
        .filter(|e| e.minimum_detectable.is_some())
        .collect();
    let page = Page {
        headline: headline(o),
        finding: format!(
            "{} of {} records without an effect got a name; with 95 % confidence the probability is below {} %. The noise \
             of a row is {} deg/s.",
            a.alarms,
            a.records,
            significant(100.0 * a.upper_limit_95, 2),
            significant(o.noise.white_rms_dps, 3)
        ),
        holds: o.holds,
        failures: o.failures.clone(),
        sizes: o
            .effects
            .first()
            .map(|e| {
                e.by_size
                    .iter()
                    .map(|s| format!("{}", s.times_noise))
                    .collect()
            })
            .unwrap_or_default(),
        effects: o.effects.iter().map(row).collect(),
        figures: tested.into_iter().map(figure).collect(),
        clean: a
            .by_noise
            .iter()
            .map(|c| [c.noise.clone(), c.records.to_string(), c.alarms.to_string()])
            .collect(),
        provenance: provenance(o),
    };
    rendered(&page)
}

fn headline(o: &Outcome) -> String {
    let tested = o.effects.iter().filter(|e| e.minimum_detectable.is_some());
    let within = |e: &&EffectScore| e.minimum_detectable.is_some_and(|m| m.relation != "above");
    let (all, found) = (tested.clone().count(), tested.filter(within).count());
    let wrong: usize = o
        .effects
        .iter()
        .flat_map(|e| &e.by_size)
        .map(|s| s.wrong)
        .sum();
    let planted: usize = o
        .effects
        .iter()
        .flat_map(|e| &e.by_size)
        .map(|s| s.records)
        .sum();
    format!(
        "{found} of {all} planted effects are found in nine records of ten from some size on that was tried; {wrong} of \
         {planted} records got a wrong name."
    )
}

fn row(e: &EffectScore) -> Row {
    let wrong: Vec<String> = e
        .wrong_names
        .iter()
        .map(|(name, count)| format!("{name} ({count})"))
        .collect();
    let (least, own) = match &e.minimum_detectable {
        Some(m) => {
            let sign = match m.relation {
                "below" => "< ",
                "above" => "> ",
                _ => "",
            };
            (
                format!("{sign}{}", significant(m.times_noise, 2)),
                format!("{sign}{} {}", significant(m.in_own_unit, 2), e.own_unit),
            )
        }
        None => ("–".to_owned(), e.remark.clone()),
    };
    Row {
        effect: e.effect.clone(),
        experiment: e.experiment.clone(),
        found: e
            .by_size
            .iter()
            .map(|s| match s.records {
                0 => "–".to_owned(),
                records => format!("{}/{records}", s.detected),
            })
            .collect(),
        wrong: wrong.join(", "),
        least,
        own,
    }
}

/// Share of records in which an effect is found, against its size.
fn figure(e: &EffectScore) -> Figure {
    let points: Vec<(f64, f64)> = e
        .by_size
        .iter()
        .filter(|s| s.records > 0)
        .map(|s| {
            (
                s.times_noise.log10(),
                100.0 * s.detected as f64 / s.records as f64,
            )
        })
        .collect();
    let x = Axis {
        interval: Interval::of(points.iter().map(|p| p.0)).padded(0.06),
        quantity: "size".to_owned(),
        unit: "noises of a row".to_owned(),
    };
    let y = Axis {
        interval: Interval {
            low: -5.0,
            high: 105.0,
        },
        quantity: "found".to_owned(),
        unit: "%".to_owned(),
    };
    let mut svg = Svg::new(SMALL);
    svg.legend([("after dots", Swatch::Marker(Shape::Dot), e.effect.clone())]);
    let mut frame = svg
        .frame(150.0, y.room(), x.clone(), y)
        .logarithmic_across(&x);
    frame.level("zero", 90.0);
    frame.line("after", &points);
    frame.markers("after dots", Shape::Dot, 3.0, &points);
    svg.add(&frame);
    let title = format!("{} against its size", e.effect);
    let least = e.minimum_detectable.map_or(String::new(), |m| {
        format!(
            "nine of ten are found {} {} noises of a row.",
            match m.relation {
                "at" => "from",
                other => other,
            },
            significant(m.times_noise, 2)
        )
    });
    svg.figure(title, format!("{}: {least}", e.experiment))
}

fn provenance(o: &Outcome) -> Vec<[String; 2]> {
    let mut out = vec![
        ("command", o.command.clone()),
        ("version", o.version.to_owned()),
        ("design's SHA-256", o.design_sha256.clone()),
        ("rows of a record", o.rows.to_string()),
    ];
    if let Some(record) = &o.record {
        out.push(("record", record.clone()));
        let steps = match o.own_steps.as_slice() {
            [] => "none".to_owned(),
            steps => steps.join(", "),
        };
        out.push(("its own causes, taken off before", steps));
    }
    let a = &o.false_alarms;
    out.push((
        "records without an effect that got a name",
        percent(a.alarms as f64, a.records.max(1) as f64),
    ));
    out.into_iter()
        .map(|(name, value)| [name.to_owned(), value])
        .collect()
}
