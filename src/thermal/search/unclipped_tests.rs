//! Clips of a bias.

use crate::thermal::channels::Channels;
use crate::thermal::search::{Effort, Search, Term};
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 800;
const NOISE_DPS: f64 = 0.02;

/// The bias of a temperature, deg/s.
fn bias_dps([b0, b1, b2]: [f64; 3], degc: f64) -> f64 {
    let u = degc / 35.0 - 1.0;
    b0 + b1 * u + b2 * u * u
}

/// A record at rest whose bias clips at a level, before the noise comes or after it.
fn clipped(seed: u64, bias: [f64; 3], upper_dps: f64, noise_clips: bool) -> Channels {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let output = degc.iter().map(|t| {
        let (total, noise) = (bias_dps(bias, *t), NOISE_DPS * random.normal());
        match noise_clips {
            true => (total + noise).min(upper_dps),
            false => total.min(upper_dps) + noise,
        }
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..ROWS).map(|k| 20.0 * k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

#[test]
fn a_bias_that_clips_before_its_noise_is_no_resonance() {
    for (seed, bias, upper_dps) in [
        (1, [0.9, 1.65, 0.35], 2.45),
        (2, [1.0, 3.2, 0.6], 3.2),
        (3, [0.5, -4.6, -0.9], 2.2),
        // Held in two rows of five, by little more than the noise.
        (4, [1.0, 0.747, 0.124], 1.243),
        (5, [1.128, 0.913, 0.166], 1.159),
    ] {
        let c = clipped(seed, bias, upper_dps, false);
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(Term::id).collect();
        assert_eq!(names, ["output_saturation"], "{seed}");
        let level = found.terms[0].point.theta[0];
        assert!((level - upper_dps).abs() < 0.01, "{seed}: {level}");
        assert_eq!(found.left, None, "{seed}");
        // The bias is that of the rows below the level.
        let model = search.model(&found.terms).unwrap();
        for degc in [0.0, 35.0, 70.0] {
            let (low, high) = (0.0, 70.0);
            let u = 2.0 * (degc - low) / (high - low) - 1.0;
            let off = model.bias.at(u) - bias_dps(bias, degc);
            assert!(off.abs() < 0.05, "{seed}: {off} at {degc}");
        }
    }
}

#[test]
fn a_clip_that_holds_most_rows_is_one() {
    let c = clipped(4, [0.9, 1.65, 0.35], 0.7, true);
    let output = c.output_dps();
    let held = output.iter().filter(|v| **v == 0.7).count();
    assert!(2 * held > ROWS, "{held}");
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let names: Vec<String> = found.terms.iter().map(Term::id).collect();
    assert_eq!(names, ["output_saturation"]);
    // A level at which readings stand is known to their resolution.
    let estimate = &search.estimates(&search.model(&found.terms).unwrap())[0];
    assert_eq!(estimate.point.theta[0], 0.7);
    assert!(estimate.theta_std[0] < 1e-3, "{estimate:?}");
}
