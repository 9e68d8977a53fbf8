//! The contract's ids with their physics and what an experiment must do to excite them.

use super::chamber::{CYCLING, Chamber};
use super::dice::Dice;
use super::form::Plan;
use super::programs::{AccelProgram, Inner, RateProgram, SupplyProgram};
use super::world::{Protocol, World};
use super::{field_effects, heat_effects, loop_effects, rate_effects};
use crate::rng::Rng;

/// What has to vary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Temperature, up and down.
    Heat,
    /// More than one power-on.
    Cycles,
    Rate,
    Supply,
    Accel,
    /// Q, apart from temperature, with the amplitude held: the gain is 1/Q.
    Damping,
    /// The drive amplitude, with Q held.
    Amplitude,
    Quadrature,
    /// `phase_rad` as thermometer.
    Phase,
}

/// One id.
pub struct Entry {
    pub id: &'static str,
    /// Draws the effect's form; None where the world does not suit it.
    pub draw: fn(&World, &mut Rng) -> Option<Plan>,
    pub needs: &'static [Need],
    /// The channel without which it cannot be seen, beside time and thermometer.
    pub channel: Option<&'static str>,
}

/// Shorthand for a row of the table.
const fn entry(
    id: &'static str,
    draw: fn(&World, &mut Rng) -> Option<Plan>,
    needs: &'static [Need],
    channel: Option<&'static str>,
) -> Entry {
    Entry {
        id,
        draw,
        needs,
        channel,
    }
}

/// All thermal ids but `covariate:NAME`.
pub const CATALOGUE: [Entry; 20] = [
    entry(
        "thermal_lag",
        heat_effects::thermal_lag,
        &[Need::Heat],
        None,
    ),
    entry(
        "temperature_rate",
        heat_effects::temperature_rate,
        &[Need::Heat],
        None,
    ),
    entry(
        "warmup_transient",
        heat_effects::warmup_transient,
        &[Need::Cycles],
        Some("time_since_power_on_s"),
    ),
    entry(
        "ageing_drift",
        heat_effects::ageing_drift,
        &[Need::Heat],
        None,
    ),
    entry(
        "bias_third_order",
        heat_effects::bias_third_order,
        &[Need::Heat],
        None,
    ),
    entry(
        "mode_crossing",
        heat_effects::mode_crossing,
        &[Need::Heat],
        None,
    ),
    entry(
        "stress_jump",
        heat_effects::stress_jump,
        &[Need::Heat],
        None,
    ),
    entry(
        "damping_bias",
        loop_effects::damping_bias,
        &[Need::Damping],
        Some("agc"),
    ),
    entry(
        "quadrature_leakage",
        loop_effects::quadrature_leakage,
        &[Need::Quadrature],
        Some("quad_dps"),
    ),
    entry(
        "demod_phase_drift",
        loop_effects::demod_phase_drift,
        &[Need::Quadrature, Need::Heat],
        Some("quad_dps"),
    ),
    entry(
        "scale_factor_temperature",
        rate_effects::scale_factor_temperature,
        &[Need::Rate, Need::Heat],
        Some("rate_dps"),
    ),
    entry(
        "scale_factor_nonlinearity",
        rate_effects::scale_factor_nonlinearity,
        &[Need::Rate],
        Some("rate_dps"),
    ),
    entry(
        "scale_factor_asymmetry",
        rate_effects::scale_factor_asymmetry,
        &[Need::Rate],
        Some("rate_dps"),
    ),
    entry(
        "output_deadband",
        rate_effects::output_deadband,
        &[Need::Rate],
        Some("rate_dps"),
    ),
    entry(
        "output_saturation",
        rate_effects::output_saturation,
        &[Need::Rate],
        Some("rate_dps"),
    ),
    entry(
        "supply_sensitivity",
        field_effects::supply_sensitivity,
        &[Need::Supply],
        Some("supply_v"),
    ),
    entry(
        "g_sensitivity",
        field_effects::g_sensitivity,
        &[Need::Accel],
        Some("accel_g"),
    ),
    entry(
        "g_squared_sensitivity",
        field_effects::g_squared_sensitivity,
        &[Need::Accel],
        Some("accel_g"),
    ),
    entry("periodic_pickup", field_effects::periodic_pickup, &[], None),
    entry(
        "amplitude_phase_coupling",
        loop_effects::amplitude_phase_coupling,
        &[Need::Amplitude, Need::Phase, Need::Heat],
        Some("agc"),
    ),
];

/// The entry of an id.
pub fn of(id: &str) -> &'static Entry {
    CATALOGUE
        .iter()
        .find(|e| e.id == id)
        .unwrap_or_else(|| panic!("no id {id}"))
}

