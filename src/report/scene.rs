//! What the figures have in common: the readings that are drawn, axes, blocks, directions.

use super::Shown;
use super::axis::{Axis, Interval};
use super::svg::{Frame, Shape, Swatch};
use super::text::fixed;
use crate::job::outcome::Point;

/// Readings up to which each has a marker.
const DRAWN: usize = 1500;

/// What the figures have in common.
pub struct Scene<'a> {
    /// What the report is made from.
    pub shown: &'a Shown<'a>,
    /// Whether each reading has a marker; where not, all of them are dots, or the number in each place.
    pub has_markers: bool,
    /// Said where they have none.
    pub crowded: &'static str,
    /// Of a marker, px.
    pub radius: f64,
    /// The thermometer's axis.
    pub thermometer: Axis,
}

/// A value of a reading.
pub type Of = fn(&Point) -> f64;

impl<'a> Scene<'a> {
    /// Chooses what is drawn.
    pub fn new(shown: &'a Shown<'a>) -> Self {
        let points = shown.points;
        let has_markers = points.len() <= DRAWN;
        let crowded = if has_markers {
            ""
        } else {
            " Where there are too many readings for a dot each, the shade is how many lie there."
        };
        let radius = match points.len() {
            0..=150 => 6.0,
            151..=500 => 3.2,
            _ => 2.4,
        };
        let range = [shown.fit.range.0, shown.fit.range.1];
        let readings = points.iter().map(|p| p.thermometer).chain(range);
        let thermometer = Axis {
            interval: Interval::of(readings).padded(0.05),
            quantity: quantity(&shown.fit.thermometer),
            unit: shown.fit.unit.to_owned(),
        };
        Scene {
            shown,
            has_markers,
            crowded,
            radius,
            thermometer,
        }
    }

    /// Readings with a marker each, or all of them as a cloud.
    pub fn readings(
        &self,
        frame: &mut Frame,
        class: &str,
        shape: Shape,
        places: impl Iterator<Item = (f64, f64)> + Clone,
    ) {
        if self.has_markers {
            frame.markers(class, shape, self.radius, &places.collect::<Vec<_>>());
        } else {
            frame.cloud(class, places);
        }
    }

    /// An interval for what is drawn and some levels.
    pub fn interval(&self, of: &[Of], more: &[f64]) -> Interval {
        let points = self.shown.points.iter();
        let values = points.flat_map(|p| of.iter().map(move |f| f(&p)));
        Interval::of(values.chain(more.iter().copied())).padded(0.07)
    }

    /// Where the firmware's input is limited, outside the calibrated range.
    pub fn outside(&self) -> Vec<(f64, f64)> {
        if !self.shown.is_clamped() {
            return Vec::new();
        }
        let (axis, range) = (self.thermometer.interval, self.shown.fit.range);
        vec![(axis.low, range.0), (range.1, axis.high)]
    }

    /// Its line in the legend.
    pub fn outside_entry(&self) -> Option<(&'static str, Swatch, String)> {
        let text = "outside calibrated range, clamped";
        self.shown
            .is_clamped()
            .then(|| ("outside", Swatch::Area, text.to_owned()))
    }

    /// Names of the two directions of the thermometer.
    pub fn directions(&self) -> (&'static str, &'static str) {
        let by_sign = matches!(self.shown.fit.thermometer.as_str(), "phase_rad" | "freq_hz");
        if by_sign && self.shown.summary.record.is_some() {
            ("thermometer rising", "thermometer falling")
        } else {
            ("heating", "cooling")
        }
    }

    /// For all paths after compensation, with the held-out band.
    pub fn residual_interval(&self) -> Interval {
        let heldout = self.shown.fit.heldout_rms_dps;
        let paths: [Of; 4] = [
            |p| p.float_dps,
            |p| p.fixed_dps,
            |p| p.c_dps.unwrap_or(f64::NAN),
            |p| p.rust_dps.unwrap_or(f64::NAN),
        ];
        self.interval(&paths, &[heldout, -heldout])
    }

