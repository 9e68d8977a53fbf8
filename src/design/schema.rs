//! The design as the program sees it. The keys of `[circuit]` and `[compensation]` are those of
//! `docs/manual.md`; their meaning is stated there and only summarised here.

pub use super::circuit::{
    Adc, AmplitudeLoop, Circuit, Cordic, Decimator, Demodulator, LoopGain, Nco, PhaseLoop,
};
pub use super::compensation::{
    BiasBound, ChannelInput, Compensation, CompensationInput, Fitted, Outside, TuningInput,
};
use super::correction::Planned;
use super::effects::Effects;
pub use super::log_axis::LogAxis;
pub use super::record_mapping::RecordMapping;
use super::study_tables::{Limits, StudyOptions};
use super::user_effects::UserEffect;
use crate::numeric::format::{Overflow, Quantizer};
use std::path::PathBuf;

/// A design, checked: every value is inside its range and every exact intermediate fits.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// `name`: a C identifier; the prefix of everything that is emitted.
    pub name: String,
    /// The detection circuit.
    pub circuit: Circuit,
    /// The bias compensation; absent = no `rate` column.
    pub compensation: Option<Compensation>,
    /// A correction of averaged readings in its place, the declared bias in it; from `gyrogen close`.
    pub correction: Option<Planned>,
    /// What the compensation's error is asked to be.
    pub bound: Option<BiasBound>,
    /// True if the file gave a `[compensation]` other than the embedded default's (and so chose the formats itself).
    pub compensation_is_own: bool,
    /// The gyro: the declared model and the plant's parameters.
    pub gyro: Gyro,
    /// The thermal run that `run` simulates when no record is given.
    pub thermal_run: ThermalRun,
    /// How a measured record's columns map to roles.
    pub record: RecordMapping,
    /// How the compensation is fitted.
    pub fit: FitOptions,
    /// Which words a word-length study varies.
    pub study: StudyOptions,
    /// What the figures may be.
    pub requirements: Limits,
    /// What the user suspects: candidates of `gyrogen close`.
    pub effects: Vec<UserEffect>,
    /// Where the design came from.
    pub source: Source,
}

impl Design {
    /// The same with `saturate` wherever the design says `error`: a run that no overflow stops.
    pub fn without_stops(&self) -> Self {
        let mut design = self.clone();
        let goes_on = |q: &mut Quantizer| {
            if q.overflow == Overflow::Error {
                q.overflow = Overflow::Saturate;
            }
        };
        goes_on(&mut design.circuit.demodulator.product);
        goes_on(&mut design.circuit.decimator.output);
        if let Some(c) = &mut design.compensation {
            goes_on(&mut c.accumulator);
            goes_on(&mut c.output);
        }
        design
    }
}

/// Where a design came from, for the headers of everything that is made from it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// The file as the user named it; `None` = the embedded default.
    pub path: Option<PathBuf>,
    /// The text as read.
    pub text: String,
    /// SHA-256 of the text, lower-case hexadecimal.
    pub sha256: String,
}

/// `[gyro]`: the resonators and the declared thermal model (seed paper, eq. 1-9).
#[derive(Debug, Clone, PartialEq)]
pub struct Gyro {
    /// Drive resonance at the reference temperature, Hz; also the excitation frequency.
    pub drive_frequency_hz: f64,
    /// Drive quality factor Q1.
    pub drive_q: f64,
    /// Sense resonance at the reference temperature, Hz.
    pub sense_frequency_hz: f64,
    /// Sense quality factor Q2.
    pub sense_q: f64,
    /// T0, K.
    pub reference_temperature_k: f64,
    /// kappa: relative fall of the stiffness, 1/K (eq. 1, 2).
    pub stiffness_tempco_per_k: f64,
    /// How the resonance follows from the stiffness: eq. 4 (default) or eq. 3.
    pub stiffness_law: StiffnessLaw,
    /// How far the sense channel's demodulation is turned away from the rate at T0, rad.
    pub demodulation_error_rad: f64,
    /// `[gyro.bias]`: eq. 9 in the measured drive phase, deg/s, deg/s/rad, deg/s/rad^2.
    pub bias_dps: [f64; 3],
    /// `[gyro.electronics]`: what the electronics add to the measured drive phase.
    pub electronics: ElectronicsPhase,
    /// `[gyro.thermal]`: the two-node thermal network.
    pub thermal: ThermalNetwork,
    /// `[gyro.effects.*]`: what the device does beyond the declared model.
    pub effects: Effects,
}

