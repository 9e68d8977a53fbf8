//! The figures of a capture: residual over time, against code and slope, and the histogram.

use super::spectrum::spectrum;
use super::view::{CELLS, Cell, Left, SLOPES, View};
use crate::capture::candidates::Effect;
use crate::report::axis::{Axis, Interval};
use crate::report::figure::{DOT, Figure, both};
use crate::report::svg::{Frame, Shape, Svg, Swatch};
use crate::report::text::significant;

/// Missing codes that are marked one by one.
const MARKED: usize = 300;
/// Rows of a cell below which its mean says nothing.
const FEW: f64 = 3.0;
/// Names of the channels.
pub(super) const NAMES: [&str; 2] = ["drive", "sense"];

const BEFORE: &str = "declared model alone";
const AFTER: &str = "with the causes";

/// In the order of the page.
pub fn all(view: &View) -> Vec<Figure> {
    both(|width| {
        let mut out = vec![
            over_time(view, width),
            spectrum(view, width),
            against_code(view, width),
            histogram(view, width),
        ];
        let steps = &view.closed.closure.steps;
        if steps.iter().any(|s| s.effect == Effect::Jitter.id()) {
            out.push(against_slope(view, width));
        }
        out
    })
}

/// What is drawn of a channel: class and what is left.
pub(super) fn series<'a>(view: &'a View, channel: usize) -> Vec<(&'static str, &'a Left)> {
    let after = ("after", &view.after[channel]);
    if view.has_steps() {
        vec![("before", &view.before[channel]), after]
    } else {
        vec![after]
    }
}

pub(super) fn legend(view: &View, swatch: Swatch) -> Vec<(&'static str, Swatch, String)> {
    let dots = swatch == DOT;
    let class = |name: &'static str, dotted: &'static str| if dots { dotted } else { name };
    let mut out = Vec::new();
    if view.has_steps() {
        out.push((class("before", "before dots"), swatch, BEFORE.to_owned()));
    }
    let words = if view.has_steps() { AFTER } else { BEFORE };
    out.push((class("after", "after dots"), swatch, words.to_owned()));
    out
}

pub(super) fn axis(interval: Interval, quantity: &str, unit: &str) -> Axis {
    Axis {
        interval,
        quantity: quantity.to_owned(),
        unit: unit.to_owned(),
    }
}

/// Frames one below the other over one horizontal axis, which only the last one labels.
pub(super) fn stacked(
    svg: &mut Svg,
    height: f64,
    x: &[Axis],
    y: &[Axis],
    mut draw: impl FnMut(usize, Frame) -> Frame,
) {
    let left = y.iter().map(Axis::room).fold(0.0, f64::max);
    for (k, (x, y)) in x.iter().zip(y).enumerate() {
        let frame = svg.frame(height, left, x.clone(), y.clone());
        let frame = draw(k, frame);
        svg.add(&frame);
    }
}

