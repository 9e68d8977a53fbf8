//! The levels of a clip where few rows define them: a rate table beyond the full scale of the gyro.

use super::channels::Channels;
use super::effects::Point;
use super::search::{Effort, Model, Search, Term};
use super::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 420;
const NOISE_DPS: f64 = 0.05;
const LEVELS_DPS: [f64; 2] = [120.0, -121.5];

/// A table that steps through its rates; four rows in a hundred are beyond each level, where the converter gives
/// one code but for the noise that comes after it.
fn channels(seed: u64) -> Channels {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS / 2), triangle(ROWS - ROWS / 2)].concat();
    let rate: Vec<f64> = (0..ROWS)
        .map(|k| match k / 4 % 24 {
            5 => 200.0,
            17 => -200.0,
            j => [0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0][j % 7],
        })
        .collect();
    let output = degc.iter().zip(&rate).map(|(t, r)| {
        let u = t / 35.0 - 1.0;
        let total = r + 2.0 - 1.5 * u + 0.7 * u * u;
        total.clamp(LEVELS_DPS[1], LEVELS_DPS[0]) + NOISE_DPS * random.normal()
    });
    let output = output.collect();
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output),
        ("rate_dps".to_owned(), rate),
        ("die_degc".to_owned(), degc),
    ]);
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

fn term(search: &Search, point: Point) -> Term {
    let mut all = search.candidates().iter();
    let candidate = all.find(|c| c.id() == "output_saturation").unwrap();
    Term::new(candidate.clone(), point)
}

/// The model with the clip polished from a shape.
fn polished(c: &Channels, point: &Point) -> Model {
    let split = c.split().unwrap();
    let search = Search::new(c, &split, Effort::default(), Vec::new());
    let start = search.model(&[term(&search, point.clone())]).unwrap();
    search.polished(start).unwrap()
}

#[test]
fn levels_lie_where_the_clipped_rows_do_wherever_the_search_left_them() {
    for seed in 0..3 {
        let c = channels(seed);
        // Upper and lower level: moved together, apart, and of one magnitude.
        let off_dps = [[-1.0; 2], [0.2; 2], [0.9; 2], [-0.6, 0.8], [0.7, -0.4]];
        let two = off_dps
            .map(|[upper, lower]| Point::at(3, &[LEVELS_DPS[0] + upper, LEVELS_DPS[1] + lower]));
        for start in two.into_iter().chain([Point::at(0, &[120.6])]) {
            let model = polished(&c, &start);
            // Eighteen rows of each, two thirds of them fitted.
            let std_dps = NOISE_DPS / 11f64.sqrt();
            assert_eq!(model.terms[0].point.form, 3, "{seed}, {start:?}");
            for (found, truth) in model.terms[0].point.theta.iter().zip(LEVELS_DPS) {
                assert!(
                    (found - truth).abs() < 5.0 * std_dps,
                    "{seed}, {start:?}: {found}"
                );
            }
        }
    }
}
