//! The figures of a closure: residuals over time and channels, what each step takes off, Allan
//! deviation.

use super::contribution::Contribution;
use super::view::{DRAWN, View, scatter, thin};
use super::{allan, curve};
use crate::report::axis::{Axis, Interval};
use crate::report::figures::Figure;
use crate::report::svg::{Frame, Shape, Svg, Swatch};
use crate::report::text::significant;
use crate::thermal::channels::range;

/// Width of a figure, px.
const WIDTH: f64 = 960.0;
/// Width of one of many, px.
const SMALL: f64 = 470.0;
/// Most small figures.
const CHANNELS: usize = 24;

/// A dot of the legend.
const DOT: Swatch = Swatch::Marker(Shape::Dot);

/// Residuals and steps, in the order of the page.
pub fn all(view: &View) -> Vec<Figure> {
    let mut out = vec![over_time(view)];
    out.extend(over_channels(view));
    for (k, contribution) in view.contributions.iter().enumerate() {
        out.extend(step(view, k, contribution));
    }
    out
}

/// The residuals that are shown: (name, class, values).
fn series<'a>(view: &'a View) -> Vec<(&'static str, &'static str, &'a [f64])> {
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
        "before" => "declared model alone".to_owned(),
        "after" => "with the steps".to_owned(),
        _ => "less the declared model".to_owned(),
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
fn over_time(view: &View) -> Figure {
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
    let mut svg = Svg::new(WIDTH);
    let mut entries = legend(view);
    entries.push(("block", Swatch::Area, "held-out rows".to_owned()));
    let words = "two standard deviations of the noise floor".to_owned();
    entries.push(("sigma", Swatch::Area, words));
    svg.legend(&entries);
    let last = shown.len().saturating_sub(1);
    for (k, ((_, class, values), y)) in shown.iter().zip(axes).enumerate() {
        let height = y.interval;
        let x = if k == last { x.clone() } else { unlabelled(&x) };
        let mut frame = svg.frame(210.0, left, x, y);
        for (from, to) in view.blocks() {
            frame.span("block", from / per, to / per);
        }
        frame.span_between("sigma", -floor, floor);
        frame.level("zero", 0.0);
        let points: Vec<(f64, f64)> = thin(values)
            .iter()
            .map(|i| (time[*i], values[*i]))
            .collect();
        scatter(&mut frame, class, height, &points);
        svg.add(&frame);
    }
    let title = if view.has_steps() {
        "Residual over time, before and after the steps"
    } else {
        "Residual over time"
    };
    let scales = if view.has_steps() {
        " Each frame has its own scale."
    } else {
        ""
    };
    Figure {
        svg: svg.finish(title),
        title: title.to_owned(),
        caption: format!(
            "Output less applied rate and less the model. No estimate has seen the held-out rows. The noise floor is the white \
             noise from differences of neighbouring rows. Triangles at an edge stand for readings beyond it.{scales}{}",
            view.thinned()
        ),
    }
}

/// Residual against every channel, one small plot each.
fn over_channels(view: &View) -> Option<Figure> {
    let (channels, still) = view.channels();
    if channels.is_empty() {
        return None;
    }
    let shown = series(view);
    let values: Vec<&[f64]> = shown.iter().map(|s| s.2).collect();
    let y = view.residual_axis("residual", &values);
    let left = y.room();
    let mut body = String::from("<div class=\"multiples\">\n");
    for (name, readings) in channels.iter().take(CHANNELS) {
        let x = view.channel_axis(name, readings);
        let mut svg = Svg::new(SMALL);
        let mut frame = svg.frame(190.0, left, x, y.clone());
        frame.level("zero", 0.0);
        for (_, class, values) in &shown {
            let rows = thin(values);
            let points: Vec<(f64, f64)> = rows.iter().map(|i| (readings[*i], values[*i])).collect();
            scatter(&mut frame, class, y.interval, &points);
        }
        svg.add(&frame);
        body.push_str(&svg.finish(&format!("Residual against {name}")));
        body.push('\n');
    }
    body.push_str("</div>\n");
    let mut key = Svg::new(WIDTH);
    key.legend(&legend(view));
    let mut caption = "One scale for all.".to_owned();
    if !still.is_empty() {
        caption += &format!(" Constant in this record: {}.", still.join(", "));
    }
    if let Some(more) = channels.get(CHANNELS..).filter(|m| !m.is_empty()) {
        let names: Vec<&str> = more.iter().map(|c| c.0.as_str()).collect();
        caption += &format!(" Not drawn: {}.", names.join(", "));
    }
    caption += &view.thinned();
    let title = "Residual against every channel";
    Some(Figure {
        svg: key.finish(title) + "\n" + &body,
        title: title.to_owned(),
        caption,
    })
}

/// One step: its contribution over the partial residual.
fn step(view: &View, k: usize, contribution: &Contribution) -> Option<Figure> {
    let step = view.closed.closure.steps.get(k)?;
    let term = view.closed.after.terms.get(k)?;
    let abscissa = curve::abscissa(view, step, contribution);
    let value = &contribution.value_dps;
    let partial: Vec<f64> = view.after.iter().zip(value).map(|(r, v)| r + v).collect();
    let (low, high) = band_within(&partial, contribution);
    let y = view.residual_axis("partial residual", &[&partial, value, &low, &high]);
    let shown = y.interval;
    let left = y.room();
    let mut svg = Svg::new(WIDTH);
    svg.legend(&[
        (
            "before dots",
            DOT,
            "residual with this step put back".to_owned(),
        ),
        ("after", Swatch::Line, "fitted contribution".to_owned()),
        (
            "sigma",
            Swatch::Area,
            "two standard deviations of it".to_owned(),
        ),
    ]);
    let mut frame = svg.frame(280.0, left, abscissa.axis.clone(), y);
    frame.level("zero", 0.0);
    let points: Vec<(f64, f64)> = thin(&partial)
        .iter()
        .map(|i| (abscissa.values[*i], partial[*i]))
        .collect();
    scatter(&mut frame, "before", shown, &points);
    draw_contribution(&mut frame, &abscissa, contribution, shown);
    svg.add(&frame);
    let title = format!("Step {}: {} against {}", k + 1, step.effect, abscissa.name);
    let equation = term.candidate.equation();
    Some(Figure {
        svg: svg.finish(&title),
        title,
        caption: format!(
            "{}: {}. The deviation counts coefficients and shape, estimated together with the declared model and all other \
             steps: it is wide where those could take its place.{}",
            step.effect, equation, abscissa.remark
        ),
    })
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
        for (x, low, high) in &band {
            frame.line("bar", &[(*x, *low), (*x, *high)]);
        }
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

/// Allan deviation of the residuals, both axes logarithmic.
pub fn allan_deviation(view: &View) -> Figure {
    let c = &view.closed.channels;
    let period_s = c.period_s();
    let curves: Vec<(&str, Vec<(f64, f64)>)> = series(view)
        .into_iter()
        .map(|(_, class, values)| (class, allan::deviation(&c.time_s, values, period_s)))
        .collect();
    let floor = view.closed.closure.noise_floor_rms;
    let logs = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        let positive = points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0);
        positive.map(|p| (p.0.log10(), p.1.log10())).collect()
    };
    let taus = curves.first().map(|c| c.1.as_slice()).unwrap_or_default();
    let white: Vec<(f64, f64)> = taus
        .iter()
        .map(|p| (p.0, floor * (period_s / p.0).sqrt()))
        .collect();
    let drawn: Vec<(&str, Vec<(f64, f64)>)> = curves.iter().map(|c| (c.0, logs(&c.1))).collect();
    let all = || drawn.iter().flat_map(|d| d.1.iter());
    let axis = |interval: Interval, quantity: &str, unit: &str| Axis {
        interval: interval.padded(0.04),
        quantity: quantity.to_owned(),
        unit: unit.to_owned(),
    };
    let x = axis(Interval::of(all().map(|p| p.0)), "averaging time", "s");
    let unit = view.closed.closure.unit;
    let y = axis(
        Interval::of(all().chain(&logs(&white)).map(|p| p.1)),
        "Allan deviation",
        unit,
    );
    let mut svg = Svg::new(WIDTH);
    let words = |class: &str| match (class, view.has_steps()) {
        ("before", _) => "declared model alone",
        (_, true) => "with the steps",
        _ => "less the declared model",
    };
    let mut entries: Vec<(&str, Swatch, String)> = drawn
        .iter()
        .map(|d| (d.0, Swatch::Line, words(d.0).to_owned()))
        .collect();
    entries.push(("bound", Swatch::Line, "white noise of the floor".to_owned()));
    svg.legend(&entries);
    let left = y.room();
    let mut frame = svg
        .frame(280.0, left, x.clone(), y.clone())
        .logarithmic(&x, &y);
    frame.line("bound", &logs(&white));
    for (class, points) in &drawn {
        frame.line(class, points);
        frame.markers(class, Shape::Circle, 2.6, points);
    }
    svg.add(&frame);
    let title = "Allan deviation of the residual";
    Figure {
        svg: svg.finish(title),
        title: title.to_owned(),
        caption: format!(
            "Overlapping, over pieces without gaps; one row is {} s. White noise falls by the root of the averaging time, 1/f noise \
             is level, a walk or an effect that is left rises.",
            significant(period_s, 3)
        ),
    }
}
