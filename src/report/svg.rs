//! A small writer of plots as SVG text: frames with ticks, lines, bands, spans, markers, a legend.
//!
//! Colours are left to the page's style sheet: every mark carries a class. Coordinates have two
//! decimals, so the same plot gives the same bytes. Values that are no number are left out: a line
//! breaks there, a marker is missing.

use super::axis::{Axis, CHARACTER, Interval, Ticks, decades, ticks};
use super::text::escape;
use std::fmt::Write as _;

/// Width of a letter of the legend, px, on average.
const LETTER: f64 = 6.9;
/// Height of a row of the legend, px.
const LEGEND_ROW: f64 = 22.0;

/// What a marker looks like; told apart without colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A circle.
    Circle,
    /// A triangle that points up.
    Up,
    /// A triangle that points down.
    Down,
    /// `+`.
    Plus,
    /// `x`.
    Cross,
    /// A dot as large as the style sheet makes the pen: for many points.
    Dot,
}

impl Shape {
    /// Path commands for one marker of radius `r`.
    fn path(self, x: f64, y: f64, r: f64) -> String {
        let a = number(0.87 * r);
        let d = number(2.0 * r);
        let at = |dx: f64, dy: f64| format!("M{} {}", number(x + dx), number(y + dy));
        match self {
            Shape::Circle => {
                let r1 = number(r);
                format!(
                    "{}a{r1} {r1} 0 1 0 {d} 0a{r1} {r1} 0 1 0 -{d} 0z",
                    at(-r, 0.0)
                )
            }
            Shape::Up => format!(
                "{}l{a} {}h-{}z",
                at(0.0, -r),
                number(1.5 * r),
                number(1.74 * r)
            ),
            Shape::Down => format!(
                "{}l{a} -{}h-{}z",
                at(0.0, r),
                number(1.5 * r),
                number(1.74 * r)
            ),
            Shape::Dot => format!("{}h0", at(0.0, 0.0)),
            Shape::Plus => format!("{}v{d}{}h{d}", at(0.0, -r), at(-r, 0.0)),
            Shape::Cross => {
                let full = number(1.5 * r);
                let (low, high) = (at(-0.75 * r, -0.75 * r), at(-0.75 * r, 0.75 * r));
                format!("{low}l{full} {full}{high}l{full} -{full}")
            }
        }
    }
}

/// How a series is shown in the legend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Swatch {
    /// A line.
    Line,
    /// An area.
    Area,
    /// A marker.
    Marker(Shape),
}

/// A plot under construction.
#[derive(Debug)]
pub struct Svg {
    width: f64,
    height: f64,
    body: String,
}

impl Svg {
    /// An empty plot; it grows as frames are added.
    pub fn new(width: f64) -> Self {
        Svg {
            width,
            height: 0.0,
            body: String::new(),
        }
    }

    /// A legend below what is there: (class, swatch, text), in rows as long as the plot is wide.
    pub fn legend(&mut self, entries: &[(&str, Swatch, String)]) {
        let (mut x, mut y) = (12.0, self.height + LEGEND_ROW / 2.0);
        for (class, swatch, label) in entries {
            let width = 52.0 + LETTER * label.chars().count() as f64;
            if x > 12.0 && x + width > self.width {
                (x, y) = (12.0, y + LEGEND_ROW);
            }
            let middle = x + 12.0;
            let mark = match swatch {
                Swatch::Line => path(class, &format!("M{} {}h24", number(x), number(y))),
                Swatch::Area => path(
                    class,
                    &format!("M{} {}h24v12h-24z", number(x), number(y - 6.0)),
                ),
                Swatch::Marker(shape) => path(class, &shape.path(middle, y, 5.0)),
            };
            self.body.push_str(&mark);
            self.text("legend", (x + 30.0, y + 4.5), "start", label);
            x += width;
        }
        self.height = y + LEGEND_ROW / 2.0 + 4.0;
    }

    /// Puts a frame below what is there.
    pub fn add(&mut self, frame: &Frame) {
        self.body.push_str(&frame.svg());
        self.height = frame.top + frame.height + if frame.x_label.is_empty() { 14.0 } else { 48.0 };
    }

