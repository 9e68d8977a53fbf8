//! What is planted: each effect of the catalogue by the plant's own physics ([`crate::plant::effects`]), its shape
//! drawn, its size found so that it leaves a given error beyond the declared model.
//!
//! Two kinds have no physics of their own in the plant. A covariate is a parabola of the recorded column. An effect
//! of the user's is the user's formula: the self-test of such an effect shows whether the experiment excites it and
//! how small it may be, not whether the formula is right.

use super::programs::Program;
use super::scene::{Plant, Scene, Taken};
use crate::approx::real::formula::Operand;
use crate::design::UserEffect;
use crate::plant::noise::Noise;
use crate::statistics::linear::{Basis, dot};
use crate::thermal::channels::scaled;

/// An effect that is planted.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Of the catalogue.
    Catalogue(&'static Planted),
    /// Of this auxiliary column.
    Covariate(String),
    /// Of the design.
    User(UserEffect),
}

/// An effect of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Planted {
    /// Its id.
    pub id: &'static str,
    /// The experiment that shows it.
    pub program: Program,
    /// Columns beside time and output without which nothing can show.
    pub needs: &'static [&'static str],
    /// What its size is, with the unit.
    pub knob: &'static str,
    /// Whether it has a sign.
    pub is_signed: bool,
}

const fn of(
    id: &'static str,
    program: Program,
    needs: &'static [&'static str],
    knob: &'static str,
) -> Planted {
    Planted {
        id,
        program,
        needs,
        knob,
        is_signed: true,
    }
}

const fn unsigned(planted: Planted) -> Planted {
    Planted {
        is_signed: false,
        ..planted
    }
}

/// Every effect of thermal records but covariates, in the catalogue's order.
#[rustfmt::skip]
pub const CATALOGUE: [Planted; 19] = [
    of("thermal_lag", Program::Thermal, &[], "dps_per_k"),
    of("temperature_rate", Program::Thermal, &[], "dps_s_per_k"),
    of("warmup_transient", Program::Restarts, &[], "amplitude_dps"),
    of("ageing_drift", Program::Thermal, &[], "drift_dps over the record"),
    of("bias_third_order", Program::Thermal, &[], "dps_per_rad3"),
    of("mode_crossing", Program::Thermal, &[], "amplitude_dps"),
    of("stress_jump", Program::Thermal, &[], "height_dps"),
    of("damping_bias", Program::Gas, &["agc"], "swing of 1/Q, relative"),
    of("quadrature_leakage", Program::Quadrature, &["quad_dps"], "phase_rad"),
    of("demod_phase_drift", Program::Quadrature, &["quad_dps"], "rad_per_k"),
    of("scale_factor_temperature", Program::Table, &["rate_dps"], "relative_per_k"),
    of("scale_factor_nonlinearity", Program::Table, &["rate_dps"], "relative_at_full_scale"),
    of("scale_factor_asymmetry", Program::Table, &["rate_dps"], "relative"),
    unsigned(of("output_deadband", Program::Creep, &["rate_dps"], "half_width_dps")),
    unsigned(of("output_saturation", Program::Limit, &["rate_dps"], "dps below the largest output")),
    of("supply_sensitivity", Program::Supply, &["supply_v"], "dps_per_v"),
    of("g_sensitivity", Program::Tumble, &["accel_g"], "dps_per_g"),
    of("g_squared_sensitivity", Program::Tumble, &["accel_g"], "dps_per_g2"),
    of("periodic_pickup", Program::Thermal, &[], "amplitude_dps"),
];

/// The one that needs the phase as thermometer.
pub const COUPLING: Planted = of(
    "amplitude_phase_coupling",
    Program::Drive,
    &["phase_rad", "agc"],
    "rad",
);

/// Numbers for one record, drawn from its own stream.
#[derive(Debug, Clone, Copy)]
pub struct Draw {
    noise: Noise,
}

impl Draw {
    /// Of a stream.
    pub fn new(seed: u64, stream: u64) -> Self {
        Draw {
            noise: Noise::new(seed, stream),
        }
    }

    /// Between two numbers.
    fn between(&self, which: u64, low: f64, high: f64) -> f64 {
        low + (high - low) * self.noise.uniform(which)
    }

    /// The same, evenly in the logarithm.
    fn spread(&self, which: u64, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.noise.uniform(which))
    }

    /// 1 or -1.
    fn sign(&self) -> f64 {
        if self.noise.uniform(99) < 0.5 {
            -1.0
        } else {
            1.0
        }
    }
}

