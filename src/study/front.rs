//! Fronts of cost and merit: what is cheaper than all that are as good.

use super::space::Lengths;

/// A design with its cost and its merit.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Its lengths.
    pub lengths: Lengths,
    /// One number.
    pub cost: f64,
    /// At most 1 = within every limit.
    pub merit: f64,
}

/// The undominated points by rising cost. Of equal ones the first in the order of the lengths that differ least from
/// `given`; points that cannot be or whose merit is above `worst` do not count.
pub fn front(mut points: Vec<Point>, given: &[u32], worst: f64) -> Vec<Point> {
    points.retain(|p| p.cost.is_finite() && p.merit <= worst);
    let changes = |p: &Point| p.lengths.iter().zip(given).filter(|(a, b)| a != b).count();
    points.sort_by(|a, b| {
        let numbers = a.cost.total_cmp(&b.cost).then(a.merit.total_cmp(&b.merit));
        numbers
            .then_with(|| changes(a).cmp(&changes(b)))
            .then_with(|| a.lengths.cmp(&b.lengths))
    });
    let mut out: Vec<Point> = Vec::new();
    for point in points {
        if out.last().is_none_or(|last| point.merit < last.merit) {
            out.push(point);
        }
    }
    out
}

/// Groups of a front that a relative change of `resolution` in the merit does not tell apart, nor `apart`: each is led
/// by its cheapest; the rest are its alternatives.
pub fn resolved(
    front: Vec<Point>,
    resolution: f64,
    apart: &dyn Fn(&Point, &Point) -> bool,
) -> Vec<(Point, Vec<Point>)> {
    let mut out: Vec<(Point, Vec<Point>)> = Vec::new();
    for point in front {
        match out.last_mut() {
            Some((leader, others))
                if point.merit > leader.merit * (1.0 - resolution) && !apart(leader, &point) =>
            {
                others.push(point);
            }
            _ => out.push((point, Vec::new())),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(lengths: &[u32], cost: f64, merit: f64) -> Point {
        Point {
            lengths: lengths.to_vec(),
            cost,
            merit,
        }
    }

    #[test]
    fn a_front_has_what_nothing_beats_and_of_equals_the_nearer() {
        let points = vec![
            point(&[5, 5], 1.0, 4.0),
            point(&[4, 4], 2.0, 2.0),
            point(&[4, 5], 2.0, 2.0),
            point(&[1, 1], 3.0, 2.0),
            point(&[9, 9], 4.0, 1.97),
            point(&[9, 8], 5.0, 0.5),
            point(&[9, 7], f64::INFINITY, 0.1),
            point(&[9, 6], 0.1, 40.0),
        ];
        let front = front(points, &[5, 5], 10.0);
        let lengths: Vec<&[u32]> = front.iter().map(|p| &p.lengths[..]).collect();
        assert_eq!(lengths, [&[5, 5][..], &[4, 5], &[9, 9], &[9, 8]]);
        let sizes = |apart: &dyn Fn(&Point, &Point) -> bool| {
            let groups = resolved(front.clone(), 0.05, apart);
            groups.iter().map(|g| g.1.len()).collect::<Vec<_>>()
        };
        assert_eq!(sizes(&|_, _| false), [0, 1, 0]);
        // One that holds what is asked does not hide behind one that does not.
        assert_eq!(
            sizes(&|a, b| (a.merit <= 1.98) != (b.merit <= 1.98)),
            [0, 0, 0, 0]
        );
    }
}
