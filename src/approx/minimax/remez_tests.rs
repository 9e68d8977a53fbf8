use super::*;
use crate::approx::minimax::{Basis, Monomials, Target, Weight};
use std::f64::consts::PI;

fn run(
    f: &dyn Target,
    kind: Monomials,
    degree: u32,
    low: f64,
    high: f64,
    weight: Weight,
) -> Minimax {
    let basis = Basis::new(kind, degree).unwrap();
    let samples = Samples::new(f, &basis, low, high, weight).unwrap();
    minimax(&samples).unwrap()
}

/// A function known to 32 digits: exp by its series.
struct Exponential;
impl Target for Exponential {
    fn value(&self, x: f64) -> f64 {
        x.exp()
    }
    fn value_wide(&self, x: Wide) -> Wide {
        let (mut term, mut sum) = (Wide::ONE, Wide::ONE);
        for k in 1..60 {
            term = term * x / Wide::from(f64::from(k));
            sum += term;
        }
        sum
    }
}

/// Chebyshev: x^n on [-1, 1] from degree n - 1 leaves 2^(1-n), whatever n.
#[test]
fn powers_leave_chebyshev_polynomials() {
    for n in 1..=13u32 {
        let f = move |x: f64| x.powi(n as i32);
        let m = run(&f, Monomials::All, n - 1, -1.0, 1.0, Weight::Absolute);
        let truth = 2f64.powi(1 - n as i32);
        assert!(m.converged, "{n}: {m:?}");
        assert!((m.error / truth - 1.0).abs() < 1e-9, "{n}: {}", m.error);
    }
}

/// Degree 12 of exp on [0, 1]: 2 e^(1/2) (1/4)^13 / 13! to within the next order, about 7.9e-18.
#[test]
fn errors_far_below_double_precision_are_found() {
    let m = run(&Exponential, Monomials::All, 12, 0.0, 1.0, Weight::Absolute);
    let estimate = 2.0 * 0.5f64.exp() * 0.25f64.powi(13) / 6_227_020_800.0;
    assert!(m.converged, "{m:?}");
    assert!(
        (m.error / estimate - 1.0).abs() < 0.02,
        "{} {estimate}",
        m.error
    );
    assert!(m.lower_bound <= m.error && m.lower_bound > m.error * (1.0 - 1e-8));
}

#[test]
fn degenerate_cases() {
    // In the span.
    let f = |x: f64| 3.0 * x * x - x + 0.5;
    let m = run(&f, Monomials::All, 4, -0.5, 1.0, Weight::Absolute);
    assert!(m.converged && m.error < 1e-15, "{m:?}");
    // Zero.
    let m = run(&|_| 0.0, Monomials::All, 3, 0.0, 1.0, Weight::Absolute);
    assert!(m.converged && m.error == 0.0, "{m:?}");
    // Odd on a symmetric interval, even degree.
    let sine = |x: f64| (0.5 * PI * x).sin();
    for degree in [2, 4, 6] {
        let even = run(&sine, Monomials::All, degree, -1.0, 1.0, Weight::Absolute);
        let odd = run(&sine, Monomials::Odd, degree, -1.0, 1.0, Weight::Absolute);
        assert!(even.converged && odd.converged);
        assert!((even.error / odd.error - 1.0).abs() < 1e-8);
    }
    // No Haar condition: an odd basis for what is not odd. |f(x) - p(x)| >= |f(x) + f(-x)| / 2.
    let f = |x: f64| x.sin() + 0.1 * x * x;
    let m = run(&f, Monomials::Odd, 5, -1.0, 1.0, Weight::Absolute);
    assert!(m.converged, "{m:?}");
    assert!((m.error - 0.1).abs() < 1e-9, "{}", m.error);
    // A kink: |x| from degree 2 on [-1, 1] is x^2 + 1/8 with error 1/8.
    let m = run(
        &|x: f64| x.abs(),
        Monomials::All,
        2,
        -1.0,
        1.0,
        Weight::Absolute,
    );
    assert!(m.converged && (m.error - 0.125).abs() < 1e-12, "{m:?}");
    // An infinite slope at the end: sqrt from degree 1 on [0, 1] is x + 1/8, error 1/8.
    let m = run(
        &|x: f64| x.sqrt(),
        Monomials::All,
        1,
        0.0,
        1.0,
        Weight::Absolute,
    );
    assert!(m.converged && (m.error - 0.125).abs() < 1e-9, "{m:?}");
}

/// The relative error of sin with odd monomials: finite at 0, levels, and is the truth at dense points.
#[test]
fn relative_errors() {
    let sine = |x: f64| x.sin();
    let m = run(&sine, Monomials::Odd, 5, 0.0, PI / 2.0, Weight::Relative);
    let dense = (1..100_000)
        .map(|k| {
            let x = f64::from(k) * PI / 200_000.0;
            let p: f64 = m
                .coefficients
                .iter()
                .rev()
                .fold(0.0, |s, c| s * x * x + c.hi)
                * x;
            ((x.sin() - p) / x.sin()).abs()
        })
        .fold(0.0, f64::max);
    assert!(m.converged, "{m:?}");
    assert!((dense / m.error - 1.0).abs() < 1e-6, "{dense} {}", m.error);
    let basis = Basis::new(Monomials::All, 3).unwrap();
    let refused = Samples::new(&sine, &basis, -1.0, 1.0, Weight::Relative)
        .err()
        .unwrap();
    assert!(refused.to_string().contains("vanishes"), "{refused}");
}

#[test]
fn intervals_far_from_zero_and_high_degrees() {
    let f = |x: f64| (x / 10.0).sin();
    let m = run(&f, Monomials::All, 5, 100.0, 110.0, Weight::Absolute);
    assert!(m.converged, "{m:?}");
    let f = |x: f64| 1.0 / (1.0 + 25.0 * x * x);
    let m = run(&f, Monomials::All, 24, -1.0, 1.0, Weight::Absolute);
    assert!(m.converged && m.error < 0.01, "{m:?}");
    let basis = Basis::new(Monomials::All, 3).unwrap();
    assert!(Samples::new(&f, &basis, 1.0, 1.0, Weight::Absolute).is_err());
    let pole = |x: f64| 1.0 / x;
    assert!(Samples::new(&pole, &basis, 0.0, 1.0, Weight::Absolute).is_err());
}
