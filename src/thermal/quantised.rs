//! A thermometer that is read in coarse steps: its course between the steps.
//!
//! A declared bias that is steep in the thermometer turns the rounding of a reading into an error of the output:
//! sawteeth in temperature, which stand still in a dwell and run with a ramp, so that a dozen effects of heat
//! resemble them. The circuit predicts them from its word lengths (half a step times the slope of the bias); where
//! they matter they are taken out before a physical cause is looked for. The temperature itself is smooth, so it is
//! the smoothest course that stays within the cell of every reading.

use super::channels::Channels;
use super::search::declared_by;
use super::staircase::Staircase;
use crate::design::Design;
use crate::statistics::smooth::averaged;
use crate::statistics::stats;
use std::f64::consts::TAU;

/// A thermometer's course between its steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// One step, in the reading's unit.
    pub step: f64,
    /// The course, one value a row, in the reading's unit.
    pub reading: Vec<f64>,
    /// What rounding makes of the declared bias, rms, deg/s.
    pub artefact_rms_dps: f64,
}

/// Fewest different readings, and rows for each, that show a step.
const LEAST_LEVELS: usize = 8;
const ROWS_A_LEVEL: usize = 3;

/// Rounding matters from this share of the output's noise on: below, it adds two percent of it or less.
const MATTERS: f64 = 0.2;

/// A step over the predicted one that is the same.
pub const LIKE: std::ops::Range<f64> = 0.4..2.5;

/// Turns of the alternation between smooth and within the cells.
const TURNS: usize = 150;

/// The course of a record's thermometer, if rounding matters there.
pub fn course(c: &Channels, design: &Design) -> Option<Course> {
    let raw = raw(c);
    let step = step_of(&raw)?;
    let reading = smoothest(&raw, &cells(c, design, &raw, step));
    let u: Vec<f64> = reading.iter().map(|r| (r - c.centre) / c.half).collect();
    let (_, rounded) = declared_by(&c.u, &c.error_dps);
    let (bias, smooth) = declared_by(&u, &c.error_dps);
    let artefact: Vec<f64> = (c.u.iter().zip(&u).zip(&c.error_dps))
        .filter(|(_, e)| e.is_finite())
        .map(|((rounded, u), _)| bias.at(*rounded) - bias.at(*u))
        .collect();
    let artefact_rms_dps = stats::rms(&artefact);
    let matters = artefact_rms_dps > MATTERS * stats::difference_noise(&smooth);
    // Noise of more than a step leads from cell to cell, and is no rounding: a mean over rows follows the temperature then.
    let (_, mean) = declared_by(&averaged(&c.time_s, &c.u), &c.error_dps);
    let others = stats::rms(&rounded).min(stats::rms(&mean));
    (matters && stats::rms(&smooth) < others).then_some(Course {
        step,
        reading,
        artefact_rms_dps,
    })
}

/// The thermometer's readings, in its unit.
fn raw(c: &Channels) -> Vec<f64> {
    c.u.iter().map(|u| c.centre + c.half * u).collect()
}

/// One step of a thermometer that is read in coarse steps, in u; 0 for others.
pub fn step_u(c: &Channels) -> f64 {
    step_of(&raw(c)).map_or(0.0, |step| step / c.half)
}

/// The step that a design's circuit predicts for a thermometer that it reads itself, in the reading's unit: the phase
/// word's LSB, or the last micro-rotation of the CORDIC if that is coarser (Volder 1959).
pub fn predicted(design: &Design, thermometer: &str) -> Option<f64> {
    if thermometer != "phase_rad" {
        return None;
    }
    let cordic = &design.circuit.cordic;
    let lsb = TAU * 2f64.powi(-(cordic.angle_bits as i32));
    let last = 2.0 * 2f64.powi(1 - cordic.iterations as i32).atan();
    Some(lsb.max(last))
}

/// What each reading may stand for: of a phase that the design's circuit reads in such steps, what its CORDIC makes
/// the same word of; else half a step to each side.
fn cells(c: &Channels, design: &Design, raw: &[f64], step: f64) -> Vec<(f64, f64)> {
    let circuit_s = predicted(design, &c.thermometer).filter(|p| LIKE.contains(&(step / p)));
    let stairs = circuit_s.and_then(|_| {
        let (low, high) = (
            c.centre - c.half - 2.0 * step,
            c.centre + c.half + 2.0 * step,
        );
        Staircase::new(design, low, high, step)
    });
    let cell = |r: &f64| {
        let own = stairs.as_ref().and_then(|s| s.cell(*r));
        own.unwrap_or((r - 0.5 * step, r + 0.5 * step))
    };
    raw.iter().map(cell).collect()
}

/// Share of the rows that move by one step from which on it is a ramp's own, and no rounding.
const EVENLY: f64 = 0.9;

