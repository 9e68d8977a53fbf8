//! What a gyro goes through in an experiment, row by row, and what a laboratory writes down of it.

use crate::design::Effects;
use crate::plant::effects::{self, Instant, StressJump};
use crate::plant::resonator::{Resonator, Response};
use crate::record::ThermalRecord;
use crate::statistics::noise::NoiseModel;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// An experiment without any undeclared effect and without noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// What it is called in tables.
    pub name: &'static str,
    /// Of the rows, s; increasing.
    pub time_s: Vec<f64>,
    /// What the plant's effects see, but for the lagged temperature, which depends on the lag.
    pub instants: Vec<Instant>,
    /// Drive gain relative to nominal, 1.
    pub agc: Vec<f64>,
    /// Gas that is let in and out: rise of 1/Q for a swing of 1, relative. Empty: none is.
    pub gas: Vec<f64>,
    /// The drive mode and the frequency that it is excited at, Hz, where gas bends the measured phase.
    pub drive: Option<(Resonator, f64)>,
    /// The bias of the declared model, deg/s.
    pub declared_dps: Vec<f64>,
    /// Columns but time and output, by name.
    pub columns: BTreeMap<String, Vec<f64>>,
    /// The column of the bias model.
    pub thermometer: String,
    /// Noise of its reading, rms, in its unit.
    pub reading_rms: f64,
    /// Noise of the output.
    pub noise: NoiseModel,
}

/// What is planted.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plant {
    /// Effects of the simulated gyro ([`crate::plant::effects`]).
    pub effects: Effects,
    /// Swing of 1/Q, where the scene has gas that can be let in, 1.
    pub gas: f64,
    /// What adds to the output beside, deg/s; empty: nothing.
    pub added_dps: Vec<f64>,
}

/// Rows of a record, without noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Taken {
    /// deg/s.
    pub rate_out_dps: Vec<f64>,
    /// As in [`Scene::columns`].
    pub columns: BTreeMap<String, Vec<f64>>,
}

impl Scene {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// From the first row to the last, s.
    pub fn span_s(&self) -> f64 {
        match (self.time_s.first(), self.time_s.last()) {
            (Some(a), Some(b)) => b - a,
            _ => 0.0,
        }
    }

    /// A record of the experiment's times with these columns.
    pub fn record(&self, columns: BTreeMap<String, Vec<f64>>) -> ThermalRecord {
        ThermalRecord {
            source: PathBuf::from("self-test"),
            time_s: self.time_s.clone(),
            columns,
            lines: (2..self.len() + 2).collect(),
            renamed: Default::default(),
            units: Default::default(),
        }
    }

    /// The rows with a plant.
    pub fn take(&self, plant: &Plant) -> Taken {
        let on = &plant.effects;
        let lag = on
            .get("thermal_lag")
            .map(|[_, tau_s]| self.lagged_degc(tau_s));
        let first = self.instants.first().map_or(0.0, |i| i.structure_degc);
        let mut jump = StressJump::new(on, first);
        let mut columns = self.columns.clone();
        let mut rate_out_dps = Vec::with_capacity(self.len());
        for (k, plain) in self.instants.iter().enumerate() {
            let at = |values: &[f64]| values.get(k).copied().unwrap_or(0.0);
            let swing = plant.gas * at(&self.gas);
            let (agc, bend_rad) = self.damped(swing, plain.structure_degc);
            let agc = at(&self.agc) * agc;
            let now = Instant {
                lagged_degc: lag.as_ref().map_or(plain.structure_degc, |l| at(l)),
                inverse_q: (1.0 + plain.inverse_q) * (1.0 + swing) - 1.0,
                ..*plain
            };
            let jump_dps = jump.as_mut().map_or(0.0, |j| j.step(now.structure_degc));
            let bias = at(&self.declared_dps) + effects::bias_dps(on, &now) + jump_dps;
            let total = effects::rate_dps(on, &now) + bias + at(&plant.added_dps);
            rate_out_dps.push(effects::limit_dps(on, total));
            let read = |columns: &mut BTreeMap<String, Vec<f64>>, name: &str, value: f64| {
                if let Some(cell) = columns.get_mut(name).and_then(|c| c.get_mut(k)) {
                    *cell = value;
                }
            };
            let pulled = effects::phase_pull_rad(on, agc - 1.0) + bend_rad;
            if pulled != 0.0 {
                let phase = self.columns.get("phase_rad").map_or(0.0, |c| at(c));
                read(&mut columns, "phase_rad", phase + pulled);
            }
            read(&mut columns, "agc", agc);
        }
        Taken {
            rate_out_dps,
            columns,
        }
    }