/// Residual over time, held-out stretches shaded: drive and sense, before and after.
fn over_time(view: &View, width: f64) -> Figure {
    let rows = view.closed.capture.rows() as f64;
    let (unit, per_row) = match view.closed.capture.meta.fs_hz {
        Some(fs) if rows / fs < 1.0 => ("ms", 1e3 / fs),
        Some(fs) => ("s", 1.0 / fs),
        None => ("rows", 1.0),
    };
    let parts: Vec<(usize, &'static str, &Left)> = (0..2)
        .flat_map(|c| {
            series(view, c)
                .into_iter()
                .map(move |(class, l)| (c, class, l))
        })
        .collect();
    let last = parts.len().saturating_sub(1);
    let x: Vec<Axis> = (0..parts.len())
        .map(|k| {
            let quantity = if k == last { "time" } else { "" };
            let ends = [0.0, rows * per_row];
            axis(Interval::of(ends).padded(0.01), quantity, unit)
        })
        .collect();
    let y: Vec<Axis> = parts
        .iter()
        .map(|(c, class, left)| {
            let values = left.over_time.iter().map(|p| p.1);
            let name = match view.has_steps() {
                true => format!("{} {class}", NAMES[*c]),
                false => NAMES[*c].to_owned(),
            };
            axis(Interval::of(values.chain([0.0])).padded(0.07), &name, "LSB")
        })
        .collect();
    let mut svg = Svg::new(width);
    let mut entries = legend(view, DOT);
    entries.push(("block", Swatch::Area, "held-out rows".to_owned()));
    svg.legend(entries);
    stacked(&mut svg, 156.0, &x, &y, |k, mut frame| {
        for (from, to) in view.held_out() {
            frame.span("block", from * per_row, to * per_row);
        }
        frame.level("zero", 0.0);
        if let Some((_, class, left)) = parts.get(k) {
            let points = left.over_time.iter().map(|p| (p.0 * per_row, p.1));
            frame.cloud(class, points);
        }
        frame
    });
    svg.figure("Residual over time",
        "Codes less the model. No estimate has seen the held-out rows. Where there are too many rows for a dot each, the \
         shade is how many lie there. Each frame has its own scale."
            .to_owned(),
    )
}

/// Means of cells at the middles of their places: (place, mean, its standard error).
fn means(cells: &[Cell], low: f64, high: f64) -> Vec<(f64, f64, f64)> {
    let width = (high - low) / cells.len().max(1) as f64;
    let filled = cells.iter().enumerate().filter(|c| c.1.rows >= FEW);
    filled
        .map(|(k, c)| {
            let mean = c.sum / c.rows;
            let variance = (c.squares / c.rows - mean * mean).max(0.0);
            (
                low + (k as f64 + 0.5) * width,
                mean,
                (variance / c.rows).sqrt(),
            )
        })
        .collect()
}

/// Mean residual against the code, with the bend that was fitted and the codes that are missing.
fn against_code(view: &View, width: f64) -> Figure {
    let findings = &view.closed.findings;
    let [_, model] = &findings.models;
    let of = |c: usize, left: &Left| means(&left.by_code, -view.reach[c], view.reach[c]);
    let curves = [0, 1].map(|c: usize| -> Vec<(f64, f64, f64)> {
        let curve = findings.bends[c].iter().flatten();
        let within = curve.filter(|p| p[0].abs() <= view.reach[c]);
        within
            .map(|[code, value, std]| (*code, *value, 2.0 * std))
            .collect()
    });
    let x: Vec<Axis> = (0..2)
        .map(|c: usize| {
            let ends = Interval::of([-view.reach[c], view.reach[c]]);
            axis(ends.padded(0.02), &format!("{} code", NAMES[c]), "LSB")
        })
        .collect();
    let y: Vec<Axis> = (0..2)
        .map(|c: usize| {
            let left = series(view, c).into_iter();
            let dots: Vec<f64> = left.flat_map(|(_, l)| of(c, l)).map(|p| p.1).collect();
            let around = curves[c].iter().flat_map(|p| [p.1 - p.2, p.1 + p.2]);
            let noise = of(c, &view.after[c])
                .into_iter()
                .flat_map(|p| [-2.0 * p.2, 2.0 * p.2]);
            let all = dots.into_iter().chain(around).chain(noise).chain([0.0]);
            axis(Interval::of(all).padded(0.1), "mean residual", "LSB")
        })
        .collect();
    let missing = |c: usize| &model.missing[c].codes;
    let has_bend = curves.iter().any(|c| !c.is_empty());
    let mut entries = legend(view, DOT);
    let words = "two standard errors of a mean".to_owned();
    entries.push(("outside", Swatch::Area, words));
    if has_bend {
        entries.push(("fixed", Swatch::Line, "fitted bend".to_owned()));
        let words = "two standard deviations of it".to_owned();
        entries.push(("sigma", Swatch::Area, words));
    }
    if (0..2).any(|c| !missing(c).is_empty()) {
        let words = "missing codes".to_owned();
        entries.push(("bound-mark", Swatch::Marker(Shape::Cross), words));
    }
    let mut svg = Svg::new(width);
    svg.legend(entries);
    stacked(&mut svg, 210.0, &x, &y, |c, mut frame| {
        let noise = of(c, &view.after[c]);
        let noise: Vec<_> = noise.iter().map(|p| (p.0, -2.0 * p.2, 2.0 * p.2)).collect();
        frame.band("outside", &noise);
        frame.level("zero", 0.0);
        let band: Vec<_> = curves[c]
            .iter()
            .map(|p| (p.0, p.1 - p.2, p.1 + p.2))
            .collect();
        frame.band("sigma", &band);
        for (class, left) in series(view, c) {
            let points: Vec<(f64, f64)> = of(c, left).iter().map(|p| (p.0, p.1)).collect();
            frame.markers(&format!("{class} dots"), Shape::Dot, 1.0, &points);
        }
        let line: Vec<(f64, f64)> = curves[c].iter().map(|p| (p.0, p.1)).collect();
        frame.line("fixed", &line);
        if let Some(y) = y.get(c).map(|y| y.interval) {
            let every = missing(c).len().div_ceil(MARKED).max(1);
            let at = y.low + 0.05 * (y.high - y.low);
            let codes = missing(c).iter().step_by(every);
            let points: Vec<_> = codes.map(|k| (f64::from(*k), at)).collect();
            frame.markers("bound-mark", Shape::Cross, 3.5, &points);
        }
        frame
    });
    let counts: Vec<String> = (0..2)
        .filter(|c| !missing(*c).is_empty())
        .map(|c| format!("{} in {}", missing(c).len(), NAMES[c]))
        .collect();
    let counted = match counts.is_empty() {
        true => String::new(),
        false => format!(" Missing codes: {}.", counts.join(", ")),
    };
    svg.figure("Residual against code",
        format!(
            "Mean of the residual in {CELLS} cells of the signal that the model puts in (not of the noisy code, which would bend the \
             mean by itself): the integral nonlinearity where it is the same at all phases. Where the capture does not declare the \
             tone's amplitude, the fitted amplitude takes up the straight part of a bend: the means show the bend without it. The \
             fitted bend's band counts all that was estimated with it.{counted}"
        ),
    )
}

/// Codes counted and expected.
fn histogram(view: &View, width: f64) -> Figure {
    let x: Vec<Axis> = (0..2)
        .map(|c: usize| {
            let h = &view.after[c].histogram;
            let ends = [h.middle(0), h.middle(h.counted.len())];
            axis(Interval::of(ends), &format!("{} code", NAMES[c]), "LSB")
        })
        .collect();
    let per_code = |values: &[f64], width: i64| -> Vec<f64> {
        values.iter().map(|v| v / width as f64).collect()
    };
    let y: Vec<Axis> = (0..2)
        .map(|c: usize| {
            let h = &view.after[c].histogram;
            let expected = series(view, c).into_iter().map(|(_, l)| &l.histogram);
            let expected = expected.flat_map(|h| per_code(&h.expected, h.width));
            let shown = per_code(&h.counted, h.width).into_iter().chain(expected);
            axis(
                Interval::of(shown.chain([0.0])).padded(0.06),
                "rows",
                "per code",
            )
        })
        .collect();
    let mut svg = Svg::new(width);
    let mut entries: Vec<(&str, Swatch, String)> = legend(view, Swatch::Line)
        .into_iter()
        .map(|(class, swatch, words)| (class, swatch, format!("expected, {words}")))
        .collect();
    entries.push(("fit dots", DOT, "counted".to_owned()));
    svg.legend(entries);
    stacked(&mut svg, 190.0, &x, &y, |c, mut frame| {
        for (class, left) in series(view, c) {
            let h = &left.histogram;
            let values = per_code(&h.expected, h.width);
            frame.line(class, &stairs(h, &values));
        }
        let h = &view.after[c].histogram;
        let counted = per_code(&h.counted, h.width);
        let points = counted.iter().enumerate().map(|(k, v)| (h.middle(k), *v));
        frame.markers(
            "fit dots many",
            Shape::Dot,
            1.0,
            &points.collect::<Vec<_>>(),
        );
        frame
    });
    let widths = view.after.each_ref().map(|l| l.histogram.width);
    svg.figure("Histogram of the codes",
        format!(
            "Rows per code, over {} (drive) and {} (sense) codes a bar. Expected is what the model's signal with its noise, limits \
             and missing codes makes of the same rows.",
            widths[0], widths[1]
        ),
    )
}

/// Bars as a line.
fn stairs(h: &super::histogram::Histogram, values: &[f64]) -> Vec<(f64, f64)> {
    let half = 0.5 * h.width as f64;
    let bars = values.iter().enumerate();
    bars.flat_map(|(k, v)| [(h.middle(k) - half, *v), (h.middle(k) + half, *v)])
        .collect()
}

/// Mean square of the residual against slope: jitter's parabola.
fn against_slope(view: &View, width: f64) -> Figure {
    let [_, model] = &view.closed.findings.models;
    let squares = |left: &Left| -> Vec<(f64, f64, f64)> {
        let width = left.steepest / SLOPES as f64;
        let filled = left.by_slope.iter().enumerate().filter(|c| c.1.rows >= FEW);
        filled
            .map(|(k, c)| {
                let square = c.squares / c.rows;
                let error = square * (2.0 / c.rows).sqrt();
                ((k as f64 + 0.5) * width, square, error)
            })
            .collect()
    };
    let curve =
        |c: usize, slope: f64| model.variance.base[c] + model.variance.jitter[c] * slope * slope;
    let x: Vec<Axis> = (0..2)
        .map(|c: usize| {
            let ends = Interval::of([0.0, view.after[c].steepest]);
            let name = format!("slope of {}", NAMES[c]);
            axis(ends.padded(0.02), &name, "LSB a sample")
        })
        .collect();
    let y: Vec<Axis> = (0..2)
        .map(|c: usize| {
            let all = squares(&view.after[c]);
            let all = all.iter().flat_map(|p| [p.1 - 2.0 * p.2, p.1 + 2.0 * p.2]);
            axis(
                Interval::of(all.chain([0.0])).padded(0.05),
                "mean square",
                "LSB²",
            )
        })
        .collect();
    let mut svg = Svg::new(width);
    svg.legend([
        ("after dots", DOT, "residual, squared".to_owned()),
        ("bar", Swatch::Line, "two standard errors".to_owned()),
        ("fixed", Swatch::Line, "fitted: noise and jitter".to_owned()),
        ("bound", Swatch::Line, "noise without jitter".to_owned()),
    ]);
    stacked(&mut svg, 190.0, &x, &y, |c, mut frame| {
        let points = squares(&view.after[c]);
        let bars = points
            .iter()
            .map(|(x, value, e)| (*x, value - 2.0 * e, value + 2.0 * e));
        frame.bars("bar", &bars.collect::<Vec<_>>());
        let steepest = view.after[c].steepest;
        let at = |k: usize| steepest * k as f64 / 60.0;
        let line: Vec<(f64, f64)> = (0..=60).map(|k| (at(k), curve(c, at(k)))).collect();
        frame.level("bound", curve(c, 0.0));
        frame.line("fixed", &line);
        let dots: Vec<(f64, f64)> = points.iter().map(|p| (p.0, p.1)).collect();
        frame.markers("after dots", Shape::Dot, 1.0, &dots);
        frame
    });
    let [drive, sense] = model.variance.jitter.map(f64::sqrt);
    let told = |samples: f64| match view.closed.capture.meta.fs_hz {
        Some(fs) => format!("{} s rms", significant(samples / fs, 3)),
        None => format!("{} samples rms", significant(samples, 3)),
    };
    let amount = match drive == sense {
        true => told(drive),
        false => format!("{} (drive) and {} (sense)", told(drive), told(sense)),
    };
    svg.figure("Noise against slope",
        format!(
            "An instant that is uncertain by {amount} makes noise in proportion to the slope, and none at the peaks."
        ),
    )
}
