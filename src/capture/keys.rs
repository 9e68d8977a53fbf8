//! Whether the keys of a capture can be true, on their own and beside the codes.

use super::input::Capture;
use crate::error::{InputError, Result};
use crate::record::Warning;
use crate::record::capture::COLUMNS;
use std::f64::consts::TAU;

/// Sample rates, Hz, that an ADC has.
const RATES_HZ: [f64; 2] = [1.0, 1e12];
/// Sample rates, Hz, beyond which the unit is doubted.
const USUAL_RATES_HZ: [f64; 2] = [1e3, 1e10];
/// Widest ADC: a capture's codes are of 32 bits.
const BITS: std::ops::RangeInclusive<u32> = 2..=32;
/// Full scales of which a declared amplitude may be: a drive that clips is declared larger than full scale.
const FULL_SCALES: f64 = 4.0;
/// Least amplitude of a drive tone, codes.
const LEAST_CODES: f64 = 1.0;
/// Largest rate of a gyro, deg/s.
const LARGEST_DPS: f64 = 20_000.0;
/// Levels of a drive tone from which on codes that are multiples of four are no chance.
const LEAST_LEVELS: u32 = 8;
/// Turns of the sense carrier's phase: beyond one it is doubted, beyond two refused.
const TURNS: [f64; 2] = [1.0, 2.0];

/// Refuses keys that cannot be true, and says which are unlikely.
///
/// # Errors
/// The first such key, with its place.
pub fn checked(capture: &Capture) -> Result<Vec<Warning>> {
    let keys = Keys {
        capture,
        full: full_scale(capture),
    };
    let mut warnings = Vec::new();
    keys.rate(&mut warnings)?;
    keys.bits()?;
    keys.drive()?;
    keys.sense(&mut warnings)?;
    keys.phase(&mut warnings)?;
    keys.alignment()?;
    Ok(warnings)
}

/// Full scale, codes: that of `adc_bits`, and no less than the codes need.
fn full_scale(capture: &Capture) -> f64 {
    let codes = capture.codes.iter().flatten().map(|c| c.unsigned_abs());
    capture
        .full_scale_codes
        .max(f64::from(codes.max().unwrap_or(0)))
}

/// Low bits that are 0 in all of these codes.
fn empty_bits(codes: impl Iterator<Item = i32>) -> u32 {
    codes.fold(0, |all, code| all | code).trailing_zeros()
}

struct Keys<'a> {
    capture: &'a Capture,
    full: f64,
}

impl Keys<'_> {
    fn refuse(&self, key: &str, message: &str, help: &str) -> Result<()> {
        let error = InputError::new(format!("`{key}` {message}")).help(help);
        Err(self.capture.places.put(key, error).into())
    }

    fn rate(&self, warnings: &mut Vec<Warning>) -> Result<()> {
        let Some(fs) = self.capture.meta.fs_hz else {
            return Ok(());
        };
        if !(RATES_HZ[0]..=RATES_HZ[1]).contains(&fs) {
            let message = format!("is {fs:e} Hz, and no ADC samples at that rate");
            return self.refuse(
                "fs_hz",
                &message,
                "give the sample rate in Hz, or take the line away",
            );
        }
        if !(USUAL_RATES_HZ[0]..=USUAL_RATES_HZ[1]).contains(&fs) {
            let message = format!(
                "{fs} Hz is an unlikely sample rate: is `fs_hz` in kHz or MHz? All times and frequencies follow from it"
            );
            warnings.push(Warning::on("sample_rate_out_of_range", "fs_hz", message));
        }
        Ok(())
    }

    fn bits(&self) -> Result<()> {
        match self.capture.meta.adc_bits {
            Some(bits) if !BITS.contains(&bits) => self.refuse(
                "adc_bits",
                &format!(
                    "is {bits}, and a code has {} to {} bits",
                    BITS.start(),
                    BITS.end()
                ),
                "give the ADC's word length, sign included, or take the line away",
            ),
            _ => Ok(()),
        }
    }

    fn drive(&self) -> Result<()> {
        let most = FULL_SCALES * self.full;
        match self.capture.meta.drive_amplitude_codes {
            Some(a) if !(a >= LEAST_CODES && a <= most) => self.refuse(
                "drive_amplitude_codes",
                &format!("is {a:e}, and an amplitude is one code at least, and here {most} at most"),
                "give the drive tone's amplitude in codes, or take the line away if it is not known",
            ),
            _ => Ok(()),
        }
    }

    fn sense(&self, warnings: &mut Vec<Warning>) -> Result<()> {
        let meta = &self.capture.meta;
        if let Some(rate) = meta.rate_dps.filter(|r| r.abs() > LARGEST_DPS) {
            let message = format!("is {rate:e}, beyond {LARGEST_DPS} deg/s");
            return self.refuse(
                "rate_dps",
                &message,
                "give the applied rate in deg/s, or take the line away",
            );
        }
        let Some(scale) = meta.sense_codes_per_dps else {
            return Ok(());
        };
        let size = scale.abs();
        let codes = meta.rate_dps.unwrap_or(0.0).abs() * size;
        let least = 1.0 / LARGEST_DPS;
        if size < least || size > FULL_SCALES * self.full || codes > FULL_SCALES * self.full {
            let message = format!(
                "is {scale:e}, {codes:e} codes at the rate given, and {least:e} codes a deg/s to {FULL_SCALES} full \
                 scales in all are possible"
            );
            let help =
                "give codes of sense amplitude per deg/s, or take the line away if it is not known";
            return self.refuse("sense_codes_per_dps", &message, help);
        }
        if scale < 0.0 {
            let message = "a negative scale: the sign of the sense carrier is left open, so it is taken as it fits";
            warnings.push(Warning::on(
                "negative_scale",
                "sense_codes_per_dps",
                message,
            ));
        }
        Ok(())
    }

    fn phase(&self, warnings: &mut Vec<Warning>) -> Result<()> {
        let Some(phase) = self.capture.meta.sense_phase_rad else {
            return Ok(());
        };
        if phase.abs() > TURNS[1] * TAU {
            let message = format!("is {phase:e}, more than two turns: is it in degrees?");
            return self.refuse(
                "sense_phase_rad",
                &message,
                "give the sense carrier's phase in rad",
            );
        }
        if phase.abs() > TURNS[0] * TAU {
            let message = format!("{phase} rad is more than a turn: is the phase in degrees?");
            warnings.push(Warning::on("phase_in_degrees", "sense_phase_rad", message));
        }
        Ok(())
    }

    /// Refuses codes whose low bits are all 0: one may be a converter's that misses every other code, more are a
    /// narrower converter's in a wider word.
    fn alignment(&self) -> Result<()> {
        let bits = [0, 1].map(|c| empty_bits(self.capture.used_codes(c)));
        let empty = bits[0].min(bits[1]);
        let largest = self.capture.used_codes(0).map(i32::unsigned_abs).max();
        if empty < 2 || empty == 32 || largest.unwrap_or(0) >> empty < LEAST_LEVELS {
            return Ok(());
        }
        let error = InputError::new(format!(
            "the low {empty} bits of all codes are 0: they are aligned to the left"
        ))
        .help(format!(
            "divide the codes, `drive_amplitude_codes` and `sense_codes_per_dps` by {}, and take {empty} from \
             `adc_bits`: a capture's codes are aligned to the right",
            1u64 << empty
        ));
        Err(self.capture.places.put(COLUMNS[0], error).into())
    }
}
