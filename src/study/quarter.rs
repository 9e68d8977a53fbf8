//! A design that costs a quarter less than the given one and is as good: found, or how far it is proved that there is
//! none.
//!
//! Where the search has none, the words concerned, those that by themselves move the price by `CONCERNED` at least,
//! are tried in all combinations: every length up to the given one by which the word alone is not above `HOPELESS`
//! times a limit. The other words are as in the cheapest good design that the search found. Every combination is
//! priced; every one that is cheap enough is run bit for bit. Nothing is skipped by a rule of thumb.

use super::bench::Bench;
use super::merit::Scale;
use super::space::Lengths;
use crate::error::Result;

/// The part of the given design's cost that is looked for (the issue of word-length studies sets it; convention).
pub const SHARE: f64 = 0.75;

/// A word that never moves the price by so much of the given design's is not tried (convention).
const CONCERNED: f64 = 0.005;

/// A word that alone makes a figure so many times its limit is not tried so short (convention).
const HOPELESS: f64 = 3.0;

/// Combinations at most; above, nothing is proved.
const MOST: usize = 20_000;

/// Designs that may be better in the verification than in the search are verified up to this merit.
const NEAR: f64 = 1.1;

/// What was tried for a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Tried {
    /// By number of the variable: its lengths.
    pub words: Vec<(usize, Vec<u32>)>,
    /// The lengths of the other variables; those of `words` do not count.
    pub others: Lengths,
    /// Combinations, all of them priced.
    pub designs: usize,
    /// Those that cost at most [`SHARE`] of the given design; all of them have run, or cannot.
    pub cheap: usize,
    /// The least merit of these, and which it is.
    pub best: Option<(f64, Lengths)>,
    /// Those of a merit up to `NEAR`.
    pub near: Vec<Lengths>,
}

/// The cheapest design that ran and has a merit of 1 at most.
fn cheapest_good(bench: &Bench, scale: &Scale, objective: usize) -> Option<(f64, Lengths)> {
    let all = bench.all().into_iter();
    let good = all.filter(|l| bench.space.contains(l) && bench.merit(scale, l) <= 1.0);
    let priced = good.map(|l| (bench.cost(objective, &l), l));
    priced.min_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)))
}

/// Tries the words concerned, of a target for which nothing so cheap was found; `None` where there is one, or where
/// there are too many combinations.
///
/// # Errors
/// A journal that cannot be written.
pub fn look(bench: &mut Bench, scale: &Scale, objective: usize) -> Result<Option<Tried>> {
    let given = bench.space.given();
    let unit = bench.cost(objective, &given);
    let (cost, others) = cheapest_good(bench, scale, objective).unwrap_or((unit, given.clone()));
    if cost <= SHARE * unit {
        return Ok(None);
    }
    let words = concerned(bench, scale, objective, unit);
    let designs: usize = words.iter().map(|(_, l)| l.len()).product();
    if designs > MOST || words.is_empty() {
        return Ok(None);
    }
    let combinations: Vec<Lengths> = (0..designs)
        .map(|k| {
            let mut lengths = others.clone();
            let mut rest = k;
            for (variable, own) in &words {
                lengths[*variable] = own[rest % own.len()];
                rest /= own.len();
            }
            lengths
        })
        .collect();
    bench.price(&combinations);
    let is_cheap = |l: &Lengths| bench.cost(objective, l) <= SHARE * unit;
    let cheap: Vec<Lengths> = combinations.into_iter().filter(is_cheap).collect();
    bench.run(&cheap)?;
    let mut merits: Vec<(f64, Lengths)> = cheap
        .iter()
        .map(|l| (bench.merit(scale, l), l.clone()))
        .filter(|(merit, _)| merit.is_finite())
        .collect();
    merits.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
    Ok(Some(Tried {
        words,
        others,
        designs,
        cheap: cheap.len(),
        near: merits
            .iter()
            .take_while(|(merit, _)| *merit <= NEAR)
            .take(32)
            .map(|(_, l)| l.clone())
            .collect(),
        best: merits.into_iter().next(),
    }))
}

/// The words that move the price, with the lengths that are tried.
fn concerned(bench: &Bench, scale: &Scale, objective: usize, unit: f64) -> Vec<(usize, Vec<u32>)> {
    let given = bench.space.given();
    let mut out = Vec::new();
    for (k, v) in bench.space.variables.iter().enumerate() {
        let at = |length: u32| {
            let mut lengths = given.clone();
            lengths[k] = length;
            lengths
        };
        let lengths: Vec<u32> = (v.low..=v.given.min(v.high)).collect();
        let saves = |l: &u32| bench.cost(objective, &at(*l)) <= (1.0 - CONCERNED) * unit;
        if lengths.iter().any(saves) {
            let hopeful = |l: &u32| bench.merit(scale, &at(*l)) <= HOPELESS;
            out.push((k, lengths.into_iter().filter(hopeful).collect()));
        }
    }
    out
}
