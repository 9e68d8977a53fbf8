//! Real functions with proved enclosures.
//!
//! In reading order: [`wide`] (numbers of 106 bits, rounded either way), [`interval`] and `elementary`
//! (rigorous intervals), [`jet`] (Taylor coefficients over intervals), [`expression`] and [`parser`]
//! (what a user writes; [`formula`]: with names of its own), [`domain`], [`segment`] and [`enclosure`] (a function as Taylor polynomials
//! with radii), [`supremum`] (how far a polynomial is from it, at most) and [`derivatives`].

mod constants;
pub mod derivatives;
pub mod domain;
mod elementary;
pub mod enclosure;
pub mod expression;
pub mod formula;
pub mod interval;
pub mod jet;
pub mod parser;
mod search;
pub mod segment;
pub mod supremum;
pub mod wide;

pub use domain::{Domain, Dyadic, Undefined};
pub use enclosure::Enclosure;
pub use expression::Expression;
pub use formula::Formula;
pub use interval::Interval;
pub use supremum::Supremum;
pub use wide::Wide;

/// A function to approximate.
pub trait Target {
    /// The value in double precision; not a number where it is undefined.
    fn value(&self, x: f64) -> f64;
    /// The value to some 30 digits at an argument of 106 bits; infinite parts where it is undefined.
    fn value_exactly(&self, x: Wide) -> Wide;
    /// The outermost doubles inside the domain.
    fn domain(&self) -> (f64, f64);
}

impl Target for (Expression, Domain) {
    fn value(&self, x: f64) -> f64 {
        self.0.value(x)
    }

    fn value_exactly(&self, x: Wide) -> Wide {
        known_middle(self.0.enclosed(Interval::from(x)))
    }

    fn domain(&self) -> (f64, f64) {
        self.1.inner()
    }
}

impl Target for Enclosure {
    fn value(&self, x: f64) -> f64 {
        self.function.value(x)
    }

    fn value_exactly(&self, x: Wide) -> Wide {
        known_middle(self.function.enclosed(Interval::from(x)))
    }

    fn domain(&self) -> (f64, f64) {
        Enclosure::domain(self).inner()
    }
}

fn known_middle(value: Interval) -> Wide {
    if value.is_bounded() {
        value.middle()
    } else {
        Wide::INFINITY
    }
}

#[cfg(test)]
mod enclosure_tests;
#[cfg(test)]
mod expression_tests;
#[cfg(test)]
mod interval_tests;
#[cfg(test)]
mod supremum_tests;
