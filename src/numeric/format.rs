//! Q formats, rounding and overflow: the words in which every quantiser of a design is stated.
//!
//! `Qm.n` is signed with m + n bits, n of them fractional (the sign bit counts as an integer bit,
//! ARM's convention); `UQm.n` is unsigned. `m + n` is 1..=64 and `m >= 1` if signed.

use std::fmt;
use std::str::FromStr;

/// A fixed-point format: `Qm.n` or `UQm.n`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Format {
    /// False for `UQm.n`.
    pub signed: bool,
    /// m: integer bits, the sign bit among them.
    pub integer_bits: u32,
    /// n: fractional bits.
    pub fraction_bits: u32,
}

impl Format {
    /// `Qm.n`.
    pub const fn q(integer_bits: u32, fraction_bits: u32) -> Self {
        Format {
            signed: true,
            integer_bits,
            fraction_bits,
        }
    }

    /// The word's width m + n in bits.
    pub const fn bits(self) -> u32 {
        self.integer_bits + self.fraction_bits
    }

    /// The bits of the word as a two's-complement number: an unsigned word needs one more.
    pub const fn signed_bits(self) -> u32 {
        self.bits() + !self.signed as u32
    }

    /// The smallest raw value.
    pub const fn min_raw(self) -> i128 {
        if self.signed {
            -(1i128 << (self.bits() - 1))
        } else {
            0
        }
    }

    /// The largest raw value.
    pub const fn max_raw(self) -> i128 {
        if self.signed {
            (1i128 << (self.bits() - 1)) - 1
        } else {
            (1i128 << self.bits()) - 1
        }
    }

    /// True if `raw` is a value of this format.
    pub const fn contains(self, raw: i128) -> bool {
        raw >= self.min_raw() && raw <= self.max_raw()
    }

    /// The weight of one LSB, 2^-n, in the unit of the value.
    pub fn lsb(self) -> f64 {
        pow2(-(self.fraction_bits as i32))
    }
}

/// 2^exponent as an f64 (exact inside the range of normal numbers).
#[inline]
pub fn pow2(exponent: i32) -> f64 {
    match exponent {
        // Sign 0, the biased exponent, fraction 0.
        -1022..=1023 => f64::from_bits(((exponent + 1023) as u64) << 52),
        _ => beyond_normal(exponent),
    }
}

/// By itself, because a power that is only sometimes needed is else made every time.
#[cold]
#[inline(never)]
fn beyond_normal(exponent: i32) -> f64 {
    f64::powi(2.0, exponent)
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let u = if self.signed { "" } else { "U" };
        write!(f, "{u}Q{}.{}", self.integer_bits, self.fraction_bits)
    }
}

/// What `Q15` (the sign bit left out) and `q1.15` mean.
fn short(text: &str) -> Option<String> {
    let upper = text.to_uppercase();
    let (sign, rest) = match upper.strip_prefix("UQ") {
        Some(rest) => ("U", rest),
        None => ("", upper.strip_prefix('Q')?),
    };
    let is_number = |s: &str| !s.is_empty() && s.len() < 3 && s.bytes().all(|b| b.is_ascii_digit());
    match rest.split_once('.') {
        Some((m, n)) if is_number(m) && is_number(n) => Some(format!("{sign}Q{rest}")),
        None if is_number(rest) && sign.is_empty() => Some(format!("Q1.{rest}")),
        None if is_number(rest) => Some(format!("UQ0.{rest}")),
        _ => None,
    }
}

impl FromStr for Format {
    type Err = String;

    /// Reads `Qm.n` or `UQm.n`; the error says which rule the text breaks.
    fn from_str(text: &str) -> Result<Self, String> {
        let shape = || {
            let plain = text.split_once('.').filter(|(m, n)| {
                [m, n]
                    .iter()
                    .all(|d| !d.is_empty() && d.bytes().all(|b| b.is_ascii_digit()))
            });
            let meant = match short(text) {
                Some(meant) => format!("; did you mean `{meant}`?"),
                None => plain.map_or(String::new(), |_| format!("; did you mean `Q{text}`?")),
            };
            format!("`{text}` is not a format of the form Qm.n or UQm.n{meant}")
        };
        let (signed, rest) = match text.strip_prefix("UQ") {
            Some(rest) => (false, rest),
            None => (true, text.strip_prefix('Q').ok_or_else(shape)?),
        };
        let (m, n) = rest.split_once('.').ok_or_else(shape)?;
        let number = |s: &str| -> Result<u32, String> {
            if s.is_empty() || s.len() > 4 || !s.bytes().all(|b| b.is_ascii_digit()) {
                return Err(shape());
            }
            s.parse().map_err(|_| shape())
        };
        let format = Format {
            signed,
            integer_bits: number(m)?,
            fraction_bits: number(n)?,
        };
        if !(1..=64).contains(&format.bits()) {
            return Err(format!(
                "`{text}` has {} bits; a word has 1 to 64",
                format.bits()
            ));
        }
        if signed && format.integer_bits == 0 {
            return Err(format!(
                "`{text}` has no room for the sign: m counts the sign bit and is at least 1"
            ));
        }
        Ok(format)
    }
}

