//! The closure of a capture: which waveform-level effect the declared model of two ADC channels lacks.
//!
//! Declared: drive code = round(A sin(p - pi/2)) + noise, sense code = round(rate and quadrature
//! carriers) + noise, p the oscillator's phase. Free in the baseline are the sense channel's two carriers (with a
//! known rate only the quadrature's), and how much of the quantiser's own error shows (all if noise is
//! added after rounding, next to none if before).
//!
//! [`input`] reads; [`examine`] looks whether the rows are what was sampled, with [`keys`], [`idle`], [`frequency`], [`clock`] and [`first_break`] (samples lost or repeated) and
//! [`wrong_codes`] (wrong codes), both on [`blocks`]; [`tone`] is the phase; [`columns`] are the functions of which effects are made, one
//! file an effect ([`offset`], [`gain`], [`latency`], [`feedthrough`], [`nonlinearity`],
//! [`harmonics`], [`mains`], [`spur`] with [`truncation`]); [`gram`] their sums and least squares;
//! [`search`] chooses. Outside of the linear part are [`clipping`] (with [`flat_top`], [`instant`], and [`crest`] with [`code_chances`]), [`missing`] (the histogram: [`code_counts`], [`missing_moves`]),
//! [`jitter`] (the variance). [`spectrum`] gives noise and lines ([`standing`]: which of them are new; [`skirts`]: those that hide in their own; [`rounding`]: those that are the quantiser's own), [`line_places`] where these are,
//! [`wander`] the slow noise that must not pass for an
//! effect. [`around`] is the fit with every freedom, [`steps`] where the quantiser's
//! steps are, [`own_steps`] the search where they show ([`exact_steps`]: with the steps exactly where the codes say),
//! [`fit`] runs all in rounds; [`report`] judges on held-out rows, with [`errors`], [`rivals`],
//! [`structure`] and [`firmware`]; [`bend`] is for the page, which is made in `report::capture`.

pub mod around;
pub mod bend;
pub mod blocks;
pub mod candidates;
pub mod clipping;
pub mod clock;
pub mod code_chances;
pub mod code_counts;
pub mod columns;
pub mod crest;
pub mod errors;
pub mod exact_steps;
pub mod examine;
#[cfg(test)]
mod examine_tests;
pub mod feedthrough;
pub mod firmware;
pub mod first_break;
pub mod fit;
pub mod flat_top;
pub mod frequency;
pub mod gain;
pub mod gram;
pub mod harmonics;
pub mod idle;
pub mod input;
pub mod instant;
pub mod jitter;
pub mod keys;
pub mod latency;
pub mod line_places;
pub mod mains;
pub mod memory;
pub mod missing;
pub mod missing_moves;
pub mod nonlinearity;
pub mod offset;
pub mod own_steps;
#[cfg(test)]
mod refusal_tests;
pub mod report;
mod reported_steps;
pub mod rivals;
pub mod rounding;
pub mod search;
pub mod signal;
pub mod skirts;
pub mod spectrum;
pub mod spur;
pub mod standing;
pub mod steps;
pub mod structure;
#[cfg(test)]
mod synthetic;
#[cfg(test)]
mod synthetic_rows;
pub mod tone;
pub mod truncation;
pub mod variant;
pub mod wander;
pub mod wrong_codes;

use super::verdict::{Closure, SCHEMA, Verdict};
use crate::design::Design;
use crate::error::{InputError, Result};
use crate::record::Warning;
use crate::record::capture::COLUMNS;
use candidates::Known;
use columns::{COS, Model, SIN};
use gram::{Combo, Detail, Gram, Summed, solve};
use input::Capture;
use report::Findings;
use std::path::Path;
use tone::Tone;

/// Fewest periods of the tone in a capture.
const LEAST_PERIODS: f64 = 4.0;

/// A closed capture, with what a report shows.
pub struct Closed {
    /// `closure.json`.
    pub closure: Closure,
    /// The codes.
    pub capture: Capture,
    /// Models and evidence.
    pub findings: Findings,
}

