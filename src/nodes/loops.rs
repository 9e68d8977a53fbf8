//! How far the two oscillators can come apart in a closed phase loop.
//!
//! On a captured tone the phase loop is closed: the oscillator turns until the measured phase has its
//! setpoint. Fixed and float chain each follow the tone by themselves, so a bound that adds up over
//! time says nothing; what holds them together is the loop itself. In turns, with x the fixed and f the
//! float chain, row k, sample n in the row:
//!
//! - eps(n) = theta_x - theta_f, the oscillators' difference; e_k its value at the end of row k
//! - dphi_k = phi_x - phi_f, the measured phases' difference (modulo 1, short way)
//! - s_k = s_(k-1) + dphi_k, the integrals' difference
//! - tau_k = Kp dphi_k + Ki s_k + F_k, the tuning words' difference, turns a sample; F_k: the floor shifts
//! - e_(k+1) = e_k + R tau_k
//!
//! **Measurement.** The float chain at the fixed chain's oscillator phase would measure phi*; |phi_x - phi*| <=
//! b_k is what the CORDIC's bound says of one row (quantisation alone). Let w_j be the decimator's terms, V their
//! sum: V* = sum w_j exp(-2 pi i eps_j). A common part eps_r of eps turns V exactly by -eps_r. Of the rest eta_j =
//! eps_j - eps_r the phase has -sum a_j eta_j with a_j = Re(w_j / V), whose sum is 1, and
//! a remainder. With G = sum |w_j| / |V|, h the decimator's normalised taps and |eta_j| <= eta:
//!
//! dphi_k = -sum h_j eps_j + D_k,
//! |D_k| <= b_k + (1 + G) eta + G (2 pi eta)^2 / (4 pi) + (G 2 pi eta (1 + pi eta))^2 / (2 pi)
//!
//! as |arg(1 + z) - Im z| <= |z|^2 for |z| <= 1/2. eta is half of what eps can change over the decimator's
//! window: R (N M + 1) max |tau| / 2. eps is linear within a row, so sum h_j eps_j = sum c_i e_(k-i).
//!
//! **Loop.** That is a linear system with inputs D_k and F_k. It is simulated from each unit state for J rows, until the
//! norm of A^J is below 1e-4; if that is not reached the loop does not contract. The peak of an output is at
//! most the sum of the absolute impulse response (peak gain) times the peak of the input; of the rows before the last
//! J only the rest of that sum counts, so what the start-up added is forgotten. As D_k needs |tau| of earlier rows only,
//! the bounds follow row by row, and hold without iteration.
//!
//! **Lost.** If D_k reaches a quarter turn (no signal), the phases lie on both sides of the setpoint's cut, or
//! the integral wraps, nothing is known from then on: the bounds are the wrap's range, half a turn.

use crate::design::Design;
use crate::numeric::lane::Lane;
use crate::numeric::paired::{Pair, exp2i};
use std::f64::consts::PI;

/// Rows after which a loop is called not contracting.
const MOST_ROWS: usize = 1 << 16;
/// Norm of A^J.
const CONTRACTED: f64 = 1e-4;

/// Peak gains from one input to (e, s, tau): over the last J rows, and over all before them.
#[derive(Debug, Clone, Copy, Default)]
struct Gains {
    recent: [f64; 3],
    rest: [f64; 3],
}

/// Bounds on the differences, row by row.
#[derive(Debug, Clone)]
pub struct PhaseLoopBound {
    gains: Option<(Gains, Gains)>,
    /// J.
    settling_rows: u64,
    ratio: f64,
    /// N M + 1.
    window_rows: usize,
    setpoint_turns: f64,
    /// The integral acts on the tuning word.
    integrates: bool,
    /// A turn in counts of the phase error.
    counts: f64,
    /// F, turns a sample.
    floors: f64,
    /// gain of the decimator * amplitude of the carrier * LSB of a code.
    gross: f64,
    peak_code: f64,
    rows: u64,
    /// Greatest D in the bucket of J rows at hand, in the one before, and at all.
    disturbance: [f64; 3],
    /// Bounds of (e, s, tau).
    bounds: [f64; 3],
    /// The last rows' bounds of tau.
    tunings: Vec<f64>,
    lost_at: Option<u64>,
    /// Greatest bounds while not lost.
    peak: [f64; 3],
}

