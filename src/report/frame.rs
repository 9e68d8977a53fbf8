//! A frame of a plot: two axes, and what is drawn between them.

use super::axis::{Axis, Interval, Ticks, decades};
use super::density;
use super::figure::Series;
use super::marks::{Shape, number, path, text};
use super::text::escape;
use std::fmt::Write as _;

/// Lines of a hint that are shown beside its point.
const SAID: usize = 4;

/// Two axes and what is drawn between them, in the order of the calls.
#[derive(Debug)]
pub struct Frame {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) x: Interval,
    pub(super) y: Interval,
    pub(super) x_ticks: Ticks,
    pub(super) y_ticks: Ticks,
    pub(super) x_label: String,
    pub(super) y_label: String,
    pub(super) axes: String,
    /// Whether the horizontal and the vertical axis show powers of ten.
    pub(super) is_log: [bool; 2],
    /// Height of a named row, px.
    pub(super) rows: Option<f64>,
    pub(super) marks: String,
    /// Class, what the third number is, points.
    pub(super) drawn: Vec<(String, &'static str, Vec<[f64; 3]>)>,
    pub(super) has_hints: bool,
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

    /// A level across the frame, where it is inside.
    pub fn level(&mut self, class: &str, y: f64) {
        if !(self.y.low..=self.y.high).contains(&y) {
            return;
        }
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

    /// A line from the lower to the upper end of the frame.
    pub fn upright(&mut self, class: &str, x: f64) {
        self.line(class, &[(x, self.y.low), (x, self.y.high)]);
        self.drawn.pop();
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
    pub fn cloud(&mut self, class: &str, points: impl Iterator<Item = (f64, f64)> + Clone) {
        let (low, high) = (self.y.low, self.y.high);
        let inside = || points.clone().filter(move |p| p.1 >= low && p.1 <= high);
        let places = || inside().filter_map(|p| self.place(p));
        if density::is_crowded(places().count(), self.width * self.height) {
            let cells = density::cells(places());
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
            let inside: Vec<(f64, f64)> = inside().collect();
            let many = if inside.len() > 200 { " many" } else { "" };
            self.markers(&format!("{class} dots{many}"), Shape::Dot, 1.0, &inside);
        }
        let inset = 0.03 * (self.y.high - self.y.low);
        let edge = |beyond: &dyn Fn(f64) -> bool, at: f64| -> Vec<(f64, f64)> {
            let beyond = points.clone().filter(|p| beyond(p.1));
            beyond.map(|p| (p.0, at)).collect()
        };
        let (above, below) = (
            edge(&|v| v > high, high - inset),
            edge(&|v| v < low, low + inset),
        );
        self.mark(class, Shape::Up, 4.0, &above);
        self.mark(class, Shape::Down, 4.0, &below);
        let beyond: Vec<(f64, f64)> = points.filter(|p| p.1 > high || p.1 < low).collect();
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

    /// The same above a marker.
    pub fn note_above(&mut self, class: &str, point: (f64, f64), content: &str) {
        if let Some((x, y)) = self.place(point) {
            self.marks
                .push_str(&text(class, (x, y - 10.0), "middle", content));
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
    pub(super) fn series(&self) -> impl Iterator<Item = Series> + '_ {
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

    pub(super) fn svg(&self) -> String {
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
