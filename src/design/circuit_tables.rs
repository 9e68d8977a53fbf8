//! `[circuit]` and `[compensation]`: the keys of `docs/manual.md`, each with its
//! range.

use super::bound;
use super::keys::{self, THERMOMETERS};
use super::schema::*;
use super::table::{Real, Table, Value};
use crate::error::Result;
use crate::numeric::format::{Format, Rounding};

/// The smallest and the largest integer of TOML.
const I64: std::ops::RangeInclusive<i128> = i64::MIN as i128..=i64::MAX as i128;

/// Reads `[circuit]`; all of its keys are required.
pub(super) fn circuit(t: &Table) -> Result<Circuit> {
    Ok(Circuit {
        sample_rate_hz: t
            .need("sample_rate_hz")?
            .real(Real::Positive, "the ADC's sample rate in Hz")?,
        adc: Adc {
            format: signed_format(
                &t.need_section("adc")?.need("format")?,
                2..=32,
                "an ADC code",
            )?,
        },
        nco: nco(&t.need_section("nco")?)?,
        demodulator: Demodulator {
            product: t
                .need_section("demodulator")?
                .need("product")?
                .quantizer()?,
        },
        decimator: decimator(&t.need_section("decimator")?)?,
        cordic: cordic(&t.need_section("cordic")?)?,
        phase_loop: optional(t, "phase_loop", phase_loop)?,
        amplitude_loop: optional(t, "amplitude_loop", amplitude_loop)?,
    })
}

fn optional<T>(t: &Table, key: &str, read: impl Fn(&Table) -> Result<T>) -> Result<Option<T>> {
    let section = t.section(key)?;
    match section.is_given() {
        true => read(&section).map(Some),
        false => Ok(None),
    }
}

fn signed_format(value: &Value, bits: std::ops::RangeInclusive<u32>, what: &str) -> Result<Format> {
    let format = value.format()?;
    let (low, high) = (bits.start(), bits.end());
    if !format.signed {
        return Err(value
            .error(format!("is {format}; {what} is signed"))
            .help(format!(
                "write a signed format of {low} to {high} bits, such as \"Q1.15\""
            ))
            .into());
    }
    if !bits.contains(&format.bits()) {
        return Err(value
            .error(format!(
                "is {format}, which has {} bits; {what} has {low} to {high}",
                format.bits()
            ))
            .help(format!("choose m + n from {low} to {high}"))
            .into());
    }
    Ok(format)
}

fn nco(t: &Table) -> Result<Nco> {
    let phase_bits: u32 = t
        .need("phase_bits")?
        .integer(8..=64, "the phase accumulator's width w in bits")?;
    let top = (1i128 << phase_bits.min(63)) - 1;
    let tuning_word = t.need("tuning_word")?.integer(
        *I64.start()..=top,
        "what the accumulator advances in a sample, 0 to 2^phase_bits - 1, \
         or a negative word, which counts modulo 2^phase_bits; for a frequency it is \
         f_hz / sample_rate_hz * 2^phase_bits, rounded",
    )?;
    let bits = t.need("table_address_bits")?;
    let table_address_bits = bits.integer(
        2..=16,
        "the bits of the phase that address the table, at most phase_bits",
    )?;
    if table_address_bits > phase_bits {
        return Err(bits
            .error(format!(
                "is {table_address_bits}, more than the {phase_bits} bits of the phase"
            ))
            .help("choose at most `phase_bits`, or widen `phase_bits`")
            .into());
    }
    let address_rounding = t.need("address_rounding")?.choice(&[
        (Rounding::Floor.name(), Rounding::Floor),
        (Rounding::HalfUp.name(), Rounding::HalfUp),
    ])?;
    Ok(Nco {
        phase_bits,
        tuning_word,
        table_address_bits,
        address_rounding,
        table: signed_format(&t.need("table")?, 2..=40, "a table entry")?,
    })
}

fn decimator(t: &Table) -> Result<Decimator> {
    Ok(Decimator {
        stages: t
            .need("stages")?
            .integer(1..=6, "N, the integrators and combs")?,
        ratio: t
            .need("ratio")?
            .integer(2..=4096, "R, the ADC samples in one output")?,
        differential_delay: t
            .need("differential_delay")?
            .integer(1..=2, "M, the delay of a comb in outputs")?,
        output: t.need("output")?.quantizer()?,
    })
}

