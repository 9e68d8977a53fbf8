//! White noise, 1/f noise and rate random walk as a linear state space on uneven times.
//!
//! 1/f noise is a sum of relaxations with time constants spread evenly in the logarithm (Bernamont
//! 1937; van der Ziel 1950; the state-space view in Kasdin 1995): an Ornstein-Uhlenbeck process of
//! variance v and time constant tau has the one-sided spectrum 4 v tau / (1 + (2 pi f tau)^2), and
//! a density of 1 / ln(r) of them per unit of ln(tau) adds up to (v / ln r) / f. With
//! neighbours at most r = 8 apart the ripple is below 2 / cosh(pi^2 / ln r) = 3.5 % (0.15 dB).
//!
//! Their shortest time constant is one row period and the longest four record lengths. What is faster
//! than a row looks white to the record: `FAST` of h per row brings the sum to within 0.5 dB of
//! Kasdin's discrete 1/f spectrum, h / (2 sin(pi f T) / (2 pi f T)) / f, from 1 / record length to
//! half of the row rate (tested).
//!
//! Rate random walk is integrated white noise. It starts at 0 in the first row; its unknown start is
//! the constant among the regressors, and since the restricted likelihood does not see what the
//! regressors span, that is the exact diffuse start (Durbin & Koopman 2012, 5.4; Harville 1977).

use super::Unusable;

/// White variance per row, in units of h, of the relaxations that are faster than a row.
const FAST: f64 = 0.5;

/// Most relaxations; a record with gaps of years has fewer per decade.
const MOST: usize = 11;

/// Strengths of the noise, in the unit of the signal (deg/s).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NoiseModel {
    /// White noise of a row of full weight, rms, deg/s.
    pub white_rms_dps: f64,
    /// sqrt(h), deg/s, where the one-sided spectrum is h / f: the rms of the 1/f noise in any band
    /// (f, e f), whatever f.
    pub flicker_dps: f64,
    /// Rate random walk K, deg/s per sqrt(s): the standard deviation after a time t is K sqrt(t).
    pub walk_dps_rts: f64,
}

impl NoiseModel {
    /// The noise of a shape whose white part has the rms `white_rms_dps`, rows `period_s` apart.
    pub fn of_shape(shape: Shape, white_rms_dps: f64, period_s: f64) -> Self {
        NoiseModel {
            white_rms_dps,
            flicker_dps: white_rms_dps * shape.flicker.sqrt(),
            walk_dps_rts: white_rms_dps * (shape.walk / period_s).sqrt(),
        }
    }

    /// Bias instability B of IEEE 952 (flat Allan deviation 0.664 B), deg/s: B^2 = pi h.
    pub fn bias_instability_dps(&self) -> f64 {
        self.flicker_dps * std::f64::consts::PI.sqrt()
    }
}

/// The noise but for its overall strength: what decides how rows are correlated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shape {
    /// h over the white variance of a row.
    pub flicker: f64,
    /// Variance that the walk gains in a row period, over the white variance of a row.
    pub walk: f64,
}

/// One state of the state space: a relaxation, or the walk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Time constant in row periods; infinite for the walk.
    pub tau: f64,
    /// Stationary variance (relaxation), or gain of variance per row period (walk), in units of
    /// the white variance.
    pub variance: f64,
}

/// The times of a record and how much each row's white noise counts. Does not depend on the noise's
/// strengths.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    /// The row period, s: the median of the steps that are not 0.
    pub period_s: f64,
    /// From the first used row to the last, in row periods.
    pub span: f64,
    /// Time since the row before, in row periods; 0 for the first.
    pub steps: Vec<f64>,
    /// Variance of the row's white noise over that of a plain row: 1 / m for a mean of m rows, more
    /// than 1 for a row that counts less, infinite for a row that is not used.
    pub white_factor: Vec<f64>,
    /// Time constants of the relaxations, in row periods.
    taus: Vec<f64>,
    /// exp(-step / tau), row by row: [row * taus.len() + k].
    decays: Vec<f64>,
}

impl Timeline {
    /// The timeline of rows at `times_s` (never decreasing); `white_factor` as in the field.
    ///
    /// # Errors
    /// Lengths that differ, times that decrease or do not advance, or that are not finite.
    pub fn new(times_s: &[f64], white_factor: Vec<f64>) -> Result<Self, Unusable> {
        if times_s.len() != white_factor.len() || times_s.iter().any(|t| !t.is_finite()) {
            return Err(Unusable::NotFinite("the time"));
        }
        let mut steps: Vec<f64> = vec![0.0];
        steps.extend(times_s.windows(2).map(|w| w[1] - w[0]));
        steps.truncate(times_s.len());
        let mut positive: Vec<f64> = steps.iter().copied().filter(|s| *s > 0.0).collect();
        if positive.is_empty() || steps.iter().any(|s| *s < 0.0) {
            return Err(Unusable::Times);
        }
        let middle = positive.len() / 2;
        let period_s = *positive.select_nth_unstable_by(middle, f64::total_cmp).1;
        for step in &mut steps {
            *step /= period_s;
        }
        let span = steps.iter().sum::<f64>().max(4.0);
        let taus = time_constants(span);
        let mut decays = Vec::with_capacity(steps.len() * taus.len());
        for step in &steps {
            decays.extend(taus.iter().map(|tau| (-step / tau).exp()));
        }
        Ok(Timeline {
            period_s,
            span,
            steps,
            white_factor,
            taus,
            decays,
        })
    }

