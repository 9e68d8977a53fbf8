//! Where the inputs of missing codes went: to the code below a gap, to the one above, or each to the nearer.

use super::code_counts::{Counts, Run};

/// Where the rows of a gap may go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    /// All to the code below.
    Below,
    /// All to the code above.
    Above,
    /// Each to the nearer one; of an odd number the one in the middle goes below.
    Nearer,
    /// The same, the one in the middle above.
    NearerAbove,
}

const WAYS: [Way; 4] = [Way::Below, Way::Above, Way::Nearer, Way::NearerAbove];

impl Way {
    /// How many codes of a gap of `length` go below.
    fn below(self, length: i64) -> i64 {
        match self {
            Way::Below => length,
            Way::Above => 0,
            Way::Nearer => (length + 1) / 2,
            Way::NearerAbove => length / 2,
        }
    }
}

/// By channel, the code that each missing one's inputs get, less itself: for all gaps the same way, unless ways of
/// their own make the counts beside them likelier by more than the choices (or `together`, for an even spacing).
pub fn of(counts: &[Option<Counts>; 2], gaps: &[Vec<Run>; 2], together: bool) -> [Vec<f64>; 2] {
    let likely = |c: usize, gap: &Run| {
        let counts = counts.get(c).and_then(Option::as_ref);
        WAYS.map(|way| counts.map_or(0.0, |counts| likelihood(counts, gap, way)))
    };
    let all: Vec<[f64; 4]> = (gaps.iter().enumerate())
        .flat_map(|(c, gaps)| gaps.iter().map(move |gap| likely(c, gap)))
        .collect();
    let mut sums = [0.0; 4];
    for one in &all {
        sums.iter_mut().zip(one).for_each(|(sum, l)| *sum += l);
    }
    let common = best(&sums);
    let choices = (WAYS.len() as f64).ln() * all.len().saturating_sub(1) as f64;
    let each: f64 = all.iter().map(|one| best(one).1).sum::<f64>() - choices;
    let mut ways = all.iter().map(|one| match together || common.1 >= each {
        true => common.0,
        false => best(one).0,
    });
    gaps.each_ref().map(|gaps| {
        let ways = ways.by_ref().take(gaps.len());
        gaps.iter()
            .zip(ways)
            .flat_map(|(gap, way)| moves(gap, way))
            .collect()
    })
}

/// The likeliest way, and its log-likelihood.
fn best(likelihoods: &[f64; 4]) -> (Way, f64) {
    let all = WAYS.into_iter().zip(*likelihoods);
    all.fold((Way::Below, f64::NEG_INFINITY), |best, one| {
        if one.1 > best.1 { one } else { best }
    })
}

/// Of the counts at both sides of a gap, Poisson about what is expected there with what comes from the gap.
fn likelihood(counts: &Counts, gap: &Run, way: Way) -> f64 {
    let split = gap.first + way.below(gap.last - gap.first + 1);
    let sum = |from: i64, to: i64| (from..to).map(|code| counts.expected(code)).sum::<f64>();
    let sides = [
        (gap.first - 1, sum(gap.first, split)),
        (gap.last + 1, sum(split, gap.last + 1)),
    ];
    let one = |(code, moved): (i64, f64)| {
        let mean = (counts.expected(code) + moved).max(0.5);
        counts.seen(code) * mean.ln() - mean
    };
    sides.into_iter().map(one).sum()
}

/// What each code of a gap moves by.
fn moves(gap: &Run, way: Way) -> impl Iterator<Item = f64> {
    let (first, last) = (gap.first, gap.last);
    let split = first + way.below(last - first + 1);
    (first..=last).map(move |code| match code < split {
        true => (first - 1 - code) as f64,
        false => (last + 1 - code) as f64,
    })
}
