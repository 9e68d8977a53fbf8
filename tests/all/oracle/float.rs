//! The chain on real numbers (`--arith float`).
//!
//! The accumulated phase is an exact 128-bit fraction of a turn, the decimator
//! is a direct convolution with the exact integer response of the CIC, so
//! nothing grows with the length of the capture; the rest is careful f64.

use std::f64::consts::TAU;

use super::design::{Compensation, Design, Thermometer};

/// One decimated sample, in the units of the contract.
#[derive(Clone, Debug, PartialEq)]
pub struct FloatRow {
    pub channels: [f64; 4],
    /// Turns in [-1/2, 1/2).
    pub phase: f64,
    pub magnitude: f64,
    pub rate: Option<f64>,
    /// Hz.
    pub tuning_word: Option<f64>,
    pub gain: Option<f64>,
}

impl FloatRow {
    /// The row in the order of the columns.
    pub fn values(&self, index: usize) -> Vec<f64> {
        let mut values = vec![index as f64];
        values.extend(self.channels);
        values.extend([self.phase, self.magnitude]);
        values.extend(self.rate);
        values.extend(self.tuning_word);
        values.extend(self.gain);
        values
    }
}

/// A disturbance that tells well-conditioned values from the others: it is
/// added to drive I, drive Q and sense I, in units of the channels' greatest value.
pub type Disturbance = [f64; 3];

/// A turn as a 128-bit fraction; sums wrap like the phase does.
type Turn = u128;

