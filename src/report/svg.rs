//! A small writer of plots as SVG text: frames with ticks, lines, bands, spans, markers, a legend.
//!
//! Colours are left to the page's style sheet: every mark carries a class. Coordinates have two
//! decimals, so the same plot gives the same bytes. Values that are no number are left out: a line
//! breaks there, a marker is missing. What is drawn is kept as numbers for the figure's CSV.

use super::axis::{Axis, CHARACTER, Interval, Ticks, decades, ticks};
use super::density;
use super::figure::{Entry, Figure, Series};
use super::text::escape;
use std::fmt::Write as _;

/// Narrower plots name the rows of a chart inside it, px.
const ROOMY: f64 = 600.0;
/// Lines of a hint that are shown beside its point.
const SAID: usize = 4;

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
    pub(super) fn path(self, x: f64, y: f64, r: f64) -> String {
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
    legend: Vec<Entry>,
    series: Vec<Series>,
    has_hints: bool,
}

impl Svg {
    /// An empty plot; it grows as frames are added.
    pub fn new(width: f64) -> Self {
        Svg {
            width,
            height: 0.0,
            body: String::new(),
            legend: Vec::new(),
            series: Vec::new(),
            has_hints: false,
        }
    }

    /// True if the plot fills a wide page.
    pub fn is_roomy(&self) -> bool {
        self.width > ROOMY
    }

    /// The legend: (class, swatch, text). It stands above the plot, in the page's own text.
    pub fn legend<C: Into<String>>(
        &mut self,
        entries: impl IntoIterator<Item = (C, Swatch, String)>,
    ) {
        let entries = entries.into_iter();
        self.legend
            .extend(entries.map(|(class, swatch, text)| (class.into(), swatch, text)));
    }

    /// Puts a frame below what is there.
    pub fn add(&mut self, frame: &Frame) {
        self.body.push_str(&frame.svg());
        self.series.extend(frame.series());
        self.has_hints |= frame.has_hints;
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
            axes: format!("{}; {}", y.labelled(0), x.labelled(0)),
            is_log: [false; 2],
            rows: None,
            marks: String::new(),
            drawn: Vec::new(),
            has_hints: false,
        }
    }

    /// A frame whose vertical axis has named rows, `height` px each, the first on top: row `k` of `n` stands at `n - k`.
    /// Names stand left of it, or above their rows where the plot is narrow.
    pub fn rows(&self, height: f64, names: &[String], x: Axis) -> Frame {
        let count = names.len() as f64;
        let y = Axis {
            interval: Interval {
                low: 0.4,
                high: count + 0.6,
            },
            quantity: String::new(),
            unit: String::new(),
        };
        let longest = names.iter().map(|n| n.chars().count()).max().unwrap_or(0);
        let (left, height) = if self.is_roomy() {
            (CHARACTER * longest as f64 + 16.0, height)
        } else {
            (12.0, height + 22.0)
        };
        let mut frame = self.frame(height * (count + 0.2), left, x, y);
        let at = names.iter().enumerate();
        frame.y_ticks.values = at.map(|(k, _)| count - k as f64).collect();
        frame.y_ticks.labels = names.to_vec();
        frame.rows = Some(height);
        frame
    }

    /// Marks that need no frame, `height` px below what is there; coordinates are px of the plot.
    pub fn add_drawing(&mut self, height: f64, body: &str) {
        self.body.push_str(body);
        self.height += height;
    }

    /// The figure; the title is also for those who cannot see it.
    pub fn figure(self, title: impl Into<String>, caption: impl Into<String>) -> Figure {
        let title = title.into();
        let (w, h) = (number(self.width), number(self.height));
        // What is an image hides its parts from a screen reader.
        let role = if self.has_hints { "group" } else { "img" };
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" role=\"{role}\" \
             aria-label=\"{}\">\n{}</svg>",
            escape(&title),
            self.body
        );
        Figure::new(title, caption.into(), svg, self.legend, self.series)
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
    axes: String,
    /// Whether the horizontal and the vertical axis show powers of ten.
    is_log: [bool; 2],
    /// Height of a named row, px.
    rows: Option<f64>,
    marks: String,
    /// Class, what the third number is, points.
    drawn: Vec<(String, &'static str, Vec<[f64; 3]>)>,
    has_hints: bool,
}

