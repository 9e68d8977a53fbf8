//! The published figures, each with its equation, beside what this run gives.
//!
//! Only the seed's own gyro is compared: with other parameters the paper says nothing.

use crate::circuit::engine::ArithmeticKind;
use crate::cosim::readings::{self, Taken};
use crate::design::template::default_design;
use crate::design::{Design, Gyro};
use crate::error::Result;
use crate::parallel::in_parallel;
use crate::plant::Device;
use serde::Serialize;

/// A published figure.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Figure {
    /// What it is.
    pub what: &'static str,
    /// Where it stands: equation or figure of the seed paper.
    pub source: &'static str,
    /// Of both values.
    pub unit: &'static str,
    /// As printed, or as derived from what is printed (`docs/paper.md`).
    pub published: f64,
    /// Half of the last printed digit; for what was derived from the recovered kappa, what its interval leaves open.
    pub tolerance: f64,
    /// Here.
    pub obtained: f64,
    /// `equation` = from the model's equations; `simulation` = through the bit-accurate chain.
    pub by: &'static str,
    /// `obtained` is within the tolerance.
    pub agrees: bool,
}

/// The scale factor at one temperature.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct ScaleFactor {
    /// Chamber, degC.
    pub chamber_degc: f64,
    /// True up to the top dwell.
    pub heating: bool,
    /// Output over applied rate, bit-accurate, 1 = nominal.
    pub fixed: f64,
    /// Without quantisation.
    pub float: f64,
}

/// Rows of a reading for the scale factor: it is a difference of two outputs of the same noise.
const ROWS: usize = 64;

/// The scale factor at each dwell, from the table's rate both ways.
///
/// # Errors
/// A circuit that stops on an overflow.
pub fn scale_factors(design: &Design, taken: &[Taken], threads: usize) -> Result<Vec<ScaleFactor>> {
    let mut dwells: Vec<&Taken> = Vec::new();
    for t in taken {
        let same = |d: &&Taken| {
            d.moment.temperatures.chamber_degc == t.moment.temperatures.chamber_degc
                && d.reading.heating == t.reading.heating
        };
        if !dwells.last().is_some_and(same) {
            dwells.push(t);
        }
    }
    // Of a long profile some: a figure has no more points.
    let step = dwells.len().div_ceil(200).max(1);
    let dwells: Vec<&Taken> = dwells.into_iter().step_by(step).collect();
    let rate = design.thermal_run.scale_rate_dps;
    let factor = |t: &Taken, kind| -> Result<f64> {
        let mut outputs = [0.0; 2];
        for (output, sign) in outputs.iter_mut().zip([1.0, -1.0]) {
            let mut moment = t.moment;
            moment.conditions.rate_dps = sign * rate;
            *output = readings::mean(design, kind, &t.reading, &moment, ROWS)?.rate_out_dps;
        }
        Ok((outputs[0] - outputs[1]) / (2.0 * rate))
    };
    in_parallel(&dwells, threads, &|_| (), |t| {
        Ok(ScaleFactor {
            chamber_degc: t.moment.temperatures.chamber_degc,
            heating: t.reading.heating,
            fixed: factor(t, ArithmeticKind::Fixed)?,
            float: factor(t, ArithmeticKind::Float)?,
        })
    })
    .into_iter()
    .collect()
}

/// What a simulation contributes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simulated {
    /// Drift before compensation, deg/s, peak to peak.
    pub before_pp_dps: f64,
    /// After, bit-accurate.
    pub after_pp_dps: Option<f64>,
    /// Half of the scale factor's range over its mean.
    pub scale_factor_swing: Option<f64>,
    /// Relative slope of the frequency, 1/K, where a phase loop tracks it.
    pub frequency_tempco_per_k: Option<f64>,
}

/// True if the design's gyro is the seed's.
fn is_seed(gyro: &Gyro) -> bool {
    default_design().is_ok_and(|d| d.gyro == *gyro)
}

