//! What a record says of the temperature: the bias model's thermometer, the tangent of a phase, a thermometer on the die.

use super::channels::{Channels, Other, range, scaled};
use crate::statistics::smooth::smoothed;

impl Channels {
    /// A further thermometer, if the record has it and it moves.
    pub(super) fn other(&self, name: &'static str) -> Option<Other> {
        let (u, _, kelvin_per_u) = scaled(self.moving(name)?);
        Some(Other {
            name,
            smooth_u: smoothed(&self.time_s, &u),
            u,
            kelvin_per_u,
        })
    }

    pub(super) fn tangent_of_phase(&self) -> Option<Vec<f64>> {
        let resonance = self.resonance_rad();
        let reach = (self.centre - resonance).abs() + self.half;
        if self.thermometer != "phase_rad" || reach > 1.3 {
            return None;
        }
        let of = |u: &f64| (self.centre + self.half * u - resonance).tan();
        let raw: Vec<f64> = self.smooth_u.iter().map(of).collect();
        Some(scaled(&raw).0)
    }

    /// [`Channels::tangent`] as a function of u; u itself where there is none.
    pub fn tangent_at(&self, u: f64) -> f64 {
        if self.tangent.is_none() {
            return u;
        }
        let resonance = self.resonance_rad();
        let of = |u: f64| (self.centre + self.half * u - resonance).tan();
        let raw: Vec<f64> = self.smooth_u.iter().map(|u| of(*u)).collect();
        let (low, high) = range(&raw);
        (of(u) - 0.5 * (low + high)) / (0.5 * (high - low)).max(f64::MIN_POSITIVE)
    }

    /// The drive's phase at resonance (an odd multiple of a quarter turn) nearest to the middle of the
    /// range, rad.
    pub fn resonance_rad(&self) -> f64 {
        use std::f64::consts::{FRAC_PI_2, PI};
        FRAC_PI_2 + PI * ((self.centre - FRAC_PI_2) / PI).round()
    }

    /// How many readings of the temperature there are ([`Channels::heat`]).
    pub fn heats(&self) -> usize {
        1 + usize::from(self.tangent.is_some())
    }

    /// The temperature, smooth and scaled: by the reading itself (0), or by the phase's tangent (1).
    pub fn heat(&self, which: usize) -> &[f64] {
        match (&self.tangent, which) {
            (Some(tangent), 1) => tangent,
            _ => &self.smooth_u,
        }
    }

    /// How many courses of temperature there are whose history may act ([`Channels::history`]): what bends the phase, as
    /// another damping does, is no change of temperature to a thermometer on the die.
    pub fn histories(&self) -> usize {
        self.heats() + usize::from(self.die.is_some())
    }

    /// The column that [`Channels::history`] is of.
    pub fn history_of(&self, which: usize) -> &str {
        match &self.die {
            Some(die) if which >= self.heats() => die.name,
            _ => &self.thermometer,
        }
    }

    /// A course of temperature as read, the same smooth, and its kelvins per unit.
    pub fn history(&self, which: usize) -> (&[f64], &[f64], f64) {
        match (&self.die, which) {
            (Some(die), k) if k >= self.heats() => (&die.u, &die.smooth_u, die.kelvin_per_u),
            (_, 0) => (&self.u, &self.smooth_u, self.kelvin_per_u),
            (_, k) => (self.heat(k), self.heat(k), self.kelvin_per_u),
        }
    }

    /// The temperature at which the readings of [`Channels::history`] are 0, degC.
    pub fn history_zero_degc(&self, which: usize) -> f64 {
        match &self.die {
            Some(die) if which >= self.heats() => {
                self.column(die.name).map_or(f64::NAN, |c| scaled(c).1)
            }
            // A phase's tangent has its ends where the phase has them, and is linear in the temperature between them.
            _ => self.middle_degc,
        }
    }
}