fn cordic(t: &Table) -> Result<Cordic> {
    Ok(Cordic {
        iterations: t
            .need("iterations")?
            .integer(4..=30, "the micro-rotations")?,
        guard_bits: t
            .need("guard_bits")?
            .integer(0..=32, "bits added below the inputs' LSB")?,
        width: t.need("width")?.integer(4..=64, "the bits of x and y")?,
        angle_bits: t
            .need("angle_bits")?
            .integer(4..=64, "b; a phase LSB is 2^-b turn")?,
        gain_bits: t
            .need("gain_bits")?
            .integer(1..=62, "the fraction bits of the magnitude's constant")?,
    })
}

fn loop_gain(t: &Table, key: &str) -> Result<LoopGain> {
    let gain = t.need_section(key)?;
    Ok(LoopGain {
        raw: gain
            .need("raw")?
            .integer(I64, "the factor; the gain is raw * 2^-shift")?,
        shift: gain.need("shift")?.integer(0..=63, SHIFT)?,
    })
}

const SHIFT: &str = "the bits of a right shift";

fn phase_loop(t: &Table) -> Result<PhaseLoop> {
    Ok(PhaseLoop {
        setpoint_raw: t
            .need("setpoint_raw")?
            .integer(I64, "the drive phase to hold, in 2^-angle_bits turn")?,
        proportional: loop_gain(t, "proportional")?,
        integral: loop_gain(t, "integral")?,
        integrator_bits: t
            .need("integrator_bits")?
            .integer(2..=64, "the integrator's width")?,
    })
}

fn amplitude_loop(t: &Table) -> Result<AmplitudeLoop> {
    let mut read = AmplitudeLoop {
        setpoint_raw: t
            .need("setpoint_raw")?
            .integer(I64, "the drive magnitude to hold, in its LSB")?,
        error_shift: t.need("error_shift")?.integer(0..=63, SHIFT)?,
        integrator_shift: t.need("integrator_shift")?.integer(0..=63, SHIFT)?,
        initial_raw: 0,
        gain_bits: t.need("gain_bits")?.integer(
            2..=32,
            "the gain's width; it stays in 0..=2^(gain_bits-1)-1",
        )?,
    };
    read.initial_raw = t.need("initial_raw")?.integer(
        0..=read.integrator_limit().min(*I64.end()),
        "the integrator's start, within its limits 0 to (2^(gain_bits-1)-1) << integrator_shift",
    )?;
    Ok(read)
}

/// Keys that only a thermometer outside the chain has.
const CHANNEL_KEYS: [&str; 4] = [
    "input_format",
    "input_offset_raw",
    "input_scale_bits",
    "rate_input_format",
];

/// Reads `[compensation]`, which belongs to `circuit`.
pub(super) fn compensation(t: &Table, circuit: &Circuit) -> Result<Compensation> {
    let input = compensation_input(t, circuit)?;
    let format_value = t.need("coefficient_format")?;
    let coefficient_format = format_value.format()?;
    let accumulator = t.need("accumulator")?.quantizer()?;
    let (fine, coarse) = (
        coefficient_format.fraction_bits,
        accumulator.format.fraction_bits,
    );
    if fine > coarse {
        return Err(format_value
            .error(format!(
                "is {coefficient_format} with {fine} fraction bits, more than the {coarse} of the \
                 accumulator, {}",
                accumulator.format
            ))
            .help(format!(
                "give the accumulator at least {fine} fraction bits, or the coefficients at most \
                 {coarse}: a coefficient enters the accumulator exactly"
            ))
            .into());
    }
    let full_scale = t.need("rate_full_scale_dps")?;
    let rate_full_scale_dps = full_scale.real(
        Real::Positive,
        "deg/s at a sense value of 1; a power of two",
    )?;
    if !is_power_of_two(rate_full_scale_dps) {
        let below = rate_full_scale_dps.log2().floor().exp2();
        return Err(full_scale
            .error(format!(
                "is {}; it has to be a power of two",
                full_scale.shown()
            ))
            .help(format!(
                "choose {below} or {}: the scale is a shift",
                2.0 * below
            ))
            .into());
    }
    let coefficients_raw = coefficients(t, coefficient_format, accumulator.format)?;
    let mut compensation = Compensation {
        fitted: fitted(t, coefficients_raw.len())?,
        form: None,
        coefficients_raw,
        coefficient_format,
        accumulator,
        rate_full_scale_dps,
        output: t.need("output")?.quantizer()?,
        clamp_raw: clamp(t, &input, circuit)?,
        outside: Outside::Clamp,
        input,
    };
    compensation.outside = outside(t, &compensation, circuit)?;
    compensation.form = bound::evaluation(t, &compensation, circuit)?;
    Ok(compensation)
}