/// sin and cos at a fraction of a turn, reduced to an eighth of a turn exactly.
fn sin_cos(turn: Turn) -> (f64, f64) {
    let quadrant = (turn.wrapping_add(1 << 125) >> 126) & 3;
    let rest = turn.wrapping_sub(quadrant << 126) as i128;
    let angle = rest as f64 * 2f64.powi(-128) * TAU;
    let (sin, cos) = angle.sin_cos();
    match quadrant {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// A real number of turns, modulo 1.
fn turn_of(turns: f64) -> Turn {
    let fraction = turns - turns.floor(); // exact but for tiny negative numbers
    let high = (fraction * 2f64.powi(64)).floor();
    let low = (fraction * 2f64.powi(64) - high) * 2f64.powi(64);
    // A fraction that rounded to 1 saturates `high`, which is one 2^-64 turn off.
    (u128::from(high as u64) << 64) + u128::from(low as u64)
}

/// The impulse response of N integrators and combs: ones convolved N times.
fn response(design: &Design) -> Vec<f64> {
    let length = (design.ratio * design.differential_delay) as usize;
    let mut taps: Vec<u128> = vec![1];
    for _ in 0..design.stages {
        let mut next = vec![0u128; taps.len() + length - 1];
        let mut window = 0u128;
        for (at, slot) in next.iter_mut().enumerate() {
            window += taps.get(at).copied().unwrap_or(0);
            if at >= length {
                window -= taps.get(at - length).copied().unwrap_or(0);
            }
            *slot = window;
        }
        taps = next;
    }
    let scale = 2f64.powi(-(design.growth_bits() as i32));
    taps.iter().map(|&tap| tap as f64 * scale).collect()
}

/// Wraps turns to [-1/2, 1/2).
pub fn wrap_turns(turns: f64) -> f64 {
    let wrapped = turns - (turns + 0.5).floor();
    if wrapped >= 0.5 {
        wrapped - 1.0
    } else {
        wrapped
    }
}

/// The polynomial's variable; `detuning` is what the phase loop has added, a wrapped turn.
fn variable(design: &Design, input: Thermometer, phase: f64, detuning: Turn) -> f64 {
    match input {
        Thermometer::Phase => 2.0 * phase,
        Thermometer::TuningWord {
            offset_raw,
            scale_bits,
        } => {
            let turns = detuning as i128 as f64 * 2f64.powi(-128);
            let steps = turns * 2f64.powi(design.nco.phase_bits as i32);
            (steps - offset_raw as f64) * 2f64.powi(-(scale_bits as i32))
        }
    }
}

/// sense I in deg/s less the polynomial.
fn rate(compensation: &Compensation, p: f64, sense_i: f64) -> f64 {
    let unit = 2f64.powi(-(compensation.coefficient_format.n as i32));
    let bias = compensation
        .coefficients_raw
        .iter()
        .rev()
        .fold(0.0, |t, &c| c as f64 * unit + t * p);
    sense_i * 2f64.powi(compensation.rate_full_scale_log2) - bias
}

/// The greatest value that a channel can have.
pub fn greatest_channel(design: &Design) -> f64 {
    let gain = f64::from(design.ratio * design.differential_delay).powi(design.stages as i32)
        * 2f64.powi(-(design.growth_bits() as i32));
    let table = design.nco.table;
    let amplitude = table.greatest() as f64 * 2f64.powi(-(table.n as i32));
    design.adc.full_scale() * amplitude * gain
}

/// Runs a capture through the chain on real numbers.
pub fn replay(design: &Design, capture: &[(i64, i64)], disturbance: Disturbance) -> Vec<FloatRow> {
    let nco = &design.nco;
    let code_unit = 2f64.powi(-(design.adc.n as i32));
    let amplitude = nco.table.greatest() as f64 * 2f64.powi(-(nco.table.n as i32));
    let taps = response(design);
    let scale = greatest_channel(design);
    let word_unit = 2f64.powi(-(nco.phase_bits as i32));
    let given: Turn = {
        let modulus = 1i128 << nco.phase_bits;
        let word = i128::from(nco.tuning_word).rem_euclid(modulus) as u128;
        word << (128 - nco.phase_bits)
    };
    let angle_unit = 2f64.powi(design.cordic.angle_bits as i32);

    let mut step = given;
    let mut phase: Turn = 0;
    let mut loop_integrator = 0.0f64;
    let mut amplitude_integrator = match &design.amplitude_loop {
        Some(control) => control.initial_raw as f64,
        None => 0.0,
    };
    let mut products: Vec<[f64; 4]> = Vec::with_capacity(capture.len());
    let mut rows = Vec::new();
    for (n, &(drive, sense)) in capture.iter().enumerate() {
        phase = phase.wrapping_add(step);
        let (sin, cos) = sin_cos(phase);
        let (d, s) = (drive as f64 * code_unit, sense as f64 * code_unit);
        let (sin, cos) = (amplitude * sin, amplitude * cos);
        products.push([d * sin, d * cos, s * sin, s * cos]);
        if !(n + 1).is_multiple_of(design.ratio as usize) {
            continue;
        }
        let mut channels = [0.0f64; 4];
        for (tap, product) in taps.iter().zip(products.iter().rev()) {
            for (channel, value) in channels.iter_mut().zip(product) {
                *channel += tap * value;
            }
        }
        for (channel, share) in channels.iter_mut().zip(disturbance) {
            *channel += share * scale;
        }
        let angle = wrap_turns(channels[1].atan2(channels[0]) / TAU);
        let magnitude = channels[0].hypot(channels[1]);
        let rate = design.compensation.as_ref().map(|compensation| {
            let p = variable(design, compensation.input, angle, step.wrapping_sub(given));
            rate(compensation, p, channels[2])
        });
        let tuning_word = design.phase_loop.as_ref().map(|control| {
            let setpoint = control.setpoint_raw as f64 / angle_unit;
            let e = wrap_turns(angle - setpoint) * angle_unit;
            loop_integrator += e;
            let proportional = control.proportional.raw as f64
                * e
                * 2f64.powi(-(control.proportional.shift as i32));
            let integral = control.integral.raw as f64
                * loop_integrator
                * 2f64.powi(-(control.integral.shift as i32));
            step = given
                .wrapping_add(turn_of(proportional * word_unit))
                .wrapping_add(turn_of(integral * word_unit));
            step as f64 * 2f64.powi(-128) * design.sample_rate_hz
        });
        let gain = design.amplitude_loop.as_ref().map(|control| {
            let raw_unit = 2f64.powi(design.output.format.n as i32);
            let ea = control.setpoint_raw as f64 - magnitude * raw_unit;
            amplitude_integrator =
                (amplitude_integrator + ea).clamp(0.0, control.greatest_integrator() as f64);
            let sum = ea * 2f64.powi(-(control.error_shift as i32))
                + amplitude_integrator * 2f64.powi(-(control.integrator_shift as i32));
            sum.clamp(0.0, control.greatest_gain() as f64) * 2f64.powi(1 - control.gain_bits as i32)
        });
        rows.push(FloatRow {
            channels,
            phase: angle,
            magnitude,
            rate,
            tuning_word,
            gain,
        });
    }
    rows
}

/// How a column is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Greatest accepted difference.
    pub tolerance: f64,
    /// The values are equal modulo this.
    pub period: Option<f64>,
}

impl Scale {
    /// Distance between two values of the column.
    pub fn distance(&self, a: f64, b: f64) -> f64 {
        let plain = (a - b).abs();
        match self.period {
            Some(period) => {
                let rest = plain.rem_euclid(period);
                rest.min(period - rest)
            }
            None => plain,
        }
    }
}

/// The rule of each column, 1e-7 of its full scale.
///
/// The full scale of drive, sense and magnitude is that of the decimator's
/// output format, that of rate is its own output format; no cast limits the
/// values here, so where a value exceeds the format it is itself the scale. The
/// terms of rate (sense I in deg/s, the coefficients) count too: the rate may be
/// their small difference.
pub fn scales(design: &Design, rows: &[FloatRow]) -> Vec<Scale> {
    let relative = 1e-7;
    let largest = |pick: fn(&FloatRow) -> f64| {
        rows.iter()
            .map(|row| pick(row).abs())
            .fold(0.0f64, f64::max)
    };
    let plain = |full_scale: f64| Scale {
        tolerance: relative * full_scale,
        period: None,
    };
    let circular = |period: f64| Scale {
        tolerance: relative * period,
        period: Some(period),
    };
    let format = design.output.format.full_scale();
    let channel = |seen: f64| plain(format.max(seen));
    let mut list = vec![
        plain(0.0),
        channel(largest(|row| row.channels[0])),
        channel(largest(|row| row.channels[1])),
        channel(largest(|row| row.channels[2])),
        channel(largest(|row| row.channels[3])),
        // Half a turn is the full scale of phase.
        Scale {
            tolerance: relative * 0.5,
            period: Some(1.0),
        },
        channel(largest(|row| row.magnitude)),
    ];
    if let Some(compensation) = &design.compensation {
        let unit = 2f64.powi(-(compensation.coefficient_format.n as i32));
        // The variable's greatest value: one half turn, or the tuning word's range and offset.
        let reach: f64 = match compensation.input {
            Thermometer::Phase => 1.0,
            Thermometer::TuningWord {
                offset_raw,
                scale_bits,
            } => {
                let half = 2f64.powi(design.nco.phase_bits as i32 - 1);
                (half + (offset_raw as f64).abs()) * 2f64.powi(-(scale_bits as i32))
            }
        };
        let mut coefficients = 0.0;
        for (&c, order) in compensation.coefficients_raw.iter().zip(0..) {
            coefficients += (c as f64 * unit).abs() * reach.powi(order);
        }
        let sense = largest(|row| row.channels[2]) * 2f64.powi(compensation.rate_full_scale_log2);
        let terms = coefficients.max(sense);
        list.push(plain(compensation.output.format.full_scale().max(terms)));
    }
    if design.phase_loop.is_some() {
        list.push(circular(design.sample_rate_hz));
    }
    if design.amplitude_loop.is_some() {
        list.push(plain(1.0));
    }
    list
}
