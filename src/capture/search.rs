//! Which effects the capture calls for: steps forward, with removal and exchange, on the sums of products.
//!
//! The objective of a set is its gain in log-likelihood less what each variant costs. A set that
//! a step forward began wrongly (a table for what are an offset and a clipping) is left by exchange.

use super::candidates::{Effect, Variant};
use super::columns::{HAT, POWER, POWERS};
use super::gram::{Combo, Detail, Solved, solve};
use std::collections::BTreeMap;

/// Less than this is no improvement.
const LEAST: f64 = 0.05;

/// A search over sets of variants.
pub struct Search<'a> {
    sums: &'a [Vec<f64>; 2],
    base: &'a [Combo],
    nuisance: &'a [(Combo, f64)],
    variants: &'a [Variant],
    gains: BTreeMap<Vec<usize>, f64>,
}

impl<'a> Search<'a> {
    /// `base` is always there; `nuisance` too, with its prior variances.
    pub fn new(
        sums: &'a [Vec<f64>; 2],
        base: &'a [Combo],
        nuisance: &'a [(Combo, f64)],
        variants: &'a [Variant],
    ) -> Self {
        Search {
            sums,
            base,
            nuisance,
            variants,
            gains: BTreeMap::new(),
        }
    }

    /// The variants.
    pub fn variants(&self) -> &'a [Variant] {
        self.variants
    }

    /// Combos of a set, the base and the nuisance first, and their ridges.
    fn combos(&self, set: &[usize]) -> (Vec<&'a Combo>, Vec<f64>) {
        combos_of(self.base, self.nuisance, self.variants, set)
    }

    /// The full solution of a set, with its combos.
    pub fn solution(&self, set: &[usize]) -> (Vec<&'a Combo>, Solved) {
        let (combos, ridge) = self.combos(set);
        let solved = solve(self.sums, &combos, &ridge, Detail::All);
        (combos, solved)
    }

    /// Standard deviations of weighted sums of a set's coefficients (weights by combo of [`Search::solution`]).
    pub fn deviations(&self, set: &[usize], weights: &[Vec<f64>]) -> Vec<f64> {
        let (combos, ridge) = self.combos(set);
        super::gram::deviations(self.sums, &combos, &ridge, weights)
    }

    /// The gain of a set beyond the base.
    pub fn gain(&mut self, set: &[usize]) -> f64 {
        let mut key = set.to_vec();
        key.sort_unstable();
        if let Some(gain) = self.gains.get(&key) {
            return *gain;
        }
        let (combos, ridge) = self.combos(&key);
        let gain = solve(self.sums, &combos, &ridge, Detail::Gain).gain;
        self.gains.insert(key, gain);
        gain
    }

    /// Gain less costs.
    pub fn objective(&mut self, set: &[usize]) -> f64 {
        let costs = set
            .iter()
            .filter_map(|k| self.variants.get(*k))
            .map(|v| v.cost);
        let costs: f64 = costs.sum();
        self.gain(set) - costs
    }

    fn effect(&self, variant: usize) -> Option<Effect> {
        self.variants.get(variant).map(|v| v.effect)
    }

    /// The variants of effects that are not in the set, but for those that are a part of one that is: a front end's
    /// bend and a converter's of the same codes are one, and the line of a bend that has one is the gain error.
    pub fn others(&self, set: &[usize]) -> Vec<usize> {
        let taken: Vec<_> = set.iter().map(|k| self.effect(*k)).collect();
        let has = |is: &dyn Fn(&Variant) -> bool| {
            set.iter().any(|k| self.variants.get(*k).is_some_and(is))
        };
        let is_bent = has(&is_bend);
        let is_lined = has(&has_line);
        let has_gain = has(&|v| v.effect == Effect::Gain);
        let is_part = |v: &Variant| {
            is_bent && is_bend(v) || is_lined && v.effect == Effect::Gain || has_gain && has_line(v)
        };
        (0..self.variants.len())
            .filter(|k| !taken.contains(&self.effect(*k)))
            .filter(|k| !self.variants.get(*k).is_some_and(is_part))
            .collect()
    }

    /// The best set that the moves find, and its objective.
    pub fn best(&mut self) -> (Vec<usize>, f64) {
        self.best_from(Vec::new())
    }

    /// The same from a set that is there.
    pub fn best_from(&mut self, mut set: Vec<usize>) -> (Vec<usize>, f64) {
        let mut score = self.objective(&set);
        for _ in 0..40 {
            let mut better: Option<(Vec<usize>, f64)> = None;
            let mut offer = |search: &mut Self, candidate: Vec<usize>| {
                let value = search.objective(&candidate);
                if value > score + LEAST && better.as_ref().is_none_or(|b| value > b.1) {
                    better = Some((candidate, value));
                }
            };
            for k in 0..set.len() {
                let mut fewer = set.clone();
                fewer.remove(k);
                for other in self.others(&fewer) {
                    let mut exchanged = fewer.clone();
                    exchanged.push(other);
                    offer(self, exchanged);
                }
                offer(self, fewer);
            }
            if set.len() > 2 {
                // One effect for all: a bend for offset, gain and harmonics.
                for other in 0..self.variants.len() {
                    offer(self, vec![other]);
                }
            }
            for straight in self.straightened(&set) {
                offer(self, straight);
            }
            for other in self.others(&set) {
                let mut more = set.clone();
                more.push(other);
                offer(self, more);
            }
            match better {
                Some((next, value)) => (set, score) = (next, value),
                None => break,
            }
        }
        (set, score)
    }

    /// A set with the variants added to it that are made of these lines alone and earn their place.
    pub fn with_lines(&mut self, mut set: Vec<usize>, lines: &[usize]) -> Vec<usize> {
        let is_line = |column: usize| {
            let mut own = lines.iter().map(|i| super::columns::line(*i));
            own.any(|(sin, cos)| column == sin || column == cos)
        };
        let is_of_lines =
            |v: &Variant| v.combos.iter().flat_map(|c| &c.parts).all(|p| is_line(p.1));
        let mut score = self.objective(&set);
        for _ in 0..2 {
            let others = self.others(&set).into_iter();
            let others = others.filter(|k| self.variants.get(*k).is_some_and(is_of_lines));
            let mut best: Option<(f64, Vec<usize>)> = None;
            for other in others.collect::<Vec<_>>() {
                let mut more = set.clone();
                more.push(other);
                let value = self.objective(&more);
                if value > best.as_ref().map_or(score + LEAST, |b| b.0) {
                    best = Some((value, more));
                }
            }
            let Some((value, more)) = best else { break };
            (score, set) = (value, more);
        }
        set
    }

    /// Sets of two in the place of a bend that a step forward may have taken for both: an offset and a gain error, or a
    /// bend of another form or of one channel beside an offset; and where harmonics are beside it, these beside
    /// a gain error or a polynomial: a bend of a tone is its harmonics and the tone.
    pub fn straightened(&self, set: &[usize]) -> Vec<Vec<usize>> {
        use Effect::{Gain, Harmonics, Nonlinearity, Offset};
        let is =
            |k: &usize, effects: &[Effect]| self.effect(*k).is_some_and(|e| effects.contains(&e));
        if !set.iter().any(|k| is(k, &[Nonlinearity])) {
            return Vec::new();
        }
        let of = |effect: Effect| (0..self.variants.len()).filter(move |k| is(k, &[effect]));
        let is_small = |k: &usize| self.variants.get(*k).is_some_and(is_polynomial);
        let beside = |first: Effect, with_tables: bool, rest: Vec<usize>| -> Vec<Vec<usize>> {
            let curves: Vec<usize> = of(Nonlinearity)
                .filter(|k| with_tables || is_small(k))
                .chain(of(Gain))
                .collect();
            let mut out = Vec::new();
            for a in of(first) {
                let allowed = self.others(&[a]);
                let both = curves.iter().filter(|b| allowed.binary_search(b).is_ok());
                out.extend(both.map(|b| rest.iter().copied().chain([a, *b]).collect()));
            }
            out
        };
        let without = |gone: &[Effect]| set.iter().copied().filter(|k| !is(k, gone)).collect();
        let mut out = beside(Offset, true, without(&[Nonlinearity, Offset, Gain]));
        if set.iter().any(|k| is(k, &[Harmonics])) {
            out.extend(beside(
                Harmonics,
                false,
                without(&[Nonlinearity, Offset, Gain, Harmonics]),
            ));
        }
        out
    }

    /// The effects that do nearly as well in the place of one of a set: best variant, and its
    /// objective less that of the set.
    pub fn rivals(&mut self, set: &[usize], member: usize) -> Vec<(Effect, f64)> {
        let score = self.objective(set);
        let fewer: Vec<usize> = set.iter().copied().filter(|k| *k != member).collect();
        let mut best: BTreeMap<Effect, f64> = BTreeMap::new();
        for other in self.others(&fewer) {
            let Some(effect) = self.effect(other) else {
                continue;
            };
            if Some(effect) == self.effect(member) {
                continue;
            }
            let mut exchanged = fewer.clone();
            exchanged.push(other);
            let value = self.objective(&exchanged) - score;
            let entry = best.entry(effect).or_insert(f64::NEG_INFINITY);
            *entry = entry.max(value);
        }
        let mut out: Vec<_> = best.into_iter().collect();
        out.sort_by(|a, b| b.1.total_cmp(&a.1));
        out
    }
}