    /// What a rise of 1/Q does: the drive gain that holds the amplitude, relative to that without, and what
    /// adds to the measured phase, rad.
    fn damped(&self, swing: f64, degc: f64) -> (f64, f64) {
        let Some((drive, excitation_hz)) = &self.drive else {
            return (1.0 + swing, 0.0);
        };
        if swing == 0.0 {
            return (1.0, 0.0);
        }
        let of = |q: f64| -> Response { Resonator { q, ..*drive }.response(degc, *excitation_hz) };
        let (plain, damped) = (of(drive.q), of(drive.q / (1.0 + swing)));
        (
            plain.amplitude / damped.amplitude,
            damped.phase_rad - plain.phase_rad,
        )
    }

    /// The structure's temperature through a first-order lag, degC: tau y' = x - y, x straight between rows.
    fn lagged_degc(&self, tau_s: f64) -> Vec<f64> {
        let mut out: Vec<f64> = Vec::with_capacity(self.len());
        for (k, now) in self.instants.iter().enumerate() {
            let x = now.structure_degc;
            let y = match (k.checked_sub(1), out.last()) {
                (Some(before), Some(y)) => {
                    let seconds = self.time_s[k] - self.time_s[before];
                    let from = self.instants[before].structure_degc;
                    let behind = tau_s * (x - from) / seconds;
                    x - behind + (y - from + behind) * (-seconds / tau_s).exp()
                }
                _ => x,
            };
            out.push(y);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        let instant = Instant::equilibrium(&Effects::default(), 20.0);
        let instants = (0..40)
            .map(|k| Instant {
                structure_degc: 20.0 + f64::from(k),
                ..instant
            })
            .collect();
        Scene {
            name: "ramp",
            time_s: (0..40).map(|k| 10.0 * f64::from(k)).collect(),
            instants,
            agc: vec![1.1; 40],
            gas: vec![0.1; 40],
            drive: None,
            declared_dps: vec![3.0; 40],
            columns: [("phase_rad", -1.7), ("agc", 1.1)]
                .map(|(name, v)| (name.to_owned(), vec![v; 40]))
                .into(),
            thermometer: "phase_rad".to_owned(),
            reading_rms: 0.0,
            noise: NoiseModel::default(),
        }
    }

    fn with(id: &str, values: &[f64]) -> Taken {
        let mut plant = Plant::default();
        plant.effects.set(id, values).unwrap();
        scene().take(&plant)
    }

    #[test]
    fn effects_act_where_they_act() {
        let plain = scene().take(&Plant::default());
        assert_eq!(plain.rate_out_dps, vec![3.0; 40]);
        assert_eq!(plain.columns, scene().columns);
        // A ramp of 0.1 K/s lags by 0.1 K/s times 30 s in the end.
        let lagged = with("thermal_lag", &[2.0, 30.0]).rate_out_dps;
        assert!(
            (lagged[39] - (3.0 - 2.0 * 3.0)).abs() < 1e-4,
            "{}",
            lagged[39]
        );
        let pulled = with("amplitude_phase_coupling", &[0.02]);
        assert!((pulled.columns["phase_rad"][7] - (-1.7 + 0.02 * 0.1)).abs() < 1e-12);
        assert_eq!(pulled.rate_out_dps, plain.rate_out_dps);
        assert_eq!(with("output_saturation", &[-9.0, 2.5]).rate_out_dps[0], 2.5);
        let gas = Plant {
            gas: 0.5,
            ..Plant::default()
        };
        let gas = scene().take(&gas);
        assert!((gas.columns["agc"][0] - 1.1 * 1.05).abs() < 1e-12);
        assert_eq!(gas.columns["phase_rad"][0], -1.7);
    }
}
