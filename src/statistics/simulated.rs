//! Records for the tests, by a generator that shares nothing with the state space: 1/f noise by
//! Kasdin's fractional filter (1995), walk by summation.

use super::random::Stream;

/// A record: times, thermometer, signal.
pub(super) struct Simulated {
    pub times: Vec<f64>,
    pub p: Vec<f64>,
    pub y: Vec<f64>,
}

/// Noise on an even grid of 1 s: white rms, flicker sqrt(h), walk per sqrt(s).
pub(super) fn noise(stream: u64, n: usize, white: f64, flicker: f64, walk: f64) -> Vec<f64> {
    let mut y: Vec<f64> = Stream::new(100, stream).normals(n);
    for v in &mut y {
        *v *= white;
    }
    if flicker > 0.0 {
        // One-sided density at low f: 2 q / (2 pi f); so q = pi h. Started 4 n rows before.
        let before = 3 * n;
        let drive = Stream::new(101, stream).normals(before + n);
        let mut filter = vec![1.0];
        for k in 1..before + n {
            filter.push(filter[k - 1] * (k as f64 - 0.5) / k as f64);
        }
        let amplitude = flicker * std::f64::consts::PI.sqrt();
        for (i, y) in y.iter_mut().enumerate() {
            let end = before + i + 1;
            let sum: f64 = drive[..end]
                .iter()
                .rev()
                .zip(&filter)
                .map(|(d, f)| d * f)
                .sum();
            *y += amplitude * sum;
        }
    }
    let mut level = 0.0;
    for (y, d) in y.iter_mut().zip(Stream::new(102, stream).normals(n)) {
        *y += level;
        level += walk * d;
    }
    y
}

/// `ramps` ramps of a thermometer over -1..1, with rounded ends.
pub(super) fn thermometer(n: usize, ramps: f64) -> Vec<f64> {
    (0..n)
        .map(|i| {
            let phase = ramps * (i as f64 + 0.5) / n as f64;
            let triangle = 1.0 - 2.0 * (phase / 2.0 - (phase / 2.0).round()).abs() * 2.0;
            -(triangle * std::f64::consts::FRAC_PI_2 * 0.9).sin()
                / (0.9f64 * std::f64::consts::FRAC_PI_2).sin()
        })
        .collect()
}

/// 1, p, p^2.
pub(super) fn declared(p: &[f64]) -> Vec<Vec<f64>> {
    (0..3)
        .map(|k| p.iter().map(|v| v.powi(k)).collect())
        .collect()
}

/// A record of noise with a quadratic bias.
pub(super) fn record(stream: u64, n: usize, strengths: (f64, f64, f64)) -> Simulated {
    let ramps = [1.0, 2.0, 4.0, 6.0][(stream % 4) as usize];
    let p = thermometer(n, ramps);
    let mut y = noise(stream, n, strengths.0, strengths.1, strengths.2);
    for (y, p) in y.iter_mut().zip(&p) {
        *y += 3.0 - 2.0 * p + 0.7 * p * p;
    }
    let times = (0..n).map(|i| i as f64).collect();
    Simulated { times, p, y }
}

/// First-order lag of a column, time constant in rows.
pub(super) fn lag(p: &[f64], tau: f64) -> Vec<f64> {
    let a = (-1.0 / tau).exp();
    let mut state = p.first().copied().unwrap_or(0.0);
    p.iter()
        .map(|v| {
            state = a * state + (1.0 - a) * v;
            state
        })
        .collect()
}

/// A dictionary of usual size: lags, rate, warm-up, drifts, cubic, steps, sinusoids, smooth
/// functions of four decoys. `size` scales the grids (1 = about 300 columns).
pub(super) fn dictionary(
    record: &Simulated,
    stream: u64,
    size: usize,
) -> Vec<super::candidates::Group> {
    use super::candidates::Group;
    let n = record.p.len();
    let map = |f: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        record
            .times
            .iter()
            .zip(&record.p)
            .map(|(t, p)| f(*t, *p))
            .collect()
    };
    let one = |c: Vec<f64>| Group {
        points: vec![vec![c]],
    };
    let length = n as f64;
    let geometric = |from: f64, to: f64, k: usize, of: usize| {
        from * (to / from).powf(k as f64 / (of - 1) as f64)
    };
    let mut groups = Vec::new();
    let lags = 20 * size;
    groups.push(Group {
        points: (0..lags)
            .map(|k| vec![lag(&record.p, geometric(2.0, 0.5 * length, k, lags))])
            .collect(),
    });
    let rate: Vec<f64> = (0..n)
        .map(|i| record.p[(i + 1).min(n - 1)] - record.p[i.saturating_sub(1)])
        .collect();
    groups.push(one(rate));
    groups.push(Group {
        points: (0..lags)
            .map(|k| {
                let tau = geometric(3.0, length, k, lags);
                vec![map(&|t, _| (-t / tau).exp())]
            })
            .collect(),
    });
    groups.push(one(map(&|t, _| t)));
    groups.push(one(map(&|t, _| (1.0 + t / 10.0).ln())));
    groups.push(one(map(&|_, p| p * p * p)));
    let steps = 30 * size;
    groups.push(Group {
        points: (0..steps)
            .map(|k| {
                let at = -0.9 + 1.8 * k as f64 / (steps - 1) as f64;
                vec![map(&|_, p| if p > at { 1.0 } else { 0.0 })]
            })
            .collect(),
    });
    let lines = 80 * size;
    groups.push(Group {
        points: (0..lines)
            .map(|k| {
                let w = std::f64::consts::TAU * geometric(2.0 / length, 0.45, k, lines);
                vec![map(&|t, _| (w * t).sin()), map(&|t, _| (w * t).cos())]
            })
            .collect(),
    });
    for decoy in 0..4u64 {
        let normals = Stream::new(500 + decoy, stream).normals(n + 4);
        let v: Vec<f64> = match decoy {
            0 => normals[..n].to_vec(),
            1 => lag(&normals[..n], 20.0),
            2 => normals[..n]
                .iter()
                .scan(0.0, |s, d| {
                    *s += d;
                    Some(*s)
                })
                .collect(),
            _ => {
                map(&|t, p| p + 0.3 * normals[n] + 0.5 * (t / length * 9.0 + normals[n + 1]).sin())
            }
        };
        let high = v.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let columns = (1..=3)
            .map(|k| v.iter().map(|v| (v / high).powi(k)).collect())
            .collect();
        groups.push(Group {
            points: vec![columns],
        });
    }
    groups
}
