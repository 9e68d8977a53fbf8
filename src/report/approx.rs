//! The page of `approx`: error over the input with its certified bound, and the forms that were not taken.

use super::axis::{Axis, Interval};
use super::figure::{Figure, both};
use super::narrow::rendered;
use super::svg::{Shape, Svg, Swatch};
use super::text::{bounding, grouped, minus, significant};
use crate::approx::minimax::Target;
use crate::error::Result;
use crate::tabulate::job::Approximation;
use crate::tabulate::outcome::{Alternative, Outcome};
use askama::Template;

/// Inputs at which the error is drawn, beside the one with the largest.
const DRAWN: i128 = 2000;

/// The page.
#[derive(Debug, Template)]
#[template(path = "report/approx.html")]
struct Page {
    name: String,
    headline: String,
    finding: String,
    holds: bool,
    figures: Vec<Figure>,
    /// What, in the function's unit, in LSB.
    errors: Vec<[String; 3]>,
    forms: Vec<Form>,
    facts: Vec<[String; 2]>,
    provenance: Vec<[String; 2]>,
}

/// A form in the table.
#[derive(Debug)]
struct Form {
    detail: String,
    /// ROM, multiplications, additions, cycles, certified error.
    numbers: [String; 5],
    chosen: bool,
    mark: &'static str,
}

/// The report as one HTML file.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub fn html(made: &Approximation) -> Result<String> {
    let o = &made.outcome;
    let lsb = made.settled.form.output().lsb();
    let sampled = sampled(made);
    let f = &o.formats;
    let mut facts = vec![
        ["form".to_owned(), o.detail.clone()],
        ["input".to_owned(), f.input.clone()],
        ["output".to_owned(), f.output.clone()],
        ["coefficients".to_owned(), f.coefficients.clone()],
    ];
    facts.extend(f.intermediate.clone().map(|i| ["each step".to_owned(), i]));
    facts.push(["memory".to_owned(), format!("{} bytes", o.cost.rom_bytes)]);
    facts.push([
        "work".to_owned(),
        format!(
            "{} multiplications, {} additions, about {} cycles",
            o.cost.multiplies, o.cost.adds, o.cost.cycles
        ),
    ]);
    let page = Page {
        name: format!("{} on {}", o.function, o.domain),
        headline: headline(o, lsb),
        finding: finding(o, lsb),
        holds: o.holds,
        figures: both(|width| {
            let mut out = vec![error(made, &sampled, width)];
            let listed = o.alternatives.as_deref().filter(|a| a.len() > 1);
            out.extend(listed.map(|a| front(o, a, width)));
            out
        }),
        errors: errors(o, lsb),
        forms: o.alternatives.iter().flatten().map(form).collect(),
        facts,
        provenance: [
            ("command", o.command.clone()),
            ("version", o.version.to_owned()),
            ("request's SHA-256", o.design_sha256.clone()),
        ]
        .map(|(name, value)| [name.to_owned(), value])
        .to_vec(),
    };
    rendered(&page)
}

fn headline(o: &Outcome, lsb: f64) -> String {
    let certified = o.error.certified_max_abs;
    let bound = match o.bound {
        Some(bound) if o.holds => format!(", within the bound of {}", significant(bound, 3)),
        Some(bound) => format!(", above the bound of {}", significant(bound, 3)),
        None => String::new(),
    };
    format!(
        "The error is at most {} ({} LSB of the output) at every input, proved{bound}: {} in {} bytes.",
        bounding(certified, 3),
        bounding(certified / lsb, 3),
        o.detail,
        grouped(o.cost.rom_bytes)
    )
}

fn finding(o: &Outcome, lsb: f64) -> String {
    let seen = o.error.exhaustive_max_abs.or(o.error.sampled_max_abs);
    let (all, what) = match o.exhaustive {
        true => ("all ", ""),
        false => ("", "of the "),
    };
    seen.map_or(String::new(), |seen| {
        format!(
            "Run bit for bit over {all}{} {what}input codes, the largest error is {} ({} LSB), at code {}.",
            grouped(o.inputs_checked),
            significant(seen, 3),
            significant(seen / lsb, 3),
            minus(&o.error.at_input_raw.to_string())
        )
    })
}

