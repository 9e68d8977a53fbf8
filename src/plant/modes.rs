//! Drive and sense mode at one temperature: what a force of some frequency makes of them, and how they move.

use super::motion::Power;
use nalgebra::{Complex, Matrix2};

type C = Complex<f64>;

/// What depends on the temperature alone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Modes {
    /// w1, w2, rad/s.
    pub w: [f64; 2],
    /// w1/Q1, w2/Q2, rad/s.
    pub width: [f64; 2],
    /// The electronics' phase that the drive channel adds, rad.
    pub electronics_rad: f64,
    /// The in-phase coupling, deg/s.
    pub in_phase_dps: f64,
}

impl Modes {
    /// The drive's displacement under a unit force of frequency w, rad/s.
    pub fn drive(&self, w: f64) -> C {
        response(self.w[0], self.width[0], w)
    }

    /// The same of the sense mode.
    pub fn sense(&self, w: f64) -> C {
        response(self.w[1], self.width[1], w)
    }

    /// Both modes moved on by `h`, s, with velocities in units of `w0`, rad/s.
    pub fn moved_by(&self, h: f64, w0: f64) -> Power {
        let mode = |k: usize| {
            let (w, width) = (self.w[k], self.width[k]);
            Matrix2::new(0.0, w0, -w * w / w0, -width) * h
        };
        // The force on v' of the sense mode, by x and by u.
        let rate_of_change = Power {
            drive: mode(0),
            sense: mode(1),
            by_velocity: Matrix2::new(0.0, 0.0, 0.0, h / w0),
            by_position: Matrix2::new(0.0, 0.0, h / w0, 0.0),
        };
        rate_of_change.exp()
    }
}

/// 1 / (wn^2 - w^2 + i w width): a mode's displacement under a unit force of frequency w (eq. 5).
fn response(wn: f64, width: f64, w: f64) -> C {
    C::new(wn * wn - w * w, w * width).inv()
}
