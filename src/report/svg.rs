//! A small writer of plots as SVG text: frames with ticks, lines, bands, spans, markers, a legend.
//!
//! Colours are left to the page's style sheet: every mark carries a class. Coordinates have two
//! decimals, so the same plot gives the same bytes. Values that are no number are left out: a line
//! breaks there, a marker is missing. What is drawn is kept as numbers for the figure's CSV.

use super::axis::{Axis, CHARACTER, Interval, ticks};
use super::figure::{Entry, Figure, Series};
pub use super::frame::Frame;
use super::marks::number;
pub use super::marks::{Shape, Swatch};
use super::text::escape;

/// Narrower plots name the rows of a chart inside it, px.
const ROOMY: f64 = 600.0;

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
        let mut most = ((height / 38.0) as usize).clamp(2, 8);
        let mut y_ticks = ticks(y.interval, most);
        // One number alone is no scale.
        while y_ticks.values.len() < 2 && most < 8 {
            most += 1;
            y_ticks = ticks(y.interval, most);
        }
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
            axes: both_axes(&y, &x),
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

    /// Data of such a drawing.
    pub fn add_series(&mut self, series: impl IntoIterator<Item = Series>) {
        self.series.extend(series);
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

/// Both axes in words; the vertical one alone where the horizontal one is labelled at a frame below.
fn both_axes(y: &Axis, x: &Axis) -> String {
    let labels = [y.labelled(0), x.labelled(0)];
    let said: Vec<String> = labels.into_iter().filter(|l| !l.is_empty()).collect();
    said.join("; ")
}

#[cfg(test)]
#[path = "svg_tests.rs"]
mod tests;