impl PhaseLoopBound {
    /// `None` for a design without a phase loop.
    pub fn new(design: &Design) -> Option<Self> {
        let circuit = &design.circuit;
        let l = circuit.phase_loop.as_ref()?;
        let d = &circuit.decimator;
        let word = exp2i(circuit.cordic.angle_bits as i32 - circuit.nco.phase_bits as i32);
        let gain = |g: crate::design::LoopGain| g.raw as f64 * exp2i(-(g.shift as i32)) * word;
        let dropped = [l.proportional, l.integral];
        let floors = dropped.iter().filter(|g| g.shift > 0 && g.raw != 0).count();
        let taps = row_taps(d.stages, d.ratio as usize, d.differential_delay as usize);
        let model = Linear {
            taps,
            proportional: gain(l.proportional),
            integral: gain(l.integral),
            ratio: f64::from(d.ratio),
        };
        let gains = model.gains();
        let table = circuit.nco.table;
        let fir = f64::from(d.ratio * d.differential_delay).powi(d.stages as i32);
        Some(PhaseLoopBound {
            settling_rows: gains.as_ref().map_or(0, |g| g.2 as u64),
            gains: gains.map(|(d, f, _)| (d, f)),
            ratio: f64::from(d.ratio),
            window_rows: (d.stages * d.differential_delay) as usize + 1,
            setpoint_turns: l.setpoint_raw as f64 * exp2i(-(circuit.cordic.angle_bits as i32)),
            integrates: l.integral.raw != 0,
            counts: exp2i(circuit.cordic.angle_bits as i32),
            floors: floors as f64 * exp2i(-(circuit.nco.phase_bits as i32)),
            gross: fir
                * exp2i(-(d.gain_bits() as i32))
                * exp2i(table.integer_bits as i32 - 1)
                * circuit.adc.format.lsb(),
            peak_code: 0.0,
            rows: 0,
            disturbance: [0.0; 3],
            bounds: [0.0; 3],
            tunings: Vec::new(),
            lost_at: None,
            peak: [0.0; 3],
        })
    }

    /// True if the linear loop is stable and settles in `MOST_ROWS`.
    pub fn is_contracting(&self) -> bool {
        self.gains.is_some()
    }

    /// J.
    pub fn settling_rows(&self) -> u64 {
        self.settling_rows
    }

    /// The ADC sample from which nothing is known.
    pub fn lost_at(&self) -> Option<u64> {
        self.lost_at
    }

    /// The largest |drive code| of what comes next.
    pub fn drive_peak(&mut self, code: f64) {
        self.peak_code = self.peak_code.max(code);
    }

    /// Nothing is known from now on.
    pub fn lose(&mut self, sample: u64) {
        self.lost_at.get_or_insert(sample);
    }

    fn is_lost(&self) -> bool {
        self.lost_at.is_some()
    }

    /// Bound on eps until the next row, turns.
    #[inline(always)]
    pub fn phase_turns(&self) -> f64 {
        if self.is_lost() {
            0.5
        } else {
            self.bounds[0].min(0.5)
        }
    }

    /// Bound on the integrals' difference, counts.
    pub fn integral_counts(&self) -> f64 {
        // Without gain the integral drives nothing, and nothing holds it.
        if self.is_lost() || !self.integrates {
            f64::INFINITY
        } else {
            self.bounds[1] * self.counts
        }
    }

    /// Bound on tau until the next row, turns a sample.
    pub fn tuning_turns(&self) -> f64 {
        if self.is_lost() {
            0.5
        } else {
            self.bounds[2].min(0.5)
        }
    }