/// A protocol that excites all `needs`; the rest is by chance.
pub fn protocol(needs: &[Need], rng: &mut Rng) -> Protocol {
    let has = |n: Need| needs.contains(&n);
    let by_chance = |rng: &mut Rng, n: Need, p: f64| has(n) || rng.odds(p);
    let long = rng.odds(0.08);
    let rows = if long {
        rng.range(1500, 4000)
    } else {
        rng.range(150, 600)
    } as usize;
    let row_s = if long {
        rng.pick(&[1.0, 2.0, 5.0, 10.0])
    } else {
        rng.pick(&[1.0, 5.0, 10.0, 15.0, 20.0, 30.0, 30.0, 60.0, 60.0, 120.0])
    };
    let chamber = if !has(Need::Heat) && rng.odds(0.15) {
        Chamber::Static
    } else {
        rng.pick(&CYCLING)
    };
    let thermometer = if has(Need::Phase) {
        "phase_rad"
    } else {
        rng.pick(&[
            "phase_rad",
            "phase_rad",
            "freq_hz",
            "freq_hz",
            "die_degc",
            "die_degc",
            "chamber_degc",
        ])
    };
    let cycles = by_chance(rng, Need::Cycles, 0.1);
    let inner = [Inner::Steps, Inner::Wander, Inner::Slow];
    let rate = by_chance(rng, Need::Rate, 0.2);
    let supply = by_chance(rng, Need::Supply, 0.2);
    let accel = by_chance(rng, Need::Accel, 0.2);
    let damping = by_chance(rng, Need::Damping, 0.15) && !has(Need::Amplitude);
    let amplitude = by_chance(rng, Need::Amplitude, 0.1) && !damping;
    let quadrature = by_chance(rng, Need::Quadrature, 0.2);
    Protocol {
        chamber,
        rows,
        row_s,
        // One power-on is enough to see a warm-up, if the temperature does not just follow it.
        power_cycles: if cycles {
            rng.pick(&[1, 1, 2, 3, 4])
        } else {
            1
        },
        rate: if rate {
            rng.pick(&[
                RateProgram::Sequence,
                RateProgram::Sequence,
                RateProgram::Random,
                RateProgram::Sine,
            ])
        } else {
            RateProgram::Rest
        },
        supply: if supply {
            rng.pick(&[
                SupplyProgram::Steps,
                SupplyProgram::Sweep,
                SupplyProgram::Wander,
            ])
        } else {
            SupplyProgram::Constant
        },
        accel: if accel {
            rng.pick(&[
                AccelProgram::Tumble,
                AccelProgram::Shaker,
                AccelProgram::Tilt,
            ])
        } else {
            AccelProgram::Level
        },
        amplitude: if amplitude {
            rng.pick(&inner)
        } else {
            Inner::Constant
        },
        damping: if damping {
            rng.pick(&inner)
        } else {
            Inner::Constant
        },
        quadrature: if quadrature {
            rng.pick(&inner)
        } else {
            rng.pick(&[Inner::Constant, Inner::OfTemperature])
        },
        thermometer,
    }
}

/// The channels of the record besides time, output and thermometer: those that `needs` call for, and others by chance.
pub fn channels(w: &World, wanted: &[&'static str], rng: &mut Rng) -> Vec<&'static str> {
    let mut out = vec![w.protocol.thermometer];
    let moving = |name: &str| match name {
        "supply_v" => w.protocol.supply != SupplyProgram::Constant,
        "accel_g" => w.protocol.accel != AccelProgram::Level,
        "agc" => w.protocol.damping != Inner::Constant || w.protocol.amplitude != Inner::Constant,
        "quad_dps" => w.protocol.quadrature != Inner::Constant,
        _ => false,
    };
    for name in ["supply_v", "accel_g", "agc", "quad_dps"] {
        if wanted.contains(&name) || rng.odds(if moving(name) { 0.8 } else { 0.25 }) {
            out.push(name);
        }
    }
    if w.protocol.rate != RateProgram::Rest || rng.odds(0.15) {
        out.push("rate_dps");
    }
    if w.protocol.power_cycles > 1 || rng.odds(0.1) {
        out.push("time_since_power_on_s");
    }
    // Only thermometers that rank behind the one of the bias model.
    let order = ["phase_rad", "freq_hz", "die_degc", "chamber_degc"];
    let rank = |n: &str| order.iter().position(|o| *o == n).unwrap_or(0);
    for name in ["die_degc", "chamber_degc"] {
        if rank(name) > rank(w.protocol.thermometer) && rng.odds(0.4) {
            out.push(name);
        }
    }
    out
}
