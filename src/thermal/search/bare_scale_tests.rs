//! Scale factors that are off everywhere, and others.

use super::*;
use crate::thermal::channels::Channels;
use crate::thermal::search::Effort;
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 400;

/// What is found of a scale factor of 1 + 1e-6 (`ppm` + `ppm_per_k` (T - 35)) + `cubic` (rate / 100)^2: names, the error that is
/// the same everywhere, and the channel of what is left.
#[allow(clippy::type_complexity)]
fn of_a_scale(
    seed: u64,
    [ppm, ppm_per_k, cubic]: [f64; 3],
    degc: &[f64],
) -> (Vec<String>, Option<(f64, f64)>, Option<String>) {
    let mut random = Random::new(seed);
    let rate = |k: usize| 25.0 * ((k / 4 * 7 % 9) as f64 - 4.0);
    let output = degc.iter().enumerate().map(|(k, t)| {
        let off = 1e-6 * (ppm + ppm_per_k * (t - 35.0)) + cubic * (rate(k) / 100.0).powi(2);
        rate(k) * (1.0 + off) + 0.4 + 0.01 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("rate_dps".to_owned(), (0..degc.len()).map(rate).collect()),
        ("die_degc".to_owned(), degc.to_vec()),
    ]);
    let time_s: Vec<f64> = (0..degc.len()).map(|k| 10.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let names = found.terms.iter().map(Term::id).collect();
    (names, found.scale_ppm, found.left)
}

#[test]
fn a_scale_factor_that_is_off_everywhere_is_no_law_of_temperature_or_rate() {
    let moving = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    for seed in 1..5 {
        for degc in [&moving, &vec![25.0; ROWS]] {
            let (_, scale_ppm, left) = of_a_scale(seed, [800.0, 0.0, 0.0], degc);
            let (ppm, std_ppm) = scale_ppm.unwrap();
            assert!((ppm - 800.0).abs() < 4.0 * std_ppm, "{seed}: {ppm}");
            assert!((5.0..30.0).contains(&std_ppm), "{seed}: {std_ppm}");
            assert_eq!(left.as_deref(), Some("rate_dps"), "{seed}");
        }
        // Off everywhere, and more than that.
        let (names, scale_ppm, left) = of_a_scale(seed, [800.0, 8.0, 0.0], &moving);
        assert_eq!(names, ["scale_factor_temperature"], "{seed}");
        assert_eq!((scale_ppm, left), (None, None), "{seed}");
        let (names, scale_ppm, left) = of_a_scale(seed, [800.0, 0.0, 2e-3], &moving);
        assert_eq!(names, ["scale_factor_nonlinearity"], "{seed}");
        assert_eq!((scale_ppm, left), (None, None), "{seed}");
    }
}