    /// A row was measured: its phase (`bound` is b_k), and the least length of its vector. Gives the bound on the
    /// phases' difference, turns, and sets the bounds until the next row.
    pub fn row<W: Lane>(&mut self, phase: &Pair<W>, length: f64, sample: u64) -> f64 {
        let tuning = self.tunings.iter().copied().fold(0.0, f64::max);
        let eta = self.ratio * self.window_rows as f64 * tuning / 2.0;
        let gross = self.gross * self.peak_code / length.max(f64::MIN_POSITIVE);
        let (x, turned) = (2.0 * PI * eta, gross * 2.0 * PI * eta * (1.0 + PI * eta));
        let second = (gross * x * x / 2.0 + turned * turned) / (2.0 * PI);
        // The float chain's own rounding is far below 2^-44 turn.
        let d = phase.bound + (1.0 + gross) * eta + second + exp2i(-44);
        let Some((from_phase, from_floors)) = self.gains else {
            self.lose(sample);
            return 0.5;
        };
        // A vector that may be zero has no direction; `!` so that a NaN is lost.
        if !(d < 0.25 && turned <= 0.5) || self.is_cut(phase) {
            self.lose(sample);
        }
        if self.is_lost() {
            return 0.5;
        }
        let before = self.bounds[0];
        self.remember(d);
        let recent = self.disturbance[0].max(self.disturbance[1]);
        for k in 0..3 {
            self.bounds[k] = from_phase.recent[k] * recent
                + from_phase.rest[k] * self.disturbance[2]
                + (from_floors.recent[k] + from_floors.rest[k]) * self.floors;
            self.peak[k] = self.peak[k].max(self.bounds[k]);
        }
        if self.tunings.len() >= self.window_rows {
            self.tunings.remove(0);
        }
        self.tunings.push(self.bounds[2]);
        // eps from here to the next row's end lies between two ends.
        self.bounds[0] = self.bounds[0].max(before.min(self.peak[0]));
        (before.max(self.bounds[0]) + d).min(0.5)
    }

    fn remember(&mut self, d: f64) {
        if self.settling_rows > 0 && self.rows.is_multiple_of(self.settling_rows) {
            self.disturbance[1] = self.disturbance[0];
            self.disturbance[0] = 0.0;
        }
        self.rows += 1;
        self.disturbance[0] = self.disturbance[0].max(d);
        self.disturbance[2] = self.disturbance[2].max(d);
    }

    /// Fixed and float error are wrapped to different ends.
    fn is_cut<W: Lane>(&self, phase: &Pair<W>) -> bool {
        let wrapped = |turns: f64| {
            let off = turns - self.setpoint_turns;
            off - (off + 0.5).floor()
        };
        (wrapped(phase.value()) - wrapped(phase.real)).abs() > 0.5
    }
}

/// c_i: the decimator's normalised taps, gathered at the rows' ends.
fn row_taps(stages: u32, ratio: usize, delay: usize) -> Vec<f64> {
    let mut taps = vec![1.0];
    let width = ratio * delay;
    for _ in 0..stages {
        // A moving sum over `width`.
        let mut next = vec![0.0; taps.len() + width - 1];
        let mut sum = 0.0;
        for (k, tap) in next.iter_mut().enumerate() {
            sum += taps.get(k).copied().unwrap_or(0.0);
            *tap = sum / width as f64;
            if k + 1 >= width {
                sum -= taps.get(k + 1 - width).copied().unwrap_or(0.0);
            }
        }
        taps = next;
    }
    let mut rows = vec![0.0; stages as usize * delay + 2];
    for (age, tap) in taps.iter().enumerate() {
        let part = (age % ratio) as f64 / ratio as f64;
        let shares = [(age / ratio, 1.0 - part), (age / ratio + 1, part)];
        for (row, share) in shares {
            if let Some(c) = rows.get_mut(row) {
                *c += tap * share;
            }
        }
    }
    rows
}

/// The linear loop.
#[derive(Debug, Clone)]
struct Linear {
    taps: Vec<f64>,
    proportional: f64,
    integral: f64,
    ratio: f64,
}

/// (e_k, e_(k-1), ..., s_(k-1)).
#[derive(Debug, Clone)]
struct LinearState {
    ends: Vec<f64>,
    integral: f64,
}

