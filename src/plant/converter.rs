//! An ADC and what is before it: from the pick-off's ideal value to the code.
//!
//! The order is that of the hardware: the front end's harmonics and its limit, then the ADC's gain,
//! offset, bend and missing codes. Both channels have the same converter; only the sense channel has
//! the drive's feedthrough and the later sample. Plausible ranges are general knowledge ("k").

use crate::design::Effects;
use crate::numeric::turn;

/// Which pick-off is converted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// The drive motion.
    Drive,
    /// The sense motion.
    Sense,
}

/// A channel's converter with the effects that it has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    channel: Channel,
    /// 2^(bits-1), LSB.
    full_scale_lsb: f64,
    /// Nearest code, ties up, saturating.
    quantiser: Quantiser,
    /// `None`: [`Converter::analog`] is the identity.
    bend: Option<Bend>,
    /// `adc_missing_codes`: spacing and residue of the codes that never appear.
    missing: Option<(i64, i64)>,
    /// `mains_pickup`: LSB, Hz.
    mains: Option<[f64; 2]>,
    jitter_rms_s: f64,
    latency_samples: f64,
    feedthrough: Option<[f64; 2]>,
}

/// The static characteristic, of x = input / full scale.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bend {
    /// `harmonic_distortion`.
    harmonics: [f64; 2],
    /// `adc_clipping`, of full scale; infinite if off.
    limit: f64,
    /// 1 + `adc_gain_error`.
    gain: f64,
    offset_lsb: f64,
    /// `adc_integral_nonlinearity`: cubic and quadratic bend at full scale, LSB.
    bend_lsb: [f64; 2],
}

impl Converter {
    /// The converter of a channel with codes of `adc_bits` bits, 2 ..= 32.
    pub fn new(effects: &Effects, channel: Channel, adc_bits: u32) -> Self {
        let sense_only = |value: Option<[f64; 2]>| match channel {
            Channel::Drive => None,
            Channel::Sense => value,
        };
        let latency = effects.get("sample_latency").map_or(0.0, |[n]| n);
        Converter {
            channel,
            full_scale_lsb: f64::powi(2.0, adc_bits as i32 - 1),
            quantiser: Quantiser::new(adc_bits),
            bend: Bend::new(effects),
            // Both are whole numbers of at most 32 bits, as the design is checked.
            missing: effects
                .get("adc_missing_codes")
                .map(|[n, k]| (n as i64, (k as i64).rem_euclid((n as i64).max(1)))),
            mains: effects.get("mains_pickup"),
            jitter_rms_s: effects.get("aperture_jitter").map_or(0.0, |[rms_s]| rms_s),
            latency_samples: match channel {
                Channel::Drive => 0.0,
                Channel::Sense => latency,
            },
            feedthrough: sense_only(effects.get("drive_feedthrough")),
        }
    }

    /// The channel.
    pub fn channel(&self) -> Channel {
        self.channel
    }

    /// What the quantiser sees of an ideal input, both in LSB; without effects the input itself, bit
    /// for bit. With the full scale F and x = input / F:
    ///
    /// 1. `harmonic_distortion`: x + 2 h2 x^2 + 4 h3 x^3. A full-scale sine so has second and third
    ///    harmonics of the relative amplitudes h2 and h3 (and 3 h3 more of its own); they fall with its first and second power.
    ///    1e-5 to 1e-2.
    /// 2. `adc_clipping`: limited to +-fraction. 0.3 to 1.
    /// 3. `adc_gain_error`, `adc_offset`: F (1 + g) x + offset. 1e-4 to 2e-2; 1 to 100 LSB.
    /// 4. `adc_integral_nonlinearity`: + i3 x^3 + i2 x^2, in LSB, zero at 0 (IEEE Std 1241, but for its
    ///    end-point line). 0.5 to 8 LSB.
    #[inline(always)]
    pub fn analog(&self, input_lsb: f64) -> f64 {
        match &self.bend {
            None => input_lsb,
            Some(bend) => bend.of(input_lsb, self.full_scale_lsb),
        }
    }

    /// The code of the quantiser's input in LSB: nearest, ties toward plus infinity, saturating.
    ///
    /// `adc_missing_codes`: of the codes that are `first` modulo `spacing` none appears; their inputs
    /// go to the code below (IEEE Std 1241: differential nonlinearity of -1 LSB), those of the lowest code of
    /// all to the one above.
    #[inline(always)]
    pub fn code(&self, lsb: f64) -> i32 {
        let code = self.quantiser.code(lsb);
        match self.missing {
            Some((spacing, residue)) if i64::from(code).rem_euclid(spacing) == residue => {
                if f64::from(code) > self.quantiser.low {
                    code - 1
                } else {
                    code + 1
                }
            }
            _ => code,
        }
    }

    /// [`analog`](Self::analog) of inputs with noise of an rms added first, LSB; `noise` is of rms 1.
    pub fn front_end(&self, inputs: &mut [f64], rms_lsb: f64, noise: &[f32]) {
        pulp::Arch::new().dispatch(FrontEnd {
            converter: self,
            inputs,
            noisy: Noisy { rms_lsb, noise },
        });
    }

    /// The [`code`](Self::code)s of the same, as many as there are inputs.
    pub fn codes(&self, inputs: &[f64], rms_lsb: f64, noise: &[f32], codes: &mut [i32]) {
        pulp::Arch::new().dispatch(Codes {
            converter: self,
            inputs,
            noisy: Noisy { rms_lsb, noise },
            codes,
        });
    }

