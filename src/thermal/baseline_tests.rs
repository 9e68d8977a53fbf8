//! The fit against records whose truth is known.

use super::baseline::{BaselineFit, fit};
use super::synthetic::{Random, few, options, record, triangle};
use crate::design::{FitOrder, RecordMapping};
use crate::numeric::polynomial::evaluate;
use nalgebra::DVector;

const TRUTH: [f64; 3] = [1.5, -0.8, 0.35];

/// The scaled reading of the triangle.
fn x_of(t: f64) -> f64 {
    t / 35.0 - 1.0
}

fn fitted(t: &[f64], e: &[f64], order: FitOrder) -> BaselineFit {
    fit(
        &record("die_degc", t, e),
        &RecordMapping::default(),
        &options(order),
    )
    .unwrap()
}

/// 200 draws with noise of a given memory: per coefficient the share of draws within 3 standard
/// deviations, the mean square of (estimate - truth) / std, and the Mahalanobis mean a coefficient.
fn honesty(rho: f64, n: usize) -> ([f64; 3], [f64; 3], f64) {
    let mut random = Random::new(42);
    let t = triangle(n);
    let (mut within, mut square, mut distance) = ([0.0; 3], [0.0; 3], 0.0);
    for _ in 0..200 {
        let noise = random.coloured(n, rho);
        let e: Vec<f64> = t
            .iter()
            .zip(noise)
            .map(|(t, v)| evaluate(&TRUTH, x_of(*t)) + 0.05 * v)
            .collect();
        let r = record("die_degc", &t, &e);
        let fit = fit(&r, &RecordMapping::default(), &few(FitOrder::Fixed(2))).unwrap();
        let off = DVector::from_iterator(
            3,
            fit.coefficients_scaled
                .iter()
                .zip(TRUTH)
                .map(|(a, b)| a - b),
        );
        for k in 0..3 {
            let z = off[k] / fit.covariance[(k, k)].sqrt();
            within[k] += f64::from(u8::from(z.abs() < 3.0)) / 200.0;
            square[k] += z * z / 200.0;
        }
        let inverse = fit.covariance.clone().cholesky().unwrap().inverse();
        distance += off.dot(&(inverse * &off)) / 600.0;
    }
    (within, square, distance)
}

/// The more memory, the fewer rows are left to judge by, and the larger may z^2 get.
fn assert_honest(rho: f64, n: usize, most: f64) {
    let (within, square, distance) = honesty(rho, n);
    println!("rho {rho}: within 3 sigma {within:.3?}, z^2 {square:.3?}, per term {distance:.3}");
    assert!(within.iter().all(|w| *w >= 0.95), "rho {rho}: {within:?}");
    let allowed = 0.6..most;
    assert!(
        square.iter().all(|s| allowed.contains(s)),
        "rho {rho}: {square:?}"
    );
    assert!(distance < most, "rho {rho}: {distance}");
}

#[test]
fn the_covariance_is_honest_under_white_noise() {
    assert_honest(0.0, 301, 1.3);
}

#[test]
fn the_covariance_is_honest_under_noise_with_memory() {
    assert_honest(0.5, 301, 1.4);
    assert_honest(0.9, 601, 1.9);
}

#[test]
fn the_covariance_is_honest_under_slow_noise() {
    assert_honest(0.97, 1201, 2.1);
}

#[test]
fn outliers_do_not_move_the_fit() {
    let mut random = Random::new(7);
    let t = triangle(500);
    let clean: Vec<f64> = t
        .iter()
        .map(|t| evaluate(&TRUTH, x_of(*t)) + 0.02 * random.normal())
        .collect();
    let mut dirty = clean.clone();
    let mut hit = Vec::new();
    for k in 0..10 {
        let i = 17 + 47 * k;
        dirty[i] += if k % 3 == 0 { 5.0 } else { -0.5 };
        hit.push(i);
    }
    let (a, b) = (
        fitted(&t, &clean, FitOrder::Fixed(2)),
        fitted(&t, &dirty, FitOrder::Fixed(2)),
    );
    assert_eq!(b.outliers, hit);
    assert!(a.outliers.is_empty());
    for t in [0.0, 20.0, 35.0, 50.0, 70.0] {
        let moved = (a.bias_dps(t) - b.bias_dps(t)).abs();
        assert!(moved < a.std_dps(t), "{t}: {moved} of {}", a.std_dps(t));
    }
    let warning = b.warnings.iter().find(|w| w.code == "outliers").unwrap();
    assert!(warning.message.contains("10 of 500 rows"), "{warning:?}");
    assert!(warning.message.contains("line 19, 66"), "{warning:?}");
    // They are not swept under the carpet: the errors count them.
    assert!(b.in_sample_rms_dps > 0.3 && b.heldout_max_abs_dps > 4.0);
}

