//! Reads expressions: a Pratt parser with the column of every mistake.
//!
//! `+ -` bind least, then `* /`, then the sign, then `^` (right associative): `-x^2` is `-(x^2)`,
//! `2^-3^2` is `2^(-(3^2))`.

use std::collections::BTreeMap;

use dashu_int::IBig;

use super::expression::{Expression, Function, Kind, pi};
use super::interval::Interval;
use crate::error::{InputError, Result};
use crate::nearest::nearest;

/// Longest text, in bytes.
const LONGEST: usize = 4000;
/// Deepest nesting of parentheses, signs and powers.
const DEEPEST: usize = 100;
/// Digits of a number, and magnitude of its exponent.
const DIGITS: usize = 100;
const EXPONENT: i64 = 300;

/// What other languages call the functions and constants.
const ALIASES: [(&str, &str); 13] = [
    ("ln", "log"),
    ("log10", "log(...)/log(10)"),
    ("log2", "log(...)/log(2)"),
    ("arcsin", "asin"),
    ("arccos", "acos"),
    ("arctan", "atan"),
    ("arctan2", "atan"),
    ("atan2", "atan"),
    ("fabs", "abs"),
    ("root", "sqrt"),
    ("pow", "^"),
    ("power", "^"),
    ("e", "exp(1)"),
];

#[derive(Debug, Clone, PartialEq)]
enum Token<'a> {
    Number(&'a str),
    Name(&'a str),
    Sign(char),
    End,
}

struct Parser<'a> {
    text: &'a str,
    parameters: &'a BTreeMap<String, f64>,
    /// The names that stand for themselves, in the order in which they are met; `None`: there are none,
    /// and the variable is `x`.
    names: Option<Vec<String>>,
    /// What the variable is called ([`variable`]).
    variable: &'a str,
    /// Byte offset of the token that is looked at, and of what follows it.
    start: usize,
    next: usize,
    token: Token<'a>,
    depth: usize,
    list: Expression,
}

/// Reads `text`; names that are neither functions nor `x` nor `pi` have the values of `parameters`.
pub(super) fn parse(text: &str, parameters: &BTreeMap<String, f64>) -> Result<Expression> {
    Ok(read(text, parameters, None)?.list)
}

/// Reads `text`; every name that is neither a function nor `pi` stands for itself. Returns these, by
/// their places.
pub(super) fn parse_named(text: &str) -> Result<(Expression, Vec<String>)> {
    let none = BTreeMap::new();
    let parser = read(text, &none, Some(Vec::new()))?;
    Ok((parser.list, parser.names.unwrap_or_default()))
}

/// The name of the variable: `x`, or, in a text without `x`, the only other letter that stands for nothing
/// else (`136.82*p^2 + 242.97*p`).
fn variable<'a>(text: &'a str, parameters: &BTreeMap<String, f64>) -> &'a str {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let mut letters = Vec::new();
    for word in text.split(|c: char| !is_name(c)) {
        // `2p` is refused later: a number needs a sign before a name.
        let open = word.chars().count() == 1 && word.chars().all(char::is_alphabetic);
        let taken = word == "e" || parameters.contains_key(word);
        if word == "x" {
            return "x";
        }
        if open && !taken && !letters.contains(&word) {
            letters.push(word);
        }
    }
    match letters.as_slice() {
        [only] => only,
        _ => "x",
    }
}

