//! Which vectors tell damaged operations from the function, of those that ends, branches and ties do not tell.

use super::damage::Damage;
use super::incremental::Dependents;
use super::interpreter::Evaluated;
use super::search::Search;
use super::stimulus;

/// Vectors that a damage is told by, where so many are found.
const EACH: usize = 2;
/// Random vectors among which damage is searched: fewer, the longer the function.
const CANDIDATES: usize = 1 << 14;
/// Operations of the whole search for one damage.
const OPERATIONS: usize = 1 << 20;
/// Vectors at which a damaged operation has another value, from which one is sought that shows it.
const NEAR_BY: usize = 16;
/// Vectors tried for that.
const SHAKEN: usize = 1024;

impl Search<'_> {
    /// Vectors that tell damage, of which the others do not tell enough.
    pub(super) fn telling(&self, chosen: &mut Vec<Vec<i128>>, seed: u64) {
        let work: usize = self.function.nodes.len()
            + self
                .function
                .loops
                .iter()
                .map(|l| (l.end - l.start) * l.count as usize)
                .sum::<usize>();
        let count = (OPERATIONS / work.max(1)).clamp(256, CANDIDATES);
        let mut candidates: Vec<_> =
            stimulus::random(&self.model.inputs, count / 2, seed + 4).collect();
        candidates.extend(self.shaken(chosen, count / 2, seed + 8));
        candidates
            .iter_mut()
            .for_each(|words| self.model.repair(words));
        let evaluated = |words: &Vec<i128>| self.caller.evaluated(words);
        let mut known: Vec<_> = chosen.iter().map(evaluated).collect();
        let mut others: Vec<_> = candidates.iter().map(evaluated).collect();
        let mut more: Vec<Vec<i128>> = Vec::new();
        for damage in self.program.damages(self.number) {
            let dependents = self.caller.dependents(damage);
            let tells = |(words, call): (&'_ Vec<i128>, &mut Evaluated)| {
                let differs = self.caller.differs(damage, &dependents, words, call);
                differs.then(|| words.clone())
            };
            let of_known = chosen.iter().zip(&mut known);
            let told = of_known.filter_map(&tells).take(EACH).count();
            let of_others = candidates.iter().zip(&mut others);
            let found: Vec<_> = of_others.filter_map(&tells).take(EACH - told).collect();
            if told + found.len() == 0 {
                let of_known = chosen.iter().zip(&mut known);
                let pool = of_known.chain(candidates.iter().zip(&mut others));
                more.extend(self.carried(damage, &dependents, pool, seed + 9));
            }
            more.extend(found);
        }
        chosen.extend(more);
    }

    /// Vectors in which some words are those of a chosen one, so that it may stay on its branch or tie, and the
    /// others ends or random words.
    fn shaken(&self, chosen: &[Vec<i128>], count: usize, seed: u64) -> Vec<Vec<i128>> {
        let mut lcg = stimulus::Lcg(seed);
        let mut shake = |words: &Vec<i128>| {
            let ranges = words.iter().zip(&self.model.inputs);
            let moved = ranges.map(|(word, range)| match lcg.draw() >> 62 {
                0 => lcg.word(*range),
                1 => [range.low, range.high][(lcg.draw() >> 63) as usize],
                _ => *word,
            });
            moved.collect()
        };
        let step = |k: usize| k * chosen.len() / count.max(1);
        (0..count)
            .filter_map(|k| chosen.get(step(k)).map(&mut shake))
            .collect()
    }

    /// A vector that tells a damage which none of `pool` tells: from those at which the damaged operation has another
    /// value, which is lost on the way to the outputs, the other words are moved until it arrives.
    fn carried<'a>(
        &self,
        damage: Damage,
        dependents: &Dependents,
        pool: impl Iterator<Item = (&'a Vec<i128>, &'a mut Evaluated)>,
        seed: u64,
    ) -> Option<Vec<i128>> {
        let moves = |(words, call): (&'a Vec<i128>, &'a mut Evaluated)| {
            let moves = self.caller.moves(damage, dependents, words, call);
            moves.then(|| words.clone())
        };
        let near: Vec<Vec<i128>> = pool.filter_map(moves).take(NEAR_BY).collect();
        let mut shaken = self.shaken(&near, SHAKEN, seed);
        shaken.iter_mut().for_each(|words| self.model.repair(words));
        shaken.into_iter().find(|words| {
            let mut call = self.caller.evaluated(words);
            self.caller.differs(damage, dependents, words, &mut call)
        })
    }
}
