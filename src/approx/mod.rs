//! Functions in fixed point: approximations with a proved error.
//!
//! [`real`] encloses the function that is wanted, [`minimax`] finds coefficients, [`form`] has the fixed-point
//! forms; [`coefficients`] puts them together for a polynomial, [`choice`] among all forms; [`job`] does what
//! `gyrogen approx` is asked, [`bundle`] emits it.

#[cfg(test)]
pub(crate) mod draws;
pub mod form;
pub mod minimax;
pub mod real;
pub mod reference;
