//! States that a block can be in. A range is proved of a sum of state words where no single word's range
//! says it (the decimator's combs give a sum of bounded products): a drawn state is moved into it.

use super::interpreter::{Interpreter, low_bits};
use crate::numeric::trace::ir::{Function, Id, Interval, Op};

/// A sum of state words, modulo 2^bits and read as signed, has to lie in a range.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Repair {
    bits: u32,
    range: Interval,
    /// Words among inputs and state, each with its factor.
    terms: Vec<(usize, i128)>,
}

impl Repair {
    /// What the state of a function, and of those that it calls, has to hold.
    pub(super) fn of(program: &Interpreter, number: usize) -> Vec<Repair> {
        let inputs = program.program().functions[number].inputs.len();
        let mut all = Vec::new();
        gather(program, number, inputs, &mut all);
        all
    }

    /// Moves the first word with a factor of one, so that the sum is in its range.
    pub(super) fn apply(&self, words: &mut [i128]) {
        let value = |words: &[i128]| {
            let sum = self.terms.iter().fold(0i128, |sum, (k, factor)| {
                sum.wrapping_add(words[*k].wrapping_mul(*factor))
            });
            let shift = 128 - self.bits;
            (sum << shift) >> shift
        };
        let is = value(words);
        let Some((knob, factor)) = self.terms.iter().find(|(_, f)| f.abs() == 1) else {
            return;
        };
        if self.range.low <= is && is <= self.range.high {
            return;
        }
        let count = self.range.high - self.range.low + 1;
        let due = self.range.low + is.rem_euclid(count);
        let step = due.wrapping_sub(is).wrapping_mul(*factor);
        words[*knob] = low_bits(words[*knob].wrapping_add(step), self.bits);
    }
}

/// Adds those of a function whose state begins at `offset` of the words.
fn gather(program: &Interpreter, number: usize, offset: usize, all: &mut Vec<Repair>) {
    let function = &program.program().functions[number];
    for node in &function.nodes {
        let Op::Centered(sum, bits) = node.op else {
            continue;
        };
        let whole = Interval::of_bits(bits);
        if node.range == whole || !node.range.is_within(whole.low, whole.high) {
            continue;
        }
        let mut terms = Vec::new();
        if linear(program, number, function, sum, 1, &mut terms) {
            let terms = terms.into_iter().map(|(k, factor)| (offset + k, factor));
            all.push(Repair {
                bits,
                range: node.range,
                terms: terms.collect(),
            });
        }
    }
    for (k, call) in function.calls.iter().enumerate() {
        let start = offset + program.start_of_call(number, k);
        gather(program, call.function, start, all);
    }
}

/// The residue as a sum of state words; false if it is none.
fn linear(
    program: &Interpreter,
    number: usize,
    function: &Function,
    id: Id,
    factor: i128,
    terms: &mut Vec<(usize, i128)>,
) -> bool {
    let mut both = |a: Id, b: Id, sign: i128| {
        linear(program, number, function, a, factor, terms)
            && linear(program, number, function, b, factor * sign, terms)
    };
    match function.nodes[id].op {
        Op::ResidueAdd(a, b, _) => both(a, b, 1),
        Op::ResidueSub(a, b, _) => both(a, b, -1),
        Op::LoadResidue(slot, element) => {
            let word = program.start_of_slot(number, slot) + element;
            match terms.iter_mut().find(|(k, _)| *k == word) {
                Some((_, f)) => *f += factor,
                None => terms.push((word, factor)),
            }
            true
        }
        _ => false,
    }
}
