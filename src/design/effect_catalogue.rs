//! Every effect that the simulated gyro can be given, by name, with its parameters.
//!
//! The equations are stated where they are computed: [`crate::plant::effects`] (structure, bias and
//! rate) and [`crate::plant::converter`] (the ADCs).

use super::table::Real::{self, Any, Celsius, NotNegative, Positive, Whole, Within};

/// A kind of effect: what `[gyro.effects.ID]` can be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectKind {
    /// The effect's name, the same in designs, records and reports.
    pub id: &'static str,
    /// What it is, in one line.
    pub what: &'static str,
    /// Its parameters, in the order in which [`super::Effects`] holds their values.
    pub parameters: &'static [Parameter],
}

/// A parameter of an effect: a real number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// The key in the effect's table; its ending is the unit.
    pub key: &'static str,
    /// The numbers that it takes.
    pub accepted: Real,
    /// What it is, with its unit.
    pub meaning: &'static str,
    /// Its value if it is left out; without one it is required.
    pub default: Option<f64>,
    /// A plausible value, as TOML.
    pub example: &'static str,
}

/// A parameter that has to be given.
const fn need(
    key: &'static str,
    accepted: Real,
    example: &'static str,
    meaning: &'static str,
) -> Parameter {
    Parameter {
        key,
        accepted,
        meaning,
        default: None,
        example,
    }
}

/// A parameter that may be left out.
const fn may(
    key: &'static str,
    accepted: Real,
    default: f64,
    example: &'static str,
    meaning: &'static str,
) -> Parameter {
    Parameter {
        default: Some(default),
        ..need(key, accepted, example, meaning)
    }
}

const fn kind(
    id: &'static str,
    what: &'static str,
    parameters: &'static [Parameter],
) -> EffectKind {
    EffectKind {
        id,
        what,
        parameters,
    }
}

/// A relative change that leaves the sign of what it changes.
const RELATIVE: Real = Within(-0.99, 0.99);

