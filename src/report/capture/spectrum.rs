//! The spectrum of a capture's residual, with marks where lines may stand.

use super::figures::{NAMES, axis, legend, series, stacked};
use super::view::{Left, View};
use crate::capture::candidates::Effect;
use crate::capture::columns::HARMONICS;
use crate::capture::tone::fold;
use crate::capture::{mains, spur};
use crate::report::axis::{Axis, Interval};
use crate::report::figure::Figure;
use crate::report::svg::{Shape, Svg, Swatch};

/// Columns of the figure.
const COLUMNS: usize = 480;
/// Least power that is drawn, dBFS.
const LEAST_DB: f64 = -200.0;

/// Class and points of a line.
type Curve = (&'static str, Vec<(f64, f64)>);

/// Marks of a spectrum: class, shape, words, frequencies in turns a sample.
fn marks(view: &View) -> Vec<(&'static str, Shape, String, Vec<f64>)> {
    let findings = &view.closed.findings;
    let [_, model] = &findings.models;
    let resolution = 1.0 / view.closed.capture.rows() as f64;
    let lines = |effect: Effect| -> Vec<f64> {
        let taken = findings.lines.iter().filter(|l| l.1 == effect);
        taken.map(|l| l.0).collect()
    };
    let of_tone = |k: f64| fold(k * model.tone.turns);
    let mut out = vec![
        (
            "cooling",
            Shape::Down,
            "tone".to_owned(),
            vec![of_tone(1.0)],
        ),
        (
            "c",
            Shape::Down,
            format!("its harmonics 2 to {HARMONICS}"),
            (2..=HARMONICS).map(|k| of_tone(k as f64)).collect(),
        ),
    ];
    if let Some(fs) = view.closed.capture.meta.fs_hz {
        let places = mains::MAINS_HZ.iter().map(|hz| hz / fs);
        let shown = places.filter(|t| *t > resolution && *t < 0.5).collect();
        out.push(("rust", Shape::Plus, "50 and 60 Hz".to_owned(), shown));
    }
    let found = lines(Effect::Mains);
    out.push(("heating", Shape::Up, "pickup found".to_owned(), found));
    let mut spurs = lines(Effect::Spur);
    let truncated = spurs.is_empty()
        && (view.closed.closure.steps.iter()).any(|s| s.effect == Effect::Spur.id());
    if truncated && let Some(truncation) = model.truncation {
        spurs = spur::places_of(&model.tone, truncation.bits);
    }
    out.push(("fixed", Shape::Cross, "spur found".to_owned(), spurs));
    out.retain(|m| !m.3.is_empty());
    out
}

/// Spectrum of the residual before and after, both channels.
pub fn spectrum(view: &View, width: f64) -> Figure {
    let fs = view.closed.capture.meta.fs_hz;
    let unit = if fs.is_some() { "Hz" } else { "per sample" };
    let fs = fs.unwrap_or(1.0);
    let bins = view.after[0].spectrum.len().saturating_sub(1).max(2) as f64;
    let across = Interval {
        low: (0.5 * fs / bins).log10(),
        high: (0.5 * fs).log10(),
    }
    .padded(0.015);
    let curve = |left: &Left| columns(&left.spectrum, fs, across);
    let curves: Vec<Vec<Curve>> = (0..2)
        .map(|c| {
            let shown = series(view, c).into_iter();
            shown.map(|(class, left)| (class, curve(left))).collect()
        })
        .collect();
    let x = [axis(across, "", unit), axis(across, "frequency", unit)];
    let y: Vec<Axis> = (0..2)
        .map(|c: usize| {
            let values = curves[c].iter().flat_map(|s| s.1.iter().map(|p| p.1));
            // Room for the marks above.
            let found = Interval::of(values);
            let span = found.high - found.low;
            let interval = Interval {
                low: found.low - 0.04 * span,
                high: found.high + 0.16 * span,
            };
            axis(interval, NAMES[c], "dBFS")
        })
        .collect();
    let marks = marks(view);
    let mut svg = Svg::new(width);
    let mut entries = legend(view, Swatch::Line);
    let shown = marks.iter();
    entries.extend(
        shown.map(|(class, shape, words, _)| (*class, Swatch::Marker(*shape), words.clone())),
    );
    svg.legend(entries);
    stacked(&mut svg, 230.0, &x, &y, |c, frame| {
        let mut frame = match x.get(c) {
            Some(x) => frame.logarithmic_across(x),
            None => frame,
        };
        for (class, points) in curves.get(c).into_iter().flatten() {
            frame.line(class, points);
        }
        if let Some(y) = y.get(c).map(|y| y.interval) {
            let at = y.high - 0.06 * (y.high - y.low);
            for (class, shape, _, turns) in &marks {
                let points = turns.iter().filter(|t| **t > 0.5 / bins);
                let points: Vec<_> = points.map(|t| ((t * fs).log10(), at)).collect();
                frame.markers(class, *shape, 5.0, &points);
            }
        }
        frame
    });
    svg.figure("Spectrum of the residual",
        "Amplitude of a line relative to a sine at full scale, Hann window; the largest bin of each column of the figure. \
         Marks stand above the frequencies of the tone, of its harmonics (folded at half the sample rate), of power lines \
         and of the lines that a cause took."
            .to_owned(),
    )
}

/// The largest bin of each column over a logarithmic axis: (log10 of the frequency, dBFS).
fn columns(power: &[f64], fs: f64, across: Interval) -> Vec<(f64, f64)> {
    let bins = power.len().saturating_sub(1).max(1) as f64;
    let mut out: Vec<(f64, f64)> = Vec::new();
    let mut column = usize::MAX;
    // Zero frequency and the bin beside it are the window's.
    for (k, power) in power.iter().enumerate().skip(1) {
        let at = (k as f64 * 0.5 * fs / bins).log10();
        let db = (10.0 * power.log10()).max(LEAST_DB);
        let place = (at - across.low) / (across.high - across.low) * COLUMNS as f64;
        let here = place.max(0.0) as usize;
        match out.last_mut().filter(|_| here == column) {
            Some(last) => {
                if db > last.1 {
                    *last = (at, db);
                }
            }
            None => out.push((at, db)),
        }
        column = here;
    }
    out
}
