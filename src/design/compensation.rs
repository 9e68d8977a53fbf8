//! `[compensation]` as the program sees it: the polynomial, its variable and its calibrated range.

use super::circuit::Circuit;
use super::target::Target;
use crate::approx::form::Codes;
use crate::approx::form::stored::Stored;
use crate::numeric::format::{Format, Quantizer, pow2};
use crate::numeric::trace::ir::Interval;

/// `[compensation]`: a polynomial in the virtual thermometer, subtracted from the rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Compensation {
    /// What the polynomial is evaluated in.
    pub input: CompensationInput,
    /// Lowest order first, 1 to 16, each within `coefficient_format`.
    pub coefficients_raw: Vec<i128>,
    /// Format of the coefficients; at most the accumulator's fraction bits.
    pub coefficient_format: Format,
    /// The cast after each multiplication and after each addition.
    pub accumulator: Quantizer,
    /// A power of two: rate input in deg/s = value * this.
    pub rate_full_scale_dps: f64,
    /// Format of bias and rate, deg/s.
    pub output: Quantizer,
    /// `clamp_raw = [low, high]`: the input is limited to the calibrated range; absent = not.
    pub clamp_raw: Option<(i128, i128)>,
    /// What the firmware does with an input outside `clamp_raw`.
    pub outside: Outside,
    /// The fit that the coefficients stand for, where there is one.
    pub fitted: Option<Fitted>,
    /// `[compensation.evaluation]`: the form that stands for the polynomial; none = Horner's rule.
    pub form: Option<Stored>,
}

/// `outside`: the polynomial beyond the calibrated range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Outside {
    /// The bias of the nearer end.
    #[default]
    Clamp,
    /// The tangent of the nearer end goes on.
    HoldSlope,
    /// The bias of the nearer end, and a word that says that the input was outside.
    Flag,
}

impl Outside {
    /// As a design file spells it.
    pub fn name(self) -> &'static str {
        match self {
            Outside::Clamp => "clamp",
            Outside::HoldSlope => "hold_slope",
            Outside::Flag => "flag",
        }
    }
}

/// `[compensation.fitted]`: a fit before its coefficients were put into their format; what the firmware's error
/// budget is counted from.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// In the firmware's variable, lowest order first, deg/s; as many as `coefficients_raw`.
    pub coefficients_dps: Vec<f64>,
    /// Largest standard deviation of the fitted bias over the calibrated range, deg/s.
    pub std_max_dps: f64,
    /// What the polynomial leaves of data that it has not seen, rms, deg/s.
    pub heldout_rms_dps: f64,
    /// `loop_rms_dps`: by how much heating and cooling differ at the same reading, rms, deg/s, where that is more than
    /// noise.
    pub loop_rms_dps: Option<f64>,
}

impl CompensationInput {
    /// True if the chain has the thermometer, so that its rows have a compensated rate.
    pub fn is_of_chain(&self) -> bool {
        !matches!(self, CompensationInput::Channel(_))
    }
}

impl Compensation {
    /// The calibrated range where the firmware says whether an input is inside (`outside = "flag"`).
    pub fn flagged_range(&self) -> Option<(i128, i128)> {
        self.clamp_raw.filter(|_| self.outside == Outside::Flag)
    }

    /// log2 of `rate_full_scale_dps`, which is a power of two.
    pub fn rate_full_scale_exponent(&self) -> i32 {
        self.rate_full_scale_dps.log2().round() as i32
    }

    /// The polynomial's variable at an input word: p = (raw - offset) * 2^-fraction_bits.
    pub fn variable_scale(&self, circuit: &Circuit) -> (i128, i32) {
        match &self.input {
            CompensationInput::Phase => (0, circuit.cordic.angle_bits as i32 - 1),
            CompensationInput::TuningWord(t) => (t.offset_raw, t.scale_bits as i32),
            CompensationInput::Channel(c) => (c.offset_raw, c.scale_bits as i32),
        }
    }

    /// The words of the polynomial's variable inside the calibrated range (every word, where there is none).
    pub fn codes(&self, circuit: &Circuit) -> Codes {
        let (offset, fraction_bits) = self.variable_scale(circuit);
        let all = match &self.input {
            CompensationInput::Phase => Interval::of_bits(circuit.cordic.angle_bits),
            CompensationInput::TuningWord(_) => Interval::of_bits(circuit.nco.phase_bits),
            CompensationInput::Channel(channel) => {
                Interval::new(channel.format.min_raw(), channel.format.max_raw())
            }
        };
        let (low, high) = self.clamp_raw.unwrap_or((all.low, all.high));
        let range = Interval::new(low - offset, high - offset);
        let fraction_bits = fraction_bits.max(0) as u32;
        let integer_bits = range.bits().saturating_sub(fraction_bits).max(1);
        Codes {
            format: Format::q(integer_bits, fraction_bits),
            low: range.low,
            high: range.high,
        }
    }

    /// The polynomial's slope at an input word, rounded to the coefficients' format (which may not hold it):
    /// sum of k c_k p^(k-1).
    pub fn slope_raw(&self, circuit: &Circuit, word: i128) -> i128 {
        let (offset, fraction_bits) = self.variable_scale(circuit);
        let p = (word - offset) as f64 * pow2(-fraction_bits);
        let orders = self.coefficients_raw.iter().enumerate().skip(1).rev();
        let slope = orders.fold(0.0, |t, (k, c)| t * p + k as f64 * *c as f64);
        (slope + 0.5).floor() as i128
    }
}

/// What the compensation's fixed-point error is asked to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasBound {
    /// The most that bias and rate may be from the fitted polynomial, at every calibrated input code, deg/s.
    pub bound_dps: f64,
    /// `form = "auto"`: the cheapest form that keeps to it; otherwise the polynomial by Horner's rule.
    pub auto: bool,
    /// The processor that "cheapest" is meant for.
    pub target: Target,
}

/// The polynomial's variable.
#[derive(Debug, Clone, PartialEq)]
pub enum CompensationInput {
    /// `input = "phase"`: the CORDIC's phase as half turns in [-1, 1); the rate input is sense I.
    Phase,
    /// `input = "tuning_word"`: what the phase loop adds to the tuning word, in its steps; the rate input
    /// is sense I. p = (steps - offset_raw) * 2^-scale_bits.
    TuningWord(TuningInput),
    /// `input = "die_degc"` (or another column of a thermal record that firmware can see):
    /// p = (raw - offset_raw) * 2^-scale_bits; the rate input is a word of its own, in deg/s.
    Channel(ChannelInput),
}

/// The drive's frequency as thermometer: the resonance that a phase loop tracks.
#[derive(Debug, Clone, PartialEq)]
pub struct TuningInput {
    /// `input_offset_raw`: the polynomial's zero, tuning word steps, default 0.
    pub offset_raw: i128,
    /// `input_scale_bits`: 0..=64, default `phase_bits` - 1.
    pub scale_bits: u32,
}

/// A thermometer that is not the chain's own.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelInput {
    /// The record's column: `die_degc`, `freq_hz`, `phase_rad`, `chamber_degc`.
    pub column: String,
    /// `input_format`: the word that firmware reads, in the column's unit.
    pub format: Format,
    /// `input_offset_raw`: the centre of the calibrated range, default 0.
    pub offset_raw: i128,
    /// `input_scale_bits`: p = (raw - offset) * 2^-scale_bits, default bits - 1; 0..=64.
    pub scale_bits: u32,
    /// `rate_input_format`: the uncompensated rate that firmware reads; its value times
    /// `rate_full_scale_dps` is in deg/s.
    pub rate_format: Format,
}
