//! What is asked: a function, its domain, formats, form and bound.

use crate::approx::form::polynomial::{Monomials, Scheme};
use crate::design::target::Target;
use crate::numeric::format::Format;
use std::collections::BTreeMap;

/// Codes that are all run if nobody says `--exhaustive`.
pub const EXHAUSTIVE_CODES: u128 = 1 << 24;

/// Codes that are all run if somebody does.
pub const MOST_CODES: u128 = 1 << 32;

/// Which form is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Asked {
    /// One polynomial.
    #[default]
    Polynomial,
    /// A table.
    Table,
    /// A polynomial for each segment.
    Piecewise,
    /// The cheapest that meets the bound.
    Auto,
}

/// What the error is weighed with when coefficients are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weight {
    /// The function's own unit.
    #[default]
    Absolute,
    /// Parts of the function's magnitude.
    Relative,
}

/// A request.
#[derive(Debug, Clone)]
pub struct Request {
    /// The expression.
    pub function: String,
    /// Named values in it.
    pub parameters: BTreeMap<String, f64>,
    /// Both ends, constant expressions.
    pub domain: [String; 2],
    /// Highest order.
    pub degree: Option<usize>,
    /// Which monomials; all, or with a bound whatever is cheapest, if not given.
    pub monomials: Option<Monomials>,
    /// Of the input.
    pub input: Format,
    /// Of the output.
    pub output: Format,
    /// Of coefficients or entries; of a polynomial one for all or one a monomial, lowest order first; none = chosen.
    pub coefficients: Vec<Format>,
    /// Of the cast after each step.
    pub intermediate: Option<Format>,
    /// The order of a polynomial's steps.
    pub evaluation: Scheme,
    /// Which form.
    pub form: Asked,
    /// The most that the certified error may be.
    pub bound: Option<f64>,
    /// For the choice of coefficients.
    pub weight: Weight,
    /// Run up to 2^32 codes.
    pub exhaustive: bool,
    /// For the estimate of cycles.
    pub target: Target,
    /// Prefix of the emitted names.
    pub name: String,
}

impl Request {
    /// One line for each thing asked, in a fixed order: what the result depends on.
    pub fn canonical(&self) -> String {
        let mut text = format!("function = {}\n", self.function);
        for (name, value) in &self.parameters {
            text += &format!("parameter {name} = {value:e}\n");
        }
        let some = |f: Option<Format>| f.map_or("chosen".to_owned(), |f| f.to_string());
        text += &format!(
            "domain = {}, {}\ndegree = {:?}\nmonomials = {:?}\ninput = {}\noutput = {}\n",
            self.domain[0], self.domain[1], self.degree, self.monomials, self.input, self.output
        );
        let formats: Vec<String> = self.coefficients.iter().map(Format::to_string).collect();
        let list = match formats.as_slice() {
            [] => "chosen".to_owned(),
            some => some.join(","),
        };
        if self.evaluation != Scheme::default() {
            text += &format!("evaluation = {:?}\n", self.evaluation);
        }
        text += &format!(
            "coefficients = {}\nintermediate = {}\nform = {:?}\nbound = {:?}\nweight = {:?}\ntarget = {:?}\nname = {}\n",
            list,
            some(self.intermediate),
            self.form,
            self.bound,
            self.weight,
            self.target,
            self.name
        );
        text
    }
}
