//! What a simulation comes to: `simulate.json`, and everything that the report shows.

use super::Run;
use super::hunting::Hunting;
use super::paper::{self, Figure, ScaleFactor, Simulated};
use super::startup::Startup;
use crate::cosim::readings::{Mean, Taken};
use crate::design::Design;
use crate::job::calibration::Calibration;
use crate::record::Warning;
use crate::text::number;
use crate::trace_file::Trace;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// What an outcome is made of.
#[derive(Debug)]
pub struct Parts {
    /// As given.
    pub design: Design,
    /// The command.
    pub command: String,
    /// The readings.
    pub run: Run,
    /// Of the bit-accurate path.
    pub record_csv: String,
    /// The design with the fitted compensation, and the fit; `None` for a run at rate or one that is too short.
    pub calibrated: Option<(Design, Calibration)>,
    /// The readings again with that compensation in the chain.
    pub after: Option<Vec<Taken>>,
    /// Power-on.
    pub startup: Startup,
    /// The circuit's words in it.
    pub trace: Trace,
    /// Dead bands and limit cycles.
    pub hunting: Vec<Hunting>,
    /// At each dwell.
    pub scale_factor: Vec<ScaleFactor>,
    /// Of the run.
    pub warnings: Vec<Warning>,
}

/// Drift over the run, deg/s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Drift {
    /// Greatest less least reading, applied rate subtracted.
    pub drift_pp_dps: f64,
    /// Root mean square.
    pub rms_dps: f64,
}

/// Float and fixed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Both {
    /// Without quantisation.
    pub float: Drift,
    /// Bit-accurate.
    pub fixed: Drift,
}

/// The largest distance of float and fixed over the readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Apart {
    /// Drive phase, rad.
    pub phase_rad: f64,
    /// Drive frequency, Hz.
    pub freq_hz: f64,
    /// Relative drive gain.
    pub agc: f64,
    /// Rate before compensation, deg/s.
    pub rate_out_dps: f64,
    /// Compensated rate, deg/s.
    pub rate_dps: Option<f64>,
}

/// The loops at the readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Lock {
    /// Every reading's mean phase is within 0.1 deg of the setpoint.
    pub locked: bool,
    /// Largest mean phase error, rad.
    pub phase_error_rad: f64,
    /// Largest distance of the mean frequency from the drive's resonance, Hz.
    pub freq_error_hz: f64,
    /// Least-squares slope of the frequency over the chamber's temperature, relative, ppm/K; none where that stands.
    pub tempco_ppm_per_k: Option<f64>,
}

/// The fit.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct FitSummary {
    /// The record's column.
    pub thermometer: String,
    /// Of the polynomial.
    pub order: usize,
    /// Lowest first, deg/s over powers of the thermometer's unit.
    pub coefficients: Vec<f64>,
    /// In the firmware's variable and formats.
    pub coefficients_raw: Vec<i128>,
    /// Rms of what it leaves of the record, deg/s.
    pub residual_rms_dps: f64,
    /// Formats that were chosen, with the reason.
    pub chosen: Vec<String>,
}

/// `simulate.json` (`gyrogen.simulate/1`).
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct Summary {
    /// `gyrogen.simulate/1`.
    pub schema: &'static str,
    /// Of the tool.
    pub version: &'static str,
    /// Of the design's text.
    pub design_sha256: String,
    /// The command.
    pub command: String,
    /// `fixed_frequency` or `resonance_tracking`.
    pub drive: &'static str,
    /// `warm_start` or `continuous`.
    pub mode: &'static str,
    /// In the record.
    pub readings: usize,
    /// Not compensated.
    pub before: Both,
    /// Compensated by the fit, in the chain; null if it was not fitted.
    pub after: Option<Both>,
    /// after.fixed / before.fixed, peak to peak.
    pub ratio: Option<f64>,
    /// The fit.
    pub fit: Option<FitSummary>,
    /// Float against fixed.
    pub float_fixed: Apart,
    /// Of a phase loop.
    pub lock: Option<Lock>,
    /// Power-on.
    pub startup: Startup,
    /// Dead bands and limit cycles.
    pub loops: Vec<Hunting>,
    /// At each dwell.
    pub scale_factor: Vec<ScaleFactor>,
    /// The published figures; empty for another gyro than the seed's.
    pub paper: Vec<Figure>,
    /// What the user should know of.
    pub warnings: Vec<Warning>,
}

