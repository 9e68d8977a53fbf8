//! The runs that a design is judged by: temperatures of the thermal run both ways, rates up to full scale, a
//! detuned oscillator. The same for every design of a study, noise included (common random numbers).

use crate::circuit::engine::ArithmeticKind;
use crate::circuit::scale::full_scale_dps;
use crate::cosim::path::Path;
use crate::cosim::readings;
use crate::design::Design;
use crate::error::Result;
use crate::numeric::format::pow2;
use crate::plant::gyroscope::Conditions;
use crate::plant::noise::{Drawn, Noise};
use crate::plant::profile::Profile;

/// What a stretch is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Role {
    /// At rest: bias, drift, noise, spurs.
    Rest,
    /// The table turns one way; the next stretch is the same the other way. deg/s, above 0.
    Rate(f64),
    /// At rest, the oscillator off the design's frequency: spurs.
    Detuned,
}

/// A run under conditions that do not change.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// What for.
    pub role: Role,
    /// Chamber, degC, and whether it was last heated.
    pub chamber_degc: f64,
    /// The chamber's last move was upward.
    pub heating: bool,
    /// What acts on the gyro.
    pub conditions: Conditions,
    /// Decimated samples.
    pub rows: usize,
    /// Of both ADC inputs, by the sample of the whole run.
    pub noise: Drawn,
}

/// How much is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Extent {
    /// Instants of the thermal run at rest.
    pub temperatures: usize,
    /// Of which so many are also run with the table turning.
    pub rates: usize,
    /// Rows of a stretch at rest.
    pub rest_rows: usize,
    /// Rows of a stretch with the table turning.
    pub rate_rows: usize,
    /// Rows with a detuned oscillator.
    pub detuned_rows: usize,
}

impl Extent {
    /// What a search runs of each design.
    pub const SEARCH: Extent = Extent {
        temperatures: 10,
        rates: 3,
        rest_rows: 96,
        rate_rows: 40,
        detuned_rows: 384,
    };
    /// What a point runs, with other noise, before it is reported.
    pub const VERIFY: Extent = Extent {
        temperatures: 26,
        rates: 8,
        rest_rows: 384,
        rate_rows: 384,
        detuned_rows: 1536,
    };
}

/// The stretches in the order in which they run.
#[derive(Debug, Clone)]
pub struct Plan {
    /// With the design's tuning word.
    pub nominal: Vec<Stretch>,
    /// With the detuned one; none where a phase loop sets the tuning word.
    pub detuned: Option<Stretch>,
    /// By how much that is off, Hz.
    pub detuned_hz: f64,
    /// The largest rate that is applied, deg/s.
    pub full_rate_dps: f64,
    /// Rows a second.
    pub row_hz: f64,
}

/// Share of the ADC's full scale that the largest rate fills.
const FILLED: f64 = 0.95;

impl Plan {
    /// The plan for a design, its noise drawn from a seed.
    ///
    /// # Errors
    /// A phase loop that cannot lock.
    pub fn new(design: &Design, extent: Extent, seed: u64) -> Result<Plan> {
        let circuit = &design.circuit;
        let row_hz = circuit.sample_rate_hz / f64::from(circuit.decimator.ratio);
        let run = &design.thermal_run;
        let reading_s = f64::from(run.samples_per_reading) / row_hz;
        let (profile, readings) = Profile::of_run(run, reading_s);
        let chosen = evenly(&readings, extent.temperatures);
        let moments = readings::moments(design, &profile, &chosen);
        let mut plan = Plan {
            nominal: Vec::new(),
            detuned: None,
            detuned_hz: detuning_hz(design, row_hz),
            full_rate_dps: 0.0,
            row_hz,
        };
        let mut at = Position::new(design, seed);
        for (reading, moment) in chosen.iter().zip(&moments) {
            plan.nominal.push(Stretch {
                role: Role::Rest,
                chamber_degc: moment.temperatures.chamber_degc,
                heating: reading.heating,
                conditions: moment.conditions,
                rows: extent.rest_rows,
                noise: at.draw(extent.rest_rows),
            });
        }
        plan.full_rate_dps = full_rate_dps(design, &plan)?;
        let mut rates = vec![run.scale_rate_dps.min(plan.full_rate_dps)];
        if plan.full_rate_dps > rates[0] {
            rates.push(plan.full_rate_dps);
        }
        let turned = evenly(&plan.nominal, extent.rates);
        for (k, rest) in turned.iter().enumerate() {
            let rate = rates[(k + 1) % rates.len()];
            for sign in [1.0, -1.0] {
                let mut conditions = rest.conditions;
                conditions.rate_dps = sign * rate;
                plan.nominal.push(Stretch {
                    role: Role::Rate(rate),
                    conditions,
                    rows: extent.rate_rows,
                    noise: at.draw(extent.rate_rows),
                    ..rest.clone()
                });
            }
        }
        if circuit.phase_loop.is_none()
            && let Some(rest) = plan.nominal.get(extent.temperatures / 2)
        {
            let mut at = Position::new(design, seed ^ 1);
            plan.detuned = Some(Stretch {
                role: Role::Detuned,
                rows: extent.detuned_rows,
                noise: at.draw(extent.detuned_rows),
                ..rest.clone()
            });
        }
        Ok(plan)
    }

