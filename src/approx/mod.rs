//! Functions in fixed point: approximations with a proved error.
//!
//! [`real`] encloses the function that is wanted.

pub mod real;
