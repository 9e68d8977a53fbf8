//! Evaluates a recorded program one call at a time, with its state as words that go in and come out:
//! what the functions that remember something are compared with, and where vectors are searched.
//!
//! The program is the blocks as [`Trace`](crate::numeric::trace::Trace) recorded them; that it says what
//! [`Fixed`](crate::numeric::fixed::Fixed) does is what [`super::chain`] and the tests of this file hold.

use crate::numeric::trace::ir::{Function, Id, Interval, Loop, Op, Program, SlotKind};
use std::sync::Arc;

/// A word or residue of a state, at its place in the state's type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StateWord {
    /// Members on the way and the variable, from the state's own type: `["nco", "phase"]`.
    pub path: Vec<&'static str>,
    /// Element of the variable, where it is an array.
    pub element: Option<usize>,
    /// What it holds.
    pub kind: SlotKind,
}

impl StateWord {
    /// Every value that it can have.
    pub fn range(&self) -> Interval {
        match self.kind {
            SlotKind::Word(range) => range,
            SlotKind::Residue(bits) => Interval::new(0, low_bits(-1, bits)),
        }
    }

    /// Its machine type has 128 bits.
    pub fn is_wide(&self) -> bool {
        match self.kind {
            SlotKind::Word(range) => range.bits() > 64,
            SlotKind::Residue(bits) => bits > 64,
        }
    }

    /// `nco.phase`, `cic.integrator[1]`.
    pub fn name(&self) -> String {
        let path = self.path.join(".");
        match self.element {
            Some(k) => format!("{path}[{k}]"),
            None => path,
        }
    }
}

/// Damage to one operation of a function, which vectors have to tell from the function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damage {
    /// The node's result, or for a test its operand, moves by this.
    Result(Id, i128),
    /// A sum becomes a difference and the reverse, a product a sum, a selection the other one; of a cast and
    /// a wrap, one bit more.
    Operator(Id),
    /// Of a cast and a wrap, one bit less; of a selection, always the first; of a test, the other outcome.
    Other(Id),
    /// The lower limit of a cast or limit moves by this.
    Low(Id, i128),
    /// The upper limit.
    High(Id, i128),
    /// A store is left out.
    Store(usize),
}

/// A program ready for calls.
#[derive(Debug)]
pub struct Interpreter {
    program: Program,
    /// By function.
    places: Vec<Places>,
}

/// Where a function's slots and its callees' states are in its own state.
#[derive(Debug)]
struct Places {
    words: Vec<StateWord>,
    slots: Vec<usize>,
    calls: Vec<usize>,
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

/// The words of a state's type: its variables, then its members'.
fn words(program: &Program, state: &str, before: &[&'static str]) -> Vec<StateWord> {
    let path = |name| [before, &[name]].concat();
    let own = || program.functions.iter().filter(|f| f.state == state);
    let mut all: Vec<StateWord> = Vec::new();
    for slot in own().flat_map(|f| &f.slots) {
        if !all.iter().any(|word| word.path == path(slot.name)) {
            all.extend((0..slot.len).map(|k| StateWord {
                path: path(slot.name),
                element: (slot.len > 1).then_some(k),
                kind: slot.kind,
            }));
        }
    }
    let mut seen: Vec<&str> = Vec::new();
    for (member, ty) in own().flat_map(|f| &f.members) {
        if !seen.contains(member) {
            seen.push(member);
            all.extend(words(program, ty, &path(member)));
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
        let run = self.evaluate(function, damage, inputs, state);
        let f = &self.program.functions[function];
        outputs.extend(f.outputs.iter().map(|(_, id)| run.values[*id]));
        for (k, (slot, element, id)) in f.stores.iter().enumerate() {
            if damage != Some(Damage::Store(k)) {
                run.state[self.places[function].slots[*slot] + element] = run.values[*id];
            }
        }
        run.fault
    }

    /// The values of all nodes of one call (in a loop, those of its last round); the state stays.
    pub fn values(
        &self,
        function: usize,
        damage: Option<Damage>,
        inputs: &[i128],
        state: &[i128],
    ) -> Vec<i128> {
        let mut state = state.to_vec();
        self.evaluate(function, damage, inputs, &mut state).values
    }

    fn evaluate<'a>(
        &'a self,
        function: usize,
        damage: Option<Damage>,
        inputs: &'a [i128],
        state: &'a mut [i128],
    ) -> Run<'a> {
        let f = &self.program.functions[function];
        let mut run = Run {
            interpreter: self,
            function: f,
            places: &self.places[function],
            damage,
            inputs,
            state,
            values: vec![0; f.nodes.len()],
            index: 0,
            fault: 0,
            results: Vec::new(),
        };
        run.body();
        run
    }

    /// Every damage that vectors are searched for.
    pub fn damages(&self, function: usize) -> Vec<Damage> {
        let f = &self.program.functions[function];
        let mut all = Vec::new();
        for (id, node) in f.nodes.iter().enumerate() {
            let moved = [Damage::Result(id, -1), Damage::Result(id, 1)];
            match node.op {
                Op::Input(_) | Op::Call(_) | Op::Phi(..) | Op::LoopOut(..) => {}
                Op::Add(..)
                | Op::Sub(..)
                | Op::Mul(..)
                | Op::ResidueAdd(..)
                | Op::ResidueSub(..) => {
                    all.extend(moved);
                    all.push(Damage::Operator(id));
                }
                Op::Cast(_, number) => {
                    // One more before it: its rounding constant.
                    all.extend(moved);
                    all.extend([Damage::Operator(id), Damage::Other(id)]);
                    if !self.program.is_proved_in_range(number) {
                        all.extend([-1, 1].map(|step| Damage::Low(id, step)));
                        all.extend([-1, 1].map(|step| Damage::High(id, step)));
                    }
                }
                Op::Limit(..) => {
                    all.extend([-1, 1].map(|step| Damage::Low(id, step)));
                    all.extend([-1, 1].map(|step| Damage::High(id, step)));
                }
                Op::Wrap(..) | Op::Select(..) | Op::IsNegative(_) => {
                    all.extend(moved);
                    all.extend([Damage::Operator(id), Damage::Other(id)]);
                }
                _ => all.extend(moved),
            }
        }
        all.extend((0..f.stores.len()).map(Damage::Store));
        all
    }
}

/// One call.
struct Run<'a> {
    interpreter: &'a Interpreter,
    function: &'a Function,
    places: &'a Places,
    damage: Option<Damage>,
    inputs: &'a [i128],
    state: &'a mut [i128],
    values: Vec<i128>,
    index: u32,
    fault: u32,
    /// Of each call so far.
    results: Vec<Vec<i128>>,
}

