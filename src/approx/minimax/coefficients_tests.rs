use super::*;
use crate::approx::minimax::{
    Basis, CoefficientFormat, Monomials, Samples, Target, Weight, minimax,
};
use std::f64::consts::PI;
use std::time::Instant;

fn solve(f: &dyn Target, kind: Monomials, degree: u32, interval: (f64, f64), bits: i32) -> Best {
    let (best, converged) = solve_any(f, kind, degree, interval, bits);
    assert!(converged);
    best
}

fn solve_any(
    f: &dyn Target,
    kind: Monomials,
    degree: u32,
    (low, high): (f64, f64),
    bits: i32,
) -> (Best, bool) {
    let basis = Basis::new(kind, degree).unwrap();
    let samples = Samples::new(f, &basis, low, high, Weight::Absolute).unwrap();
    let real = minimax(&samples).unwrap();
    let problem = Problem::new(&samples, &real, &[CoefficientFormat::unlimited(bits)]).unwrap();
    (problem.best(Budget::default()).unwrap(), real.converged)
}

/// The figures to reach or beat, those of the usual lattice heuristic and of plain rounding: function,
/// monomials, degree, interval, fraction bits, largest error.
#[test]
fn published_cases_are_reached_with_proof() {
    let atan = |x: f64| x.atan() / (2.0 * PI);
    let sine = |x: f64| (0.5 * PI * x).sin();
    let root = |x: f64| x.sqrt();
    let bias = |p: f64| 136.82 * p * p + 242.97 * p + 109.60;
    let unit = (0.0, 1.0);
    use Monomials::{All, Odd};
    type Case<'a> = (
        &'a str,
        &'a dyn Target,
        Monomials,
        u32,
        (f64, f64),
        i32,
        f64,
    );
    let cases: [Case; 12] = [
        ("atan 5", &atan, All, 5, unit, 15, 4.41e-6),
        ("atan 5", &atan, All, 5, unit, 17, 6.96e-6),
        ("atan 7", &atan, All, 7, unit, 15, 1.97e-7),
        ("atan 7", &atan, All, 7, unit, 17, 1.38e-7),
        ("atan odd 5", &atan, Odd, 5, unit, 15, 9.91e-5),
        ("atan odd 5", &atan, Odd, 5, unit, 17, 9.81e-5),
        ("atan odd 7", &atan, Odd, 7, unit, 15, 1.60e-5),
        ("atan odd 7", &atan, Odd, 7, unit, 17, 1.41e-5),
        ("sine odd 5", &sine, Odd, 5, unit, 15, 7.08e-5),
        ("sine odd 7", &sine, Odd, 7, unit, 15, 2.15e-6),
        ("sqrt 4", &root, All, 4, (0.25, 1.0), 15, 1.79e-4),
        ("bias 2", &bias, All, 2, (-0.9, 0.2), 7, 2.90e-3),
    ];
    for (name, f, kind, degree, interval, bits, goal) in cases {
        let t = Instant::now();
        let b = solve(f, kind, degree, interval, bits);
        println!(
            "{name:12} 2^-{bits}: {:.4e} (goal {goal:.2e}) real {:.4e} rounded {:.4e} babai {:.4e} proved {} nodes {} {:.1} ms {:?}",
            b.error,
            b.minimax_error,
            b.rounded.error,
            b.babai.error,
            b.proved,
            b.nodes,
            t.elapsed().as_secs_f64() * 1e3,
            b.raw
        );
        assert!(b.proved, "{name}");
        // Goals are printed with three digits, some cut, some rounded: one unit of the last.
        let digit = 0.01 * 10f64.powf(goal.log10().floor());
        assert!(b.error < goal + digit, "{name}: {}", b.error);
    }
}

/// The optimum by trying every choice near the minimax coefficients, on points of its own.
fn brute_force(
    f: &dyn Target,
    degree: usize,
    (low, high): (f64, f64),
    bits: i32,
    reach: i64,
    start: &[f64],
) -> f64 {
    let unit = 2f64.powi(-bits);
    let points: Vec<(f64, f64)> = (0..=400)
        .map(|k| {
            let x = low + (high - low) * (0.5 - 0.5 * (PI * f64::from(k) / 400.0).cos());
            (x, f.value(x))
        })
        .collect();
    let centre: Vec<i64> = start.iter().map(|c| (c / unit).round() as i64).collect();
    let width = (2 * reach + 1) as usize;
    let mut least = f64::INFINITY;
    for index in 0..width.pow(degree as u32 + 1) {
        let mut rest = index;
        let c: Vec<f64> = centre
            .iter()
            .map(|&c| {
                let by = (rest % width) as i64 - reach;
                rest /= width;
                (c + by) as f64 * unit
            })
            .collect();
        let mut largest = 0.0f64;
        for &(x, y) in &points {
            let p = c.iter().rev().fold(0.0, |s, c| s * x + c);
            largest = largest.max((y - p).abs());
            if largest >= least {
                break;
            }
        }
        least = least.min(largest);
    }
    least
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(60))]
    /// The proved optimum is the optimum: nothing in a large box of integers is better.
    #[test]
    fn the_proved_optimum_is_that_of_brute_force(
        a in 0.2..2.0f64, b in -1.0..1.0f64, c in 0.3..3.0f64,
        low in -1.0..0.5f64, width in 0.5..1.5f64, degree in 1usize..=2, bits in 3i32..=6,
    ) {
        let f = move |x: f64| a * (c * x).sin() + b / (2.5 + x);
        let interval = (low, low + width);
        let best = solve(&f, Monomials::All, degree as u32, interval, bits);
        proptest::prop_assert!(best.proved);
        let reach = if degree == 1 { 60 } else { 24 };
        let brute = brute_force(&f, degree, interval, bits, reach, &best.values);
        // 401 points see the maximum to about 1e-4.
        proptest::prop_assert!(best.error <= brute * (1.0 + 3e-4) + 1e-15, "{} {brute}", best.error);
        proptest::prop_assert!(best.error >= brute * (1.0 - 1e-12), "{} {brute}", best.error);
        proptest::prop_assert!(best.lower_bound <= best.error && best.minimax_error <= best.error * (1.0 + 1e-9));
    }
}

