//! The declared bias by least squares, before any noise is known.

use super::judge::Judged;
use super::{Search, declared};
use crate::statistics::linear::{Basis, dot};
use crate::thermal::effects::Candidate;

/// Share of a shape's square about its mean from which on the declared model does not have it all.
const INSIDE: f64 = 0.01;

impl Search<'_> {
    /// The rows of a column that take part in the fit.
    pub(super) fn of_used(&self, column: &[f64]) -> Vec<f64> {
        let rows = column.iter().zip(&self.used).filter(|(_, u)| **u);
        rows.map(|(v, _)| *v).collect()
    }

    /// Whether the record excludes an effect from what could explain it as well as something else does: a clip shows as readings
    /// that repeat at an end of the output's range ([`crate::thermal::rails`]), and is no candidate without them.
    fn is_excluded(&self, candidate: &dyn Candidate) -> bool {
        candidate.is_last() && self.rails.is_none()
    }

    /// The same in a record at rest, where nothing drives the output to a level before its noise is added.
    pub(super) fn is_excluded_at_rest(&self, candidate: &dyn Candidate) -> bool {
        self.channels.moving("rate_dps").is_none() && self.is_excluded(candidate)
    }

    /// Whether next to all of a shape is in the declared model: what makes it goes with the temperature in this record, and
    /// what it does was taken for the temperature's doing.
    pub fn is_declared(&self, judged: &Judged) -> bool {
        if self.is_excluded(judged.candidate.as_ref()) {
            return false;
        }
        let c = self.channels;
        let of_used = |column: &Vec<f64>| self.of_used(column);
        let declared: Vec<Vec<f64>> = declared(c).iter().map(of_used).collect();
        let (constant, all) = (Basis::new(&declared[..1]), Basis::new(&declared));
        let left = |basis: &Basis, column: &[f64]| {
            let mut rest = column.to_vec();
            basis.project_off(&mut rest);
            dot(&rest, &rest)
        };
        let bias = self.plain_bias();
        let columns = judged.candidate.columns(c, &bias, &judged.point);
        let is_inside = |column: &Vec<f64>| {
            let column = of_used(column);
            left(&all, &column) < INSIDE * left(&constant, &column)
        };
        declared.len() > 1 && !columns.is_empty() && columns.iter().all(is_inside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::channels::Channels;
    use crate::thermal::effects::Point;
    use crate::thermal::search::Effort;
    use crate::thermal::synthetic::Random;
    use std::collections::BTreeMap;

    /// Whether a clip of an output that follows the temperature is said to be in the polynomial, and excluded; the readings
    /// are held at `most_dps` at most.
    fn of_clip(most_dps: f64) -> [bool; 2] {
        let phase = |k: u32| f64::from(k) / 300.0 * std::f64::consts::TAU;
        let degc: Vec<f64> = (0..600).map(|k| 25.0 + 20.0 * phase(k).sin()).collect();
        let mut random = Random::new(8);
        let output = degc.iter().map(|t| {
            let rate = 1.0 + 0.025 * (t - 25.0) + 0.01 * random.normal();
            rate.min(most_dps)
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let time_s: Vec<f64> = (0..600).map(f64::from).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let mut all = search.candidates.iter();
        let clip = all.find(|k| k.id() == "output_saturation").unwrap();
        // Two thirds of the rows beyond: but for 0.7 % of its square this shape is a parabola in the temperature.
        let judged = Judged {
            candidate: clip.clone(),
            point: Point::at(1, &[0.7]),
            gain: 0.0,
            net: 0.0,
            odds_against: 0.0,
            p_value: 1.0,
        };
        [
            search.is_declared(&judged),
            search.is_excluded_at_rest(clip.as_ref()),
        ]
    }

    #[test]
    fn a_clip_explains_nothing_where_no_readings_repeat_at_an_end() {
        assert_eq!(of_clip(f64::INFINITY), [false, true]);
        let [_, excluded] = of_clip(1.3);
        assert!(!excluded);
    }
}