#[test]
fn a_long_soak_does_not_outvote_the_ramp() {
    // The bias has a kink that a line cannot follow; nine tenths of the rows are at 70 degC.
    let mut random = Random::new(3);
    let mut t: Vec<f64> = (0..200).map(|k| 0.35 * f64::from(k)).collect();
    t.extend(std::iter::repeat_n(70.0, 1800));
    let e: Vec<f64> = t
        .iter()
        .map(|t| 0.02 * (t - 30.0).abs() + 0.01 * random.normal())
        .collect();
    let r = record("die_degc", &t, &e);
    let mapping = RecordMapping::default();
    let o = options(FitOrder::Fixed(1));
    let limited = fit(&r, &mapping, &o).unwrap();
    let plain = super::baseline::fit_with(&r, &mapping, &o, false).unwrap();
    let misfit = |f: &BaselineFit| {
        (0..=70)
            .map(f64::from)
            .map(|t| (f.bias_dps(t) - 0.02 * (t - 30.0).abs()).powi(2))
            .sum::<f64>()
    };
    assert!(
        misfit(&limited) < 0.8 * misfit(&plain),
        "{} {}",
        misfit(&limited),
        misfit(&plain)
    );
    assert!(limited.warnings.iter().any(|w| w.code == "dwell_dominates"));
}

#[test]
fn the_order_is_found_by_held_out_error() {
    let mut random = Random::new(11);
    let t: Vec<f64> = [triangle(300), triangle(300)].concat();
    let polynomials: [&[f64]; 4] = [
        &[1.0],
        &[1.0, 0.5],
        &[1.0, 0.5, 0.3],
        &[1.0, 0.5, 0.3, 0.25],
    ];
    for (order, c) in polynomials.iter().enumerate() {
        let mut found = 0;
        for _ in 0..10 {
            let e: Vec<f64> = t
                .iter()
                .map(|t| evaluate(c, x_of(*t)) + 0.03 * random.normal())
                .collect();
            let f = fitted(&t, &e, FitOrder::Auto);
            found += usize::from(f.order == order);
            assert!(
                f.reason.contains(&format!("order {}", f.order)),
                "{}",
                f.reason
            );
            assert_eq!(f.orders_tried.len(), 6);
        }
        assert!(found >= 9, "order {order}: {found} of 10");
    }
    // A given order is kept, and the reason says what the held-out error would have chosen.
    let e: Vec<f64> = t
        .iter()
        .map(|t| evaluate(polynomials[3], x_of(*t)) + 0.03 * random.normal())
        .collect();
    let f = fitted(&t, &e, FitOrder::Fixed(1));
    assert_eq!((f.order, f.coefficients.len()), (1, 2));
    assert!(f.reason.contains("would be order 3"), "{}", f.reason);
}

