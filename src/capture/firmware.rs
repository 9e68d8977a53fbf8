//! The compensation that firmware would run on the codes, in integers: code minus correction, rounded.
//!
//! Offset, gain and bend are corrected from the code itself (a table of integer corrections at the
//! code), latency and feedthrough from the oscillator's phase. What the correction leaves is held
//! against the declared model.

use super::columns::{ALL, HAT, HATS, Model, ONE, OTHER, POWER, POWERS, Rows, SEGMENT, chunks};
use super::input::{Capture, Part};
use crate::verdict::FirmwareErrors;

/// Held-out error of corrected codes. `effects` are the coefficients of the steps alone, `all` those with the
/// base; `applied` are the effects that the firmware takes away: these, or none.
pub fn corrected(
    capture: &Capture,
    model: &Model,
    all: &[Vec<f64>; 2],
    effects: &[Vec<f64>; 2],
    applied: &[Vec<f64>; 2],
) -> FirmwareErrors {
    let mut rows = Rows::new();
    let (mut sum, mut count, mut largest) = (0.0, 0.0, 0.0f64);
    for segment in capture.segments.iter().filter(|s| s.part == Part::HeldOut) {
        for chunk in chunks(segment.rows.clone()) {
            let (start, n) = (chunk.start, chunk.len());
            rows.fill(capture, model, chunk);
            for channel in 0..2 {
                let (effects, applied) = (&effects[channel], &applied[channel]);
                // What the base puts beyond the declared tone is no error: rate and quadrature.
                let base: Vec<f64> = all[channel]
                    .iter()
                    .zip(effects)
                    .map(|(a, e)| a - e)
                    .collect();
                for i in (0..n).filter(|i| !capture.is_left_out(start + i)) {
                    let code = rows.code(channel, i);
                    let correction =
                        bend(model, applied, code) + phased(&rows, channel, i, applied);
                    let corrected = (code - correction + 0.5).floor();
                    let declared = code - rows.target[channel][i];
                    let error = corrected - declared - rows.value(channel, i, &base);
                    sum += error * error;
                    largest = largest.max(error.abs());
                    count += 1.0;
                }
            }
        }
    }
    FirmwareErrors {
        compensable: true,
        heldout_rms: Some((sum / f64::max(count, 1.0)).sqrt()),
        heldout_max_abs: Some(largest),
    }
}

/// Powers, table and staircase of the code itself.
fn bend(model: &Model, coefficients: &[f64], code: f64) -> f64 {
    let at = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
    let u = code / model.span_codes;
    let powers: f64 = (0..POWERS)
        .map(|k| at(POWER + k) * u.powi(k as i32 + 1))
        .sum();
    let place = ((u + 1.0) * 0.5 * (HATS - 1) as f64).clamp(0.0, (HATS - 1) as f64 - 1e-9);
    let (k, part) = (place as usize, place.fract());
    let segment = at(SEGMENT + model.segment(code));
    powers + at(HAT + k) * (1.0 - part) + at(HAT + k + 1) * part + segment
}

/// Constant and tone by the phase.
fn phased(rows: &Rows, channel: usize, i: usize, coefficients: &[f64]) -> f64 {
    let columns = (ONE..ALL).filter(|k| *k < POWER || (OTHER..HAT).contains(k));
    let at = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
    columns
        .filter(|k| at(*k) != 0.0)
        .filter_map(|k| Some(at(k) * rows.dense[channel].get(k)?.get(i)?))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::super::analyse;
    use super::super::synthetic::Made;

    #[test]
    fn an_offset_below_half_a_code_is_nothing_for_firmware() {
        let of = |offset: f64| {
            let made = Made {
                offset,
                noise: 0.2,
                rows: 8000,
                ..Made::CLEAN
            };
            let found = analyse(&made.capture()).unwrap();
            assert!(
                found.steps.iter().any(|s| s.effect == "adc_offset"),
                "{offset}"
            );
            let told = found.warnings.iter().find(|w| w.code == "firmware_useless");
            (found.firmware, told.map(|w| w.message.clone()))
        };
        let (firmware, told) = of(0.4);
        assert!(!firmware.compensable && firmware.heldout_rms.is_none());
        let told = told.unwrap();
        assert!(
            told.contains("no better than none") && told.contains("nothing is emitted"),
            "{told}"
        );
        let (firmware, told) = of(3.0);
        assert!(firmware.compensable && firmware.heldout_rms.is_some() && told.is_none());
    }
}
