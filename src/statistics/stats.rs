//! Robust statistics of plain slices. NaN (not measured) is skipped; of nothing they are NaN.

/// 1 / (the third quartile of the standard normal): makes a median absolute deviation an
/// estimate of the standard deviation of normal data.
pub const MAD_TO_STD: f64 = 1.482_602_218_505_602;

/// The measured values, ascending.
pub fn sorted(values: &[f64]) -> Vec<f64> {
    let mut v = measured(values);
    v.sort_unstable_by(f64::total_cmp);
    v
}

/// The `p`-quantile (0..=1) of ascending values, linear between order statistics.
pub fn quantile_sorted(v: &[f64], p: f64) -> f64 {
    let Some(last) = v.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = p.clamp(0.0, 1.0) * last as f64;
    let low = at.floor() as usize;
    let high = (low + 1).min(last);
    let part = at - low as f64;
    if part == 0.0 {
        v[low]
    } else {
        v[low] * (1.0 - part) + v[high] * part
    }
}

/// The median.
pub fn median(values: &[f64]) -> f64 {
    median_of(&mut measured(values))
}

fn measured(values: &[f64]) -> Vec<f64> {
    // At once: grown by doubling, a long record would take up to half as much again.
    let mut out = Vec::with_capacity(values.len());
    out.extend(values.iter().copied().filter(|x| !x.is_nan()));
    out
}

/// The median of measured values, which are put in another order: a long record is not copied again.
fn median_of(v: &mut [f64]) -> f64 {
    let Some(last) = v.len().checked_sub(1) else {
        return f64::NAN;
    };
    let (_, low, above) = v.select_nth_unstable_by(last / 2, f64::total_cmp);
    let low = *low;
    match last % 2 {
        0 => low,
        _ => 0.5 * low + 0.5 * above.iter().copied().fold(f64::INFINITY, f64::min),
    }
}

/// Median absolute deviation about the median, scaled to a standard deviation; 0 where more than
/// half of the values are the same.
pub fn mad_std(values: &[f64]) -> f64 {
    let mut v = measured(values);
    let centre = median_of(&mut v);
    v.iter_mut().for_each(|v| *v = (*v - centre).abs());
    // Of infinities.
    v.retain(|v| !v.is_nan());
    MAD_TO_STD * median_of(&mut v)
}

/// As [`mad_std`], but where more than half of the values are the same (a coarse quantiser) the
/// median of the deviations that are not zero; 0 only for constants.
pub fn robust_std(values: &[f64]) -> f64 {
    let s = mad_std(values);
    if s > 0.0 || s.is_nan() {
        return s;
    }
    let centre = median(values);
    let moved: Vec<f64> = values
        .iter()
        .map(|v| (v - centre).abs())
        .filter(|d| *d > 0.0)
        .collect();
    if moved.is_empty() {
        0.0
    } else {
        MAD_TO_STD * median(&moved)
    }
}

/// Root of the mean square of the measured values.
pub fn rms(values: &[f64]) -> f64 {
    let (sum, n) = values
        .iter()
        .filter(|v| !v.is_nan())
        .fold((0.0, 0usize), |(s, n), v| (s + v * v, n + 1));
    if n == 0 {
        f64::NAN
    } else {
        (sum / n as f64).sqrt()
    }
}

/// (least, greatest) of the measured values.
pub fn extremes(values: &[f64]) -> Option<(f64, f64)> {
    values
        .iter()
        .filter(|v| !v.is_nan())
        .fold(None, |range, &v| match range {
            None => Some((v, v)),
            Some((low, high)) => Some((f64::min(low, v), f64::max(high, v))),
        })
}

/// Noise of a slowly varying series: the standard deviation of its first differences / sqrt(2),
/// differences further than five robust standard deviations from their median left out.
///
/// White noise gives its own standard deviation; noise with memory gives less (an AR(1) with
/// coefficient r: sqrt(1 - r) of it); a trend gives nothing. Same unit as the values.
pub fn difference_noise(values: &[f64]) -> f64 {
    // In place: a long record is not copied twice.
    let mut differences = measured(values);
    for k in 1..differences.len() {
        differences[k - 1] = differences[k] - differences[k - 1];
    }
    differences.pop();
    if differences.is_empty() {
        return f64::NAN;
    }
    let centre = median(&differences);
    let limit = 5.0 * robust_std(&differences);
    differences.iter_mut().for_each(|d| *d -= centre);
    differences.retain(|d| d.abs() <= limit);
    rms(&differences) / std::f64::consts::SQRT_2
}

