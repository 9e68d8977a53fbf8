//! The figures of a study's page.

use super::super::axis::{Axis, Interval};
use super::super::figure::{Figure, SMALL};
use super::super::svg::{Shape, Svg, Swatch};
use super::super::text::significant;
use super::name;
use crate::study::outcome::{Chosen, Point, Study};

/// What a logarithmic axis shows of a value at or below 0.
const LEAST: f64 = 1e-9;

fn log(value: f64) -> f64 {
    value.abs().max(LEAST).log10()
}

fn axis(values: impl IntoIterator<Item = f64>, quantity: &str, unit: &str) -> Axis {
    Axis {
        interval: Interval::of(values).padded(0.06),
        quantity: quantity.to_owned(),
        unit: unit.to_owned(),
    }
}

/// What pointing at a point says.
fn hint(p: &Point) -> String {
    let lengths = p.word_lengths.iter().map(|(k, v)| format!("{k} {v}"));
    format!(
        "point {}: merit {} by {}\nbias {} deg/s, drift {} deg/s, noise {} deg/s/√Hz\nscale factor {} ppm, spur {} deg/s\n{}",
        name(p),
        significant(p.merit, 3),
        p.limited_by,
        significant(p.bias_error_dps, 3),
        significant(p.drift_residual_dps, 3),
        significant(p.noise_dps_rthz, 3),
        significant(p.scale_factor_ppm, 3),
        significant(p.spur_dps, 3),
        lengths.collect::<Vec<_>>().join("\n")
    )
}

/// Cost against merit for a target.
pub(super) fn front(s: &Study, target: &str, width: f64) -> Figure {
    let at = |p: &Point| Some((log(p.merit), p.price.get(target).copied()?));
    let own: Vec<&Point> = s
        .front
        .iter()
        .filter(|p| p.targets.iter().any(|t| t == target))
        .collect();
    let points: Vec<(f64, f64)> = own.iter().filter_map(|p| at(p)).collect();
    let given = at(&s.reference);
    let all = || points.iter().chain(&given);
    let x = axis(
        all().map(|p| p.0),
        "merit: the largest figure",
        "of its limit",
    );
    let y = axis(all().map(|p| p.1), "cost", target);
    let mut svg = Svg::new(width);
    let room = y.room();
    let mut frame = svg.frame(320.0, room, x.clone(), y).logarithmic_across(&x);
    frame.line("after", &points);
    frame.markers("after dots", Shape::Dot, 4.0, &points);
    let chosen = s.chosen.iter().find(|c| c.target == target);
    let number = chosen.and_then(|c| c.point);
    let taken: Vec<(f64, f64)> = own
        .iter()
        .filter(|p| Some(p.number) == number)
        .filter_map(|p| at(p))
        .collect();
    frame.markers("fixed", Shape::Circle, 7.0, &taken);
    frame.markers(
        "c",
        Shape::Cross,
        6.0,
        &given.into_iter().collect::<Vec<_>>(),
    );
    for point in own.into_iter().chain([&s.reference]) {
        if let Some(place) = at(point) {
            frame.hint(9.0, place, &hint(point));
        }
    }
    svg.add(&frame);
    svg.legend([
        (
            "after dots",
            Swatch::Marker(Shape::Dot),
            "verified point".to_owned(),
        ),
        ("fixed", Swatch::Marker(Shape::Circle), "chosen".to_owned()),
        ("c", Swatch::Marker(Shape::Cross), "as given".to_owned()),
    ]);
    let caption = format!(
        "{} points; to the left finer, to the top dearer. Point at one for its words.",
        points.len()
    );
    svg.figure(format!("Front for {target}"), caption)
}