/// Whether a variant is a function of the signal: a nonlinearity, or harmonics by powers of it.
fn is_bend(variant: &Variant) -> bool {
    let mut columns = variant.combos.iter().flat_map(|c| &c.parts);
    variant.effect == Effect::Nonlinearity
        || variant.effect == Effect::Harmonics && columns.any(|p| is_power(p.1))
}

/// Whether a variant is a bend with a line of its own: the first power, or a table.
fn has_line(variant: &Variant) -> bool {
    let mut columns = variant.combos.iter().flat_map(|c| &c.parts);
    variant.effect == Effect::Nonlinearity && columns.any(|p| p.1 == POWER || p.1 >= HAT)
}

/// Whether a variant is a nonlinearity that is a sum of powers of the signal.
fn is_polynomial(variant: &Variant) -> bool {
    let mut columns = variant.combos.iter().flat_map(|c| &c.parts);
    variant.effect == Effect::Nonlinearity && columns.all(|p| p.1 < HAT)
}

/// Whether a column is a power of the signal.
fn is_power(column: usize) -> bool {
    (POWER..POWER + POWERS).contains(&column)
}

/// Combos of a set, the base and the nuisance first, and their ridges.
pub fn combos_of<'a>(
    base: &'a [Combo],
    nuisance: &'a [(Combo, f64)],
    variants: &'a [Variant],
    set: &[usize],
) -> (Vec<&'a Combo>, Vec<f64>) {
    let mut combos: Vec<&Combo> = base.iter().collect();
    let mut ridge = super::candidates::base_ridge(base);
    for (combo, variance) in nuisance {
        combos.push(combo);
        ridge.push(1.0 / variance);
    }
    let chosen = set.iter().filter_map(|k| variants.get(*k));
    combos.extend(chosen.flat_map(|v| &v.combos));
    ridge.resize(combos.len(), 0.0);
    (combos, ridge)
}