/// The step of readings that take few values, evenly spaced; `None` for others.
fn step_of(readings: &[f64]) -> Option<f64> {
    let mut levels = readings.to_vec();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    if levels.len() < LEAST_LEVELS || levels.len() * ROWS_A_LEVEL > readings.len() {
        return None;
    }
    let step = stats::even_step(&levels)?;
    let as_one = readings.windows(2).map(|w| (w[1] - w[0]).abs());
    let as_one = as_one.filter(|d| (d - step).abs() < 0.05 * step).count();
    (as_one as f64 <= EVENLY * readings.len() as f64).then_some(step)
}

/// The course with the least sum of squared second differences within the cell of every reading, by alternating
/// directions (Boyd et al. 2011, 5.2): a quadratic's minimum, and the nearest values within the cells, by turns.
fn smoothest(readings: &[f64], cells: &[(f64, f64)]) -> Vec<f64> {
    let n = readings.len();
    let moves = readings.windows(2).filter(|w| w[0] != w[1]).count();
    // A quadratic with this weight follows what lasts longer than two steps.
    let rows_a_step = n as f64 / (moves + 1) as f64;
    let weight = (2.0 * rows_a_step).powi(-4);
    let factor = Factor::new(n, weight);
    let mut course = readings.to_vec();
    let mut within = readings.to_vec();
    let mut lag = vec![0.0; n];
    for _ in 0..TURNS {
        let target = within.iter().zip(&lag).map(|(z, u)| weight * (z - u));
        course = factor.solve(target.collect());
        for i in 0..n {
            let free = course[i] + lag[i];
            within[i] = free.max(cells[i].0).min(cells[i].1);
            lag[i] = free - within[i];
        }
    }
    course
}

/// D' D + weight for second differences D, as L diag L' with two subdiagonals.
struct Factor {
    diagonal: Vec<f64>,
    below: Vec<f64>,
    second: Vec<f64>,
}

impl Factor {
    fn new(n: usize, weight: f64) -> Self {
        // The band of D' D, from the n - 2 rows (1, -2, 1).
        let (mut a, mut b, mut c) = (vec![weight; n], vec![0.0; n], vec![0.0; n]);
        for i in 0..n.saturating_sub(2) {
            for (k, d) in [1.0, 4.0, 1.0].into_iter().enumerate() {
                a[i + k] += d;
            }
            b[i] -= 2.0;
            b[i + 1] -= 2.0;
            c[i] += 1.0;
        }
        let mut out = Factor {
            diagonal: Vec::with_capacity(n),
            below: Vec::with_capacity(n),
            second: Vec::with_capacity(n),
        };
        // Row i: l1 stands at (i, i-1), l2 at (i, i-2).
        for i in 0..n {
            let l2 = if i >= 2 {
                c[i - 2] / out.diagonal[i - 2]
            } else {
                0.0
            };
            let mut l1 = 0.0;
            if i >= 1 {
                let mixed = if i >= 2 {
                    l2 * out.diagonal[i - 2] * out.below[i - 1]
                } else {
                    0.0
                };
                l1 = (b[i - 1] - mixed) / out.diagonal[i - 1];
            }
            let mut d = a[i];
            if i >= 1 {
                d -= l1 * l1 * out.diagonal[i - 1];
            }
            if i >= 2 {
                d -= l2 * l2 * out.diagonal[i - 2];
            }
            out.diagonal.push(d);
            out.below.push(l1);
            out.second.push(l2);
        }
        out
    }

