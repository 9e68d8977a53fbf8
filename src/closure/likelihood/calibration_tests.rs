//! How often chance alone earns a small probability, and what it costs a true effect.

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
        seed: stream,
        ..score::Options::default()
    };
    score::score(&fit, &groups, &options)
}

#[test]
fn table() {
    let records: u64 = std::env::var("RECORDS")
        .ok()
        .and_then(|v| v.parse().ok())
        .unwrap_or(20);
    let sizes = std::env::var("ROWS").unwrap_or("150,400".into());
    for n in sizes.split(',').map(|v| v.parse::<usize>().unwrap()) {
        for strengths in [
            (1.0, 0.0, 0.0),
            (1.0, 0.3, 0.0),
            (1.0, 1.0, 0.0),
            (0.1, 1.0, 0.0),
            (1.0, 0.0, 0.03),
            (1.0, 0.0, 0.3),
            (0.03, 0.0, 1.0),
        ] {
            let (mut fast, mut boot, mut both) = ([0; 3], [0; 3], [0; 3]);
            let mut who = std::collections::BTreeMap::new();
            for k in 0..records {
                let simulated = record(1000 * n as u64 + k, n, strengths);
                let scores = scored(&simulated, k, 200);
                let least = |f: &dyn Fn(&score::GroupScore) -> f64| {
                    scores.groups.iter().map(f).fold(1.0, f64::min)
                };
                let p = [
                    least(&|g| g.p_fast),
                    least(&|g| g.p_bootstrap.unwrap()),
                    least(&|g| g.p_fast_bootstrap.unwrap()),
                ];
                for (i, level) in [0.1, 0.05, 0.01].iter().enumerate() {
                    fast[i] += usize::from(p[0] < *level);
                    boot[i] += usize::from(p[1] < *level);
                    both[i] += usize::from(p[2] < *level);
                }
                if p[0] < 0.01 || p[1] < 0.01 {
                    *who.entry(scores.leader()).or_insert(0) += 1;
                }
            }
            println!(
                "{n} {strengths:?} of {records}: p<.1/.05/.01 fast {fast:?} bootstrap {boot:?} fast-bootstrap {both:?} {who:?}"
            );
        }
    }
}

#[test]
fn power() {
    let records: u64 = std::env::var("RECORDS")
        .ok()
        .and_then(|v| v.parse().ok())
        .unwrap_or(20);
    let sizes = std::env::var("ROWS").unwrap_or("150,400".into());
    for n in sizes.split(',').map(|v| v.parse::<usize>().unwrap()) {
        for strengths in [(1.0, 0.0, 0.0), (1.0, 0.3, 0.0)] {
            for size in [0.5, 1.0, 2.0] {
                for group in [0usize, 2, 4, 6, 8, 10] {
                    let (mut fast, mut boot, mut both, mut right) = (0, 0, 0, 0);
                    for k in 0..records {
                        let mut simulated = record(5000 * n as u64 + k, n, strengths);
                        let groups = dictionary(&simulated, k, 1);
                        let point = &groups[group].points[groups[group].points.len() * 3 / 5];
                        let column = &point[point.len() - 1];
                        // Contribution: rms after the declared terms, in units of white noise.
                        let basis = super::linear::Basis::new(&declared(&simulated.p));
                        let mut rest = column.clone();
                        basis.project_off(&mut rest);
                        let rms = (super::linear::dot(&rest, &rest) / n as f64).sqrt();
                        for (y, c) in simulated.y.iter_mut().zip(column) {
                            *y += size / rms * c;
                        }
                        let scores = scored(&simulated, k, 100);
                        let g = &scores.groups[group];
                        fast += usize::from(g.p_fast < 0.01);
                        boot += usize::from(g.p_bootstrap.unwrap() < 0.01);
                        both += usize::from(g.p_fast_bootstrap.unwrap() < 0.01);
                        right += usize::from(scores.leader() == Some(group));
                    }
                    println!(
                        "{n} {strengths:?} effect {group} x {size} of {records}: fast {fast} bootstrap {boot} fast-bootstrap {both} leader {right}"
                    );
                }
            }
        }
    }
}

#[test]
fn speed() {
    let n = 2000;
    let simulated = record(3, n, (1.0, 0.5, 0.0));
    let columns = declared(&simulated.p);
    let used = vec![true; n];
    let start = std::time::Instant::now();
    let fit = reml::fit(
        &simulated.times,
        &simulated.y,
        &columns,
        &used,
        &reml::Options::default(),
    )
    .unwrap();
    println!("fit {:?} {:?}", start.elapsed(), fit.noise);
    let groups = dictionary(&simulated, 1, 2);
    let count: usize = groups.iter().flat_map(|g| &g.points).map(Vec::len).sum();
    for surrogates in [0, 200] {
        let start = std::time::Instant::now();
        let scores = score::score(
            &fit,
            &groups,
            &score::Options {
                surrogates,
                ..score::Options::default()
            },
        );
        println!(
            "score {count} columns, {surrogates} surrogates, {} shapes: {:?}",
            scores.grid.shapes.len(),
            start.elapsed()
        );
    }
}

#[test]
fn long() {
    let n = 1_000_000;
    let mut simulated = record(3, 100, (1.0, 0.0, 0.0));
    simulated.p = super::simulated::thermometer(n, 4.0);
    simulated.times = (0..n).map(|i| i as f64 * 0.1).collect();
    simulated.y = super::simulated::noise(3, n, 1.0, 0.0, 0.001);
    let columns = declared(&simulated.p);
    let used = vec![true; n];
    let start = std::time::Instant::now();
    let fit = reml::fit(
        &simulated.times,
        &simulated.y,
        &columns,
        &used,
        &reml::Options::default(),
    )
    .unwrap();
    println!("long fit {:?} {:?}", start.elapsed(), fit.noise);
}
