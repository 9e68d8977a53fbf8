//! How often chance alone earns a small probability, and what it costs a true effect: the small
//! edition. Raise `records` for a table.

use super::linear::{Basis, dot};
use super::reml;
use super::score::{self, Scores};
use super::simulated::{Simulated, declared, dictionary, record};

fn scored(simulated: &Simulated, stream: u64, surrogates: usize) -> Scores {
    let columns = declared(&simulated.p);
    let used = vec![true; simulated.y.len()];
    let options = reml::Options::default();
    let fit = reml::fit(&simulated.times, &simulated.y, &columns, &used, &options).unwrap();
    let groups = dictionary(simulated, stream, 1);
    let options = score::Options {
        surrogates,
        is_thin: surrogates == 0,
        seed: stream,
    };
    score::score(&fit, &groups, &options)
}

/// Of `records` records of noise, how many have a least probability below 0.1 and 0.01.
fn false_alarms(strengths: (f64, f64, f64), n: usize, records: u64) -> [usize; 2] {
    let least = (0..records).map(|k| {
        let simulated = record(7000 + k, n, strengths);
        let scores = scored(&simulated, k, 60);
        let each = scores.groups.iter().filter_map(|g| g.p_bootstrap);
        each.fold(1.0, f64::min)
    });
    let least: Vec<f64> = least.collect();
    [0.1, 0.01].map(|level| least.iter().filter(|p| **p < level).count())
}

#[test]
fn noise_alone_earns_small_probabilities_as_seldom_as_they_say() {
    let records = 30;
    let (mut tenth, mut hundredth) = (0, 0);
    for strengths in [
        (1.0, 0.0, 0.0),
        (1.0, 0.5, 0.0),
        (0.1, 1.0, 0.0),
        (0.05, 0.0, 1.0),
    ] {
        let count = false_alarms(strengths, 120, records);
        tenth += count[0];
        hundredth += count[1];
    }
    // 120 records: binomial means 12 and 1.2; the bounds are passed once in 500 by chance.
    assert!(tenth <= 22, "{tenth} of 120 below 0.1");
    assert!(hundredth <= 5, "{hundredth} of 120 below 0.01");
}

/// Adds the middle point of a group, its rms after the declared terms being `size`.
fn plant(simulated: &mut Simulated, stream: u64, group: usize, size: f64) {
    let groups = dictionary(simulated, stream, 1);
    let points = &groups[group].points;
    let column = points[points.len() / 2].last().unwrap();
    let mut rest = column.clone();
    Basis::new(&declared(&simulated.p)).project_off(&mut rest);
    let rms = (dot(&rest, &rest) / rest.len() as f64).sqrt();
    for (y, c) in simulated.y.iter_mut().zip(column) {
        *y += size / rms * c;
    }
}

#[test]
fn effects_as_large_as_the_noise_are_found() {
    let (mut found, mut first, mut total) = (0, 0, 0);
    for group in [0usize, 2, 6, 7] {
        for k in 0..6 {
            let mut simulated = record(9000 + k, 240, (1.0, 0.1, 0.0));
            plant(&mut simulated, k, group, 1.0);
            let scores = scored(&simulated, k, 60);
            total += 1;
            found += usize::from(scores.groups[group].p_bootstrap.unwrap() < 0.01);
            first += usize::from(scores.leader() == Some(group));
        }
    }
    assert!(found >= 15 && first >= 18, "{found} and {first} of {total}");
}

#[test]
fn the_same_record_gives_the_same_bits() {
    let simulated = record(1, 150, (1.0, 0.4, 0.0));
    let (a, b) = (scored(&simulated, 3, 20), scored(&simulated, 3, 20));
    assert_eq!(a.groups, b.groups);
    assert_eq!(a.grid, b.grid);
}