/// The closure of a capture file, and what a report shows beside it.
///
/// # Errors
/// A file that cannot be read as a capture, too few rows, no tone.
pub fn close(path: &Path, design: &Design, command: &str) -> Result<Closed> {
    let bits = design.circuit.adc.format.bits();
    let (capture, mut warnings) = input::read(path, bits)?;
    warnings.extend(key_warnings(&capture, bits));
    closed(capture, warnings, design, command).map_err(|e| match e {
        // What has a place has its file: the side-car's, for a key of an NPY capture.
        crate::error::Error::Input(e) if e.file.is_none() => (*e).in_file(path).into(),
        other => other,
    })
}

/// The same for a capture in memory, with what was seen when it was read.
///
/// # Errors
/// Those of [`analyse`].
pub fn closed(
    capture: Capture,
    mut warnings: Vec<Warning>,
    design: &Design,
    command: &str,
) -> Result<Closed> {
    let (capture, seen) = examine::examined(capture)?;
    warnings.extend(seen);
    let findings = analyse(&capture)?;
    warnings.extend(findings.warnings.iter().cloned());
    let closure = Closure {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        design_sha256: design.source.sha256.clone(),
        command: command.to_owned(),
        verdict: Verdict::of(findings.steps.len(), findings.structure.left),
        unit: "lsb",
        noise_floor_rms: findings.noise_floor_rms,
        before: findings.before,
        steps: findings.steps.clone(),
        after: findings.after,
        firmware: findings.firmware,
        residual_structure: findings.structure.clone(),
        evidence: findings.evidence.clone(),
        warnings,
    };
    Ok(Closed {
        closure,
        capture,
        findings,
    })
}

/// Models and evidence for a capture in memory, the rows of which were looked at by [`examine::examined`].
///
/// # Errors
/// A capture without a tone, or with less than four periods of it.
pub fn analyse(capture: &Capture) -> Result<Findings> {
    let no_tone = |what: &str| {
        let error = InputError::new(what)
            .help("check `ftw` and `fs_hz` against the capture; capture more periods of the drive");
        capture.places.put("ftw", error)
    };
    let tone = Tone::of(capture).ok_or_else(|| {
        let error = no_tone("the drive codes hold no tone, and `ftw` is not given");
        capture.places.put(COLUMNS[0], error)
    })?;
    if periods(capture, &tone) < LEAST_PERIODS {
        return Err(no_tone(
            "the drive tone has less than four periods to zero frequency or to half the sample rate in \
             this capture",
        )
        .into());
    }
    let (known, mut plain, fitted) = likeliest(capture, tone);
    plain.variance = fitted.model.variance;
    plain.variance.jitter = [0.0; 2];
    Ok(report::findings(capture, &known, &plain, &fitted))
}

/// Periods of the tone in a capture, to zero frequency or to half the sample rate.
fn periods(capture: &Capture, tone: &Tone) -> f64 {
    (0.5 - tone.folded()).min(tone.folded()) * capture.rows() as f64
}

/// What the keys say, the declared model fitted to the codes, and the effects, with the carrier of the rate that
/// makes the codes likeliest.
///
/// The one that is nearest to the sense tone as it is may not be it: a latency turns the tone, by the angle that the
/// drive shows, and so does a truncated oscillator.
fn likeliest(capture: &Capture, tone: Tone) -> (Known, Model, fit::Fitted) {
    let (known, plain) = known(capture, tone);
    let fitted = fit::fit(capture, &known, tone, &plain);
    let with = |known: &Known, carrier| {
        let known = Known {
            in_phase: carrier,
            ..known.clone()
        };
        let plain = baseline(capture, &known, tone);
        let fitted = fit::fit(capture, &known, tone, &plain);
        (known, plain, fitted)
    };
    let mut best = (known, plain, fitted);
    let mut tried = vec![best.0.in_phase];
    // Beside what was found the tone is known better: what is nearest then is what the contract's freedom leaves.
    let nearest = nearest_carrier(capture, best.2.free[1]);
    if !tried.contains(&nearest) {
        tried.push(nearest);
        best = with(&best.0, nearest);
    }
    if let Some(lag) = drive_lag(&best.0, &best.1, best.2.free[0]) {
        let (sin, cos) = lag.sin_cos();
        let [s, c] = best.2.free[1];
        let turned_back = nearest_carrier(capture, [s * cos - c * sin, c * cos + s * sin]);
        if !tried.contains(&turned_back) {
            let other = with(&best.0, turned_back);
            if fit::is_likelier(capture, &other.2, &best.2) {
                best = other;
            }
        }
    }
    best
}

