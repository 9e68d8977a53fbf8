//! What acts on the gyro over time: the chamber through the thermal network, table, supply,
//! acceleration, effects and slow noise.

use crate::design::Design;
use crate::plant::gyroscope::Conditions;
use crate::plant::profile::{Profile, Surroundings};
use crate::plant::thermal::Thermal;
use crate::plant::{Device, Temperatures};

/// Walks along a profile.
#[derive(Debug, Clone)]
pub struct World {
    device: Device,
    profile: Profile,
    thermal: Thermal,
    time_s: f64,
    drive_q: f64,
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
    /// At the profile's start, in thermal equilibrium.
    pub fn new(design: &Design, profile: Profile) -> Self {
        let first = profile.first();
        World {
            device: Device::new(&design.gyro),
            thermal: Thermal::in_equilibrium(&design.gyro.thermal, 60.0, first.chamber_degc),
            time_s: first.time_s,
            drive_q: design.gyro.drive_q,
            profile,
        }
    }

    /// Goes on to a time, s, not before the one reached so far.
    pub fn advance_to(&mut self, time_s: f64) -> Moment {
        let corners = self.profile.corners_between(self.time_s, time_s);
        for corner in corners {
            self.thermal
                .advance(corner.time_s - self.time_s, corner.chamber_degc);
            self.time_s = corner.time_s;
        }
        let surroundings = self.profile.at(time_s);
        self.thermal
            .advance(time_s - self.time_s, surroundings.chamber_degc);
        self.time_s = self.time_s.max(time_s);
        self.moment(surroundings)
    }

    fn moment(&self, surroundings: Surroundings) -> Moment {
        let temperatures = self.thermal.now();
        let conditions = Conditions {
            temperatures,
            rate_dps: surroundings.rate_dps,
            extra_bias_dps: self.device.effects_dps(temperatures.structure_degc),
            phase_pull_rad: 0.0,
            drive_q: self.drive_q,
            softening: 0.0,
        };
        Moment {
            time_s: self.time_s,
            temperatures,
            surroundings,
            conditions,
        }
    }
}