#[cfg(test)]
mod tests {
    use super::super::candidates::variants;
    use super::super::columns::ALL;
    use super::super::synthetic::{AMPLITUDE, Made, model};
    use super::*;

    /// All variants of a capture.
    fn all() -> Vec<Variant> {
        let made = Made::CLEAN;
        let (known, model) = model(&made.capture(), &made);
        let free = [[0.0, -AMPLITUDE], [61.7, 20.2]];
        variants(&known, &model, free, made.rows, false)
    }

    fn first(variants: &[Variant], effect: Effect) -> usize {
        variants.iter().position(|v| v.effect == effect).unwrap()
    }

    #[test]
    fn a_bend_is_not_beside_another_bend() {
        let variants = all();
        let sums = [vec![0.0; (ALL + 1).pow(2)], vec![0.0; (ALL + 1).pow(2)]];
        let search = Search::new(&sums, &[], &[], &variants);
        let bend = first(&variants, Effect::Nonlinearity);
        let others = search.others(&[bend]);
        let harmonics = others
            .iter()
            .filter(|k| variants[**k].effect == Effect::Harmonics);
        let powers = |k: &usize| variants[*k].combos.iter().any(|c| is_power(c.parts[0].1));
        assert!(harmonics.clone().count() > 20);
        assert!(!harmonics.clone().any(powers));
    }