#[test]
fn what_a_format_does_not_hold_is_refused() {
    let f = |x: f64| 3.0 * (x + 0.1).sin();
    let basis = Basis::new(Monomials::All, 3).unwrap();
    let samples = Samples::new(&f, &basis, 0.0, 1.0, Weight::Absolute).unwrap();
    let real = minimax(&samples).unwrap();
    let narrow = CoefficientFormat::from(crate::numeric::format::Format::q(1, 15));
    let refused = Problem::new(&samples, &real, &[narrow]).err().unwrap();
    let crate::error::Error::Input(e) = &refused else {
        panic!()
    };
    assert!(e.message.contains("x^1"), "{refused}");
    assert!(
        e.help.as_deref().unwrap().contains("3 integer bits"),
        "{refused}"
    );
    assert!(Problem::new(&samples, &real, &[narrow; 3]).is_err());
    // Limits hold in the result as well.
    let format = CoefficientFormat {
        fraction_bits: 8,
        min_raw: -200,
        max_raw: 767,
    };
    let problem = Problem::new(&samples, &real, &[format]).unwrap();
    let best = problem.best(Budget::default()).unwrap();
    assert!(
        best.proved && best.raw.iter().all(|r| (-200..=767).contains(r)),
        "{best:?}"
    );
}

/// The list in order of error is what single looks say, and complete.
#[test]
fn enumeration_lists_all_up_to_its_limit() {
    let f = |x: f64| x.exp();
    let basis = Basis::new(Monomials::All, 2).unwrap();
    let samples = Samples::new(&f, &basis, 0.0, 1.0, Weight::Absolute).unwrap();
    let real = minimax(&samples).unwrap();
    let problem = Problem::new(&samples, &real, &[CoefficientFormat::unlimited(8)]).unwrap();
    let limit = 0.014;
    let listed = problem
        .enumerate(limit, 100_000, Budget::default())
        .unwrap();
    assert_eq!(listed.complete_below, limit);
    let mut count = 0;
    for a in 245..=270i128 {
        for b in 180..=260 {
            for c in 180..=260 {
                let raw = vec![a, b, c];
                let error = problem.error(&raw);
                if error <= limit {
                    count += 1;
                    assert!(listed.candidates.iter().any(|k| k.raw == raw));
                }
            }
        }
    }
    assert_eq!(count, listed.candidates.len());
    assert!(count > 10);
    assert!(listed.candidates.is_sorted_by(|a, b| a.error <= b.error));
    let few = problem.enumerate(limit, 5, Budget::default()).unwrap();
    assert_eq!(few.candidates[..], listed.candidates[..5]);
}

/// Where all formats are equal and 1 is in the interval, p(1) is a multiple of their unit: what that
/// leaves is a lower bound, and it is reached.
#[test]
fn a_bound_of_the_lattice_proves_coarse_formats() {
    let best = solve(&|x: f64| x.exp(), Monomials::All, 8, (0.0, 1.0), 15);
    let scaled = 1f64.exp() * 32768.0;
    let truth = (scaled - scaled.round()).abs() / 32768.0;
    assert!(best.proved);
    assert!(
        (best.error / truth - 1.0).abs() < 1e-6,
        "{} {truth}",
        best.error
    );
}

/// A kink between the points: errors are the true ones, and never worse than plain rounding.
#[test]
fn a_kink_is_not_missed() {
    let f = |x: f64| (x - 0.3).abs();
    for bits in [8, 15] {
        let (best, _) = solve_any(&f, Monomials::All, 5, (-1.0, 1.0), bits);
        let dense = (-100_000..=100_000)
            .map(|k| {
                let x = f64::from(k) * 1e-5;
                let p = best.values.iter().rev().fold(0.0, |s, c| s * x + c);
                (f(x) - p).abs()
            })
            .fold(0.0, f64::max);
        assert!(
            (best.error / dense - 1.0).abs() < 1e-4,
            "{} {dense}",
            best.error
        );
        assert!(best.error <= best.rounded.error && best.lower_bound <= best.error);
    }
}
