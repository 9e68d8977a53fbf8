//! Does an effect hold over the whole record with one and the same gain? A law does. What only resembles it
//! (the course of a hidden channel, a walk) does so for a while.

use super::{Model, Search, Term};
use crate::statistics::linear::{Basis, add_scaled, dot};
use crate::statistics::tail::chi_square_surprise;
use crate::statistics::whiten::Whitener;

/// Stretches of equal information, each with a gain of its own.
const STRETCHES: usize = 4;

/// What gains of its own in every stretch explain beyond one gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constancy {
    /// Probability of that, were the gain one.
    pub p_value: f64,
    /// As a share of what the effect explains.
    pub share: f64,
}

impl Search<'_> {
    /// The constancy of a term of a model (Chow's test of stability over stretches, whitened; the other
    /// terms being in); `None` where physics gives the gain, or nothing is left to test.
    pub fn constancy(&self, model: &Model, term: &Term) -> Option<Constancy> {
        if term.candidate.is_whole() {
            return None;
        }
        let c = self.channels;
        let fit = &model.fit;
        let whitener = Whitener::new(&fit.problem.line, fit.at.shape);
        let columns = model.shown(term.candidate.columns(c, &model.acting, &term.point));
        let own: Vec<Vec<f64>> = columns.iter().map(|c| fit.reduce(c)).collect();
        let white = whitener.apply_all(&own);
        // All other regressors.
        let others: Vec<Vec<f64>> = fit
            .problem
            .columns
            .iter()
            .filter(|column| !own.contains(column))
            .cloned()
            .collect();
        let mut basis = Basis::new(&whitener.apply_all(&others));
        let mut y = fit.problem.y.clone();
        if term.candidate.is_sized(&term.point) {
            // The fit has taken it off.
            own.iter()
                .for_each(|column| add_scaled(&mut y, 1.0, column));
        }
        let mut rest = whitener.apply(&y);
        basis.project_off(&mut rest);
        let without = dot(&rest, &rest);
        let off = |column: &Vec<f64>| {
            let mut left = column.clone();
            basis.project_off(&mut left);
            left
        };
        let projected: Vec<Vec<f64>> = white.iter().map(off).collect();
        for column in &white {
            basis.push(column);
        }
        basis.project_off(&mut rest);
        let with = dot(&rest, &rest);
        let rank = basis.rank();
        for stretch in stretches(&projected).iter().skip(1) {
            for column in &own {
                let masked: Vec<f64> = column
                    .iter()
                    .enumerate()
                    .map(|(i, v)| if stretch.contains(&i) { *v } else { 0.0 })
                    .collect();
                let mut left = whitener.apply(&masked);
                let before = dot(&left, &left).sqrt();
                basis.project_off(&mut left);
                if dot(&left, &left).sqrt() > 1e-3 * before {
                    basis.push(&left);
                }
            }
        }
        basis.project_off(&mut rest);
        let free = dot(&rest, &rest);
        let degrees = basis.rank() - rank;
        let contrasts = whitener.used.saturating_sub(basis.rank());
        if degrees == 0 || contrasts < 10 || without <= with {
            return None;
        }
        let statistic = contrasts as f64 * (with / free.max(f64::MIN_POSITIVE)).ln();
        Some(Constancy {
            p_value: (-chi_square_surprise(degrees, statistic)).exp(),
            share: (with - free) / (without - with),
        })
    }
}

