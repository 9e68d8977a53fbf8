//! The whitener against a dense covariance and its Cholesky factor, written out here.

use super::lattice::Problem;
use super::linear::dot;
use super::noise::{Shape, Timeline};
use super::random::Stream;
use super::whiten::Whitener;
use nalgebra::{DMatrix, DVector};

/// Uneven times with a gap and a repeated time, weights, two rows not used.
fn uneven(n: usize) -> Timeline {
    let stream = Stream::new(1, 1);
    let mut t = 5.0;
    let mut times = Vec::new();
    let mut factor = Vec::new();
    for k in 0..n {
        t += match k {
            7 => 0.0,
            20 => 55.0,
            _ => 0.2 + 1.6 * stream.uniform(k as u64),
        };
        times.push(t);
        factor.push(match k {
            0 | 13 => f64::INFINITY,
            k if k % 5 == 0 => 0.25,
            k if k % 7 == 0 => 6.0,
            _ => 1.0,
        });
    }
    Timeline::new(&times, factor).unwrap()
}

/// The covariance of the used rows, entry by entry, from the model's definition.
fn dense(line: &Timeline, shape: Shape) -> (Vec<usize>, DMatrix<f64>) {
    let rows: Vec<usize> = (0..line.len())
        .filter(|i| line.white_factor[*i].is_finite())
        .collect();
    let mut at = 0.0;
    let times: Vec<f64> = line
        .steps
        .iter()
        .map(|s| {
            at += s;
            at
        })
        .collect();
    let v = DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
        let (a, b) = (rows[a], rows[b]);
        let mut sum = 0.0;
        for state in line.states(shape) {
            sum += if state.tau.is_finite() {
                state.variance * (-(times[a] - times[b]).abs() / state.tau).exp()
            } else {
                state.variance * times[a].min(times[b])
            };
        }
        if a == b {
            sum += line.white_factor[a] + line.floor(shape);
        }
        sum
    });
    (rows, v)
}

const SHAPES: [(f64, f64); 5] = [
    (0.0, 0.0),
    (0.3, 0.0),
    (0.0, 0.02),
    (0.1, 0.05),
    (30.0, 100.0),
];

#[test]
fn whitening_is_the_inverse_cholesky_factor() {
    for n in [40usize, 160] {
        let line = uneven(n);
        let columns: Vec<Vec<f64>> = (0..6).map(|k| Stream::new(2, k).normals(n)).collect();
        for (flicker, walk) in SHAPES {
            let shape = Shape { flicker, walk };
            let (rows, v) = dense(&line, shape);
            let cholesky = v.clone().cholesky().unwrap();
            let whitener = Whitener::new(&line, shape);
            let log_det = 2.0 * cholesky.l().diagonal().map(f64::ln).sum();
            assert!((whitener.log_det - log_det).abs() < 1e-8, "{shape:?}");
            assert_eq!(whitener.used, rows.len());
            let mut white = whitener.apply_all(&columns);
            for (column, white) in columns.iter().zip(&white) {
                let chosen = DVector::from_iterator(rows.len(), rows.iter().map(|i| column[*i]));
                let reference = cholesky.l().solve_lower_triangular(&chosen).unwrap();
                for (k, i) in rows.iter().enumerate() {
                    assert!((white[*i] - reference[k]).abs() < 1e-9, "{shape:?} row {i}");
                }
                assert_eq!((white[0], white[13]), (0.0, 0.0));
            }
            // The auxiliary residuals against V^-1 itself.
            let inverse = cholesky.inverse();
            let chosen = DVector::from_iterator(rows.len(), rows.iter().map(|i| columns[1][*i]));
            let u = &inverse * &chosen;
            let auxiliary = whitener.auxiliary(&white[1]);
            for (k, i) in rows.iter().enumerate() {
                assert!(
                    (auxiliary[*i].0 - u[k]).abs() < 1e-9 * u.amax(),
                    "{shape:?} row {i}"
                );
                assert!(
                    (auxiliary[*i].1 / inverse[(k, k)] - 1.0).abs() < 1e-9,
                    "row {i}"
                );
            }
            // Colouring undoes whitening.
            let back = whitener.colour(&white[2]);
            for i in &rows {
                assert!((back[*i] - columns[2][*i]).abs() < 1e-10);
            }
            white.clear();
        }
    }
}

/// Even times, whose gains become steady, with what ends that: a gap, a row that counts less, a row that is not used.
fn even(n: usize) -> Timeline {
    let time = |k: usize| 0.1 * k as f64 + if k >= 300 { 7.0 } else { 0.0 };
    let times: Vec<f64> = (0..n).map(time).collect();
    let factor = |k: usize| match k {
        150 => f64::INFINITY,
        400 => 6.0,
        _ => 1.0,
    };
    Timeline::new(&times, (0..n).map(factor).collect()).unwrap()
}

