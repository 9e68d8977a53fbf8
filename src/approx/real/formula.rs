//! A formula in named quantities: the same language as an [`Expression`], with names instead of `x`.

use super::expression::{Expression, Kind};
use super::parser;
use crate::error::Result;

/// A formula whose names get their values with every evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula {
    expression: Expression,
    names: Vec<String>,
}

/// What stands for a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Operand<'a> {
    /// One number for all rows.
    Number(f64),
    /// A number for each row.
    Column(&'a [f64]),
}

/// How a formula depends on its amplitudes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Degree {
    /// Not at all.
    None,
    /// It is a sum of products of one amplitude each with something without amplitudes.
    Linear,
}

/// Where a formula is not linear in its amplitudes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NotLinear {
    /// 1-based column of the operation, in characters.
    pub column: usize,
    /// The operation as it is written.
    pub part: String,
    /// True where a part with an amplitude and one without are added.
    pub is_sum: bool,
}

impl Formula {
    /// Reads a formula. Every name that is neither a function nor `pi` is a name of its own.
    ///
    /// # Errors
    /// What is no expression, with its column; an unknown function.
    pub fn parse(text: &str) -> Result<Formula> {
        let (expression, names) = parser::parse_named(text)?;
        Ok(Formula { expression, names })
    }

    /// Its names, in the order in which they are met.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The value in each of `rows` rows, the operands in the order of the names; not a number where it
    /// is undefined or an operand is missing.
    pub fn values(&self, operands: &[Operand<'_>], rows: usize) -> Vec<f64> {
        let mut named = vec![f64::NAN; self.names.len()];
        let mut scratch = Vec::new();
        (0..rows)
            .map(|row| {
                for (value, operand) in named.iter_mut().zip(operands) {
                    *value = match operand {
                        Operand::Number(number) => *number,
                        Operand::Column(column) => column.get(row).copied().unwrap_or(f64::NAN),
                    };
                }
                self.expression.value_with(0.0, &named, &mut scratch)
            })
            .collect()
    }

    /// How it depends on the names for which `is_amplitude` holds.
    ///
    /// # Errors
    /// It is neither free of them nor a sum of terms with one of them each, as a factor.
    pub fn degree(
        &self,
        is_amplitude: impl Fn(&str) -> bool,
    ) -> std::result::Result<Degree, NotLinear> {
        let mut degrees: Vec<Degree> = Vec::new();
        for (place, node) in self.expression.nodes().iter().enumerate() {
            let of = |i: &usize| degrees.get(*i).copied().unwrap_or(Degree::None);
            let refused = |is_sum| NotLinear {
                column: node.column,
                part: self.expression.shown(place),
                is_sum,
            };
            use Degree::{Linear, None};
            let degree = match &node.kind {
                Kind::X | Kind::Constant { .. } => None,
                Kind::Named { text, .. } if is_amplitude(text) => Linear,
                Kind::Named { .. } => None,
                Kind::Negate(a) => of(a),
                Kind::Add(a, b) | Kind::Subtract(a, b) if of(a) == of(b) => of(a),
                Kind::Add(..) | Kind::Subtract(..) => return Err(refused(true)),
                Kind::Multiply(a, b) => match (of(a), of(b)) {
                    (Linear, Linear) => return Err(refused(false)),
                    (None, None) => None,
                    _ => Linear,
                },
                Kind::Divide(a, b) if of(b) == None => of(a),
                Kind::Power(a, b) if of(a) == None && of(b) == None => None,
                Kind::Apply(_, a) if of(a) == None => None,
                Kind::Divide(..) | Kind::Power(..) | Kind::Apply(..) => return Err(refused(false)),
            };
            degrees.push(degree);
        }
        Ok(degrees.last().copied().unwrap_or(Degree::None))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Formula {
        Formula::parse(text).unwrap()
    }

    #[test]
    fn rows_are_evaluated_with_numbers_and_columns() {
        let f = read("gain*sin(2*pi*t/period) + x^2 - -x");
        assert_eq!(f.names(), ["gain", "t", "period", "x"]);
        let t = [0.0, 1.0, 2.0];
        let x = [3.0, 0.5];
        let values = f.values(
            &[
                Operand::Number(2.0),
                Operand::Column(&t),
                Operand::Number(4.0),
                Operand::Column(&x),
            ],
            3,
        );
        assert_eq!(values[0], 12.0);
        assert_eq!(values[1], 2.0 + 0.25 + 0.5);
        // A row without a value of x.
        assert!(values[2].is_nan());
        assert!(f.values(&[], 1)[0].is_nan());
    }

    #[test]
    fn amplitudes_are_told_from_other_parameters() {
        let degree = |text: &str| read(text).degree(|name| name == "a" || name == "b");
        for text in [
            "a*t",
            "a*sin(c*t) - b*t/c",
            "-(a + b)*t",
            "t*a/2",
            "(a*t + b)*c",
        ] {
            assert_eq!(degree(text), Ok(Degree::Linear), "{text}");
        }
        for text in ["t", "sin(c*t)^2", "exp(-t/c)"] {
            assert_eq!(degree(text), Ok(Degree::None), "{text}");
        }
        for (text, column, part, is_sum) in [
            ("a*t + t", 5, "a*t + t", true),
            ("a*b*t", 2, "a*b", false),
            ("t*sin(a*t)", 3, "sin(a*t)", false),
            ("t/a", 2, "t/a", false),
            ("(a*t)^2", 6, "(a*t)^2", false),
            ("2^a", 2, "2^a", false),
        ] {
            let part = part.to_owned();
            let expected = NotLinear {
                column,
                part,
                is_sum,
            };
            assert_eq!(degree(text), Err(expected), "{text}");
        }
    }

    #[test]
    fn what_is_no_formula_is_refused_with_its_column() {
        for (text, column, what) in [
            ("gain*tanh(t)", 6, "unknown function `tanh`"),
            ("gain*ln(t)", 6, "unknown function `ln`"),
            ("gain*e", 6, "unknown name `e`"),
            ("gain*(t", 8, "is open"),
            ("gain t", 6, "expected an operator"),
            ("gain*", 6, "expected a number, a name or a function"),
            ("", 1, "expected a number, a name or a function"),
            ("gain**t", 6, "met `*`"),
        ] {
            let crate::error::Error::Input(e) = Formula::parse(text).unwrap_err() else {
                panic!("{text}");
            };
            assert!(e.message.contains(what), "{text}: {}", e.message);
            assert_eq!(e.column, Some(column), "{text}");
        }
    }
}
