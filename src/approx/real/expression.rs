//! A function of `x` as a user writes it, kept as a list of operations.
//!
//! Numbers are the exact decimals that were written (0.1 is one tenth). The list's operands stand
//! before their operation: evaluation is one pass, without recursion.

use std::collections::BTreeMap;
use std::fmt;

use super::constants::PI;
use super::interval::Interval;
use super::jet::{Blocked, Jet};
use super::parser;
use crate::error::Result;

/// A function of one argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Function {
    /// Sine of an angle in radians.
    Sin,
    /// Cosine.
    Cos,
    /// Tangent.
    Tan,
    /// Arc sine, in radians.
    Asin,
    /// Arc cosine.
    Acos,
    /// Arc tangent.
    Atan,
    /// Square root.
    Sqrt,
    /// Exponential.
    Exp,
    /// Natural logarithm.
    Log,
    /// Magnitude.
    Abs,
}

impl Function {
    /// All, with their names.
    pub const NAMES: [(&'static str, Function); 10] = [
        ("sin", Function::Sin),
        ("cos", Function::Cos),
        ("tan", Function::Tan),
        ("asin", Function::Asin),
        ("acos", Function::Acos),
        ("atan", Function::Atan),
        ("sqrt", Function::Sqrt),
        ("exp", Function::Exp),
        ("log", Function::Log),
        ("abs", Function::Abs),
    ];

    /// As it is written.
    pub fn name(self) -> &'static str {
        let found = Function::NAMES.iter().find(|(_, f)| *f == self);
        found.map_or("", |(name, _)| name)
    }

    fn in_double(self, u: f64) -> f64 {
        match self {
            Function::Sin => u.sin(),
            Function::Cos => u.cos(),
            Function::Tan => u.tan(),
            Function::Asin => u.asin(),
            Function::Acos => u.acos(),
            Function::Atan => u.atan(),
            Function::Sqrt => u.sqrt(),
            Function::Exp => u.exp(),
            Function::Log => u.ln(),
            Function::Abs => u.abs(),
        }
    }

    fn of(self, u: &Jet) -> std::result::Result<Jet, Blocked> {
        Ok(match self {
            Function::Sin => u.sin(),
            Function::Cos => u.cos(),
            Function::Tan => u.tan()?,
            Function::Asin => u.asin()?,
            Function::Acos => u.acos()?,
            Function::Atan => u.atan(),
            Function::Sqrt => u.sqrt()?,
            Function::Exp => u.exp(),
            Function::Log => u.log()?,
            Function::Abs => u.abs(),
        })
    }
}

/// What an operation does; operands are places in the list.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Kind {
    /// The variable.
    X,
    /// A name whose value comes with every evaluation ([`super::formula`]): its place among them.
    Named {
        text: String,
        place: usize,
    },
    /// A number or a named parameter: as it is written, its value in double precision and exactly.
    Constant {
        text: String,
        double: f64,
        exact: Interval,
    },
    Negate(usize),
    Add(usize, usize),
    Subtract(usize, usize),
    Multiply(usize, usize),
    Divide(usize, usize),
    Power(usize, usize),
    Apply(Function, usize),
}

/// An operation, and where its sign or name stands in the text (1-based, in characters).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Node {
    pub kind: Kind,
    pub column: usize,
    /// The value of an operation that does not depend on `x`, where it has one.
    constant: Option<Interval>,
}

/// Where and why a value is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Trouble {
    /// Place of the operation in the list.
    pub node: usize,
    pub blocked: Blocked,
}

/// A function of `x`.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    nodes: Vec<Node>,
}

impl Expression {
    /// Reads an expression without named parameters.
    pub fn parse(text: &str) -> Result<Expression> {
        Expression::parse_with(text, &BTreeMap::new())
    }

    /// Reads an expression whose other names have the given values (exactly those doubles).
    pub fn parse_with(text: &str, parameters: &BTreeMap<String, f64>) -> Result<Expression> {
        parser::parse(text, parameters)
    }

