//! A coarse ADC without enough noise before it ([`super::adc_rounding`]) in a thermal record: how large its error is,
//! and the rows without it.
//!
//! The sense ADC's rounding adds to the rate. That of the drive ADC turns the phase, which is the thermometer, and
//! moves the amplitude that its loop holds, and with it the rate and its bias. All three turn with temperature as no
//! smooth law does. What the record says of I and Q of both channels tells the tones behind the codes, and so the
//! error of every row; it is taken off where the record is likelier without it.

use super::adc_rounding::{Rounding, phases, rms_lsb};
use super::channels::{self, Channels};
use super::search::{Effort, declared_by, powers};
use crate::circuit::scale::{amplitude_lsb_per_magnitude, sense_lsb_dps};
use crate::design::Design;
use crate::record::Warning;
use crate::statistics::reml;
use crate::statistics::stats;
use crate::text::number;
use std::collections::BTreeMap;

/// An error below this share of the record's white noise is not spoken of.
const MATTERS: f64 = 0.1;

/// Log-likelihood by which a record has to be likelier without the error.
const WORTH: f64 = 10.0;

/// Coefficients of the error that are one.
const LIKE: std::ops::Range<f64> = 0.5..1.5;

/// Share of the error that is left where it was taken off: the way back is not known to better.
const REMAINS: f64 = 0.1;

/// The columns of a record.
pub type Columns = BTreeMap<String, Vec<f64>>;

/// An error of a record's rows that the design's ADC makes.
#[derive(Debug, Clone, PartialEq)]
pub struct Undithered {
    /// Its rms as predicted from word lengths and noise, deg/s.
    pub predicted_dps: f64,
    /// What the record is without it.
    pub removed: Option<Removed>,
    noise_lsb: f64,
    phases: f64,
}

/// A record without its ADCs' error.
#[derive(Debug, Clone, PartialEq)]
pub struct Removed {
    /// Its columns.
    pub columns: Columns,
    /// The output of every row, of those as well that are not among the columns, deg/s.
    pub output_dps: Vec<f64>,
    /// rms of what was taken off the rate beyond its smooth part, deg/s.
    pub rms_dps: f64,
}

impl Undithered {
    /// The error that is still in the rows, deg/s.
    pub fn left_dps(&self) -> f64 {
        match &self.removed {
            Some(removed) => REMAINS * removed.rms_dps,
            None => self.predicted_dps,
        }
    }

    /// What is said of it.
    pub fn warning(&self, design: &Design) -> Warning {
        let done = match &self.removed {
            Some(removed) => format!(
                "The circuit's own blocks tell it row by row: {rms_dps} deg/s rms are taken off before and after; the \
                 firmware's error contains it",
                rms_dps = number(removed.rms_dps, 3)
            ),
            None => "The record does not tell it row by row: no step is named whose whole contribution is below twice \
                     of it"
                .to_owned(),
        };
        Warning::general(
            "adc_not_dithered",
            format!(
                "the noise before the ADC of {} bits, {:.2} LSB, does not dither it: at the {:.0} phases that the \
                 oscillator samples, its rounding adds up to an error of {} deg/s rms (predicted), which turns with \
                 temperature. {done}. Add noise of half an \
                 LSB before the ADC, take more bits, or a tuning word that does not repeat",
                design.circuit.adc.format.bits(),
                self.noise_lsb,
                self.phases,
                number(self.predicted_dps, 3)
            ),
        )
    }
}

/// What both ADCs see in a design, LSB.
struct Levels {
    sense_lsb_dps: f64,
    /// rms of the noise before each ADC.
    drive_noise: f64,
    sense_noise: f64,
    drive_amplitude: f64,
    /// A loop holds it.
    held: bool,
}

impl Levels {
    fn of(design: &Design) -> Self {
        let run = &design.thermal_run;
        let circuit = &design.circuit;
        let full_scale = -circuit.adc.format.min_raw() as f64;
        let sense_lsb_dps = sense_lsb_dps(design);
        // White noise of rms s at the sense input has, demodulated, the one-sided density 2 s / sqrt(fs).
        let rate = run.rate_noise_dps_rthz * circuit.sample_rate_hz.sqrt() / 2.0 / sense_lsb_dps;
        let held = circuit.amplitude_loop.as_ref();
        let magnitude_lsb = circuit.decimator.output.format.lsb();
        Levels {
            sense_lsb_dps,
            drive_noise: run.adc_noise_lsb,
            sense_noise: run.adc_noise_lsb.hypot(rate),
            drive_amplitude: held.map_or(full_scale * run.drive_amplitude, |l| {
                l.setpoint_raw as f64 * magnitude_lsb * amplitude_lsb_per_magnitude(design)
            }),
            held: held.is_some(),
        }
    }
}

