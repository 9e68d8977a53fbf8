//! Which monomials a polynomial has, and the well-conditioned functions that span the same space.

use super::wide::Wide;
use crate::error::{InputError, Result};

/// The highest degree: beyond it, monomials on a short interval far from 0 exhaust 106 bits.
pub const MOST_DEGREE: u32 = 24;

/// All powers up to the degree, or every second one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Monomials {
    /// 1, x, x^2, ...
    All,
    /// x, x^3, x^5, ...
    Odd,
    /// 1, x^2, x^4, ...
    Even,
}

/// The monomials of a polynomial.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Basis {
    /// Their kind.
    pub monomials: Monomials,
    /// Their exponents, ascending.
    pub exponents: Vec<u32>,
}

impl Basis {
    /// The monomials up to `degree`. An odd basis ends at the largest odd number up to it, an even
    /// one likewise. Refused: a degree above [`MOST_DEGREE`], an odd basis of degree 0.
    pub fn new(monomials: Monomials, degree: u32) -> Result<Basis> {
        if degree > MOST_DEGREE {
            return Err(InputError::new(format!(
                "degree {degree} is too high: the highest is {MOST_DEGREE}"
            ))
            .help("use a piecewise polynomial or a table")
            .into());
        }
        let (first, step) = match monomials {
            Monomials::All => (0, 1),
            Monomials::Odd => (1, 2),
            Monomials::Even => (0, 2),
        };
        let exponents: Vec<u32> = (first..=degree).step_by(step).collect();
        if exponents.is_empty() {
            return Err(InputError::new("an odd polynomial of degree 0 has no monomial").into());
        }
        Ok(Basis {
            monomials,
            exponents,
        })
    }

    /// The number of monomials.
    pub fn len(&self) -> usize {
        self.exponents.len()
    }

    /// Never true for a basis made by [`Basis::new`].
    pub fn is_empty(&self) -> bool {
        self.exponents.is_empty()
    }

    /// The monomials at `x`.
    pub fn monomials_at(&self, x: Wide) -> Vec<Wide> {
        self.exponents.iter().map(|&e| x.powi(e)).collect()
    }

    /// Value of the polynomial with these coefficients (one a monomial) at `x`.
    pub fn value(&self, coefficients: &[Wide], x: Wide) -> Wide {
        let (first, step) = self.progression();
        let factor = x.powi(step);
        let sum = coefficients
            .iter()
            .rev()
            .fold(Wide::ZERO, |sum, &c| sum * factor + c);
        if first == 0 { sum } else { sum * x }
    }

    /// Least exponent and the step between exponents.
    pub(super) fn progression(&self) -> (u32, u32) {
        match self.monomials {
            Monomials::All => (0, 1),
            Monomials::Odd => (1, 2),
            Monomials::Even => (0, 2),
        }
    }
}

/// x^s T_j(u) with u = (x^d - middle) / half, where d and s are the basis' step and least exponent:
/// they span what the monomials span, and systems in them are well conditioned.
#[derive(Debug, Clone)]
pub(super) struct Chebyshev {
    least: u32,
    step: u32,
    middle: Wide,
    half: Wide,
    terms: usize,
}

impl Chebyshev {
    /// For `basis` on [low, high].
    pub(super) fn new(basis: &Basis, low: f64, high: f64) -> Chebyshev {
        let (least, step) = basis.progression();
        let (mut from, mut to) = (Wide::from(low).powi(step), Wide::from(high).powi(step));
        if step == 2 {
            if low < 0.0 && high > 0.0 {
                (from, to) = (Wide::ZERO, if from > to { from } else { to });
            } else if from > to {
                (from, to) = (to, from);
            }
        }
        Chebyshev {
            least,
            step,
            middle: (from + to).scaled(0.5),
            half: (to - from).scaled(0.5),
            terms: basis.len(),
        }
    }

    /// The functions at `x`.
    pub(super) fn at(&self, x: f64) -> Vec<Wide> {
        let x = Wide::from(x);
        let u = (x.powi(self.step) - self.middle) / self.half;
        let mut previous = x.powi(self.least);
        let mut current = previous * u;
        let mut values = Vec::with_capacity(self.terms);
        for _ in 0..self.terms {
            values.push(previous);
            let next = (u * current).scaled(2.0) - previous;
            previous = current;
            current = next;
        }
        values
    }

    /// Coefficients of the monomials from those of these functions.
    pub(super) fn to_monomials(&self, coefficients: &[Wide]) -> Vec<Wide> {
        let n = self.terms;
        let mut sum = vec![Wide::ZERO; n];
        let mut previous = vec![Wide::ZERO; n];
        let mut current = vec![Wide::ZERO; n];
        previous[0] = Wide::ONE;
        let scale = Wide::ONE / self.half;
        let times_u = |p: &[Wide]| -> Vec<Wide> {
            (0..n)
                .map(|k| {
                    let below = if k == 0 { Wide::ZERO } else { p[k - 1] };
                    (below - self.middle * p[k]) * scale
                })
                .collect()
        };
        if n > 1 {
            current = times_u(&previous);
        }
        for &a in coefficients {
            for (s, p) in sum.iter_mut().zip(&previous) {
                *s += a * *p;
            }
            let next = times_u(&current)
                .iter()
                .zip(&previous)
                .map(|(t, p)| t.scaled(2.0) - *p)
                .collect();
            previous = std::mem::replace(&mut current, next);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn monomials_and_chebyshev_functions_are_the_same_polynomial() {
        for (kind, degree, low, high) in [
            (Monomials::All, 12, 0.0, 1.0),
            (Monomials::Odd, 11, 0.0, 1.5),
            (Monomials::Even, 10, -2.0, 1.0),
            (Monomials::All, 5, 3.0, 4.0),
        ] {
            let basis = Basis::new(kind, degree).unwrap();
            let functions = Chebyshev::new(&basis, low, high);
            let a: Vec<Wide> = (0..basis.len())
                .map(|k| Wide::from(1.0 / (k as f64 + 1.5)))
                .collect();
            let c = functions.to_monomials(&a);
            for k in 0..=10 {
                let x = low + (high - low) * f64::from(k) / 10.0;
                let direct = super::super::wide::dot(&a, &functions.at(x));
                let other = basis.value(&c, Wide::from(x));
                assert!((direct - other).hi.abs() < 1e-20, "{kind:?} at {x}");
                let plain = super::super::wide::dot(&c, &basis.monomials_at(Wide::from(x)));
                assert!((plain - other).hi.abs() < 1e-20);
            }
        }
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(Basis::new(Monomials::All, 25).is_err());
        assert!(Basis::new(Monomials::Odd, 0).is_err());
        assert_eq!(Basis::new(Monomials::Odd, 6).unwrap().exponents, [1, 3, 5]);
        assert_eq!(Basis::new(Monomials::Even, 5).unwrap().exponents, [0, 2, 4]);
    }
}
