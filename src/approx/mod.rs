//! Functions in fixed point: polynomials and tables with proved error.

pub mod bundle;
pub mod choice;
pub mod coefficients;
pub mod cost;
pub mod form;
pub mod job;
pub mod minimax;
pub mod outcome;
pub mod real;
pub mod reference;