/// Reads all of `text`.
fn read<'a>(
    text: &'a str,
    parameters: &'a BTreeMap<String, f64>,
    names: Option<Vec<String>>,
) -> Result<Parser<'a>> {
    if text.len() > LONGEST {
        return Err(InputError::new(format!(
            "an expression of {} characters; at most {LONGEST} are read",
            text.len()
        ))
        .into());
    }
    for (name, value) in parameters {
        check_parameter(name, *value)?;
    }
    let mut parser = Parser {
        text,
        parameters,
        names,
        variable: variable(text, parameters),
        start: 0,
        next: 0,
        token: Token::End,
        depth: 0,
        list: Expression::empty(),
    };
    parser.advance()?;
    parser.sum(0)?;
    match parser.token {
        Token::End => Ok(parser),
        Token::Sign(')') => Err(parser.wrong(
            "there is no `(` before this `)`",
            Some("take it away, or write the `(` that it closes".to_owned()),
        )),
        Token::Sign('*') => {
            let help = "a power is written with `^`".to_owned();
            let message = format!("expected {} after `*`, met `*`", parser.operands());
            Err(parser.wrong(&message, Some(help)))
        }
        Token::Number(_) | Token::Name(_) | Token::Sign('(') => Err(parser.wrong(
            &format!("expected an operator or the end, met {}", parser.met()),
            Some("a product is written with `*`: `2*x`".to_owned()),
        )),
        Token::Sign(_) => Err(parser.wrong(
            &format!("expected an operator or the end, met {}", parser.met()),
            Some("operators are `+ - * / ^`".to_owned()),
        )),
    }
}

fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

fn check_parameter(name: &str, value: f64) -> Result<()> {
    let reserved = name == "x" || name == "pi" || Function::NAMES.iter().any(|(n, _)| *n == name);
    if reserved {
        return Err(
            InputError::new(format!("`{name}` cannot be the name of a parameter"))
                .help("it already has a meaning in expressions: choose another name")
                .into(),
        );
    }
    if !is_name(name) {
        return Err(InputError::new(format!("`{name}` is not a name"))
            .help("a name has letters, digits and `_`, and begins with a letter or `_`")
            .into());
    }
    if !value.is_finite() {
        return Err(InputError::new(format!("parameter `{name}` is {value}"))
            .help("give a finite number")
            .into());
    }
    Ok(())
}

impl<'a> Parser<'a> {
    fn wrong(&self, message: &str, help: Option<String>) -> crate::error::Error {
        self.wrong_at(self.start, message, help)
    }

    fn wrong_at(&self, offset: usize, message: &str, help: Option<String>) -> crate::error::Error {
        let error = InputError::new(message).at_offset(self.text, offset);
        match help {
            Some(help) => error.help(help).into(),
            None => error.into(),
        }
    }

