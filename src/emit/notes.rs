//! The comment above an emitted function: its ports, what comes of words outside their range, what its result is worth.

use super::machine::{Lowered, Type};
use crate::numeric::arithmetic::Port;
use crate::numeric::trace::ir::{Function, Interval};
use crate::text::{constant, number};

/// Digits of a range's end, and most of one that would look rounder than it is (a double has no more).
const DIGITS: usize = 7;
const MOST_DIGITS: usize = 16;

/// A port's name, its range in words and, where its scale is known, in its quantity, and what it means.
pub(super) fn described(port: &Port, range: Interval) -> String {
    let quantity = port.scale.as_ref().map(|s| {
        let at = |raw: i128| told(s.offset + s.factor * raw as f64, s.factor.abs());
        let range = format!("{} .. {} {}", at(range.low), at(range.high), s.unit);
        format!(" ({})", range.trim_end())
    });
    format!(
        "{}: {} .. {}{}; {}",
        port.name,
        range.low,
        range.high,
        quantity.unwrap_or_default(),
        meaning(port)
    )
}

/// A word's value to seven digits; to more where those would pass for another word's round value (2047.9998, a step of
/// 2^-12 below 2048).
fn told(value: f64, step: f64) -> String {
    let text = constant(value, DIGITS);
    let is_this = |text: &String| {
        text.parse::<f64>()
            .is_ok_and(|v| (v - value).abs() < step / 2.0)
    };
    if text == number(value, DIGITS) || is_this(&text) {
        return text;
    }
    let mut longer = (DIGITS + 1..=MOST_DIGITS).map(|digits| constant(value, digits));
    longer.find(is_this).unwrap_or(text)
}

/// What a port's words are, the value of a step apart from the word's own format.
pub(super) fn meaning(port: &Port) -> String {
    let parts = port.meaning.split_once(" = raw * ");
    let parts = parts.and_then(|(what, rest)| Some((what, rest.split_once(", ")?)));
    match parts {
        Some((what, (worth, format))) => format!("{what} = raw * {worth}; word format {format}"),
        None => port.meaning.clone(),
    }
}

/// What comes of a word that an input's type holds and its range does not.
pub(super) fn outside(function: &Function, lowered: &Lowered) -> String {
    let mut inputs = function.inputs.iter().zip(&lowered.inputs);
    let holds_more = inputs
        .any(|((_, range), ty)| matches!(ty, Type::Signed(width) if width.interval() != *range));
    // Limits of the function's own are another matter: they are for words of the range.
    let of = function
        .inputs
        .iter()
        .find(|(port, _)| port.limits.is_some());
    let of = of.map_or("its range".to_owned(), |(_, range)| {
        format!(
            "{} .. {}, which is no word of the format,",
            range.low, range.high
        )
    });
    match (holds_more, lowered.guarded) {
        (false, _) => String::new(),
        (true, true) => format!("an input outside {of} is clamped to it"),
        (true, false) => format!("an input outside {of} is not clamped: its result may be wrong"),
    }
}

/// What a block's result is worth against real arithmetic on the same inputs.
pub(super) fn guarantee(function: &str) -> Option<&'static str> {
    let base = function.trim_end_matches(|c: char| c == '_' || c.is_ascii_digit());
    Some(match base {
        "nco" => "error: phase exact modulo one turn; the table's address drops the low phase bits",
        "demodulate" | "decimate" => {
            "error: one rounding to the output's LSB (half an LSB if to nearest), nothing else"
        }
        "integrate" | "retune" => "error: none, exact modulo 2^width",
        "cordic" => {
            "error: residual angle at most atan(2^-(n-1)), and half a unit for each of n table angles"
        }
        "bias" => "error: each step one rounding to the accumulator's LSB",
        "rate" => "error: one rounding of the input to the output's LSB; the difference is exact",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The greatest word of Q12.12 is not 2048.
    #[test]
    fn an_end_of_a_range_is_not_rounded_to_the_next_word() {
        let step = 2f64.powi(-12);
        assert_eq!(told(-8388608.0 * step, step), "-2048");
        assert_eq!(told(8388607.0 * step, step), "2047.9998");
        assert_eq!(told(2047.9375, step), "2047.938");
        assert_eq!(told(1.0 - 2f64.powi(-31), 2f64.powi(-31)), "0.9999999995");
        assert_eq!(told(std::f64::consts::PI, 1e-9), "3.141593");
    }

    #[test]
    fn a_port_says_its_range_in_words_and_in_its_quantity() {
        let port = Port::new("rate", "sense I = raw * 2^-11 deg/s, Q2.22");
        let plain = described(&port, Interval::new(-2048, 4096));
        assert_eq!(
            plain,
            "rate: -2048 .. 4096; sense I = raw * 2^-11 deg/s; word format Q2.22"
        );
        let scaled = described(
            &port.in_unit("sense I", -11, "deg/s"),
            Interval::new(-2048, 4096),
        );
        assert!(scaled.starts_with("rate: -2048 .. 4096 (-1 .. 2 deg/s); sense I = "));
        let other = Port::new("carrier", "NCO output, Q1.15");
        assert!(described(&other, Interval::new(0, 1)).ends_with("; NCO output, Q1.15"));
    }
}