    /// The same times with other weights of the rows.
    pub fn with_white_factor(&self, white_factor: Vec<f64>) -> Self {
        let mut out = self.clone();
        out.white_factor = white_factor;
        out
    }

    /// Number of rows, used or not.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Rows that are used.
    pub fn used(&self) -> usize {
        self.white_factor.iter().filter(|f| f.is_finite()).count()
    }

    /// The states that a shape needs, relaxations first.
    pub fn states(&self, shape: Shape) -> Vec<State> {
        let mut out = Vec::new();
        if shape.flicker > 0.0 {
            let variance = shape.flicker * self.log_ratio();
            out.extend(self.taus.iter().map(|tau| State {
                tau: *tau,
                variance,
            }));
        }
        if shape.walk > 0.0 {
            out.push(State {
                tau: f64::INFINITY,
                variance: shape.walk,
            });
        }
        out
    }

    /// The states of a shape with a smooth walk beside it, relaxations first, and the stationary covariance of the last two
    /// relaxations.
    ///
    /// A smooth walk is integrated random walk, here with `smooth`, the variance that its slope gains in a row period (rows^-2,
    /// in units of the white variance). Two relaxations of rates a < b that one noise of intensity g drives with opposite signs have
    /// the spectrum g (b - a)^2 / ((w^2 + a^2)(w^2 + b^2)): integrated walk at all periods that the record has, if a and b
    /// are those of the longest two time constants. Variances g / 2a, g / 2b; covariance -g / (a + b).
    pub fn smooth_states(&self, shape: Shape, smooth: f64) -> (Vec<State>, f64) {
        let [.., short, long] = self.taus[..] else {
            return (self.states(shape), 0.0);
        };
        if smooth <= 0.0 {
            return (self.states(shape), 0.0);
        }
        let variance = shape.flicker * self.log_ratio();
        let relaxation = |tau: &f64| State {
            tau: *tau,
            variance,
        };
        // Without 1/f noise the longest two alone.
        let first = match shape.flicker > 0.0 {
            true => 0,
            false => self.taus.len() - 2,
        };
        let mut out: Vec<State> = self.taus[first..].iter().map(relaxation).collect();
        let (a, b) = (1.0 / long, 1.0 / short);
        let g = smooth / (b - a).powi(2);
        let last = out.len() - 1;
        out[last].variance += 0.5 * g / a;
        out[last - 1].variance += 0.5 * g / b;
        out.extend(self.states(Shape {
            flicker: 0.0,
            ..shape
        }));
        (out, -g / (a + b))
    }

    /// Variance, in units of the white variance, that every row has whatever its weight.
    pub fn floor(&self, shape: Shape) -> f64 {
        FAST * shape.flicker
    }

    /// exp(-step / tau) of a row for [`Timeline::states`]; 1 for the walk.
    pub fn decays(&self, row: usize) -> &[f64] {
        let k = self.taus.len();
        self.decays.get(row * k..(row + 1) * k).unwrap_or(&[])
    }

    /// ln of the ratio of neighbouring time constants.
    fn log_ratio(&self) -> f64 {
        match (self.taus.first(), self.taus.last()) {
            (Some(a), Some(b)) if self.taus.len() > 1 => {
                (b / a).ln() / (self.taus.len() - 1) as f64
            }
            _ => 1.0,
        }
    }
}

/// Time constants from one row period to four spans, at most a factor of 8 apart (more only in
/// records with long gaps).
fn time_constants(span: f64) -> Vec<f64> {
    let longest = (4.0 * span).log10();
    let steps = ((longest / 8f64.log10()).ceil().max(1.0) as usize).min(MOST - 1);
    (0..=steps)
        .map(|k| f64::powf(10.0, longest * k as f64 / steps as f64))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    /// The two-sided spectrum of the sampled sum against Kasdin's, in dB.
    fn decibels(line: &Timeline, f: f64) -> f64 {
        let shape = Shape {
            flicker: 1.0,
            walk: 0.0,
        };
        let relaxations: f64 = line
            .states(shape)
            .iter()
            .map(|s| {
                let a = (-1.0 / s.tau).exp();
                s.variance * (1.0 - a * a) / (1.0 - 2.0 * a * (TAU * f).cos() + a * a)
            })
            .sum();
        let kasdin = PI / (2.0 * (PI * f).sin());
        10.0 * ((relaxations + line.floor(shape)) / kasdin).log10()
    }

    #[test]
    fn the_sum_is_one_over_f_within_half_a_decibel() {
        for n in [50usize, 100, 300, 1000, 3000, 30_000, 1_000_000] {
            let times: Vec<f64> = (0..n).map(|k| 0.25 * k as f64).collect();
            let line = Timeline::new(&times, vec![1.0; n]).unwrap();
            for k in 0..=300 {
                let f = (1.0 / n as f64) * (0.5 * n as f64).powf(f64::from(k) / 300.0);
                let error = decibels(&line, f);
                assert!(error.abs() < 0.5, "{n} rows, f = {f}: {error} dB");
            }
        }
    }

    #[test]
    fn times_that_are_unusable_are_refused() {
        assert_eq!(
            Timeline::new(&[0.0, 1.0, 0.5], vec![1.0; 3]).err(),
            Some(Unusable::Times)
        );
        assert_eq!(
            Timeline::new(&[2.0; 4], vec![1.0; 4]).err(),
            Some(Unusable::Times)
        );
        assert!(Timeline::new(&[0.0, f64::NAN], vec![1.0; 2]).is_err());
        assert!(Timeline::new(&[], vec![]).is_err());
    }
}
