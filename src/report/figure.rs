//! A figure of a page: drawn once for wide pages and once for narrow ones, with its legend, its data as CSV and its
//! figures in numbers for those who cannot see it.

use super::marks::{Shape, Swatch, path};
use super::text::{escape, grouped_decimal, minus, significant};
use std::fmt::Write as _;

/// Width of a figure that fills a wide page, px.
pub const WIDE: f64 = 960.0;
/// Width of a figure on a telephone (400 px less the margins), px.
pub const NARROW: f64 = 372.0;
/// Width of one of many small plots, px.
pub const SMALL: f64 = 400.0;

/// What is drawn of a series in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Both axes, as they are labelled.
    pub axes: String,
    /// Class of the marks.
    pub class: String,
    /// What the third number of each point is; empty without one.
    pub third: &'static str,
    /// Abscissa, ordinate, and the upper end of a band or the count of a cell (else NaN), in the axes' units.
    pub points: Vec<[f64; 3]>,
}

/// A line of a legend: class, what stands for it, words.
pub type Entry = (String, Swatch, String);

/// A figure for the page.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// What it shows.
    pub title: String,
    /// How to read it.
    pub caption: String,
    /// SVG for wide pages, escaped; several in a grid where there are many small ones.
    svg: String,
    /// The same for narrow pages; empty if that is the same.
    narrow: String,
    legend: Vec<Entry>,
    series: Vec<Series>,
}

impl Figure {
    /// From what was drawn.
    pub(super) fn new(
        title: String,
        caption: String,
        svg: String,
        legend: Vec<Entry>,
        series: Vec<Series>,
    ) -> Self {
        Figure {
            title,
            caption,
            svg,
            narrow: String::new(),
            legend,
            series,
        }
    }

    /// A figure of many small plots in a grid, with one legend.
    pub fn grid(title: &str, caption: String, plots: Vec<Figure>) -> Self {
        let legend = plots.first().map_or(Vec::new(), |p| p.legend.clone());
        let svgs: Vec<&str> = plots.iter().map(|p| p.svg.as_str()).collect();
        Figure {
            svg: format!("<div class=\"multiples\">\n{}\n</div>", svgs.join("\n")),
            title: title.to_owned(),
            caption,
            narrow: String::new(),
            legend,
            series: plots.into_iter().flat_map(|p| p.series).collect(),
        }
    }

    /// Legend and drawings as HTML, escaped.
    pub fn html(&self) -> String {
        let mut out = String::new();
        if !self.legend.is_empty() {
            out.push_str("<ul class=\"legend\">\n");
            for (class, swatch, words) in &self.legend {
                let drawn = match swatch {
                    Swatch::Line => path(class, "M0 7h24"),
                    Swatch::Area => path(class, "M0 1h24v12h-24z"),
                    Swatch::Marker(shape) => path(class, &shape.path(12.0, 7.0, 5.0)),
                };
                let _ = writeln!(
                    out,
                    "<li><svg viewBox=\"0 0 24 14\" aria-hidden=\"true\">{}</svg>{}</li>",
                    drawn.trim_end(),
                    escape(words)
                );
            }
            out.push_str("</ul>\n");
        }
        if self.narrow.is_empty() {
            return out + &self.svg;
        }
        format!(
            "{out}<div class=\"wide\">\n{}\n</div>\n<div class=\"narrow\">\n{}\n</div>",
            self.svg, self.narrow
        )
    }

    /// Name of the file with the data.
    pub fn file(&self) -> String {
        let word = |c: char| {
            if c.is_ascii_alphanumeric() {
                c.to_ascii_lowercase()
            } else {
                ' '
            }
        };
        let words: String = self.title.chars().map(word).collect();
        let words: Vec<&str> = words.split_whitespace().take(8).collect();
        format!("{}.csv", words.join("-"))
    }

    /// What is drawn, as CSV in a `data:` address.
    pub fn data(&self) -> String {
        let mut out = String::from("data:text/csv;charset=utf-8,");
        let mut line = |fields: &[&str]| {
            for (k, field) in fields.iter().enumerate() {
                if k > 0 {
                    out.push(',');
                }
                percent_encoded(&mut out, field);
            }
            out.push_str("%0A");
        };
        line(&["axes", "series", "x", "y", "third", "third_is"]);
        for series in &self.series {
            let (axes, name) = (quoted(&series.axes), quoted(&self.name_of(series)));
            for [x, y, third] in &series.points {
                let [x, y, third] = [number(*x), number(*y), number(*third)];
                line(&[&axes, &name, &x, &y, &third, series.third]);
            }
        }
        out
    }

