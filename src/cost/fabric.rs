//! What a program takes in an FPGA: parts at the exact widths of the words that can occur.
//!
//! Each operation is a part of its own, each call of a function an instance of its own; a loop's body is there
//! once and is passed through as often as the loop counts. Shifts by constants, casts that drop bits, and products
//! with a power of two are wires. `half_up` is the carry-in of the adder or the constant of the multiplier before it.

use super::state_sum;
use crate::numeric::cast::{Cast, round_shift};
use crate::numeric::format::Rounding;
use crate::numeric::trace::ir::{Function, Id, Interval, Op, Program, SlotKind};
use serde::Serialize;

/// Parts of an FPGA.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct Fabric {
    /// Multipliers of 25 x 18 bits, signed.
    pub multiplier_tiles: u64,
    /// Bits of adders and subtractors.
    pub adder_bits: u64,
    /// Bits of selections, limits and shifters by a variable.
    pub logic_bits: u64,
    /// Bits of the state and of what loops carry.
    pub register_bits: u64,
    /// Bits of tables.
    pub rom_bits: u64,
}

impl Fabric {
    /// Of a program.
    pub fn of(program: &Program) -> Self {
        let mut parts: Vec<Fabric> = Vec::new();
        let mut called = vec![false; program.functions.len()];
        for function in &program.functions {
            let mut own = Fabric::default();
            for id in 0..function.nodes.len() {
                own.node(program, function, id);
            }
            for l in &function.loops {
                let carried = function.nodes[l.start..l.start + l.inits.len()].iter();
                own.register_bits += carried.map(|n| u64::from(n.range.bits())).sum::<u64>();
            }
            for call in &function.calls {
                own.add(&parts[call.function]);
                called[call.function] = true;
            }
            parts.push(own);
        }
        let mut whole = Fabric::default();
        let outermost = parts.iter().zip(&called).filter(|(_, called)| !**called);
        outermost.for_each(|(part, _)| whole.add(part));
        whole.register_bits += state_sum(program, &|kind| match kind {
            SlotKind::Word(range) => u64::from(range.bits()),
            SlotKind::Residue(bits) => u64::from(bits),
        });
        let sines = program.sine_tables.iter().map(|t| &t.entries[..]);
        let indexed = program.index_tables.iter().map(|t| &t.entries[..]);
        let tables = program.tables.iter().map(|t| &t.entries[..]);
        whole.rom_bits = sines.chain(indexed).chain(tables).map(rom_bits).sum();
        whole
    }

    fn add(&mut self, other: &Fabric) {
        self.multiplier_tiles += other.multiplier_tiles;
        self.adder_bits += other.adder_bits;
        self.logic_bits += other.logic_bits;
        self.register_bits += other.register_bits;
        self.rom_bits += other.rom_bits;
    }

    fn node(&mut self, program: &Program, function: &Function, id: Id) {
        let bits = |id: Id| u64::from(function.nodes[id].range.bits());
        match &function.nodes[id].op {
            Op::Add(..) | Op::Sub(..) | Op::Neg(_) => self.adder_bits += bits(id),
            Op::ResidueAdd(_, _, ring) | Op::ResidueSub(_, _, ring) => {
                self.adder_bits += u64::from(*ring);
            }
            Op::Mul(a, b) => {
                let power = [a, b].iter().any(|id| is_power(function, **id));
                if !power {
                    self.multiplier_tiles += tiles(bits(*a) as u32, bits(*b) as u32);
                }
            }
            Op::Cast(a, number) => {
                let before = function.nodes[*a].range;
                self.cast(&program.casts[*number], before, bits(id));
            }
            Op::Limit(a, low, high) if !function.nodes[*a].range.is_within(*low, *high) => {
                self.logic_bits += 2 * bits(*a);
            }
            Op::Select(..) => self.logic_bits += bits(id),
            Op::ShiftByIndex(a) => {
                let inside = |l: &&crate::numeric::trace::ir::Loop| (l.start..l.end).contains(&id);
                let count = function.loops.iter().find(inside).map_or(1, |l| l.count);
                // Two stages of a shifter fit one table of six inputs.
                let stages = u64::from(u32::BITS - count.saturating_sub(1).leading_zeros());
                self.logic_bits += bits(*a) * stages.div_ceil(2);
            }
            _ => {}
        }
    }

    fn cast(&mut self, cast: &Cast, before: Interval, bits: u64) {
        let free = cast.shift <= 0 || matches!(cast.rounding, Rounding::Floor | Rounding::HalfUp);
        if !free {
            self.adder_bits += bits;
        }
        let (low, high) = cast.limits();
        let rounded = Interval::new(
            round_shift(before.low, cast.shift, cast.rounding),
            round_shift(before.high, cast.shift, cast.rounding),
        );
        use crate::numeric::format::Overflow;
        let wraps = matches!(cast.overflow, None | Some(Overflow::Wrap));
        if !wraps && !rounded.is_within(low, high) {
            self.logic_bits += bits;
        }
    }
}

fn is_power(function: &Function, id: Id) -> bool {
    matches!(function.nodes[id].op, Op::Constant(c) if c > 0 && c & (c - 1) == 0)
}

/// Multipliers of 25 x 18 bits for a signed product: pieces below the top are unsigned and one bit narrower.
pub fn tiles(a: u32, b: u32) -> u64 {
    let pieces =
        |bits: u32, piece: u32| u64::from(bits.saturating_sub(1).max(1).div_ceil(piece - 1));
    let one = pieces(a, 25) * pieces(b, 18);
    one.min(pieces(a, 18) * pieces(b, 25))
}

/// Entries at the width of the widest.
fn rom_bits(entries: &[i64]) -> u64 {
    let low = entries.iter().copied().min().unwrap_or(0);
    let high = entries.iter().copied().max().unwrap_or(0);
    let range = Interval::new(i128::from(low), i128::from(high));
    let sign = u32::from(low >= 0);
    entries.len() as u64 * u64::from((range.bits() - sign).max(1))
}
