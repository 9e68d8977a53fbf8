//! How the command line spells the library's choices.

use clap::ValueEnum;
use clap::builder::PossibleValue;
use std::ops::RangeInclusive;

/// A number of an option, which is in the option's own unit.
///
/// # Errors
/// What is none, such as a number with a unit.
pub(super) fn number(text: &str) -> Result<f64, String> {
    let text = text.trim();
    text.parse().map_err(|_| {
        let with_point = text.replacen(',', ".", 1);
        match with_point != text && with_point.parse::<f64>().is_ok() {
            true => format!("the decimal mark is a point; give {with_point}"),
            false => "it is no number; give one without its unit, such as 0.5 or 3600".to_owned(),
        }
    })
}

/// A whole number of a range, for an option.
pub(super) fn whole<T: TryFrom<u64>>(
    range: RangeInclusive<u64>,
) -> impl Fn(&str) -> Result<T, String> + Clone {
    move |text| {
        let number = text.parse::<u64>().ok().filter(|n| range.contains(n));
        number.and_then(|n| T::try_from(n).ok()).ok_or_else(|| {
            format!(
                "give a whole number from {} to {}",
                range.start(),
                range.end()
            )
        })
    }
}

/// The digits of a count that is written in another way: `200k`, `1e6`, `10_000`. `None` for what is no such count.
pub(super) fn plain_integer(text: &str) -> Option<u64> {
    let plain: String = text.chars().filter(|c| !"_' ".contains(*c)).collect();
    if let Ok(digits) = plain.parse::<u64>() {
        return (plain != text).then_some(digits);
    }
    let (number, zeros) = match plain.char_indices().last()? {
        (at, 'k' | 'K') => (&plain[..at], 3),
        (at, 'M') => (&plain[..at], 6),
        (at, 'G') => (&plain[..at], 9),
        _ => (plain.as_str(), 0),
    };
    // `inf` and a sign are no count.
    if !number.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    let value = format!("{number}e{zeros}")
        .parse()
        .or_else(|_| number.parse::<f64>());
    let value = value.ok()?;
    (value.fract() == 0.0 && value < 1e15).then_some(value as u64)
}

/// A choice of the library's as a value of the command line: variant, spelling, what it means.
macro_rules! values {
    ($choice:ty { $($variant:ident = $spelled:literal $(| $other:literal)?, $means:literal;)+ }) => {
        impl ValueEnum for $choice {
            fn value_variants<'a>() -> &'a [Self] {
                &[$(Self::$variant),+]
            }

            fn to_possible_value(&self) -> Option<PossibleValue> {
                Some(match self {
                    $(Self::$variant => PossibleValue::new($spelled)$(.alias($other))?.help($means),)+
                })
            }
        }
    };
}

values!(crate::emit::views::Language {
    C = "c", "C99";
    Rust = "rust", "Rust, `no_std`";
});

values!(crate::emit::bundle::Part {
    Compensation = "compensation", "The bias polynomial of `[compensation]` and its subtraction from the rate";
    Tables = "tables", "The constant tables alone: sine, arctangents";
    Correction = "correction", "The correction of averaged readings that `gyrogen close` wrote as `[correction]`";
    Conversion = "conversion", "What averages the chain's rows and scales them to the words of the `[correction]`";
    All = "all", "Chain, conversion and correction in one folder, with an example that joins them";
    Chain = "chain", "The whole detection circuit with its compensation; the compensation alone where its thermometer is not the circuit's";
});

values!(crate::design::target::Target {
    Host = "host", "A 64-bit processor";
    CortexM4 = "cortex-m4", "ARMv7E-M: single-cycle 32 x 32 to 64 bit multiplier";
    CortexM0 = "cortex-m0", "ARMv6-M: 32-cycle 32 x 32 to 32 bit multiplier and none for the upper half";
    CortexM0Fast = "cortex-m0-fast", "The same with the single-cycle multiplier";
    Rv32imc = "rv32imc" | "riscv32", "32-bit RISC-V with multiplication, as Ibex executes it; `riscv32` is the same";
    Dsp16 = "dsp16", "A 16-bit signal processor";
});

values!(crate::tabulate::job::Asked {
    Polynomial = "polynomial", "One polynomial";
    Table = "table", "A table";
    Piecewise = "piecewise", "A polynomial for each segment";
    Auto = "auto", "The cheapest that meets the bound";
});

values!(crate::tabulate::job::Weight {
    Absolute = "absolute", "The function's own unit";
    Relative = "relative", "Parts of the function's magnitude";
});

values!(crate::verify::target::Target {
    Host = "host", "This machine";
    CortexM4 = "cortex-m4", "ARM Cortex-M4, Thumb-2, under emulation; C bundles only";
    Riscv32 = "riscv32" | "rv32imc", "32-bit RISC-V (RV32IMAC), under emulation; C bundles only; `rv32imc` is the same";
});

values!(crate::approx::form::polynomial::Monomials {
    All = "all", "1, x, x^2, ..";
    Odd = "odd", "x, x^3, x^5, ..";
    Even = "even", "1, x^2, x^4, ..";
});

values!(crate::approx::form::plan::Scheme {
    Horner = "horner", "One step after the other: fewest multiplications";
    Estrin = "estrin", "Pairs, then pairs of pairs: more multiplications, a shorter chain of steps";
});

values!(crate::approx::form::table::Kind {
    Plain = "plain", "The entry";
    Linear = "linear", "Between two entries";
    Quadratic = "quadratic", "Through three entries";
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_names_of_the_risc_v_target_are_taken_everywhere() {
        for name in ["rv32imc", "riscv32"] {
            let priced = <crate::design::target::Target as ValueEnum>::from_str(name, false);
            assert_eq!(priced, Ok(crate::design::target::Target::Rv32imc));
            let run_on = <crate::verify::target::Target as ValueEnum>::from_str(name, false);
            assert_eq!(run_on, Ok(crate::verify::target::Target::Riscv32));
        }
    }

    #[test]
    fn counts_in_another_spelling_are_given_in_digits() {
        for (text, digits) in [
            ("200k", Some(200_000)),
            ("1.5M", Some(1_500_000)),
            ("1e6", Some(1_000_000)),
            ("10_000", Some(10_000)),
            ("many", None),
            ("-5", None),
            ("0.5", None),
            ("0", None),
            ("", None),
        ] {
            assert_eq!(plain_integer(text), digits, "{text}");
        }
    }

    #[test]
    fn a_number_outside_its_range_is_told_the_range_in_words() {
        let of = whole::<u16>(10..=1000);
        assert_eq!(of("10"), Ok(10));
        for text in ["9", "1001", "-20", "many", "70000"] {
            let said = of(text).expect_err(text);
            assert_eq!(said, "give a whole number from 10 to 1000", "{text}");
        }
    }

    #[test]
    fn a_decimal_comma_is_shown_with_a_point() {
        assert_eq!(number(" 0.5 "), Ok(0.5));
        assert!(number("0,01").is_err_and(|e| e.contains("give 0.01")));
        assert!(number("5 Hz").is_err_and(|e| e.contains("without its unit")));
    }
}