    /// ADC samples of one design's run, warm starts not counted.
    pub fn samples(&self, ratio: u32) -> u64 {
        let rows: usize = self
            .nominal
            .iter()
            .chain(&self.detuned)
            .map(|s| s.rows)
            .sum();
        rows as u64 * u64::from(ratio)
    }
}

/// `count` of them, evenly from the first to the last.
fn evenly<T: Clone>(all: &[T], count: usize) -> Vec<T> {
    let last = all.len().saturating_sub(1);
    let steps = count.saturating_sub(1).max(1);
    let places = (0..count.min(all.len())).map(|k| (k * last + steps / 2) / steps);
    places.filter_map(|k| all.get(k).cloned()).collect()
}

/// Where the whole run has come to, in ADC samples and noise streams.
struct Position {
    seed: u64,
    stream: u64,
    sample: u64,
    warm: u64,
    ratio: usize,
}

impl Position {
    fn new(design: &Design, seed: u64) -> Self {
        let decimator = &design.circuit.decimator;
        let warm = decimator.stages * decimator.differential_delay;
        Position {
            seed,
            stream: 0,
            sample: 0,
            warm: u64::from(warm),
            ratio: decimator.ratio as usize,
        }
    }

    /// The noise of the next stretch, its warm start's too.
    fn draw(&mut self, rows: usize) -> Drawn {
        let rows = rows + self.warm as usize;
        let count = rows * self.ratio;
        let noise = Noise::new(self.seed, self.stream);
        let drawn = Drawn::new(&noise, self.sample, count);
        self.stream += 1;
        self.sample += count as u64;
        drawn
    }
}

/// A frequency at which a coherent oscillator's phases spread over their whole gaps within some hundred rows, Hz.
fn detuning_hz(design: &Design, row_hz: f64) -> f64 {
    // 32 phases in a row's turn: the pattern repeats after 1/32 of a turn. At row_hz / 10 000 that is 340 rows.
    let resolution_hz =
        design.circuit.sample_rate_hz * pow2(-(design.circuit.nco.phase_bits as i32));
    (row_hz / 10_937.5).max(resolution_hz)
}

/// The design with its oscillator off by `hz`.
pub fn detuned(design: &Design, hz: f64) -> Design {
    let mut out = design.clone();
    let nco = &mut out.circuit.nco;
    let steps = hz / design.circuit.sample_rate_hz * pow2(nco.phase_bits as i32);
    nco.tuning_word = nco
        .tuning_word
        .saturating_add((steps.round() as i64).max(1));
    out
}

/// The largest rate, both ways, at which the sense ADC is filled by at most [`FILLED`] at any of the plan's
/// temperatures, deg/s. A rate moves the demodulated vector along a line; both ends have to stay inside the circle.
fn full_rate_dps(design: &Design, plan: &Plan) -> Result<f64> {
    let scale = full_scale_dps(design);
    let radius = FILLED * design.thermal_run.sense_full_scale_dps;
    let probe_dps = design.thermal_run.scale_rate_dps;
    let mut path = Path::new(design, ArithmeticKind::Float);
    let mut vector = |conditions: Conditions| -> Result<[f64; 2]> {
        // Beyond the end of what was drawn there is no noise.
        let silent = Drawn::new(&Noise::new(0, 0), u64::MAX, 0);
        path.warm_start(design, conditions, &silent)?;
        let [_, _, i, q] = path.period(&silent)?.channels;
        Ok([i * scale, q * scale])
    };
    let mut least = design.thermal_run.sense_full_scale_dps;
    for stretch in &plan.nominal {
        let mut turning = stretch.conditions;
        turning.rate_dps = probe_dps;
        let ([i, q], [ti, tq]) = (vector(stretch.conditions)?, vector(turning)?);
        let (di, dq) = ((ti - i) / probe_dps, (tq - q) / probe_dps);
        // |v + R d|^2 = radius^2, the smaller of the two roots' sizes.
        let square = (di * di + dq * dq).max(1e-9);
        let across = (i * di + q * dq).abs();
        let room = radius * radius - i * i - q * q;
        let root = (across * across + square * room.max(0.0)).sqrt();
        least = least.min((root - across) / square);
    }
    Ok(least.max(0.0))
}