/// Radians by which the drive's tone is late, as its declared phase tells; `None` where that is not known.
fn drive_lag(known: &Known, plain: &Model, free: [f64; 2]) -> Option<f64> {
    let [s, c] = plain.declared[0];
    let lag = (free[0] * c - free[1] * s).atan2(free[0] * s + free[1] * c);
    (known.phase && known.amplitude).then_some(lag)
}

/// What the keys say, and the declared model fitted to the codes.
fn known(capture: &Capture, tone: Tone) -> (Known, Model) {
    let meta = &capture.meta;
    let mut known = Known {
        fs_hz: meta.fs_hz,
        amplitude: meta.drive_amplitude_codes.is_some_and(|a| a != 0.0),
        phase: meta.ftw.is_some(),
        in_phase: None,
        full_scale_codes: capture.full_scale_codes,
    };
    let free = baseline(capture, &known, tone);
    let at = |k: usize| free.coefficients[1].get(k).copied().unwrap_or(0.0);
    known.in_phase = nearest_carrier(capture, [at(SIN), at(COS)]);
    let plain = baseline(capture, &known, tone);
    (known, plain)
}

/// The rate's carrier (its sine and cosine) and amplitude, if the rate is known; `found` is the sense tone as it is in
/// the codes. The contract leaves open whether the carrier is the sine or the cosine at `sense_phase_rad`, and its
/// sign: of the four the one is taken that is nearest to the known rate, so that only what none explains counts as a
/// deviation.
fn nearest_carrier(capture: &Capture, found: [f64; 2]) -> Option<([f64; 2], f64)> {
    let meta = &capture.meta;
    let codes = meta.rate_dps? * meta.sense_codes_per_dps?;
    let (sin, cos) = meta.sense_phase_rad?.sin_cos();
    let carriers = [[cos, sin], [-sin, cos], [-cos, -sin], [sin, -cos]];
    let off = |c: &[f64; 2]| (c[0] * found[0] + c[1] * found[1] - codes).abs();
    let nearest = carriers
        .into_iter()
        .min_by(|a, b| off(a).total_cmp(&off(b)))?;
    Some((nearest, codes))
}

/// The declared model with its free carriers fitted.
fn baseline(capture: &Capture, known: &Known, tone: Tone) -> Model {
    let mut model = fit::declared(capture, known, tone);
    let base = candidates::base(known);
    let combos: Vec<&Combo> = base.iter().collect();
    // Twice: the quantiser's error needs the signal.
    let summed = Summed::of(&combos, 1);
    for _ in 0..2 {
        let gram = Gram::over(capture, &model, &summed);
        let solved = solve(
            gram.all(),
            &combos,
            &candidates::base_ridge(&base),
            Detail::All,
        );
        model.coefficients = gram::spread(&combos, &solved);
        model.neutral = model.coefficients.clone();
    }
    model
}

fn key_warnings(capture: &Capture, design_bits: u32) -> Vec<Warning> {
    let meta = &capture.meta;
    let mut out = Vec::new();
    let mut missing = |key: &str, there: bool, what: &str| {
        if !there {
            let message = format!("the capture does not say `{key}`: {what}");
            out.push(Warning::general("missing_key", message));
        }
    };
    missing(
        "fs_hz",
        meta.fs_hz.is_some(),
        "times and frequencies are in samples",
    );
    missing(
        "ftw",
        meta.ftw.is_some(),
        "the tone is fitted, and latency and spurs cannot be seen",
    );
    missing(
        "drive_amplitude_codes",
        meta.drive_amplitude_codes.is_some(),
        "a gain error of the drive channel cannot be seen",
    );
    let full = format!("{design_bits} bits of the design are taken");
    missing("adc_bits", meta.adc_bits.is_some(), &full);
    let rate = meta.rate_dps.is_some()
        && meta.sense_codes_per_dps.is_some()
        && meta.sense_phase_rad.is_some();
    missing(
        "rate_dps, sense_codes_per_dps, sense_phase_rad",
        rate,
        "the sense channel's amplitude is free, and feedthrough shows in its noise alone",
    );
    out
}