    /// What an operand can be.
    fn operands(&self) -> &'static str {
        match self.names {
            None => "a number, `x` or a function",
            Some(_) => "a number, a name or a function",
        }
    }

    fn met(&self) -> String {
        match &self.token {
            Token::Number(text) | Token::Name(text) => format!("`{text}`"),
            Token::Sign(c) => format!("`{c}`"),
            Token::End => "the end".to_owned(),
        }
    }

    fn column(&self, offset: usize) -> usize {
        let before = self.text.get(..offset).unwrap_or("");
        before.chars().count() + 1
    }

    /// Looks at the next token.
    fn advance(&mut self) -> Result<()> {
        let rest = self.text.get(self.next..).unwrap_or("");
        let trimmed = rest.trim_start();
        self.start = self.text.len() - trimmed.len();
        let length_while = |allowed: fn(char) -> bool| {
            trimmed.find(|c: char| !allowed(c)).unwrap_or(trimmed.len())
        };
        let taken = |n: usize| trimmed.get(..n).unwrap_or("");
        let (token, length) = match trimmed.chars().next() {
            None => (Token::End, 0),
            Some(c) if c.is_ascii_digit() || c == '.' => {
                let n = number_length(trimmed);
                (Token::Number(taken(n)), n)
            }
            Some(c) if c.is_ascii_alphabetic() || c == '_' => {
                let n = length_while(|c| c.is_ascii_alphanumeric() || c == '_');
                (Token::Name(taken(n)), n)
            }
            Some(c) => (Token::Sign(c), c.len_utf8()),
        };
        self.token = token;
        self.next = self.start + length;
        Ok(())
    }

    /// An operand and all operators after it that bind more than `least`.
    fn sum(&mut self, least: u8) -> Result<usize> {
        self.depth += 1;
        if self.depth > DEEPEST {
            let message = format!("nested more than {DEEPEST} deep");
            return Err(self.wrong(&message, Some("write it with fewer parentheses".to_owned())));
        }
        let mut left = self.operand()?;
        loop {
            let (binds, right_binds) = match self.token {
                Token::Sign('+' | '-') => (1, 1),
                Token::Sign('*' | '/') => (2, 2),
                // Right associative, and its exponent may have a sign.
                Token::Sign('^') => (4, 3),
                _ => break,
            };
            if binds <= least {
                break;
            }
            let (sign, column) = (self.token.clone(), self.column(self.start));
            self.advance()?;
            let right = self.sum(right_binds)?;
            let kind = match sign {
                Token::Sign('+') => Kind::Add(left, right),
                Token::Sign('-') => Kind::Subtract(left, right),
                Token::Sign('*') => Kind::Multiply(left, right),
                Token::Sign('/') => Kind::Divide(left, right),
                _ => Kind::Power(left, right),
            };
            left = self.list.push(kind, column);
        }
        self.depth -= 1;
        Ok(left)
    }

    fn operand(&mut self) -> Result<usize> {
        let (start, column) = (self.start, self.column(self.start));
        match self.token.clone() {
            Token::Number(text) => {
                let kind = self.number(text)?;
                self.advance()?;
                Ok(self.list.push(kind, column))
            }
            Token::Name(name) => {
                self.advance()?;
                self.named(name, start)
            }
            Token::Sign('-') => {
                self.advance()?;
                let inner = self.sum(3)?;
                Ok(self.list.push(Kind::Negate(inner), column))
            }
            Token::Sign('(') => {
                self.advance()?;
                self.until_closed(start)
            }
            Token::Sign('*') if self.text.get(..start).is_some_and(|t| t.ends_with('*')) => {
                Err(self.wrong(
                    &format!("expected {}, met `*`", self.operands()),
                    Some("a power is written with `^`".to_owned()),
                ))
            }
            _ => Err(self.wrong(
                &format!("expected {}, met {}", self.operands(), self.met()),
                Some(match self.token {
                    Token::End => "the expression is cut short: complete it".to_owned(),
                    _ => format!("write {} there", self.operands()),
                }),
            )),
        }
    }

    /// What stands between the parenthesis at `opened` and its partner.
    fn until_closed(&mut self, opened: usize) -> Result<usize> {
        let inner = self.sum(0)?;
        if self.token != Token::Sign(')') {
            let message = format!(
                "expected an operator or `)`, met {}: the `(` in column {} is open",
                self.met(),
                self.column(opened)
            );
            let help = match self.token {
                Token::Number(_) | Token::Name(_) | Token::Sign('(') => {
                    "a product is written with `*`: `2*x`"
                }
                Token::Sign(',') => "a function has one argument; the decimal mark is a point",
                Token::End => "close it with `)`",
                Token::Sign(_) => "operators are `+ - * / ^`; close it with `)`",
            };
            return Err(self.wrong(&message, Some(help.to_owned())));
        }
        self.advance()?;
        Ok(inner)
    }

    fn named(&mut self, name: &str, start: usize) -> Result<usize> {
        let column = self.column(start);
        if let Some((_, function)) = Function::NAMES.iter().find(|(n, _)| *n == name) {
            if self.token != Token::Sign('(') {
                let message = format!("expected `(` after `{name}`, met {}", self.met());
                return Err(self.wrong(&message, Some(format!("write `{name}(x)`"))));
            }
            let opened = self.start;
            self.advance()?;
            let inner = self.until_closed(opened)?;
            return Ok(self.list.push(Kind::Apply(*function, inner), column));
        }
        let kind = match (name, self.parameters.get(name)) {
            ("pi", _) => pi(),
            _ if self.names.is_some() => self.own_name(name, start)?,
            (name, _) if name == self.variable => Kind::X,
            (_, Some(value)) => Kind::Constant {
                text: name.to_owned(),
                double: *value,
                exact: Interval::from(*value),
            },
            _ => return Err(self.unknown(name, start)),
        };
        Ok(self.list.push(kind, column))
    }

    /// A name that stands for itself, unless a function was meant.
    fn own_name(&mut self, name: &str, start: usize) -> Result<Kind> {
        let alias = ALIASES.iter().any(|(other, _)| *other == name);
        let Some(names) = self.names.as_mut() else {
            return Err(self.unknown(name, start));
        };
        if self.token == Token::Sign('(') || alias {
            return Err(self.unknown(name, start));
        }
        let known = names.iter().position(|n| n == name);
        let place = known.unwrap_or_else(|| {
            names.push(name.to_owned());
            names.len() - 1
        });
        let text = name.to_owned();
        Ok(Kind::Named { text, place })
    }

    fn unknown(&self, name: &str, start: usize) -> crate::error::Error {
        let functions = Function::NAMES.iter().map(|(n, _)| *n);
        let parameters = self.parameters.keys().map(String::as_str);
        let variables: &[&str] = match self.names {
            None => &["x", "pi"],
            Some(_) => &["pi"],
        };
        let known: Vec<&str> = variables
            .iter()
            .copied()
            .chain(functions)
            .chain(parameters)
            .collect();
        let plain = name.to_lowercase();
        let alias = ALIASES.iter().find(|(other, _)| *other == plain);
        let meant = alias
            .map(|(_, ours)| *ours)
            .or_else(|| nearest(&plain, &known));
        let letter = alias.is_none() && name.chars().count() == 1;
        let help = match meant {
            _ if letter => format!(
                "the variable is `x`; a value of your own is given with `--parameter {name}=1.5`"
            ),
            Some(meant) => format!("did you mean `{meant}`?"),
            None => format!("known names are {}", known.join(", ")),
        };
        let what = match (&self.names, &self.token) {
            (Some(_), Token::Sign('(')) => "function",
            _ => "name",
        };
        self.wrong_at(start, &format!("unknown {what} `{name}`"), Some(help))
    }

    fn number(&self, text: &str) -> Result<Kind> {
        let refused = |why: &str| {
            let help = "write it with a decimal point, such as `0.25` or `2.5e-3`".to_owned();
            self.wrong(&format!("the number `{text}` {why}"), Some(help))
        };
        let (digits, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
        let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
        if whole.is_empty() && part.is_empty() {
            return Err(refused("has no digit"));
        }
        if part.contains('.') {
            return Err(refused("has two decimal points"));
        }
        if whole.len() + part.len() > DIGITS {
            return Err(refused(&format!("has more than {DIGITS} digits")));
        }
        let exponent: i64 = exponent.parse().unwrap_or(i64::MAX);
        if exponent.saturating_abs() > EXPONENT {
            return Err(refused(&format!("has an exponent beyond {EXPONENT}")));
        }
        let all: IBig = format!("{whole}{part}").parse().unwrap_or(IBig::ZERO);
        let shift = exponent - part.len() as i64;
        let power = IBig::from(10).pow(shift.unsigned_abs() as usize);
        let exact = match shift >= 0 {
            true => Interval::from_ratio(&(all * power), &IBig::ONE),
            false => Interval::from_ratio(&all, &power),
        };
        let double = text.parse::<f64>().unwrap_or(f64::NAN);
        if !double.is_finite() || !exact.is_bounded() {
            return Err(refused("is too large"));
        }
        let text = text.to_owned();
        Ok(Kind::Constant {
            text,
            double,
            exact,
        })
    }
}

/// Bytes of the number that `text` begins with; an `e` belongs to it if digits follow.
fn number_length(text: &str) -> usize {
    let digits = |from: usize| {
        let rest = text.get(from..).unwrap_or("");
        rest.find(|c: char| !c.is_ascii_digit())
            .unwrap_or(rest.len())
    };
    let mut length = text
        .find(|c: char| !c.is_ascii_digit() && c != '.')
        .unwrap_or(text.len());
    if text
        .get(length..)
        .is_some_and(|t| t.starts_with(['e', 'E']))
    {
        let signed = text
            .get(length + 1..)
            .is_some_and(|t| t.starts_with(['+', '-']));
        let from = length + 1 + usize::from(signed);
        if digits(from) > 0 {
            length = from + digits(from);
        }
    }
    length
}
