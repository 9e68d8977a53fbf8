//! Auxiliary columns: one that is a cause, and decoys that are none.

use super::dice::Dice;
use super::form::{Form, Plan};
use super::heat::lag_stepwise;
use super::linear::centred;
use super::noise::{relaxations, walk};
use super::world::World;
use crate::rng::Rng;
use std::f64::consts::{PI, TAU};

/// An auxiliary column of the record.
#[derive(Clone, Debug)]
pub struct Auxiliary {
    pub name: &'static str,
    /// One value a row, in the unit of the name.
    pub values: Vec<f64>,
}

/// Names with a plausible middle and half range.
const NAMES: [(&str, f64, f64); 9] = [
    ("humidity_pct", 45.0, 20.0),
    ("pressure_hpa", 1000.0, 25.0),
    ("heater_ma", 120.0, 60.0),
    ("board_degc", 30.0, 8.0),
    ("bias_mon_v", 1.25, 0.04),
    ("fan_hz", 55.0, 20.0),
    ("field_ut", 40.0, 15.0),
    ("motor_duty_pct", 50.0, 40.0),
    ("strain_ppm", 10.0, 6.0),
];

/// Movement of a column on the regular rows, -1..1.
fn movement(n: usize, r: &mut Rng) -> Vec<f64> {
    let raw = match r.range(0, 4) {
        0 => lag_stepwise(&walk(n, r), 1.0, r.between(1.0, 10.0)),
        1 => {
            let (turns, lead) = (r.between(1.2, 12.0), r.unit());
            let sine = |k: usize| (TAU * (turns * k as f64 / n as f64 + lead)).sin();
            (0..n).map(sine).collect()
        }
        2 => relaxations(n, r),
        3 => {
            let mut level = 0.0;
            (0..n)
                .map(|k| {
                    if k == 0 || r.odds(20.0 / n as f64) {
                        level = r.signed_unit();
                    }
                    level
                })
                .collect()
        }
        _ => {
            let steps = walk(n, r);
            let (turns, lead) = (r.between(2.0, 6.0), r.unit());
            let size = 0.3 * (n as f64).sqrt();
            (0..n)
                .map(|k| steps[k] + size * (TAU * (turns * k as f64 / n as f64 + lead)).sin())
                .collect()
        }
    };
    centred(&raw)
}

/// `count` columns that cause nothing: random walks, sines, steps, copies of the temperature or of `of` with noise.
pub fn decoys(w: &World, count: usize, of: Option<&Auxiliary>, r: &mut Rng) -> Vec<Auxiliary> {
    let mut names: Vec<usize> = (0..NAMES.len()).collect();
    r.shuffle(&mut names);
    names.retain(|k| of.is_none_or(|a| a.name != NAMES[*k].0));
    let warmth = w.warmth();
    let like = of.map(|a| centred(&a.values));
    names
        .iter()
        .take(count)
        .map(|k| {
            let own = movement(w.protocol.rows, r);
            let own: Vec<f64> = w.grid.iter().map(|g| own[*g]).collect();
            let share = r.between(0.3, 0.95);
            let mixed: Vec<f64> = match (r.range(0, 4), &like) {
                (0, _) => mix(&own, &warmth, share),
                (1, Some(cause)) => mix(&own, cause, r.between(0.3, 0.75)),
                _ => own,
            };
            dressed(*k, &mixed, 0.01, r)
        })
        .collect()
}

/// `share` of b, the rest a.
fn mix(a: &[f64], b: &[f64], share: f64) -> Vec<f64> {
    let rest = (1.0 - share * share).sqrt();
    a.iter().zip(b).map(|(x, y)| rest * x + share * y).collect()
}

/// The named column with its middle, range and read noise.
fn dressed(k: usize, unit: &[f64], noise: f64, r: &mut Rng) -> Auxiliary {
    let (name, middle, half) = NAMES[k];
    let values = unit
        .iter()
        .map(|u| middle + half * (u + noise * r.gauss()))
        .collect();
    Auxiliary { name, values }
}

/// A column that is a cause, with the plan of its effect `covariate:NAME`. Shapes: line, parabola, saturation,
/// half to one and a half waves, and a first-order delay before the line or the saturation.
pub fn cause(w: &World, r: &mut Rng) -> (Auxiliary, Plan) {
    let n = w.protocol.rows;
    let unit = movement(n, r);
    let shape = r.range(0, 4);
    let delay_rows = if shape == 4 {
        r.between(1.0, 0.02 * n as f64)
    } else {
        0.0
    };
    let felt = if delay_rows > 0.0 {
        lag_stepwise(&unit, 1.0, delay_rows)
    } else {
        unit.clone()
    };
    let (vertex, waves, steep) = (
        r.between(-0.5, 0.5),
        r.between(0.5, 1.5),
        r.between(1.5, 4.0),
    );
    let law = |x: f64| match shape {
        0 | 4 => x,
        1 => (x - vertex).powi(2),
        2 => (steep * (x - vertex)).tanh(),
        _ => (PI * waves * x + vertex).sin(),
    };
    let pick = |v: &[f64]| w.grid.iter().map(|k| v[*k]).collect::<Vec<f64>>();
    let column = dressed(
        r.range(0, NAMES.len() as i64 - 1) as usize,
        &pick(&unit),
        0.002,
        r,
    );
    let contribution = pick(&felt).iter().map(|x| law(*x)).collect();
    let plan = Plan::with(
        &format!("covariate:{}", column.name),
        Form::Linear(contribution),
        &[("shape", shape as f64), ("delay_rows", delay_rows)],
    );
    (column, plan)
}