    /// A frame of this height for these axes; `left` is for the labels of the vertical axis.
    pub fn frame(&self, height: f64, left: f64, x: Axis, y: Axis) -> Frame {
        let top = self.height + 8.0;
        let width = self.width - left - 16.0;
        let longest = ticks(x.interval, 8)
            .labels
            .iter()
            .map(|l| l.chars().count())
            .max();
        let room = CHARACTER * (longest.unwrap_or(1) as f64 + 3.0);
        let x_ticks = ticks(x.interval, ((width / room) as usize).clamp(2, 10));
        let y_ticks = ticks(y.interval, ((height / 38.0) as usize).clamp(2, 8));
        Frame {
            left,
            top,
            width,
            height,
            x_label: x.labelled(x_ticks.exponent),
            y_label: y.labelled(y_ticks.exponent),
            x: x.interval,
            y: y.interval,
            x_ticks,
            y_ticks,
            marks: String::new(),
        }
    }

    fn text(&mut self, class: &str, (x, y): (f64, f64), anchor: &str, content: &str) {
        self.body.push_str(&text(class, (x, y), anchor, content));
    }

    /// The whole element; `title` is for those who cannot see it.
    pub fn finish(self, title: &str) -> String {
        let title = escape(title);
        let (w, h) = (number(self.width), number(self.height));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
             aria-label=\"{title}\">\n{}</svg>",
            self.body
        )
    }
}

/// Two axes and what is drawn between them, in the order of the calls.
#[derive(Debug)]
pub struct Frame {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    x: Interval,
    y: Interval,
    x_ticks: Ticks,
    y_ticks: Ticks,
    x_label: String,
    y_label: String,
    marks: String,
}

impl Frame {
    /// Both axes logarithmic: their intervals, and what is drawn, are powers of ten.
    pub fn logarithmic(mut self, x: &Axis, y: &Axis) -> Self {
        (self.x_ticks, self.y_ticks) = (decades(self.x), decades(self.y));
        (self.x_label, self.y_label) = (x.labelled(0), y.labelled(0));
        self
    }

    /// The horizontal axis logarithmic: its interval, and the abscissae of what is drawn, are powers of ten.
    pub fn logarithmic_across(mut self, x: &Axis) -> Self {
        (self.x_ticks, self.x_label) = (decades(self.x), x.labelled(0));
        self
    }

    fn px(&self, x: f64) -> f64 {
        self.left + self.width * (x - self.x.low) / (self.x.high - self.x.low)
    }

    fn py(&self, y: f64) -> f64 {
        self.top + self.height * (self.y.high - y) / (self.y.high - self.y.low)
    }