/// What each word adds alone, of the given and of the chosen design.
pub(super) fn budget(s: &Study, width: f64) -> Figure {
    let rms = |l: &crate::study::budget::Line| {
        let noise = l.alone_on.map(|f| f.noise_dps_rthz);
        noise.unwrap_or(LEAST)
    };
    let chosen = s.chosen_budgets.values().next();
    let count = s.budget.lines.len();
    let names: Vec<String> = s.budget.lines.iter().map(|l| l.name.to_owned()).collect();
    let values = s
        .budget
        .lines
        .iter()
        .chain(chosen.iter().flat_map(|b| &b.lines))
        .map(|l| log(rms(l)));
    let x = axis(values, "noise with this word alone on", "deg/s/√Hz");
    let mut svg = Svg::new(width);
    let left = x.interval.low;
    let mut frame = svg.rows(26.0, &names, x.clone()).logarithmic_across(&x);
    let mut bars = |class: &str, lines: &[crate::study::budget::Line], above: f64| {
        for (k, line) in lines.iter().enumerate() {
            let middle = (count - k) as f64 + above;
            let end = log(rms(line));
            frame.band(
                class,
                &[
                    (left, middle - 0.17, middle + 0.17),
                    (end, middle - 0.17, middle + 0.17),
                ],
            );
            let said = format!("{}: {} deg/s/√Hz", line.name, significant(rms(line), 3));
            frame.hint(7.0, (end, middle), &said);
        }
    };
    bars("bar-of", &s.budget.lines, 0.19);
    if let Some(chosen) = chosen {
        bars("bar-of second", &chosen.lines, -0.19);
    }
    svg.add(&frame);
    let mut legend = vec![("bar-of", Swatch::Area, "as given".to_owned())];
    if let Some(target) = s.chosen_budgets.keys().next() {
        legend.push((
            "bar-of second",
            Swatch::Area,
            format!("chosen for {target}"),
        ));
    }
    svg.legend(legend);
    let caption =
        "Each word as it is, every other one made fine. What no word resolves is the left end.";
    svg.figure("Error budget".to_owned(), caption.to_owned())
}

/// Merit and noise against the length of each word.
pub(super) fn words(s: &Study) -> Vec<Figure> {
    let of = |sweep: &crate::study::outcome::Sweep| {
        let merits: Vec<(f64, f64)> = sweep
            .curve
            .iter()
            .filter_map(|p| Some((f64::from(p.length), log(p.merit?))))
            .collect();
        // Of white rounding: a bit less doubles the word's own share. Drawn from the budget's line.
        let given = s
            .parameters
            .iter()
            .find(|p| p.name == sweep.name)
            .map_or(0, |p| p.given);
        let line = s.budget.lines.iter().find(|l| l.name == sweep.name);
        let noise = s.limits.noise_dps_rthz;
        let share = line.and_then(|l| Some(l.alone_on?.noise_dps_rthz / noise?));
        let rest = s.budget.total.noise_dps_rthz;
        let predicted: Vec<(f64, f64)> = share
            .into_iter()
            .flat_map(|share| {
                let limit = noise.unwrap_or(1.0);
                sweep.curve.iter().map(move |p| {
                    let bits = f64::from(given) - f64::from(p.length);
                    let own = share * 2f64.powf(bits);
                    let others = (rest / limit).powi(2) - share * share;
                    (
                        f64::from(p.length),
                        log((own * own + others.max(0.0)).sqrt()),
                    )
                })
            })
            .collect();
        let both = || merits.iter().chain(&predicted);
        let x = axis(
            both().map(|p| p.0),
            sweep.name.rsplit('.').next().unwrap_or(""),
            "",
        );
        let x = Axis {
            unit: s
                .parameters
                .iter()
                .find(|p| p.name == sweep.name)
                .map_or("bits", |p| p.unit)
                .to_owned(),
            ..x
        };
        let y = axis(both().map(|p| p.1.clamp(-4.0, 5.0)), "merit", "1");
        let mut svg = Svg::new(SMALL);
        let mut frame = svg.frame(150.0, 74.0, x, y.clone()).logarithmic_up(&y);
        frame.level("zero", 0.0);
        frame.line("float", &predicted);
        frame.line("after", &merits);
        frame.markers("after dots", Shape::Dot, 3.0, &merits);
        let here: Vec<(f64, f64)> = merits
            .iter()
            .copied()
            .filter(|p| p.0 == f64::from(given))
            .collect();
        frame.markers("c", Shape::Cross, 5.0, &here);
        svg.add(&frame);
        let shown = |l: Option<u32>| l.map_or("none".to_owned(), |l| l.to_string());
        let caption = format!(
            "{}: first that hurts {}, last that helps {}.",
            sweep.name,
            shown(sweep.first_that_hurts),
            shown(sweep.last_that_helps)
        );
        svg.figure(format!("Merit against {}", sweep.name), caption)
    };
    s.sweeps.iter().map(of).collect()
}

