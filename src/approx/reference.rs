//! The function that a form stands for: expression, domain and enclosure in one, for the search of coefficients
//! and for proofs.

use super::form::measure::Reference;
use super::form::{Number, Piece};
use super::minimax;
use super::real::{Domain, Dyadic, Enclosure, Expression, Target as _};
use crate::error::{InputError, Result};

/// How many times the radius aimed at is too much for any search or proof (convention: of the 2^-34 LSB of
/// `gyrogen approx` an eighth of an LSB is left); what lies below is slower and still proved.
const LOOSE: f64 = 2_147_483_648.0;

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
    /// A place in the domain where the function has no value, or none that can be bounded; a function that turns so often
    /// that it cannot be enclosed in as many segments as there may be.
    pub fn new(
        text: &str,
        expression: Expression,
        domain: Domain,
        tolerance: f64,
    ) -> Result<Function> {
        let enclosure = Enclosure::new(&expression, &domain, tolerance);
        let enclosure = enclosure.map_err(|undefined| undefined.in_text(text))?;
        if enclosure.is_cut_short() && enclosure.radius() > tolerance * LOOSE {
            let pieces = enclosure.segments().len();
            return Err(InputError::new(format!(
                "the function `{text}` turns too often on its domain: {pieces} pieces, which are the most, leave it unknown by \
                 {:.1e}",
                enclosure.radius()
            ))
            .help(
                "narrow the domain, or split it over several calls; a call inside a call multiplies how often its function \
                 turns, so that each level costs as many times more",
            )
            .into());
        }
        Ok(Function {
            text: text.to_owned(),
            target: (expression, domain),
            enclosure,
        })
    }

    /// Encloses the polynomial with exactly these coefficients, lowest order first, from `low` to `high`.
    ///
    /// # Errors
    /// An empty domain; a coefficient that is not finite.
    pub fn of_polynomial(coefficients: &[f64], (low, high): (f64, f64)) -> Result<Function> {
        let domain = Domain::between(low, high)?;
        let enclosure = Enclosure::of_polynomial(coefficients, &domain).map_err(|e| {
            InputError::new(format!("the polynomial cannot be bounded: {}", e.reason))
        })?;
        Ok(Function {
            text: "polynomial".to_owned(),
            target: (Expression::polynomial(coefficients), domain),
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
        let dyadic = |n: &Number| Dyadic::new(n.raw, n.fraction_bits);
        let terms: Vec<Dyadic> = piece.terms.iter().map(dyadic).collect();
        let about = dyadic(&piece.centre);
        self.enclosure
            .supremum_about(&terms, about, low, high)
            .upper
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
