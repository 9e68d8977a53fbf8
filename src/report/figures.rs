//! The figures: rate output and residual against thermometer and time, fixed against float.

use super::Shown;
use super::axis::{Axis, Interval};
use super::figure::{Figure, both};
use super::scene::Scene;
use super::svg::{Frame, Shape, Svg, Swatch};
use super::text::significant;
use crate::job::outcome::Point;
use crate::text::away_from_zero;

/// All of them, in the order of the page.
pub fn all(shown: &Shown) -> Vec<Figure> {
    let scene = Scene::new(shown);
    both(|width| {
        vec![
            scene.uncompensated(width),
            scene.residual(width),
            scene.over_time(width),
            scene.fixed_minus_float(width),
        ]
    })
}

impl Scene<'_> {
    fn uncompensated(&self, width: f64) -> Figure {
        let fit = self.shown.fit;
        let (low, high) = (
            self.thermometer.interval.low,
            self.thermometer.interval.high,
        );
        let steps = (0..=160).map(|k| low + (high - low) * f64::from(k) / 160.0);
        let mut abscissae: Vec<f64> = steps.chain([fit.range.0, fit.range.1]).collect();
        abscissae.sort_by(f64::total_cmp);
        let curve: Vec<(f64, f64, f64)> = abscissae
            .into_iter()
            .map(|t| {
                let held = if self.shown.is_clamped() {
                    t.max(fit.range.0).min(fit.range.1)
                } else {
                    t
                };
                (t, fit.bias_dps(held), 2.0 * fit.std_dps(held))
            })
            .collect();
        let band: Vec<_> = curve.iter().map(|(t, b, s)| (*t, b - s, b + s)).collect();
        let ends = band.iter().flat_map(|b| [b.1, b.2]);
        let data = self.shown.points.iter().map(|p| p.before_dps);
        let y = rate_axis("rate output", Interval::of(data.chain(ends)).padded(0.05));
        let (rising, falling) = self.directions();
        let mut svg = Svg::new(width);
        let mut legend = vec![
            ("heating", Swatch::Marker(Shape::Up), rising.to_owned()),
            ("cooling", Swatch::Marker(Shape::Down), falling.to_owned()),
            (
                "fit",
                Swatch::Line,
                format!("fitted polynomial, order {}", fit.order),
            ),
            ("sigma", Swatch::Area, "± 2 sigma of the curve".to_owned()),
        ];
        legend.extend(self.outside_entry());
        svg.legend(legend);
        let mut frame = svg.frame(330.0, y.room(), self.thermometer.clone(), y);
        for (from, to) in self.outside() {
            frame.span("outside", from, to);
        }
        frame.band("sigma", &band);
        let line: Vec<_> = curve.iter().map(|(t, b, _)| (*t, *b)).collect();
        for (class, shape, heating) in [
            ("heating", Shape::Up, true),
            ("cooling", Shape::Down, false),
        ] {
            let chosen = self
                .shown
                .points
                .iter()
                .filter(move |p| p.heating == heating);
            let places = chosen.map(|p| (p.thermometer, p.before_dps));
            self.readings(&mut frame, class, shape, places);
        }
        frame.line("fit", &line);
        svg.add(&frame);
        let title = "Rate output without compensation against the thermometer";
        svg.figure(title, format!(
                "Applied rate subtracted{}. Sigma is the uncertainty of the fitted curve, {} deg/s where it is largest. It follows from \
                 the fit's residuals and from their correlation in time, so it counts what the curve cannot follow as \
                 well as noise. It is not the scatter of a single reading.{}",
                self.span_degc(),
                significant(fit.std_max_dps(), 3),
                self.crowded
            ))
    }

    fn residual(&self, width: f64) -> Figure {
        let heldout = self.shown.fit.heldout_rms_dps;
        let y = rate_axis("residual", self.residual_interval());
        let mut svg = Svg::new(width);
        let mut legend = self.paths_legend();
        legend.push(heldout_entry());
        legend.extend(self.outside_entry());
        svg.legend(legend);
        let mut frame = svg.frame(330.0, y.room(), self.thermometer.clone(), y);
        for (from, to) in self.outside() {
            frame.span("outside", from, to);
        }
        frame.span_between("heldout", -heldout, heldout);
        frame.level("zero", 0.0);
        self.paths(&mut frame, |p| p.thermometer, 1.0);
        svg.add(&frame);
        let title = "Residual after compensation against the thermometer";
        svg.figure(
            title,
            format!(
                "{} Band: held-out rms {} deg/s.{}",
                self.paths_sentence(),
                significant(heldout, 3),
                self.crowded
            ),
        )
    }

    fn over_time(&self, width: f64) -> Figure {
        let times = || self.shown.points.iter().map(|p| p.time_s);
        let span = Interval::of(times());
        let (unit, seconds) = time_unit(span.high - span.low);
        let interval = Interval::of(times().map(|t| t / seconds)).padded(0.02);
        let time = |quantity: &str| Axis {
            interval,
            quantity: quantity.to_owned(),
            unit: unit.to_owned(),
        };
        let before = rate_axis("before", self.interval(&[|p| p.before_dps], &[]));
        let after = rate_axis("residual", self.residual_interval());
        let left = before.room().max(after.room());
        let blocks = self.blocks();
        let mut svg = Svg::new(width);
        let mut legend = vec![("before", Swatch::Line, "not compensated".to_owned())];
        legend.extend(self.paths_legend());
        legend.push(heldout_entry());
        if !blocks.is_empty() {
            let text = "held-out blocks, every other one shaded".to_owned();
            legend.push(("block", Swatch::Area, text));
        }
        svg.legend(legend);
        let heldout = self.shown.fit.heldout_rms_dps;
        let shade = |frame: &mut Frame| {
            for (from, to) in blocks.iter().step_by(2) {
                frame.span("block", from / seconds, to / seconds);
            }
        };
        let mut upper = svg.frame(120.0, left, time(""), before);
        shade(&mut upper);
        let raw = self.shown.points.iter();
        let raw = raw.map(|p| (p.time_s / seconds, p.before_dps));
        if self.has_markers {
            let raw: Vec<_> = raw.collect();
            upper.line("before", &raw);
            upper.markers("before-dot", Shape::Circle, 0.4 * self.radius, &raw);
            // The points of the line once more.
            upper.drawn.pop();
        } else {
            upper.cloud("before", raw);
        }
        svg.add(&upper);
        let mut lower = svg.frame(270.0, left, time("time"), after);
        shade(&mut lower);
        lower.span_between("heldout", -heldout, heldout);
        lower.level("zero", 0.0);
        self.paths(&mut lower, |p| p.time_s, seconds);
        svg.add(&lower);
        let title = "Before and after compensation over time";
        svg.figure(title, format!(
                "Above without, below with compensation: mind the different scales, deg/s both.{}{}",
                if blocks.is_empty() {
                    String::new()
                } else {
                    format!(
                        " Each of the {} blocks was predicted from the others; the held-out rms ({} \
                         deg/s) is what that leaves.",
                        blocks.len(),
                        significant(heldout, 3)
                    )
                },
                self.crowded
            ))
    }

    fn fixed_minus_float(&self, width: f64) -> Figure {
        let lsb = self.shown.output_lsb;
        // As the legend says it.
        let bound = away_from_zero(self.shown.summary.budget.bound_dps / lsb, 3);
        let apart = |p: Point| (p.fixed_dps - p.float_dps) / lsb;
        let all = self.shown.points.iter().map(apart);
        let interval = Interval::of(all.chain([bound, -bound])).padded(0.1);
        let y = Axis {
            interval,
            quantity: "fixed − float".to_owned(),
            unit: "output LSB".to_owned(),
        };
        let mut svg = Svg::new(width);
        let mut legend = vec![
            (
                "fixed",
                Swatch::Marker(Shape::Circle),
                "fixed minus float, each reading".to_owned(),
            ),
            (
                "bound",
                Swatch::Line,
                format!(
                    "± bound of the compensation alone, {} LSB",
                    significant(bound, 3)
                ),
            ),
        ];
        legend.extend(self.outside_entry());
        svg.legend(legend);
        let mut frame = svg.frame(230.0, y.room(), self.thermometer.clone(), y);
        for (from, to) in self.outside() {
            frame.span("outside", from, to);
        }
        frame.level("zero", 0.0);
        frame.level("bound", bound);
        frame.level("bound", -bound);
        let all = self.shown.points.iter();
        let places = all.map(|p| (p.thermometer, apart(p)));
        self.readings(&mut frame, "fixed", Shape::Circle, places);
        svg.add(&frame);
        let title = "What fixed point costs: fixed minus float, in LSB of the output";
        svg.figure(
            title,
            format!("{}{}", self.bound_sentence(lsb, bound), self.crowded),
        )
    }

    /// Whether the readings stay within the bound, and what it is about.
    fn bound_sentence(&self, lsb: f64, bound: f64) -> String {
        let apart = |p: Point| ((p.fixed_dps - p.float_dps) / lsb).abs();
        let beyond = self
            .shown
            .points
            .iter()
            .filter(|p| apart(*p) > bound)
            .count();
        let largest = self.shown.points.iter().map(apart).fold(0.0, f64::max);
        let about = if self.shown.summary.record.is_some() {
            "The bound is for the compensation; rounding the record's rate to the firmware's input word \
             comes on top of it"
        } else {
            "The bound is for the compensation; here the float path is the whole circuit in double \
             precision, so rounding before the compensation shows too (each reading is a mean of rows)"
        };
        let verdict = match beyond {
            0 => "every reading lies within the bound".to_owned(),
            n => format!(
                "{} of {} readings lie beyond it",
                n,
                self.shown.points.len()
            ),
        };
        format!(
            "1 LSB of the output is {} deg/s. {about}: {verdict}, the largest distance is {} LSB.",
            significant(lsb, 4),
            significant(largest, 3)
        )
    }
}

/// The held-out band in a legend.
fn heldout_entry() -> (&'static str, Swatch, String) {
    let text = "± held-out rms of the fit".to_owned();
    ("heldout", Swatch::Area, text)
}

fn rate_axis(quantity: &str, interval: Interval) -> Axis {
    Axis {
        interval,
        quantity: quantity.to_owned(),
        unit: "deg/s".to_owned(),
    }
}

/// A unit that fits a span in s, and how many s it has.
fn time_unit(span: f64) -> (&'static str, f64) {
    match span {
        s if s < 300.0 => ("s", 1.0),
        s if s < 10_800.0 => ("min", 60.0),
        s if s < 345_600.0 => ("h", 3600.0),
        _ => ("d", 86_400.0),
    }
}