/// Ranges of rows with equal sums of squares of the columns.
fn stretches(columns: &[Vec<f64>]) -> Vec<std::ops::Range<usize>> {
    let rows = columns.first().map_or(0, Vec::len);
    let square = |i: usize| columns.iter().map(|c| c[i] * c[i]).sum::<f64>();
    let total: f64 = (0..rows).map(square).sum();
    let mut out = Vec::new();
    let (mut sum, mut from) = (0.0, 0);
    for i in 0..rows {
        sum += square(i);
        if sum * STRETCHES as f64 >= total * (out.len() + 1) as f64 && out.len() + 1 < STRETCHES {
            out.push(from..i + 1);
            from = i + 1;
        }
    }
    out.push(from..rows);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::blocks::Split;
    use crate::thermal::channels::Channels;
    use crate::thermal::effects::{Candidate, Point};
    use crate::thermal::search::Effort;
    use crate::thermal::synthetic::{Pull, Random, triangle};
    use std::collections::BTreeMap;
    use std::sync::Arc;

    const ROWS: usize = 300;

    /// Two heatings and a supply that steps; the output has the supply times `gain` of the share of the record
    /// that is over, in units of the noise.
    fn channels(seed: u64, unit_v: f64, gain: impl Fn(f64) -> f64) -> Channels {
        let mut random = Random::new(seed);
        let degc = [triangle(ROWS / 2), triangle(ROWS - ROWS / 2)].concat();
        let supply = |k: usize| f64::from(u8::from(k / 11 % 3 == 1)) + 0.5 * (k as f64 / 7.0).sin();
        let output = (0..ROWS).map(|k| {
            let u = degc[k] / 35.0 - 1.0;
            let effect = gain(k as f64 / ROWS as f64) * supply(k);
            0.3 - 0.2 * u + 0.1 * u * u + 0.01 * (effect + random.normal())
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("die_degc".to_owned(), degc.clone()),
            (
                "supply_v".to_owned(),
                (0..ROWS).map(|k| unit_v * supply(k)).collect(),
            ),
        ]);
        let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
        Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
    }

    /// Of the named effect at its first point, or at the one that is given.
    fn constancy(c: &Channels, effect: &str) -> Option<Constancy> {
        constancy_at(c, effect, None)
    }

    fn constancy_at(c: &Channels, effect: &str, point: Option<Point>) -> Option<Constancy> {
        let split: Split = c.split().unwrap();
        let effort = Effort {
            rows: ROWS,
            ..Effort::default()
        };
        let search = Search::new(c, &split, effort, Vec::new());
        let is_it = |candidate: &&Arc<dyn Candidate>| candidate.id() == effect;
        let candidate = search.candidates().iter().find(is_it).unwrap().clone();
        let point: Point = point.unwrap_or_else(|| candidate.points(c).remove(0));
        let term = Term::new(candidate, point);
        let model = search.model(std::slice::from_ref(&term)).unwrap();
        search.constancy(&model, &term)
    }

    const SUPPLY: &str = "supply_sensitivity";

    #[test]
    fn a_law_passes_as_often_as_its_probability_says() {
        let found: Vec<Constancy> = (0..240)
            .filter_map(|seed| constancy(&channels(seed, 1.0, |_| 5.0), SUPPLY))
            .collect();
        assert_eq!(found.len(), 240);
        let below = |p: f64| found.iter().filter(|f| f.p_value < p).count();
        // 240 draws of a uniform number: 12 +- 3.4, 120 +- 7.7.
        assert!(below(0.05) <= 22, "{} below 0.05", below(0.05));
        assert!((97..=143).contains(&below(0.5)), "{} below 0.5", below(0.5));
        assert!(below(1e-4) == 0 && found.iter().all(|f| (0.0..0.05).contains(&f.share)));
    }

    #[test]
    fn a_gain_that_flips_or_comes_late_is_no_law() {
        let courses: [fn(f64) -> f64; 3] = [
            |x| if x < 0.5 { 5.0 } else { -2.0 },
            |x| if x < 0.7 { 0.0 } else { 6.0 },
            |x| 10.0 * (9.0 * x).cos() + 2.0,
        ];
        for (k, course) in courses.into_iter().enumerate() {
            for seed in 0..6 {
                let found = constancy(&channels(seed, 1.0, course), SUPPLY).unwrap();
                assert!(found.p_value < 1e-7, "course {k}, {seed}: {found:?}");
                assert!(found.share > 0.2, "course {k}, {seed}: {found:?}");
            }
        }
    }

    #[test]
    fn the_unit_of_a_channel_does_not_matter() {
        let course = |x: f64| 3.0 + 2.0 * x;
        let volts = constancy(&channels(3, 1.0, course), SUPPLY).unwrap();
        let millivolts = constancy(&channels(3, 1000.0, course), SUPPLY).unwrap();
        assert!((volts.p_value / millivolts.p_value).ln().abs() < 1e-6);
        assert!((volts.share - millivolts.share).abs() < 1e-9);
    }

    #[test]
    fn the_share_of_a_shape_with_its_size_in_it_is_of_what_the_shape_explains() {
        let pulled = Pull::default().made();
        let point = Point::at(0, &[pulled.most_u]);
        let found = constancy_at(&pulled.channels, "amplitude_phase_coupling", Some(point));
        let found = found.unwrap();
        assert!((0.0..0.001).contains(&found.share), "{found:?}");
    }

    #[test]
    fn a_clip_has_no_gain_to_be_constant() {
        assert_eq!(
            constancy(&channels(1, 1.0, |_| 5.0), "output_saturation"),
            None
        );
    }

    #[test]
    fn stretches_cover_the_rows_with_equal_information() {
        let mut random = Random::new(9);
        for columns in 1..4 {
            let columns: Vec<Vec<f64>> = (0..columns)
                .map(|_| {
                    (0..500)
                        .map(|k| random.normal() * (k as f64 / 90.0).exp())
                        .collect()
                })
                .collect();
            let square = |rows: std::ops::Range<usize>| -> f64 {
                let own = |c: &Vec<f64>| dot(&c[rows.clone()], &c[rows.clone()]);
                columns.iter().map(own).sum()
            };
            let found = stretches(&columns);
            assert_eq!(found.len(), STRETCHES);
            assert_eq!((found[0].start, found[STRETCHES - 1].end), (0, 500));
            assert!(found.windows(2).all(|w| w[0].end == w[1].start));
            let largest = (0..500).map(|k| square(k..k + 1)).fold(0.0, f64::max);
            for rows in found {
                let share = square(rows) - square(0..500) / STRETCHES as f64;
                assert!(share.abs() <= largest);
            }
        }
    }
}