    fn solve(&self, mut x: Vec<f64>) -> Vec<f64> {
        let n = x.len();
        for i in 0..n {
            if i >= 1 {
                x[i] -= self.below[i] * x[i - 1];
            }
            if i >= 2 {
                x[i] -= self.second[i] * x[i - 2];
            }
        }
        for (x, d) in x.iter_mut().zip(&self.diagonal) {
            *x /= d;
        }
        for i in (0..n).rev() {
            if i + 1 < n {
                x[i] -= self.below[i + 1] * x[i + 1];
            }
            if i + 2 < n {
                x[i] -= self.second[i + 2] * x[i + 2];
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::random::Stream;

    #[test]
    fn the_band_solves_what_the_dense_matrix_does() {
        let (n, weight) = (9, 0.03);
        let mut dense = nalgebra::DMatrix::identity(n, n) * weight;
        for i in 0..n - 2 {
            let mut d = nalgebra::DVector::zeros(n);
            (d[i], d[i + 1], d[i + 2]) = (1.0, -2.0, 1.0);
            dense += &d * d.transpose();
        }
        let right = Stream::new(5, 0).normals(n);
        let want = dense
            .lu()
            .solve(&nalgebra::DVector::from_column_slice(&right))
            .unwrap();
        for (x, want) in Factor::new(n, weight).solve(right).iter().zip(&want) {
            assert!((x - want).abs() < 1e-9, "{x} {want}");
        }
    }

    /// A slow course, rounded to steps, comes back to a third of what rounding is.
    #[test]
    fn a_course_is_found_between_its_steps() {
        for (rows, cycles) in [(600, 1.5), (1500, 2.0), (900, 0.4)] {
            let truth: Vec<f64> = (0..rows)
                .map(|i| {
                    let at = f64::from(i) / f64::from(rows);
                    20.0 * (TAU * cycles * at).sin() + 6.0 * at
                })
                .collect();
            let rounded: Vec<f64> = truth.iter().map(|t| t.round()).collect();
            assert_eq!(step_of(&rounded), Some(1.0));
            let cells: Vec<(f64, f64)> = rounded.iter().map(|r| (r - 0.5, r + 0.5)).collect();
            let found = smoothest(&rounded, &cells);
            let error = |of: &[f64]| {
                let pairs = of.iter().zip(&truth);
                stats::rms(&pairs.map(|(a, b)| a - b).collect::<Vec<_>>())
            };
            assert!(error(&rounded) > 0.25);
            assert!(error(&found) < 0.1, "{rows} {cycles}: {}", error(&found));
        }
    }

    /// A bias that is steep in a thermometer of 1 K steps: its sawteeth are seen and taken out, unless noise hides them.
    #[test]
    fn sawteeth_matter_where_they_exceed_a_fifth_of_the_noise() {
        let design = crate::design::reader::read(None).unwrap();
        let rows = 900;
        let truth: Vec<f64> = (0..rows)
            .map(|i| 30.0 + 20.0 * (TAU * 1.5 * f64::from(i) / f64::from(rows)).sin())
            .collect();
        let noise = Stream::new(2, 0).normals(rows as usize);
        let seen = |noise_dps: f64| {
            let pairs = truth.iter().zip(&noise);
            let rate: Vec<f64> = pairs
                .map(|(t, n)| 3.0 - 0.2 * t + 1e-3 * t * t + noise_dps * n)
                .collect();
            let columns = std::collections::BTreeMap::from([
                ("rate_out_dps".to_owned(), rate),
                (
                    "die_degc".to_owned(),
                    truth.iter().map(|t| t.round()).collect(),
                ),
            ]);
            let time_s: Vec<f64> = (0..rows).map(|i| 10.0 * f64::from(i)).collect();
            let mut c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
            // A row without a rate counts nowhere.
            c.error_dps[100] = f64::NAN;
            course(&c, &design)
        };
        let found = seen(0.02).unwrap();
        assert_eq!(found.step, 1.0);
        let error: Vec<f64> = (found.reading.iter().zip(&truth))
            .map(|(r, t)| r - t)
            .collect();
        assert!(stats::rms(&error) < 0.1, "{}", stats::rms(&error));
        // The slope is 0.14 rms, a reading is off by 0.29 rms.
        let artefact = found.artefact_rms_dps;
        assert!((0.03..0.055).contains(&artefact), "{artefact}");
        assert!(seen(0.12).is_some());
        assert!(seen(0.5).is_none());
    }

    #[test]
    fn noise_of_a_step_is_no_rounding() {
        let design = crate::design::reader::read(None).unwrap();
        let rows = 1500;
        let [noise, reading] = [3, 4].map(|k| Stream::new(k, 0).normals(rows));
        let seen = |noise_k: f64| {
            let degc = |i: usize| 30.0 + 20.0 * (TAU * 1.5 * i as f64 / rows as f64).sin();
            let rate = |i: usize| 3.0 - 0.2 * degc(i) + 0.02 * noise[i];
            let read = |i: usize| (degc(i) + noise_k * reading[i]).round();
            let columns = std::collections::BTreeMap::from([
                ("rate_out_dps".to_owned(), (0..rows).map(rate).collect()),
                ("die_degc".to_owned(), (0..rows).map(read).collect()),
            ]);
            let time_s: Vec<f64> = (0..rows).map(|i| 10.0 * i as f64).collect();
            course(
                &Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap(),
                &design,
            )
        };
        assert!(seen(0.0).is_some());
        assert!(seen(1.0).is_none());
    }

    #[test]
    fn fine_readings_have_no_steps() {
        let noise = Stream::new(9, 0).normals(600);
        assert_eq!(step_of(&noise), None);
        // Printed with two decimals: more levels than rows could show.
        let printed: Vec<f64> = noise.iter().map(|v| (v * 1000.0).round() / 100.0).collect();
        assert_eq!(step_of(&printed), None);
        assert_eq!(step_of(&[1.0; 50]), None);
        // A chamber's even ramps, without noise; and the same rounded to what it does in three rows.
        let ramps: Vec<f64> = (0..600).map(|k| 0.4 * f64::from(k % 75)).collect();
        assert_eq!(step_of(&ramps), None);
        let rounded: Vec<f64> = ramps.iter().map(|v| (v / 1.2).round() * 1.2).collect();
        assert!(step_of(&rounded).is_some_and(|s| (s - 1.2).abs() < 1e-9));
    }
}
