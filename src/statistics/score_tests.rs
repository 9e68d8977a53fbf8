//! Scores against dense generalised least squares, and what they say of columns that the record does
//! not excite.

use super::candidates::{AtShape, Grid, Group};
use super::noise::Shape;
use super::reml::{self, Options};
use super::score;
use super::simulated::{Simulated, declared, lag, record};
use super::whiten::Whitener;
use nalgebra::{DMatrix, DVector};

/// Gains alone, at every third shape of the grid.
const GAINS: score::Options = score::Options {
    surrogates: 0,
    is_thin: true,
    seed: 1,
};

fn fit(simulated: &Simulated) -> reml::Fit {
    let columns = declared(&simulated.p);
    let used = vec![true; simulated.y.len()];
    reml::fit(
        &simulated.times,
        &simulated.y,
        &columns,
        &used,
        &Options::default(),
    )
    .unwrap()
}

/// Lags, the rate, the thermometer itself twice, a pair.
fn groups(simulated: &Simulated) -> Vec<Group> {
    let n = simulated.p.len();
    let rate = (0..n)
        .map(|i| simulated.p[(i + 1).min(n - 1)] - simulated.p[i.saturating_sub(1)])
        .collect::<Vec<f64>>();
    let of = |f: &dyn Fn(f64) -> f64| simulated.times.iter().map(|t| f(*t)).collect::<Vec<f64>>();
    let p = simulated.p.clone();
    vec![
        Group {
            points: [3.0, 30.0].iter().map(|tau| vec![lag(&p, *tau)]).collect(),
        },
        Group {
            points: vec![vec![rate]],
        },
        Group {
            points: vec![vec![p.iter().map(|p| 2.0 * p - 1.0).collect()]],
        },
        Group {
            points: vec![vec![of(&|t| (0.3 * t).sin()), p, of(&|t| (0.3 * t).cos())]],
        },
    ]
}

#[test]
fn gains_are_those_of_dense_generalised_least_squares() {
    let n = 90;
    let simulated = record(2, n, (1.0, 0.5, 0.0));
    let fit = fit(&simulated);
    let groups = groups(&simulated);
    let shape = Shape {
        flicker: 0.3,
        walk: 0.01,
    };
    let at = AtShape::new(&fit, &groups, std::slice::from_ref(&fit.problem.y), shape);
    // V from the whitener's inverse: column k of V^(1/2) is the colouring of unit vector k.
    let whitener = Whitener::new(&fit.problem.line, shape);
    let root = DMatrix::from_columns(
        &(0..n)
            .map(|k| {
                let unit: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == k))).collect();
                DVector::from_vec(whitener.colour(&unit))
            })
            .collect::<Vec<_>>(),
    );
    let inverse = (&root * root.transpose()).try_inverse().unwrap();
    let rss = |columns: &[Vec<f64>]| -> f64 {
        let x = DMatrix::from_fn(n, columns.len(), |i, j| columns[j][i]);
        let y = DVector::from_vec(fit.problem.y.clone());
        let gram = x.transpose() * &inverse * &x;
        let beta = gram.try_inverse().unwrap() * x.transpose() * &inverse * &y;
        let r = y - x * beta;
        r.dot(&(&inverse * &r))
    };
    let null = rss(&fit.problem.columns);
    assert!((at.rss[0] / null - 1.0).abs() < 1e-8);
    for (point, added) in [
        (0, vec![groups[0].points[0][0].clone()]),
        (1, vec![groups[0].points[1][0].clone()]),
        (2, vec![groups[1].points[0][0].clone()]),
        (
            4,
            vec![
                groups[3].points[0][0].clone(),
                groups[3].points[0][2].clone(),
            ],
        ),
    ] {
        let mut columns = fit.problem.columns.clone();
        columns.extend(added);
        let gain = null - rss(&columns);
        assert!((at.gain[point] - gain).abs() < 1e-7 * null, "point {point}");
        assert!((at.ratio(point, 0) + (1.0 - gain / null).ln()).abs() < 1e-6);
    }
}

