//! The gyro and its surroundings, row by row, without noise and without any undeclared effect.

use super::chamber::{Chamber, Clock, clock};
use super::dice::Dice;
use super::heat::{lag_runge_kutta, lag_stepwise};
use super::linear::{centred, range};
use super::programs::{self, AccelProgram, Inner, RateProgram, SupplyProgram};
use crate::rng::Rng;
use std::f64::consts::{FRAC_PI_2, TAU};

/// What is done in an experiment.
#[derive(Clone, Copy, Debug)]
pub struct Protocol {
    pub chamber: Chamber,
    pub rows: usize,
    pub row_s: f64,
    pub power_cycles: usize,
    pub rate: RateProgram,
    pub supply: SupplyProgram,
    pub accel: AccelProgram,
    /// Set point of the drive amplitude.
    pub amplitude: Inner,
    /// Damping, beyond its law of temperature.
    pub damping: Inner,
    pub quadrature: Inner,
    /// First of `phase_rad`, `freq_hz`, `die_degc`, `chamber_degc` that the record will have.
    pub thermometer: &'static str,
}

/// The drive resonator.
///
/// w_n = w_0 (1 - kappa/2 (T - T0)); driven at w_0 its phase is -atan2(w_n w_0 / Q, w_n^2 - w_0^2)
/// (Chen et al. 2004, eq. 4 and 7), to which the electronics add a slope.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    pub f0_hz: f64,
    pub q: f64,
    pub kappa_per_k: f64,
    pub electronics_rad_per_k: f64,
    /// Q = q (T/T0)^-gamma: 0.5 molecular, 0.7 viscous, more for thermoelastic damping.
    pub gamma: f64,
}

/// Reference temperature, 300 K.
pub const T0_DEGC: f64 = 26.85;

impl Drive {
    fn draw(rng: &mut Rng) -> Self {
        Self {
            f0_hz: rng.spread(1.7e3, 2.5e4),
            q: rng.between(30.0, 120.0),
            kappa_per_k: rng.between(2e-5, 7e-5),
            electronics_rad_per_k: if rng.odds(0.5) {
                -rng.between(1e-4, 6.5e-3)
            } else {
                0.0
            },
            gamma: rng.pick(&[0.0, 0.5, 0.7, 1.5, 4.0]),
        }
    }

    /// rad at `t` degC with quality factor `q`.
    pub fn phase_rad(&self, t: f64, q: f64) -> f64 {
        let w = 1.0 - 0.5 * self.kappa_per_k * (t - T0_DEGC);
        let lag = (w / q).atan2(w * w - 1.0);
        debug_assert!((lag - FRAC_PI_2).abs() < 1.6);
        -lag + self.electronics_rad_per_k * (t - T0_DEGC)
    }

    /// Hz at `t` degC.
    pub fn freq_hz(&self, t: f64) -> f64 {
        self.f0_hz * (1.0 - 0.5 * self.kappa_per_k * (t - T0_DEGC))
    }

    /// Q over its nominal value at `t` degC.
    pub fn relative_q(&self, t: f64) -> f64 {
        ((t + 273.15) / (T0_DEGC + 273.15)).powf(-self.gamma)
    }
}

/// Everything that is true of a run, one value a row of the record unless said otherwise.
pub struct World {
    pub protocol: Protocol,
    pub clock: Clock,
    /// Index into the fine grid.
    pub at: Vec<usize>,
    /// Index into the regular rows.
    pub grid: Vec<usize>,
    pub time_s: Vec<f64>,
    pub on_s: Vec<f64>,
    pub chamber_degc: Vec<f64>,
    pub die_degc: Vec<f64>,
    /// Temperature that the thermometer stands for, on the fine grid.
    pub heat_degc: Vec<f64>,
    /// The same on the rows.
    pub temp_degc: Vec<f64>,
    pub rate_dps: Vec<f64>,
    pub supply_v: Vec<f64>,
    pub accel_g: Vec<f64>,
    /// Drive amplitude, relative.
    pub amplitude: Vec<f64>,
    /// Q, relative to nominal.
    pub relative_q: Vec<f64>,
    pub agc: Vec<f64>,
    pub quad_dps: Vec<f64>,
    pub phase_rad: Vec<f64>,
    pub freq_hz: Vec<f64>,
    pub drive: Drive,
    /// The thermometer reading as the declared model means it, in its own unit.
    pub p: Vec<f64>,
    /// What effects add to the reading (`phase_rad` only).
    pub pull: Vec<f64>,
    /// Bias = k0 + k1 u + k2 u^2, deg/s, with u = (p - middle) / half.
    pub bias_dps: [f64; 3],
    pub middle: f64,
    pub half: f64,
    /// Short-term noise, deg/s (one sigma of the white part).
    pub sigma_dps: f64,
}

