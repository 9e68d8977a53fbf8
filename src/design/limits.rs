//! The 127-bit rule: every exact intermediate of up to 127 bits is supported, and a design that
//! can need more is refused with the sum that shows it (`docs/manual.md`).
//!
//! Bits are those of a two's-complement number, counted on the formats and never on ranges:
//! - a product has the sum of its operands' bits;
//! - a left shift by k has k more; a right shift has fewer, so the word before it is what counts;
//! - an unsigned operand has one more than its format;
//! - a bare integer (a loop's gain) has the bits of its shortest two's-complement form;
//! - rounding constants and the carry of a sum do not count (the engine has one bit to spare);
//! - a cast's word counts before its overflow step;
//! - what wraps by definition (integrators, x, y, z, the phases) has the width it wraps in.
//!
//! What can never exceed 127 bits given the keys' ranges is counted all the same, so that the
//! rule still holds if a range is widened one day.

use super::schema::*;
use crate::numeric::format::Format;
use std::fmt;

/// The most bits of an exact intermediate.
pub const MOST_BITS: u32 = 127;

/// An exact intermediate with more bits than the engine holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Excess {
    /// The dotted key of the cast that takes it, such as `circuit.demodulator.product`.
    pub key: &'static str,
    /// The arithmetic: `16 (adc) + 40 (table) + 80 (left shift) = 136 bits`.
    pub sum: String,
    /// The bits that it needs.
    pub bits: u32,
}

impl Excess {
    /// What to change.
    pub fn remedy(&self) -> &'static str {
        match self.key {
            "circuit.demodulator.product" => {
                "give the product fewer fraction bits (no more than the ADC's and the table's \
                 together cost nothing), or the ADC or the table fewer bits"
            }
            "circuit.decimator.output" => {
                "give the product fewer bits, the output fewer fraction bits, or the decimator a \
                 smaller ratio or fewer stages"
            }
            "compensation.accumulator" => {
                "give the accumulator or the coefficients fewer bits, or the input fewer \
                 (`circuit.cordic.angle_bits` or `compensation.input_format`)"
            }
            "compensation.output" => {
                "give the output fewer fraction bits, the rate input or the accumulator fewer \
                 bits, or choose a smaller `rate_full_scale_dps`"
            }
            "circuit.phase_loop.proportional" => {
                "choose a smaller factor with a smaller shift, or fewer `circuit.cordic.angle_bits`"
            }
            "circuit.phase_loop.integral" => {
                "choose a smaller factor with a smaller shift, or fewer `integrator_bits`"
            }
            _ => "give the operands fewer bits",
        }
    }
}

impl fmt::Display for Excess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "needs {}; an exact intermediate has at most {MOST_BITS}",
            self.sum
        )
    }
}

/// Refuses the first intermediate, in the order of the chain, with more than 127 bits.
pub fn check(design: &Design) -> Result<(), Excess> {
    let circuit = &design.circuit;
    product(circuit)?;
    decimator(circuit)?;
    cordic(circuit)?;
    if let Some(compensation) = &design.compensation {
        polynomial(circuit, compensation)?;
        outputs(circuit, compensation)?;
    }
    if let Some(phase_loop) = &circuit.phase_loop {
        phase(circuit, phase_loop)?;
    }
    if let Some(amplitude_loop) = &circuit.amplitude_loop {
        amplitude(amplitude_loop)?;
    }
    Ok(())
}

/// Adds the terms up; those of zero bits are not shown.
fn count(key: &'static str, terms: &[(u32, &str)]) -> Result<(), Excess> {
    let bits = terms.iter().map(|(bits, _)| bits).sum();
    if bits <= MOST_BITS {
        return Ok(());
    }
    let shown: Vec<String> = terms
        .iter()
        .filter(|(bits, _)| *bits > 0)
        .map(|(bits, what)| format!("{bits} ({what})"))
        .collect();
    let sum = format!("{} = {bits} bits", shown.join(" + "));
    Err(Excess { key, sum, bits })
}

