//! Terms tried on one input before they go into a plan: what firmware would take off, by its own block.

use super::Words;
use super::clock;
use crate::correction::{Correction, Input, Plan, Reading, Term};
use crate::thermal::channels::Channels;

/// An input as the firmware reads it, period by period.
pub struct Trial {
    period_s: f64,
    inputs: Vec<Input>,
    readings: Vec<Reading>,
    /// Where the record's rows are among them.
    places: Vec<usize>,
}

impl Words {
    /// For terms of the thermometer alone; `None` if firmware does not see it.
    pub fn trial(&self, c: &Channels) -> Option<Trial> {
        self.trial_of(c, self.thermometer?, &c.u)
    }

    /// For terms of the input `at` alone, whose scaled readings are given; the inputs before it stand still.
    pub fn trial_of(&self, c: &Channels, at: usize, readings: &[f64]) -> Option<Trial> {
        let inputs = self.inputs.get(..=at)?;
        let rows = readings.iter().enumerate().map(|(k, x)| {
            let mut read: Vec<f64> = inputs.iter().map(|i| i.offset).collect();
            read[at] += inputs[at].scale * x;
            Reading {
                time_s: c.time_s[k],
                time_since_power_on_s: c.on_known.then(|| c.on_s[k]),
                inputs: read,
                rate_out_dps: 0.0,
            }
        });
        // Only states that are kept see what lies between two power-ons.
        let rows: Vec<Reading> = rows.collect();
        let (mut readings, places) = clock::with_between(self.period_s, &rows, true);
        for between in &mut readings {
            between.rate_out_dps = 0.0;
        }
        Some(Trial {
            period_s: self.period_s,
            inputs: inputs.to_vec(),
            readings,
            places,
        })
    }
}

impl Trial {
    /// What these terms on the bias take off each row, deg/s: the block without quantisation, with firmware's
    /// constants in words for a rate of `full_scale_dps`. `None` if no such words carry them.
    pub fn taken_off(&self, terms: &[Term], full_scale_dps: f64) -> Option<Vec<f64>> {
        let plan = Plan {
            period_s: self.period_s,
            inputs: self.inputs.clone(),
            full_scale_dps,
            terms: terms.to_vec(),
        };
        let corrected = Correction::auto(&plan).ok()?.run_float(&self.readings);
        let of = |place: &usize| corrected.get(*place).map(|rate| -rate);
        self.places.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::effects::Bias;
    use std::collections::BTreeMap;

    const BIAS: Bias = Bias {
        coefficients_dps: Vec::new(),
        others_dps: Vec::new(),
    };

    /// Two power-ons; the phase rises by 1e-4 rad/s, rows 10 s apart but for one that the logger missed.
    fn channels() -> Channels {
        let on_s: Vec<f64> = [0.0, 10.0, 20.0, 40.0, 50.0, 0.0, 10.0, 20.0].to_vec();
        let time_s: Vec<f64> = (0..8)
            .map(|k| on_s[k] + if k < 5 { 0.0 } else { 90.0 })
            .collect();
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), vec![0.0; 8]),
            (
                "phase_rad".to_owned(),
                time_s.iter().map(|t| -1.6 + 1e-4 * t).collect(),
            ),
            ("time_since_power_on_s".to_owned(), on_s),
        ]);
        Channels::new(&time_s, &columns, "phase_rad", |p| p).unwrap()
    }

    #[test]
    fn a_slope_is_what_the_firmware_makes_of_a_straight_course() {
        let c = channels();
        let words = Words::new(&c, &BIAS, 1e-3);
        let trial = words.trial(&c).unwrap();
        // x rises by 1e-4 / half a second; over two periods the first is seen by half.
        let gain_dps_s = 300.0;
        let slope = [Term::Slope {
            gain_dps_s,
            input: 0,
            rows: 2,
        }];
        let full = gain_dps_s * 1e-4 / c.half;
        let expected = [0.0, 0.5, 1.0, 1.0, 1.0, 0.0, 0.5, 1.0].map(|share| share * full);
        let taken = trial.taken_off(&slope, 1.0).unwrap();
        assert_eq!(taken.len(), c.len());
        for (row, (a, b)) in taken.iter().zip(expected).enumerate() {
            // The last reading is held at 1 - LSB.
            assert!((a - b).abs() < 2e-3 * full, "row {row}: {a}, not {b}");
        }
    }

    #[test]
    fn what_no_words_carry_is_not_tried() {
        let c = channels();
        let trial = Words::new(&c, &BIAS, 1e-3).trial(&c).unwrap();
        let wide = [Term::Product {
            gain_dps: 1e5,
            factors: vec![(0, 1)],
        }];
        assert!(trial.taken_off(&wide, 1e-3).is_none());
        assert!(trial.taken_off(&wide, 1e3).is_some());
    }
}
