//! Allan deviation of a residual: which noise it holds at which averaging time.

use super::figures::series;
use super::view::View;
use crate::report::axis::{Axis, Interval};
use crate::report::figure::{Figure, one};
use crate::report::svg::{Shape, Svg, Swatch};
use crate::report::text::significant;

/// Steps of rows that count as one: longer ones cut the record.
const GAP: f64 = 1.5;
/// Averaging times per decade.
const PER_DECADE: f64 = 10.0;
/// Fewer averaging times make no curve.
const FEWEST: usize = 4;
/// Flat Allan deviation of 1/f noise over its bias instability B (IEEE Std 952): sqrt(2 ln 2 / pi).
const FLAT_PER_INSTABILITY: f64 = 0.664_28;
/// Decades of the averaging time beside which a curve of the model is no longer drawn below the data.
const BELOW: f64 = 0.5;

/// Overlapping Allan deviation (IEEE Std 952, annex C): (averaging time in s, deviation in the unit of
/// the values), from one row up to a quarter of the rows.
///
/// Rows without a value and steps in time of more than one and a half `period_s` cut the record; pairs
/// of means never reach over a cut. Averaging times with fewer than four such pairs are left out.
pub fn deviation(time_s: &[f64], values: &[f64], period_s: f64) -> Vec<(f64, f64)> {
    let pieces = sums(time_s, values, period_s);
    let longest = pieces.iter().map(|p| p.len() - 1).max().unwrap_or(0);
    let mut out = Vec::new();
    let mut last = 0;
    for k in 0.. {
        let rows = 10f64.powf(f64::from(k) / PER_DECADE).round() as usize;
        if 4 * rows > longest {
            break;
        }
        if rows == last {
            continue;
        }
        last = rows;
        let (mut sum, mut pairs) = (0.0, 0usize);
        for piece in &pieces {
            for w in piece.windows(2 * rows + 1) {
                // Sum of the later rows less sum of the earlier ones.
                let step = (w[2 * rows] - 2.0 * w[rows] + w[0]) / rows as f64;
                sum += step * step;
                pairs += 1;
            }
        }
        if pairs >= 4 {
            let variance = sum / (2.0 * pairs as f64);
            out.push((rows as f64 * period_s, variance.sqrt()));
        }
    }
    out
}

/// The figure, both axes logarithmic, with the parts of the noise model and their slopes; where the record has too few
/// rows without a gap, a sentence that says so.
///
/// # Errors
/// That sentence.
pub fn figure(view: &View) -> Result<Figure, String> {
    let c = &view.closed.channels;
    let period_s = c.period_s();
    let curves: Vec<(&str, Vec<(f64, f64)>)> = series(view)
        .into_iter()
        .map(|(_, class, values)| (class, deviation(&c.time_s, values, period_s)))
        .collect();
    if curves.iter().any(|(_, points)| points.len() < FEWEST) {
        let pieces = sums(&c.time_s, &view.after, period_s);
        let longest = pieces.iter().map(|p| p.len() - 1).max().unwrap_or(0);
        return Err(format!(
            "There is no Allan deviation of this record. It needs rows in a steady step, and the longest stretch without a gap \
             has {longest} ({} s a row). Sixty rows without a gap are enough to see one decade of averaging times.",
            significant(period_s, 3)
        ));
    }
    Ok(one(|width| drawn(view, &curves, period_s, width)))
}

/// Logarithms of what has one.
fn logs(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let positive = points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0);
    positive.map(|p| (p.0.log10(), p.1.log10())).collect()
}

/// Shares of the frame within which two labels would touch: the height of a line of text, and what two texts take of the width of a
/// telephone (convention).
const LABEL_HEIGHT_SHARE: f64 = 0.08;
const LABEL_WIDTH_SHARE: f64 = 0.9;

/// How far along an axis a value lies, as a share of it.
fn share(axis: &Axis, value: f64) -> f64 {
    (value - axis.interval.low) / (axis.interval.high - axis.interval.low)
}

/// Whether labels at two places would touch.
fn touch(one: &(f64, f64), other: &(f64, f64), [x, y]: [&Axis; 2]) -> bool {
    let apart = |axis: &Axis, a: f64, b: f64| (share(axis, a) - share(axis, b)).abs();
    apart(x, one.0, other.0) < LABEL_WIDTH_SHARE && apart(y, one.1, other.1) < LABEL_HEIGHT_SHARE
}

