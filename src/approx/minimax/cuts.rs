//! Cuts of the enumeration by linear programming.
//!
//! With coordinates z_k and above fixed, the error at point m is r_m - sum over j < k of b_j(m) z_j. If weights v_m
//! with sum of |v_m| = 1 are orthogonal to every b_j, j < k, the largest error is at least
//! |sum of v_m r_m| whatever the remaining coordinates are, real or integer. The best v is the dual solution of
//! a discrete Chebyshev approximation ([`super::exchange`]); once found, it holds for every node of its
//! level, where it costs one short inner product. This is what the ellipsoid lacks where the optimum is close
//! to the real minimax error, for the body of good polynomials is nearly a simplex there.

use super::exchange::{self, Place};
use super::problem::Frame;
use super::samples::Point;
use super::wide::{Wide, dot};
use std::f64::consts::PI;

/// Steps of a linear programme at most.
const MOST_STEPS: u64 = 40;
/// Steps that one commonly takes.
const COMMON_STEPS: u64 = 5;
/// Cuts kept a level.
const MOST_CUTS: usize = 48;
/// Slack against rounding, relative.
const SLACK: f64 = 1e-8;

/// sum of v_m r_m as a function of the fixed coordinates.
struct Cut {
    offset: f64,
    /// Of coordinates k and above.
    slopes: Vec<f64>,
}

/// The cuts found so far.
pub(super) struct Cuts<'f> {
    frame: &'f Frame,
    /// Points that are looked at, ascending.
    points: Vec<usize>,
    /// `[free coordinates]`
    cuts: Vec<Vec<Cut>>,
    /// Volume of the unit ball over the lattice's in the first k coordinates.
    density: Vec<f64>,
}

impl<'f> Cuts<'f> {
    pub fn new(frame: &'f Frame) -> Self {
        let n = frame.transform.len();
        let mut points = frame.order.clone();
        // Places where the coordinates change nothing tell nothing.
        points.retain(|m| {
            let row = frame.rows.get(*m);
            row.is_some_and(|row| row.iter().any(|b| b.abs() > f64::MIN_POSITIVE))
        });
        points.truncate(12 * n);
        points.sort_unstable();
        let mut density = vec![1.0, 2.0 / frame.ball.side(0)];
        let mut volume = vec![1.0, 2.0];
        let mut cell = frame.ball.side(0);
        for k in 2..=n {
            volume.push(volume[k - 2] * 2.0 * PI / k as f64);
            cell *= frame.ball.side(k - 1);
            density.push(volume[k] / cell);
        }
        Cuts {
            frame,
            points,
            cuts: (0..=n).map(|_| Vec::new()).collect(),
            density,
        }
    }

    /// True if no completion of the coordinates `free` and above has an error up to `limit`; `room` is
    /// what the ball leaves of its squared radius. The second number is the cost.
    pub fn excludes(&mut self, free: usize, z: &[i64], limit: f64, room: f64) -> (bool, u64) {
        let bound = limit * (1.0 + SLACK);
        let list = &mut self.cuts[free];
        let hit = list.iter().position(|cut| {
            let known = cut.slopes.iter().zip(&z[free..]);
            let value = known.fold(cut.offset, |v, (s, &z)| v - s * z as f64);
            value.abs() > bound
        });
        if let Some(place) = hit {
            list[..=place].rotate_right(1);
            return (true, 0);
        }
        let below = self.density[free] * room.max(0.0).powf(0.5 * free as f64);
        let step = self.step_cost(free);
        if below < (step * COMMON_STEPS) as f64 {
            return (false, 0);
        }
        let mut cost = step;
        match self.programme(free, z, bound, &mut cost) {
            Some(cut) => {
                let list = &mut self.cuts[free];
                list.insert(0, cut);
                list.truncate(MOST_CUTS);
                (true, cost)
            }
            None => (false, cost),
        }
    }

    /// What a step of a programme costs, in nodes: it solves three systems and looks at all points.
    fn step_cost(&self, free: usize) -> u64 {
        let n = free as u64 + 1;
        2 * n * n * n + self.points.len() as u64 * n / 2
    }