/// The left shift that brings a value with `from` fraction bits to `to`; 0 for a right shift.
fn left_shift(from: i64, to: u32) -> u32 {
    u32::try_from(i64::from(to) - from).unwrap_or(0)
}

/// The bits of an integer's shortest two's-complement form: 1 for 0 and -1, 2 for 1 and -2.
fn integer_bits(v: i128) -> u32 {
    let magnitude = if v < 0 { !v } else { v };
    129 - magnitude.leading_zeros()
}

fn unsigned(format: Format) -> (u32, &'static str) {
    (u32::from(!format.signed), "unsigned")
}

/// Step 2. code * entry: the ADC's bits + the table's; then the cast's left shift if the product's
/// format has more fraction bits than the two together.
fn product(c: &Circuit) -> Result<(), Excess> {
    let (adc, table) = (c.adc.format, c.nco.table);
    let fraction = i64::from(adc.fraction_bits) + i64::from(table.fraction_bits);
    let to = c.demodulator.product.format.fraction_bits;
    count(
        "circuit.demodulator.product",
        &[
            (adc.bits(), "adc"),
            (table.bits(), "table"),
            (left_shift(fraction, to), "left shift"),
        ],
    )
}

/// Steps 3 and 4. The integer S: the product's bits + G, one more with an unsigned product; then
/// the cast's left shift if the output has more fraction bits than the product's + G.
fn decimator(c: &Circuit) -> Result<(), Excess> {
    let product = c.demodulator.product.format;
    let gain = c.decimator.gain_bits();
    let fraction = i64::from(product.fraction_bits) + i64::from(gain);
    let to = c.decimator.output.format.fraction_bits;
    count(
        "circuit.decimator.output",
        &[
            (product.bits(), "product"),
            unsigned(product),
            (gain, "gain of the decimator"),
            (left_shift(fraction, to), "left shift"),
        ],
    )
}

/// Step 5. I << g: the output's bits + g (97 at most). x * constant: `width` bits, and the
/// constant's, which is positive and below 2^gain_bits: gain_bits + 1 (127 at most).
fn cordic(c: &Circuit) -> Result<(), Excess> {
    let output = c.decimator.output.format;
    count(
        "circuit.cordic.guard_bits",
        &[
            (output.bits(), "decimator output"),
            unsigned(output),
            (c.cordic.guard_bits, "left shift by guard_bits"),
        ],
    )?;
    count(
        "circuit.cordic.gain_bits",
        &[
            (c.cordic.width, "x"),
            (c.cordic.gain_bits + 1, "magnitude constant"),
        ],
    )
}

/// The polynomial's variable: its bits and its fraction bits. A phase has `angle_bits`, one less
/// of them fractional; a channel's word less its offset has the bits that its format's two ends
/// less the offset need; so has what a phase loop adds to the tuning word.
fn variable(c: &Circuit, k: &Compensation) -> (u32, u32) {
    match &k.input {
        CompensationInput::Phase => (c.cordic.angle_bits, c.cordic.angle_bits - 1),
        CompensationInput::TuningWord(t) => {
            let half = 1i128 << (c.nco.phase_bits - 1);
            let bits = |end: i128| integer_bits(end - t.offset_raw);
            (bits(-half).max(bits(half - 1)), t.scale_bits)
        }
        CompensationInput::Channel(channel) => {
            let bits = |end: i128| integer_bits(end - channel.offset_raw);
            let ends = bits(channel.format.min_raw()).max(bits(channel.format.max_raw()));
            (ends, channel.scale_bits)
        }
    }
}

