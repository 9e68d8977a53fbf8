//! Forms against plain f64 functions.

use super::generate;
use super::measure::{Effort, Reference, measure};
use super::polynomial::{Formats, Monomials, Polynomial, choose_intermediate};
use super::split::{Spacing, Split};
use super::table::Kind;
use super::*;
use crate::numeric::cast::Target;

struct Plain(fn(f64) -> f64, f64, f64);

impl Reference for Plain {
    fn at(&self, x: f64) -> (f64, f64) {
        ((self.0)(x), 1e-14)
    }
    fn supremum(&self, piece: &Piece, low: f64, high: f64) -> f64 {
        let error = |k: i32| {
            let x = low + (high - low) * f64::from(k) / 64.0;
            ((self.0)(x) - piece.value(x).0).abs()
        };
        (0..=64).map(error).fold(0.0, f64::max) * (1.0 + 1e-3) + 1e-13
    }
    fn range(&self, low: f64, high: f64) -> (f64, f64) {
        let values = (0..=64).map(|k| (self.0)(low + (high - low) * f64::from(k) / 64.0));
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        })
    }
    fn domain(&self) -> (f64, f64) {
        (self.1, self.2)
    }
}

fn codes(format: &str, low: f64, high: f64) -> Codes {
    let format: Format = format.parse().unwrap();
    Codes {
        format,
        low: (low / format.lsb()).ceil() as i128,
        high: ((high / format.lsb()).floor() as i128).min(format.max_raw()),
    }
}

fn report(name: &str, form: Form, reference: &dyn Reference) -> (f64, f64) {
    let lsb = form.output().lsb();
    let settled = form.settle().unwrap();
    let effort = Effort {
        most_codes: 1 << 24,
        sample: super::measure::SAMPLE,
        threads: 2,
        progress: &|_| (),
    };
    let m = measure(&settled, reference, &effort).unwrap();
    let cost = crate::tabulate::priced::cost(&settled, crate::design::target::Target::CortexM4);
    println!(
        "{name}: data {:.3} LSB, rounding {:.3}, certified {:.3}, observed {:.3} at {}; {} bits, {cost:?}",
        m.data_only / lsb,
        m.rounding / lsb,
        m.certified / lsb,
        m.observed / lsb,
        m.at_input_raw,
        settled.bits
    );
    assert!(m.observed <= m.certified);
    (m.certified / lsb, m.observed / lsb)
}

#[test]
fn forms_of_a_sine() {
    let f = Plain(|x| (std::f64::consts::PI * x).sin(), -1.0, 1.0);
    let c = codes("Q1.15", -1.0, 1.0);
    let out: Format = "Q1.15".parse().unwrap();
    let symmetry = generate::symmetry(&f, c);
    assert_eq!(symmetry.map(|s| (s.about_raw, s.odd)), Some((0, true)));
    for s in [None, symmetry] {
        for bits in [0, 6, 8] {
            let split = Split::new(c, s, Spacing::Uniform { bits });
            for (kind, f_bits) in [(Kind::Plain, 15), (Kind::Linear, 17), (Kind::Quadratic, 18)] {
                let form = generate::table(&f, split.clone(), kind, out, f_bits).unwrap();
                report(&format!("{kind:?} {bits} {}", s.is_some()), form, &f);
            }
            for degree in 1..=4 {
                let form = generate::piecewise(&f, split.clone(), degree, out, 18).unwrap();
                report(
                    &format!("piecewise {degree} {bits} {}", s.is_some()),
                    form,
                    &f,
                );
            }
        }
        for steps in 1..=4 {
            let split = Split::new(c, s, Spacing::PowerOfTwo { steps });
            let form = generate::piecewise(&f, split.clone(), 4, out, 18).unwrap();
            report(&format!("power of two {steps} {}", s.is_some()), form, &f);
        }
        let form = generate::bipartite(&f, c, s, (5, 5), out, 17).unwrap();
        report(&format!("bipartite {}", s.is_some()), form, &f);
    }
}

#[test]
fn a_polynomial_of_a_sine() {
    let f = Plain(|x| (std::f64::consts::FRAC_PI_2 * x).sin(), 0.0, 1.0);
    let c = codes("Q1.15", 0.0, 1.0);
    let coefficients: Format = "Q2.14".parse().unwrap();
    let output: Format = "Q1.15".parse().unwrap();
    let raw: Vec<i128> = [0.0, 1.5706268, 0.0, -0.6432292, 0.0, 0.0727102]
        .iter()
        .map(|c| (c * 16384.0f64).round() as i128)
        .collect();
    let wide = choose_intermediate(
        c,
        coefficients.into(),
        (output, Default::default()),
        Monomials::Odd,
        &raw,
    )
    .unwrap();
    println!("intermediate {wide}");
    for intermediate in [wide, "Q2.14".parse().unwrap()] {
        let formats = Formats {
            codes: c,
            coefficients: coefficients.into(),
            intermediate: Target::from(intermediate),
            output,
            scheme: Default::default(),
        };
        let p = Polynomial::new(formats, Monomials::Odd, raw.clone()).unwrap();
        report(
            &format!("odd 5 {intermediate}"),
            Form::Polynomial(Box::new(p)),
            &f,
        );
    }
}
