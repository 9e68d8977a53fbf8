//! Readings without their noise: slopes, means over rows, and how large the noise is.

use crate::statistics::stats;

/// Half widths, in rows, that [`smoothed`] and [`slope`] choose from.
const HALF_WIDTHS: [usize; 7] = [1, 2, 3, 4, 6, 9, 14];

/// Noise of a slope over `k` rows to each side, relative to a reading's and per row.
fn slope_noise(k: usize) -> f64 {
    let k = k as f64;
    (3.0 / (k * (k + 1.0) * (2.0 * k + 1.0))).sqrt()
}

/// Shares of the third differences below which the noise of a reading is looked at, with the share's quantile of a normal
/// deviate's magnitude: where the course bends all the time, its smallest differences are least the course's.
const QUANTILES: [(f64, f64); 2] = [(0.5, 0.674_489_75), (0.2, 0.253_347_1)];

/// Share of the usual noise that is none.
const STILL: f64 = 1e-6;

/// What a parabola through any three of four readings leaves of the fourth, with weights whose squares add up to 1: the third
/// difference, divided by the times (rows that are unevenly spaced make one of a straight line otherwise). `None` where times
/// are repeated.
fn third_difference(time_s: &[f64], values: &[f64]) -> Option<f64> {
    let unit = time_s[3] - time_s[0];
    let mut sum = 0.0;
    let mut squares = 0.0;
    for (i, v) in values.iter().enumerate() {
        let others = (0..values.len()).filter(|j| *j != i);
        let product: f64 = others.map(|j| (time_s[i] - time_s[j]) / unit).product();
        sum += v / product;
        squares += 1.0 / (product * product);
    }
    let difference = sum / squares.sqrt();
    difference.is_finite().then_some(difference)
}

/// White noise of a reading, from its third differences (a smooth course has none).
pub fn reading_noise(time_s: &[f64], values: &[f64]) -> f64 {
    let rows = time_s.windows(4).zip(values.windows(4));
    let mut sizes: Vec<f64> = rows
        .filter_map(|(t, v)| third_difference(t, v))
        .map(f64::abs)
        .collect();
    sizes.sort_by(f64::total_cmp);
    let noise = |(share, deviate): (f64, f64)| {
        let size = sizes.get((share * sizes.len() as f64) as usize)?;
        Some(size / deviate)
    };
    let [most, least] = QUANTILES.map(|q| noise(q).unwrap_or(0.0));
    // A coarse reading stands still in many rows (but for the rounding of its scale), which says nothing of its noise.
    if least > STILL * most {
        most.min(least)
    } else {
        most
    }
}

/// The same from its first differences, of which half may be a course's.
fn first_difference_noise(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let (share, deviate) = QUANTILES[0];
    let middle = (share * sizes.len() as f64) as usize;
    sizes
        .get(middle)
        .map_or(0.0, |s| s / (deviate * 2f64.sqrt()))
}

/// The narrowest half width at which a slope's noise is small beside the slopes themselves.
fn half_width(time_s: &[f64], values: &[f64]) -> usize {
    let noise = reading_noise(time_s, values);
    for k in HALF_WIDTHS {
        let steps: Vec<f64> = (k..values.len().saturating_sub(k))
            .map(|i| (values[i + k] - values[i - k]) / (2 * k) as f64)
            .collect();
        let rms = (steps.iter().map(|s| s * s).sum::<f64>() / steps.len().max(1) as f64).sqrt();
        if noise * slope_noise(k) <= 0.05 * rms {
            return k;
        }
    }
    HALF_WIDTHS[HALF_WIDTHS.len() - 1]
}

/// Of each row, the rows of the stretch around it that has no gap longer than a window of `k` rows to each side: what is
/// beyond such a gap says nothing of a slope here. A lone row's stretch is the record.
fn stretches(time_s: &[f64], k: usize) -> Vec<std::ops::Range<usize>> {
    let n = time_s.len();
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    let longest = steps.get(steps.len() / 2).copied().unwrap_or(0.0) * (2 * k + 2) as f64;
    let mut out = Vec::with_capacity(n);
    let mut start = 0;
    for end in 1..=n {
        if end == n || time_s[end] - time_s[end - 1] > longest {
            let rows = if end - start > 1 { start..end } else { 0..n };
            out.resize(end, rows);
            start = end;
        }
    }
    out
}

