use std::collections::BTreeMap;

use super::*;
use crate::error::Error;

fn value(text: &str, x: f64) -> f64 {
    Expression::parse(text).unwrap().value(x)
}

#[test]
fn operators_bind_as_they_are_read() {
    for (text, x, wanted) in [
        ("-x^2", 3.0, -9.0),
        ("2^3^2", 0.0, 512.0),
        ("2^-2", 0.0, 0.25),
        ("-2^-3^0", 0.0, -0.5),
        ("(-x)^2", 3.0, 9.0),
        ("1 - 2 - 3", 0.0, -4.0),
        ("8/4/2", 0.0, 1.0),
        ("1 + 2*x^2/4 - -x", 2.0, 5.0),
        ("--x", 2.0, 2.0),
        ("2*-x", 2.0, -4.0),
        ("1.5e1 + .5 + 2. + 1E-1", 0.0, 17.6),
        (
            "cos(pi) + sin(0) + sqrt(4)*abs(-2) + exp(0) + log(1)",
            0.0,
            4.0,
        ),
        (
            "asin(1)+acos(1)+atan(0)+tan(0)",
            0.0,
            std::f64::consts::FRAC_PI_2,
        ),
    ] {
        let found = value(text, x);
        assert!((found - wanted).abs() < 1e-14, "{text}: {found}");
        // What is printed is the same function.
        let printed = Expression::parse(text).unwrap().to_string();
        assert_eq!(value(&printed, x), found, "{text} printed {printed}");
        let again = Expression::parse(&printed).unwrap().to_string();
        assert_eq!(again, printed);
    }
    assert_eq!(
        Expression::parse("(1-x)-(2-(x+1))^2^x")
            .unwrap()
            .to_string(),
        "1 - x - (2 - (x + 1))^2^x"
    );
    assert_eq!(
        Expression::parse("(x^2)^3 * -(x*2)").unwrap().to_string(),
        "(x^2)^3*-(x*2)"
    );
}

#[test]
fn numbers_are_the_decimals_that_were_written() {
    let tenth = Expression::parse("0.1*10")
        .unwrap()
        .enclosed(Interval::ZERO);
    assert!(tenth.contains(Wide::ONE) && tenth.radius() < 1e-30);
    let off = Expression::parse("0.1").unwrap().enclosed(Interval::ZERO);
    assert!(
        !off.contains(Wide::from(0.1)),
        "the double 0.1 is not a tenth"
    );
    let long = Expression::parse("0.1234567890123456789012345678").unwrap();
    let short = Expression::parse("0.1234567890123456789012345679").unwrap();
    assert!(long.enclosed(Interval::ZERO).high < short.enclosed(Interval::ZERO).low);
    assert!(
        Expression::parse("1e-300")
            .unwrap()
            .enclosed(Interval::ZERO)
            .is_bounded()
    );
}

#[test]
fn parameters_have_their_values() {
    let parameters = BTreeMap::from([("a1".to_owned(), 2.5), ("t_0".to_owned(), -1.0)]);
    let f = Expression::parse_with("a1*(x - t_0)", &parameters).unwrap();
    assert_eq!(f.value(1.0), 5.0);
    assert_eq!(f.to_string(), "a1*(x - t_0)");
    for (name, value) in [("x", 1.0), ("sin", 1.0), ("2a", 1.0), ("b", f64::NAN)] {
        let parameters = BTreeMap::from([(name.to_owned(), value)]);
        assert!(Expression::parse_with("x", &parameters).is_err(), "{name}");
    }
}

#[test]
fn without_x_the_only_other_letter_is_the_variable() {
    let none = BTreeMap::new();
    let value = |text: &str| Expression::parse_with(text, &none).map(|f| f.value(2.0));
    assert_eq!(value("3*p^2 + p").unwrap(), 14.0);
    assert_eq!(value("exp(0)*t").unwrap(), 2.0);
    // Two letters, a letter beside x, a parameter's letter.
    assert!(value("a*p").is_err() && value("x + p").is_err());
    let parameters = BTreeMap::from([("k".to_owned(), 5.0)]);
    let f = Expression::parse_with("k*p", &parameters).unwrap();
    assert_eq!(f.value(2.0), 10.0);
    assert!(Expression::parse_with("k*x + p", &parameters).is_err());
}

#[test]
fn mistakes_have_a_column_what_was_met_and_help() {
    for (text, column, message, help) in [
        ("", 1, "met the end", ""),
        ("1 +", 4, "met the end", "cut short"),
        ("sin x", 5, "expected `(` after `sin`, met `x`", "`sin(x)`"),
        ("2x", 2, "expected an operator or the end, met `x`", "`2*x`"),
        (
            "(x + 1",
            7,
            "the `(` in column 1 is open",
            "close it with `)`",
        ),
        (
            "sin(x, 2)",
            6,
            "the `(` in column 4 is open",
            "one argument",
        ),
        ("x + 1)", 6, "no `(` before", ""),
        ("x**2", 3, "met `*`", "`^`"),
        ("arctan(x)", 1, "unknown name `arctan`", "`atan`"),
        ("1 + ln(x)", 5, "unknown name `ln`", "`log`"),
        ("sqr(x)", 1, "unknown name `sqr`", "`sqrt`"),
        (
            "weight",
            1,
            "unknown name `weight`",
            "known names are x, pi, sin",
        ),
        ("x, 2", 2, "met `,`", "operators"),
        ("1.2.3", 1, "two decimal points", ""),
        (".", 1, "no digit", ""),
        ("1e999", 1, "exponent beyond", ""),
        ("µ", 1, "met `µ`", ""),
        ("x + µ", 5, "met `µ`", ""),
        ("x\n + §", 4, "met `§`", ""),
        ("+x", 1, "met `+`", ""),
        ("x ^^ 2", 4, "met `^`", ""),
    ] {
        let Err(Error::Input(error)) = Expression::parse(text) else {
            panic!("{text} was read");
        };
        assert_eq!(error.column, Some(column), "{text}: {error}");
        assert!(error.message.contains(message), "{text}: {error}");
        let said = error.help.clone().unwrap_or_default();
        assert!(said.contains(help), "{text}: {error}");
    }
}

#[test]
fn bombs_are_refused() {
    for text in [
        "(".repeat(2000),
        "-".repeat(3000) + "x",
        "x^".repeat(1000) + "x",
        "sin(".repeat(500) + "x" + &")".repeat(500),
        "1".repeat(3000),
        "x+".repeat(100_000) + "x",
    ] {
        assert!(Expression::parse(&text).is_err());
    }
    // Long but flat: read, printed and evaluated.
    let text = "x+".repeat(1900) + "x";
    let f = Expression::parse(&text).unwrap();
    assert_eq!(f.value(1.0), 1901.0);
    assert!(f.to_string().len() > 1900);
    assert!(f.enclosed(Interval::ONE).contains(Wide::from(1901.0)));
}

#[test]
fn the_same_operand_twice_is_a_square() {
    let x = Interval::new(Wide::from(-1.0), Wide::from(1.0));
    for text in ["x*x", "(x + 0)*(x + 0)", "x^2"] {
        let f = Expression::parse(text).unwrap();
        assert!(f.enclosed(x).low >= Wide::ZERO, "{text}");
    }
    assert_eq!(value("x - x + x/x*x", 3.0), 3.0);
}