/// x = x1 + x2, each a relaxation, driven by one noise with opposite signs: the covariance of two times is the sum over both of what is
/// left of the stationary covariances after the time between them.
#[test]
fn a_smooth_walk_is_two_relaxations_of_one_noise() {
    let line = uneven(40);
    let (shape, smooth) = (Shape::default(), 1e-3);
    let (states, cross) = line.smooth_states(shape, smooth);
    let [.., short, long] = &states[..] else {
        panic!("two relaxations")
    };
    let rows: Vec<usize> = (0..line.len())
        .filter(|i| line.white_factor[*i].is_finite())
        .collect();
    let times: Vec<f64> = rows
        .iter()
        .map(|row| line.steps[..=*row].iter().sum())
        .collect();
    let dense = DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
        let apart = (times[a] - times[b]).abs();
        let left = |tau: f64| (-apart / tau).exp();
        let walk =
            (short.variance + cross) * left(short.tau) + (long.variance + cross) * left(long.tau);
        let own = if a == b {
            line.white_factor[rows[a]]
        } else {
            0.0
        };
        walk + own
    });
    let whitener = Whitener::with_smooth(&line, shape, smooth);
    let factor = dense.cholesky().unwrap().l();
    let y: Vec<f64> = times.iter().map(|t| (0.3 * t).sin()).collect();
    let mut column = vec![0.0; line.len()];
    rows.iter().zip(&y).for_each(|(row, y)| column[*row] = *y);
    let expected = factor
        .solve_lower_triangular(&DVector::from_vec(y))
        .unwrap();
    let white = whitener.apply(&column);
    for (k, row) in rows.iter().enumerate() {
        assert!((white[*row] - expected[k]).abs() < 1e-6, "{k}");
    }
    // Between rows much nearer than the time constants it grows as integrated random walk: q t^3 / 3 about its own tangent.
    let (a, b) = (1.0 / long.tau, 1.0 / short.tau);
    let g = smooth / (b - a).powi(2);
    assert!((2.0 * a * long.variance / g - 1.0).abs() < 1e-12);
    assert!((cross * (a + b) / g + 1.0).abs() < 1e-12);
}

#[test]
fn steady_gains_are_those_of_the_covariance() {
    let n = 500;
    let line = even(n);
    let column = Stream::new(3, 1).normals(n);
    for (flicker, walk) in [(0.0, 0.5), (0.0, 5.0), (0.3, 0.0), (0.1, 0.5)] {
        let shape = Shape { flicker, walk };
        let (rows, v) = dense(&line, shape);
        let cholesky = v.cholesky().unwrap();
        let whitener = Whitener::new(&line, shape);
        let log_det = 2.0 * cholesky.l().diagonal().map(f64::ln).sum();
        assert!((whitener.log_det - log_det).abs() < 1e-8, "{shape:?}");
        assert_eq!(whitener.used, rows.len());
        let white = whitener.apply(&column);
        let chosen = DVector::from_iterator(rows.len(), rows.iter().map(|i| column[*i]));
        let reference = cholesky.l().solve_lower_triangular(&chosen).unwrap();
        for (k, i) in rows.iter().enumerate() {
            assert!((white[*i] - reference[k]).abs() < 1e-9, "{shape:?} row {i}");
        }
    }
}

#[test]
fn least_squares_on_whitened_columns_is_generalised_least_squares() {
    let n = 160;
    let line = uneven(n);
    let shape = Shape {
        flicker: 0.4,
        walk: 0.01,
    };
    let mut columns: Vec<Vec<f64>> = (0..3).map(|k| Stream::new(3, k).normals(n)).collect();
    columns.insert(0, vec![1.0; n]);
    let mut y = Stream::new(4, 0).normals(n);
    y[13] = f64::NAN;
    let problem = Problem { line, y, columns };
    let (rows, v) = dense(&problem.line, shape);
    let x = DMatrix::from_fn(rows.len(), 4, |i, j| problem.columns[j][rows[i]]);
    let target = DVector::from_iterator(rows.len(), rows.iter().map(|i| problem.y[*i]));
    let inverse = v.clone().try_inverse().unwrap();
    let gram = x.transpose() * &inverse * &x;
    let covariance = gram.clone().try_inverse().unwrap();
    let beta = &covariance * x.transpose() * &inverse * &target;
    let residual = &target - &x * &beta;
    let rss = residual.dot(&(&inverse * &residual));
    let (mut white, basis) = problem.whiten(&Whitener::new(&problem.line, shape));
    let z = basis.project_off(&mut white);
    for (a, b) in basis.solve(&z).iter().zip(beta.iter()) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    assert!((dot(&white, &white) / rss - 1.0).abs() < 1e-9);
    assert!((basis.inverse_gram() - covariance).amax() < 1e-9);
    let at = problem.evaluate(shape);
    let log_det = v.determinant().ln() + gram.determinant().ln();
    assert!(
        (at.log_det - log_det).abs() < 1e-7,
        "{} {log_det}",
        at.log_det
    );
    assert_eq!(at.contrasts, rows.len() - 4);
}
