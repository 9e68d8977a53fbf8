//! What a design costs: one model for `approx`, the word-length study, `check` and the reports.
//!
//! Everything is counted from the program that is emitted: the typed operations of [`crate::emit::lower`] (casts
//! that cannot act are gone, widths are those of the operands), times how often each function runs for a row: the
//! sample rate's R times, a loop's body as often as it counts. [`sequences`] and [`processors`] have the instructions of each
//! operation, [`walk`] adds them up, `uses` knows what a compiler drops; [`fabric`] counts an FPGA's parts;
//! [`price`] makes one number of it.
//!
//! What the model predicts is the number of instructions that the emitted C executes for a row at GCC's `-O2`,
//! the calls of `push` included; `tests/all/cost_model.rs` counts them under emulation. Cycles are those instructions
//! with the cycles of their class: no wait states of a flash memory, no cache.

pub mod fabric;
pub mod function;
pub mod price;
pub mod processors;
pub mod sequences;
mod uses;
pub mod walk;

use crate::design::Design;
pub use crate::design::target::Target;
use crate::emit::bundle::{Bundle, Part};
use crate::emit::lower::lower;
use crate::emit::machine::{Lowered, residue_type, word_type};
use crate::emit::views::entry_type;
use crate::numeric::trace::ir::{Program, SlotKind};
use fabric::Fabric;
use processors::processor;
use sequences::Sequence;
use serde::Serialize;
use std::collections::BTreeMap;
use walk::Walk;

/// What a design costs on a processor and in an FPGA.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Cost {
    /// The processor.
    pub target: Target,
    /// Instructions executed for a row: R samples and what follows them.
    pub instructions_per_row: u64,
    /// Their cycles.
    pub cycles_per_row: u64,
    /// The firmware's code, without tables, bytes.
    pub code_bytes: u64,
    /// Tables at the widths of their types, bytes.
    pub rom_bytes: u64,
    /// The state, bytes.
    pub ram_bytes: u64,
    /// The same circuit in an FPGA.
    pub fabric: Fabric,
}

/// Instructions of `init` and `push` in the code.
const AROUND: f64 = 60.0;

/// What the whole firmware of a design costs: the circuit with its compensation, or the compensation alone where
/// its thermometer is not the circuit's.
pub fn of_design(design: &Design, target: Target) -> Cost {
    of_bundle(&Bundle::new(design, Part::Chain), target)
}

/// What a bundle costs.
pub fn of_bundle(bundle: &Bundle, target: Target) -> Cost {
    let ratio = if bundle.has_chain { bundle.ratio } else { 1 };
    of_program(&bundle.program, &bundle.lowered, ratio, target)
}

/// What a program costs of which the function `sample`, if any, runs `ratio` times for a row and every other one
/// that nothing calls once.
pub fn of_program(program: &Program, lowered: &[Lowered], ratio: u32, target: Target) -> Cost {
    let p = processor(target);
    let walk = Walk::new(program, lowered, &p);
    let mut executed = Sequence::NONE;
    let mut code = Sequence::NONE;
    let is_chain = program.function("sample").is_some();
    for (number, function) in program.functions.iter().enumerate() {
        let tally = walk.tally(number);
        code.add(&tally.code, 1.0);
        if is_called(program, number) {
            continue;
        }
        let is_sample = function.name == "sample";
        let times = if is_sample { f64::from(ratio) } else { 1.0 };
        executed.add(&tally.executed, times);
        if is_sample {
            executed.add(&p.push, times);
        } else if is_chain {
            let outputs = lowered[number].outputs.len() as f64;
            executed.add(&p.row[0], 1.0);
            executed.add(&p.row[1], outputs);
        }
    }
    let around = if is_chain { AROUND } else { 0.0 };
    Cost {
        target,
        instructions_per_row: executed.instructions().round() as u64,
        cycles_per_row: executed.cycles(&p.cycles).round() as u64,
        code_bytes: ((code.instructions() + around) * p.bytes).round() as u64,
        rom_bytes: table_bytes(program),
        ram_bytes: state_bytes(program),
        fabric: Fabric::of(program),
    }
}

/// The instructions of each function that the program calls, for one call of it; and of the functions that nothing
/// calls. Names are those of the emitted code without its prefix.
pub fn by_function(bundle: &Bundle, target: Target) -> Vec<(String, u64)> {
    let p = processor(target);
    let walk = Walk::new(&bundle.program, &bundle.lowered, &p);
    let functions = bundle.program.functions.iter().enumerate();
    functions
        .map(|(k, f)| {
            let instructions = walk.tally(k).executed.instructions();
            (f.name.clone(), instructions.round() as u64)
        })
        .collect()
}

fn is_called(program: &Program, number: usize) -> bool {
    let calls = program.functions.iter().flat_map(|f| &f.calls);
    calls.into_iter().any(|c| c.function == number)
}

/// Bytes of a program's tables at the widths of their types.
pub fn table_bytes(program: &Program) -> u64 {
    let sines = program.sine_tables.iter().map(|t| &t.entries[..]);
    let indexed = program.index_tables.iter().map(|t| &t.entries[..]);
    let tables = program.tables.iter().map(|t| &t.entries[..]);
    let all = sines.chain(indexed).chain(tables);
    all.map(|entries| (entries.len() * entry_type(entries).0) as u64)
        .sum()
}

/// Variables of each state: name, elements, kind.
type Variables<'a> = BTreeMap<&'a str, BTreeMap<&'a str, (usize, SlotKind)>>;

/// Adds `of` up over all variables of the program's state.
fn state_sum(program: &Program, of: &dyn Fn(SlotKind) -> u64) -> u64 {
    let mut variables: Variables = BTreeMap::new();
    let mut members: BTreeMap<&str, BTreeMap<&str, &str>> = BTreeMap::new();
    for f in program.functions.iter().filter(|f| !f.state.is_empty()) {
        let own = variables.entry(f.state).or_default();
        own.extend(f.slots.iter().map(|s| (s.name, (s.len, s.kind))));
        let own = f.members.iter().copied();
        members.entry(f.state).or_default().extend(own);
    }
    let held: Vec<&str> = members.values().flat_map(|m| m.values().copied()).collect();
    fn one(
        state: &str,
        variables: &Variables,
        members: &BTreeMap<&str, BTreeMap<&str, &str>>,
        of: &dyn Fn(SlotKind) -> u64,
    ) -> u64 {
        let own = variables.get(state).into_iter().flat_map(|v| v.values());
        let own: u64 = own.map(|(len, kind)| *len as u64 * of(*kind)).sum();
        let inner = members.get(state).into_iter().flat_map(|m| m.values());
        own + inner
            .map(|state| one(state, variables, members, of))
            .sum::<u64>()
    }
    let outermost = variables.keys().filter(|state| !held.contains(state));
    outermost
        .map(|state| one(state, &variables, &members, of))
        .sum()
}

fn state_bytes(program: &Program) -> u64 {
    state_sum(program, &|kind| {
        let ty = match kind {
            SlotKind::Word(range) => word_type(range),
            SlotKind::Residue(bits) => residue_type(bits),
        };
        match ty {
            crate::emit::machine::Type::Signed(w) | crate::emit::machine::Type::Unsigned(w) => {
                u64::from(w.bits()) / 8
            }
            crate::emit::machine::Type::Bool => 1,
        }
    })
}

/// Lowers and prices a program of functions without a sample rate.
fn of_functions(program: &Program, target: Target) -> Cost {
    of_program(program, &lower(program), 1, target)
}

#[cfg(test)]
mod tests;
