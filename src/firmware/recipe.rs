//! A sensor's code as a word, in integers: what the README of a bundle tells who has no other arithmetic.
//!
//! `word = clamp(((code - C) * M + R) >> S, LOW, HIGH)`, with `value = step * code`, is the word
//! `(value - offset) / lsb`, rounded to the nearest. M has 30 bits, so that with codes of 32 bits nothing leaves 64 bits.

use crate::design::CompensationInput;
use crate::numeric::arithmetic::{Port, Scale};
use crate::numeric::format::pow2;
use crate::numeric::trace::ir::Interval;
use crate::text::{self, Place, at_most, constant};

/// Bits of M.
const FACTOR_BITS: i32 = 30;
/// The largest code and C.
const LARGEST_CODE: f64 = i32::MAX as f64;
/// What the 53 bits of the constants' own computation may add, as a share of the largest word and of the offset's.
const COMPUTED_SHARE: f64 = 8.0 * f64::EPSILON;
/// Digits of the error in LSB.
const SHOWN_DIGITS: usize = 5;

/// The constants for codes in decimal steps.
#[derive(Debug, Clone, PartialEq)]
struct Recipe {
    /// One step of the code, in the quantity's unit: a power of ten.
    step: f64,
    /// C.
    zero: i64,
    /// M.
    factor: i64,
    /// R.
    rounding: i64,
    /// S.
    shift: u32,
    /// Largest distance from the exact word where this is in its range, LSB.
    error_lsb: f64,
}

impl Recipe {
    /// For words of a range. The code's step is the largest power of ten that is no coarser than the word's LSB, or the
    /// smallest with which codes of 32 bits reach every word. `None` for an offset beside which such codes do not tell words apart.
    fn of(scale: &Scale, range: Interval) -> Option<Self> {
        let (offset, lsb) = (scale.offset, scale.factor);
        let finest = lsb.abs().log10().floor();
        let reach = offset.abs() + reach_lsb(range) * lsb.abs();
        let narrowest = (reach / LARGEST_CODE).log10().ceil();
        Recipe::of_sensor(scale, range, 0.0, 10f64.powi(finest.max(narrowest) as i32))
    }

    /// For codes whose value is `zero` at code 0 and moves by `step` from one to the next, both in the quantity's unit. `None` as
    /// of [`Recipe::of`].
    fn of_sensor(scale: &Scale, range: Interval, zero_value: f64, step: f64) -> Option<Self> {
        let (offset, lsb) = (scale.offset, scale.factor);
        let reach_lsb = reach_lsb(range);
        let ratio = step / lsb;
        let shift = FACTOR_BITS - 1 - ratio.abs().log2().floor() as i32;
        if !(1..62).contains(&shift) {
            return None;
        }
        let exact = ratio * pow2(shift);
        let factor = exact.round();
        let at_offset = (offset - zero_value) / step;
        let zero = at_offset.round();
        let rounding = pow2(shift - 1) - (factor * (at_offset - zero)).round();
        let of_factor = (factor / exact - 1.0).abs() * reach_lsb;
        let offsets = offset.abs().max(zero_value.abs());
        let computed = COMPUTED_SHARE * (reach_lsb + (offsets / lsb).abs());
        Some(Recipe {
            step,
            zero: zero as i64,
            factor: factor as i64,
            rounding: rounding as i64,
            shift: shift as u32,
            error_lsb: 0.5 + of_factor + 0.5 * pow2(-shift) + computed,
        })
    }

    /// The word of a code of 32 bits.
    fn word(&self, code: i64, range: Interval) -> i128 {
        let sum = (code - self.zero) * self.factor + self.rounding;
        i128::from(sum >> self.shift).clamp(range.low, range.high)
    }
}

/// Distance of the range's farther end from 0, and one more, LSB.
fn reach_lsb(range: Interval) -> f64 {
    range.low.abs().max(range.high.abs()) as f64 + 1.0
}