impl Kind {
    /// As it is reported.
    pub fn id(&self) -> String {
        match self {
            Kind::Catalogue(planted) => planted.id.to_owned(),
            Kind::Covariate(name) => format!("covariate:{name}"),
            Kind::User(effect) => effect.id.clone(),
        }
    }

    /// What its size is in a scene, with the unit.
    pub fn knob(&self, scene: &Scene) -> String {
        // A record's: gas is in its drive gain, and its thermometer may be no phase.
        let is_record = scene.gas.is_empty();
        match self {
            Kind::Catalogue(planted) => match planted.id {
                "damping_bias" if is_record => "dps, 1/Q being doubled",
                "bias_third_order" if is_record && scene.thermometer != "phase_rad" => {
                    "dps at u = 1"
                }
                _ => planted.knob,
            }
            .to_owned(),
            Kind::Covariate(_) => "dps over half the column's range".to_owned(),
            Kind::User(effect) => {
                let mut amplitudes = effect.amplitudes();
                match (amplitudes.next(), amplitudes.next()) {
                    (Some(one), None) => format!("{} ({})", one.name, one.unit),
                    _ => "rms of each part (deg/s)".to_owned(),
                }
            }
        }
    }

    /// A column that the scene lacks and that it needs.
    pub fn lacks(&self, scene: &Scene) -> Option<String> {
        let has = |name: &str| name == "time_s" || scene.columns.contains_key(name);
        let needs: Vec<&str> = match self {
            Kind::Catalogue(planted) => planted.needs.to_vec(),
            Kind::Covariate(name) => vec![name.as_str()],
            Kind::User(effect) => effect.columns().collect(),
        };
        needs.into_iter().find(|n| !has(n)).map(str::to_owned)
    }

    /// The plant with a size; `None` for a size that it cannot have.
    fn plant(&self, scene: &Scene, draw: &Draw, size: f64) -> Option<Plant> {
        let mut plant = Plant::default();
        match self {
            Kind::Catalogue(planted) => {
                let size = if planted.is_signed {
                    size * draw.sign()
                } else {
                    size
                };
                catalogue(planted.id, scene, draw, size, &mut plant)?;
            }
            Kind::Covariate(name) => {
                let (x, ..) = scaled(scene.columns.get(name)?);
                let bend = draw.between(0, -0.8, 0.8);
                let size = size * draw.sign();
                plant.added_dps = x.iter().map(|x| size * (x + bend * x * x)).collect();
            }
            Kind::User(effect) => plant.added_dps = of_user(effect, scene, draw, size)?,
        }
        Some(plant)
    }

