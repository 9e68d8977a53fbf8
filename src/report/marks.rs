//! The smallest parts of a plot: markers, paths, texts, numbers.

use super::text::escape;

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

/// A path with the marks of a class; nothing without any.
pub(super) fn path(class: &str, d: &str) -> String {
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