/// The error of a record, if it matters there. `whole` is the output of every row, which the columns may lack; `seen` makes
/// channels of columns.
///
/// # Errors
/// Those of `seen`.
pub fn found<E>(
    (columns, whole): (&Columns, &[f64]),
    c: &Channels,
    design: &Design,
    seen: impl Fn(&Columns) -> Result<Channels, E>,
) -> Result<Option<Undithered>, E> {
    let levels = Levels::of(design);
    let output = columns.get("rate_out_dps").map_or(&[][..], Vec::as_slice);
    let measured: Vec<f64> = output.iter().copied().filter(|v| v.is_finite()).collect();
    let rate_dps = stats::rms(&measured);
    let quadrature = columns.get("quad_dps").filter(|q| q.len() == c.len());
    let quad_dps = quadrature.map_or(design.thermal_run.quadrature_dps.abs(), |q| {
        stats::rms(
            &q.iter()
                .copied()
                .filter(|v| v.is_finite())
                .collect::<Vec<_>>(),
        )
    });
    let amplitude = rate_dps.hypot(quad_dps) / levels.sense_lsb_dps;
    let samples = f64::from(design.thermal_run.samples_per_reading)
        * f64::from(design.circuit.decimator.ratio);
    let count = phases(design, amplitude.max(levels.drive_amplitude), samples);
    let sense_dps = levels.sense_lsb_dps * rms_lsb(count, amplitude, levels.sense_noise);
    // Of the drive's unit vector.
    let drive = rms_lsb(count, levels.drive_amplitude, levels.drive_noise) / levels.drive_amplitude;
    let (rest, slope) = declared(c);
    let by_phase = if c.thermometer == "phase_rad" {
        slope
    } else {
        0.0
    };
    let by_amplitude = if levels.held { rate_dps } else { 0.0 };
    let predicted_dps = sense_dps
        .hypot(drive * by_phase)
        .hypot(drive * by_amplitude);
    // Without any noise to hold it against, it does not.
    let matters = predicted_dps > MATTERS * stats::difference_noise(&rest);
    if !matters {
        return Ok(None);
    }
    let removed = match quadrature {
        Some(quadrature) => likeliest(
            c,
            design,
            &levels,
            columns,
            [output, whole, quadrature],
            seen,
        )?,
        None => None,
    };
    Ok(Some(Undithered {
        predicted_dps,
        removed,
        noise_lsb: levels.sense_noise.min(levels.drive_noise),
        phases: count,
    }))
}

/// What the declared model leaves, and the rms of its slope, deg/s per unit of the thermometer.
fn declared(c: &Channels) -> (Vec<f64>, f64) {
    let (bias, rest) = declared_by(&c.u, &c.error_dps);
    let slopes: Vec<f64> = c.u.iter().map(|u| bias.slope(*u) / c.half).collect();
    (rest, stats::rms(&slopes))
}