/// The published figures with what is obtained; empty for another gyro than the seed's.
pub fn figures(design: &Design, simulated: &Simulated) -> Vec<Figure> {
    if !is_seed(&design.gyro) {
        return Vec::new();
    }
    let mut figures = by_equation(&Device::new(&design.gyro));
    let mut add = |what, source, unit, published: f64, tolerance: f64, obtained: Option<f64>| {
        if let Some(obtained) = obtained {
            figures.push(figure(
                what,
                source,
                unit,
                (published, tolerance),
                obtained,
                "simulation",
            ));
        }
    };
    if design.circuit.phase_loop.is_none() {
        add(
            "bias drift over 0..70 degC",
            "abstract, fig. 2",
            "deg/s",
            160.0,
            5.0,
            Some(simulated.before_pp_dps),
        );
        let left = simulated
            .after_pp_dps
            .map(|a| 100.0 * a / simulated.before_pp_dps);
        add(
            "bias drift left by the quadratic of eq. 9",
            "abstract, eq. 9",
            "%",
            5.0,
            0.5,
            left,
        );
        let swing = simulated.scale_factor_swing.map(|s| 100.0 * s);
        add(
            "scale factor, half of its range",
            "fig. 2",
            "%",
            4.3,
            0.05,
            swing,
        );
    }
    let tempco = simulated.frequency_tempco_per_k.map(|t| 1e6 * t);
    add(
        "drive frequency against temperature, tracked",
        "eq. 4",
        "ppm/K",
        -24.7,
        0.05,
        tempco,
    );
    figures
}

fn figure(
    what: &'static str,
    source: &'static str,
    unit: &'static str,
    (published, tolerance): (f64, f64),
    obtained: f64,
    by: &'static str,
) -> Figure {
    Figure {
        what,
        source,
        unit,
        published,
        tolerance,
        obtained,
        by,
        agrees: (obtained - published).abs() <= tolerance * (1.0 + 1e-9),
    }
}

/// Greatest less least over -10..70 degC in steps of 0.1 K.
fn swing(f: impl Fn(f64) -> f64) -> f64 {
    let values = (-100..=700).map(|i| f(f64::from(i) / 10.0));
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v), h.max(v))
    });
    high - low
}

fn by_equation(device: &Device) -> Vec<Figure> {
    let (drive, sense, hz) = (&device.drive, &device.sense, device.excitation_hz);
    let phase_deg = |t: f64| drive.response(t, hz).phase_rad.to_degrees();
    let linear_deg = |t: f64| drive.linear_phase_rad(t).to_degrees();
    let linearised = swing(|t| linear_deg(t) - phase_deg(t));
    let sense_amplitude = |t: f64| sense.response(t, hz).amplitude;
    let relative = |t: f64| 100.0 * (drive.response(t, hz).amplitude / drive.q - 1.0);
    let of = |what, source, unit, published, tolerance, obtained| {
        figure(
            what,
            source,
            unit,
            (published, tolerance),
            obtained,
            "equation",
        )
    };
    vec![
        of(
            "drive resonance at 0 degC",
            "eq. 4",
            "Hz",
            1751.160,
            1e-3,
            drive.natural_frequency_hz(0.0),
        ),
        of(
            "drive resonance at 70 degC",
            "eq. 4",
            "Hz",
            1748.135,
            1e-3,
            drive.natural_frequency_hz(70.0),
        ),
        of(
            "drive phase at 0 degC",
            "eq. 7",
            "deg",
            -86.208,
            3e-3,
            phase_deg(0.0),
        ),
        of(
            "drive phase at 70 degC",
            "eq. 7",
            "deg",
            -96.085,
            3e-3,
            phase_deg(70.0),
        ),
        of(
            "drive amplitude at -10 degC against resonance",
            "eq. 6, fig. 1",
            "%",
            -0.50,
            5e-3,
            relative(-10.0),
        ),
        of(
            "drive amplitude at 70 degC against resonance",
            "eq. 6, fig. 1",
            "%",
            -0.46,
            5e-3,
            relative(70.0),
        ),
        of(
            "error of the linear phase, peak to peak",
            "eq. 8 against eq. 7",
            "deg",
            0.0364,
            5e-5,
            linearised,
        ),
        of(
            "the same over the phase's swing",
            "eq. 8 against eq. 7",
            "%",
            0.32,
            5e-3,
            100.0 * linearised / swing(linear_deg),
        ),
        of(
            "sense amplitude, change",
            "eq. 6, section 2",
            "%",
            0.78,
            5e-3,
            100.0 * swing(sense_amplitude) / sense_amplitude(70.0),
        ),
        of(
            "sense phase, change",
            "eq. 7, section 2",
            "deg",
            0.417,
            5e-4,
            swing(|t| sense.response(t, hz).phase_rad.to_degrees()),
        ),
        of(
            "bias drift of the structure's phase alone",
            "eq. 9 with eq. 7",
            "deg/s",
            33.2,
            0.05,
            {
                let bias = |t: f64| device.bias_at_phase_dps(device.structural_phase_rad(t));
                bias(70.0) - bias(0.0)
            },
        ),
    ]
}
