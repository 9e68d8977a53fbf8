//! Rising against falling thermometer: the loop that no function of the reading can follow.

use crate::numeric::polynomial;
use crate::statistics::correlation::{NoiseModel, Rows};
use crate::statistics::folds::Sample;
use crate::statistics::weights::{BINS, Bins};

/// Which way the thermometer goes on its way through the record: +1 rising, -1 falling, 0 where
/// it never turns out to move by `threshold` (its unit).
///
/// Turning points are those after which the reading comes back by more than `threshold`; dwells
/// and noise below it belong to the sweep that they interrupt. `t` is in order of time.
pub fn directions(t: &[f64], threshold: f64) -> Vec<i8> {
    let mut out = vec![0; t.len()];
    let Some(first) = t.first() else {
        return out;
    };
    let (mut low, mut high) = ((0, *first), (0, *first));
    let mut direction = 0i8;
    let mut start = 0;
    for (i, &value) in t.iter().enumerate() {
        if value > high.1 {
            high = (i, value);
        }
        if value < low.1 {
            low = (i, value);
        }
        let turned = match direction {
            0 if value - low.1 > threshold => {
                direction = 1;
                high = (i, value);
                continue;
            }
            0 if high.1 - value > threshold => {
                direction = -1;
                low = (i, value);
                continue;
            }
            1 if high.1 - value > threshold => high.0,
            -1 if value - low.1 > threshold => low.0,
            _ => continue,
        };
        out[start..=turned].fill(direction);
        start = turned + 1;
        direction = -direction;
        (low, high) = ((i, value), (i, value));
    }
    out[start..].fill(direction);
    out
}

/// How many of the thermometer's bins rising and falling sweeps visit.
pub fn places(t: &[f64], bins: Bins, directions: &[i8]) -> (usize, usize) {
    let visited = |way: i8| {
        let mut seen = [false; BINS];
        for (t, _) in t.iter().zip(directions).filter(|(_, d)| **d == way) {
            seen[bins.index(*t)] = true;
        }
        seen.iter().filter(|s| **s).count()
    };
    (visited(1), visited(-1))
}

/// The loop between rising and falling sweeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loop {
    /// Root mean square, over the thermometer's bins that both directions visit, of the
    /// difference between their mean residuals, deg/s.
    pub rms_dps: f64,
    /// What chance would be expected to give, with residuals of the rms and autocorrelation that the fit and the loop leave, deg/s.
    pub noise_dps: f64,
    /// How many bins were compared.
    pub bins: usize,
    /// How many independent rows the record is worth, by the autocorrelation of what the fit and the loop leave.
    pub effective_rows: f64,
    /// The test's statistic: an F (Wald statistic over its degrees of freedom), as a standard
    /// normal.
    pub z: f64,
    /// True if that is more than [`LOOP_LIMIT`].
    pub significant: bool,
}

impl Loop {
    /// True for a difference that is larger than chance and than a single reading's noise, deg/s rms, but not significant:
    /// this record cannot tell a loop from slow noise.
    pub fn is_undecided(&self, noise_floor_rms_dps: f64) -> bool {
        !self.significant && self.rms_dps > noise_floor_rms_dps.max(self.noise_dps)
    }

    /// What the test says, in words; `noise_floor_rms_dps` is a single reading's noise, deg/s rms.
    pub fn finding(&self, noise_floor_rms_dps: f64) -> &'static str {
        match (self.significant, self.is_undecided(noise_floor_rms_dps)) {
            (true, _) => "significant",
            (false, true) => {
                "larger than chance, but this record cannot tell a loop from slow noise (see the warning); try `gyrogen close`"
            }
            (false, false) => "not significant",
        }
    }
}

/// Most terms of the loop that is tested (convention).
const MOST_TERMS: usize = 6;

/// Far out, because the memory of the noise is itself an estimate.
pub const LOOP_LIMIT: f64 = 4.0;

/// A standard normal with the same tail as `f`, an F with `k` and `v` degrees of freedom
/// (Paulson 1942).
fn normal_of_f(f: f64, k: f64, v: f64) -> f64 {
    let (a, b) = (2.0 / (9.0 * k), 2.0 / (9.0 * v));
    let root = f.max(0.0).cbrt();
    ((1.0 - b) * root - (1.0 - a)) / (b * root * root + a).sqrt()
}