/// How a value between two LSBs is brought to one of them. Every mode names its tie rule.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Rounding {
    /// Toward minus infinity.
    Floor,
    /// To nearest, ties toward plus infinity.
    #[default]
    HalfUp,
    /// To nearest, ties to the even LSB.
    HalfEven,
    /// To nearest, ties away from zero.
    HalfAway,
    /// Toward zero.
    TowardZero,
    /// Toward plus infinity.
    Ceil,
}

impl Rounding {
    /// All modes, in the contract's order.
    pub const ALL: [Rounding; 6] = [
        Rounding::Floor,
        Rounding::HalfUp,
        Rounding::HalfEven,
        Rounding::HalfAway,
        Rounding::TowardZero,
        Rounding::Ceil,
    ];

    /// The name as a design file spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Rounding::Floor => "floor",
            Rounding::HalfUp => "half_up",
            Rounding::HalfEven => "half_even",
            Rounding::HalfAway => "half_away",
            Rounding::TowardZero => "toward_zero",
            Rounding::Ceil => "ceil",
        }
    }
}

/// What becomes of a value outside its format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Overflow {
    /// Modulo 2^(m+n).
    Wrap,
    /// To the nearest end of the format's range.
    #[default]
    Saturate,
    /// As `Saturate`, but a signed format's lower end is minus its upper end.
    SaturateSymmetric,
    /// The run stops, naming sample, node and operands.
    Error,
}

impl Overflow {
    /// All modes, in the contract's order.
    pub const ALL: [Overflow; 4] = [
        Overflow::Wrap,
        Overflow::Saturate,
        Overflow::SaturateSymmetric,
        Overflow::Error,
    ];

    /// The name as a design file spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Overflow::Wrap => "wrap",
            Overflow::Saturate => "saturate",
            Overflow::SaturateSymmetric => "saturate_symmetric",
            Overflow::Error => "error",
        }
    }
}

/// A format with its rounding and overflow: all that one quantiser does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Quantizer {
    /// The format of the result.
    pub format: Format,
    /// The rounding to the format's fraction bits.
    pub rounding: Rounding,
    /// What happens outside the format.
    pub overflow: Overflow,
}

impl Quantizer {
    /// The default quantiser of a format: nearest, ties toward plus infinity; saturating.
    pub const fn default_of(format: Format) -> Self {
        Quantizer {
            format,
            rounding: Rounding::HalfUp,
            overflow: Overflow::Saturate,
        }
    }
}

impl fmt::Display for Quantizer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} {} {}",
            self.format,
            self.rounding.name(),
            self.overflow.name()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_print_as_they_are_read_and_know_their_range() {
        for text in ["Q1.15", "UQ0.16", "Q64.0", "Q1.63", "UQ64.0", "Q33.15"] {
            assert_eq!(text.parse::<Format>().unwrap().to_string(), text);
        }
        let q: Format = "Q1.15".parse().unwrap();
        assert_eq!((q.min_raw(), q.max_raw()), (-32768, 32767));
        let u: Format = "UQ64.0".parse().unwrap();
        assert_eq!((u.min_raw(), u.max_raw()), (0, u64::MAX as i128));
        assert_eq!((u.bits(), u.signed_bits()), (64, 65));
    }

    #[test]
    fn powers_of_two_are_exact_to_the_ends_of_the_range() {
        let mut expected = f64::MIN_POSITIVE;
        for exponent in -1022..=1023 {
            assert_eq!(pow2(exponent), expected, "{exponent}");
            expected *= 2.0;
        }
        assert_eq!(pow2(1024), f64::INFINITY);
    }

    #[test]
    fn impossible_formats_are_refused_with_the_rule() {
        for (text, rule) in [
            ("Q0.16", "sign"),
            ("Q1.64", "65 bits"),
            ("UQ0.0", "0 bits"),
            ("q1.15", "did you mean `Q1.15`"),
            ("Q15", "did you mean `Q1.15`"),
            ("uq16", "did you mean `UQ0.16`"),
            ("1.15", "did you mean `Q1.15`"),
            ("Q1,15", "form"),
            ("Q1.15 ", "form"),
            ("Q+1.15", "form"),
            ("Q99999.1", "form"),
        ] {
            let e = text.parse::<Format>().unwrap_err();
            assert!(e.contains(rule), "{text}: {e}");
        }
    }
}