/// Local straight line or parabola through `k` rows to each side: (value, slope per second) at each row.
fn local(time_s: &[f64], values: &[f64], k: usize) -> (Vec<f64>, Vec<f64>) {
    let n = values.len();
    let mut out = (Vec::with_capacity(n), Vec::with_capacity(n));
    for (i, stretch) in stretches(time_s, k).into_iter().enumerate() {
        let rows = i.saturating_sub(k).max(stretch.start)..(i + k + 1).min(stretch.end);
        let centre_s = time_s[i];
        let unit = (time_s[rows.end - 1] - time_s[rows.start]).max(f64::MIN_POSITIVE);
        // Normal equations of 1, x, x^2; the parabola only where five rows carry it.
        let mut sums = [0.0f64; 5];
        let mut right = [0.0f64; 3];
        for j in rows.clone() {
            let x = (time_s[j] - centre_s) / unit;
            let powers = [1.0, x, x * x, x * x * x, x * x * x * x];
            for (s, p) in sums.iter_mut().zip(powers) {
                *s += p;
            }
            for (r, p) in right.iter_mut().zip(powers) {
                *r += p * values[j];
            }
        }
        let (value, slope) = solved(sums, right, rows.len() >= 5);
        out.0.push(value);
        out.1.push(slope / unit);
    }
    out
}

/// Value and slope at 0 of the least-squares parabola (or line) with moments `s` and `r`.
fn solved(s: [f64; 5], r: [f64; 3], parabola: bool) -> (f64, f64) {
    let line = || {
        let det = s[0] * s[2] - s[1] * s[1];
        if det.abs() < 1e-12 {
            return (r[0] / s[0], 0.0);
        }
        (
            (r[0] * s[2] - r[1] * s[1]) / det,
            (s[0] * r[1] - s[1] * r[0]) / det,
        )
    };
    if !parabola {
        return line();
    }
    let m = nalgebra::Matrix3::new(s[0], s[1], s[2], s[1], s[2], s[3], s[2], s[3], s[4]);
    match m.try_inverse() {
        Some(inverse) => {
            let b = inverse * nalgebra::Vector3::new(r[0], r[1], r[2]);
            if b.iter().all(|v| v.is_finite()) {
                (b[0], b[1])
            } else {
                line()
            }
        }
        None => line(),
    }
}

/// A column without most of its reading noise: untouched where its noise is small.
pub fn smoothed(time_s: &[f64], values: &[f64]) -> Vec<f64> {
    match half_width(time_s, values) {
        1 => values.to_vec(),
        k => local(time_s, values, k).0,
    }
}

/// Most that a mean over rows may take away, in units of the reading's noise.
const NOISE_ALONE: f64 = 1.1;

/// The mean over as many rows as take away nothing but noise: where temperatures are wanted, not their slopes.
pub fn averaged(time_s: &[f64], values: &[f64]) -> Vec<f64> {
    // In dwells of a few readings most rows differ from the one before by noise alone, and third differences hardly do.
    let still = first_difference_noise(values);
    let third = reading_noise(time_s, values);
    let noise = if still > STILL * third {
        third.min(still)
    } else {
        third
    };
    let mut out = values.to_vec();
    for k in HALF_WIDTHS.into_iter().filter(|k| *k > 1) {
        let mean = local(time_s, values, k).0;
        let away: Vec<f64> = mean.iter().zip(values).map(|(m, v)| v - m).collect();
        if stats::rms(&away) > NOISE_ALONE * noise {
            break;
        }
        out = mean;
    }
    out
}

/// Rate of change, per second, over `rows` rows to each side.
pub fn slope(time_s: &[f64], values: &[f64], rows: usize) -> Vec<f64> {
    local(time_s, values, rows.max(1)).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_does_not_reach_over_a_long_gap() {
        // Falling by 1 a second, an hour off, rising by 2 a second; one row lost within.
        let value = |t: f64| if t < 3000.0 { -t } else { 2.0 * (t - 3600.0) };
        let times = (0..20).chain(3600..3620).filter(|t| *t != 10);
        let rows = times.map(|t| (f64::from(t), value(f64::from(t))));
        let (time_s, values): (Vec<f64>, Vec<f64>) = rows.unzip();
        for rows in [1, 3] {
            for (t, slope) in time_s.iter().zip(slope(&time_s, &values, rows)) {
                let truth = if *t < 3000.0 { -1.0 } else { 2.0 };
                assert!((slope - truth).abs() < 1e-9, "{rows} {t} {slope}");
            }
        }
        // A row alone between gaps has its neighbours.
        let times = [0.0, 1.0, 2.0, 100.0, 200.0, 201.0, 202.0];
        let alone = slope(&times, &[0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0], 1);
        assert!((alone[3] - 0.0101).abs() < 1e-3, "{}", alone[3]);
    }
}