    /// Whether there is anything to put into a table.
    pub fn has_data(&self) -> bool {
        self.series.iter().any(|s| !s.points.is_empty())
    }

    /// In numbers: axes, series, how many points, abscissae from and to, ordinates from and to. Series that these do not
    /// tell apart are one row, and so are those that only the sign of the ordinates does.
    pub fn numbers(&self) -> Vec<[String; 5]> {
        let mut rows: Vec<Row> = Vec::new();
        for s in self.series.iter().filter(|s| !s.points.is_empty()) {
            let span = |low: &dyn Fn(&[f64; 3]) -> f64, high: &dyn Fn(&[f64; 3]) -> f64| {
                let least = s.points.iter().map(low).fold(f64::INFINITY, f64::min);
                let greatest = s.points.iter().map(high).fold(f64::NEG_INFINITY, f64::max);
                [least, greatest]
            };
            let upper = |p: &[f64; 3]| if s.third == "upper" { p[2] } else { p[1] };
            let row = Row {
                axes: s.axes.clone(),
                name: self.name_of(s),
                count: match s.third {
                    "count" => s.points.iter().map(|p| p[2]).sum::<f64>() as usize,
                    _ => s.points.len(),
                },
                x: span(&|p| p[0], &|p| p[0]),
                y: span(&|p| p[1], &upper),
                has_mirrored: false,
            };
            let of_this = |r: &&mut Row| row.is_shown_by(r);
            match rows.iter_mut().find(of_this) {
                Some(shown) => shown.has_mirrored |= shown.y != row.y,
                None => rows.push(row),
            }
        }
        rows.iter().map(Row::text).collect()
    }

    /// What the legend calls a series; its class where the legend does not.
    fn name_of(&self, series: &Series) -> String {
        let first = |class: &str| class.split(' ').next().unwrap_or("").to_owned();
        let mut named = self
            .legend
            .iter()
            .filter(|e| first(&e.0) == first(&series.class));
        let exact = named.clone().find(|e| e.0 == series.class);
        exact
            .or_else(|| named.next())
            .map_or_else(|| series.class.clone(), |e| e.2.clone())
    }
}

/// A row of a figure's numbers.
struct Row {
    axes: String,
    name: String,
    /// Points.
    count: usize,
    /// Least and greatest abscissa, in the axis's unit.
    x: [f64; 2],
    /// Least and greatest ordinate, in the axis's unit.
    y: [f64; 2],
    /// Whether a series is the same but for the ordinates' sign.
    has_mirrored: bool,
}

impl Row {
    fn is_shown_by(&self, shown: &Row) -> bool {
        let [low, high] = self.y;
        (&self.axes, &self.name, self.count, self.x)
            == (&shown.axes, &shown.name, shown.count, shown.x)
            && (shown.y == self.y || shown.y == [-high, -low])
    }

    fn text(&self) -> [String; 5] {
        let sign = if self.has_mirrored { "±" } else { "" };
        let count = self.count.to_string();
        let (x, y) = (range("", self.x), range(sign, self.y));
        [self.axes.clone(), self.name.clone(), count, x, y]
    }
}

/// A range; one number where its ends are the same. `sign` is `±` where it stands for two.
fn range(sign: &str, [least, greatest]: [f64; 2]) -> String {
    // Above this every float is a whole number.
    const EXACT: f64 = 1e15;
    let of = |v: f64| match v.fract() == 0.0 && v.abs() < EXACT {
        true => minus(&grouped_decimal(&format!("{:.0}", v + 0.0))),
        false => significant(v, 4),
    };
    match (sign, least == greatest) {
        (_, true) => format!("{sign}{}", of(least)),
        ("", false) => format!("{} to {}", of(least), of(greatest)),
        _ => format!("{sign}({} to {})", of(least), of(greatest)),
    }
}

/// The same figures drawn for wide pages and for narrow ones.
pub fn both(draw: impl Fn(f64) -> Vec<Figure>) -> Vec<Figure> {
    let mut wide = draw(WIDE);
    for (wide, narrow) in wide.iter_mut().zip(draw(NARROW)) {
        if wide.svg != narrow.svg {
            wide.narrow = narrow.svg;
        }
    }
    wide
}