/// Every effect; those of thermal records before those of captures.
#[rustfmt::skip]
pub const CATALOGUE: &[EffectKind] = &[
    // Temperature and structure.
    kind("thermal_lag", "part of the bias follows a temperature that lags the structure's", &[
        need("dps_per_k", Any, "0.8", "the bias in deg/s per K of lag"),
        need("tau_s", Positive, "240.0", "the lag's time constant in s"),
    ]),
    kind("temperature_rate", "bias proportional to the structure's rate of temperature", &[
        need("dps_s_per_k", Any, "60.0", "the bias in deg/s per K/s"),
    ]),
    kind("warmup_transient", "exponential in the time since power-on", &[
        need("amplitude_dps", Any, "1.5", "the bias at power-on in deg/s"),
        need("tau_s", Positive, "400.0", "its time constant in s"),
    ]),
    kind("ageing_drift", "logarithmic in time; linear as long as the time constant is long", &[
        need("amplitude_dps", Any, "0.2", "the bias in deg/s per e-fold"),
        need("time_constant_s", Positive, "7200.0", "when the linear rise bends, s"),
    ]),
    kind("bias_third_order", "third-order term of the bias in the measured drive phase", &[
        need("dps_per_rad3", Any, "100.0", "deg/s/rad^3"),
        may("center_rad", Any, -1.8, "-1.8", "the phase where it is zero, rad"),
    ]),
    kind("mode_crossing", "a parasitic mode crosses the drive in temperature: a bump of resonance shape in the bias", &[
        need("amplitude_dps", Any, "4.5", "the bump's height in deg/s"),
        need("center_degc", Celsius, "37.5", "the crossing's temperature in degC"),
        need("half_width_k", Positive, "3.7", "the distance from the centre to each extreme in K"),
    ]),
    kind("stress_jump", "the bias steps where the structure passes a temperature", &[
        need("height_dps", Any, "1.0", "the step when warming in deg/s"),
        need("temperature_degc", Celsius, "45.0", "where it steps, degC"),
        may("hysteresis_k", NotNegative, 0.0, "6.0", "K between the steps of warming and cooling"),
    ]),
    kind("damping_bias", "bias through anisotropic damping, follows 1/Q; a Q that changes also bends the phase", &[
        need("dps", Any, "10.0", "the bias in deg/s where 1/Q has doubled"),
        need("q_exponent", Within(-10.0, 10.0), "0.7", "gamma of Q = Q0 (T/T0)^-gamma"),
    ]),
    kind("stiffness_second_order", "the stiffness has a second-order term in temperature", &[
        need("per_k2", Within(-1e-5, 1e-5), "5.0e-8", "the stiffness's relative fall in 1/K^2"),
    ]),
    kind("amplitude_phase_coupling", "the measured phase is pulled by the drive amplitude (Duffing)", &[
        need("rad", Any, "0.02", "the phase in rad per 1 of relative drive gain"),
    ]),
    // Demodulation.
    kind("quadrature_leakage", "a constant demodulation phase error times the quadrature", &[
        need("phase_rad", Within(-1.6, 1.6), "0.01", "the demodulation phase error in rad"),
    ]),
    kind("demod_phase_drift", "a demodulation phase error that drifts with the electronics' temperature, times the quadrature", &[
        need("rad_per_k", Any, "2.0e-4", "the demodulation phase error in rad/K"),
        need("reference_degc", Celsius, "25.0", "where it is zero, degC"),
    ]),
    // Rate.
    kind("scale_factor_temperature", "scale factor linear in temperature", &[
        need("relative_per_k", Within(-0.1, 0.1), "6.0e-4", "the scale factor's relative rise in 1/K"),
        need("reference_degc", Celsius, "25.0", "where the scale factor is nominal, degC"),
    ]),
    kind("scale_factor_nonlinearity", "odd (cubic) in the rate", &[
        need("relative_at_full_scale", RELATIVE, "1.0e-3", "the deviation at full scale, relative"),
        need("full_scale_dps", Positive, "300.0", "that full scale in deg/s"),
    ]),
    kind("scale_factor_asymmetry", "even in the rate: differs between the turning directions", &[
        need("relative", RELATIVE, "5.0e-4", "deg/s per deg/s of the rate's magnitude"),
    ]),
    kind("output_deadband", "the applied rate reads as zero around zero, before the bias is added", &[
        need("half_width_dps", NotNegative, "0.5", "the largest rate that reads as zero, deg/s"),
    ]),
    kind("output_saturation", "rate plus bias is limited, symmetrically or not", &[
        need("low_dps", Any, "-300.0", "the lower limit in deg/s, below high_dps"),
        need("high_dps", Any, "300.0", "the upper limit in deg/s, above low_dps"),
    ]),
    // Environment.
    kind("supply_sensitivity", "linear in the supply voltage", &[
        need("dps_per_v", Any, "1.0", "the bias in deg/s/V"),
        need("nominal_v", Positive, "5.0", "the supply without bias in V"),
    ]),
    kind("g_sensitivity", "linear in the acceleration along the sensitive axis", &[
        need("dps_per_g", Any, "0.05", "the bias in deg/s/g"),
    ]),
    kind("g_squared_sensitivity", "quadratic in the acceleration (vibration rectification)", &[
        need("dps_per_g2", Any, "5.0e-3", "the bias in deg/s/g^2"),
    ]),
    kind("periodic_pickup", "sinusoid in time: aliased mains or a spur", &[
        need("amplitude_dps", Any, "0.5", "its amplitude in deg/s"),
        need("period_s", Positive, "600.0", "its period in s"),
        may("phase_rad", Any, 0.0, "0.0", "its phase at time 0 in rad"),
    ]),
    // The converters.
    kind("adc_offset", "offset of each ADC", &[
        need("lsb", Any, "20.0", "what is added to the input, LSB"),
    ]),
    kind("adc_gain_error", "gain error of each ADC", &[
        need("relative", RELATIVE, "5.0e-3", "the gain less 1"),
    ]),
    kind("adc_integral_nonlinearity", "smooth bend of each ADC's characteristic", &[
        need("lsb", Any, "4.0", "the cubic bend at full scale in LSB"),
        may("order2_lsb", Any, 0.0, "0.0", "the quadratic bend at full scale in LSB"),
    ]),
    kind("adc_missing_codes", "codes at an even spacing never appear; their inputs go to the code below", &[
        need("spacing", Whole(2.0, 1_048_576.0), "64.0", "codes from one missing code to the next"),
        need("first", Whole(-2_147_483_648.0, 2_147_483_647.0), "5.0", "one of the missing codes"),
    ]),
    kind("adc_clipping", "what is before each ADC limits below the ADC's full scale", &[
        need("fraction", Within(1e-6, 1.0), "0.45", "the limit as a fraction of full scale"),
    ]),
    kind("aperture_jitter", "the instant of sampling is random", &[
        need("rms_s", NotNegative, "1.0e-7", "the standard deviation of the instant in s"),
    ]),
    kind("harmonic_distortion", "second and third harmonic of what is before each ADC", &[
        need("second", Within(-0.1, 0.1), "1.0e-3", "relative amplitude of a full-scale sine's second harmonic"),
        need("third", Within(-0.1, 0.1), "0.0", "relative amplitude of a full-scale sine's third harmonic"),
    ]),
    kind("drive_feedthrough", "the drive voltage couples into the sense channel; it follows the drive gain", &[
        need("dps", Any, "5.0", "its amplitude at nominal drive gain in deg/s"),
        need("phase_rad", Any, "0.3", "its phase to the rate carrier in rad"),
    ]),
    kind("sample_latency", "the sense channel is sampled later than the drive channel", &[
        need("samples", Within(-16.0, 16.0), "0.25", "by this many samples"),
    ]),
    kind("mains_pickup", "mains frequency at the input of each ADC", &[
        need("lsb", Any, "30.0", "its amplitude in LSB"),
        need("frequency_hz", Positive, "50.0", "its frequency in Hz"),
    ]),
    kind("nco_spur", "a spur of the excitation", &[
        need("relative", RELATIVE, "2.0e-3", "its amplitude relative to the excitation's"),
        need("frequency_hz", Positive, "1700.0", "its frequency in Hz"),
    ]),
];