fn drawn(view: &View, curves: &[(&str, Vec<(f64, f64)>)], period_s: f64, width: f64) -> Figure {
    let noise = &view.closed.after.fit.noise;
    let taus: Vec<f64> = curves
        .first()
        .map_or(Vec::new(), |c| c.1.iter().map(|p| p.0).collect());
    let flat = FLAT_PER_INSTABILITY * noise.bias_instability_dps();
    let parts: [(&str, &dyn Fn(f64) -> f64); 3] = [
        ("white noise, slope −½", &|t| {
            noise.white_rms_dps * (period_s / t).sqrt()
        }),
        ("1/f noise, level", &|_| flat),
        ("random walk, slope +½", &|t| {
            noise.walk_dps_rts * (t / 3.0).sqrt()
        }),
    ];
    let data: Vec<(&str, Vec<(f64, f64)>)> = curves.iter().map(|c| (c.0, logs(&c.1))).collect();
    let least = data
        .iter()
        .flat_map(|d| &d.1)
        .map(|p| p.1)
        .fold(f64::INFINITY, f64::min);
    let parts = parts.map(|(words, of)| {
        let line: Vec<(f64, f64)> = taus.iter().map(|t| (*t, of(*t))).collect();
        let mut line = logs(&line);
        line.retain(|p| p.1 >= least - BELOW);
        (words, line)
    });
    let all = || data.iter().flat_map(|d| &d.1);
    let axis = |interval: Interval, quantity: &str, unit: &str| Axis {
        interval: interval.padded(0.04),
        quantity: quantity.to_owned(),
        unit: unit.to_owned(),
    };
    let x = axis(Interval::of(all().map(|p| p.0)), "averaging time", "s");
    let up = all().chain(parts.iter().flat_map(|p| &p.1)).map(|p| p.1);
    let y = axis(
        Interval::of(up),
        "Allan deviation",
        view.closed.closure.unit,
    );
    let mut svg = Svg::new(width);
    let words = |class: &str| match (class, view.has_steps()) {
        ("before", _) => "polynomial alone",
        (_, true) => "with the causes",
        _ => "less the polynomial",
    };
    svg.legend(
        data.iter()
            .map(|d| (d.0, Swatch::Line, words(d.0).to_owned())),
    );
    svg.legend([(
        "bound",
        Swatch::Line,
        "parts of the fitted noise".to_owned(),
    )]);
    let mut frame = svg
        .frame(300.0, 78.0, x.clone(), y.clone())
        .logarithmic(&x, &y);
    let mut labelled: Vec<(f64, f64)> = Vec::new();
    for (words, line) in &parts {
        frame.line("bound", line);
        let ends = [line.last(), line.first()].into_iter().flatten();
        let mut free = ends.filter(|end| !labelled.iter().any(|l| touch(l, end, [&x, &y])));
        if let (Some(&(at, level)), true) = (free.next(), line.len() > 1) {
            let anchor = if share(&x, at) > 0.6 { "end" } else { "start" };
            frame.note("slope", (at, level), anchor, words);
            labelled.push((at, level));
        }
    }
    for (class, points) in &data {
        frame.line(class, points);
        frame.markers(class, Shape::Circle, 2.6, points);
    }
    svg.add(&frame);
    svg.figure(
        "Allan deviation of the residual",
        format!(
            "Overlapping, over pieces without gaps; one row is {} s. White noise falls by the root of the averaging time, 1/f noise \
             is level, a walk or an effect that is left rises.",
            significant(period_s, 3)
        ),
    )
}

/// Running sums of each unbroken piece, one more than it has rows.
fn sums(time_s: &[f64], values: &[f64], period_s: f64) -> Vec<Vec<f64>> {
    let mut pieces: Vec<Vec<f64>> = Vec::new();
    let mut current = vec![0.0];
    let mut before = f64::NAN;
    for (t, v) in time_s.iter().zip(values) {
        if (!v.is_finite() || t - before > GAP * period_s) && current.len() > 1 {
            pieces.push(std::mem::replace(&mut current, vec![0.0]));
        }
        before = *t;
        if let (true, Some(sum)) = (v.is_finite(), current.last().copied()) {
            current.push(sum + v);
        }
    }
    if current.len() > 1 {
        pieces.push(current);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the definition: means of neighbouring stretches, one pair after another.
    fn by_hand(values: &[f64], m: usize) -> f64 {
        let mean = |s: &[f64]| s.iter().sum::<f64>() / s.len() as f64;
        let pairs: Vec<f64> = (0..=values.len() - 2 * m)
            .map(|i| (mean(&values[i + m..i + 2 * m]) - mean(&values[i..i + m])).powi(2))
            .collect();
        (0.5 * mean(&pairs)).sqrt()
    }

    #[test]
    fn it_is_the_definition_and_never_reaches_over_a_gap() {
        let values: Vec<f64> = (0..200)
            .map(|i| f64::from((i * i * 37 + i * 11) % 101) / 50.0)
            .collect();
        let times: Vec<f64> = (0..200).map(|i| 2.5 * f64::from(i)).collect();
        let found = deviation(&times, &values, 2.5);
        assert_eq!(found.first().map(|p| p.0), Some(2.5));
        assert_eq!(found.last().map(|p| p.0), Some(125.0));
        for (tau, value) in &found {
            let expected = by_hand(&values, (tau / 2.5).round() as usize);
            assert!((value / expected - 1.0).abs() < 1e-9, "{tau}: {value}");
        }
        // A jump of level in a gap, or at a row without a value, does not show.
        let jumped: Vec<f64> = (0..200).map(|i| f64::from(i / 100) * 1e6).collect();
        let late: Vec<f64> = (0..200)
            .map(|i| 2.5 * f64::from(i) + f64::from(i / 100) * 500.0)
            .collect();
        assert!(deviation(&late, &jumped, 2.5).iter().all(|p| p.1 == 0.0));
        let mut holed = jumped.clone();
        holed[100] = f64::NAN;
        assert!(deviation(&times, &holed, 2.5).iter().all(|p| p.1 == 0.0));
        assert!(deviation(&times, &jumped, 2.5).iter().any(|p| p.1 > 1e4));
        assert!(deviation(&[], &[], 1.0).is_empty());
    }
}
