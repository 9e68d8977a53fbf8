//! The rate of change of a noisy reading: a cubic smoothing spline, by a Kalman filter and a smoother.
//!
//! The course is an integrated random walk, its rate a random walk whose variance grows by q a second; each reading is the course and white noise of
//! variance r. What all readings say of the rate at each of them is the smoothing spline's slope (Wahba 1978; Kohn & Ansley 1987), at uneven times and
//! over gaps as well, in rows times a constant (Rauch, Tung & Striebel 1965).

use crate::statistics::stats;
use nalgebra::{Matrix2, Vector2};

/// Variance of the rate at the first reading, in readings' noises per period: any.
const DIFFUSE: f64 = 1e6;

/// What is known of course and rate.
#[derive(Clone, Copy)]
struct State {
    mean: Vector2<f64>,
    covariance: Matrix2<f64>,
}

/// Rate of change, per second, at each reading. `suppleness` is q T^3 / r, T being the period of the rows, r the mean square of
/// what neighbouring readings differ by: much above 1 the rate follows the readings, much below it their trend.
pub fn slope(time_s: &[f64], values: &[f64], suppleness: f64) -> Vec<f64> {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    steps.retain(|s| *s > 0.0);
    let period_s = stats::median(&steps);
    let differences: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).collect();
    let unit = stats::rms(&differences);
    if !(period_s > 0.0 && unit > 0.0) {
        return vec![0.0; values.len()];
    }
    let readings: Vec<(f64, f64)> = time_s
        .iter()
        .zip(values)
        .map(|(t, v)| ((t - time_s[0]) / period_s, (v - values[0]) / unit))
        .collect();
    let smooth = smoothed(&readings, suppleness);
    smooth.iter().map(|m| m[1] * unit / period_s).collect()
}

/// Over a step, in periods: how course and rate move, and what is added to their covariance.
fn transition(step: f64, q: f64) -> (Matrix2<f64>, Matrix2<f64>) {
    let (half, third) = (step * step / 2.0, step.powi(3) / 3.0);
    (
        Matrix2::new(1.0, step, 0.0, 1.0),
        Matrix2::new(third, half, half, step) * q,
    )
}