fn errors(o: &Outcome, lsb: f64) -> Vec<[String; 3]> {
    let e = &o.error;
    let line = |what: &str, v: f64| [what.to_owned(), bounding(v, 3), bounding(v / lsb, 3)];
    // A bound is rounded up, what was seen to the nearest, here as in the sentence above.
    let seen = |what: &str, v: f64| [what.to_owned(), significant(v, 3), significant(v / lsb, 3)];
    let mut out = vec![line(
        "certified: approximation, data, evaluation, output",
        e.certified_max_abs,
    )];
    out.extend(
        e.exhaustive_max_abs
            .map(|v| seen("observed over every input code", v)),
    );
    out.extend(
        e.sampled_max_abs
            .map(|v| seen("observed over the codes that were run", v)),
    );
    out.push(line(
        "of the data alone, evaluated exactly",
        e.coefficients_only_max_abs,
    ));
    out.push(line(
        "rounding of evaluation and output",
        e.rounding_max_abs,
    ));
    if let Some(search) = &o.search {
        out.push(line(
            "of the best real coefficients, evaluated exactly",
            search.minimax_error,
        ));
    }
    out
}

fn form(a: &Alternative) -> Form {
    Form {
        detail: a.detail.clone(),
        numbers: [
            grouped(a.cost.rom_bytes),
            a.cost.multiplies.to_string(),
            a.cost.adds.to_string(),
            a.cost.cycles.to_string(),
            bounding(a.certified_max_abs, 3),
        ],
        chosen: a.chosen,
        mark: match (a.chosen, a.undominated) {
            (true, _) => "chosen",
            (false, true) => "not beaten",
            (false, false) => "",
        },
    }
}

/// Input, error of the emitted words, both in their units: evenly spread, ends and the worst code among them.
fn sampled(made: &Approximation) -> Vec<(f64, f64)> {
    let codes = made.settled.form.codes();
    let span = codes.high - codes.low;
    let count = span.min(DRAWN);
    let mut raw: Vec<i128> = (0..=count)
        .map(|k| codes.low + span * k / count.max(1))
        .chain([made.outcome.error.at_input_raw])
        .collect();
    raw.sort_unstable();
    raw.dedup();
    let (input, output) = (codes.format.lsb(), made.settled.form.output().lsb());
    raw.into_iter()
        .map(|code| {
            let x = code as f64 * input;
            let y = made.settled.run(code) as f64 * output;
            (x, y - made.function.value(x))
        })
        .collect()
}

fn axis(interval: Interval, quantity: &str, unit: &str) -> Axis {
    Axis {
        interval,
        quantity: quantity.to_owned(),
        unit: unit.to_owned(),
    }
}

/// The function, and the error beside its certified bound.
fn error(made: &Approximation, sampled: &[(f64, f64)], width: f64) -> Figure {
    let o = &made.outcome;
    let lsb = made.settled.form.output().lsb();
    let of_function: Vec<(f64, f64)> = sampled
        .iter()
        .map(|p| (p.0, made.function.value(p.0)))
        .collect();
    let x = axis(
        Interval::of(sampled.iter().map(|p| p.0)).padded(0.01),
        "input",
        "x",
    );
    let unlabelled = Axis {
        quantity: String::new(),
        ..x.clone()
    };
    let y = axis(
        Interval::of(of_function.iter().map(|p| p.1)).padded(0.06),
        "function",
        "its unit",
    );
    let bound = o.error.certified_max_abs / lsb;
    let errors: Vec<(f64, f64)> = sampled.iter().map(|p| (p.0, p.1 / lsb)).collect();
    let ends = errors.iter().map(|p| p.1).chain([bound, -bound]);
    let below = axis(Interval::of(ends).padded(0.1), "error", "output LSB");
    let left = y.room().max(below.room());
    let mut svg = Svg::new(width);
    svg.legend(
        [
            ("fit", Swatch::Line, "function"),
            (
                "fixed dots",
                Swatch::Marker(Shape::Dot),
                "error of the emitted words",
            ),
            ("bound", Swatch::Line, "certified bound"),
            (
                "bound-mark",
                Swatch::Marker(Shape::Cross),
                "largest error that was met",
            ),
        ]
        .map(|(class, swatch, words)| (class, swatch, words.to_owned())),
    );
    let mut frame = svg.frame(120.0, left, unlabelled, y);
    frame.line("fit", &of_function);
    svg.add(&frame);
    let mut frame = svg.frame(280.0, left, x, below);
    frame.level("zero", 0.0);
    frame.cloud("fixed", errors.iter().copied());
    frame.level("bound", bound);
    frame.level("bound", -bound);
    let at = o.error.at_input_raw as f64 * made.settled.form.codes().format.lsb();
    let worst: Vec<(f64, f64)> = errors.iter().copied().filter(|p| p.0 == at).collect();
    frame.markers("bound-mark", Shape::Cross, 5.0, &worst);
    for place in worst {
        let said = format!(
            "input {}\nerror {} LSB",
            significant(place.0, 6),
            significant(place.1, 4)
        );
        frame.hint(9.0, place, &said);
    }
    svg.add(&frame);
    svg.figure(
        "Error over the input",
        format!(
            "Emitted words less the function at {} of the input codes, evenly spread, bit for bit. The bound is proved for every \
             real input; rounding the output alone may cost half an LSB.",
            sampled.len()
        ),
    )
}