/// The columns without the error of the sense ADC, or of both, as it is or with a coefficient, whichever is
/// likeliest; `None` if the record is likelier as it is.
fn likeliest<E>(
    c: &Channels,
    design: &Design,
    levels: &Levels,
    columns: &Columns,
    [output, whole, quadrature]: [&[f64]; 3],
    seen: impl Fn(&Columns) -> Result<Channels, E>,
) -> Result<Option<Removed>, E> {
    let Some(sense) = Rounding::new(design, ["sense_i", "sense_q"], levels.sense_noise) else {
        return Ok(None);
    };
    let Some(quadrature) = channels::filled(&c.time_s, quadrature) else {
        return Ok(None);
    };
    let lsb = levels.sense_lsb_dps;
    // Row by row: what is not among the columns decides nothing about them.
    let ways = |output: &[f64]| -> Option<Vec<Columns>> {
        let rate = channels::filled(&c.time_s, output)?;
        let tones: Vec<[f64; 2]> = rate
            .iter()
            .zip(&quadrature)
            .map(|(i, q)| sense.behind([i / lsb, q / lsb]).map(|v| v * lsb))
            .collect();
        let column = |of: usize| tones.iter().map(|t| t[of]).collect();
        let alone: Columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), column(0)),
            ("quad_dps".to_owned(), column(1)),
        ]);
        let both = columns.get("phase_rad").filter(|_| levels.held);
        let both = both.and_then(|p| with_drive(c, design, levels, &alone, p));
        Some(std::iter::once(alone).chain(both).collect())
    };
    let (Some(changes), Some(of_all)) = (ways(output), ways(whole)) else {
        return Ok(None);
    };
    let mut best = (value(c, &c.error_dps, None).map(|v| v.0 + WORTH), None);
    for (changed, of_all) in changes.into_iter().zip(of_all) {
        let mut next = columns.clone();
        next.extend(changed);
        keep_holes(output, &mut next);
        let clean = seen(&next)?;
        let off: Vec<f64> = (c.error_dps.iter().zip(&clean.error_dps))
            .map(|(with, without)| with - without)
            .collect();
        let plain = value(&clean, &clean.error_dps, None).map(|v| v.0);
        let free = value(&clean, &c.error_dps, Some(&off));
        // A coefficient costs what Schwarz's criterion says.
        let price = 0.5 * (c.len() as f64).ln();
        let scaled = free.filter(|(v, b)| LIKE.contains(b) && plain.is_none_or(|p| v - price > p));
        let (reached, coefficient) = match scaled {
            Some((v, b)) => (Some(v - price), b),
            None => (plain, 1.0),
        };
        if reached <= best.0 {
            continue;
        }
        let without = |raw: &[f64], clean: &[f64]| -> Vec<f64> {
            let rows = raw.iter().zip(clean);
            rows.map(|(raw, clean)| raw - coefficient * (raw - clean))
                .collect()
        };
        let own = without(output, &next["rate_out_dps"]);
        next.insert("rate_out_dps".to_owned(), own);
        // Beyond what the declared model would take up.
        let rms_dps = coefficient * stats::rms(&declared_by(&clean.u, &off).1);
        let removed = Removed {
            columns: next,
            output_dps: without(whole, &of_all["rate_out_dps"]),
            rms_dps,
        };
        best = (reached, Some(removed));
    }
    Ok(best.1)
}

/// Rows without a measured rate stay so.
fn keep_holes(output: &[f64], columns: &mut Columns) {
    if let Some(rate) = columns.get_mut("rate_out_dps") {
        for (rate, raw) in rate.iter_mut().zip(output) {
            if !raw.is_finite() {
                *rate = f64::NAN;
            }
        }
    }
}

/// The columns without the drive ADC's error as well: the phase that its tone has, and the rate at the amplitude
/// that its loop would hold without the error.
fn with_drive(
    c: &Channels,
    design: &Design,
    levels: &Levels,
    sense: &Columns,
    phase_rad: &[f64],
) -> Option<Columns> {
    let drive = Rounding::new(design, ["drive_i", "drive_q"], levels.drive_noise)?;
    let phase_rad = channels::filled(&c.time_s, phase_rad)?;
    let held = levels.drive_amplitude;
    let mut phase = Vec::with_capacity(phase_rad.len());
    let mut amplitude = Vec::with_capacity(phase_rad.len());
    for read in phase_rad {
        let (sin, cos) = read.sin_cos();
        let [i, q] = drive.behind([held * cos, held * sin]);
        // The angle from the phase that was read to the tone's.
        phase.push(read + (q * cos - i * sin).atan2(i * cos + q * sin));
        amplitude.push(i.hypot(q) / held);
    }
    let mut out = BTreeMap::from([("phase_rad".to_owned(), phase)]);
    for (name, values) in sense {
        let at_setpoint = values.iter().zip(&amplitude).map(|(v, a)| v / a);
        out.insert(name.clone(), at_setpoint.collect());
    }
    Some(out)
}

/// Log-likelihood of an error under the declared model and perhaps one more column, with its coefficient.
fn value(c: &Channels, error_dps: &[f64], more: Option<&Vec<f64>>) -> Option<(f64, f64)> {
    let used: Vec<bool> = error_dps.iter().map(|e| e.is_finite()).collect();
    let mut columns = powers(&c.u);
    columns.extend(more.map(|off| {
        let finite = off.iter().map(|o| if o.is_finite() { *o } else { 0.0 });
        finite.collect()
    }));
    let options = reml::Options {
        rows: Effort::default().rows,
        ..reml::Options::default()
    };
    let fit = reml::fit(&c.time_s, error_dps, &columns, &used, &options).ok()?;
    Some((fit.loglik_ml, fit.beta.last().copied().unwrap_or(0.0)))
}

#[cfg(test)]
#[path = "adc_rows_tests.rs"]
mod tests;
