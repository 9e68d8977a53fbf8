//! From a recorded program to what the engine needs: how wide its lanes have to be, and which casts
//! the ranges prove idle.

use super::ir::{Function, Interval, Op, Program};
use crate::numeric::cast::{Cast, rounding_intermediate};
use crate::numeric::format::Overflow;

impl Program {
    /// The widest signed word, in bits, that evaluating the function (without its callees) makes,
    /// the sums inside a rounding among them. Where only the low 64 bits are looked at (a wrap
    /// follows), a word may be wider than its lane and does not count.
    pub fn word_bits(&self, function: &Function) -> u32 {
        let modular = function.modular();
        let of_node = |(id, node): (usize, &super::ir::Node)| {
            if modular[id] || !is_word(&node.op) {
                return 1;
            }
            match node.op {
                Op::Cast(a, number) => {
                    let cast = &self.casts[number];
                    let before = function.nodes[a].range;
                    node.range.bits().max(intermediate_bits(cast, before))
                }
                _ => node.range.bits(),
            }
        };
        let nodes = function.nodes.iter().enumerate().map(of_node);
        let inputs = function.inputs.iter().map(|(_, range)| range.bits());
        nodes.chain(inputs).max().unwrap_or(1)
    }

    /// [`Program::word_bits`] over a function and everything that it calls.
    pub fn word_bits_deep(&self, function: usize) -> u32 {
        let f = &self.functions[function];
        f.calls
            .iter()
            .map(|call| self.word_bits_deep(call.function))
            .fold(self.word_bits(f), u32::max)
    }

    /// True if no word that reaches the cast is ever outside its limits.
    pub fn is_proved_in_range(&self, number: usize) -> bool {
        let (low, high) = self.casts[number].limits();
        self.cast_ranges[number].is_some_and(|r| r.is_within(low, high))
    }

    /// By what the first loop of a function carries: true where an iteration ends with a wrap of it that never
    /// changes a word.
    pub fn idle_wraps(&self, function: &str) -> Vec<bool> {
        let Some(function) = self.function(function) else {
            return Vec::new();
        };
        let is_idle = |id: &usize| match function.nodes[*id].op {
            Op::Wrap(before, bits) => {
                let all = Interval::of_bits(bits);
                function.nodes[before].range.is_within(all.low, all.high)
            }
            _ => false,
        };
        let first = function.loops.first();
        first.map_or(Vec::new(), |l| l.outs.iter().map(is_idle).collect())
    }
}

/// The bits of what a cast computes on the way from a word in `before` to its result.
fn intermediate_bits(cast: &Cast, before: Interval) -> u32 {
    if cast.shift <= 0 && cast.overflow == Some(Overflow::Wrap) && cast.target.bits <= 64 {
        return 1;
    }
    let (low, high) = rounding_intermediate(cast, before.low, before.high);
    Interval::new(low, high).bits()
}

/// True if the node is a word (and its range means something).
pub fn is_word(op: &Op) -> bool {
    !matches!(
        op,
        Op::LoadResidue(..)
            | Op::Residue(..)
            | Op::ResidueConstant(..)
            | Op::ResidueAdd(..)
            | Op::ResidueSub(..)
            | Op::IsNegative(_)
            | Op::Call(_)
    )
}
