//! The thermometer of the firmware, and formats where the design leaves them open.

use crate::cosim::scale::{nominal_full_scale_dps, power_of_two_near};
use crate::design::{
    BiasBound, ChannelInput, Circuit, Compensation, CompensationInput, Design, Outside,
    RecordMapping, TuningInput,
};
use crate::error::{InputError, Result};
use crate::numeric::format::{Format, Overflow, Quantizer, Rounding, pow2};
use crate::record::ThermalRecord;
use crate::text::number;
use crate::thermal::BaselineFit;

/// Bits of a chosen coefficient and of a chosen output.
const WORD_BITS: u32 = 32;
/// A chosen thermometer word has 16 to 24 bits (2^24 codes can be compared one by one).
const INPUT_BITS: std::ops::RangeInclusive<u32> = 16..=24;

/// Settles which column the bias is fitted in: the design's own compensation decides if it has one.
///
/// # Errors
/// A compensation whose input the record does not have.
pub fn choose_thermometer(
    design: &Design,
    record: &ThermalRecord,
    mapping: &mut RecordMapping,
) -> Result<()> {
    let own = design
        .compensation
        .as_ref()
        .filter(|_| design.compensation_is_own);
    let Some(own) = own else {
        return Ok(());
    };
    let column = column_of(own);
    let named = mapping.thermometer.as_deref().unwrap_or(column);
    if named != column {
        return Err(InputError::new(format!(
            "the record's thermometer is {named}, the compensation's input is {column}"
        ))
        .help("make `record.thermometer` and `compensation.input` agree, or leave one out")
        .into());
    }
    if record.column(column).is_none() {
        let has: Vec<&str> = record.columns.keys().map(String::as_str).collect();
        return Err(InputError::new(format!(
            "the compensation's input is {column}, which the record does not have"
        ))
        .in_file(&record.source)
        .help(format!(
            "the record has: {}; map one with [record.columns], change `compensation.input`, or leave \
             [compensation] out to have it chosen",
            has.join(", ")
        ))
        .into());
    }
    mapping.thermometer = Some(column.to_owned());
    Ok(())
}

/// The record's column that a compensation reads.
pub fn column_of(compensation: &Compensation) -> &str {
    match &compensation.input {
        CompensationInput::Phase => "phase_rad",
        CompensationInput::TuningWord(_) => "freq_hz",
        CompensationInput::Channel(channel) => &channel.column,
    }
}

/// Gives the design a compensation for the fit's thermometer if it has none for it; says what was
/// chosen and why.
///
/// # Errors
/// Ranges that no word holds.
pub fn fill(design: &mut Design, fit: &BaselineFit, record: &ThermalRecord) -> Result<Vec<String>> {
    let own = design.compensation_is_own;
    let usable = |c: &Compensation| {
        let fine = |b: BiasBound| 4.0 * c.output.format.lsb() <= b.bound_dps;
        let serves = || holds(&design.circuit, c, fit) && design.bound.is_none_or(fine);
        column_of(c) == fit.thermometer && (own || serves())
    };
    if design.compensation.as_ref().is_some_and(usable) {
        return Ok(Vec::new());
    }
    let rate = record.column("rate_out_dps").unwrap_or(&[]);
    let greatest = rate
        .iter()
        .copied()
        .filter(|v| !v.is_nan())
        .fold(0.0, |m: f64, v| m.max(v.abs()));
    // Rate and bias, and their difference, with a factor of two to spare.
    let wanted = design.bound.map_or(f64::INFINITY, |b| b.bound_dps);
    let step = (fit.noise_floor_rms_dps / 64.0).min(wanted / 4.0);
    let own = 4.0 * greatest;
    // A record at rest does not say how fast the gyro turns.
    let applied = record.column("rate_dps").unwrap_or(&[]);
    let is_at_rest = applied.iter().all(|v| v.is_nan() || *v == 0.0);
    let gyros = design.thermal_run.sense_full_scale_dps;
    let wide = no_finer_than(own.max(gyros), step, 16..=WORD_BITS)?;
    let is_wide = is_at_rest && own < gyros && wide.lsb() <= step;
    let output = match is_wide {
        true => wide,
        false => no_finer_than(own, step, 16..=WORD_BITS)?,
    };
    let (input, mut said) = match fit.thermometer.as_str() {
        "phase_rad" => (CompensationInput::Phase, Vec::new()),
        "freq_hz" if design.circuit.phase_loop.is_some() => tuning_word(design, fit),
        _ => channel(fit, output, wanted)?,
    };
    let of_chain = input.is_of_chain();
    let mut compensation = Compensation {
        input,
        coefficients_raw: vec![0],
        coefficient_format: output,
        accumulator: Quantizer::default_of(output),
        rate_full_scale_dps: 1.0,
        output: Quantizer::default_of(output),
        clamp_raw: None,
        outside: Outside::Clamp,
        fitted: None,
        form: None,
    };
    if of_chain {
        compensation.rate_full_scale_dps = power_of_two_near(nominal_full_scale_dps(design));
    }
    let (offset, scale) = super::coefficients::variable(&design.circuit, &compensation);
    let exact = fit.scaled_to(offset, scale);
    let largest = exact.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let sum: f64 = exact.iter().map(|v| v.abs()).sum();
    let coefficient = signed_for(2.0 * largest, WORD_BITS)?;
    let wide = signed_for(2.0 * sum, WORD_BITS)?;
    // The accumulator keeps the coefficients' LSB and has room for the sum of all terms.
    let accumulator = Format::q(wide.integer_bits, coefficient.fraction_bits);
    compensation.coefficient_format = coefficient;
    compensation.accumulator = Quantizer {
        format: accumulator,
        rounding: Rounding::HalfUp,
        overflow: Overflow::Saturate,
    };
    said.push(format!(
        "coefficients {coefficient}: {}, so that twice the largest one, 2 * {largest:.4} deg/s, fits; the rest of {WORD_BITS} bits are \
         fraction",
        reach(coefficient)
    ));
    said.push(format!(
        "accumulator {accumulator}: {}, so that twice the sum of the terms' magnitudes, 2 * {sum:.4} deg/s, fits",
        reach(accumulator)
    ));
    said.push(match is_wide {
        true => format!(
            "output {output}: {}, so that an assumed full scale of {gyros} deg/s fits, since a record at rest does not say how \
             fast the gyro turns (set thermal_run.sense_full_scale_dps to yours); its LSB is at most a 64th of the noise floor",
            reach(output)
        ),
        false => format!(
            "output {output}: {}, so that four times the largest rate, 4 * {greatest:.4} deg/s, fits; its LSB is at most a 64th \
             of the noise floor",
            reach(output)
        ),
    });
    design.compensation = Some(compensation);
    Ok(said)
}

