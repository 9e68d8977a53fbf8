//! The figures of a closure: residuals over time and channels, what each step takes off, Allan
//! deviation.

use super::contribution::Contribution;
use super::curve;
use super::view::View;
use crate::report::axis::{Axis, Interval};
use crate::report::figure::{DOT, Figure, SMALL, both};
use crate::report::svg::{Frame, Svg, Swatch};
use crate::report::text::significant;
use crate::thermal::channels::range;

/// Most small figures.
const CHANNELS: usize = 24;
/// Points of a line and its band.
const DRAWN: usize = 600;
/// Said of figures with all readings.
const CROWDED: &str =
    "Where there are too many readings for a dot each, the shade is how many lie there.";

/// Residuals and steps, in the order of the page.
pub fn all(view: &View) -> Vec<Figure> {
    let mut out = both(|width| vec![over_time(view, width)]);
    out.extend(over_channels(view));
    let steps = || view.contributions.iter().enumerate();
    out.extend(both(|width| {
        steps()
            .filter_map(|(k, c)| step(view, k, c, width))
            .collect()
    }));
    out
}

/// The residuals that are shown: (name, class, values).
pub(super) fn series<'a>(view: &'a View) -> Vec<(&'static str, &'static str, &'a [f64])> {
    if view.has_steps() {
        vec![
            ("before", "before", &view.before[..]),
            ("after", "after", &view.after[..]),
        ]
    } else {
        vec![("residual", "after", &view.after[..])]
    }
}

fn legend(view: &View) -> Vec<(&'static str, Swatch, String)> {
    let words = |name: &str| match name {
        "before" => "polynomial alone".to_owned(),
        "after" => "with the causes".to_owned(),
        _ => "less the polynomial".to_owned(),
    };
    let shown = series(view).into_iter();
    shown
        .map(|(name, class, _)| (dots(class), DOT, words(name)))
        .collect()
}

fn dots(class: &str) -> &'static str {
    if class == "before" {
        "before dots"
    } else {
        "after dots"
    }
}

fn unlabelled(axis: &Axis) -> Axis {
    Axis {
        quantity: String::new(),
        ..axis.clone()
    }
}

/// Residual before and after against time, held-out blocks shaded.
fn over_time(view: &View, width: f64) -> Figure {
    let (time, unit, per) = view.time();
    let x = Axis {
        interval: Interval::of(time.iter().copied()).padded(0.01),
        quantity: "time".to_owned(),
        unit: unit.to_owned(),
    };
    let shown = series(view);
    let axes: Vec<Axis> = shown
        .iter()
        .map(|(name, _, values)| view.residual_axis(name, &[values]))
        .collect();
    let left = axes.iter().map(Axis::room).fold(0.0, f64::max);
    let floor = 2.0 * view.closed.closure.noise_floor_rms;
    let mut svg = Svg::new(width);
    let mut entries = legend(view);
    entries.push(("block", Swatch::Area, "held-out rows".to_owned()));
    let words = "two standard deviations of the noise floor".to_owned();
    entries.push(("sigma", Swatch::Area, words));
    svg.legend(entries);
    let last = shown.len().saturating_sub(1);
    for (k, ((_, class, values), y)) in shown.iter().zip(axes).enumerate() {
        let x = if k == last { x.clone() } else { unlabelled(&x) };
        let mut frame = svg.frame(210.0, left, x, y);
        for (from, to) in view.blocks() {
            frame.span("block", from / per, to / per);
        }
        frame.span_between("sigma", -floor, floor);
        frame.level("zero", 0.0);
        frame.cloud(class, pairs(&time, values));
        svg.add(&frame);
    }
    let title = if view.has_steps() {
        "Residual over time, before and after the causes are taken off"
    } else {
        "Residual over time"
    };
    let scales = if view.has_steps() {
        " Each frame has its own scale."
    } else {
        ""
    };
    svg.figure(
        title,
        format!(
            "Output less applied rate and less the model. The errors are of the held-out rows. The noise floor is the white \
             noise from differences of neighbouring rows. Triangles at an edge stand for readings beyond it.{scales} {CROWDED}"
        ),
    )
}

/// Rows with a value, as points.
fn pairs<'a>(x: &'a [f64], y: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + Clone + 'a {
    let rows = x.iter().copied().zip(y.iter().copied());
    rows.filter(|(x, y)| x.is_finite() && y.is_finite())
}

/// Residual before and after against every channel, one small plot each, a frame for each.
fn over_channels(view: &View) -> Option<Figure> {
    let (channels, still) = view.channels();
    if channels.is_empty() {
        return None;
    }
    let shown = series(view);
    let axes: Vec<Axis> = shown
        .iter()
        .map(|(name, _, values)| view.residual_axis(name, &[values]))
        .collect();
    let left = axes.iter().map(Axis::room).fold(0.0, f64::max);
    let last = shown.len().saturating_sub(1);
    let plot = |(name, readings): &(String, Vec<f64>)| {
        let x = view.channel_axis(name, readings);
        let mut svg = Svg::new(SMALL);
        svg.legend(legend(view));
        for (k, ((_, class, values), y)) in shown.iter().zip(&axes).enumerate() {
            let x = if k == last { x.clone() } else { unlabelled(&x) };
            let mut frame = svg.frame(130.0, left, x, y.clone());
            frame.level("zero", 0.0);
            frame.cloud(class, pairs(readings, values));
            svg.add(&frame);
        }
        svg.figure(format!("Residual against {name}"), "")
    };
    let mut caption = match view.has_steps() {
        true => "Before on one scale in all plots, after on another.".to_owned(),
        false => "One scale for all.".to_owned(),
    };
    if !still.is_empty() {
        caption += &format!(" Constant in this record: {}.", still.join(", "));
    }
    if let Some(more) = channels.get(CHANNELS..).filter(|m| !m.is_empty()) {
        let names: Vec<&str> = more.iter().map(|c| c.0.as_str()).collect();
        caption += &format!(" Not drawn: {}.", names.join(", "));
    }
    let plots = channels.iter().take(CHANNELS).map(plot).collect();
    Some(Figure::grid(
        "Residual against every channel",
        caption,
        plots,
    ))
}

