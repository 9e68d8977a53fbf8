//! An effect of a capture in one of its forms, and what is known of the capture beforehand.

use super::columns::{COS, SIN};
use super::gram::Combo;

/// An effect of the contract's list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effect {
    /// A constant is added to the code.
    Offset,
    /// The code is larger than declared by a factor.
    Gain,
    /// The code bends.
    Nonlinearity,
    /// Codes never appear.
    MissingCodes,
    /// The code does not pass a level.
    Clipping,
    /// The sampling instant is random.
    Jitter,
    /// The tone has harmonics.
    Harmonics,
    /// The drive shows in the sense channel.
    Feedthrough,
    /// Samples are taken late.
    Latency,
    /// A line that is neither a harmonic nor a spur of the oscillator.
    Mains,
    /// Lines that the oscillator's phase truncation makes.
    Spur,
}

impl Effect {
    /// All, in the order of the contract.
    pub const ALL: [Effect; 11] = [
        Effect::Offset,
        Effect::Gain,
        Effect::Nonlinearity,
        Effect::MissingCodes,
        Effect::Clipping,
        Effect::Jitter,
        Effect::Harmonics,
        Effect::Feedthrough,
        Effect::Latency,
        Effect::Mains,
        Effect::Spur,
    ];

    /// Id of the contract.
    pub fn id(self) -> &'static str {
        match self {
            Effect::Offset => "adc_offset",
            Effect::Gain => "adc_gain_error",
            Effect::Nonlinearity => "adc_integral_nonlinearity",
            Effect::MissingCodes => "adc_missing_codes",
            Effect::Clipping => "adc_clipping",
            Effect::Jitter => "aperture_jitter",
            Effect::Harmonics => "harmonic_distortion",
            Effect::Feedthrough => "drive_feedthrough",
            Effect::Latency => "sample_latency",
            Effect::Mains => "mains_pickup",
            Effect::Spur => "nco_spur",
        }
    }

    /// Whether firmware can take it away by arithmetic on codes and phase.
    pub fn is_compensable(self) -> bool {
        matches!(
            self,
            Effect::Offset
                | Effect::Gain
                | Effect::Nonlinearity
                | Effect::Feedthrough
                | Effect::Latency
        )
    }

    /// The experiment that tells it from what looks alike.
    pub fn experiment(self) -> &'static str {
        match self {
            Effect::Offset => "short the ADC's input and average the codes",
            Effect::Gain => "apply a known amplitude by a calibrated source in place of the drive",
            Effect::Nonlinearity | Effect::Harmonics => {
                "repeat the capture at half the drive amplitude: harmonics of a bend of order n \
                 fall by 2^n, and the bend stays at its codes"
            }
            Effect::MissingCodes => "apply a slow ramp and look for codes that never appear",
            Effect::Clipping => "repeat the capture at half the drive amplitude",
            Effect::Jitter => "repeat at half the drive frequency: the noise's slope part halves",
            Effect::Feedthrough => {
                "repeat at two rates and with the sense electrodes unbiased: what stays is \
                 feedthrough"
            }
            Effect::Latency => {
                "repeat at another drive frequency: the phase of a latency grows with it"
            }
            Effect::Mains | Effect::Spur => {
                "change the tuning word by one: a spur of the oscillator moves, a pickup stays"
            }
        }
    }
}

/// A way in which an effect can show.
#[derive(Debug, Clone)]
pub struct Variant {
    /// The effect.
    pub effect: Effect,
    /// Its columns.
    pub combos: Vec<Combo>,
    /// What it has to gain in log-likelihood before it counts.
    pub cost: f64,
    /// The part of it by which the variant is less likely than the effect's usual form, or by which it was searched.
    pub further: f64,
}

/// Gain that an effect with no free column would have to make: one in a thousand captures without it.
pub const PRIOR: f64 = 7.0;

/// Gain that each free column costs: the logarithm of how much narrower the rows make its coefficient than what a
/// single one tells (Schwarz 1978).
pub fn per_column(rows: usize) -> f64 {
    (0.5 * (rows.max(1) as f64).ln()).max(2.0)
}

impl Variant {
    /// A variant that is `further` nats less likely than the effect's usual form.
    pub fn new(effect: Effect, combos: Vec<Combo>, further: f64) -> Self {
        Variant {
            effect,
            cost: PRIOR + further,
            combos,
            further,
        }
    }
}

/// What is known of a capture beyond its codes.
#[derive(Debug, Clone)]
pub struct Known {
    /// Sample rate, Hz.
    pub fs_hz: Option<f64>,
    /// The drive's declared amplitude is known.
    pub amplitude: bool,
    /// The tuning word is known, and so the phase.
    pub phase: bool,
    /// Sine and cosine parts of the sense carrier in phase with the rate, and its declared amplitude in codes;
    /// `None` without rate, scale or phase.
    pub in_phase: Option<([f64; 2], f64)>,
    /// 2^(bits-1), codes.
    pub full_scale_codes: f64,
}

impl Known {
    /// The in-phase carrier as a combo of sense columns.
    pub fn carrier(&self, name: &str, unit: f64) -> Option<Combo> {
        self.in_phase
            .map(|([s, c], _)| Combo::new(name, unit, &[(1, SIN, s), (1, COS, c)]))
    }
}

/// Columns that are always in the fit: the free tones, the quantiser's own error.
pub fn base(known: &Known) -> Vec<Combo> {
    use super::columns::{SAW, WAVE, WAVES};
    let mut out = Vec::new();
    if !known.phase {
        out.push(Combo::one("drive_sin", 0, SIN));
    }
    if !known.amplitude {
        out.push(Combo::one("drive_cos", 0, COS));
    }
    match known.in_phase {
        Some(([s, c], _)) => {
            let parts = [(1, SIN, -c), (1, COS, s)];
            out.push(Combo::new("quadrature_codes", 1.0, &parts));
        }
        None => {
            out.push(Combo::one("sense_sin", 1, SIN));
            out.push(Combo::one("sense_cos", 1, COS));
        }
    }
    for channel in 0..2 {
        out.push(Combo::one("saw", channel, SAW));
        out.extend((0..WAVES).map(|k| Combo::one("wave", channel, WAVE + k)));
    }
    out
}

/// One over the prior variances of the base: the quantiser's error is no larger than itself, and must
/// not stand for other effects where few phases make all columns alike.
pub fn base_ridge(base: &[Combo]) -> Vec<f64> {
    use super::columns::WAVE;
    base.iter()
        .map(|c| match (c.name.as_str(), c.parts.as_slice()) {
            ("saw", _) => 1.0,
            // Wave k is 1 / (pi k) at most.
            ("wave", [(_, column, _)]) => 10.0 * ((column - WAVE + 1) as f64).powi(2),
            _ => 0.0,
        })
        .collect()
}
