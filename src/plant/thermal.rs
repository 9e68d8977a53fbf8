//! Heat: structure and electronics as two nodes, each coupled to the chamber and to the other.
//!
//! C1 dT1/dt = G1 (Tc - T1) + G12 (T2 - T1) and C2 dT2/dt = G2 (Tc - T2) + G12 (T1 - T2) + P, with T1
//! the structure, T2 the electronics, Tc the chamber. A third temperature follows the structure's with
//! a first-order lag, for the effect that needs one. While the chamber ramps the equations are
//! linear with a linear input, and a step of any length is exact: one matrix exponential.

use crate::design::ThermalNetwork;
use nalgebra::{SMatrix, SVector};

/// Structure, electronics, lagged, chamber, the chamber's slope, and 1.
type State = SVector<f64, 6>;
type Step = SMatrix<f64, 6, 6>;

/// The temperatures of a device, and how they move.
#[derive(Debug, Clone)]
pub struct Thermal {
    generator: Step,
    state: State,
    /// The last step's length, s, and its matrix: steps are mostly of equal length.
    cached: Option<(f64, Step)>,
}

/// Temperatures at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Temperatures {
    /// Of the chamber, degC.
    pub chamber_degc: f64,
    /// Of the structure, degC.
    pub structure_degc: f64,
    /// Of the electronics, degC.
    pub electronics_degc: f64,
    /// Follows the structure's with the lag, degC.
    pub lagged_degc: f64,
    /// How fast the structure's moves, K/s.
    pub structure_k_per_s: f64,
}

impl Thermal {
    /// In equilibrium with a chamber at `chamber_degc`. `lag_s`: time constant of the lagged
    /// temperature, s, above 0.
    pub fn in_equilibrium(network: &ThermalNetwork, lag_s: f64, chamber_degc: f64) -> Self {
        let n = network;
        let (c1, c2) = (n.structure_heat_j_per_k, n.electronics_heat_j_per_k);
        let (g1, g2) = (n.structure_chamber_w_per_k, n.electronics_chamber_w_per_k);
        let g12 = n.exchange_w_per_k;
        let mut generator = Step::zeros();
        generator[(0, 0)] = -(g1 + g12) / c1;
        generator[(0, 1)] = g12 / c1;
        generator[(0, 3)] = g1 / c1;
        generator[(1, 0)] = g12 / c2;
        generator[(1, 1)] = -(g2 + g12) / c2;
        generator[(1, 3)] = g2 / c2;
        generator[(1, 5)] = n.power_w / c2;
        generator[(2, 0)] = 1.0 / lag_s;
        generator[(2, 2)] = -1.0 / lag_s;
        generator[(3, 4)] = 1.0;
        // Above the chamber, with P as the only source: two heat balances.
        let determinant = (g1 + g12) * (g2 + g12) - g12 * g12;
        let structure = chamber_degc + n.power_w * g12 / determinant;
        let electronics = chamber_degc + n.power_w * (g1 + g12) / determinant;
        Thermal {
            generator,
            state: State::from([structure, electronics, structure, chamber_degc, 0.0, 1.0]),
            cached: None,
        }
    }

    /// Lets `seconds` pass while the chamber goes evenly to `chamber_degc`.
    pub fn advance(&mut self, seconds: f64, chamber_degc: f64) {
        if seconds <= 0.0 {
            self.state[3] = chamber_degc;
            return;
        }
        self.state[4] = (chamber_degc - self.state[3]) / seconds;
        let step = match &self.cached {
            Some((length, step)) if *length == seconds => *step,
            _ => (self.generator * seconds).exp(),
        };
        self.cached = Some((seconds, step));
        self.state = step * self.state;
        // Exact, where the exponential rounds.
        (self.state[3], self.state[5]) = (chamber_degc, 1.0);
    }

    /// As they are.
    pub fn now(&self) -> Temperatures {
        Temperatures {
            chamber_degc: self.state[3],
            structure_degc: self.state[0],
            electronics_degc: self.state[1],
            lagged_degc: self.state[2],
            structure_k_per_s: (self.generator.row(0) * self.state)[0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network() -> ThermalNetwork {
        ThermalNetwork {
            structure_heat_j_per_k: 0.6,
            structure_chamber_w_per_k: 0.01,
            electronics_heat_j_per_k: 0.9,
            electronics_chamber_w_per_k: 0.02,
            exchange_w_per_k: 0.0,
            power_w: 0.0,
        }
    }

    #[test]
    fn a_step_decays_exponentially_and_a_ramp_lags_by_rate_times_time_constant() {
        let mut t = Thermal::in_equilibrium(&network(), 10.0, 20.0);
        t.advance(0.0, 30.0);
        t.advance(60.0, 30.0);
        // Time constants 60 and 45 s.
        assert!((t.now().structure_degc - (30.0 - 10.0 / std::f64::consts::E)).abs() < 1e-9);
        let left = 10.0 * (-60.0f64 / 45.0).exp();
        assert!((t.now().electronics_degc - (30.0 - left)).abs() < 1e-9);
        t.advance(3600.0, 30.0);
        t.advance(6000.0, 30.0 + 6000.0 / 60.0);
        let now = t.now();
        assert!((now.chamber_degc - now.structure_degc - 1.0).abs() < 1e-6);
        assert!((now.structure_degc - now.lagged_degc - 10.0 / 60.0).abs() < 1e-6);
        assert!((now.structure_k_per_s - 1.0 / 60.0).abs() < 1e-9);
    }

    #[test]
    fn pieces_of_a_step_are_the_step() {
        let coupled = ThermalNetwork {
            exchange_w_per_k: 0.005,
            power_w: 0.05,
            ..network()
        };
        let mut whole = Thermal::in_equilibrium(&coupled, 300.0, 0.0);
        let mut pieces = whole.clone();
        whole.advance(1000.0, 50.0);
        for k in 1..=100 {
            pieces.advance(10.0, f64::from(k) * 0.5);
        }
        let (a, b) = (whole.now(), pieces.now());
        assert!((a.structure_degc - b.structure_degc).abs() < 1e-9);
        assert!((a.electronics_degc - b.electronics_degc).abs() < 1e-9);
        assert!((a.lagged_degc - b.lagged_degc).abs() < 1e-9);
    }

    #[test]
    fn self_heating_is_in_balance_from_the_start() {
        let heated = ThermalNetwork {
            exchange_w_per_k: 0.005,
            power_w: 0.05,
            ..network()
        };
        let mut t = Thermal::in_equilibrium(&heated, 300.0, 25.0);
        let before = t.now();
        assert!(before.electronics_degc > before.structure_degc && before.structure_degc > 25.0);
        t.advance(5000.0, 25.0);
        let after = t.now();
        assert!((before.electronics_degc - after.electronics_degc).abs() < 1e-9);
        assert!((before.structure_degc - after.structure_degc).abs() < 1e-9);
        // All heat leaves through the chamber.
        let out = 0.01 * (after.structure_degc - 25.0) + 0.02 * (after.electronics_degc - 25.0);
        assert!((out - 0.05).abs() < 1e-9);
    }
}