/// What a README says of sensors' codes.
#[derive(Debug, Default)]
pub struct Recipes {
    /// Of each input whose words stand for a quantity, a line with its constants.
    pub lines: Vec<String>,
    /// The first input from a sensor whose codes have a binary step; empty without an input.
    pub example: String,
}

impl Recipes {
    /// For the inputs of a function.
    pub fn of(inputs: &[(Port, Interval)]) -> Self {
        let mut recipes = Recipes::default();
        for (port, range) in inputs {
            let Some(scale) = &port.scale else { continue };
            let Some(recipe) = Recipe::of(scale, *range) else {
                continue;
            };
            let line = sentence(port.name, scale, *range, &recipe);
            recipes.lines.push(text::shown(&line, Place::Source));
            if recipes.example.is_empty() {
                let said = example(port.name, scale, *range, recipe.step).unwrap_or_default();
                recipes.example = text::shown(&said, Place::Source);
            }
        }
        recipes
    }
}

/// Where the words of a compensation come from whose thermometer is the circuit's own; empty where a sensor has it.
pub fn own_words(input: &CompensationInput) -> &'static str {
    match input {
        CompensationInput::Phase => {
            "No sensor's code is converted: `thermometer` is the word `phase`, and `raw_rate` the word `sense_i`, of a row of the \
             detection circuit."
        }
        CompensationInput::TuningWord(_) => {
            "No sensor's code is converted: `thermometer` is what the phase loop of the detection circuit adds to the tuning word, \
             and `raw_rate` the word `sense_i` of the circuit's row."
        }
        CompensationInput::Channel(_) => "",
    }
}

/// The value at code 0 of the example's sensor, degC; those of other quantities have 0 there.
const EXAMPLE_ZERO_DEGC: f64 = 25.0;

/// The recipe for a sensor whose step is a power of two, `step` or the next above, with a code that makes a quarter of the
/// largest word.
fn example(name: &str, scale: &Scale, range: Interval, step: f64) -> Option<String> {
    let exponent = step.log2().ceil() as i32;
    let step = pow2(exponent);
    let zero = match scale.unit {
        "degC" => EXAMPLE_ZERO_DEGC,
        _ => 0.0,
    };
    let r = Recipe::of_sensor(scale, range, zero, step)?;
    let wanted = scale.offset + scale.factor * (range.high / 4) as f64;
    let code = ((wanted - zero) / step).round() as i64;
    if [code, r.zero]
        .iter()
        .any(|k| k.unsigned_abs() as f64 > LARGEST_CODE)
    {
        return None;
    }
    let value = zero + step * code as f64;
    let unit = behind(scale.unit);
    Some(format!(
        "A sensor of `{name}` with `value = {zero:?} + 2^{exponent} * code`{unit} has C = {}, M = {}, R = {}, S = {}. Its code {code} \
         is {}{unit}; the exact word is {}, and the integers give {}.",
        r.zero,
        r.factor,
        r.rounding,
        r.shift,
        constant(value, 12),
        constant((value - scale.offset) / scale.factor, 9),
        r.word(code, range)
    ))
}

/// A unit to stand behind a number.
fn behind(unit: &str) -> String {
    match unit {
        "" => String::new(),
        unit => format!(" {unit}"),
    }
}