/// The shortest signed format in `bits` whose values reach `peak` and whose LSB is at most `step`;
/// the longest, if none is as fine.
fn no_finer_than(peak: f64, step: f64, bits: std::ops::RangeInclusive<u32>) -> Result<Format> {
    let mut format = signed_for(peak, *bits.end())?;
    for count in bits {
        if let Ok(shorter) = signed_for(peak, count)
            && shorter.lsb() <= step
        {
            format = shorter;
            break;
        }
    }
    Ok(format)
}

/// The range of a signed format in a sentence.
fn reach(format: Format) -> String {
    let end = pow2(format.integer_bits as i32 - 1);
    format!("range -{end} to {end} deg/s")
}

/// True if the formats hold every coefficient of the fit.
fn holds(circuit: &Circuit, c: &Compensation, fit: &BaselineFit) -> bool {
    let (offset, scale) = super::coefficients::variable(circuit, c);
    let exact = fit.scaled_to(offset, scale);
    let format = c.coefficient_format;
    let fits = |v: &f64| format.contains((v / format.lsb()).round() as i128);
    exact.len() <= 16 && exact.iter().all(fits)
}

/// The narrowest signed format of `bits` bits whose values reach `peak`.
fn signed_for(peak: f64, bits: u32) -> Result<Format> {
    let integer_bits = (peak.max(f64::MIN_POSITIVE).log2().floor() as i32 + 2).max(1);
    if integer_bits as u32 > bits {
        return Err(
            InputError::new(format!("values up to {peak} fit no word of {bits} bits"))
                .help("give a [compensation] with formats of your own")
                .into(),
        );
    }
    Ok(Format::q(integer_bits as u32, bits - integer_bits as u32))
}

/// The circuit's own tuning word as thermometer: its zero in the middle of the calibrated range, its unit
/// the least power of two of steps that reaches the ends.
fn tuning_word(design: &Design, fit: &BaselineFit) -> (CompensationInput, Vec<String>) {
    let step_hz = super::coefficients::tuning_step_hz(&design.circuit);
    let given = design.circuit.nco.tuning_word as f64;
    let reach = (fit.half_span / step_hz).max(1.0);
    let input = TuningInput {
        offset_raw: (fit.centre / step_hz - given).round() as i128,
        scale_bits: (reach.log2().ceil() as u32).clamp(1, 64),
    };
    let said = vec![format!(
        "input tuning_word: the phase loop holds the phase, the frequency is the thermometer; a step is \
         {step_hz} Hz",
        step_hz = number(step_hz, 3)
    )];
    (CompensationInput::TuningWord(input), said)
}

/// A word for the thermometer: one LSB moves the bias by at most a sixteenth of the noise floor.
fn channel(
    fit: &BaselineFit,
    rate_format: Format,
    bound_dps: f64,
) -> Result<(CompensationInput, Vec<String>)> {
    let reach = fit.range.0.abs().max(fit.range.1.abs());
    let margin = 0.25 * (fit.range.1 - fit.range.0);
    let slope = (0..=100)
        .map(|k| fit.centre + fit.half_span * (f64::from(k) / 50.0 - 1.0))
        .map(|t| fit.slope_dps(t).abs())
        .fold(0.0, f64::max);
    let floor = fit.noise_floor_rms_dps.max(1e-9);
    // Half a step within half the bound, if one is asked for.
    let step_dps = (floor / 16.0).min(bound_dps);
    let format = no_finer_than(reach + margin, step_dps / slope.max(1e-12), INPUT_BITS)?;
    let lsb = format.lsb();
    let offset_raw = (fit.centre / lsb).round() as i128;
    let half_range = (fit.half_span / lsb).max(1.0);
    let scale_bits = (half_range.log2().ceil() as u32).clamp(1, 64);
    let said = vec![match slope == 0.0 {
        true => format!(
            "input {format} of {}, on which the bias does not depend",
            fit.thermometer
        ),
        false => format!(
            "input {format} of {}: one LSB moves the bias by at most {:.6} deg/s, far below the noise floor of {floor:.6} deg/s",
            fit.thermometer,
            slope * lsb
        ),
    }];
    Ok((
        CompensationInput::Channel(ChannelInput {
            column: fit.thermometer.clone(),
            format,
            offset_raw,
            scale_bits,
            rate_format,
        }),
        said,
    ))
}
