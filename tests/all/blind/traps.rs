//! Experiments that cannot separate causes, and experiments that do not show them.

use super::catalogue::protocol;
use super::chamber::Chamber;
use super::programs::{AccelProgram, Inner, RateProgram, SupplyProgram};
use super::world::Protocol;
use crate::rng::Rng;

/// An id and an experiment in which something else looks the same.
pub fn confounded(rng: &mut Rng) -> (&'static str, Protocol) {
    let mut p = protocol(&[], rng);
    let id = match rng.range(0, 6) {
        0 | 1 => {
            // Temperature and time rise together.
            p.chamber = rng.pick(&[Chamber::HeatOnly, Chamber::HeatOnly, Chamber::CoolOnly]);
            p.power_cycles = 1;
            rng.pick(&[
                "thermal_lag",
                "temperature_rate",
                "warmup_transient",
                "ageing_drift",
                "bias_third_order",
            ])
        }
        2 => {
            // Rest and one rate: any law of the rate is one number.
            p.rate = RateProgram::TwoLevels;
            rng.pick(&["scale_factor_nonlinearity", "scale_factor_asymmetry"])
        }
        3 => {
            p.accel = AccelProgram::TwoLevels;
            rng.pick(&["g_sensitivity", "g_squared_sensitivity"])
        }
        4 => {
            // The gain is a function of temperature alone.
            p.damping = Inner::OfTemperature;
            p.amplitude = Inner::Constant;
            rng.pick(&["damping_bias", "bias_third_order"])
        }
        5 => {
            p.supply = SupplyProgram::Decline;
            rng.pick(&["supply_sensitivity", "ageing_drift"])
        }
        _ => {
            p.quadrature = Inner::OfTemperature;
            rng.pick(&[
                "demod_phase_drift",
                "quadrature_leakage",
                "bias_third_order",
            ])
        }
    };
    (id, p)
}

/// An id and an experiment in which nothing of it can be seen.
pub fn unexcited(rng: &mut Rng) -> (&'static str, Protocol) {
    let mut p = protocol(&[], rng);
    let id = rng.pick(&[
        "scale_factor_temperature",
        "scale_factor_nonlinearity",
        "scale_factor_asymmetry",
        "output_deadband",
        "supply_sensitivity",
        "g_sensitivity",
        "g_squared_sensitivity",
        "quadrature_leakage",
        "demod_phase_drift",
        "damping_bias",
    ]);
    match id {
        "supply_sensitivity" => p.supply = SupplyProgram::Constant,
        "g_sensitivity" | "g_squared_sensitivity" => p.accel = AccelProgram::Level,
        "quadrature_leakage" | "demod_phase_drift" => p.quadrature = Inner::Constant,
        "damping_bias" => (p.damping, p.amplitude) = (Inner::Constant, Inner::Constant),
        _ => p.rate = RateProgram::Rest,
    }
    (id, p)
}
