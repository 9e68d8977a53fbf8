//! What a form costs: read-only memory, operations, and an estimate of cycles.

use crate::approx::form::{Form, Settled};
use crate::design::target::Target;
use crate::emit::machine::Width;
use crate::emit::views::entry_type;
use crate::numeric::format::Format;
use crate::numeric::trace::ir::{Function, Op, Program};
use serde::Serialize;

/// Bytes of read-only memory that weigh as much as a cycle.
const BYTES_A_CYCLE: u64 = 32;

/// Estimated cycles of an operation on words of 32, 64 and 128 bits.
struct Weights {
    multiply: [u32; 3],
    add: [u32; 3],
    shift: [u32; 3],
    load: u32,
    select: u32,
}

impl Weights {
    fn of(target: Target) -> Self {
        match target {
            Target::Host => Weights {
                multiply: [3, 3, 12],
                add: [1, 1, 3],
                shift: [1, 1, 4],
                load: 4,
                select: 1,
            },
            Target::CortexM4 => Weights {
                multiply: [1, 6, 60],
                add: [1, 2, 10],
                shift: [1, 4, 16],
                load: 2,
                select: 2,
            },
            Target::CortexM0 => Weights {
                multiply: [32, 90, 500],
                add: [1, 2, 12],
                shift: [1, 6, 24],
                load: 2,
                select: 3,
            },
            Target::Riscv32 => Weights {
                multiply: [4, 18, 120],
                add: [1, 4, 20],
                shift: [1, 6, 24],
                load: 2,
                select: 3,
            },
        }
    }
}

/// What a form costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Cost {
    /// Tables and coefficients at the widths of their types.
    pub rom_bytes: u64,
    /// Multiplications of words.
    pub multiplies: u32,
    /// Additions and subtractions of words; those inside a rounding do not count.
    pub adds: u32,
    /// Estimated cycles on the target: the operations above, table reads, shifts and selections, each with a
    /// weight. Good for a comparison of forms, not for a schedule.
    pub cycles: u32,
}

impl Cost {
    /// Of a form on a target.
    pub fn of(settled: &Settled, target: Target) -> Self {
        Cost::of_program(&settled.program, &constants(&settled.form), target)
    }

    /// Of a program whose coefficients, beside its tables, have these formats.
    pub fn of_program(program: &Program, coefficients: &[Format], target: Target) -> Self {
        let tables = program.tables.iter();
        let tables: usize = tables
            .map(|t| t.entries.len() * entry_type(&t.entries).0)
            .sum();
        let constants: usize = coefficients.iter().map(bytes).sum();
        let mut cost = Cost {
            rom_bytes: (tables + constants) as u64,
            multiplies: 0,
            adds: 0,
            cycles: 0,
        };
        for function in &program.functions {
            count(function, &Weights::of(target), &mut cost);
        }
        cost
    }

    /// Cycles, and read-only memory weighed against them.
    pub fn price(&self) -> u64 {
        u64::from(self.cycles) * BYTES_A_CYCLE + self.rom_bytes
    }
}

/// The formats of a form's coefficients that are no table.
pub fn constants(form: &Form) -> Vec<Format> {
    match form {
        Form::Polynomial(p) => {
            let degree = p.coefficients.len().saturating_sub(1);
            p.formats.coefficients.each(p.monomials, degree)
        }
        _ => Vec::new(),
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

fn count(function: &Function, weights: &Weights, cost: &mut Cost) {
    for (id, node) in function.nodes.iter().enumerate() {
        let operands = function.operands(id);
        let widest = operands.iter().map(|a| function.nodes[*a].range);
        let range = widest.fold(node.range, |r, other| r.join(other));
        let width = match Width::of_range(range) {
            Width::W8 | Width::W16 | Width::W32 => 0,
            Width::W64 => 1,
            Width::W128 => 2,
        };
        match node.op {
            Op::Mul(..) => {
                cost.multiplies += 1;
                cost.cycles += weights.multiply[width];
            }
            Op::Add(..) | Op::Sub(..) => {
                cost.adds += 1;
                cost.cycles += weights.add[width];
            }
            Op::Neg(_) => cost.cycles += weights.add[width],
            // A rounding: an addition and a shift.
            Op::Cast(..) => cost.cycles += weights.add[width] + weights.shift[width],
            Op::Wrap(..) => cost.cycles += weights.shift[width],
            // Emitted code has no limit that never acts.
            Op::Limit(a, low, high) if is_within(function, a, low, high) => {}
            Op::Select(..) | Op::Limit(..) => cost.cycles += weights.select << width.min(1),
            Op::Lookup(..) => cost.cycles += weights.load,
            _ => {}
        }
    }
}

fn is_within(function: &Function, word: usize, low: i128, high: i128) -> bool {
    let range = function.nodes.get(word).map(|node| node.range);
    range.is_some_and(|r| low <= r.low && r.high <= high)
}
