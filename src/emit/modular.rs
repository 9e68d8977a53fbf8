//! Which values are computed modulo 2^32, 2^64 or 2^128: those of which only low bits are looked at and
//! whose words may be wider than that.

use super::machine::Width;
use crate::numeric::trace::ir::{Function, Id, Interval, Op};

/// What a loop carries modulo 2^bits: wrapped once after the loop instead of in each of its turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Deferred {
    /// The node that is wrapped at the end of a turn.
    pub(super) before: Id,
    /// The width of the wrap.
    pub(super) bits: u32,
}

/// If value `k` of a loop is wrapped at the end of each turn, and nothing in the loop looks at more than its
/// low bits: sums and differences of which only low bits count.
pub(super) fn deferred(function: &Function, number: usize, k: usize) -> Option<Deferred> {
    let l = &function.loops[number];
    let (phi, out) = (l.start + k, *l.outs.get(k)?);
    let Op::Wrap(before, bits) = function.nodes[out].op else {
        return None;
    };
    let modular = function.modular();
    let users = |id: Id| {
        let nodes = 0..function.nodes.len();
        nodes.filter(move |user| function.operands(*user).contains(&id))
    };
    // Of the phi: sums of which nothing but these low bits are looked at.
    let looks_low = |user: Id| {
        let is_sum = matches!(function.nodes[user].op, Op::Add(..) | Op::Sub(..));
        is_sum && modular[user] && users(user).all(|u| wraps(function, u, bits, &users))
    };
    let kept = function.outputs.iter().map(|(_, id)| *id);
    let kept = kept.chain(function.stores.iter().map(|(_, _, id)| *id));
    let carried = function
        .loops
        .iter()
        .flat_map(|l| l.outs.iter().chain(&l.inits));
    let is_alone = users(out).next().is_none()
        && !kept.chain(carried.copied()).any(|id| id == phi)
        && function
            .loops
            .iter()
            .flat_map(|l| &l.outs)
            .filter(|id| **id == out)
            .count()
            == 1;
    let all = Interval::of_bits(bits);
    let acts = !function.nodes[before].range.is_within(all.low, all.high);
    (acts && is_alone && modular[before] && users(phi).all(looks_low))
        .then_some(Deferred { before, bits })
}

/// The node wraps to `bits` bits, itself or behind selections.
fn wraps<I: Iterator<Item = Id>>(
    function: &Function,
    id: Id,
    bits: u32,
    users: &impl Fn(Id) -> I,
) -> bool {
    match function.nodes[id].op {
        Op::Wrap(_, b) => b == bits,
        Op::Select(..) => {
            users(id).all(|u| matches!(function.nodes[u].op, Op::Wrap(_, b) if b == bits))
        }
        _ => false,
    }
}

/// For each node that is computed modulo a power of two, the width.
pub(super) fn widths(function: &Function) -> Vec<Option<Width>> {
    let mut modular = function.modular();
    let mut bits = vec![0u32; function.nodes.len()];
    for id in (0..function.nodes.len()).rev() {
        let wanted = match function.nodes[id].op {
            Op::Wrap(_, b) | Op::Residue(_, b) => b,
            _ if modular[id] => bits[id],
            _ => continue,
        };
        for operand in function.operands(id) {
            bits[operand] = bits[operand].max(wanted);
        }
    }
    let mut of_deferred = vec![false; function.nodes.len()];
    for (number, l) in function.loops.iter().enumerate() {
        for k in (0..l.outs.len()).filter(|k| deferred(function, number, *k).is_some()) {
            of_deferred[l.start + k] = true;
        }
    }
    // A word that fits is a plain signed one. Operands of a selection come before it.
    for id in 0..function.nodes.len() {
        let node = &function.nodes[id];
        let width = Width::of_bits(bits[id]);
        let of_words = match node.op {
            Op::Select(_, a, b) => !modular[a] && !modular[b],
            _ => true,
        };
        // A selection is narrowed by what is proved of it, whatever its branches.
        let fits = |range: Interval| Width::of_range(range) <= width;
        let is_carried = function.operands(id).iter().any(|a| of_deferred[*a]);
        if modular[id] && of_words && !is_carried && fits(node.range) {
            modular[id] = false;
        }
    }
    (0..function.nodes.len())
        .map(|id| modular[id].then(|| Width::of_bits(bits[id])))
        .collect()
}
