//! What acts on the gyro over time: the chamber through the thermal network, table, supply,
//! acceleration, effects and slow noise.

use crate::design::Design;
use crate::plant::effects::{self, Instant, StressJump};
use crate::plant::gyroscope::Conditions;
use crate::plant::profile::{Profile, Surroundings};
use crate::plant::resonator::ZERO_CELSIUS_K;
use crate::plant::slow_noise::SlowNoise;
use crate::plant::thermal::Thermal;
use crate::plant::{Device, Temperatures};

/// The grid of the slow noise, s.
const SLOW_STEP_S: f64 = 0.02;

/// The lag where no effect asks for one, s.
const ANY_LAG_S: f64 = 60.0;

/// Walks along a profile.
#[derive(Debug, Clone)]
pub struct World {
    device: Device,
    profile: Profile,
    thermal: Thermal,
    time_s: f64,
    quadrature_dps: f64,
    jump: Option<StressJump>,
    jump_dps: f64,
    slow: SlowNoise,
}

/// All that is true at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// s since the run's start.
    pub time_s: f64,
    /// Chamber, structure, electronics.
    pub temperatures: Temperatures,
    /// Table, supply, acceleration.
    pub surroundings: Surroundings,
    /// For the gyro.
    pub conditions: Conditions,
}

impl World {
    /// At the profile's start, in thermal equilibrium, just switched on.
    pub fn new(design: &Design, profile: Profile) -> Self {
        let first = profile.first();
        let run = &design.thermal_run;
        let on = &design.gyro.effects;
        let lag_s = on.get("thermal_lag").map_or(ANY_LAG_S, |[_, tau_s]| tau_s);
        let thermal = Thermal::in_equilibrium(&design.gyro.thermal, lag_s, first.chamber_degc);
        let degc = thermal.now().structure_degc;
        let mut jump = StressJump::new(on, degc);
        World {
            device: Device::new(&design.gyro),
            jump_dps: jump.as_mut().map_or(0.0, |j| j.step(degc)),
            jump,
            thermal,
            time_s: first.time_s,
            quadrature_dps: run.quadrature_dps,
            slow: SlowNoise::new(
                run.flicker_dph,
                run.rate_random_walk_dph_rth,
                SLOW_STEP_S,
                profile.duration_s().max(1.0),
                run.seed,
            ),
            profile,
        }
    }

    /// Goes on to a time, s, not before the one reached so far.
    pub fn advance_to(&mut self, time_s: f64) -> Moment {
        let corners = self.profile.corners_between(self.time_s, time_s).to_vec();
        for corner in corners {
            self.pass(corner.time_s, corner.chamber_degc);
        }
        let surroundings = self.profile.at(time_s);
        self.pass(time_s, surroundings.chamber_degc);
        self.moment(surroundings)
    }

    fn pass(&mut self, to_s: f64, chamber_degc: f64) {
        self.thermal.advance(to_s - self.time_s, chamber_degc);
        self.time_s = self.time_s.max(to_s);
        if let Some(jump) = &mut self.jump {
            self.jump_dps = jump.step(self.thermal.now().structure_degc);
        }
    }

    fn moment(&self, surroundings: Surroundings) -> Moment {
        let t = self.thermal.now();
        let d = &self.device;
        let on = &d.effects;
        let q = effects::quality_factor(on, d.drive.q, t.structure_degc, d.drive.reference_k);
        let since_start_s = self.time_s - self.profile.first().time_s;
        let instant = Instant {
            time_s: self.time_s,
            power_on_s: since_start_s,
            structure_degc: t.structure_degc,
            electronics_degc: t.electronics_degc,
            structure_k_per_s: t.structure_k_per_s,
            lagged_degc: t.lagged_degc,
            phase_rad: d.structural_phase_rad(t.structure_degc)
                + d.electronics_phase_rad(t.electronics_degc),
            inverse_q: d.drive.q / q - 1.0,
            quadrature_dps: self.quadrature_dps,
            rate_dps: surroundings.rate_dps,
            supply_v: surroundings.supply_v,
            accel_g: surroundings.accel_g,
        };
        let rate = effects::rate_dps(on, &instant);
        let bias = effects::bias_dps(on, &instant) + self.jump_dps;
        // The limit is on the total; what it takes away is a bias.
        let total = rate + d.bias_at_phase_dps(instant.phase_rad) + bias;
        let limited = effects::limit_dps(on, total) - total;
        let slow = self.slow.at((since_start_s / SLOW_STEP_S).round() as u64);
        let above_k = t.structure_degc + ZERO_CELSIUS_K - d.drive.reference_k;
        let conditions = Conditions {
            temperatures: t,
            rate_dps: rate,
            extra_bias_dps: bias + limited + slow,
            drive_q: q,
            softening: effects::stiffness_extra(on, above_k),
        };
        Moment {
            time_s: self.time_s,
            temperatures: t,
            surroundings,
            conditions,
        }
    }
}
