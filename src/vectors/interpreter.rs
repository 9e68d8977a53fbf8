//! Evaluates a recorded program one call at a time, with its state as words that go in and come out:
//! what the functions that remember something are compared with, and where vectors are searched.
//!
//! The program is the blocks as [`Trace`](crate::numeric::trace::Trace) recorded them; that it says what
//! [`Fixed`](crate::numeric::fixed::Fixed) does is what [`super::chain`] and the tests of this file hold.

use super::damage::Damage;
use super::state::{StateWord, words};
use crate::numeric::trace::ir::{Function, Id, Op, Program, SlotKind};
use std::ops::Range;
use std::sync::Arc;

/// A program ready for calls.
#[derive(Debug)]
pub struct Interpreter {
    program: Program,
    /// By function.
    places: Vec<Places>,
}

/// Where a function's slots and its callees' states are in its own state, and its callees' outputs among its nodes.
#[derive(Debug)]
struct Places {
    words: Vec<StateWord>,
    slots: Vec<usize>,
    calls: Vec<usize>,
    /// Of each call: a node that is one of its outputs, and which.
    call_outs: Vec<Vec<(Id, usize)>>,
}

/// One call as it was evaluated.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Evaluated {
    /// By node; in a loop, those of its last round.
    pub(super) values: Vec<i128>,
    /// The state as callees leave it, before the function's own stores.
    pub(super) state: Vec<i128>,
    /// Overflows where the design says `error`, in order: the operation (of a loop its first) and the number.
    pub(super) faults: Vec<(Id, u32)>,
}

impl Evaluated {
    /// Before the first of so many nodes.
    pub(super) fn start(&mut self, state: &[i128], nodes: usize) {
        self.values.clear();
        self.values.resize(nodes, 0);
        self.state.clear();
        self.state.extend_from_slice(state);
        self.faults.clear();
    }
}

/// What is evaluated together.
#[derive(Debug, Clone, Copy)]
pub(super) enum Step {
    /// A node outside of loops.
    Node(Id),
    /// A loop.
    Loop(usize),
}

/// Memory that calls leave to the next ones.
#[derive(Debug, Default)]
pub(super) struct Spare(Vec<Vec<i128>>);

impl Spare {
    fn take(&mut self) -> Vec<i128> {
        let mut words = self.0.pop().unwrap_or_default();
        words.clear();
        words
    }
}

/// Two's-complement low bits as an unsigned number.
pub(super) fn low_bits(v: i128, bits: u32) -> i128 {
    if bits >= 127 {
        v & i128::MAX
    } else {
        v & ((1i128 << bits) - 1)
    }
}

fn sign_extend(v: i128, bits: u32) -> i128 {
    let shift = 128 - bits.clamp(1, 128);
    (v << shift) >> shift
}

/// Of each call: a node that is one of its outputs, and which.
fn call_outs(function: &Function) -> Vec<Vec<(Id, usize)>> {
    let mut all = vec![Vec::new(); function.calls.len()];
    for (id, node) in function.nodes.iter().enumerate() {
        if let Op::CallOut(call, k) = node.op {
            all[call].push((id, k));
        }
    }
    all
}

impl Interpreter {
    /// Of a program.
    pub fn new(program: &Program) -> Arc<Self> {
        let places = program.functions.iter().map(|function| {
            let words = match function.state {
                "" => Vec::new(),
                state => words(program, state, &[]),
            };
            let starts = |name: &str| words.iter().position(|w| w.path.first() == Some(&name));
            Places {
                slots: function
                    .slots
                    .iter()
                    .map(|s| starts(s.name).unwrap_or(0))
                    .collect(),
                calls: function
                    .calls
                    .iter()
                    .map(|c| starts(c.instance).unwrap_or(0))
                    .collect(),
                call_outs: call_outs(function),
                words,
            }
        });
        Arc::new(Interpreter {
            places: places.collect(),
            program: program.clone(),
        })
    }