/// A simulation's result.
#[derive(Debug)]
pub struct Outcome {
    /// For machines.
    pub summary: Summary,
    /// For the report.
    pub parts: Parts,
}

impl Outcome {
    /// Draws the conclusions.
    pub fn new(parts: Parts) -> Self {
        let design = &parts.design;
        let taken = &parts.run.taken;
        let before = both(taken, |m| m.rate_out_dps);
        let after = parts.after.as_ref().map(|a| both(a, |m| m.rate_dps));
        let lock = lock(design, taken);
        let swing = swing(&parts.scale_factor);
        let simulated = Simulated {
            before_pp_dps: before.fixed.drift_pp_dps,
            after_pp_dps: after.map(|a| a.fixed.drift_pp_dps),
            scale_factor_swing: swing,
            frequency_tempco_per_k: lock.and_then(|l| l.tempco_ppm_per_k).map(|t| t * 1e-6),
        };
        let own_run = !parts.run.continuous && parts.run.profile.is_none();
        let paper = if own_run {
            paper::figures(design, &simulated)
        } else {
            Vec::new()
        };
        let summary = Summary {
            schema: "gyrogen.simulate/1",
            version: env!("CARGO_PKG_VERSION"),
            design_sha256: design.source.sha256.clone(),
            command: parts.command.clone(),
            drive: if design.circuit.phase_loop.is_some() {
                "resonance_tracking"
            } else {
                "fixed_frequency"
            },
            mode: if parts.run.continuous {
                "continuous"
            } else {
                "warm_start"
            },
            readings: taken.len(),
            before,
            after,
            ratio: after
                .map(|a| a.fixed.drift_pp_dps / before.fixed.drift_pp_dps.max(f64::MIN_POSITIVE)),
            fit: parts.calibrated.as_ref().map(|(d, c)| fit(d, c)),
            float_fixed: apart(taken, parts.after.as_deref()),
            lock,
            startup: parts.startup.clone(),
            loops: parts.hunting.clone(),
            scale_factor: parts.scale_factor.clone(),
            paper,
            warnings: warnings(&parts),
        };
        Outcome { summary, parts }
    }

    /// What does not hold, in words; empty if everything does.
    pub fn failures(&self) -> Vec<String> {
        let mut failures = Vec::new();
        if let Some(lock) = &self.summary.lock
            && !lock.locked
        {
            failures.push(format!(
                "the phase loop does not lock everywhere: its phase is up to {} rad off, its frequency up to {} Hz",
                number(lock.phase_error_rad, 3), number(lock.freq_error_hz, 3)));
        }
        failures
    }
}

fn both(taken: &[Taken], of: fn(&Mean) -> f64) -> Both {
    let drift = |path: fn(&Taken) -> &Mean| {
        let errors: Vec<f64> = taken
            .iter()
            .map(|t| of(path(t)) - t.moment.surroundings.rate_dps)
            .collect();
        let high = errors.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let low = errors.iter().copied().fold(f64::INFINITY, f64::min);
        let squares: f64 = errors.iter().map(|e| e * e).sum();
        Drift {
            drift_pp_dps: high - low,
            rms_dps: (squares / errors.len().max(1) as f64).sqrt(),
        }
    };
    Both {
        float: drift(|t| &t.float),
        fixed: drift(|t| &t.fixed),
    }
}

fn apart(taken: &[Taken], after: Option<&[Taken]>) -> Apart {
    let largest = |taken: &[Taken], of: fn(&Mean) -> f64| {
        let distances = taken.iter().map(|t| (of(&t.fixed) - of(&t.float)).abs());
        distances.fold(0.0, f64::max)
    };
    Apart {
        phase_rad: largest(taken, |m| m.phase_rad),
        freq_hz: largest(taken, |m| m.freq_hz),
        agc: largest(taken, |m| m.agc),
        rate_out_dps: largest(taken, |m| m.rate_out_dps),
        rate_dps: after.map(|a| largest(a, |m| m.rate_dps)),
    }
}

