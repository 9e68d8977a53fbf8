//! Which orders a polynomial has.

/// The highest degree.
pub const HIGHEST_DEGREE: usize = 24;

/// Which monomials a polynomial has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Monomials {
    /// 1, x, x^2, ..
    #[default]
    All,
    /// x, x^3, x^5, ..
    Odd,
    /// 1, x^2, x^4, ..
    Even,
}

impl Monomials {
    /// The exponents up to `degree`, lowest first.
    pub fn exponents(self, degree: usize) -> Vec<usize> {
        match self {
            Monomials::All => (0..=degree).collect(),
            Monomials::Odd => (1..=degree).step_by(2).collect(),
            Monomials::Even => (0..=degree).step_by(2).collect(),
        }
    }
}