    /// The recorded program.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// The state of a function, word by word.
    pub fn state(&self, function: usize) -> &[StateWord] {
        &self.places[function].words
    }

    /// The place of a slot's first element in the state.
    pub(super) fn start_of_slot(&self, function: usize, slot: usize) -> usize {
        self.places[function].slots[slot]
    }

    /// The place of a call's state in the caller's.
    pub(super) fn start_of_call(&self, function: usize, call: usize) -> usize {
        self.places[function].calls[call]
    }

    /// The words of a call's state in the caller's.
    pub(super) fn words_of_call(&self, function: usize, call: usize) -> Range<usize> {
        let start = self.start_of_call(function, call);
        let callee = self.program.functions[function].calls[call].function;
        start..start + self.state(callee).len()
    }

    /// The place that a store writes to.
    pub(super) fn place_of_store(&self, function: usize, store: usize) -> usize {
        let (slot, element, _) = self.program.functions[function].stores[store];
        self.start_of_slot(function, slot) + element
    }

    /// Calls a function: its outputs (those of stages that the design lacks among them) are appended; gives
    /// the number of the first overflow where the design says `error`, 0 = none.
    pub fn call(
        &self,
        function: usize,
        inputs: &[i128],
        state: &mut [i128],
        outputs: &mut Vec<i128>,
    ) -> u32 {
        self.damaged(function, None, inputs, state, outputs)
    }

    /// The same with damage to the function (not to its callees).
    pub fn damaged(
        &self,
        function: usize,
        damage: Option<Damage>,
        inputs: &[i128],
        state: &mut [i128],
        outputs: &mut Vec<i128>,
    ) -> u32 {
        let f = &self.program.functions[function];
        let (mut call, mut spare) = (Evaluated::default(), Spare::default());
        call.start(state, f.nodes.len());
        let mut run = self.run(function, damage, inputs, &mut call, &mut spare);
        run.up_to(f.nodes.len());
        self.store(function, damage, &mut call);
        state.copy_from_slice(&call.state);
        outputs.extend(f.outputs.iter().map(|(_, id)| call.values[*id]));
        call.faults.first().map_or(0, |(_, number)| *number)
    }

    /// The function's own stores.
    pub(super) fn store(&self, function: usize, damage: Option<Damage>, call: &mut Evaluated) {
        for (k, (_, _, id)) in self.program.functions[function].stores.iter().enumerate() {
            if damage != Some(Damage::Store(k)) {
                call.state[self.place_of_store(function, k)] = call.values[*id];
            }
        }
    }

    /// A call in which nothing has been evaluated.
    pub(super) fn run<'a>(
        &'a self,
        function: usize,
        damage: Option<Damage>,
        inputs: &'a [i128],
        call: &'a mut Evaluated,
        spare: &'a mut Spare,
    ) -> Run<'a> {
        Run {
            interpreter: self,
            number: function,
            function: &self.program.functions[function],
            places: &self.places[function],
            damage,
            inputs,
            call,
            spare,
            index: 0,
            at: 0,
        }
    }
}

/// One call on its way.
pub(super) struct Run<'a> {
    interpreter: &'a Interpreter,
    number: usize,
    function: &'a Function,
    places: &'a Places,
    damage: Option<Damage>,
    inputs: &'a [i128],
    call: &'a mut Evaluated,
    spare: &'a mut Spare,
    /// Of the loop's round.
    index: u32,
    /// The operation, or the first of the loop.
    at: Id,
}