    #[test]
    fn a_gain_error_is_not_beside_a_bend_that_has_a_line() {
        let variants = all();
        let sums = [vec![0.0; (ALL + 1).pow(2)], vec![0.0; (ALL + 1).pow(2)]];
        let search = Search::new(&sums, &[], &[], &variants);
        let gain = first(&variants, Effect::Gain);
        let with = |set: &[usize], other: usize| search.others(set).contains(&other);
        let bends = || (0..variants.len()).filter(|k| variants[*k].effect == Effect::Nonlinearity);
        let lines = bends().filter(|k| has_line(&variants[*k]));
        assert!(lines.clone().count() > 20 && bends().any(|k| !has_line(&variants[k])));
        for bend in bends() {
            let apart = !has_line(&variants[bend]);
            assert_eq!((with(&[bend], gain), with(&[gain], bend)), (apart, apart));
        }
    }

    #[test]
    fn a_bend_beside_harmonics_may_be_a_gain_error_beside_others() {
        let variants = all();
        let sums = [vec![0.0; (ALL + 1).pow(2)], vec![0.0; (ALL + 1).pow(2)]];
        let search = Search::new(&sums, &[], &[], &variants);
        let set = [Effect::Nonlinearity, Effect::Harmonics].map(|e| first(&variants, e));
        let is = |set: &Vec<usize>| {
            let mut effects: Vec<Effect> = set.iter().map(|k| variants[*k].effect).collect();
            effects.sort();
            effects == [Effect::Gain, Effect::Harmonics]
        };
        assert!(search.straightened(&set).iter().any(is));
    }

    #[test]
    fn a_table_of_both_channels_may_be_one_of_the_drive_beside_an_offset() {
        let variants = all();
        let sums = [vec![0.0; (ALL + 1).pow(2)], vec![0.0; (ALL + 1).pow(2)]];
        let search = Search::new(&sums, &[], &[], &variants);
        let is_table = |v: &Variant| v.effect == Effect::Nonlinearity && v.combos.len() > 12;
        let channels = |v: &Variant| -> Vec<usize> {
            let mut all: Vec<usize> = v
                .combos
                .iter()
                .flat_map(|c| &c.parts)
                .map(|p| p.0)
                .collect();
            all.sort_unstable();
            all.dedup();
            all
        };
        let of = |wanted: &[usize]| {
            let is = |v: &Variant| is_table(v) && channels(v) == wanted;
            variants.iter().position(is).unwrap()
        };
        let offset = variants
            .iter()
            .position(|v| v.effect == Effect::Offset && channels(v) == [1] && v.combos.len() == 1);
        let wanted = [offset.unwrap(), of(&[0])];
        assert!(
            search
                .straightened(&[of(&[0, 1])])
                .iter()
                .any(|s| *s == wanted)
        );
    }
}