/// `[gyro.electronics]`: phase = offset + slope * (T - reference).
#[derive(Debug, Clone, PartialEq)]
pub struct ElectronicsPhase {
    /// rad, at the reference temperature.
    pub phase_offset_rad: f64,
    /// rad/K.
    pub phase_slope_rad_per_k: f64,
    /// degC.
    pub reference_temperature_degc: f64,
    /// Share of this phase that a phase loop sees, 0 to 1.
    pub loop_share: f64,
}

/// How the natural frequency follows from the stiffness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StiffnessLaw {
    /// `square_root`, eq. 3: omega_n = omega_n(T0) * sqrt(1 - kappa (T - T0)).
    SquareRoot,
    /// `linear`, eq. 4, the first order of eq. 3: omega_n = omega_n(T0) * (1 - kappa/2 (T - T0)). The
    /// law that the paper's printed figures were made with, and the default.
    #[default]
    Linear,
}

/// `[gyro.thermal]`: structure and electronics, each a heat capacity, both coupled to the chamber
/// and to each other.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalNetwork {
    /// Heat capacity of the structure, J/K.
    pub structure_heat_j_per_k: f64,
    /// Structure to chamber, W/K.
    pub structure_chamber_w_per_k: f64,
    /// Heat capacity of the electronics, J/K.
    pub electronics_heat_j_per_k: f64,
    /// Electronics to chamber, W/K.
    pub electronics_chamber_w_per_k: f64,
    /// Structure to electronics, W/K.
    pub exchange_w_per_k: f64,
    /// Heat of the electronics, W.
    pub power_w: f64,
}

/// `[thermal_run]`: chamber from start to stop and back, with dwells.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalRun {
    /// degC.
    pub start_degc: f64,
    /// degC, above start.
    pub stop_degc: f64,
    /// K between dwells.
    pub step_k: f64,
    /// The chamber's ramp between dwells, K/min.
    pub ramp_k_per_min: f64,
    /// s at each dwell before the readings.
    pub dwell_s: f64,
    /// Readings at each dwell.
    pub readings_per_dwell: u32,
    /// Decimated samples averaged into one reading.
    pub samples_per_reading: u32,
    /// Drive pick-off amplitude, fraction of the ADC's full scale.
    pub drive_amplitude: f64,
    /// Rate that drives the sense ADC to its full scale, deg/s.
    pub sense_full_scale_dps: f64,
    /// Standing quadrature, deg/s.
    pub quadrature_dps: f64,
    /// ADC input noise, LSB rms.
    pub adc_noise_lsb: f64,
    /// White rate noise, one-sided density, deg/s/sqrt(Hz).
    pub rate_noise_dps_rthz: f64,
    /// Bias instability (1/f noise), deg/h.
    pub flicker_dph: f64,
    /// Rate random walk, deg/h/sqrt(h).
    pub rate_random_walk_dph_rth: f64,
    /// Rate of the table, both ways, that the scale factor is measured with, deg/s.
    pub scale_rate_dps: f64,
    /// Seed of all noise.
    pub seed: u64,
}

/// `[fit]`: how the compensation is fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// `order`: an integer 0..=8, "auto" (chosen by held-out error) or "by_record" (the default).
    pub order: FitOrder,
    /// `heldout_blocks`: contiguous blocks of the cross-validation, 2..=50. Default 10.
    pub heldout_blocks: u32,
}

/// The polynomial's order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FitOrder {
    /// As given.
    Fixed(u32),
    /// By held-out error.
    Auto,
    /// 2 (eq. 9) for the design's own thermal run, by held-out error for a measured record.
    ByRecord,
}
