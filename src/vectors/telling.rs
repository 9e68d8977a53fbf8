//! Which vectors tell damaged operations from the function, of those that ends, branches and ties do not tell.

use super::interpreter::Damage;
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
    /// Outputs, state and fault.
    fn outcome(&self, damage: Option<Damage>, words: &[i128]) -> (Vec<i128>, Vec<i128>, u32) {
        let (inputs, state) = self.split(words);
        let (mut state, mut outputs) = (state.to_vec(), Vec::new());
        let program = self.program;
        let fault = program.damaged(self.number, damage, inputs, &mut state, &mut outputs);
        (outputs, state, fault)
    }

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
        let known: Vec<_> = chosen
            .iter()
            .map(|words| self.outcome(None, words))
            .collect();
        let others: Vec<_> = candidates
            .iter()
            .map(|words| self.outcome(None, words))
            .collect();
        let mut more: Vec<Vec<i128>> = Vec::new();
        for damage in self.program.damages(self.number) {
            let tells =
                |(words, due): &(&Vec<i128>, &_)| self.outcome(Some(damage), words) != **due;
            let told = chosen.iter().zip(&known).filter(tells).take(EACH).count();
            let lacking = EACH - told;
            if lacking == 0 {
                continue;
            }
            let found = candidates.iter().zip(&others).filter(tells).take(lacking);
            let before = more.len();
            more.extend(found.map(|(words, _)| words.clone()));
            if told + more.len() - before == 0 {
                let pool = chosen.iter().chain(&candidates);
                more.extend(self.carried(damage, pool, seed + 9));
            }
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
        pool: impl Iterator<Item = &'a Vec<i128>>,
        seed: u64,
    ) -> Option<Vec<i128>> {
        let (Damage::Result(node, _)
        | Damage::Operator(node)
        | Damage::Other(node)
        | Damage::Low(node, _)
        | Damage::High(node, _)) = damage
        else {
            return None;
        };
        let is_other = |words: &&Vec<i128>| {
            let (inputs, state) = self.split(words);
            let [is, was] = [Some(damage), None]
                .map(|damage| self.program.values(self.number, damage, inputs, state)[node]);
            is != was
        };
        let near: Vec<Vec<i128>> = pool.filter(is_other).take(NEAR_BY).cloned().collect();
        let mut shaken = self.shaken(&near, SHAKEN, seed);
        shaken.iter_mut().for_each(|words| self.model.repair(words));
        let tells =
            |words: &Vec<i128>| self.outcome(Some(damage), words) != self.outcome(None, words);
        shaken.into_iter().find(tells)
    }
}
