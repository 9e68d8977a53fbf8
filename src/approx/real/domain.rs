//! Where a function is wanted, and why it is not defined there.

use std::fmt;

use super::expression::{Expression, Kind, Trouble};
use super::interval::Interval;
use super::jet::Obstacle;
use super::wide::{Toward, Wide};
use crate::error::{Error, InputError, Result};

/// A closed interval of arguments. Its ends are as exact as they were given: decimals, or constant
/// expressions such as `pi/4`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    /// The lower end.
    pub low: Interval,
    /// The upper end, above the lower one.
    pub high: Interval,
}

impl Domain {
    /// Two constant expressions, in this order.
    ///
    /// # Errors
    /// An end that depends on `x` or has no value; ends that are equal or in the wrong order.
    pub fn new(low: &Expression, high: &Expression) -> Result<Domain> {
        let end = |which: &str, e: &Expression| {
            let value = e.enclosed(Interval::ZERO);
            if e.depends_on_x() || !value.is_bounded() {
                let message = format!("the {which} end `{e}` of the domain is not a number");
                return Err(Error::from(
                    InputError::new(message).help("give a number or a constant such as `pi/4`"),
                ));
            }
            Ok(value)
        };
        let (low_end, high_end) = (end("lower", low)?, end("upper", high)?);
        if low_end.high >= high_end.low {
            let what = match low_end.low <= high_end.high {
                true => "is empty",
                false => "is in the wrong order",
            };
            return Err(
                InputError::new(format!("the domain from {low} to {high} {what}"))
                    .help("give the lower end first, and an upper end above it")
                    .into(),
            );
        }
        Ok(Domain {
            low: low_end,
            high: high_end,
        })
    }

    /// As [`Domain::new`], from text.
    pub fn parse(low: &str, high: &str) -> Result<Domain> {
        Domain::new(&Expression::parse(low)?, &Expression::parse(high)?)
    }

    /// From two doubles, exactly these.
    pub fn between(low: f64, high: f64) -> Result<Domain> {
        Domain::new(
            &Expression::polynomial(&[low]),
            &Expression::polynomial(&[high]),
        )
    }

    /// All arguments, and less than a rounding beyond where an end has no 106 bits.
    pub fn hull(&self) -> Interval {
        self.low.hull(self.high)
    }

    /// The outermost doubles inside; the nearest ones if there are none.
    pub fn inner(&self) -> (f64, f64) {
        let (low, high) = (self.low.high.ceil_f64(), self.high.low.floor_f64());
        if low <= high {
            (low, high)
        } else {
            (self.low.high.to_f64(), self.high.low.to_f64())
        }
    }
}

/// The exact number `raw * 2^-fraction_bits`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Dyadic {
    /// The integer.
    pub raw: i128,
    /// Bits after the point; negative for multiples of a power of two.
    pub fraction_bits: i32,
}

impl Dyadic {
    /// `raw * 2^-fraction_bits`.
    pub fn new(raw: i128, fraction_bits: i32) -> Dyadic {
        Dyadic { raw, fraction_bits }
    }

    /// The number; a point up to 104 significant bits.
    pub fn to_interval(self) -> Interval {
        Interval::from_dyadic(self.raw, self.fraction_bits)
    }

    /// The nearest double, or one of the two nearest beyond 104 significant bits.
    pub fn to_f64(self) -> f64 {
        self.to_interval().low.to_f64()
    }

    /// The dyadic that a finite double is, if its integer is within 2^126; 0 for what is not finite or
    /// smaller than 2^-1000.
    pub fn from_f64(value: f64) -> Dyadic {
        if !value.is_finite() || value.abs() < 1e-300 {
            return Dyadic::new(0, 0);
        }
        let bits = value.to_bits();
        let exponent = ((bits >> 52) & 0x7ff) as i32 - 1075;
        let magnitude = i128::from((bits & ((1 << 52) - 1)) | (1 << 52));
        let raw = if value < 0.0 { -magnitude } else { magnitude };
        Dyadic::new(raw, -exponent)
    }
}

/// A function has no value, or none that can be bounded, somewhere in its domain.
#[derive(Debug, Clone, PartialEq)]
pub struct Undefined {
    /// Near which argument.
    pub at: f64,
    /// What is wrong there, with the operation.
    pub reason: String,
    /// Where the operation stands in the function's text (1-based, in characters), if it has a place.
    pub column_in_text: Option<usize>,
}

impl fmt::Display for Undefined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason)
    }
}

impl std::error::Error for Undefined {}

impl Undefined {
    /// As an error of the input, with the place in `text` (what the user wrote).
    pub fn in_text(&self, text: &str) -> Error {
        let error = InputError::new(self.reason.clone())
            .help("change the function, or choose a domain where it has a bounded value");
        match self.column_in_text {
            Some(column) => {
                let offset = text.char_indices().nth(column.saturating_sub(1));
                error.at_offset(text, offset.map_or(0, |(o, _)| o)).into()
            }
            None => error.into(),
        }
    }

    /// No value that can be bounded.
    pub(super) fn unbounded(f: &Expression, x: Interval) -> Undefined {
        let at = x.middle().to_f64();
        Undefined {
            at,
            reason: format!("the value of `{f}` cannot be bounded near x = {}", place(x)),
            column_in_text: None,
        }
    }

    /// What an operation met.
    pub(super) fn met(f: &Expression, trouble: Trouble, x: Interval) -> Undefined {
        let operation = f.shown(trouble.node);
        let near = place(x);
        let node = f.nodes().get(trouble.node);
        let reason = match trouble.blocked.obstacle {
            Obstacle::Zero => {
                let top = match node.map(|n| &n.kind) {
                    Some(Kind::Divide(top, _)) => f.part(*top).over(x).ok(),
                    _ => Some(Interval::ONE),
                };
                match top {
                    Some(top) if !top.contains_zero() => {
                        format!("`{operation}` has a pole near x = {near}")
                    }
                    _ => format!("`{operation}` divides 0 by 0 near x = {near}"),
                }
            }
            Obstacle::Pole => format!("`{operation}` has a pole near x = {near}"),
            Obstacle::NotPositive => format!(
                "`{operation}` is undefined near x = {near}: its {} must be positive",
                argument(node.map(|n| &n.kind))
            ),
            Obstacle::Negative => format!(
                "`{operation}` is undefined near x = {near}: its {} must not be negative",
                argument(node.map(|n| &n.kind))
            ),
            Obstacle::BeyondOne => format!(
                "`{operation}` is undefined near x = {near}: its argument must lie from -1 to 1"
            ),
        };
        Undefined {
            at: x.middle().to_f64(),
            reason,
            column_in_text: node.map(|n| n.column),
        }
    }
}

fn argument(kind: Option<&Kind>) -> &'static str {
    match kind {
        Some(Kind::Power(..)) => "base",
        _ => "argument",
    }
}

/// An argument in few digits: 0 where an interval of almost no width holds it.
fn place(x: Interval) -> String {
    let middle = x.middle().to_f64();
    let width = x.high.sub(x.low, Toward::Up).to_f64();
    if x.contains_zero() && width < 1e-9 || middle == 0.0 {
        return "0".to_owned();
    }
    let rounded: f64 = format!("{middle:.5e}").parse().unwrap_or(middle);
    // The middle itself if rounding would leave the interval by far.
    let shown = if x.contains(Wide::from(rounded)) || (rounded - middle).abs() < 1e-4 {
        rounded
    } else {
        middle
    };
    format!("{shown}")
}