fn sentence(name: &str, scale: &Scale, range: Interval, r: &Recipe) -> String {
    let unit = behind(scale.unit);
    format!(
        "{name}: code in steps of {}{unit} ({}), C = {}, M = {}, R = {}, S = {}, LOW = {}, HIGH = {}; at most {} LSB from the \
         exact word; offset = {:?}{unit}, lsb = {:?}{unit}",
        constant(r.step, 1),
        scale.quantity,
        r.zero,
        r.factor,
        r.rounding,
        r.shift,
        range.low,
        range.high,
        at_most(r.error_lsb, SHOWN_DIGITS),
        scale.offset,
        scale.factor
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correction::{Correction, Formats, Input, Plan, Term};
    use crate::emit::views::Language;
    use crate::firmware::correction::{Origin, emit};
    use crate::numeric::format::Format;

    /// Most codes that are run of one input: all of one of 16 bits.
    const MOST_CODES: i64 = 1 << 20;

    fn word(r: &Recipe, code: i64, range: Interval) -> i128 {
        let difference = code - r.zero;
        let product = difference.checked_mul(r.factor).expect("64 bits");
        product.checked_add(r.rounding).expect("64 bits");
        r.word(code, range)
    }

    fn correction(offset: f64, scale: f64, fraction_bits: u32) -> Correction {
        let plan = Plan {
            period_s: 1.0,
            inputs: vec![Input {
                column: "die_degc".into(),
                offset,
                scale,
            }],
            full_scale_dps: 500.0,
            terms: vec![Term::Product {
                gain_dps: 1.0,
                factors: vec![(0, 1)],
            }],
        };
        let formats = Formats {
            inputs: vec![Format::q(1, fraction_bits)],
            ..Formats::auto(&plan).expect("formats")
        };
        Correction::new(&plan, &formats).expect("a correction")
    }

    fn of_input(correction: &Correction) -> (Scale, Interval) {
        let format = correction.formats.inputs[0];
        let input = &correction.plan.inputs[0];
        let scale = Scale {
            quantity: input.column.clone(),
            offset: input.offset,
            factor: input.scale * format.lsb(),
            unit: crate::design::record_columns::unit_behind(&input.column),
        };
        (scale, Interval::new(format.min_raw(), format.max_raw()))
    }

    #[test]
    fn a_code_makes_the_word_of_its_value_over_the_whole_range() {
        for (offset, scale, bits) in [
            (25.017, 50.09, 15),
            (25.0, 64.0, 16),
            (-1.818_703_87, 0.314_095_526, 18),
            (1749.6, -1.55, 15),
            (1749.6, 1.55, 23),
            (0.0, 1.0, 20),
            (-40.0, 1e-3, 15),
            (1.013e5, 2.5e4, 17),
        ] {
            let correction = correction(offset, scale, bits);
            let (scale, range) = of_input(&correction);
            let r = Recipe::of(&scale, range).expect("a recipe");
            let half = ((range.high as f64 + 2.0) * (scale.factor / r.step).abs()) as i64 + 2;
            let stride = (2 * half / MOST_CODES).max(1);
            for k in -(half / stride)..=half / stride {
                let code = r.zero + k * stride;
                let value = code as f64 * r.step;
                let exact = (value - offset) / scale.factor;
                let within = exact.clamp(range.low as f64, range.high as f64);
                let word = word(&r, code, range);
                let off = (word as f64 - within).abs();
                assert!(off <= r.error_lsb, "{scale:?}, {code}: {off} {r:?}");
                // The model's word is another one at a tie alone.
                let due = correction.input_raw(0, value);
                let from_tie = (exact - exact.floor() - 0.5).abs();
                assert!(
                    word == due || from_tie <= r.error_lsb - 0.5 + 1e-6,
                    "{scale:?}, {code}: {word}, not {due}; {r:?}"
                );
            }
            // Codes that the sensor cannot mean overflow nothing, and all words are met.
            for (code, end) in [(i32::MIN, range.low), (i32::MAX, range.high)] {
                let end = match scale.factor < 0.0 {
                    true => range.low + range.high - end,
                    false => end,
                };
                assert_eq!(word(&r, i64::from(code), range), end, "{scale:?}");
            }
        }
    }

    #[test]
    fn the_constants_are_told_with_the_step_of_the_code() {
        let (scale, range) = of_input(&correction(25.017, 50.09, 15));
        let r = Recipe::of(&scale, range).expect("a recipe");
        let said = sentence("die_temperature", &scale, range, &r);
        assert_eq!(
            said,
            "die_temperature: code in steps of 0.001 degC (die_degc), C = 25017, M = 702423080, R = 536870912, S = 30, LOW = -32768, \
             HIGH = 32767; at most 0.50002 LSB from the exact word; offset = 25.017 degC, lsb = 0.00152862548828125 degC"
        );
        assert!((0.5..0.51).contains(&r.error_lsb), "{r:?}");
    }

    #[test]
    fn the_example_has_another_step_and_its_word_is_the_exact_one_rounded() {
        let (scale, range) = of_input(&correction(25.017, 50.09, 15));
        let step = Recipe::of(&scale, range).expect("a recipe").step;
        // C = 0.017 * 512 = 8.704, rounded; M = 2^29 * 2^-9 / lsb = 685960039.29; R = 2^28 - M * (8.704 - 9).
        assert_eq!(
            example("die_temperature", &scale, range, step).expect("an example"),
            "A sensor of `die_temperature` with `value = 25.0 + 2^-9 * code` degC has C = 9, M = 685960039, R = 471479628, S = 29. \
             Its code 6419 is 37.537109375 degC; the exact word is 8190.4361, and the integers give 8190."
        );
        // Over all codes, whatever the zero and the step.
        for (zero, step) in [
            (25.0, pow2(-9)),
            (-46.85, 175.72 / 65536.0),
            (0.0, pow2(-8)),
        ] {
            let r = Recipe::of_sensor(&scale, range, zero, step).expect("a recipe");
            for code in -65_536..65_536 {
                let exact = (zero + step * code as f64 - scale.offset) / scale.factor;
                let within = exact.clamp(range.low as f64, range.high as f64);
                let off = (word(&r, code, range) as f64 - within).abs();
                assert!(off <= r.error_lsb, "{zero} + {step} * {code}: {off} {r:?}");
            }
        }
    }

    #[test]
    fn a_corrections_readme_has_the_constants_of_every_word_that_goes_in() {
        let correction = correction(25.017, 50.09, 15);
        let origin = Origin {
            prefix: "tested",
            sha256: "0",
            command: "test",
        };
        for (language, call) in [
            (
                Language::C,
                "\nword = tested_clamp_64(tested_asr_64(((int64_t)code - C) * M + R, S), LOW, HIGH)\n",
            ),
            (
                Language::Rust,
                "\nword = (((i64::from(code) - C) * M + R) >> S).clamp(LOW, HIGH)\n",
            ),
        ] {
            let files = emit(&correction, &origin, language).expect("a bundle");
            let readme = files
                .iter()
                .find(|f| f.path == "README.md")
                .expect("a README");
            for told in [
                call,
                "\ndie_temperature: code in steps of 0.001 degC (die_degc), C = 25017, ",
                "\nrate: code in steps of ",
                "\nA sensor of `die_temperature` with `value = 25.0 + 2^-9 * code` degC has C = 9, ",
            ] {
                assert!(
                    readme.text.contains(told),
                    "{told} missing in {}",
                    readme.text
                );
            }
        }
    }

    #[test]
    fn words_of_the_circuit_itself_have_no_recipe() {
        let design = crate::design::reader::read(None).expect("the default design");
        let compensation = design.compensation.as_ref().expect("a compensation");
        let told = own_words(&compensation.input);
        assert!(told.contains("`phase`"), "{told}");
        let files = crate::firmware::files::emit(
            &design,
            crate::emit::bundle::Part::Compensation,
            Language::C,
            "test",
        );
        let files = files.expect("a bundle");
        let readme = files.iter().find(|f| f.path == "README.md");
        let text = &readme.expect("a README").text;
        assert!(
            text.contains(&format!("\n\n{told}\n\n## Ten lines\n")),
            "{text}"
        );
        assert!(!text.contains("A word from a sensor's code"), "{text}");
    }

    #[test]
    fn an_offset_that_hides_the_scale_has_no_recipe() {
        let scale = |offset| Scale {
            quantity: "count".into(),
            offset,
            factor: 1e-9,
            unit: "",
        };
        let range = Interval::of_bits(16);
        assert!(Recipe::of(&scale(1.0), range).is_some());
        assert_eq!(Recipe::of(&scale(1e12), range), None);
    }
}