/// Course and rate at each reading (time, value), by all of them; the noise of a reading is 1.
fn smoothed(readings: &[(f64, f64)], q: f64) -> Vec<Vector2<f64>> {
    let mut now = State {
        mean: Vector2::zeros(),
        covariance: Matrix2::new(DIFFUSE, 0.0, 0.0, DIFFUSE),
    };
    let mut before_s = readings.first().map_or(0.0, |r| r.0);
    // Of each reading what the earlier ones say, and what they and it say.
    let mut states = Vec::with_capacity(readings.len());
    for (time, value) in readings {
        let (move_on, added) = transition(time - before_s, q);
        before_s = *time;
        let predicted = State {
            mean: move_on * now.mean,
            covariance: move_on * now.covariance * move_on.transpose() + added,
        };
        let with = predicted.covariance.column(0).into_owned();
        let gain = with / (with[0] + 1.0);
        now = State {
            mean: predicted.mean + gain * (value - predicted.mean[0]),
            covariance: predicted.covariance - gain * with.transpose(),
        };
        states.push((predicted, now));
    }
    let mut out: Vec<Vector2<f64>> = states.iter().map(|s| s.1.mean).collect();
    for k in (1..states.len()).rev() {
        let (move_on, _) = transition(readings[k].0 - readings[k - 1].0, q);
        let (later, here) = (&states[k].0, &states[k - 1].1);
        if let Some(inverse) = later.covariance.try_inverse() {
            let gain = here.covariance * move_on.transpose() * inverse;
            out[k - 1] = here.mean + gain * (out[k] - later.mean);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::smooth;
    use crate::thermal::synthetic::Random;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn the_smoother_is_least_squares_over_all_readings() {
        let mut random = Random::new(2);
        for q in [1e-2, 1.0, 50.0] {
            let mut time = 0.0;
            let readings: Vec<(f64, f64)> = (0..30)
                .map(|k| {
                    time += 0.2 + 2.0 * random.uniform() + if k == 17 { 20.0 } else { 0.0 };
                    (time, (0.2 * time).sin() + random.normal())
                })
                .collect();
            // The square of readings less courses, and of steps in the units of what may be added to them, as normal equations.
            let n = readings.len();
            let (mut gram, mut right) = (DMatrix::zeros(2 * n, 2 * n), DVector::zeros(2 * n));
            for (k, (_, value)) in readings.iter().enumerate() {
                gram[(2 * k, 2 * k)] += 1.0;
                right[2 * k] = *value;
            }
            gram[(0, 0)] += 1.0 / DIFFUSE;
            gram[(1, 1)] += 1.0 / DIFFUSE;
            for k in 1..n {
                // The integrals of an integrated random walk of variance q a unit of time, written out.
                let d = readings[k].0 - readings[k - 1].0;
                let move_on = Matrix2::new(1.0, d, 0.0, 1.0);
                let of = [d * d * d / 3.0, d * d / 2.0, d].map(|v| q * v);
                let weight = Matrix2::new(of[0], of[1], of[1], of[2]);
                let weight = weight.try_inverse().unwrap();
                let mut both = DMatrix::zeros(2, 4);
                both.view_mut((0, 0), (2, 2)).copy_from(&-move_on);
                both.view_mut((0, 2), (2, 2))
                    .copy_from(&Matrix2::identity());
                let of_step = both.transpose() * weight * &both;
                let mut place = gram.view_mut((2 * k - 2, 2 * k - 2), (4, 4));
                place += of_step;
            }
            let dense = gram.cholesky().unwrap().solve(&right);
            for (k, state) in smoothed(&readings, q).iter().enumerate() {
                for i in 0..2 {
                    let off = state[i] - dense[2 * k + i];
                    assert!(off.abs() < 1e-6, "{q} {k} {i}: {off}");
                }
            }
        }
    }

    #[test]
    fn a_ramp_has_its_slope_at_uneven_times_and_what_stands_still_none() {
        let time_s: Vec<f64> = (0..40)
            .map(|k| f64::from(k * k % 17) * 0.1 + f64::from(2 * k))
            .collect();
        let ramp: Vec<f64> = time_s.iter().map(|t| 300.0 - 0.25 * t).collect();
        for suppleness in [0.01, 1.0, 100.0] {
            let all = slope(&time_s, &ramp, suppleness);
            assert!(
                all.iter().all(|s| (s + 0.25).abs() < 1e-4),
                "{suppleness} {all:?}"
            );
        }
        assert_eq!(slope(&time_s, &[7.0; 40], 1.0), [0.0; 40]);
        assert_eq!(slope(&[3.0], &[7.0], 1.0), [0.0]);
        // Repeated times are readings of the same moment.
        let twice = slope(&[0.0, 1.0, 1.0, 2.0], &[0.0, 1.0, 1.0, 2.0], 10.0);
        assert!(twice.iter().all(|s| (s - 1.0).abs() < 0.05), "{twice:?}");
    }

    #[test]
    fn in_noise_it_errs_less_than_lines_through_a_few_rows() {
        let mut random = Random::new(9);
        let time_s: Vec<f64> = (0..600).map(f64::from).collect();
        let course = |t: f64| 20.0 * (t / 40.0).sin();
        let values: Vec<f64> = time_s
            .iter()
            .map(|t| course(*t) + 0.5 * random.normal())
            .collect();
        let error = |slopes: Vec<f64>| {
            let off = time_s
                .iter()
                .zip(slopes)
                .map(|(t, s)| s - 0.5 * (t / 40.0).cos());
            stats::rms(&off.collect::<Vec<f64>>())
        };
        let lines = [1, 2, 3, 5, 9].map(|rows| error(smooth::slope(&time_s, &values, rows)));
        let splines = [0.001, 0.01, 0.1, 1.0].map(|q| error(slope(&time_s, &values, q)));
        let least = |all: &[f64]| all.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(
            least(&splines) < 0.9 * least(&lines),
            "{splines:?} {lines:?}"
        );
    }
}
