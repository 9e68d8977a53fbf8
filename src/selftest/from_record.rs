//! A user's own record as an experiment: its columns and its noise, with the declared model as it was fitted beside
//! the record's own steps, and without these.
//!
//! The plant's instants come from the columns: the structure's temperature from the smoothed thermometer by the same
//! line through its readings as in `close`, its rate of change by differences, 1/Q from the drive gain. A
//! thermometer that is no phase stands for the phase in the cubic bias, scaled to -1..1.

use super::scene::Scene;
use crate::plant::effects::Instant;
use crate::plant::profile::NOMINAL_SUPPLY_V;
use crate::thermal::close::Closed;

/// The scene of a closed record.
pub fn scene(closed: &Closed) -> Scene {
    let c = &closed.channels;
    let mut columns = c.columns.clone();
    let reading: Vec<f64> = c.u.iter().map(|u| c.centre + c.half * u).collect();
    columns.insert(c.thermometer.clone(), reading);
    if c.on_known {
        columns.insert("time_since_power_on_s".to_owned(), c.on_s.clone());
    }
    let of = |name: &str, row: usize, absent: f64| {
        let column = columns.get(name).and_then(|v| v.get(row));
        column.copied().unwrap_or(absent)
    };
    let degc: Vec<f64> = c
        .smooth_u
        .iter()
        .map(|u| c.middle_degc + c.kelvin_per_u * u)
        .collect();
    let slope = slopes(&c.time_s, &degc);
    let is_phase = c.thermometer == "phase_rad";
    let instants = (0..c.len())
        .map(|k| Instant {
            time_s: c.time_s[k],
            power_on_s: c.on_s[k],
            structure_degc: degc[k],
            electronics_degc: of("die_degc", k, degc[k]),
            structure_k_per_s: slope[k],
            lagged_degc: degc[k],
            phase_rad: if is_phase {
                of("phase_rad", k, 0.0)
            } else {
                c.u[k]
            },
            inverse_q: of("agc", k, 1.0) - 1.0,
            quadrature_dps: of("quad_dps", k, 0.0),
            rate_dps: of("rate_dps", k, 0.0),
            supply_v: of("supply_v", k, NOMINAL_SUPPLY_V),
            accel_g: of("accel_g", k, 0.0),
        })
        .collect();
    let bias = &closed.after.bias;
    Scene {
        name: "the record",
        time_s: c.time_s.clone(),
        instants,
        agc: (0..c.len()).map(|k| of("agc", k, 1.0)).collect(),
        gas: Vec::new(),
        drive: None,
        declared_dps: c.u.iter().map(|u| bias.at(*u)).collect(),
        thermometer: c.thermometer.clone(),
        // The readings are the record's own, noise and all.
        reading_rms: 0.0,
        noise: closed.after.fit.noise,
        columns,
    }
}

/// Rates of change over a row to each side, per second.
fn slopes(time_s: &[f64], values: &[f64]) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(last));
            let seconds = time_s[b] - time_s[a];
            if seconds > 0.0 {
                (values[b] - values[a]) / seconds
            } else {
                0.0
            }
        })
        .collect()
}
