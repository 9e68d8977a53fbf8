//! Functions in fixed point: approximations with a proved error.
//!
//! [`real`] encloses the function that is wanted, [`minimax`] finds coefficients, [`form`] has the fixed-point
//! forms. What `gyrogen approx` makes of them is in [`crate::tabulate`].

#[cfg(test)]
pub(crate) mod draws;
pub mod form;
pub mod minimax;
pub mod real;
pub mod reference;
