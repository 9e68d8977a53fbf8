//! A design with other word lengths: integer bits stay, fraction bits change, and what is stated in the LSB of a
//! changed word is rescaled, so that the circuit does the same to that word's precision.
//!
//! | word | goes with it |
//! |---|---|
//! | ADC code | noise and effects that are stated in ADC LSB: the same voltage |
//! | oscillator | tuning word; the phase loop's gains; the compensation's tuning word input |
//! | decimated sample | the amplitude loop's setpoint, shifts and start; the CORDIC's width |
//! | guard bits | the CORDIC's width |
//! | phase | the phase loop's setpoint and gains; the calibrated range |
//! | drive gain | the amplitude loop's shifts |
//! | coefficients | rounded anew, from the fit where the design has it |

use crate::design::word::Word;
use crate::design::{Compensation, CompensationInput, Design, LoopGain, limits};
use crate::numeric::format::{Format, pow2};

/// `design` with these lengths.
///
/// # Errors
/// Why there is no such design.
pub fn with_lengths(design: &Design, lengths: &[(Word, u32)]) -> Result<Design, String> {
    let mut out = design.clone();
    for (word, length) in lengths {
        let Some(given) = word.length(design) else {
            continue;
        };
        let (least, most) = word.limits();
        if !(least..=most).contains(length) {
            return Err(format!("`{}` takes {least} to {most}", word.key()));
        }
        let by = *length as i32 - given as i32;
        if by != 0 {
            set(&mut out, *word, *length, by)?;
        }
    }
    coefficients(&mut out, design)?;
    if let Some(l) = &mut out.circuit.amplitude_loop {
        let limit = i64::try_from(l.integrator_limit()).unwrap_or(i64::MAX);
        l.initial_raw = l.initial_raw.clamp(0, limit);
    }
    let nco = &out.circuit.nco;
    if nco.table_address_bits > nco.phase_bits {
        return Err("the oscillator has fewer bits than its table's address".to_owned());
    }
    limits::check(&out).map_err(|e| format!("`{}` {e}", e.key))?;
    Ok(out)
}

/// The word `word`, which has `length` in the result, `by` more than in the given design.
fn set(out: &mut Design, word: Word, length: u32, by: i32) -> Result<(), String> {
    let circuit = &mut out.circuit;
    match word {
        Word::Adc => {
            circuit.adc.format = finer(circuit.adc.format, by)?;
            // The same voltages in another LSB.
            out.thermal_run.adc_noise_lsb *= pow2(by);
            for (effect, parameters) in [
                ("adc_offset", &[0][..]),
                ("adc_integral_nonlinearity", &[0, 1]),
                ("mains_pickup", &[0]),
            ] {
                for parameter in parameters {
                    out.gyro.effects.scale(effect, *parameter, pow2(by));
                }
            }
        }
        Word::Phase => oscillator(out, length, by)?,
        Word::Address => circuit.nco.table_address_bits = length,
        Word::Table => circuit.nco.table = finer(circuit.nco.table, by)?,
        Word::Product => {
            let product = &mut circuit.demodulator.product;
            product.format = finer(product.format, by)?;
        }
        Word::Decimated => {
            let output = &mut circuit.decimator.output;
            output.format = finer(output.format, by)?;
            widen(out, by)?;
            if let Some(l) = &mut out.circuit.amplitude_loop {
                l.setpoint_raw = scaled(l.setpoint_raw, by);
                l.initial_raw = scaled(l.initial_raw, by);
                l.error_shift = shifted(l.error_shift, by, "amplitude_loop.error_shift")?;
                l.integrator_shift =
                    shifted(l.integrator_shift, by, "amplitude_loop.integrator_shift")?;
            }
        }
        Word::Iterations => circuit.cordic.iterations = length,
        Word::Guard => {
            circuit.cordic.guard_bits = length;
            widen(out, by)?;
        }
        Word::Angle => {
            circuit.cordic.angle_bits = length;
            if let Some(l) = &mut circuit.phase_loop {
                l.setpoint_raw = scaled(l.setpoint_raw, by);
                l.proportional = per_step(l.proportional, by)?;
                l.integral = per_step(l.integral, by)?;
            }
            let by_phase = |c: &&mut Compensation| c.input == CompensationInput::Phase;
            if let Some(c) = out.compensation.as_mut().filter(by_phase) {
                c.clamp_raw = c.clamp_raw.map(|(low, high)| {
                    let half = 1i128 << (length - 1);
                    let to = |end: i128| scaled_wide(end, by).clamp(-half, half - 1);
                    (to(low), to(high))
                });
            }
        }
        Word::Gain => circuit.cordic.gain_bits = length,
        Word::Proportional => {
            if let Some(l) = &mut circuit.phase_loop {
                l.proportional = finer_gain(l.proportional, by, "proportional")?;
            }
        }
        Word::Integral => {
            if let Some(l) = &mut circuit.phase_loop {
                l.integral = finer_gain(l.integral, by, "integral")?;
            }
        }
        Word::Integrator => {
            if let Some(l) = &mut circuit.phase_loop {
                l.integrator_bits = length;
            }
        }
        Word::DriveGain => {
            if let Some(l) = &mut circuit.amplitude_loop {
                l.gain_bits = length;
                l.error_shift = shifted(l.error_shift, -by, "amplitude_loop.error_shift")?;
                l.integrator_shift =
                    shifted(l.integrator_shift, -by, "amplitude_loop.integrator_shift")?;
            }
        }
        Word::Coefficients => {
            if let Some(c) = &mut out.compensation {
                c.coefficient_format = finer(c.coefficient_format, by)?;
            }
        }
        Word::Accumulator => {
            if let Some(c) = &mut out.compensation {
                c.accumulator.format = finer(c.accumulator.format, by)?;
            }
        }
        Word::Output => {
            if let Some(c) = &mut out.compensation {
                c.output.format = finer(c.output.format, by)?;
            }
        }
    }
    Ok(())
}