#[test]
fn all_forms_of_the_polynomial_agree() {
    let mut random = Random::new(5);
    // A resonance near 17.5 kHz that moves by 30 Hz: powers of the frequency itself are hopeless.
    let t: Vec<f64> = triangle(400).iter().map(|t| 17_500.0 - 0.43 * t).collect();
    let e: Vec<f64> = t
        .iter()
        .map(|f| evaluate(&[3.0, 20.0, -4.0, 1.0], (f - 17_485.0) / 15.0) + 0.01 * random.normal())
        .collect();
    let f = fit(
        &record("freq_hz", &t, &e),
        &RecordMapping::default(),
        &options(FitOrder::Fixed(3)),
    )
    .unwrap();
    assert_eq!((f.thermometer.as_str(), f.unit), ("freq_hz", "Hz"));
    for (offset, scale) in [(17_485.0, 16.0), (17_500.0, 64.0), (17_470.0, -1.0)] {
        let c = f.scaled_to(offset, scale);
        for t in [17_470.0, 17_478.3, 17_500.0] {
            let p = (t - offset) / scale;
            let difference = (evaluate(&c, p) - f.bias_dps(t)).abs();
            assert!(difference < 1e-10, "offset {offset}: {difference}");
        }
    }
    // In the reading itself the same, as far as doubles go: 17500^3 * 1e-16 / 15^3.
    let difference = (evaluate(&f.coefficients, 17_480.0) - f.bias_dps(17_480.0)).abs();
    assert!(difference < 1e-4, "{difference}");
    let slope = (f.bias_dps(17_480.01) - f.bias_dps(17_479.99)) / 0.02;
    assert!((slope - f.slope_dps(17_480.0)).abs() < 1e-6);
    assert!(f.std_dps(17_500.0) <= f.std_max_dps() && f.std_max_dps() < f.std_dps(17_550.0));
    let at = f.least_certain();
    assert!((at - f.centre).abs() <= (1.0 + 1e-9) * f.half_span, "{at}");
    assert_eq!(f.std_dps(at), f.std_max_dps());
}

#[test]
fn rows_without_readings_are_skipped_and_applied_rates_taken_off() {
    let mut random = Random::new(9);
    let t = triangle(200);
    let clean: Vec<f64> = t
        .iter()
        .map(|t| evaluate(&TRUTH, x_of(*t)) + 0.01 * random.normal())
        .collect();
    let rates: Vec<f64> = (0..200).map(|k| f64::from(k % 5 - 2) * 100.0).collect();
    let turning: Vec<f64> = clean.iter().zip(&rates).map(|(e, r)| e + r).collect();
    let mut r = record("phase_rad", &t, &turning);
    r.columns.insert("rate_dps".into(), rates);
    let a = fit(&r, &RecordMapping::default(), &options(FitOrder::Fixed(2))).unwrap();
    let b = fitted(&t, &clean, FitOrder::Fixed(2));
    for (x, y) in a.coefficients_scaled.iter().zip(&b.coefficients_scaled) {
        assert!((x - y).abs() < 1e-10);
    }
    if let Some(c) = r.columns.get_mut("phase_rad") {
        c[3] = f64::NAN;
        c[4] = -40_000.0;
    }
    if let Some(c) = r.columns.get_mut("rate_out_dps") {
        c[100] = f64::NAN;
    }
    let c = fit(&r, &RecordMapping::default(), &options(FitOrder::Fixed(2))).unwrap();
    assert_eq!(c.rows.len(), 197);
    assert_eq!(c.residuals.len(), 200);
    assert!(
        [3, 4, 100]
            .iter()
            .all(|i| c.residuals[*i].is_nan() && c.weights[*i] == 0.0)
    );
    let codes: Vec<&str> = c.warnings.iter().map(|w| w.code).collect();
    assert_eq!(codes, ["rows_without_thermometer", "thermometer_glitch"]);
    assert!((c.bias_dps(50.0) - b.bias_dps(50.0)).abs() < 0.005);
}

#[test]
fn figures_of_the_record_are_those_that_were_put_in() {
    let mut random = Random::new(13);
    let t = triangle(2000);
    let e: Vec<f64> = t.iter().map(|t| 0.1 * t + 0.2 * random.normal()).collect();
    let f = fitted(&t, &e, FitOrder::Fixed(1));
    assert!(
        (f.noise_floor_rms_dps - 0.2).abs() < 0.01,
        "{}",
        f.noise_floor_rms_dps
    );
    assert!((f.in_sample_rms_dps - 0.2).abs() < 0.01);
    assert!((f.heldout_rms_dps - 0.2).abs() < 0.01);
    // Bin means at the ends lie half a bin inside: 7 deg/s less a twentieth.
    assert!(
        (f.drift_before_pp_dps - 6.65).abs() < 0.15,
        "{}",
        f.drift_before_pp_dps
    );
    assert!(f.drift_before_pp_plain_dps > 7.2);
    assert_eq!(f.blocks.len(), 10);
}