impl Run<'_> {
    fn body(&mut self) {
        let mut id = 0;
        let mut next_loop = 0;
        while id < self.function.nodes.len() {
            match self.function.loops.get(next_loop) {
                Some(l) if l.start == id => {
                    self.counted_loop(l, next_loop);
                    id = l.end;
                    next_loop += 1;
                }
                _ => {
                    self.node(id);
                    id += 1;
                }
            }
        }
    }

    fn counted_loop(&mut self, l: &Loop, number: usize) {
        let mut carried: Vec<i128> = l.inits.iter().map(|id| self.values[*id]).collect();
        for index in 0..l.count {
            self.index = index;
            for (k, value) in carried.iter().enumerate() {
                self.values[l.start + k] = *value;
            }
            for id in l.start + carried.len()..l.end {
                self.node(id);
            }
            for (value, id) in carried.iter_mut().zip(&l.outs) {
                *value = self.values[*id];
            }
        }
        for id in l.end..self.function.nodes.len() {
            if let Op::LoopOut(n, k) = self.function.nodes[id].op
                && n == number
            {
                self.values[id] = carried[k];
            }
        }
    }

    fn node(&mut self, id: Id) {
        let function = self.function;
        let op = &function.nodes[id].op;
        if matches!(op, Op::Phi(..) | Op::LoopOut(..)) {
            return;
        }
        let v = |id: &Id| self.values[*id];
        // What damage does to this node: its result moves, one bit more or less, limits move.
        let (mut moved, mut operator, mut other, mut limits) = (0, false, false, (0, 0));
        match self.damage {
            Some(Damage::Result(at, step)) if at == id => moved = step,
            Some(Damage::Operator(at)) if at == id => operator = true,
            Some(Damage::Other(at)) if at == id => other = true,
            Some(Damage::Low(at, step)) if at == id => limits.0 = step,
            Some(Damage::High(at, step)) if at == id => limits.1 = step,
            _ => {}
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
            Op::LoadWord(slot, element) => self.state[self.places.slots[*slot] + element],
            Op::LoadResidue(slot, element) => {
                let word = self.state[self.places.slots[*slot] + element];
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
                if outside && self.fault == 0 {
                    self.fault = cast.id as u32 + 1;
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
            Op::CallOut(call, k) => self.results[*call][*k].wrapping_add(moved),
            Op::Phi(..) | Op::LoopOut(..) => 0,
        };
        self.values[id] = result;
    }

    fn call(&mut self, number: usize) {
        let site = &self.function.calls[number];
        let inputs: Vec<i128> = site.arguments.iter().map(|id| self.values[*id]).collect();
        let start = self.places.calls[number];
        let count = self.interpreter.state(site.function).len();
        let mut outputs = Vec::new();
        let state = &mut self.state[start..start + count];
        let fault = self
            .interpreter
            .call(site.function, &inputs, state, &mut outputs);
        if self.fault == 0 {
            self.fault = fault;
        }
        self.results.push(outputs);
    }
}

/// Damaged addresses may leave the table.
fn entry(entries: &[i64], address: i128) -> i128 {
    let address = usize::try_from(address).unwrap_or(0);
    i128::from(entries.get(address).copied().unwrap_or(0))
}