/// A slope is a constant like a coefficient.
fn outside(t: &Table, c: &Compensation, circuit: &Circuit) -> Result<Outside> {
    let Some(value) = t.get("outside") else {
        return Ok(Outside::Clamp);
    };
    let kinds = [Outside::Clamp, Outside::HoldSlope, Outside::Flag].map(|o| (o.name(), o));
    let outside = value.choice(&kinds)?;
    if outside != Outside::HoldSlope {
        return Ok(outside);
    }
    // Without a calibrated range there is no outside; a fit sets both.
    let Some((low, high)) = c.clamp_raw else {
        return Ok(outside);
    };
    for word in [low, high] {
        let slope = c.slope_raw(circuit, word);
        if !c.coefficient_format.contains(slope) {
            return Err(value
                .error(format!(
                    "needs the polynomial's slope at input {word}, raw {slope}, which coefficient_format {} \
                     cannot hold",
                    c.coefficient_format
                ))
                .help("give coefficient_format more integer bits, or set `outside = \"clamp\"`")
                .into());
        }
    }
    Ok(outside)
}

fn fitted(t: &Table, count: usize) -> Result<Option<Fitted>> {
    optional(t, "fitted", |table| fitted_table(table, count))
}

fn fitted_table(table: &Table, count: usize) -> Result<Fitted> {
    let value = table.need("coefficients_dps")?;
    let elements = value.array("[109.60, 763.31, 1350.36]")?;
    if elements.len() != count {
        return Err(value
            .error(format!(
                "has {} coefficients, coefficients_raw has {count}",
                elements.len()
            ))
            .help("delete [compensation.fitted] where coefficients are changed by hand")
            .into());
    }
    let any = |v: &Value, what| v.real(Real::Any, what);
    let coefficients_dps = elements
        .iter()
        .map(|e| any(e, "deg/s"))
        .collect::<Result<Vec<f64>>>()?;
    let size = |key: &str| table.need(key)?.real(Real::NotNegative, "deg/s");
    Ok(Fitted {
        coefficients_dps,
        std_max_dps: size("std_max_dps")?,
        heldout_rms_dps: size("heldout_rms_dps")?,
        loop_rms_dps: match table.get("loop_rms_dps") {
            Some(value) => Some(value.real(Real::NotNegative, "deg/s")?),
            None => None,
        },
    })
}

fn is_power_of_two(x: f64) -> bool {
    let mantissa = x.to_bits() & ((1 << 52) - 1);
    match x.is_normal() {
        true => mantissa == 0,
        false => mantissa.is_power_of_two(),
    }
}

/// The tuning word moves only where a phase loop moves it.
fn tuning_input(t: &Table, circuit: &Circuit, input: &Value) -> Result<CompensationInput> {
    if circuit.phase_loop.is_none() {
        return Err(input
            .error("is \"tuning_word\", which stands still without a phase loop")
            .help("add [circuit.phase_loop], or set `input = \"phase\"`")
            .into());
    }
    if let Some(extra) = ["input_format", "rate_input_format"]
        .iter()
        .find_map(|k| t.get(k))
    {
        return Err(extra
            .error("goes only with a thermometer that is not the chain's own")
            .help("delete it")
            .into());
    }
    let bits = circuit.nco.phase_bits;
    let half = 1i128 << (bits - 1);
    Ok(CompensationInput::TuningWord(TuningInput {
        offset_raw: t.take("input_offset_raw", Some(0), |v| {
            v.integer(-half..=half - 1, "tuning word steps")
        })?,
        scale_bits: t.take("input_scale_bits", Some(bits - 1), |v| {
            v.integer(
                0..=64,
                "the polynomial's variable is (steps - offset) * 2^-bits",
            )
        })?,
    }))
}

fn compensation_input(t: &Table, circuit: &Circuit) -> Result<CompensationInput> {
    let value = t.need("input")?;
    let words: Vec<(&str, &str)> = ["phase", "tuning_word"]
        .into_iter()
        .chain(THERMOMETERS.iter().copied())
        .map(|w| (w, w))
        .collect();
    let column = value.choice(&words)?;
    if column == "phase" {
        if let Some(extra) = CHANNEL_KEYS.iter().find_map(|key| t.get(key)) {
            return Err(extra
                .error("goes only with a thermometer that is not the chain's own phase")
                .help(format!(
                    "delete it, or set `input` to {}",
                    keys::one_of(THERMOMETERS.iter().copied())
                ))
                .into());
        }
        return Ok(CompensationInput::Phase);
    }
    if column == "tuning_word" {
        return tuning_input(t, circuit, &value);
    }
    let format = t.need("input_format")?.format()?;
    let offset_raw = t.take("input_offset_raw", Some(0), |v| {
        v.integer(
            format.min_raw()..=format.max_raw(),
            "the word that is the polynomial's zero, a value of input_format",
        )
    })?;
    let scale_bits = t.take("input_scale_bits", Some(format.bits() - 1), |v| {
        v.integer(
            0..=64,
            "the polynomial's variable is (raw - offset) * 2^-bits",
        )
    })?;
    Ok(CompensationInput::Channel(ChannelInput {
        column: column.to_owned(),
        format,
        offset_raw,
        scale_bits,
        rate_format: t.need("rate_input_format")?.format()?,
    }))
}

