//! What a function alone costs, as `approx` compares its forms.

use super::{Target, of_functions};
use crate::emit::views::entry_type;
use crate::numeric::format::Format;
use crate::numeric::trace::ir::{Op, Program};
use serde::Serialize;

/// Bytes of read-only memory that weigh as much as a cycle.
pub const BYTES_A_CYCLE: u64 = 32;

/// What a form costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct FunctionCost {
    /// Tables and coefficients at the widths of their types.
    pub rom_bytes: u64,
    /// Multiplications of words.
    pub multiplies: u32,
    /// Additions and subtractions of words; those inside a rounding do not count.
    pub adds: u32,
    /// Estimated cycles of a call on the target. Good for a comparison of forms, not for a schedule.
    pub cycles: u64,
}

impl FunctionCost {
    /// Of a program whose coefficients, beside its tables, have these formats.
    pub fn of_program(program: &Program, coefficients: &[Format], target: Target) -> Self {
        let tables = program.tables.iter();
        let tables: usize = tables
            .map(|t| t.entries.len() * entry_type(&t.entries).0)
            .sum();
        let constants: usize = coefficients.iter().map(bytes).sum();
        let nodes = program.functions.iter().flat_map(|f| &f.nodes);
        let (mut multiplies, mut adds) = (0, 0);
        for node in nodes {
            match node.op {
                Op::Mul(..) => multiplies += 1,
                Op::Add(..) | Op::Sub(..) => adds += 1,
                _ => {}
            }
        }
        FunctionCost {
            rom_bytes: (tables + constants) as u64,
            multiplies,
            adds,
            cycles: of_functions(program, target).cycles_per_row,
        }
    }

    /// Cycles, and read-only memory weighed against them.
    pub fn price(&self) -> u64 {
        self.cycles * BYTES_A_CYCLE + self.rom_bytes
    }
}

/// Of a word at its type's width.
fn bytes(format: &Format) -> usize {
    match format.bits() {
        0..=8 => 1,
        9..=16 => 2,
        17..=32 => 4,
        _ => 8,
    }
}