    /// `c_0 + c_1 x + c_2 x^2 + ...` with exactly these doubles; they are finite.
    pub fn polynomial(coefficients: &[f64]) -> Expression {
        let mut list = Expression { nodes: Vec::new() };
        let constant = |value: f64| Kind::Constant {
            text: format!("{value:?}"),
            double: value,
            exact: Interval::from(value),
        };
        let highest = coefficients.last().copied().unwrap_or(0.0);
        let mut sum = list.push(constant(highest), 1);
        for c in coefficients.iter().rev().skip(1) {
            let x = list.push(Kind::X, 1);
            let product = list.push(Kind::Multiply(sum, x), 1);
            let c = list.push(constant(*c), 1);
            sum = list.push(Kind::Add(product, c), 1);
        }
        list
    }

    pub(super) fn empty() -> Expression {
        Expression { nodes: Vec::new() }
    }

    pub(super) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Appends an operation on operands that are in the list already; one that is there is used again, so
    /// that `x*x` is seen to be a square.
    pub(super) fn push(&mut self, kind: Kind, column: usize) -> usize {
        if let Some(same) = self.nodes.iter().position(|node| node.kind == kind) {
            return same;
        }
        let mut node = Node {
            kind,
            column,
            constant: None,
        };
        let of = |i: usize| self.nodes.get(i).and_then(|n| n.constant);
        let known = match &node.kind {
            Kind::X | Kind::Named { .. } => None,
            Kind::Constant { exact, .. } => Some(*exact),
            Kind::Negate(a) => of(*a).map(|a| -a),
            Kind::Apply(function, a) => of(*a)
                .and_then(|a| function.of(&Jet::constant(a, 1)).ok())
                .map(|jet| jet.value()),
            Kind::Add(a, b)
            | Kind::Subtract(a, b)
            | Kind::Multiply(a, b)
            | Kind::Divide(a, b)
            | Kind::Power(a, b) => of(*a).zip(of(*b)).and_then(|(a, b)| {
                let (a, b) = (Jet::constant(a, 1), Jet::constant(b, 1));
                combined(&node.kind, &a, &b, Some(b.value()))
                    .ok()
                    .map(|jet| jet.value())
            }),
        };
        node.constant = known;
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Whether the value depends on `x`.
    pub fn depends_on_x(&self) -> bool {
        self.nodes.iter().any(|n| n.kind == Kind::X)
    }

    /// The value in double precision; not a number where it is undefined.
    pub fn value(&self, x: f64) -> f64 {
        self.value_with(x, &[], &mut Vec::with_capacity(self.nodes.len()))
    }

    /// The same with the values of the names, in their places; `values` is scratch.
    pub(super) fn value_with(&self, x: f64, named: &[f64], values: &mut Vec<f64>) -> f64 {
        values.clear();
        for node in &self.nodes {
            let value = match &node.kind {
                Kind::X => x,
                Kind::Named { place, .. } => named.get(*place).copied().unwrap_or(f64::NAN),
                Kind::Constant { double, .. } => *double,
                Kind::Negate(a) => -values[*a],
                Kind::Add(a, b) => values[*a] + values[*b],
                Kind::Subtract(a, b) => values[*a] - values[*b],
                Kind::Multiply(a, b) => values[*a] * values[*b],
                Kind::Divide(a, b) => values[*a] / values[*b],
                Kind::Power(a, b) => values[*a].powf(values[*b]),
                Kind::Apply(function, a) => function.in_double(values[*a]),
            };
            values.push(value);
        }
        values.last().copied().unwrap_or(f64::NAN)
    }

    /// Enclosures of the Taylor coefficients at every point of `x`, at most `length` of them.
    pub(super) fn jet(&self, x: Interval, length: usize) -> std::result::Result<Jet, Trouble> {
        let mut jets: Vec<Jet> = Vec::with_capacity(self.nodes.len());
        for (place, node) in self.nodes.iter().enumerate() {
            let jet = match (&node.kind, node.constant) {
                (_, Some(constant)) => Ok(Jet::constant(constant, length)),
                (Kind::X, _) => Ok(Jet::variable(x, length)),
                // Nothing is known of it; only formulas have names, and they are never enclosed.
                (Kind::Named { .. }, _) => Ok(Jet::constant(Interval::WHOLE, length)),
                (Kind::Constant { exact, .. }, _) => Ok(Jet::constant(*exact, length)),
                (Kind::Negate(a), _) => Ok(jets[*a].neg()),
                (Kind::Apply(function, a), _) => function.of(&jets[*a]),
                (
                    Kind::Add(a, b)
                    | Kind::Subtract(a, b)
                    | Kind::Multiply(a, b)
                    | Kind::Divide(a, b)
                    | Kind::Power(a, b),
                    _,
                ) if a == b && matches!(node.kind, Kind::Multiply(..)) => Ok(jets[*a].square()),
                (
                    Kind::Add(a, b)
                    | Kind::Subtract(a, b)
                    | Kind::Multiply(a, b)
                    | Kind::Divide(a, b)
                    | Kind::Power(a, b),
                    _,
                ) => combined(&node.kind, &jets[*a], &jets[*b], self.nodes[*b].constant),
            };
            jets.push(jet.map_err(|blocked| Trouble {
                node: place,
                blocked,
            })?);
        }
        Ok(jets
            .pop()
            .unwrap_or_else(|| Jet::constant(Interval::WHOLE, 1)))
    }

    /// The function that the list computes up to and with one operation.
    pub(super) fn part(&self, node: usize) -> Expression {
        let nodes = self.nodes.iter().take(node + 1).cloned().collect();
        Expression { nodes }
    }

    /// The value over an interval, or why there is none.
    pub(super) fn over(&self, x: Interval) -> std::result::Result<Interval, Trouble> {
        self.jet(x, 1).map(|jet| jet.value())
    }

    /// An enclosure of the value over an interval; the whole line where it may be undefined.
    pub fn enclosed(&self, x: Interval) -> Interval {
        self.over(x).unwrap_or(Interval::WHOLE)
    }

    /// The text of one operation.
    pub(super) fn shown(&self, node: usize) -> String {
        self.written(node, 0)
    }

    fn written(&self, place: usize, around: u8) -> String {
        let Some(node) = self.nodes.get(place) else {
            return String::new();
        };
        let both = |a: usize, sign: &str, b: usize, left: u8, right: u8| {
            format!("{}{sign}{}", self.written(a, left), self.written(b, right))
        };
        let (text, binds) = match &node.kind {
            Kind::X => ("x".to_owned(), 9),
            Kind::Named { text, .. } => (text.clone(), 9),
            Kind::Constant { text, .. } if text.starts_with('-') => (text.clone(), 3),
            Kind::Constant { text, .. } => (text.clone(), 9),
            Kind::Negate(a) => (format!("-{}", self.written(*a, 3)), 3),
            Kind::Add(a, b) => (both(*a, " + ", *b, 1, 2), 1),
            Kind::Subtract(a, b) => (both(*a, " - ", *b, 1, 2), 1),
            Kind::Multiply(a, b) => (both(*a, "*", *b, 2, 3), 2),
            Kind::Divide(a, b) => (both(*a, "/", *b, 2, 3), 2),
            Kind::Power(a, b) => (both(*a, "^", *b, 5, 3), 4),
            Kind::Apply(function, a) => {
                (format!("{}({})", function.name(), self.written(*a, 0)), 9)
            }
        };
        if binds < around {
            format!("({text})")
        } else {
            text
        }
    }
}

/// An operation on two jets; `exponent` is the second one's value if it is constant.
fn combined(
    kind: &Kind,
    a: &Jet,
    b: &Jet,
    exponent: Option<Interval>,
) -> std::result::Result<Jet, Blocked> {
    match kind {
        Kind::Add(..) => Ok(a.add(b)),
        Kind::Subtract(..) => Ok(a.sub(b)),
        Kind::Divide(..) => a.div(b),
        Kind::Power(..) => match exponent {
            Some(e) => match as_integer(e) {
                Some(n) => a.power(n),
                None => a.real_power(e),
            },
            None => a.general_power(b),
        },
        _ => Ok(a.mul(b)),
    }
}

/// The integer that an exponent is exactly.
fn as_integer(exponent: Interval) -> Option<i32> {
    let value = exponent.low.to_f64();
    let whole = exponent.is_point()
        && exponent.low.rest() == 0.0
        && value == value.trunc()
        && value.abs() <= 1e6;
    whole.then_some(value as i32)
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown(self.nodes.len().saturating_sub(1)))
    }
}

/// pi as an operand.
pub(super) fn pi() -> Kind {
    Kind::Constant {
        text: "pi".to_owned(),
        double: std::f64::consts::PI,
        exact: *PI,
    }
}
