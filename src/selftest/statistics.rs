//! What counts of hits and misses say.

/// Slopes of the logistic curve that are tried: width of a tenth to nine tenths, in e-folds of size.
const WIDTHS: [f64; 6] = [0.15, 0.25, 0.4, 0.6, 0.9, 1.3];

/// Steps of the curve's middle per e-fold of size.
const PER_EFOLD: f64 = 50.0;

/// Probability of at most `hits` of `trials` at probability `p` each.
pub fn binomial_at_most(hits: usize, trials: usize, p: f64) -> f64 {
    if hits >= trials || p <= 0.0 {
        return 1.0;
    }
    if p >= 1.0 {
        return 0.0;
    }
    let mut ln_term = trials as f64 * (-p).ln_1p();
    let mut sum = ln_term.exp();
    for k in 0..hits {
        ln_term += ((trials - k) as f64 / (k + 1) as f64).ln() + (p / (1.0 - p)).ln();
        sum += ln_term.exp();
    }
    sum.min(1.0)
}

/// One-sided 95 % upper limit of a probability of which `hits` of `trials` were seen (Clopper & Pearson
/// 1934); 1 without trials.
pub fn upper_limit_95(hits: usize, trials: usize) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    if hits >= trials {
        return 1.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if binomial_at_most(hits, trials, middle) > 0.05 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Probability of `hits` or more of `trials` at probability `p` each.
pub fn binomial_at_least(hits: usize, trials: usize, p: f64) -> f64 {
    match hits.checked_sub(1) {
        Some(below) => 1.0 - binomial_at_most(below, trials, p),
        None => 1.0,
    }
}

/// The size at which nine tenths are detected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Limit {
    /// It is this.
    At(f64),
    /// Below the smallest size that was tried.
    Below(f64),
    /// Above the largest.
    Above(f64),
}

/// The size that is detected with a probability of 0.9, from (size, records, detected): a logistic curve
/// in the logarithm of the size, by maximum likelihood over a grid of middles and widths (of equal ones
/// the mean; where no size lies between none and all, the widths do not matter much).
pub fn detected_from(counts: &[(f64, usize, usize)]) -> Option<Limit> {
    let tried: Vec<_> = counts.iter().filter(|c| c.1 > 0).collect();
    let smallest = tried.iter().map(|c| c.0).fold(f64::INFINITY, f64::min);
    let largest = tried.iter().map(|c| c.0).fold(0.0, f64::max);
    if !(smallest > 0.0 && largest.is_finite()) || tried.is_empty() {
        return None;
    }
    let (from, to) = (smallest.ln() - 1.5, largest.ln() + 1.5);
    let steps = ((to - from) * PER_EFOLD).ceil() as usize;
    let mut best = (f64::NEG_INFINITY, 0.0, 0.0);
    let mut weights: Vec<(f64, f64)> = Vec::new();
    for width in WIDTHS {
        for k in 0..=steps {
            let middle = from + k as f64 / PER_EFOLD;
            let likelihood: f64 = tried
                .iter()
                .map(|(size, records, hits)| {
                    let x = (size.ln() - middle) / (width / 4.394);
                    let (yes, no) = (-(-x).exp().ln_1p(), -x.exp().ln_1p());
                    *hits as f64 * yes + (records - hits) as f64 * no
                })
                .sum();
            let ninety = middle + 0.5 * width;
            weights.push((likelihood, ninety));
            if likelihood > best.0 {
                best = (likelihood, middle, width);
            }
        }
    }
    // The mean of the logarithm under the likelihood, the prior being flat over the grid.
    let total: f64 = weights.iter().map(|w| (w.0 - best.0).exp()).sum();
    let mean: f64 = weights
        .iter()
        .map(|w| (w.0 - best.0).exp() * w.1)
        .sum::<f64>()
        / total;
    let size = mean.exp();
    Some(if size > largest {
        Limit::Above(largest)
    } else if size < smallest {
        Limit::Below(smallest)
    } else {
        Limit::At(size)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_those_of_the_tables() {
        // Clopper & Pearson: 0 of 60, 1 of 100, 3 of 300.
        assert!((upper_limit_95(0, 60) - 0.048_70).abs() < 1e-4);
        assert!((upper_limit_95(1, 100) - 0.046_56).abs() < 1e-4);
        assert!((upper_limit_95(3, 300) - 0.025_63).abs() < 1e-4);
        assert_eq!(upper_limit_95(0, 0), 1.0);
        assert_eq!(upper_limit_95(5, 5), 1.0);
        assert!((binomial_at_least(2, 60, 0.01) - 0.121_2).abs() < 1e-3);
        assert_eq!(binomial_at_least(0, 60, 0.01), 1.0);
    }

    #[test]
    fn the_detected_size_lies_where_the_counts_turn() {
        let turns = [(0.5, 8, 0), (1.0, 8, 2), (2.0, 8, 8), (5.0, 8, 8)];
        let Some(Limit::At(size)) = detected_from(&turns) else {
            panic!("{:?}", detected_from(&turns));
        };
        assert!((1.2..2.0).contains(&size), "{size}");
        let never = [(0.5, 4, 0), (1.0, 4, 0), (10.0, 4, 1)];
        assert_eq!(detected_from(&never), Some(Limit::Above(10.0)));
        let always = [(0.5, 40, 40), (1.0, 40, 40), (10.0, 40, 40)];
        assert_eq!(detected_from(&always), Some(Limit::Below(0.5)));
        assert_eq!(detected_from(&[(1.0, 0, 0)]), None);
    }
}