/// Measures the loop; `None` if fewer than four bins hold at least three clean rows of each
/// direction.
///
/// `sample` holds the rows, `residuals` are those of the fit of order `order`, `directions` come
/// from [`directions`]. The figure is taken from bins, so it does not depend on the loop's
/// shape. The test takes a loop that is a polynomial in the reading, added on the way up and taken off
/// on the way down, beside the fitted one: what that leaves is the noise, its memory included. Its
/// order is the highest, 5 at most, that leaves the noise as many degrees of freedom as there are
/// coefficients. Noise that wanders over a whole sweep (rate random walk) cannot be told
/// from a loop by one pair of sweeps.
pub fn measure_loop(
    sample: &Sample,
    residuals: &[f64],
    order: usize,
    directions: &[i8],
) -> Option<Loop> {
    let mut sums = [[(0.0, 0usize); 2]; BINS];
    for (i, way) in directions.iter().enumerate() {
        if *way != 0 && sample.spike[i] >= 0.5 {
            let cell = &mut sums[sample.bins.index(sample.t[i])][usize::from(*way < 0)];
            cell.0 += residuals[i];
            cell.1 += 1;
        }
    }
    let compared: Vec<_> = sums
        .iter()
        .filter(|[up, down]| up.1 >= 3 && down.1 >= 3)
        .collect();
    if compared.len() < 4 {
        return None;
    }
    let mut freedom = (compared.len() / 2).min(MOST_TERMS);
    let mut tested = test(sample, residuals, order, directions, freedom)?;
    while freedom > 2 && !tested.is_judged_by_enough() {
        freedom -= 1;
        tested = test(sample, residuals, order, directions, freedom)?;
    }
    let (mut square, mut expected) = (0.0, 0.0);
    for [(up, nu), (down, nd)] in &compared {
        square += (up / *nu as f64 - down / *nd as f64).powi(2);
        expected += tested.noise.variance_of_mean(*nu) + tested.noise.variance_of_mean(*nd);
    }
    let n = compared.len() as f64;
    Some(Loop {
        rms_dps: (square / n).sqrt(),
        noise_dps: (expected / n).sqrt(),
        bins: compared.len(),
        effective_rows: tested.noise.effective_rows,
        z: tested.z,
        significant: tested.z > LOOP_LIMIT,
    })
}

/// A loop of so many terms, fitted beside the polynomial.
struct Tested {
    /// Of what both leave.
    noise: NoiseModel,
    /// Coefficients of both.
    coefficients: usize,
    /// [`Loop::z`].
    z: f64,
}

impl Tested {
    /// Whether the noise keeps at least as many degrees of freedom as were fitted: with one or two left, no F is significant.
    fn is_judged_by_enough(&self) -> bool {
        self.noise.effective_rows >= 2.0 * self.coefficients as f64
    }
}

/// The F test of a loop with `freedom` terms; the arguments else are those of [`measure_loop`].
fn test(
    sample: &Sample,
    residuals: &[f64],
    order: usize,
    directions: &[i8],
    freedom: usize,
) -> Option<Tested> {
    let terms = order.max(freedom - 1) + 1;
    let design = Rows {
        count: sample.x.len(),
        columns: terms + freedom,
        row: |i: usize, row: &mut [f64]| {
            let (plain, directed) = row.split_at_mut(terms);
            polynomial::fill_powers(sample.x[i], plain);
            for (signed, power) in directed.iter_mut().zip(plain.iter()) {
                *signed = f64::from(directions[i]) * power;
            }
        },
    };
    let weights = &sample.spike;
    let c = design.solve(residuals, weights)?;
    let mut left = design.times(&c);
    for (fitted, r) in left.iter_mut().zip(residuals) {
        *fitted = r - *fitted;
    }
    let coefficients = terms + freedom;
    let noise = NoiseModel::of_residuals(left, weights, coefficients);
    let covariance = design.covariance(weights, &noise);
    let ours = covariance
        .view((terms, terms), (freedom, freedom))
        .into_owned();
    let ours_c = c.rows(terms, freedom).into_owned();
    let chi_square = ours_c.dot(&(ours.cholesky()?.solve(&ours_c)));
    let k = freedom as f64;
    // What is left to judge the noise by: rows that are independent, less the coefficients.
    let rest = (noise.effective_rows - coefficients as f64).max(1.0);
    Some(Tested {
        noise,
        coefficients,
        z: normal_of_f(chi_square / k, k, rest),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweeps_are_cut_at_their_turning_points() {
        let mut t: Vec<f64> = (0..=70).map(f64::from).collect();
        t.extend((0..70).rev().map(f64::from));
        t.extend((1..=30).map(f64::from));
        let d = directions(&t, 7.0);
        assert!(d[..=70].iter().all(|d| *d == 1));
        assert!(d[71..=140].iter().all(|d| *d == -1), "{d:?}");
        assert!(d[141..].iter().all(|d| *d == 1));
        // Noise and dwells turn nothing.
        let noisy: Vec<f64> = (0..100)
            .map(|k| f64::from(k / 10 * 10) + f64::from(k % 3) - 1.0)
            .collect();
        assert!(directions(&noisy, 7.0).iter().all(|d| *d == 1));
        assert!(directions(&[5.0; 9], 1.0).iter().all(|d| *d == 0));
        assert!(directions(&[], 1.0).is_empty());
        let falling: Vec<f64> = (0..50).rev().map(f64::from).collect();
        assert!(directions(&falling, 5.0).iter().all(|d| *d == -1));
    }

    /// A difference of four times chance is not told as no more than chance.
    #[test]
    fn a_difference_larger_than_chance_is_told_as_such() {
        let seen = |rms_dps, significant| Loop {
            rms_dps,
            noise_dps: 0.1768,
            bins: 20,
            effective_rows: 15.0,
            z: 0.0,
            significant,
        };
        let larger = seen(0.6936, false);
        assert!(larger.is_undecided(0.05));
        assert!(larger.finding(0.05).contains("larger than chance"));
        // Within a single reading's noise, or within chance.
        assert_eq!(larger.finding(0.7), "not significant");
        assert_eq!(seen(0.17, false).finding(0.05), "not significant");
        assert_eq!(seen(0.6936, true).finding(0.05), "significant");
        assert!(!seen(0.6936, true).is_undecided(0.05));
    }
}