/// Certified error of every form that keeps to the bound over its memory and over its cycles.
fn front(o: &Outcome, listed: &[Alternative], width: f64) -> Figure {
    let mut svg = Svg::new(width);
    svg.legend(
        [
            (
                "before dots",
                Swatch::Marker(Shape::Dot),
                "keeps to the bound, beaten",
            ),
            ("after dots", Swatch::Marker(Shape::Dot), "not beaten"),
            ("fixed", Swatch::Marker(Shape::Circle), "chosen"),
            ("bound", Swatch::Line, "bound"),
        ]
        .map(|(class, swatch, words)| (class, swatch, words.to_owned())),
    );
    let error = |a: &Alternative| a.certified_max_abs.max(f64::MIN_POSITIVE).log10();
    let bound = o.bound.map(f64::log10);
    let errors = listed.iter().map(error).chain(bound);
    let y = axis(
        Interval::of(errors).padded(0.08),
        "certified error",
        "the function's unit",
    );
    type Of = fn(&Alternative) -> f64;
    let costs: [(&str, &str, Of); 2] = [
        ("memory", "bytes", |a| {
            (a.cost.rom_bytes.max(1) as f64).log10()
        }),
        ("work", "cycles", |a| (a.cost.cycles.max(1) as f64).log10()),
    ];
    for (quantity, unit, of) in costs {
        let x = axis(
            Interval::of(listed.iter().map(of)).padded(0.06),
            quantity,
            unit,
        );
        let mut frame = svg
            .frame(220.0, 84.0, x.clone(), y.clone())
            .logarithmic(&x, &y);
        if let Some(bound) = bound {
            frame.level("bound", bound);
        }
        let places = |is_shown: &dyn Fn(&Alternative) -> bool| -> Vec<(f64, f64)> {
            let shown = listed.iter().filter(|a| is_shown(a));
            shown.map(|a| (of(a), error(a))).collect()
        };
        frame.markers("before dots", Shape::Dot, 1.0, &places(&|a| !a.undominated));
        frame.markers("after dots", Shape::Dot, 1.0, &places(&|a| a.undominated));
        frame.markers("fixed", Shape::Circle, 7.0, &places(&|a| a.chosen));
        for a in listed.iter().filter(|a| a.undominated || a.chosen) {
            let said = format!(
                "{}\n{} bytes, {} cycles, error {}",
                a.detail,
                a.cost.rom_bytes,
                a.cost.cycles,
                bounding(a.certified_max_abs, 3)
            );
            frame.hint(9.0, (of(a), error(a)), &said);
        }
        svg.add(&frame);
    }
    svg.figure(
        "Forms that keep to the bound",
        "Not beaten: no other form is at least as good in memory, multiplications, additions and error. Cycles are an estimate.",
    )
}
