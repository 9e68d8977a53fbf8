//! The function that a form stands for: expression, domain and enclosure in one, for the search of coefficients
//! and for proofs.

use super::form::measure::Reference;
use super::form::{Number, Piece};
use super::minimax;
use super::real::{Domain, Dyadic, Enclosure, Expression, Target as _};
use crate::error::Result;
use crate::numeric::format::pow2;
use dashu_int::IBig;

/// Significant bits that a coefficient of the expanded polynomial keeps.
const KEPT_BITS: usize = 100;

/// A function on a domain, enclosed.
#[derive(Debug, Clone)]
pub struct Function {
    /// As it was written.
    pub text: String,
    target: (Expression, Domain),
    enclosure: Enclosure,
}

impl Function {
    /// Encloses the expression, aiming at a radius of `tolerance` in its unit.
    ///
    /// # Errors
    /// A place in the domain where the function has no value, or none that can be bounded.
    pub fn new(
        text: &str,
        expression: Expression,
        domain: Domain,
        tolerance: f64,
    ) -> Result<Function> {
        let enclosure = Enclosure::new(&expression, &domain, tolerance);
        let enclosure = enclosure.map_err(|undefined| undefined.in_text(text))?;
        Ok(Function {
            text: text.to_owned(),
            target: (expression, domain),
            enclosure,
        })
    }
}

impl Reference for Function {
    fn at(&self, x: f64) -> (f64, f64) {
        self.enclosure.at(x)
    }

    fn supremum(&self, piece: &Piece, low: f64, high: f64) -> f64 {
        if low >= high {
            let (value, radius) = self.enclosure.at(low);
            let (ideal, slack) = piece.value(low);
            return (value - ideal).abs() + radius + slack;
        }
        let (terms, dropped) = expanded(piece, low.abs().max(high.abs()));
        self.enclosure.supremum(&terms, low, high).upper + dropped
    }

    fn range(&self, low: f64, high: f64) -> (f64, f64) {
        self.enclosure.range(low, high)
    }

    fn domain(&self) -> (f64, f64) {
        self.target.domain()
    }
}

impl minimax::Target for Function {
    fn value(&self, x: f64) -> f64 {
        self.target.value(x)
    }

    fn value_wide(&self, x: minimax::Wide) -> minimax::Wide {
        let high = x.to_f64();
        let low = (x - minimax::Wide::from(high)).to_f64();
        let value = self
            .target
            .value_exactly(super::real::Wide::of_sum(high, low));
        minimax::Wide::sum(value.to_f64(), value.rest())
    }
}

/// The piece's polynomial in x, lowest order first, and a bound on what was dropped for |x| up to `reach`.
fn expanded(piece: &Piece, reach: f64) -> (Vec<Dyadic>, f64) {
    let centre = piece.centre;
    if centre.raw == 0 {
        let dyadic = |t: &Number| Dyadic::new(t.raw, t.fraction_bits);
        return (piece.terms.iter().map(dyadic).collect(), 0.0);
    }
    // Horner's rule with polynomials: q = q (x - c) + t, q on 2^-scale.
    let mut q: Vec<IBig> = Vec::new();
    let mut scale = piece.terms.last().map_or(0, |t| t.fraction_bits);
    for term in piece.terms.iter().rev() {
        let mut next = vec![IBig::ZERO; q.len() + 1];
        for (j, value) in q.iter().enumerate() {
            next[j + 1] += value << centre.fraction_bits.max(0) as usize;
            next[j] -= value * IBig::from(centre.raw);
        }
        if !q.is_empty() {
            scale += centre.fraction_bits;
        }
        if term.fraction_bits > scale {
            let up = (term.fraction_bits - scale) as usize;
            next.iter_mut().for_each(|value| *value <<= up);
            scale = term.fraction_bits;
        }
        next[0] += IBig::from(term.raw) << (scale - term.fraction_bits) as usize;
        q = next;
    }
    let mut dropped = 0.0;
    let mut terms = Vec::with_capacity(q.len());
    for (k, value) in q.into_iter().enumerate() {
        let bits = magnitude_bits(&value);
        let excess = bits.saturating_sub(KEPT_BITS);
        let kept = value >> excess;
        let fraction_bits = scale - excess as i32;
        if excess > 0 {
            dropped += pow2(-fraction_bits) * reach.powi(k as i32);
        }
        terms.push(Dyadic::new(
            i128::try_from(kept).unwrap_or(0),
            fraction_bits,
        ));
    }
    (terms, dropped * (1.0 + 1e-12))
}

fn magnitude_bits(value: &IBig) -> usize {
    use dashu_int::ops::BitTest;
    value.bit_len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_expanded_polynomial_has_the_values_of_the_piece() {
        let number = |raw, fraction_bits| Number { raw, fraction_bits };
        for centre in [number(0, 3), number(-77, 6), number(1_234_567, 21)] {
            let piece = Piece {
                low: 0,
                high: 1,
                centre,
                terms: vec![
                    number(12345, 17),
                    number(-999, 9),
                    number(77, -3),
                    number(5, -11),
                ],
                evaluation_bound: 0.0,
            };
            let (terms, dropped) = expanded(&piece, 2.0);
            assert_eq!(dropped, 0.0);
            for x in [-1.25, 0.0, 0.4, 1.0 / 3.0, 1.9] {
                let sum: f64 = terms
                    .iter()
                    .enumerate()
                    .map(|(k, t)| t.raw as f64 * pow2(-t.fraction_bits) * f64::powi(x, k as i32))
                    .sum();
                let (value, _) = piece.value(x);
                assert!(
                    (sum - value).abs() < 1e-9 * (1.0 + value.abs()),
                    "{x}: {sum} {value}"
                );
            }
        }
    }
}
