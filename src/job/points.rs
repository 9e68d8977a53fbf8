//! Readings through every path, and figures over them.

use crate::thermal::no_gain;
pub use crate::thermal::no_gain::DRIFT_BINS;
use std::fmt;

/// One reading: the same rate through every path, deg/s. The applied rate is subtracted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// s.
    pub time_s: f64,
    /// In the thermometer's unit.
    pub thermometer: f64,
    /// Chamber or die, degC; NaN where nobody knows.
    pub temperature_degc: f64,
    /// True while the thermometer's trend is that of heating.
    pub heating: bool,
    /// Not compensated.
    pub before_dps: f64,
    /// Compensated in `f64` with the fit's own coefficients.
    pub float_dps: f64,
    /// Compensated by the bit-accurate model.
    pub fixed_dps: f64,
    /// Compensated by the emitted C; `None` where it was not built.
    pub c_dps: Option<f64>,
    /// Compensated by the emitted Rust.
    pub rust_dps: Option<f64>,
}

impl Point {
    /// True if emitted code that was built differs from the model.
    pub fn differs(&self) -> bool {
        let emitted = [self.c_dps, self.rust_dps];
        let mut built = emitted.into_iter().flatten();
        built.any(|dps| dps != self.fixed_dps)
    }

    /// C and Rust in words.
    pub fn emitted(&self, show: impl Fn(f64) -> String) -> [String; 2] {
        [self.c_dps, self.rust_dps].map(|dps| dps.map_or("not built".to_owned(), &show))
    }
}

/// Readings, each put together when it is asked for: those of a long record would be several times the record.
pub struct Points {
    count: usize,
    at: Box<dyn Fn(usize) -> Point + Send + Sync>,
}

impl Points {
    /// So many, from their numbers.
    pub fn new(count: usize, at: impl Fn(usize) -> Point + Send + Sync + 'static) -> Self {
        let at = Box::new(at);
        Points { count, at }
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.count
    }

    /// There is none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// One of them.
    pub fn get(&self, k: usize) -> Option<Point> {
        (k < self.count).then(|| (self.at)(k))
    }

    /// All in order of time.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Point> + Clone {
        (0..self.count).map(|k| (self.at)(k))
    }
}

impl From<Vec<Point>> for Points {
    fn from(points: Vec<Point>) -> Self {
        Points::new(points.len(), move |k| points[k])
    }
}

impl fmt::Debug for Points {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

/// Points' drift: greatest minus least of the means over [`DRIFT_BINS`] bins of the thermometer.
pub fn drift_pp(points: &Points, of: impl Fn(&Point) -> f64) -> f64 {
    no_gain::drift_pp(points.iter().map(|p| (p.thermometer, of(&p))))
}

/// Root mean square.
pub fn rms(points: &Points, of: impl Fn(&Point) -> f64) -> f64 {
    let sum: f64 = points.iter().map(|p| of(&p).powi(2)).sum();
    (sum / points.len().max(1) as f64).sqrt()
}
