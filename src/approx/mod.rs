//! Functions in fixed point: polynomials and tables with proved error.

pub mod minimax;