/// A phase, rad, in [-pi, pi).
fn wrapped(rad: f64) -> f64 {
    (rad + PI).rem_euclid(TAU) - PI
}

fn lock(design: &Design, taken: &[Taken]) -> Option<Lock> {
    let l = design.circuit.phase_loop.as_ref()?;
    let turn = crate::numeric::format::pow2(-(design.circuit.cordic.angle_bits as i32)) * TAU;
    let setpoint = l.setpoint_raw as f64 * turn;
    let device = crate::plant::Device::new(&design.gyro);
    let errors = taken
        .iter()
        .map(|t| wrapped(t.fixed.phase_rad - setpoint).abs());
    let phase_error_rad = errors.fold(0.0, f64::max);
    let off = taken.iter().map(|t| {
        let degc = t.moment.temperatures.structure_degc;
        (t.fixed.freq_hz - device.drive.natural_frequency_hz(degc)).abs()
    });
    let freq_error_hz = off.fold(0.0, f64::max);
    let count = taken.len().max(1) as f64;
    let degc = |t: &Taken| t.moment.temperatures.chamber_degc;
    let mean_degc = taken.iter().map(degc).sum::<f64>() / count;
    let mean_hz = taken.iter().map(|t| t.fixed.freq_hz).sum::<f64>() / count;
    let (mut cross, mut square) = (0.0, 0.0);
    for t in taken {
        cross += (degc(t) - mean_degc) * (t.fixed.freq_hz - mean_hz);
        square += (degc(t) - mean_degc).powi(2);
    }
    let slope = (square > 0.0).then(|| cross / square);
    // Where the electronics' phase reaches the loop, or the setpoint is no resonance, the frequency is
    // pulled by design.
    Some(Lock {
        locked: phase_error_rad < 0.1f64.to_radians(),
        phase_error_rad,
        freq_error_hz,
        tempco_ppm_per_k: slope.map(|s| 1e6 * s / design.gyro.drive_frequency_hz),
    })
}

/// Half of the range over the mean.
fn swing(factors: &[ScaleFactor]) -> Option<f64> {
    let values = || factors.iter().map(|f| f.fixed);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    let low = values().fold(f64::INFINITY, f64::min);
    (!factors.is_empty()).then(|| (high - low) / (high + low))
}

fn fit(design: &Design, calibration: &Calibration) -> FitSummary {
    let raw = design
        .compensation
        .as_ref()
        .map(|c| c.coefficients_raw.clone());
    FitSummary {
        thermometer: calibration.fit.thermometer.clone(),
        order: calibration.fit.order,
        coefficients: calibration.fit.coefficients.clone(),
        coefficients_raw: raw.unwrap_or_default(),
        residual_rms_dps: calibration.fit.in_sample_rms_dps,
        chosen: calibration.chosen.clone(),
    }
}

fn warnings(parts: &Parts) -> Vec<Warning> {
    let mut warnings = parts.warnings.clone();
    let design = &parts.design;
    let full_scale = |t: &Taken| t.fixed.magnitude;
    let amplitude = crate::circuit::scale::amplitude_lsb_per_magnitude(design);
    let largest = parts.run.taken.iter().map(full_scale).fold(0.0, f64::max) * amplitude;
    let adc = crate::numeric::format::pow2(design.circuit.adc.format.bits() as i32 - 1);
    if largest > 0.99 * adc {
        warnings.push(Warning::general(
            "drive_adc_full",
            format!(
                "the drive's amplitude is {largest:.0} LSB, and the ADC ends at {adc:.0}. The drive's codes clip, and what follows \
                 them is not the gyro's. Give the ADC more bits or a wider range"
            ),
        ));
    }
    warnings.extend(Warning::of_setpoint(design));
    if let Some((what, mend)) = crate::circuit::scale::excitation_is_off(design) {
        warnings.push(Warning::general(
            "excitation_off_resonance",
            format!("{what}. To mend it, {mend}"),
        ));
    }
    if let Some((_, calibration)) = &parts.calibrated {
        warnings.extend(calibration.warnings.iter().cloned());
    }
    warnings
}
