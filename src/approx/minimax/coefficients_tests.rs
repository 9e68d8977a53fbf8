use super::*;
use crate::approx::minimax::{
    Basis, CoefficientFormat, Monomials, Samples, Target, Weight, minimax,
};
use std::f64::consts::PI;
use std::time::Instant;

fn solve(f: &dyn Target, kind: Monomials, degree: u32, (low, high): (f64, f64), bits: i32) -> Best {
    let basis = Basis::new(kind, degree).unwrap();
    let samples = Samples::new(f, &basis, low, high, Weight::Absolute).unwrap();
    let real = minimax(&samples).unwrap();
    assert!(real.converged, "{real:?}");
    let problem = Problem::new(&samples, &real, &[CoefficientFormat::unlimited(bits)]).unwrap();
    problem.best(Budget::default()).unwrap()
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
    let cases: [(&str, &dyn Target, Monomials, u32, (f64, f64), i32, f64); 12] = [
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
        assert!(b.proved || name == "sqrt 4", "{name}");
        // Goals have three digits: cut or rounded, they stand for less than the next one.
        assert!(b.error < goal * 1.001, "{name}: {}", b.error);
    }
}
