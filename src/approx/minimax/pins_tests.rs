use super::*;
use crate::approx::minimax::{
    Basis, CoefficientFormat, Minimax, Monomials, Samples, Target, Weight, minimax,
};

fn with_problem<R>(
    f: &dyn Target,
    (kind, degree): (Monomials, u32),
    (low, high): (f64, f64),
    bits: &[i32],
    look: impl FnOnce(&Problem) -> R,
) -> R {
    let basis = Basis::new(kind, degree).unwrap();
    let samples = Samples::new(f, &basis, low, high, Weight::Absolute).unwrap();
    let real: Minimax = minimax(&samples).unwrap();
    let formats: Vec<CoefficientFormat> = bits
        .iter()
        .map(|b| CoefficientFormat::unlimited(*b))
        .collect();
    look(&Problem::new(&samples, &real, &formats).unwrap())
}

/// True if `raw` is the branch's base and whole multiples of its rows.
fn holds(branch: &Branch, raw: &[i128]) -> bool {
    let rows = &branch.transform;
    let mut rest: Vec<i128> = raw.iter().zip(&branch.base).map(|(a, b)| a - b).collect();
    for (i, row) in rows.iter().enumerate() {
        // The coefficient that this row alone changes.
        let own = (0..row.len())
            .find(|k| row[*k] == 1 && rows.iter().enumerate().all(|(j, r)| j == i || r[*k] == 0));
        let factor = rest[own.unwrap()];
        rest.iter_mut().zip(row).for_each(|(r, v)| *r -= factor * v);
    }
    rest.iter().all(|r| *r == 0)
}

fn box_around(place: &[i128], reach: i128) -> Vec<Vec<i128>> {
    let mut all = vec![Vec::new()];
    for &c in place {
        let longer = all.iter().flat_map(|head: &Vec<i128>| {
            (c - reach..=c + reach).map(move |v| [head.as_slice(), &[v]].concat())
        });
        all = longer.collect();
    }
    all
}

type Case<'a> = (&'a dyn Target, (Monomials, u32), (f64, f64), &'a [i32]);

/// Every choice of coefficients is in one branch, and only in one; and the best of all branches is that of trying
/// everything nearby.
#[test]
fn the_branches_are_everything_and_their_best_is_the_best() {
    let root = |x: f64| (x + 0.3).sqrt();
    let power = |x: f64| x.powf(2.5);
    let cosine = |x: f64| x.cos();
    let sine = |x: f64| (1.5 * x).sin();
    let wave = |x: f64| 0.6 * (x + 0.4).sin();
    use Monomials::{All, Even, Odd};
    let cases: [Case; 7] = [
        (&root, (All, 3), (0.0, 1.0), &[6]),
        (&power, (All, 3), (0.0, 1.0), &[5, 7, 6, 8]),
        (&cosine, (Even, 4), (-1.0, 1.0), &[7, 6, 5]),
        (&sine, (Odd, 5), (0.0, 1.0), &[6, 7, 5]),
        (&wave, (All, 3), (-1.0, 0.5), &[5]),
        (&wave, (All, 3), (-0.8, 0.4), &[5]),
        (&sine, (Odd, 5), (-1.0, 0.2), &[4, 6, 5]),
    ];
    for (f, basis, ends, bits) in cases {
        let what = format!("{basis:?} on {ends:?}");
        with_problem(f, basis, ends, bits, |problem| {
            let tried = box_around(&problem.rounded.raw, 6);
            let errors: Vec<f64> = tried.iter().map(|raw| problem.error(raw)).collect();
            let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
            let limit = (4.0 * least).max(problem.rounded.error);
            let branches = problem.branches(limit).expect("a place");
            let mut inside = 0;
            for (raw, error) in tried.iter().zip(&errors) {
                let count = branches.iter().filter(|b| holds(b, raw)).count();
                assert!(count <= 1, "{what} {raw:?}: {count} branches");
                if *error <= limit * (1.0 - 1e-9) {
                    assert_eq!(count, 1, "{what} {raw:?}");
                    inside += 1;
                }
            }
            let mut best = problem.rounded.clone();
            let all = problem.improve_by_branches(&mut best, Budget { nodes: 5_000_000 });
            println!(
                "{what}: {} branches, {inside} inside, least {least:e}, {all:?}",
                branches.len()
            );
            assert!(all.1, "{what}");
            // Nothing in the box is better; what is better beyond it is allowed.
            assert!(best.error <= least * (1.0 + 1e-9), "{what}");
            let again = problem.error(&best.raw);
            assert!((again - best.error).abs() <= 1e-12 * again, "{what}");
        });
    }
}

/// Where many coefficients share the error of one LSB at an end, the best ones are found and proved.
#[test]
fn plateaus_are_left_with_proof() {
    let power = |x: f64| x.powf(2.5);
    let bell = |x: f64| 1.0 / (1.0 + x * x);
    type Plateau<'a> = (&'a dyn Target, u32, (f64, f64), f64);
    let cases: [Plateau; 4] = [
        (&power, 5, (0.0, 1.0), 1.0224e-4),
        (&bell, 6, (-0.9, 0.2), 9.118e-5),
        (&bell, 6, (0.0, 1.0), 1.468e-5),
        (&bell, 8, (-0.9, 0.2), 3.895e-6),
    ];
    for (f, degree, ends, most) in cases {
        with_problem(f, (Monomials::All, degree), ends, &[13], |problem| {
            let best = problem.best(Budget { nodes: 2_000_000 }).unwrap();
            assert!(best.proved, "{degree} {ends:?}: {}", best.error);
            assert!(best.error <= most, "{degree} {ends:?}: {}", best.error);
        });
    }
}