    /// A cut that excludes these coordinates, if there is one.
    fn programme(&self, free: usize, z: &[i64], bound: f64, cost: &mut u64) -> Option<Cut> {
        let places: Vec<Place> = self
            .points
            .iter()
            .map(|&m| self.place(m, free, z))
            .collect();
        let last = places.len().checked_sub(1)?;
        let mut chosen: Vec<usize> = (0..=free).map(|k| k * last / free.max(1)).collect();
        let mut reference: Vec<Place> = chosen.iter().map(|&k| places[k].clone()).collect();
        let mut solved = exchange::levelled(&reference)?;
        for _ in 0..MOST_STEPS {
            *cost += self.step_cost(free);
            if solved.error > bound {
                return self.cut(&chosen, &solved.weights(), free);
            }
            let mut worst = (0, 0.0f64);
            for (k, p) in places.iter().enumerate() {
                let e = (p.point.value - dot(&solved.coefficients, &p.row)).hi;
                if e.abs() > worst.1.abs() {
                    worst = (k, e);
                }
            }
            if worst.1.abs() <= bound || chosen.contains(&worst.0) {
                return None;
            }
            let entering = places[worst.0].clone();
            let sign = worst.1.signum();
            let (next, left) = exchange::exchange_at(&mut reference, &solved, entering, sign)?;
            chosen[left] = worst.0;
            solved = next;
        }
        None
    }

    fn place(&self, m: usize, free: usize, z: &[i64]) -> Place {
        let row = &self.frame.rows[m];
        let known = row[free..].iter().zip(&z[free..]);
        let value = known.fold(self.frame.errors[m], |e, (b, &z)| e - b * z as f64);
        Place {
            point: Point {
                x: 0.0,
                value: Wide::from(value),
                weight: 1.0,
            },
            row: row[..free].iter().map(|&b| Wide::from(b)).collect(),
        }
    }

    fn cut(&self, chosen: &[usize], weights: &[f64], free: usize) -> Option<Cut> {
        let n = self.frame.transform.len();
        let mut cut = Cut {
            offset: 0.0,
            slopes: vec![0.0; n - free],
        };
        let mut rest = vec![0.0; free];
        let mut size = 0.0f64;
        for (&k, &v) in chosen.iter().zip(weights) {
            let m = self.points[k];
            let row = &self.frame.rows[m];
            cut.offset += v * self.frame.errors[m];
            for (s, b) in cut.slopes.iter_mut().zip(&row[free..]) {
                *s += v * b;
            }
            for (r, b) in rest.iter_mut().zip(&row[..free]) {
                *r += v * b;
                size = size.max(b.abs());
            }
        }
        // Orthogonal but for rounding, or not to be trusted.
        rest.iter().all(|r| r.abs() <= 1e-13 * size).then_some(cut)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::approx::minimax::{
        Basis, CoefficientFormat, Monomials, Problem, Samples, Weight, minimax,
    };
    use std::collections::BTreeSet;

    /// With and without cuts the same points are good; with them far fewer nodes are visited.
    #[test]
    fn no_good_point_is_cut() {
        let f = |x: f64| x.sqrt();
        let basis = Basis::new(Monomials::All, 3).unwrap();
        let samples = Samples::new(&f, &basis, 0.25, 1.0, Weight::Absolute).unwrap();
        let real = minimax(&samples).unwrap();
        let problem = Problem::new(&samples, &real, &[CoefficientFormat::unlimited(13)]).unwrap();
        let limit = 1.06 * real.error;
        let frame = problem.frame(&problem.rounded.raw, limit, None).unwrap();
        let run = |cutting: bool| {
            let mut cuts = Cuts::new(&frame);
            let mut good = BTreeSet::new();
            let mut scratch = vec![0.0; frame.errors.len()];
            let (nodes, complete) = frame.ball.visit(
                limit * limit * (1.0 + 1e-9),
                50_000_000,
                &mut |free, z, room| match cutting {
                    true => cuts.excludes(free, z, limit, room),
                    false => (false, 0),
                },
                &mut |z| {
                    if frame.errors_within(z, limit, &mut scratch).is_some() {
                        good.insert(z.to_vec());
                    }
                    (limit * limit * (1.0 + 1e-9), 0)
                },
            );
            assert!(complete);
            (good, nodes)
        };
        let ((with, few), (without, many)) = (run(true), run(false));
        println!("{} good, {few} nodes with cuts, {many} without", with.len());
        assert!(with.len() > 5);
        assert_eq!(with, without);
        assert!(2 * few < many);
    }
}
