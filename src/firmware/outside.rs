//! Vectors outside the inputs' ranges: a guarded function limits such words, and its limits are tested so.

use crate::emit::machine::{Lowered, Type};
use crate::vectors::model::Model;

/// Vectors by which a limit that is off by one is told, for each end of each input.
const EACH: usize = 2;
/// Vectors among which these are looked for.
const LOOKED_AT: usize = 2048;

/// Inputs just outside their ranges and at the ends of their types, each with the inputs whose outputs are due:
/// the same, limited. The state is inside its ranges. None for a function that limits nothing. From `pool`, vectors
/// inside the ranges, come the other words: those with which a limit that is off by one changes the result.
pub(super) fn rows(lowered: &Lowered, model: &Model, pool: &[Vec<i128>]) -> Vec<[Vec<i128>; 2]> {
    let ranges = &model.inputs;
    if !lowered.guarded {
        return Vec::new();
    }
    let limited = |words: &[i128]| -> Vec<i128> {
        let pairs = words.iter().zip(ranges);
        pairs
            .map(|(word, range)| (*word).clamp(range.low, range.high))
            .collect()
    };
    let mut rows = Vec::new();
    for (k, (range, ty)) in ranges.iter().zip(&lowered.inputs).enumerate() {
        let Type::Signed(width) = *ty else { continue };
        // A vector has words of 64 bits.
        let all = width
            .interval()
            .meet(i128::from(i64::MIN), i128::from(i64::MAX));
        let beside = [range.low - 1, range.high + 1, all.low, all.high];
        let is_outside = |word: &i128| {
            all.low <= *word && *word <= all.high && !(range.low..=range.high).contains(word)
        };
        for word in beside.into_iter().filter(is_outside) {
            for others in [0, i128::from(i64::MIN), i128::from(i64::MAX)] {
                let mut given: Vec<i128> = limited(&vec![others; ranges.len()]);
                model.repair(&mut given);
                given[k] = word;
                let due = limited(&given);
                rows.push([given, due]);
            }
        }
        for (end, step) in [(range.low, -1), (range.high, 1)] {
            if !is_outside(&(end + step)) {
                continue;
            }
            let with = |words: &[i128], word: i128| {
                let mut words = words.to_vec();
                words[k] = word;
                words
            };
            for wrong in [end + step, end - step] {
                let tells = |words: &&Vec<i128>| {
                    model.traced(&with(words, end)) != model.traced(&with(words, wrong))
                };
                let found = pool.iter().take(LOOKED_AT).filter(tells).take(EACH);
                rows.extend(found.map(|words| [with(words, end + step), with(words, end)]));
            }
        }
    }
    rows
}