impl Run<'_> {
    /// Evaluates the nodes before `end`, and the whole of a loop that holds it.
    pub(super) fn up_to(&mut self, end: Id) {
        let mut id = 0;
        let mut next_loop = 0;
        while id < end {
            match self.function.loops.get(next_loop) {
                Some(l) if l.start == id => {
                    self.take(Step::Loop(next_loop));
                    id = l.end;
                    next_loop += 1;
                }
                _ => {
                    self.take(Step::Node(id));
                    id += 1;
                }
            }
        }
    }

    /// Evaluates a step.
    pub(super) fn take(&mut self, step: Step) {
        match step {
            Step::Node(id) => {
                self.at = id;
                self.node(id);
            }
            Step::Loop(number) => self.counted_loop(number),
        }
    }

    fn counted_loop(&mut self, number: usize) {
        let l = &self.function.loops[number];
        self.at = l.start;
        let mut carried = self.spare.take();
        carried.extend(l.inits.iter().map(|id| self.call.values[*id]));
        for index in 0..l.count {
            self.index = index;
            self.call.values[l.start..][..carried.len()].copy_from_slice(&carried);
            for id in l.start + carried.len()..l.end {
                self.node(id);
            }
            for (value, id) in carried.iter_mut().zip(&l.outs) {
                *value = self.call.values[*id];
            }
        }
        for id in l.end..self.function.nodes.len() {
            if let Op::LoopOut(n, k) = self.function.nodes[id].op
                && n == number
            {
                self.call.values[id] = carried[k];
            }
        }
        self.spare.0.push(carried);
    }

    fn node(&mut self, id: Id) {
        match self.damage {
            Some(damage) if damage.node() == Some(id) => self.compute::<true>(id),
            _ => self.compute::<false>(id),
        }
    }

    fn compute<const DAMAGED: bool>(&mut self, id: Id) {
        let function = self.function;
        let op = &function.nodes[id].op;
        if matches!(op, Op::Phi(..) | Op::LoopOut(..)) {
            return;
        }
        let v = |id: &Id| self.call.values[*id];
        // What damage does to this node: its result moves, one bit more or less, limits move.
        let (mut moved, mut operator, mut other, mut limits) = (0, false, false, (0, 0));
        if DAMAGED {
            match self.damage {
                Some(Damage::Result(_, step)) => moved = step,
                Some(Damage::Operator(_)) => operator = true,
                Some(Damage::Other(_)) => other = true,
                Some(Damage::Low(_, step)) => limits.0 = step,
                Some(Damage::High(_, step)) => limits.1 = step,
                Some(Damage::Store(_)) | None => {}
            }
        }
        let bit = i32::from(operator) - i32::from(other);
        let before = if matches!(op, Op::Cast(..) | Op::IsNegative(_)) {
            std::mem::take(&mut moved)
        } else {
            0
        };
        let program = &self.interpreter.program;
        let result = match op {
            Op::Input(k) => self.inputs[*k],
            Op::LoadWord(slot, element) => self.call.state[self.places.slots[*slot] + element],
            Op::LoadResidue(slot, element) => {
                let word = self.call.state[self.places.slots[*slot] + element];
                match function.slots[*slot].kind {
                    SlotKind::Residue(bits) => low_bits(word.wrapping_add(moved), bits),
                    SlotKind::Word(_) => word.wrapping_add(moved),
                }
            }
            Op::Constant(raw) => raw.wrapping_add(moved),
            Op::Add(a, b) | Op::Sub(a, b) => match matches!(op, Op::Add(..)) != operator {
                true => v(a).wrapping_add(v(b)).wrapping_add(moved),
                false => v(a).wrapping_sub(v(b)).wrapping_add(moved),
            },
            Op::Mul(a, b) if operator => v(a).wrapping_add(v(b)),
            Op::Mul(a, b) => v(a).wrapping_mul(v(b)).wrapping_add(moved),
            Op::Neg(a) => v(a).wrapping_neg().wrapping_add(moved),
            Op::Cast(a, number) => {
                let cast = &program.casts[*number];
                let value = v(a).wrapping_add(before);
                let moves = bit != 0 || limits != (0, 0);
                let changed = moves.then(|| cast.with_damage(bit, limits));
                let cast = changed.as_ref().unwrap_or(cast);
                let mut outside = false;
                let result = cast.kernel::<i128>().apply(value, |_| outside = true);
                if outside {
                    self.fault(cast.id as u32 + 1);
                }
                result
            }
            Op::Wrap(a, bits) => {
                sign_extend(v(a), bits.saturating_add_signed(bit)).wrapping_add(moved)
            }
            Op::Limit(a, low, high) => {
                let (low, high) = (low + limits.0, high + limits.1);
                v(a).max(low).min(high)
            }
            Op::IsNegative(a) => {
                // `<=` for `<` is an operand one less.
                i128::from((v(a).wrapping_add(before) < i128::from(operator)) != other)
            }
            Op::Select(_, a, _) if other => v(a),
            Op::Select(t, a, b) => {
                let yes = (v(t) != 0) != operator;
                (if yes { v(a) } else { v(b) }).wrapping_add(moved)
            }
            Op::Residue(a, bits) => low_bits(v(a).wrapping_add(moved), *bits),
            Op::ResidueConstant(raw, bits) => low_bits((*raw as i128).wrapping_add(moved), *bits),
            Op::ResidueAdd(a, b, bits) | Op::ResidueSub(a, b, bits) => {
                let sum = match matches!(op, Op::ResidueAdd(..)) != operator {
                    true => v(a).wrapping_add(v(b)),
                    false => v(a).wrapping_sub(v(b)),
                };
                low_bits(sum.wrapping_add(moved), *bits)
            }
            Op::Centered(a, bits) => sign_extend(v(a), *bits).wrapping_add(moved),
            Op::Sine(phase, number) => {
                let table = &program.sine_tables[*number];
                let dropped = table.phase_bits - table.address_bits;
                let half = match table.half_step && dropped > 0 {
                    true => 1i128 << (dropped - 1),
                    false => 0,
                };
                let address = low_bits((v(phase) + half) >> dropped, table.address_bits);
                entry(&table.entries, address).wrapping_add(moved)
            }
            Op::Lookup(address, number) => {
                entry(&program.tables[*number].entries, v(address)).wrapping_add(moved)
            }
            Op::ShiftByIndex(a) => (v(a) >> self.index).wrapping_add(moved),
            Op::Entry(number) => {
                let entries = &program.index_tables[*number].entries;
                entry(entries, i128::from(self.index)).wrapping_add(moved)
            }
            Op::Call(number) => {
                self.call(*number);
                0
            }
            // The call has put it there.
            Op::CallOut(..) => self.call.values[id].wrapping_add(moved),
            Op::Phi(..) | Op::LoopOut(..) => 0,
        };
        self.call.values[id] = result;
    }

    /// The first of an operation, or of a loop, is kept.
    fn fault(&mut self, number: u32) {
        if self.call.faults.last().is_none_or(|(at, _)| *at != self.at) {
            self.call.faults.push((self.at, number));
        }
    }

    /// Calls a function on its part of the state; its outputs are put where they are looked for.
    fn call(&mut self, number: usize) {
        let site = &self.function.calls[number];
        let range = self.interpreter.words_of_call(self.number, number);
        let mut inputs = self.spare.take();
        inputs.extend(site.arguments.iter().map(|id| self.call.values[*id]));
        let mut callee = Evaluated {
            values: self.spare.take(),
            state: self.spare.take(),
            faults: Vec::new(),
        };
        let f = &self.interpreter.program.functions[site.function];
        callee.start(&self.call.state[range.clone()], f.nodes.len());
        let mut run = self
            .interpreter
            .run(site.function, None, &inputs, &mut callee, self.spare);
        run.up_to(f.nodes.len());
        self.interpreter.store(site.function, None, &mut callee);
        self.call.state[range].copy_from_slice(&callee.state);
        for (id, k) in &self.places.call_outs[number] {
            self.call.values[*id] = callee.values[f.outputs[*k].1];
        }
        if let Some((_, number)) = callee.faults.first() {
            self.fault(*number);
        }
        self.spare.0.extend([inputs, callee.values, callee.state]);
    }
}

/// Damaged addresses may leave the table.
fn entry(entries: &[i64], address: i128) -> i128 {
    let address = usize::try_from(address).unwrap_or(0);
    i128::from(entries.get(address).copied().unwrap_or(0))
}