/// One step over its own channel: the readings less the model and less all other steps, with what was fitted.
fn step(view: &View, k: usize, contribution: &Contribution, width: f64) -> Option<Figure> {
    let step = view.closed.closure.steps.get(k)?;
    let term = view.closed.after.terms.get(k)?;
    let abscissa = curve::abscissa(view, step, contribution);
    let (contribution, constant) = &without_constant(contribution);
    let value = &contribution.value_dps;
    let partial: Vec<f64> = view.after.iter().zip(value).map(|(r, v)| r + v).collect();
    let (low, high) = band_within(&partial, contribution);
    let y = view.residual_axis("this cause alone", &[&partial, value, &low, &high]);
    let shown = y.interval;
    let left = y.room();
    let mut svg = Svg::new(width);
    let words = "readings, less the polynomial and the other causes".to_owned();
    svg.legend([
        ("before dots", DOT, words),
        ("after", Swatch::Line, "fitted shape".to_owned()),
        (
            if abscissa.is_band { "sigma" } else { "bar" },
            Swatch::Area,
            "two standard deviations of it".to_owned(),
        ),
    ]);
    let mut frame = svg.frame(280.0, left, abscissa.axis.clone(), y);
    frame.level("zero", 0.0);
    frame.cloud("before", pairs(&abscissa.values, &partial));
    draw_contribution(&mut frame, &abscissa, contribution, shown);
    svg.add(&frame);
    let title = format!("Cause {}: {} over {}", k + 1, step.effect, abscissa.name);
    let equation = term.candidate.equation(&view.closed.channels, &term.point);
    let caption = format!(
        "{}: {}. The deviation counts coefficients and shape, estimated together with the polynomial and all other \
         causes: it is wide where those could take its place.{}{constant} {CROWDED}",
        step.effect, equation, abscissa.remark
    );
    Some(svg.figure(title, caption))
}

/// The contribution less its mean where it is far from 0 throughout, as a gain times a supply voltage is, and a sentence that
/// says so: the polynomial's constant takes the mean up.
fn without_constant(contribution: &Contribution) -> (Contribution, String) {
    let mut out = contribution.clone();
    let (least, greatest) = range(&out.value_dps);
    let mean = out.value_dps.iter().sum::<f64>() / out.value_dps.len().max(1) as f64;
    if mean.abs() <= greatest - least {
        return (out, String::new());
    }
    out.value_dps.iter_mut().for_each(|v| *v -= mean);
    let told = format!(
        " Its mean, {} deg/s, is taken off here.",
        significant(mean, 3)
    );
    (out, told)
}

/// The contribution as a line with its band; a bar for each row where the deviation is no curve.
fn draw_contribution(
    frame: &mut Frame,
    x: &curve::Abscissa,
    contribution: &Contribution,
    y: Interval,
) {
    let (value, std) = (&contribution.value_dps, &contribution.std_dps);
    let clip = |v: f64| v.clamp(y.low, y.high);
    let rows = sparse(&x.order);
    let band: Vec<(f64, f64, f64)> = rows
        .iter()
        .map(|i| {
            let wide = 2.0 * std.get(*i).copied().unwrap_or(0.0);
            (x.values[*i], clip(value[*i] - wide), clip(value[*i] + wide))
        })
        .collect();
    if x.is_band {
        frame.band("sigma", &band);
    } else {
        frame.bars("bar", &band);
    }
    let line: Vec<(f64, f64)> = rows.iter().map(|i| (x.values[*i], value[*i])).collect();
    frame.line("after", &line);
}

/// Both edges of the band, no farther off than the residual is wide: what the axis has to show.
fn band_within(partial: &[f64], contribution: &Contribution) -> (Vec<f64>, Vec<f64>) {
    let (least, greatest) = range(partial);
    let edge = |sign: f64| {
        let pairs = contribution.value_dps.iter().zip(&contribution.std_dps);
        pairs
            .map(|(v, s)| v + sign * (2.0 * s).min(0.5 * (greatest - least)))
            .collect()
    };
    (edge(-1.0), edge(1.0))
}

/// Every so many, with the last.
fn sparse(rows: &[usize]) -> Vec<usize> {
    let every = rows.len().div_ceil(DRAWN - 1).max(1);
    let mut out: Vec<usize> = rows.iter().copied().step_by(every).collect();
    if let Some(last) = rows.last().filter(|last| out.last() != Some(last)) {
        out.push(*last);
    }
    out
}