/// What a bit less and a bit more of each word does at the chosen point.
pub(super) fn tornado(s: &Study, chosen: &Chosen, width: f64) -> Option<Figure> {
    let point = s.front.iter().find(|p| Some(p.number) == chosen.point)?;
    let mut names: Vec<&'static str> = chosen.sensitivity.iter().map(|s| s.name).collect();
    names.dedup();
    let ratio = |name: &str, by: i32| {
        let mut steps = chosen.sensitivity.iter();
        let step = steps.find(|s| s.name == name && s.by == by)?;
        Some(log(step.merit? / point.merit.max(LEAST)))
    };
    let reach = |name: &str| {
        [-1, 1]
            .iter()
            .filter_map(|b| ratio(name, *b))
            .fold(0.0, |a: f64, r| a.max(r.abs()))
    };
    names.sort_by(|a, b| reach(b).total_cmp(&reach(a)).then_with(|| a.cmp(b)));
    let count = names.len();
    let ends = names
        .iter()
        .flat_map(|n| [ratio(n, -1), ratio(n, 1)])
        .flatten();
    let x = axis(
        ends.chain([-0.05, 0.05]),
        "merit in parts of the chosen point's",
        "1",
    );
    let labels: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
    let mut svg = Svg::new(width);
    let mut frame = svg.rows(24.0, &labels, x.clone()).logarithmic_across(&x);
    for (k, name) in names.iter().enumerate() {
        let middle = (count - k) as f64;
        for (class, by) in [("bar-of second", -1), ("bar-of", 1)] {
            let Some(end) = ratio(name, by) else { continue };
            let offset = 0.17 * f64::from(by);
            let (low, high) = (middle + offset - 0.16, middle + offset + 0.16);
            frame.band(class, &[(0.0, low, high), (end, low, high)]);
            let price = chosen
                .sensitivity
                .iter()
                .find(|s| s.name == *name && s.by == by)
                .and_then(|s| s.price.get(&chosen.target));
            let price = price.map_or("–".to_owned(), |p| significant(*p, 4));
            let said = format!(
                "{name} {by:+}: merit × {}, cost {price}",
                significant(10f64.powf(end), 3)
            );
            frame.hint(7.0, (end, middle + offset), &said);
        }
    }
    svg.add(&frame);
    svg.legend([
        ("bar-of second", Swatch::Area, "one less".to_owned()),
        ("bar-of", Swatch::Area, "one more".to_owned()),
    ]);
    let title = format!(
        "Sensitivity of point {}, chosen for {}",
        point.number, chosen.target
    );
    Some(svg.figure(
        title,
        "Words whose step there is no design for have no bar.".to_owned(),
    ))
}

/// Every point as a line across its words, less the given lengths, and its merit.
pub(super) fn parallel(s: &Study, width: f64) -> Figure {
    let count = s.parameters.len();
    let lines: Vec<(Vec<(f64, f64)>, &Point)> = s
        .front
        .iter()
        .map(|p| {
            let of = |(k, w): (usize, &crate::study::outcome::Parameter)| {
                let length = p.word_lengths.get(w.name).copied().unwrap_or(w.given);
                (f64::from(length) - f64::from(w.given), (count - k) as f64)
            };
            (s.parameters.iter().enumerate().map(of).collect(), p)
        })
        .collect();
    let names: Vec<String> = s
        .parameters
        .iter()
        .map(|w| format!("{} ({})", w.name, w.given))
        .collect();
    let x = axis(
        lines
            .iter()
            .flat_map(|(l, _)| l.iter().map(|p| p.0))
            .chain([0.0]),
        "length less the given one",
        "bits",
    );
    let mut svg = Svg::new(width);
    let mut frame = svg.rows(30.0, &names, x);
    for (line, point) in &lines {
        let chosen = s.chosen.iter().any(|c| c.point == Some(point.number));
        let class = if chosen {
            "after"
        } else if point.merit > 1.0 {
            "dim"
        } else {
            "thin"
        };
        frame.line(class, line);
    }
    // One for a line: who goes through the page by the keyboard has not to pass each of its places.
    for (line, point) in &lines {
        if let Some(place) = line.last() {
            frame.hint(5.0, *place, &hint(point));
        }
    }
    svg.add(&frame);
    svg.legend([
        ("after", Swatch::Line, "chosen".to_owned()),
        ("thin", Swatch::Line, "merit of at most 1".to_owned()),
        ("dim", Swatch::Line, "others".to_owned()),
    ]);
    svg.figure(
        "All points at once".to_owned(),
        "A point is a line from word to word; the number in brackets is the given length."
            .to_owned(),
    )
}