    /// What is added to the ideal input at a time, LSB: `mains_pickup`, a sin(2 pi f t). 0.1 to
    /// 100 LSB, 50 or 60 Hz.
    pub fn additive_lsb(&self, time_s: f64) -> f64 {
        match self.mains {
            Some([lsb, frequency_hz]) => {
                let turns = (frequency_hz * time_s).fract();
                lsb * turn::sin_cos(turn::phase_of_rad(std::f64::consts::TAU * turns)).0
            }
            None => 0.0,
        }
    }

    /// `aperture_jitter`: the standard deviation of the sampling instant, s; 1e-10 to 1e-6.
    pub fn aperture_jitter_rms_s(&self) -> f64 {
        self.jitter_rms_s
    }

    /// `sample_latency`: by how many samples this channel is sampled later than the drive channel;
    /// 0 for the drive channel. 0 to 1.
    pub fn latency_samples(&self) -> f64 {
        self.latency_samples
    }

    /// `drive_feedthrough`, sense channel only: amplitude at nominal drive gain, deg/s, and phase to
    /// the rate's carrier, rad. 0.1 to 100 deg/s.
    pub fn drive_feedthrough(&self) -> Option<[f64; 2]> {
        self.feedthrough
    }
}

impl Bend {
    /// `None` if no effect bends the characteristic.
    fn new(effects: &Effects) -> Option<Self> {
        let harmonics: Option<[f64; 2]> = effects.get("harmonic_distortion");
        let limit: Option<[f64; 1]> = effects.get("adc_clipping");
        let gain: Option<[f64; 1]> = effects.get("adc_gain_error");
        let offset: Option<[f64; 1]> = effects.get("adc_offset");
        let bend: Option<[f64; 2]> = effects.get("adc_integral_nonlinearity");
        let any = harmonics.is_some()
            || limit.is_some()
            || gain.is_some()
            || offset.is_some()
            || bend.is_some();
        any.then(|| Bend {
            harmonics: harmonics.unwrap_or_default(),
            limit: limit.map_or(f64::INFINITY, |[fraction]| fraction),
            gain: 1.0 + gain.map_or(0.0, |[relative]| relative),
            offset_lsb: offset.map_or(0.0, |[lsb]| lsb),
            bend_lsb: bend.unwrap_or_default(),
        })
    }

    #[inline(always)]
    fn of(&self, input_lsb: f64, full_scale_lsb: f64) -> f64 {
        let [second, third] = self.harmonics;
        let x = input_lsb / full_scale_lsb;
        let x = x + x * x * (2.0 * second + 4.0 * third * x);
        let x = x.max(-self.limit).min(self.limit);
        let x = self.gain * x + self.offset_lsb / full_scale_lsb;
        let [cubic, quadratic] = self.bend_lsb;
        full_scale_lsb * x + x * x * (quadratic + cubic * x)
    }
}

/// Noise of an rms, LSB, by noise of rms 1.
#[derive(Clone, Copy)]
struct Noisy<'a> {
    rms_lsb: f64,
    noise: &'a [f32],
}

/// Inputs with their noise through the front end, in the widest SIMD that the processor has; the same values with each.
struct FrontEnd<'a> {
    converter: &'a Converter,
    inputs: &'a mut [f64],
    noisy: Noisy<'a>,
}

impl pulp::WithSimd for FrontEnd<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let Noisy { rms_lsb, noise } = self.noisy;
        if rms_lsb != 0.0 {
            for (input, noise) in self.inputs.iter_mut().zip(noise) {
                *input += rms_lsb * f64::from(*noise);
            }
        }
        if let Some(bend) = &self.converter.bend {
            for input in self.inputs {
                *input = bend.of(*input, self.converter.full_scale_lsb);
            }
        }
    }
}

/// Codes of inputs, as [`FrontEnd`].
struct Codes<'a> {
    converter: &'a Converter,
    inputs: &'a [f64],
    noisy: Noisy<'a>,
    codes: &'a mut [i32],
}

impl pulp::WithSimd for Codes<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let (adc, Noisy { rms_lsb, noise }) = (self.converter, self.noisy);
        let all = self.codes.iter_mut().zip(self.inputs.iter().zip(noise));
        if adc.bend.is_none() && adc.missing.is_none() {
            for (code, (input, noise)) in all {
                *code = adc.quantiser.code(input + rms_lsb * f64::from(*noise));
            }
            return;
        }
        for (code, (input, noise)) in all {
            *code = adc.code(adc.analog(input + rms_lsb * f64::from(*noise)));
        }
    }
}

/// An ideal ADC: nearest, ties toward plus infinity, saturating.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Quantiser {
    low: f64,
    high: f64,
}

impl Quantiser {
    fn new(bits: u32) -> Self {
        let full_scale = f64::powi(2.0, bits as i32 - 1);
        Quantiser {
            low: -full_scale,
            high: full_scale - 1.0,
        }
    }

    /// The code of an input in LSB. The limits are integers, so limiting first changes nothing.
    ///
    /// A sum with 1.5 * 2^52 has the nearest integer, ties to even, in its low bits. A conversion to an integer, which saturates,
    /// would be compiled for one lane at a time.
    #[inline(always)]
    fn code(&self, lsb: f64) -> i32 {
        const INTEGERS: f64 = 6_755_399_441_055_744.0;
        let limited = lsb.max(self.low).min(self.high);
        let sum = limited + INTEGERS;
        // Exact: at most 52 bits are left. It is a half where a tie went down.
        let rest = limited - (sum - INTEGERS);
        (sum.to_bits() as i32).wrapping_add(i32::from(rest >= 0.5))
    }
}

#[cfg(test)]
#[path = "converter_tests.rs"]
mod tests;
