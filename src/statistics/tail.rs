//! The upper tail of a sampled maximum: small probabilities from few draws.
//!
//! Above a high threshold the excess of any smooth distribution follows a generalised Pareto
//! distribution (Pickands 1975); fitted to the excesses it gives probabilities below one over the number of
//! draws (Knijnenburg et al. 2009, for permutation tests).

/// Bounds of the shape parameter. Statistics here are minus the logarithm of a probability, whose
/// tail is exponential (shape 0); a lower one would invent an end of the distribution, a higher one is
/// allowed in part, towards larger probabilities.
const SHAPE: (f64, f64) = (0.0, 0.3);

/// A sampled distribution with a fitted tail.
#[derive(Debug, Clone, PartialEq)]
pub struct Tail {
    /// The sample, ascending.
    sorted: Vec<f64>,
    /// Where the tail begins.
    threshold: f64,
    /// Share of the sample beyond.
    share: f64,
    /// Scale and shape of the excess.
    scale: f64,
    shape: f64,
}

impl Tail {
    /// From a sample (at least one number; not finite ones are dropped). The tail is its upper quarter.
    pub fn new(sample: Vec<f64>) -> Self {
        let mut sorted: Vec<f64> = sample.into_iter().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let beyond = n / 4;
        let start = n - beyond;
        let threshold = start.checked_sub(1).and_then(|i| sorted.get(i)).copied();
        let threshold = threshold.unwrap_or(0.0);
        let excess: Vec<f64> = sorted.iter().skip(start).map(|v| v - threshold).collect();
        let (scale, shape) = pareto(&excess);
        Tail {
            share: beyond as f64 / n.max(1) as f64,
            sorted,
            threshold,
            scale,
            shape,
        }
    }

    /// The probability of a number at least `value`: never 0. Of the sample itself it counts
    /// (r + 1) / (n + 1).
    pub fn survival(&self, value: f64) -> f64 {
        if !value.is_finite() {
            return if value > 0.0 { 0.0 } else { 1.0 };
        }
        if value > self.threshold && self.scale > 0.0 {
            let excess = (value - self.threshold) / self.scale;
            let beyond = if self.shape > 1e-6 {
                (1.0 + self.shape * excess).powf(-1.0 / self.shape)
            } else {
                (-excess).exp()
            };
            return (self.share * beyond).max(f64::MIN_POSITIVE);
        }
        let n = self.sorted.len();
        let below = self.sorted.partition_point(|v| *v < value);
        (n - below + 1) as f64 / (n + 1) as f64
    }
}

/// Scale and shape by probability-weighted moments (Hosking & Wallis 1987), the shape bounded.
fn pareto(ascending: &[f64]) -> (f64, f64) {
    let n = ascending.len();
    let mean = ascending.iter().sum::<f64>() / n.max(1) as f64;
    if n < 8 {
        return (mean, 0.0);
    }
    let weighted = ascending
        .iter()
        .enumerate()
        .map(|(i, x)| (n - 1 - i) as f64 / (n - 1) as f64 * x)
        .sum::<f64>()
        / n as f64;
    let shape = 2.0 - mean / (mean - 2.0 * weighted);
    let shape = if shape.is_finite() { shape } else { SHAPE.1 };
    let shape = shape.clamp(SHAPE.0, SHAPE.1);
    (mean * (1.0 - shape), shape)
}

/// Minus the natural logarithm of the probability that chi-square with `degrees` degrees of freedom
/// (1 or more) exceeds `x`; without underflow for large `x`.
pub fn chi_square_surprise(degrees: usize, x: f64) -> f64 {
    if x <= 0.0 || x.is_nan() {
        return 0.0;
    }
    let half = 0.5 * x;
    // Sum of the finite series over exp(-half), starting from one or two degrees of freedom.
    let (mut sum, mut term, mut at) = if degrees.is_multiple_of(2) {
        (1.0, 1.0, 2)
    } else {
        (
            scaled_erfc(half.sqrt()),
            (half / std::f64::consts::PI).sqrt() * 2.0,
            1,
        )
    };
    while at + 2 <= degrees {
        if at > 1 {
            term *= half / (at as f64 / 2.0);
        }
        sum += term;
        at += 2;
    }
    half - sum.ln()
}

/// exp(x^2) erfc(x) for x >= 0.
fn scaled_erfc(x: f64) -> f64 {
    let (t, exponent) = erfc_parts(x);
    t * exponent.exp()
}

/// Factor t and exponent e of erfc(x) = t exp(e - x^2) for x >= 0: the rational approximation of Numerical
/// Recipes (relative error below 1.2e-7). Apart, as what follows differs in the last bits by where -x^2 is
/// added.
pub fn erfc_parts(x: f64) -> (f64, f64) {
    let t = 1.0 / (1.0 + 0.5 * x);
    let poly = [
        -1.265_512_23,
        1.000_023_68,
        0.374_091_96,
        0.096_784_18,
        -0.186_288_06,
        0.278_868_07,
        -1.135_203_98,
        1.488_515_87,
        -0.822_152_23,
        0.170_872_77,
    ];
    (t, poly.iter().rev().fold(0.0, |s, c| s * t + c))
}

#[cfg(test)]
mod tests {
    use super::super::random::Stream;
    use super::*;

    #[test]
    fn surprises_are_those_of_tables() {
        for (degrees, x, p) in [
            (1, 3.841_459, 0.05),
            (1, 10.827_57, 0.001),
            (2, 5.991_465, 0.05),
            (3, 7.814_728, 0.05),
            (3, 16.266_24, 0.001),
            (4, 9.487_729, 0.05),
            (5, 11.070_50, 0.05),
            (6, 12.591_59, 0.05),
            (7, 14.067_14, 0.05),
        ] {
            let found = (-chi_square_surprise(degrees, x)).exp();
            assert!((found / p - 1.0f64).abs() < 1e-5, "{degrees} {x}: {found}");
        }
        assert!((chi_square_surprise(1, 3000.0) - 1504.2).abs() < 0.5);
        assert_eq!(chi_square_surprise(3, 0.0), 0.0);
    }

    #[test]
    fn the_tail_of_a_known_distribution_is_found_beyond_the_sample() {
        // Minus the logarithm of a uniform: exp(-u), at one in a million from 2000 draws.
        let mut worst: f64 = 0.0;
        for seed in 0..50 {
            let stream = Stream::new(seed, 3);
            let tail = Tail::new((0..2000).map(|k| -stream.uniform(k).ln()).collect());
            assert!((tail.survival(1.0) - 0.368).abs() < 0.05);
            let found = tail.survival(1e6f64.ln()) / 1e-6;
            // Never far too small; the bound on the shape leaves it too large at times.
            assert!(found > 0.1, "{found}");
            worst = worst.max(found);
        }
        assert!(worst < 500.0, "{worst}");
        assert_eq!(Tail::new(vec![1.0; 3]).survival(0.5), 1.0);
    }
}