impl World {
    /// Runs the protocol.
    pub fn run(protocol: Protocol, rng: &mut Rng) -> Self {
        let n = protocol.rows;
        let clock = clock(
            protocol.chamber,
            n,
            protocol.row_s,
            protocol.power_cycles,
            rng,
        );
        let drive = Drive::draw(rng);
        let length_s = n as f64 * protocol.row_s;
        let tau_s = rng.spread(60.0, 400.0).min(length_s / 15.0);
        let structure = lag_runge_kutta(&clock.chamber_degc, clock.fine_s, tau_s);
        let die = lag_stepwise(&structure, clock.fine_s, 0.1 * tau_s);
        let heat = match protocol.thermometer {
            "chamber_degc" => clock.chamber_degc.clone(),
            "die_degc" => die.clone(),
            _ => structure,
        };
        let grid = present(&clock, n, rng);
        let at: Vec<usize> = grid.iter().map(|k| clock.rows[*k]).collect();
        let take = |fine: &[f64]| at.iter().map(|k| fine[*k]).collect::<Vec<f64>>();
        let pick = |rows: Vec<f64>| grid.iter().map(|k| rows[*k]).collect::<Vec<f64>>();
        let temp = take(&heat);
        let warmth = centred(&clock.rows.iter().map(|k| heat[*k]).collect::<Vec<_>>());
        let amplitude_swing = rng.between(0.05, 0.15);
        let damping_swing = rng.between(0.03, 0.15);
        let amplitude: Vec<f64> = pick(programs::inner(protocol.amplitude, n, &warmth, rng))
            .iter()
            .map(|a| 1.0 + amplitude_swing * a)
            .collect();
        let relative_q: Vec<f64> = pick(programs::inner(protocol.damping, n, &warmth, rng))
            .iter()
            .zip(&temp)
            .map(|(d, t)| drive.relative_q(*t) * (1.0 + damping_swing * d))
            .collect();
        let quad_middle = rng.sign() * rng.spread(20.0, 500.0);
        let quad_swing = quad_middle * rng.between(0.05, 0.5);
        let quad_slope = if rng.odds(0.5) {
            0.1 * quad_middle * rng.signed_unit()
        } else {
            0.0
        };
        let quad_dps = pick(programs::inner(protocol.quadrature, n, &warmth, rng))
            .iter()
            .zip(pick(warmth.clone()))
            .map(|(x, w)| quad_middle + quad_swing * x + quad_slope * w)
            .collect();
        let phase_rad: Vec<f64> = temp.iter().map(|t| drive.phase_rad(*t, drive.q)).collect();
        let freq_hz: Vec<f64> = temp.iter().map(|t| drive.freq_hz(*t)).collect();
        let p = match protocol.thermometer {
            "phase_rad" => phase_rad.clone(),
            "freq_hz" => freq_hz.clone(),
            _ => temp.clone(),
        };
        let (low, high) = range(&p);
        let drift = rng.spread(2.0, 80.0)
            * if protocol.chamber == Chamber::Static {
                0.02
            } else {
                1.0
            };
        let bias_dps = [
            rng.between(-60.0, 60.0),
            rng.sign() * drift,
            rng.between(-0.45, 0.45) * drift,
        ];
        Self {
            time_s: at.iter().map(|k| *k as f64 * clock.fine_s).collect(),
            on_s: take(&clock.on_s),
            chamber_degc: take(&clock.chamber_degc),
            die_degc: take(&die),
            heat_degc: heat,
            temp_degc: temp,
            rate_dps: pick(programs::rate(protocol.rate, n, rng)),
            supply_v: pick(programs::supply(protocol.supply, n, rng)),
            accel_g: pick(programs::accel(protocol.accel, n, rng)),
            agc: amplitude
                .iter()
                .zip(&relative_q)
                .map(|(a, q)| a / q)
                .collect(),
            amplitude,
            relative_q,
            quad_dps,
            phase_rad,
            freq_hz,
            drive,
            pull: vec![0.0; p.len()],
            middle: 0.5 * (low + high),
            half: (0.5 * (high - low)).max(1e-12),
            p,
            bias_dps,
            sigma_dps: rng.spread(0.005, 0.3),
            protocol,
            clock,
            at,
            grid,
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Declared bias at thermometer reading `p`, deg/s.
    pub fn bias_at(&self, p: f64) -> f64 {
        let u = (p - self.middle) / self.half;
        self.bias_dps[0] + u * (self.bias_dps[1] + u * self.bias_dps[2])
    }

    /// Largest slope of the declared bias, deg/s per unit of the reading.
    pub fn steepest(&self) -> f64 {
        (self.bias_dps[1].abs() + 2.0 * self.bias_dps[2].abs()) / self.half
    }

    /// The reading as the record has it, without read noise.
    pub fn reading(&self) -> Vec<f64> {
        super::linear::sum(&self.p, &self.pull)
    }

    /// A column of the fine grid at the rows.
    pub fn rows_of(&self, fine: &[f64]) -> Vec<f64> {
        self.at.iter().map(|k| fine[*k]).collect()
    }

    /// Length of the run, s.
    pub fn length_s(&self) -> f64 {
        self.protocol.rows as f64 * self.protocol.row_s
    }

    /// Temperature scaled to -1..1 over the run.
    pub fn warmth(&self) -> Vec<f64> {
        centred(&self.temp_degc)
    }

    /// A sine of period `period_s`, phase `lead` in turns.
    pub fn sine(&self, period_s: f64, lead: f64) -> Vec<f64> {
        let turn = |t: &f64| (TAU * (t / period_s + lead)).sin();
        self.time_s.iter().map(turn).collect()
    }
}

/// The regular rows that are there: powered, not in a gap; some twice.
fn present(clock: &Clock, n: usize, rng: &mut Rng) -> Vec<usize> {
    let mut there: Vec<bool> = clock
        .rows
        .iter()
        .map(|k| !clock.on_s[*k].is_nan())
        .collect();
    if rng.odds(0.25) {
        for _ in 0..rng.range(1, 4) {
            let start = rng.range(0, n as i64 - 1) as usize;
            let length = rng.range(1, (n as i64 / 20).max(2)) as usize;
            there
                .iter_mut()
                .skip(start)
                .take(length)
                .for_each(|t| *t = false);
        }
    }
    let twice = rng.odds(0.1);
    let mut rows = Vec::new();
    for (k, _) in there.iter().enumerate().filter(|(_, t)| **t) {
        rows.push(k);
        if twice && rng.odds(0.01) {
            rows.push(k);
        }
    }
    rows
}