    /// The point on the page; none for what is no number or far away.
    fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        let at = (self.px(x), self.py(y));
        (at.0.is_finite() && at.1.is_finite() && at.0.abs().max(at.1.abs()) < 1e5).then_some(at)
    }

    /// A line; it breaks where a point is no number.
    pub fn line(&mut self, class: &str, points: &[(f64, f64)]) {
        let mut d = String::new();
        let mut pen = "M";
        for point in points {
            pen = match self.place(*point) {
                Some((x, y)) => {
                    // Writing to a string cannot fail.
                    let _ = write!(d, "{pen}{} {}", number(x), number(y));
                    "L"
                }
                None => "M",
            };
        }
        self.marks.push_str(&path(class, &d));
    }

    /// A level across the frame.
    pub fn level(&mut self, class: &str, y: f64) {
        self.line(class, &[(self.x.low, y), (self.x.high, y)]);
    }

    /// The area between two curves over the same abscissae: (x, lower, upper).
    pub fn band(&mut self, class: &str, points: &[(f64, f64, f64)]) {
        let lower = points.iter().map(|p| self.place((p.0, p.1)));
        let upper = points.iter().rev().map(|p| self.place((p.0, p.2)));
        let outline: Vec<String> = lower
            .chain(upper)
            .flatten()
            .map(|(x, y)| format!("{} {}", number(x), number(y)))
            .collect();
        if !outline.is_empty() {
            self.marks
                .push_str(&path(class, &format!("M{}z", outline.join("L"))));
        }
    }

    /// A shaded stretch of the horizontal axis, limited to the frame.
    pub fn span(&mut self, class: &str, from: f64, to: f64) {
        let (from, to) = (from.max(self.x.low), to.min(self.x.high));
        if from < to {
            self.band(
                class,
                &[
                    (from, self.y.low, self.y.high),
                    (to, self.y.low, self.y.high),
                ],
            );
        }
    }

    /// A shaded stretch of the vertical axis, limited to the frame.
    pub fn span_between(&mut self, class: &str, from: f64, to: f64) {
        let (from, to) = (from.max(self.y.low), to.min(self.y.high));
        if from < to {
            self.band(class, &[(self.x.low, from, to), (self.x.high, from, to)]);
        }
    }

    /// Markers of radius `r`.
    pub fn markers(&mut self, class: &str, shape: Shape, r: f64, points: &[(f64, f64)]) {
        let places = points.iter().filter_map(|p| self.place(*p));
        let d: String = places.map(|(x, y)| shape.path(x, y, r)).collect();
        self.marks.push_str(&path(class, &d));
    }

    /// An invisible circle that says something to who points at it.
    pub fn hint(&mut self, r: f64, point: (f64, f64), content: &str) {
        if let Some((x, y)) = self.place(point) {
            let _ = writeln!(
                self.marks,
                "<circle class=\"hint\" cx=\"{}\" cy=\"{}\" r=\"{}\"><title>{}</title></circle>",
                number(x),
                number(y),
                number(r),
                escape(content)
            );
        }
    }

    /// Labels in place of numbers on the vertical axis, at these ordinates.
    pub fn named(mut self, names: &[(f64, String)]) -> Self {
        self.y_ticks.values = names.iter().map(|n| n.0).collect();
        self.y_ticks.labels = names.iter().map(|n| n.1.clone()).collect();
        self
    }

    /// The vertical axis logarithmic: its interval, and the ordinates of what is drawn, are powers of ten.
    pub fn logarithmic_up(mut self, y: &Axis) -> Self {
        (self.y_ticks, self.y_label) = (decades(self.y), y.labelled(0));
        self
    }

    fn svg(&self) -> String {
        let (right, bottom) = (self.left + self.width, self.top + self.height);
        let mut grid = String::new();
        let mut labels = String::new();
        for (value, label) in self.x_ticks.values.iter().zip(&self.x_ticks.labels) {
            let x = self.px(*value);
            let _ = write!(
                grid,
                "M{} {}V{}",
                number(x),
                number(self.top),
                number(bottom)
            );
            if !self.x_label.is_empty() {
                labels.push_str(&text("tick", (x, bottom + 18.0), "middle", label));
            }
        }
        for (value, label) in self.y_ticks.values.iter().zip(&self.y_ticks.labels) {
            let y = self.py(*value);
            let _ = write!(
                grid,
                "M{} {}H{}",
                number(self.left),
                number(y),
                number(right)
            );
            labels.push_str(&text("tick", (self.left - 8.0, y + 4.5), "end", label));
        }
        let outline = format!(
            "M{} {}H{}V{}H{}z",
            number(self.left),
            number(self.top),
            number(right),
            number(bottom),
            number(self.left)
        );
        let middle = ((self.left + right) / 2.0, bottom + 40.0);
        labels.push_str(&text("axis", middle, "middle", &self.x_label));
        let (x, y) = (16.0, (self.top + bottom) / 2.0);
        let _ = writeln!(
            labels,
            "<text class=\"axis\" transform=\"translate({} {}) rotate(-90)\" \
             text-anchor=\"middle\">{}</text>",
            number(x),
            number(y),
            escape(&self.y_label)
        );
        path("grid", &grid) + &self.marks + &path("frame", &outline) + &labels
    }
}

fn path(class: &str, d: &str) -> String {
    if d.is_empty() {
        return String::new();
    }
    format!("<path class=\"{class}\" d=\"{d}\"/>\n")
}

fn text(class: &str, (x, y): (f64, f64), anchor: &str, content: &str) -> String {
    if content.is_empty() {
        return String::new();
    }
    format!(
        "<text class=\"{class}\" x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\">{}</text>\n",
        number(x),
        number(y),
        escape(content)
    )
}

/// Two decimals, without a signed zero.
fn number(v: f64) -> String {
    let text = format!("{v:.2}");
    if text == "-0.00" {
        "0.00".to_owned()
    } else {
        text
    }
}

#[cfg(test)]
#[path = "svg_tests.rs"]
mod tests;