/// `by` more fraction bits.
fn finer(format: Format, by: i32) -> Result<Format, String> {
    let fraction_bits = u32::try_from(format.fraction_bits as i32 + by)
        .map_err(|_| format!("{format} has no {} fraction bits to give", -by))?;
    if format.integer_bits + fraction_bits > 64 {
        return Err(format!("{format} with {by} bits more has more than 64"));
    }
    Ok(Format {
        fraction_bits,
        ..format
    })
}

/// x and y of the CORDIC have `by` more bits below, and so in all.
fn widen(out: &mut Design, by: i32) -> Result<(), String> {
    let width = out.circuit.cordic.width as i32 + by;
    if !(4..=64).contains(&width) {
        return Err(format!("`circuit.cordic.width` would be {width}"));
    }
    out.circuit.cordic.width = width as u32;
    Ok(())
}

fn oscillator(out: &mut Design, length: u32, by: i32) -> Result<(), String> {
    let nco = &mut out.circuit.nco;
    nco.phase_bits = length;
    let most = if length >= 64 {
        i128::from(i64::MAX)
    } else {
        (1i128 << length.min(63)) - 1
    };
    let word = scaled_wide(i128::from(nco.tuning_word), by);
    if word > most || word < -(1i128 << (length - 1)) || (word == 0) != (nco.tuning_word == 0) {
        return Err(format!("{length} bits do not hold the tuning word"));
    }
    nco.tuning_word = word as i64;
    if let Some(l) = &mut out.circuit.phase_loop {
        // The loop puts out steps of the oscillator.
        l.proportional = per_step(l.proportional, -by)?;
        l.integral = per_step(l.integral, -by)?;
    }
    if let Some(c) = &mut out.compensation
        && let CompensationInput::TuningWord(t) = &mut c.input
    {
        t.offset_raw = scaled_wide(t.offset_raw, by);
        let bits = t.scale_bits as i32 + by;
        t.scale_bits = u32::try_from(bits)
            .ok()
            .filter(|b| *b <= 64)
            .ok_or("the compensation's input has no such scale")?;
        c.clamp_raw = c
            .clamp_raw
            .map(|(low, high)| (scaled_wide(low, by), scaled_wide(high, by)));
    }
    Ok(())
}

/// raw * 2^by, to nearest.
fn scaled(raw: i64, by: i32) -> i64 {
    let wide = scaled_wide(i128::from(raw), by);
    wide.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64
}

fn scaled_wide(raw: i128, by: i32) -> i128 {
    match by {
        0.. => raw << by.min(60),
        _ => {
            let down = (-by).min(120);
            (raw + (1 << (down - 1))) >> down
        }
    }
}

fn shifted(shift: u32, by: i32, key: &str) -> Result<u32, String> {
    let new = shift as i32 + by;
    u32::try_from(new)
        .ok()
        .filter(|s| *s <= 63)
        .ok_or_else(|| format!("`circuit.{key}` would be {new}"))
}

/// The same gain for an input that counts 2^by times as many.
fn per_step(gain: LoopGain, by: i32) -> Result<LoopGain, String> {
    let shift = gain.shift as i32 + by;
    if (0..=63).contains(&shift) {
        return Ok(LoopGain {
            raw: gain.raw,
            shift: shift as u32,
        });
    }
    if shift > 63 {
        return Err(format!("a loop's shift would be {shift}"));
    }
    let raw = gain
        .raw
        .checked_mul(1i64.checked_shl(-shift as u32).unwrap_or(0));
    raw.filter(|r| *r != 0)
        .map(|raw| LoopGain { raw, shift: 0 })
        .ok_or_else(|| "a loop's factor would be too large".to_owned())
}

/// The same gain with `by` more fraction bits of its factor.
fn finer_gain(gain: LoopGain, by: i32, key: &str) -> Result<LoopGain, String> {
    let raw = scaled(gain.raw, by);
    if raw == 0 {
        return Err(format!("`circuit.phase_loop.{key}` would be 0"));
    }
    Ok(LoopGain {
        raw,
        shift: shifted(gain.shift, by, "phase_loop")?,
    })
}

/// The coefficients in their format, from the fit or from the given ones.
fn coefficients(out: &mut Design, given: &Design) -> Result<(), String> {
    let (Some(c), Some(from)) = (&mut out.compensation, &given.compensation) else {
        return Ok(());
    };
    if c.coefficient_format != from.coefficient_format {
        let lsb = c.coefficient_format.lsb();
        let values: Vec<f64> = match &from.fitted {
            Some(fitted) => fitted.coefficients_dps.clone(),
            None => {
                let lsb = from.coefficient_format.lsb();
                let raw = from.coefficients_raw.iter();
                raw.map(|r| *r as f64 * lsb).collect()
            }
        };
        let raw = values.iter().map(|v| (v / lsb + 0.5).floor() as i128);
        c.coefficients_raw = raw.collect();
    }
    if c.coefficient_format.fraction_bits > c.accumulator.format.fraction_bits {
        return Err("the coefficients have more fraction bits than the accumulator".to_owned());
    }
    let holds = |f: Format, raw: &i128, up: u32| f.contains(raw << up);
    let up = c.accumulator.format.fraction_bits - c.coefficient_format.fraction_bits;
    let held = c
        .coefficients_raw
        .iter()
        .all(|r| holds(c.coefficient_format, r, 0) && holds(c.accumulator.format, r, up));
    held.then_some(())
        .ok_or_else(|| "a coefficient does not fit its format".to_owned())
}

#[cfg(test)]
#[path = "retune_tests.rs"]
mod tests;