impl Linear {
    fn start(&self) -> LinearState {
        LinearState {
            ends: vec![0.0; self.taps.len()],
            integral: 0.0,
        }
    }

    /// One row; gives (e at its end, s, tau).
    fn step(&self, state: &mut LinearState, disturbance: f64, floors: f64) -> [f64; 3] {
        let measured: f64 = self.taps.iter().zip(&state.ends).map(|(c, e)| c * e).sum();
        let phase = disturbance - measured;
        // Without integral gain the integral is no part of the loop, and of no bound.
        if self.integral != 0.0 {
            state.integral += phase;
        }
        let tuning = self.proportional * phase + self.integral * state.integral + floors;
        let end = state.ends.first().copied().unwrap_or(0.0) + self.ratio * tuning;
        state.ends.rotate_right(1);
        if let Some(first) = state.ends.first_mut() {
            *first = end;
        }
        [end, state.integral, tuning]
    }

    /// The weight that makes the integral's size that of the ends.
    fn integral_scale(&self) -> f64 {
        let weight = (self.ratio * self.integral).abs().sqrt();
        if weight > 0.0 { weight } else { 1.0 }
    }

    /// Gains from D and from F, and J; `None` if the loop does not contract.
    fn gains(&self) -> Option<(Gains, Gains, usize)> {
        if self.proportional == 0.0 && self.integral == 0.0 {
            return Some((Gains::default(), Gains::default(), 1));
        }
        let scale = self.integral_scale();
        let mut units: Vec<LinearState> = Vec::new();
        for k in 0..self.taps.len() {
            let mut unit = self.start();
            if let Some(end) = unit.ends.get_mut(k) {
                *end = 1.0;
            }
            units.push(unit);
        }
        if self.integral != 0.0 {
            let mut unit = self.start();
            unit.integral = 1.0 / scale;
            units.push(unit);
        }
        // Sums over rows and units of |output|: the norm of what a state of norm 1 can still do.
        let mut from_state = [0.0; 3];
        for row in 1..=MOST_ROWS {
            for unit in &mut units {
                let outputs = self.step(unit, 0.0, 0.0);
                for (sum, y) in from_state.iter_mut().zip(outputs) {
                    *sum += y.abs();
                }
            }
            let norm = norm(&units, scale);
            if norm > 1e9 {
                return None;
            }
            if norm < CONTRACTED {
                let phase = self.impulse(row, from_state, norm, [1.0, 0.0], scale);
                let floors = self.impulse(row, from_state, norm, [0.0, 1.0], scale);
                return Some((phase, floors, row));
            }
        }
        None
    }

    /// Peak gains of the impulse [disturbance, floors].
    fn impulse(
        &self,
        rows: usize,
        from_state: [f64; 3],
        norm: f64,
        [disturbance, floors]: [f64; 2],
        scale: f64,
    ) -> Gains {
        let mut state = self.start();
        let mut gains = Gains {
            recent: self.step(&mut state, disturbance, floors).map(f64::abs),
            rest: [0.0; 3],
        };
        for _ in 1..rows {
            for (sum, y) in gains.recent.iter_mut().zip(self.step(&mut state, 0.0, 0.0)) {
                *sum += y.abs();
            }
        }
        // What is left of the impulse, times all that it can still do.
        let left = size(&state, scale) / (1.0 - norm);
        gains.rest = from_state.map(|sum| sum * left);
        gains
    }
}

/// The largest component.
fn size(state: &LinearState, scale: f64) -> f64 {
    let ends = state.ends.iter().map(|e| e.abs());
    ends.fold((state.integral * scale).abs(), f64::max)
}

/// The row-sum norm of the matrix whose columns are `units`.
fn norm(units: &[LinearState], scale: f64) -> f64 {
    let states = units.first().map_or(0, |u| u.ends.len());
    let row = |k: usize| -> f64 {
        let entry = |u: &LinearState| u.ends.get(k).map_or(0.0, |e| e.abs());
        units.iter().map(entry).sum()
    };
    let integral: f64 = units.iter().map(|u| (u.integral * scale).abs()).sum();
    (0..states).map(row).fold(integral, f64::max)
}
