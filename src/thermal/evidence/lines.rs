//! Spectral lines: places to look at, from the innovations' spectrum.

use super::columns::Frame;
use super::score::Stage;
use crate::thermal::effects::Candidate;
use crate::thermal::effects::Point;
use crate::thermal::effects::tone::{Pickup, returns};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Frequencies in one resolution cell of the spectrum (1 / span); a line between two loses less than 10 % of its power.
const OVERSAMPLED: f64 = 2.0;

/// Most frequencies of a scan: a longer record is looked at more coarsely at first (and in means of blocks).
const MOST: usize = 2000;

/// The strongest line in the innovations of a stage: a candidate, its one point, and the number of cells looked at. `named`: whether
/// a first line may carry the name. None without a row period.
pub fn strongest(
    frame: &Frame,
    stage: &Stage,
    named: bool,
) -> Option<(Arc<dyn Candidate>, Point, f64)> {
    let c = frame.channels;
    let time_s = frame.fit.reduce(&c.time_s);
    let rows: Vec<usize> = (0..time_s.len())
        .filter(|k| frame.whitened(stage.noise).whitener.inverse_std[*k] > 0.0)
        .collect();
    let (first, last) = (*rows.first()?, *rows.last()?);
    let span_s = time_s[last] - time_s[first];
    let period_s = frame.line().period_s;
    if span_s <= 0.0 || rows.len() < 16 {
        return None;
    }
    let cells = 0.5 * span_s / period_s;
    let count = ((OVERSAMPLED * cells) as usize).clamp(8, MOST);
    let mut best = (0.0, 0.0);
    // Below one turn a line is a trend.
    for k in OVERSAMPLED as usize..count {
        let f = k as f64 / count as f64 * 0.5 / period_s;
        let (mut a, mut b) = (0.0, 0.0);
        let step = TAU * f;
        for row in &rows {
            let (sin, cos) = (step * time_s[*row]).sin_cos();
            a += sin * stage.rest[*row];
            b += cos * stage.rest[*row];
        }
        let power = a * a + b * b;
        if power > best.0 {
            best = (power, f);
        }
    }
    let further = !named || !returns(c, best.1);
    let pickup = Pickup {
        frequency_hz: best.1,
        further,
    };
    (best.0 > 0.0).then(|| {
        let point = Point::at(0, &[best.1]);
        (Arc::new(pickup) as Arc<dyn Candidate>, point, cells)
    })
}
