//! Allan deviation of a residual: which noise it holds at which averaging time.

/// Steps of rows that count as one: longer ones cut the record.
const GAP: f64 = 1.5;
/// Averaging times per decade.
const PER_DECADE: f64 = 10.0;

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