fn coefficients(t: &Table, format: Format, accumulator: Format) -> Result<Vec<i128>> {
    let value = t.need("coefficients_raw")?;
    let elements = value.array("[3591373, 7961641, 4483318]")?;
    if !(1..=16).contains(&elements.len()) {
        return Err(value
            .error(format!(
                "has {} coefficients; a polynomial has 1 to 16",
                elements.len()
            ))
            .help("list 1 to 16 integers, the lowest order first")
            .into());
    }
    // c << shift is a value of the accumulator's format exactly if c is between these.
    let shift = accumulator.fraction_bits - format.fraction_bits;
    let held = -(-accumulator.min_raw() >> shift)..=accumulator.max_raw() >> shift;
    let raws = elements.iter().map(|element| {
        element.integer(
            format.min_raw()..=format.max_raw(),
            &format!("a raw value of coefficient_format, {format}"),
        )
    });
    let raws = raws.collect::<Result<Vec<i128>>>()?;
    let mut pairs = elements.iter().zip(&raws);
    if let Some((element, raw)) = pairs.find(|(_, raw)| !held.contains(*raw)) {
        let wider = holding(&raws, format, accumulator);
        return Err(element
            .error(format!(
                "is {raw}, which the accumulator's format {accumulator} cannot hold"
            ))
            .help(match wider.bits() {
                0..=64 => format!(
                    "at least {} integer bits hold all coefficients: {wider}",
                    wider.integer_bits
                ),
                bits => format!(
                    "{wider} would hold all coefficients, but has {bits} bits, and a word at most 64: give coefficients and accumulator \
                     fewer fraction bits"
                ),
            })
            .into());
    }
    Ok(raws)
}

/// The accumulator's format with the fewest integer bits that hold all coefficients; it is signed if one of them is negative.
fn holding(raws: &[i128], coefficient: Format, accumulator: Format) -> Format {
    let signed = accumulator.signed || raws.iter().any(|raw| *raw < 0);
    let bits = |raw: &i128| {
        let magnitude = if *raw < 0 { !*raw } else { *raw };
        128 - magnitude.leading_zeros() + u32::from(signed)
    };
    let most = raws.iter().map(bits).max().unwrap_or(0);
    Format {
        signed,
        integer_bits: most
            .saturating_sub(coefficient.fraction_bits)
            .max(accumulator.integer_bits),
        fraction_bits: accumulator.fraction_bits,
    }
}

fn clamp(t: &Table, input: &CompensationInput, circuit: &Circuit) -> Result<Option<(i128, i128)>> {
    let Some(value) = t.get("clamp_raw") else {
        return Ok(None);
    };
    let (range, what) = match input {
        CompensationInput::Phase => {
            let half = 1i128 << (circuit.cordic.angle_bits - 1);
            (-half..=half - 1, "a raw phase of angle_bits")
        }
        CompensationInput::TuningWord(_) => {
            let half = 1i128 << (circuit.nco.phase_bits - 1);
            (-half..=half - 1, "tuning word steps")
        }
        CompensationInput::Channel(channel) => (
            channel.format.min_raw()..=channel.format.max_raw(),
            "a raw value of input_format",
        ),
    };
    let elements = value.array("[-5900000, -3900000]")?;
    let [low, high] = elements.as_slice() else {
        return Err(value
            .error(format!("has {} numbers; it takes two", elements.len()))
            .help("write the lowest and the highest calibrated input: `clamp_raw = [low, high]`")
            .into());
    };
    let low: i128 = low.integer(range.clone(), what)?;
    let high: i128 = high.integer(range, what)?;
    if low >= high {
        return Err(value
            .error(format!("is [{low}, {high}], which is no range"))
            .help("write the lower end first")
            .into());
    }
    Ok(Some((low, high)))
}
