//! `[circuit]` as the program sees it: the words and constants of each block.

use crate::numeric::format::{Format, Quantizer, Rounding};

/// `[circuit]`: the digital detection circuit.
#[derive(Debug, Clone, PartialEq)]
pub struct Circuit {
    /// ADC sample rate, both channels, Hz.
    pub sample_rate_hz: f64,
    /// `[circuit.adc]`.
    pub adc: Adc,
    /// `[circuit.nco]`.
    pub nco: Nco,
    /// `[circuit.demodulator]`.
    pub demodulator: Demodulator,
    /// `[circuit.decimator]`.
    pub decimator: Decimator,
    /// `[circuit.cordic]`.
    pub cordic: Cordic,
    /// `[circuit.phase_loop]`; absent = the tuning word is fixed.
    pub phase_loop: Option<PhaseLoop>,
    /// `[circuit.amplitude_loop]`.
    pub amplitude_loop: Option<AmplitudeLoop>,
}

/// `[circuit.adc]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Adc {
    /// Format of a captured code; signed, 2..=32 bits.
    pub format: Format,
}

/// `[circuit.nco]`: the numerically controlled oscillator.
#[derive(Debug, Clone, PartialEq)]
pub struct Nco {
    /// w: accumulator width, 8..=64 bits, wraps.
    pub phase_bits: u32,
    /// FCW as given: 0 ..= min(2^w, 2^63) - 1, or negative (modulo 2^w).
    pub tuning_word: i64,
    /// a: 2..=16, at most w.
    pub table_address_bits: u32,
    /// `floor`, or `half_up`: half an address step is added before truncating.
    pub address_rounding: Rounding,
    /// Format of a table entry; signed, 2..=40 bits.
    pub table: Format,
}

/// `[circuit.demodulator]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Demodulator {
    /// The cast of code * table entry.
    pub product: Quantizer,
}

/// `[circuit.decimator]`: a CIC with N stages, ratio R, differential delay M.
#[derive(Debug, Clone, PartialEq)]
pub struct Decimator {
    /// N: 1..=6.
    pub stages: u32,
    /// R: 2..=4096.
    pub ratio: u32,
    /// M: 1 or 2.
    pub differential_delay: u32,
    /// The cast of S * 2^-G.
    pub output: Quantizer,
}

impl Decimator {
    /// G: the least integer with 2^G >= (R M)^N; the decimator divides by 2^G.
    pub fn gain_bits(&self) -> u32 {
        // (4096 * 2)^6 = 2^78 fits.
        let gain = u128::from(self.ratio * self.differential_delay).pow(self.stages);
        128 - (gain - 1).leading_zeros()
    }
}

/// `[circuit.cordic]`: vectoring on (drive I, drive Q).
#[derive(Debug, Clone, PartialEq)]
pub struct Cordic {
    /// n: 4..=30.
    pub iterations: u32,
    /// g: 0..=32.
    pub guard_bits: u32,
    /// Width of x and y, wraps, 4..=64.
    pub width: u32,
    /// b: z counts 2^-b turns, wraps, 4..=64.
    pub angle_bits: u32,
    /// 1..=62: fraction bits of the magnitude constant.
    pub gain_bits: u32,
}

/// A loop gain: raw * 2^-shift, the shift a floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LoopGain {
    /// The integer factor.
    pub raw: i64,
    /// 0..=63.
    pub shift: u32,
}

/// `[circuit.phase_loop]`: PI on the drive phase, acting on the tuning word.
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseLoop {
    /// In phase units, 2^-b turn.
    pub setpoint_raw: i64,
    /// kp.
    pub proportional: LoopGain,
    /// ki.
    pub integral: LoopGain,
    /// Width of the integrator, wraps, 2..=64.
    pub integrator_bits: u32,
}

/// `[circuit.amplitude_loop]`: PI on the drive magnitude, acting on the drive gain.
#[derive(Debug, Clone, PartialEq)]
pub struct AmplitudeLoop {
    /// In magnitude LSB.
    pub setpoint_raw: i64,
    /// 0..=63.
    pub error_shift: u32,
    /// 0..=63.
    pub integrator_shift: u32,
    /// Of the integrator, within its limits.
    pub initial_raw: i64,
    /// 2..=32: the gain is limited to 0 ..= 2^(gain_bits-1)-1.
    pub gain_bits: u32,
}

impl AmplitudeLoop {
    /// The largest gain, 2^(gain_bits-1)-1.
    pub fn gain_limit(&self) -> i128 {
        (1i128 << (self.gain_bits - 1)) - 1
    }

    /// The largest integrator, `gain_limit << integrator_shift`.
    pub fn integrator_limit(&self) -> i128 {
        self.gain_limit() << self.integrator_shift
    }
}
