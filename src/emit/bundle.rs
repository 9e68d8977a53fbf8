//! What is printed, apart from the language: the program, lowered, with its states and initial
//! values under checked names.

use super::lower::lower;
use super::machine::{Lowered, Type, residue_type, word_type};
use crate::circuit::compensate::{Compensate, compensation_alone, in_range};
use crate::circuit::engine;
use crate::design::Design;
use crate::numeric::trace::Trace;
use crate::numeric::trace::ir::{Program, SlotKind};

/// Which part of the firmware is emitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The bias polynomial of `[compensation]` and its subtraction from the rate.
    Compensation,
    /// The constant tables alone: sine, arctangents.
    Tables,
    /// The correction of averaged readings that `gyrogen close` wrote as `[correction]`.
    Correction,
    /// What makes the words of the correction of the chain's rows.
    Conversion,
    /// Chain, conversion and correction, each in a folder of its own.
    All,
    /// The whole detection circuit with its compensation; the compensation alone where its thermometer is not the circuit's.
    Chain,
}

/// A value that the state has at the start and that is not zero.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Initial {
    /// Member of the chain's state.
    pub member: &'static str,
    /// Variable in it.
    pub variable: &'static str,
    /// Raw value.
    pub value: i128,
}

/// A state's type: its variables with their C or Rust types, or members with their own state.
#[derive(Debug, Clone, PartialEq)]
pub struct StateType {
    /// The state's name.
    pub name: &'static str,
    /// Variables: name, elements, type.
    pub variables: Vec<(&'static str, usize, Type)>,
    /// Members: name, state.
    pub members: Vec<(&'static str, &'static str)>,
}

/// A program ready for printing.
#[derive(Debug)]
pub struct Bundle {
    /// The prefix of every name.
    pub prefix: String,
    /// The recorded program.
    pub program: Program,
    /// Its functions, lowered.
    pub lowered: Vec<Lowered>,
    /// States, members before what holds them.
    pub states: Vec<StateType>,
    /// What is not zero at the start.
    pub initial: Vec<Initial>,
    /// Sense and drive codes in, rows out.
    pub has_chain: bool,
    /// R, where there is a chain.
    pub ratio: u32,
    /// How accurate the compensation is, in sentences for the head of the sources.
    pub accuracy: Vec<String>,
}

impl Bundle {
    /// Traces and lowers the part of a design.
    pub fn new(design: &Design, part: Part) -> Self {
        let on_phase = design
            .compensation
            .as_ref()
            .is_none_or(|c| c.input.is_of_chain());
        let has_chain = part == Part::Tables || part == Part::Chain && on_phase;
        let program = if has_chain {
            engine::trace(design)
        } else {
            trace_compensation(design)
        };
        Bundle {
            prefix: design.name.clone(),
            lowered: lower(&program),
            states: states(&program),
            initial: if has_chain {
                initial(design)
            } else {
                Vec::new()
            },
            program,
            has_chain,
            ratio: design.circuit.decimator.ratio,
            accuracy: Vec::new(),
        }
    }

    /// True if any function may note a fault.
    pub fn may_fault(&self) -> bool {
        self.lowered.iter().any(|l| l.may_fault)
    }
}

/// The compensation alone as a program: `bias`, `rate`, `compensate`, and `in_range` with `outside = "flag"`.
pub fn trace_compensation(design: &Design) -> Program {
    let trace = Trace::new();
    if let Some((bias, rate)) = compensation_alone(design) {
        let block = Compensate { bias, rate };
        let ranges = [block.bias.input_range, block.rate.input_range];
        trace.record(&block, &(), ranges);
        if let Some(flag) = in_range(design) {
            trace.record(&flag, &(), [flag.input_range]);
        }
    }
    trace.finish()
}

pub fn states(program: &Program) -> Vec<StateType> {
    let mut states: Vec<StateType> = Vec::new();
    for function in &program.functions {
        if function.state.is_empty() {
            continue;
        }
        let known = states.iter().position(|s| s.name == function.state);
        let k = known.unwrap_or_else(|| {
            states.push(StateType {
                name: function.state,
                variables: Vec::new(),
                members: Vec::new(),
            });
            states.len() - 1
        });
        let state = &mut states[k];
        for slot in &function.slots {
            if !state
                .variables
                .iter()
                .any(|(name, _, _)| *name == slot.name)
            {
                let ty = match slot.kind {
                    SlotKind::Word(range) => word_type(range),
                    SlotKind::Residue(bits) => residue_type(bits),
                };
                state.variables.push((slot.name, slot.len, ty));
            }
        }
        for member in &function.members {
            if !state.members.contains(member) {
                state.members.push(*member);
            }
        }
    }
    // Those with members hold the others and come last.
    states.sort_by_key(|s| !s.members.is_empty());
    states
}

/// What is not zero in the chain's state before the first sample.
fn initial(design: &Design) -> Vec<Initial> {
    let nco = crate::circuit::nco::Oscillator::new(&design.circuit.nco);
    let mut initial = vec![Initial {
        member: "nco",
        variable: "tuning_word",
        value: nco.tuning_word,
    }];
    if let Some(l) = &design.circuit.amplitude_loop {
        initial.push(Initial {
            member: "amplitude_loop",
            variable: "integrator",
            value: i128::from(l.initial_raw),
        });
    }
    initial.retain(|i| i.value != 0);
    initial
}