#[test]
fn what_is_not_excited_is_said() {
    let mut simulated = record(1, 300, (1.0, 0.0, 0.0));
    let truth = lag(&simulated.p, 30.0);
    for (y, c) in simulated.y.iter_mut().zip(&truth) {
        *y += 20.0 * c;
    }
    let fit = fit(&simulated);
    let groups = groups(&simulated);
    let scores = score::score(&fit, &groups, &GAINS);
    let [lag, rate, thermometer, pair] = &scores.groups[..] else {
        panic!("four groups");
    };
    assert_eq!((lag.point, lag.degrees), (Some(1), 1));
    assert_eq!((thermometer.point, thermometer.profiled), (None, 0.0));
    // Of the pair's three columns the thermometer drops out.
    assert_eq!((pair.point, pair.degrees), (Some(0), 2));
    assert_eq!(rate.point, Some(0));
    assert_eq!(scores.leader(), Some(0));
}

#[test]
fn null_and_candidate_each_choose_their_shape() {
    let mut simulated = record(1, 200, (1.0, 0.3, 0.0));
    let truth = lag(&simulated.p, 30.0);
    for (y, c) in simulated.y.iter_mut().zip(&truth) {
        *y += 10.0 * c;
    }
    let fit = fit(&simulated);
    let groups = groups(&simulated);
    let (mut null, mut with) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    let grid = Grid::new(&fit);
    for shape in &grid.shapes {
        let signal = std::slice::from_ref(&fit.problem.y);
        let at = AtShape::new(&fit, &groups, signal, *shape);
        null = null.max(at.null(0));
        with = with.max(at.with_point(1, 0));
    }
    // With surrogates every shape is looked at.
    let options = score::Options {
        surrogates: 1,
        is_thin: false,
        ..GAINS
    };
    let scores = score::score(&fit, &groups, &options);
    assert!((scores.groups[0].gain - (with - null)).abs() < 1e-9);
    assert!(scores.groups.iter().all(|g| g.gain >= 0.0));
    let weights: f64 = grid.weights.iter().sum();
    assert!((weights - 1.0).abs() < 1e-12 && grid.weights[0] > 0.0);
    // The effect, taken for drift by the null hypothesis, leaves whiter noise behind.
    let whiter = |s: Shape| s.flicker + s.walk;
    assert!(whiter(scores.groups[0].shape) < whiter(grid.shapes[0]));
}

#[test]
fn a_third_of_the_shapes_may_be_without_the_noise_beside_a_candidate() {
    let mut hidden = 0;
    for seed in 0..12 {
        let mut simulated = record(seed, 200, (1.0, 0.0, 0.0));
        let truth = lag(&simulated.p, 30.0);
        for (y, c) in simulated.y.iter_mut().zip(&truth) {
            *y += 10.0 * c;
        }
        let (fit, groups) = (fit(&simulated), groups(&simulated));
        let gain = |is_thin: bool| {
            let options = score::Options { is_thin, ..GAINS };
            score::score(&fit, &groups, &options).groups[0].gain
        };
        let lost = gain(false) - gain(true);
        assert!(lost >= 0.0);
        hidden += usize::from(lost > 3.0);
    }
    assert!(hidden >= 3, "{hidden} of 12");
}

#[test]
fn surrogates_of_another_round_decide_what_is_clear() {
    let mut simulated = record(1, 200, (1.0, 0.0, 0.0));
    let noise = score::score(
        &fit(&simulated),
        &groups(&simulated),
        &score::Options {
            surrogates: 40,
            is_thin: false,
            ..GAINS
        },
    );
    let tail = noise.by_chance.clone().unwrap();
    assert!(!noise.is_clear((1e-8, 1.0)), "nothing is sure of noise");
    let truth = lag(&simulated.p, 30.0);
    for (y, c) in simulated.y.iter_mut().zip(&truth) {
        *y += 20.0 * c;
    }
    let scores = score::score(&fit(&simulated), &groups(&simulated), &GAINS).judged_by(&tail);
    let p = |g: usize| scores.groups[g].p_bootstrap.unwrap();
    assert!(scores.is_clear((1e-8, 0.5)) && p(0) < 1e-8, "{}", p(0));
    // What is not excited is as good by chance as it is.
    assert!(p(2) > 0.9 && p(1) == tail.survival(scores.groups[1].profiled));
    assert_eq!(scores.greatest(), Some(0));
}