/// Step 6, the accumulator. First t * p: t is the exact coefficient, so the coefficient format's
/// bits + p's, then the cast's left shift; later t is the accumulator's. The outer cast takes
/// c_k, which is a value of the accumulator's format, plus another one: never more.
fn polynomial(c: &Circuit, k: &Compensation) -> Result<(), Excess> {
    const KEY: &str = "compensation.accumulator";
    let (bits, fraction) = variable(c, k);
    let (first, later) = (k.coefficient_format, k.accumulator.format);
    let to = later.fraction_bits;
    if k.coefficients_raw.len() > 1 {
        let from = i64::from(first.fraction_bits) + i64::from(fraction);
        count(
            KEY,
            &[
                (first.bits(), "coefficient"),
                unsigned(first),
                (bits, "input"),
                (left_shift(from, to), "left shift"),
            ],
        )?;
    }
    if k.coefficients_raw.len() > 1 && k.outside == Outside::HoldSlope {
        let from = i64::from(first.fraction_bits) + i64::from(fraction);
        count(
            KEY,
            &[
                (first.bits(), "slope"),
                (bits + 1, "input beyond the range"),
                (left_shift(from, to), "left shift"),
            ],
        )?;
    }
    if k.coefficients_raw.len() > 2 {
        count(
            KEY,
            &[
                (later.bits(), "accumulator"),
                unsigned(later),
                (bits, "input"),
            ],
        )?;
    }
    Ok(())
}

/// Step 6, the outputs. The bias takes t (the coefficient itself if there is but one, else the
/// accumulator) with a left shift if the output is finer; the rate takes the rate input, times
/// 2^e deg/s, with a left shift of output fraction bits + e - input fraction bits. The carry of
/// q - bias does not count.
fn outputs(c: &Circuit, k: &Compensation) -> Result<(), Excess> {
    const KEY: &str = "compensation.output";
    let to = k.output.format.fraction_bits;
    let (t, what) = match k.coefficients_raw.len() {
        1 => (k.coefficient_format, "coefficient"),
        _ => (k.accumulator.format, "accumulator"),
    };
    count(
        KEY,
        &[
            (t.bits(), what),
            unsigned(t),
            (left_shift(i64::from(t.fraction_bits), to), "left shift"),
        ],
    )?;
    let rate = match &k.input {
        CompensationInput::Phase | CompensationInput::TuningWord(_) => c.decimator.output.format,
        CompensationInput::Channel(channel) => channel.rate_format,
    };
    let from = i64::from(rate.fraction_bits) - i64::from(k.rate_full_scale_exponent());
    count(
        KEY,
        &[
            (rate.bits(), "rate input"),
            unsigned(rate),
            (left_shift(from, to), "left shift to rate_full_scale_dps"),
        ],
    )
}

/// Step 7, the phase loop. kp * e: kp's own bits + `angle_bits`; ki * integrator: ki's own bits +
/// `integrator_bits`. Their sum with the tuning word is modulo 2^w and so not wider.
fn phase(c: &Circuit, l: &PhaseLoop) -> Result<(), Excess> {
    count(
        "circuit.phase_loop.proportional",
        &[
            (integer_bits(l.proportional.raw.into()), "proportional.raw"),
            (c.cordic.angle_bits, "phase error"),
        ],
    )?;
    count(
        "circuit.phase_loop.integral",
        &[
            (integer_bits(l.integral.raw.into()), "integral.raw"),
            (l.integrator_bits, "integrator"),
        ],
    )
}

/// Step 7, the amplitude loop. setpoint - magnitude: 64 bits each, the sum's carry aside; the
/// integrator: its limit (2^(gain_bits-1)-1) << integrator_shift has gain_bits + integrator_shift
/// bits (95 at most).
fn amplitude(l: &AmplitudeLoop) -> Result<(), Excess> {
    count(
        "circuit.amplitude_loop.setpoint_raw",
        &[(integer_bits(l.setpoint_raw.into()).max(64), "magnitude")],
    )?;
    count(
        "circuit.amplitude_loop.integrator_shift",
        &[
            (l.gain_bits, "gain"),
            (l.integrator_shift, "left shift by integrator_shift"),
        ],
    )
}

#[cfg(test)]
#[path = "limits_tests.rs"]
mod tests;