    /// Float as a line, the others as markers: those of C and Rust fit into the circle of fixed. Of many readings, those of
    /// fixed, and of C and Rust where they differ. The abscissa is divided by `per`.
    pub fn paths(&self, frame: &mut Frame, x: Of, per: f64) {
        let series = |y: Of, is_shown: &dyn Fn(&Point) -> bool| -> Vec<(f64, f64)> {
            let points = self.shown.points.iter().filter(|p| is_shown(p));
            points.map(|p| (x(&p) / per, y(&p))).collect()
        };
        let r = self.radius;
        let many = self.shown.points.len() > 150;
        let class = |one, thin| if many { thin } else { one };
        if self.has_markers {
            frame.line(
                class("float", "float many"),
                &series(|p| p.float_dps, &|_| true),
            );
        }
        let points = self.shown.points.iter();
        let fixed = points.map(|p| (x(&p) / per, p.fixed_dps));
        self.readings(frame, class("fixed", "fixed many"), Shape::Circle, fixed);
        let shown = |p: &Point| self.has_markers || p.differs();
        let c = series(|p| p.c_dps.unwrap_or(f64::NAN), &shown);
        frame.markers(class("c", "c many"), Shape::Plus, 0.8 * r, &c);
        let rust = series(|p| p.rust_dps.unwrap_or(f64::NAN), &shown);
        frame.markers(class("rust", "rust many"), Shape::Cross, 0.8 * r, &rust);
    }

    /// What [`Scene::paths`] draws.
    pub fn paths_legend(&self) -> Vec<(&'static str, Swatch, String)> {
        let words = |name: &str| match self.has_markers {
            true => name.to_owned(),
            false => format!("{name}, where it differs from fixed"),
        };
        let mut out = vec![("fixed", Swatch::Marker(Shape::Circle), "fixed".to_owned())];
        if self.has_markers {
            out.insert(0, ("float", Swatch::Line, "float".to_owned()));
        }
        if self.has_markers || self.shown.points.iter().any(|p| p.differs()) {
            out.extend([
                ("c", Swatch::Marker(Shape::Plus), words("emitted C")),
                ("rust", Swatch::Marker(Shape::Cross), words("emitted Rust")),
            ]);
        }
        out
    }

    /// How to read what [`Scene::paths`] draws.
    pub fn paths_sentence(&self) -> String {
        if self.has_markers {
            return "Four paths of the same readings. Where C (+) and Rust (×) lie inside the circle of the fixed-point model they \
                    agree with it; the float line joins readings in order of time."
                .to_owned();
        }
        let apart = self.shown.points.iter().filter(|p| p.differs()).count();
        let where_they_do = match apart {
            0 => "nowhere here".to_owned(),
            n => format!("{n} readings here"),
        };
        format!(
            "The readings as the fixed-point model compensates them. C (+) and Rust (×) are drawn only where they differ from it: {where_they_do}."
        )
    }

    /// From when to when each held-out block lasts, s; the border is halfway between readings.
    pub fn blocks(&self) -> Vec<(f64, f64)> {
        let (fit, points) = (self.shown.fit, self.shown.points);
        // Either the points are the fitted rows, or they are all rows of the record.
        let time = |k: usize| {
            let row = if points.len() == fit.rows.len() {
                k
            } else {
                *fit.rows.get(k)?
            };
            points.get(row).map(|p| p.time_s)
        };
        let border = |k: usize| match (k.checked_sub(1).and_then(time), time(k)) {
            (Some(a), Some(b)) => Some((a + b) / 2.0),
            (a, b) => a.or(b),
        };
        let ends = fit
            .blocks
            .iter()
            .map(|b| Some((border(b.start)?, border(b.end)?)));
        ends.collect::<Option<Vec<_>>>().unwrap_or_default()
    }

    /// ", 0.0 to 70.0 degC", where a temperature is known and is not on the axis.
    pub fn span_degc(&self) -> String {
        let known = self.shown.points.iter().map(|p| p.temperature_degc);
        let (low, high) = known
            .filter(|t| t.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| {
                (l.min(t), h.max(t))
            });
        if low > high || self.shown.fit.unit == "degC" {
            return String::new();
        }
        format!(", readings at {} to {} degC", fixed(low, 1), fixed(high, 1))
    }
}
/// A thermometer's name in words; an unknown column's own.
pub fn quantity(thermometer: &str) -> String {
    match thermometer {
        "phase_rad" => "thermometer: drive phase".to_owned(),
        "freq_hz" => "thermometer: drive frequency".to_owned(),
        "die_degc" => "thermometer: die temperature".to_owned(),
        "chamber_degc" => "thermometer: chamber temperature".to_owned(),
        other => format!("thermometer: {other}"),
    }
}