/// One figure drawn for wide pages and for narrow ones.
pub fn one(draw: impl Fn(f64) -> Figure) -> Figure {
    let (mut wide, narrow) = (draw(WIDE), draw(NARROW));
    if wide.svg != narrow.svg {
        wide.narrow = narrow.svg;
    }
    wide
}

/// Dots in a legend.
pub const DOT: Swatch = Swatch::Marker(Shape::Dot);

/// Seven digits; nothing for what is no number.
fn number(value: f64) -> String {
    if !value.is_finite() {
        return String::new();
    }
    let rounded: f64 = format!("{value:.6e}").parse().unwrap_or(value);
    if rounded != 0.0 && !(1e-4..1e9).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        rounded.to_string()
    }
}

/// A field of a CSV file. What a spreadsheet would take for a formula is text.
fn quoted(field: &str) -> String {
    let guard = if field.starts_with(['=', '+', '-', '@']) {
        "'"
    } else {
        ""
    };
    format!("\"{guard}{}\"", field.replace('"', "\"\""))
}

/// Text inside a `data:` address.
fn percent_encoded(out: &mut String, text: &str) {
    for byte in text.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'+' | b'/' => {
                out.push(char::from(byte));
            }
            _ => {
                // Writing to a string cannot fail.
                let _ = write!(out, "%{byte:02X}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure() -> Figure {
        let series = Series {
            axes: "rate, \"deg/s\"; time, s".to_owned(),
            class: "after dots".to_owned(),
            third: "",
            points: vec![[1.0, 0.1 + 0.2, f64::NAN], [2.0, -1.5e-7, f64::NAN]],
        };
        let legend = vec![("after".to_owned(), Swatch::Line, "=with <steps>".to_owned())];
        Figure::new(
            "Residual: over time".to_owned(),
            String::new(),
            "<svg></svg>".to_owned(),
            legend,
            vec![series],
        )
    }

    #[test]
    fn data_are_csv_with_the_legends_names_and_seven_digits() {
        let data = figure().data();
        assert!(data.starts_with("data:text/csv;charset=utf-8,axes,series,x,y,third,third_is%0A"));
        assert!(data.contains("%22rate%2C%20%22%22deg/s%22%22%3B%20time%2C%20s%22,"));
        assert!(
            data.contains("%22%27%3Dwith%20%3Csteps%3E%22,1,0.3,,%0A"),
            "{data}"
        );
        assert!(data.contains(",2,-1.5e-7,,%0A"));
        assert_eq!(figure().file(), "residual-over-time.csv");
    }

    #[test]
    fn numbers_stand_for_the_drawing_and_the_legend_is_escaped() {
        let numbers = figure().numbers();
        assert_eq!(numbers[0][2..4], ["2", "1 to 2"]);
        assert!(figure().html().contains("=with &lt;steps&gt;"));
    }

    #[test]
    fn whole_numbers_are_exact_and_series_that_are_alike_are_one_row() {
        let mut drawn = figure();
        let one = |points: Vec<[f64; 3]>| Series {
            points,
            ..drawn.series[0].clone()
        };
        let nan = f64::NAN;
        drawn.series = vec![
            one(vec![[-32768.0, 32767.0, nan]]),
            one(vec![[-32768.0, 32767.0, nan]]),
            one(vec![[0.0, 0.25, nan], [4294967295.0, 0.5, nan]]),
            one(vec![[0.0, -0.5, nan], [4294967295.0, -0.25, nan]]),
        ];
        let numbers = drawn.numbers();
        let ranges: Vec<&[String]> = numbers.iter().map(|n| &n[2..]).collect();
        let narrow = |text: &str| text.replace(' ', "\u{202f}");
        let words = [narrow("4 294 967 295"), narrow("−32 768"), narrow("32 767")];
        assert_eq!(ranges.len(), 2, "{numbers:?}");
        assert_eq!(ranges[0], ["1", &words[1], &words[2]]);
        assert_eq!(
            ranges[1],
            ["2", &format!("0 to {}", words[0]), "±(0.2500 to 0.5000)"]
        );
    }

    #[test]
    fn a_figure_that_is_narrow_in_any_case_is_there_once() {
        assert!(!one(|_| figure()).html().contains("class=\"narrow\""));
        let drawn = both(|width| {
            let mut f = figure();
            f.svg = format!("<svg {width}></svg>");
            vec![f]
        });
        let html = drawn[0].html();
        assert!(html.contains("<svg 960>") && html.contains("class=\"narrow\">\n<svg 372>"));
    }
}
