use super::*;
use crate::approx::minimax::{
    Basis, CoefficientFormat, Monomials, Samples, Target, Weight, minimax,
};
use crate::numeric::format::Format;
use std::cell::RefCell;
use std::f64::consts::PI;

/// 16-bit input and output, Horner with one rounding a step: t = round(t x + c).
struct Horner<'a> {
    f: &'a dyn Target,
    codes: Vec<(i64, f64)>,
    sample: Vec<(i64, f64)>,
    /// Codes where earlier candidates were worst.
    worst: RefCell<Vec<(i64, f64)>>,
    input_bits: u32,
    coefficient_bits: u32,
    inner_bits: u32,
    output_bits: u32,
}

fn shift(v: i128, by: i32) -> i128 {
    if by <= 0 {
        v << -by
    } else {
        (v + (1 << (by - 1))) >> by
    }
}

impl<'a> Horner<'a> {
    fn new(f: &'a dyn Target, low: f64, high: f64, input_bits: u32) -> Self {
        let unit = 2f64.powi(-(input_bits as i32));
        let (from, to) = ((low / unit).ceil() as i64, (high / unit).floor() as i64);
        let codes: Vec<(i64, f64)> = (from..=to).map(|k| (k, f.value(k as f64 * unit))).collect();
        let sample = codes.iter().copied().step_by(97).collect();
        Horner {
            f,
            codes,
            sample,
            worst: RefCell::default(),
            input_bits,
            coefficient_bits: 14,
            inner_bits: 18,
            output_bits: 15,
        }
    }

    fn run(&self, raw: &[i128], code: i64) -> f64 {
        let (x, c, t) = (
            self.input_bits as i32,
            self.coefficient_bits as i32,
            self.inner_bits as i32,
        );
        let mut value = 0i128;
        for (k, &coefficient) in raw.iter().rev().enumerate() {
            value = if k == 0 {
                shift(coefficient, c - t)
            } else {
                // t x has t + x fraction bits.
                let product = value * i128::from(code);
                shift(product + (coefficient << (t + x - c)), x)
            };
        }
        shift(value, t - self.output_bits as i32) as f64 * 2f64.powi(-(self.output_bits as i32))
    }

    fn largest(&self, raw: &[i128], codes: &[(i64, f64)], limit: f64) -> Option<f64> {
        let mut largest = 0.0f64;
        for &(code, f) in codes {
            let error = (self.run(raw, code) - f).abs();
            if error > limit {
                let mut worst = self.worst.borrow_mut();
                if !worst.contains(&(code, f)) {
                    worst.push((code, f));
                }
                return None;
            }
            largest = largest.max(error);
        }
        Some(largest)
    }
}

impl Datapath for Horner<'_> {
    fn max_error(&self, raw: &[i128], limit: f64) -> Option<f64> {
        self.largest(raw, &self.codes, limit)
    }
    fn sample_error(&self, raw: &[i128], limit: f64) -> Option<f64> {
        let worst = self.worst.borrow().clone();
        self.largest(raw, &worst, limit)?;
        self.largest(raw, &self.sample, limit)
    }
    fn evaluation_bound(&self, raw: &[i128]) -> f64 {
        let steps = raw.len() as f64;
        2f64.powi(-(self.output_bits as i32) - 1) + steps * 2f64.powi(-(self.inner_bits as i32) - 1)
    }
}

fn run(f: &dyn Target, degree: u32, (low, high): (f64, f64), input_bits: u32) -> (Found, Vec<f64>) {
    let datapath = Horner::new(f, low, high, input_bits);
    let unit = 2f64.powi(-(input_bits as i32));
    let basis = Basis::new(Monomials::All, degree).unwrap();
    let nearest = |x: f64| (x / unit).round() * unit;
    let samples =
        Samples::on_codes(datapath.f, &basis, low, high, Weight::Absolute, &nearest).unwrap();
    let real = minimax(&samples).unwrap();
    let format = CoefficientFormat::from(Format::q(2, 14));
    let problem = Problem::new(&samples, &real, &[format]).unwrap();
    let found = search(&problem, &datapath, Effort::default()).unwrap();
    let totals = found.baselines.iter().map(|b| b.total_error).collect();
    assert_eq!(
        datapath.max_error(&found.raw, f64::INFINITY),
        Some(found.total_error)
    );
    (found, totals)
}

#[test]
fn the_loop_beats_the_coefficients_of_real_arithmetic() {
    let atan = |x: f64| x.atan() / (2.0 * PI);
    let sine = |x: f64| (0.5 * PI * x).sin();
    let root = |x: f64| x.sqrt();
    let exp = |x: f64| (-x).exp();
    let log = |x: f64| (1.0 + x).ln();
    let rational = |x: f64| 1.0 / (1.0 + x * x);
    let cases: [(&str, &dyn Target, (f64, f64)); 6] = [
        ("atan", &atan, (0.0, 1.0)),
        ("sine", &sine, (0.0, 1.0)),
        ("root", &root, (0.25, 1.0)),
        ("exp", &exp, (0.0, 1.0)),
        ("log", &log, (0.0, 1.0)),
        ("rational", &rational, (0.0, 1.0)),
    ];
    for (name, f, interval) in cases {
        for degree in 2..=6 {
            if name == "root" && degree > 4 {
                continue; // its coefficients exceed Q2.14
            }
            let t = std::time::Instant::now();
            let (found, totals) = run(f, degree, interval, 15);
            println!(
                "{name:8} {degree}: total {:.4e} ideal {:.4e} | rounded {:.4e} babai {:.4e} ideal {:.4e} | to babai {:.3} proved {} {} evaluations {:.0} ms",
                found.total_error,
                found.ideal_error,
                totals[0],
                totals[1],
                totals[2],
                found.total_error / totals[1],
                found.proved,
                found.evaluations,
                t.elapsed().as_secs_f64() * 1e3
            );
            for (total, what) in totals.iter().zip(["rounded", "babai", "ideal"]) {
                assert!(found.total_error <= *total, "{name} {degree} {what}");
            }
            // Where the heuristic's coefficients are not beaten, they are the optimum.
            assert!(
                found.total_error < totals[1] || found.proved,
                "{name} {degree}"
            );
        }
    }
}