/// As [`difference_noise`], from second differences / sqrt(6): blind to a slope that changes
/// slowly or seldom, for series such as a thermometer's under ramps and steps.
pub fn curvature_noise(values: &[f64]) -> f64 {
    // In place: a long record is not copied twice.
    let mut bends = measured(values);
    for k in 2..bends.len() {
        bends[k - 2] = bends[k - 2] - 2.0 * bends[k - 1] + bends[k];
    }
    bends.truncate(bends.len().saturating_sub(2));
    if bends.is_empty() {
        return f64::NAN;
    }
    let limit = 5.0 * mad_std(&bends);
    bends.retain(|d| d.abs() <= limit);
    rms(&bends) / 6f64.sqrt()
}

/// The step of a quantised channel: the smallest distance between two different values, if the
/// values lie on a lattice of that step; `None` for continuous values and constants.
pub fn lattice_step(values: &[f64]) -> Option<f64> {
    let mut distinct = sorted(values);
    let largest = distinct.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    distinct.dedup_by(|a, b| (*a - *b).abs() <= 1e-9 * largest);
    let step = distinct
        .windows(2)
        .map(|w| w[1] - w[0])
        .fold(f64::INFINITY, f64::min);
    if !step.is_finite() || distinct.len() < 2 {
        return None;
    }
    let first = distinct[0];
    let on = distinct
        .iter()
        .filter(|v| {
            let k = (**v - first) / step;
            (k - k.round()).abs() < 0.02 + 1e-9 * largest / step
        })
        .count();
    (on as f64 >= 0.98 * distinct.len() as f64).then_some(step)
}

/// Share of the distances of even levels that are whole numbers of their step: a few levels may be odd (convention).
const ON_GRID_SHARE: f64 = 0.8;

/// The step of ascending levels that lie evenly, but for a few: the lower quartile of their distances. `None` where they do not.
pub fn even_step(levels: &[f64]) -> Option<f64> {
    let mut gaps: Vec<f64> = levels.windows(2).map(|w| w[1] - w[0]).collect();
    gaps.sort_by(f64::total_cmp);
    let step = *gaps.get(gaps.len() / 4)?;
    let whole = |g: &&f64| {
        let steps = **g / step;
        (steps - steps.round()).abs() < 0.05 && steps.round() >= 1.0
    };
    let on_grid = gaps.iter().filter(whole).count();
    (step > 0.0 && on_grid as f64 >= ON_GRID_SHARE * gaps.len() as f64).then_some(step)
}

/// How many different values were measured.
pub fn distinct(values: &[f64]) -> usize {
    let mut v = sorted(values);
    v.dedup();
    v.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_noise_of_known_series() {
        assert_eq!(median(&[3.0, f64::NAN, 1.0, 2.0]), 2.0);
        assert!(median(&[]).is_nan());
        assert_eq!(mad_std(&[1.0, 1.0, 1.0, 9.0]), 0.0);
        assert!(robust_std(&[1.0, 1.0, 1.0, 9.0]) > 8.0);
        // A trend is no noise; an alternation of +-1 has differences of +-2.
        let trend: Vec<f64> = (0..50).map(f64::from).collect();
        assert_eq!(difference_noise(&trend), 0.0);
        let alternating: Vec<f64> = (0..51).map(|k| f64::from(k % 2) * 2.0 - 1.0).collect();
        assert!((difference_noise(&alternating) - 2f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_lattice_is_told_from_a_continuum() {
        let whole: Vec<f64> = (0..100).map(|k| f64::from(20 + (k / 7) % 11)).collect();
        assert_eq!(lattice_step(&whole), Some(1.0));
        let tenths: Vec<f64> = (0..300).map(|k| f64::from(k) / 10.0 + 22.8).collect();
        assert!((lattice_step(&tenths).unwrap() - 0.1).abs() < 1e-9);
        let continuous: Vec<f64> = (0..100).map(|k| (f64::from(k) * 0.7).sin()).collect();
        assert_eq!(lattice_step(&continuous), None);
        assert_eq!(lattice_step(&[1.0, 1.0]), None);
    }
}