    /// A plant that leaves an error of `target_dps` rms beyond the declared model, and its size; `None` where
    /// the scene cannot show that much of it.
    pub fn sized(&self, scene: &Scene, draw: &Draw, target_dps: f64) -> Option<(Plant, f64)> {
        let left = |size: f64| {
            let plant = self.plant(scene, draw, size)?;
            Some(beyond(scene, &scene.take(&plant)))
        };
        // From far below upwards, then halving.
        let mut high = 1e-9;
        while left(high)? < target_dps {
            high *= 4.0;
            if high > 1e6 {
                return None;
            }
        }
        let mut low = high / 4.0;
        for _ in 0..24 {
            let middle = (low * high).sqrt();
            if left(middle)? < target_dps {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some((self.plant(scene, draw, high)?, high))
    }
}

/// Sets an effect of the catalogue; `None` for a size out of its range.
fn catalogue(id: &str, scene: &Scene, draw: &Draw, size: f64, plant: &mut Plant) -> Option<()> {
    let row_s = scene.span_s() / scene.len().saturating_sub(1).max(1) as f64;
    let degc = || scene.instants.iter().map(|i| i.structure_degc);
    let (cold, hot) = degc().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| {
        (a.min(t), b.max(t))
    });
    let inside =
        |which: u64, from: f64, to: f64| cold + (hot - cold) * draw.between(which, from, to);
    let rates = scene.instants.iter().map(|i| i.rate_dps.abs());
    let fastest = rates.fold(0.0, f64::max).max(1e-9);
    let values: Vec<f64> = match id {
        "thermal_lag" => vec![size, draw.spread(0, 2.5 * row_s, 15.0 * row_s)],
        "warmup_transient" => vec![size, draw.spread(0, 3.0 * row_s, 20.0 * row_s)],
        // Logarithmic or nearly linear.
        "ageing_drift" => {
            let t0_s = scene.span_s() * draw.spread(0, 0.05, 3.0);
            vec![size / (scene.span_s() / t0_s).ln_1p(), t0_s]
        }
        "bias_third_order" => {
            let middle = scene.instants.iter().map(|i| i.phase_rad).sum::<f64>();
            vec![size, middle / scene.len().max(1) as f64]
        }
        "mode_crossing" => {
            let half_width = (hot - cold) * draw.spread(1, 0.03, 0.1);
            vec![size, inside(0, 0.25, 0.75), half_width]
        }
        "stress_jump" => {
            let gap = (hot - cold) * draw.between(1, 0.0, 0.12);
            vec![size, inside(0, 0.25, 0.7), gap]
        }
        "damping_bias" if !scene.gas.is_empty() => {
            plant.gas = size.abs();
            if plant.gas > 0.5 {
                return None;
            }
            vec![10.0 * size.signum(), 0.0]
        }
        "damping_bias" => vec![size, 0.0],
        "demod_phase_drift" => vec![size, inside(0, 0.2, 0.8)],
        "scale_factor_temperature" => vec![size, inside(0, 0.2, 0.8)],
        "scale_factor_nonlinearity" => vec![size, fastest],
        "output_saturation" => {
            let total = scene.take(&Plant::default()).rate_out_dps;
            let highest = total.into_iter().fold(f64::NEG_INFINITY, f64::max);
            vec![-1e9, highest - size]
        }
        "supply_sensitivity" => {
            let supply = scene.instants.iter().map(|i| i.supply_v).sum::<f64>();
            vec![size, (supply / scene.len().max(1) as f64).max(1e-3)]
        }
        "periodic_pickup" => vec![
            size,
            row_s * draw.spread(0, 3.3, 25.0),
            draw.between(1, -3.1, 3.1),
        ],
        _ => vec![size],
    };
    plant.effects.set(id, &values).ok()
}

/// What an effect of the user's adds, deg/s: with one amplitude, that times the formula; with several, parts of
/// equal rms. `None` where the formula has no finite value, or no amplitude.
fn of_user(effect: &UserEffect, scene: &Scene, draw: &Draw, size: f64) -> Option<Vec<f64>> {
    let rows = scene.len();
    let middle = |which: usize, low: f64, high: f64| {
        let share = draw.between(which as u64, 0.25, 0.75);
        if low > 0.0 && high > 4.0 * low {
            low * (high / low).powf(share)
        } else {
            low + share * (high - low)
        }
    };
    let count = effect.amplitudes().count();
    let part = |one: usize| -> Option<Vec<f64>> {
        let operand = |name: &String| -> Option<Operand<'_>> {
            if let Some(k) = effect.shapes().position(|(p, _)| p.name == *name) {
                let (_, r) = effect.shapes().nth(k)?;
                return Some(Operand::Number(middle(k, r.low, r.high)));
            }
            if let Some(k) = effect.amplitudes().position(|p| p.name == *name) {
                return Some(Operand::Number(if k == one { 1.0 } else { 0.0 }));
            }
            match name.as_str() {
                "time_s" => Some(Operand::Column(&scene.time_s)),
                name => scene.columns.get(name).map(|c| Operand::Column(c)),
            }
        };
        let names = effect.formula.names().iter();
        let operands: Vec<Operand<'_>> = names.map(operand).collect::<Option<_>>()?;
        let values = effect.formula.values(&operands, rows);
        values.iter().all(|v| v.is_finite()).then_some(values)
    };
    if count == 0 {
        return None;
    }
    let mut sum = vec![0.0; rows];
    for k in 0..count {
        let values = part(k)?;
        let rms = (dot(&values, &values) / rows.max(1) as f64).sqrt();
        let unit = if count == 1 {
            1.0
        } else {
            1.0 / rms.max(f64::MIN_POSITIVE)
        };
        for (s, v) in sum.iter_mut().zip(&values) {
            *s += draw.sign() * size * unit * v;
        }
    }
    Some(sum)
}

/// The error that the declared model leaves in rows without noise, deg/s rms.
pub fn beyond(scene: &Scene, taken: &Taken) -> f64 {
    let rate = taken.columns.get("rate_dps");
    let mut error: Vec<f64> = taken
        .rate_out_dps
        .iter()
        .enumerate()
        .map(|(k, out)| out - rate.and_then(|r| r.get(k)).copied().unwrap_or(0.0))
        .collect();
    let (u, ..) = taken
        .columns
        .get(&scene.thermometer)
        .map_or((vec![0.0; error.len()], 0.0, 1.0), |t| scaled(t));
    let powers: Vec<Vec<f64>> = (0..3)
        .map(|k| u.iter().map(|u| u.powi(k)).collect())
        .collect();
    Basis::new(&powers).project_off(&mut error);
    (dot(&error, &error) / error.len().max(1) as f64).sqrt()
}