impl Frame {
    /// Both axes logarithmic: their intervals, and what is drawn, are powers of ten.
    pub fn logarithmic(self, x: &Axis, y: &Axis) -> Self {
        self.logarithmic_across(x).logarithmic_up(y)
    }

    /// The horizontal axis logarithmic: its interval, and the abscissae of what is drawn, are powers of ten.
    pub fn logarithmic_across(mut self, x: &Axis) -> Self {
        let most = (self.width / 46.0) as usize;
        (self.x_ticks, self.x_label) = (decades(self.x, most), x.labelled(0));
        self.is_log[0] = true;
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
        self.keep(class, points);
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
        if class == "zero" {
            // No data.
            self.drawn.pop();
        }
    }

    /// The area between two curves over the same abscissae: (x, lower, upper).
    pub fn band(&mut self, class: &str, points: &[(f64, f64, f64)]) {
        let kept = points.iter().map(|(x, low, high)| [*x, *low, *high]);
        self.drawn.push((class.to_owned(), "upper", kept.collect()));
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

    /// A stroke from the lower to the upper value at each abscissa: (x, lower, upper).
    pub fn bars(&mut self, class: &str, points: &[(f64, f64, f64)]) {
        let kept = points.iter().map(|(x, low, high)| [*x, *low, *high]);
        self.drawn.push((class.to_owned(), "upper", kept.collect()));
        let mut d = String::new();
        for (x, low, high) in points {
            if let (Some(from), Some(to)) = (self.place((*x, *low)), self.place((*x, *high))) {
                // Writing to a string cannot fail.
                let _ = write!(d, "M{} {}V{}", number(from.0), number(from.1), number(to.1));
            }
        }
        self.marks.push_str(&path(class, &d));
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
        self.keep(class, points);
        self.mark(class, shape, r, points);
    }

    fn mark(&mut self, class: &str, shape: Shape, r: f64, points: &[(f64, f64)]) {
        let places = points.iter().filter_map(|p| self.place(*p));
        let d: String = places.map(|(x, y)| shape.path(x, y, r)).collect();
        self.marks.push_str(&path(class, &d));
    }

    /// Every point as it is, as a dot; where there are too many, how many fall into each cell of the frame. What lies
    /// above or below the frame is a triangle at its edge.
    pub fn cloud(&mut self, class: &str, points: &[(f64, f64)]) {
        let within = |p: &&(f64, f64)| p.1 >= self.y.low && p.1 <= self.y.high;
        let inside: Vec<(f64, f64)> = points.iter().filter(within).copied().collect();
        let places: Vec<(f64, f64)> = inside.iter().filter_map(|p| self.place(*p)).collect();
        if density::is_crowded(places.len(), self.width * self.height) {
            let cells = density::cells(&places);
            for (level, d) in density::paths(&cells).iter().enumerate() {
                self.marks
                    .push_str(&path(&format!("{class} cell l{}", level + 1), d));
            }
            let value = |cell: &density::Cell| {
                let (x, y) = (cell.x - self.left, cell.y - self.top);
                let x = self.x.low + (self.x.high - self.x.low) * x / self.width;
                [
                    x,
                    self.y.high - (self.y.high - self.y.low) * y / self.height,
                    cell.count as f64,
                ]
            };
            self.drawn
                .push((class.to_owned(), "count", cells.iter().map(value).collect()));
        } else {
            let many = if inside.len() > 200 { " many" } else { "" };
            self.markers(&format!("{class} dots{many}"), Shape::Dot, 1.0, &inside);
        }
        let inset = 0.03 * (self.y.high - self.y.low);
        let edge = |beyond: &dyn Fn(f64) -> bool, at: f64| -> Vec<(f64, f64)> {
            let beyond = points.iter().filter(|p| beyond(p.1));
            beyond.map(|p| (p.0, at)).collect()
        };
        let (low, high) = (self.y.low, self.y.high);
        let (above, below) = (
            edge(&|v| v > high, high - inset),
            edge(&|v| v < low, low + inset),
        );
        self.mark(class, Shape::Up, 4.0, &above);
        self.mark(class, Shape::Down, 4.0, &below);
        let beyond = points.iter().filter(|p| p.1 > high || p.1 < low).copied();
        let beyond: Vec<(f64, f64)> = beyond.collect();
        if !beyond.is_empty() {
            self.keep(class, &beyond);
        }
    }

    /// An invisible circle that says something to who points at it or comes to it by the keyboard.
    pub fn hint(&mut self, r: f64, point: (f64, f64), content: &str) {
        let Some((x, y)) = self.place(point) else {
            return;
        };
        self.has_hints = true;
        let anchor = match (x - self.left) / self.width {
            share if share < 0.33 => "start",
            share if share > 0.67 => "end",
            _ => "middle",
        };
        let lines: Vec<&str> = content.lines().take(SAID).collect();
        let up = y > self.top + 17.0 * lines.len() as f64 + 12.0;
        let mut said = String::new();
        for (k, line) in lines.iter().enumerate() {
            let down = if up {
                -10.0 - 17.0 * (lines.len() - 1 - k) as f64
            } else {
                22.0 + 17.0 * k as f64
            };
            said.push_str(text("say", (x, y + down), anchor, line).trim_end());
        }
        let _ = writeln!(
            self.marks,
            "<g class=\"hint\" tabindex=\"0\" role=\"img\" aria-label=\"{}\"><circle cx=\"{}\" cy=\"{}\" \
             r=\"{}\"/>{said}</g>",
            escape(&content.replace('\n', "; ")),
            number(x),
            number(y),
            number(r),
        );
    }

    /// A word or two at a point; nothing that belongs to the data.
    pub fn note(&mut self, class: &str, point: (f64, f64), anchor: &str, content: &str) {
        if let Some(place) = self.place(point) {
            self.marks.push_str(&text(class, place, anchor, content));
        }
    }

    /// The vertical axis logarithmic: its interval, and the ordinates of what is drawn, are powers of ten.
    pub fn logarithmic_up(mut self, y: &Axis) -> Self {
        let most = (self.height / 24.0) as usize;
        (self.y_ticks, self.y_label) = (decades(self.y, most), y.labelled(0));
        self.is_log[1] = true;
        self
    }

    /// What was drawn, in the axes' units.
    fn series(&self) -> impl Iterator<Item = Series> + '_ {
        let plain = |v: f64, is_log: bool| if is_log { 10f64.powf(v) } else { v };
        let [across, up] = self.is_log;
        self.drawn.iter().map(move |(class, third, points)| Series {
            axes: self.axes.clone(),
            class: class.clone(),
            third,
            points: points
                .iter()
                .map(|[x, y, t]| {
                    let t = plain(*t, up && *third == "upper");
                    [plain(*x, across), plain(*y, up), t]
                })
                .collect(),
        })
    }

    fn keep(&mut self, class: &str, points: &[(f64, f64)]) {
        let points = points.iter().map(|(x, y)| [*x, *y, f64::NAN]);
        self.drawn.push((class.to_owned(), "", points.collect()));
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
            let (place, anchor) = match self.rows {
                Some(row) if self.left < 20.0 => ((self.left + 4.0, y - 0.5 * row + 15.0), "start"),
                _ => ((self.left - 8.0, y + 4.5), "end"),
            };
            labels.push_str(&text("tick", place, anchor, label));
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

/// A path with the marks of a class; nothing without any.
pub(super) fn mark(class: &str, d: &str) -> String {
    path(class, d)
}

fn path(class: &str, d: &str) -> String {
    if d.is_empty() {
        return String::new();
    }
    format!("<path class=\"{class}\" d=\"{d}\"/>\n")
}

pub(super) fn text(class: &str, (x, y): (f64, f64), anchor: &str, content: &str) -> String {
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
pub(super) fn number(v: f64) -> String {
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
