//! Where a step may switch: between two readings.

use super::Point;
use super::step::{ONCE, RELAY, SHARP};
use crate::thermal::channels::Channels;

/// How far from a threshold others are tried, in u, and how many: all of the nearest to each side, and of the others.
const NEAR: f64 = 0.1;
const NEAREST: usize = 20;
const MOST_STAIRS: usize = 60;

/// Thresholds between readings, in order.
pub(super) fn levels(u: &[f64]) -> Vec<f64> {
    let mut sorted = u.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    sorted.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect()
}

/// The up or the down threshold of a step (`axis` 0 or 1; the only one of a sharp one) moved down and up as far as it stays the
/// same in what is seen.
pub(super) fn ends(
    from: &Point,
    axis: usize,
    levels: &[f64],
    same: impl Fn(&Point) -> bool,
) -> Vec<Point> {
    let (centre, gap) = (from.theta[0], from.theta.get(1).map_or(0.0, |g| g.abs()));
    let (up, down) = (centre + 0.5 * gap, centre - 0.5 * gap);
    let moved = |level: f64| {
        let (up, down) = match (from.theta.len(), axis) {
            (1, _) => return Some(Point::at(from.form, &[level])),
            (_, 0) => (level, down),
            _ => (up, level),
        };
        (up >= down).then(|| Point::at(from.form, &[0.5 * (up + down), up - down]))
    };
    let own = if axis == 0 { up } else { down };
    let place = levels.partition_point(|l| *l < own);
    let stays = |level: &f64| moved(*level).filter(|p| same(p));
    let least = levels[..place].iter().rev().map_while(stays).last();
    let most = levels[place..].iter().map_while(stays).last();
    let ends = [least, most].map(|end| end.unwrap_or_else(|| from.clone()));
    ends.into()
}

/// Thresholds near `centre`, in order, each between two readings: the nearest ones, and every n-th where these are many.
pub(super) fn thresholds(u: &[f64], centre: f64) -> Vec<f64> {
    let near = |v: &&f64| (**v - centre).abs() < NEAR;
    let between = levels(&u.iter().filter(near).copied().collect::<Vec<f64>>());
    let every = between.len().div_ceil(MOST_STAIRS).max(1);
    let own = between.partition_point(|t| *t < centre);
    let is_tried = |k: usize| k.abs_diff(own) <= NEAREST || k.is_multiple_of(every);
    let tried = between.into_iter().enumerate();
    tried
        .filter(|(k, _)| is_tried(*k))
        .map(|(_, t)| t)
        .collect()
}

/// Rows to each side of a jump over which its size is taken, and how many jumps are looked at.
const ASIDE: usize = 3;
const JUMPS: usize = 8;

/// A jump of the error between two rows.
#[derive(Debug, Clone, Copy)]
struct Jump {
    /// u between them.
    at: f64,
    /// The temperature rises.
    rising: bool,
    /// By which the error does, deg/s.
    by_dps: f64,
}

/// The largest jumps of the error in the rows that are seen, each the largest within [`ASIDE`] rows.
fn jumps(c: &Channels, seen: &[bool]) -> Vec<Jump> {
    let pairs = c.error_dps.iter().zip(seen);
    let e: Vec<f64> = pairs.map(|(e, s)| if *s { *e } else { f64::NAN }).collect();
    let mean = |rows: std::ops::Range<usize>| {
        let (sum, count) = e[rows]
            .iter()
            .filter(|v| v.is_finite())
            .fold((0.0, 0), |s, v| (s.0 + v, s.1 + 1));
        if count > 0 {
            sum / f64::from(count)
        } else {
            f64::NAN
        }
    };
    let sizes: Vec<f64> = (ASIDE..e.len().saturating_sub(ASIDE - 1))
        .map(|i| mean(i..i + ASIDE) - mean(i - ASIDE..i))
        .map(|d| if d.is_finite() { d } else { 0.0 })
        .collect();
    let tops = (0..sizes.len()).filter(|k| {
        let around = &sizes[k.saturating_sub(ASIDE)..(k + ASIDE + 1).min(sizes.len())];
        around.iter().all(|d| d.abs() <= sizes[*k].abs())
    });
    let mut all: Vec<Jump> = tops
        .map(|k| {
            let (before, after) = (c.smooth_u[k + ASIDE - 1], c.smooth_u[k + ASIDE]);
            Jump {
                at: 0.5 * (before + after),
                rising: after > before,
                by_dps: sizes[k],
            }
        })
        .collect();
    all.sort_by(|a, b| b.by_dps.abs().total_cmp(&a.by_dps.abs()));
    all.truncate(JUMPS);
    all
}

/// Steps that switch where the error jumps: to the row, which a grid of thresholds does not hit where readings are many.
pub(super) fn at_jumps(c: &Channels, seen: &[bool]) -> Vec<Point> {
    let jumps = jumps(c, seen);
    let mut out = Vec::new();
    for jump in &jumps {
        out.push(Point::at(SHARP, &[jump.at]));
        out.push(Point::at(ONCE, &[jump.at]));
        let back = |b: &&Jump| b.rising != jump.rising && b.by_dps * jump.by_dps < 0.0;
        for other in jumps.iter().filter(back).filter(|_| jump.rising) {
            let (up, down) = (jump.at, other.at);
            if up > down {
                out.push(Point::at(RELAY, &[0.5 * (up + down), up - down]));
            }
        }
    }
    out
}
