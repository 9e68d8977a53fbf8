//! The formats of a polynomial's coefficients: one for all, or one for each.

use super::polynomial::{HIGHEST_DEGREE, Monomials};
use crate::error::{InputError, Result};
use crate::numeric::format::Format;

/// A format for every order up to [`HIGHEST_DEGREE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CoefficientFormats {
    by_order: [Format; HIGHEST_DEGREE + 1],
}

impl From<Format> for CoefficientFormats {
    /// One format for all.
    fn from(format: Format) -> Self {
        CoefficientFormats {
            by_order: [format; HIGHEST_DEGREE + 1],
        }
    }
}

impl CoefficientFormats {
    /// One for all, or one a monomial, lowest order first.
    ///
    /// # Errors
    /// Another number of formats.
    pub fn new(formats: &[Format], kind: Monomials, degree: usize) -> Result<Self> {
        let orders = kind.exponents(degree);
        let Some(first) = formats.first() else {
            return Err(InputError::new("no format for the coefficients is given")
                .help("say `--coefficients Qm.n`")
                .into());
        };
        let mut all = CoefficientFormats::from(*first);
        if formats.len() == 1 {
            return Ok(all);
        }
        if formats.len() != orders.len() {
            let names: Vec<String> = orders.iter().map(|k| format!("x^{k}")).collect();
            return Err(InputError::new(format!(
                "{} formats are given for {} coefficients, those of {}",
                formats.len(),
                orders.len(),
                names.join(", ")
            ))
            .help("give one format for all, or one for each coefficient, lowest order first")
            .into());
        }
        for (order, format) in orders.into_iter().zip(formats) {
            if let Some(place) = all.by_order.get_mut(order) {
                *place = *format;
            }
        }
        Ok(all)
    }

    /// Of the coefficient of x^order.
    pub fn of(&self, order: usize) -> Format {
        let [first, ..] = self.by_order;
        self.by_order.get(order).copied().unwrap_or(first)
    }

    /// The finest coefficient's fraction bits, among orders up to `degree`.
    pub fn most_fraction_bits(&self, kind: Monomials, degree: usize) -> u32 {
        let orders = kind.exponents(degree).into_iter();
        orders.map(|k| self.of(k).fraction_bits).max().unwrap_or(0)
    }

    /// One a monomial, lowest order first.
    pub fn each(&self, kind: Monomials, degree: usize) -> Vec<Format> {
        let orders = kind.exponents(degree).into_iter();
        orders.map(|k| self.of(k)).collect()
    }

    /// As on the command line: one name if they are all the same.
    pub fn name(&self, kind: Monomials, degree: usize) -> String {
        let mut names = self.each(kind, degree);
        if names.iter().all(|f| Some(f) == names.first()) {
            names.truncate(1);
        }
        let names: Vec<String> = names.iter().map(Format::to_string).collect();
        names.join(",")
    }
}
