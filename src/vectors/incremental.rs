//! Tells a call with one damaged operation from the call without by evaluating what depends on that operation, and
//! nothing else. A search for vectors asks this for each damage at some thousand vectors.

use super::damage::Damage;
use super::interpreter::{Evaluated, Interpreter, Spare, Step};
use crate::numeric::trace::ir::{Function, Id, Op};
use std::cell::{OnceCell, RefCell};

/// What depends on one operation.
#[derive(Debug)]
pub(super) struct Dependents {
    /// In the order of evaluation, each with the nodes whose values it makes.
    steps: Vec<(Step, Vec<Id>)>,
    /// How many of them, up to the one that holds the operation itself.
    origin: usize,
    /// By node: it is evaluated again.
    again: Vec<bool>,
}

/// A function, with memory to call it often.
pub(super) struct Caller<'a> {
    program: &'a Interpreter,
    number: usize,
    pub(super) function: &'a Function,
    /// Two calls of the function work on the same words of the state: their order counts.
    shares_state: bool,
    /// By node.
    operands: Vec<Vec<Id>>,
    /// By node: an output, or what the state keeps.
    is_kept: Vec<bool>,
    /// By node: what its value depends on, in the order of evaluation.
    needs: Vec<OnceCell<Vec<Step>>>,
    memory: RefCell<Memory>,
}

#[derive(Default)]
struct Memory {
    call: Evaluated,
    spare: Spare,
    /// Values before they were evaluated again.
    saved: Vec<(Id, i128)>,
}

impl<'a> Caller<'a> {
    /// Of a program's function.
    pub(super) fn new(program: &'a Interpreter, number: usize) -> Self {
        let function = &program.program().functions[number];
        let mut taken = vec![false; program.state(number).len()];
        let mut words = (0..function.calls.len()).flat_map(|k| program.words_of_call(number, k));
        let mut is_kept = vec![false; function.nodes.len()];
        function
            .outputs
            .iter()
            .for_each(|(_, id)| is_kept[*id] = true);
        // Of two stores to one place the later counts.
        let place = |k: usize| program.place_of_store(number, k);
        for (k, (_, _, id)) in function.stores.iter().enumerate() {
            is_kept[*id] |= (k + 1..function.stores.len()).all(|later| place(later) != place(k));
        }
        Caller {
            program,
            number,
            function,
            shares_state: words.any(|k| std::mem::replace(&mut taken[k], true)),
            operands: (0..function.nodes.len())
                .map(|id| function.operands(id))
                .collect(),
            is_kept,
            needs: vec![OnceCell::new(); function.nodes.len()],
            memory: RefCell::default(),
        }
    }

    /// Inputs and state of a vector.
    fn split<'w>(&self, words: &'w [i128]) -> (&'w [i128], &'w [i128]) {
        words.split_at(self.function.inputs.len())
    }

    /// The value of a node (in a loop, of its last round).
    pub(super) fn value(&self, words: &[i128], node: Id) -> i128 {
        let (inputs, state) = self.split(words);
        let Memory { call, spare, .. } = &mut *self.memory.borrow_mut();
        call.start(state, self.function.nodes.len());
        let mut run = self.program.run(self.number, None, inputs, call, spare);
        self.needs(node).iter().for_each(|step| run.take(*step));
        call.values[node]
    }

    /// What a node's value depends on, itself included.
    fn needs(&self, node: Id) -> &[Step] {
        self.needs[node].get_or_init(|| self.sought(node))
    }

    /// The same, by following operands backwards.
    fn sought(&self, node: Id) -> Vec<Step> {
        let mut needed = vec![false; self.function.nodes.len()];
        needed[node] = true;
        let mut needed_loops = vec![false; self.function.loops.len()];
        let mut loops = self.function.loops.iter().enumerate().rev().peekable();
        let mut steps = Vec::new();
        let mut end = self.function.nodes.len();
        while end > 0 {
            if let Some((number, l)) = loops.next_if(|(_, l)| l.end == end) {
                end = l.start;
                let mut body = l.start..l.end;
                if needed_loops[number] || body.any(|id| needed[id]) {
                    let operands = (l.start..l.end).flat_map(|id| &self.operands[id]);
                    operands.chain(&l.inits).for_each(|id| needed[*id] = true);
                    steps.push(Step::Loop(number));
                }
                continue;
            }
            end -= 1;
            let op = &self.function.nodes[end].op;
            // Calls that work on the same words count all.
            let is_shared = self.shares_state && end < node && matches!(op, Op::Call(_));
            if !needed[end] && !is_shared {
                continue;
            }
            match *op {
                // A loop or a call puts its value there.
                Op::LoopOut(number, _) => needed_loops[number] = true,
                Op::CallOut(call, _) => {
                    let is_made = |op: &Op| matches!(op, Op::Call(c) if *c == call);
                    let made = self.nodes().filter(|(_, op)| is_made(op));
                    made.for_each(|(id, _)| needed[id] = true);
                }
                _ => {
                    self.operands[end].iter().for_each(|id| needed[*id] = true);
                    steps.push(Step::Node(end));
                }
            }
        }
        steps.reverse();
        steps
    }

    /// A call without damage.
    pub(super) fn evaluated(&self, words: &[i128]) -> Evaluated {
        let (inputs, state) = self.split(words);
        let mut call = Evaluated::default();
        call.start(state, self.function.nodes.len());
        let spare = &mut self.memory.borrow_mut().spare;
        let mut run = self
            .program
            .run(self.number, None, inputs, &mut call, spare);
        run.up_to(self.function.nodes.len());
        call
    }

    /// What depends on the operation that is damaged; nothing on a store.
    pub(super) fn dependents(&self, damage: Damage) -> Dependents {
        let count = self.function.nodes.len();
        let mut dependents = Dependents {
            steps: Vec::new(),
            origin: 0,
            again: vec![self.shares_state; count],
        };
        let Some(origin) = damage.node() else {
            return dependents;
        };
        dependents.again[origin] = true;
        let mut loops = self.function.loops.iter().enumerate().peekable();
        let mut id = 0;
        while id < count {
            let step = match loops.next_if(|(_, l)| l.start == id) {
                Some((number, l)) => {
                    id = l.end;
                    self.reached_loop(number, &mut dependents.again)
                }
                None => {
                    id += 1;
                    self.reached_node(id - 1, origin, &mut dependents.again)
                }
            };
            dependents.steps.extend(step);
            if dependents.origin == 0 && id > origin {
                dependents.origin = dependents.steps.len();
            }
        }
        dependents
    }

    /// A node that is evaluated again, with its values; marks them.
    fn reached_node(&self, id: Id, origin: Id, again: &mut [bool]) -> Option<(Step, Vec<Id>)> {
        let op = &self.function.nodes[id].op;
        // A loop or a call has put its value there.
        if id != origin && matches!(op, Op::LoopOut(..) | Op::CallOut(..)) {
            return None;
        }
        again[id] |= self.operands[id].iter().any(|id| again[*id]);
        let mut made = vec![id];
        if let Op::Call(call) = op {
            let outs = self
                .nodes()
                .filter(|(_, op)| matches!(op, Op::CallOut(c, _) if c == call));
            made.extend(outs.map(|(id, _)| id));
        }
        again[id].then(|| {
            made.iter().for_each(|id| again[*id] = true);
            (Step::Node(id), made)
        })
    }

    /// A loop that is evaluated again, with its values; marks them.
    fn reached_loop(&self, number: usize, again: &mut [bool]) -> Option<(Step, Vec<Id>)> {
        let l = &self.function.loops[number];
        let mut body = l.start..l.end;
        let mut carried = l.inits.iter().chain(&l.outs);
        let is_reached = carried.any(|id| again[*id])
            || body.any(|id| again[id] || self.operands[id].iter().any(|id| again[*id]));
        is_reached.then(|| {
            let outs = self
                .nodes()
                .filter(|(_, op)| matches!(op, Op::LoopOut(n, _) if *n == number));
            let made: Vec<Id> = (l.start..l.end).chain(outs.map(|(id, _)| id)).collect();
            made.iter().for_each(|id| again[*id] = true);
            (Step::Loop(number), made)
        })
    }

    fn nodes(&self) -> impl Iterator<Item = (Id, &Op)> {
        self.function.nodes.iter().map(|node| &node.op).enumerate()
    }

    /// True where the damaged operation has another value at these words. `call` is the call without damage, and is
    /// that again afterwards.
    pub(super) fn moves(
        &self,
        damage: Damage,
        dependents: &Dependents,
        words: &[i128],
        call: &mut Evaluated,
    ) -> bool {
        let Some(node) = damage.node() else {
            return false;
        };
        let before = call.values[node];
        let steps = &dependents.steps[..dependents.origin];
        self.again(damage, steps, words, call, |after, _| {
            after.values[node] != before
        })
    }

    /// True where outputs, state or fault are others with damage. `call` is the call without, and is that again
    /// afterwards.
    pub(super) fn differs(
        &self,
        damage: Damage,
        dependents: &Dependents,
        words: &[i128],
        call: &mut Evaluated,
    ) -> bool {
        if let Damage::Store(store) = damage {
            return self.store_counts(store, call);
        }
        let faults = std::mem::take(&mut call.faults);
        let state = std::mem::take(&mut call.state);
        let steps = &dependents.steps[..dependents.origin];
        let at_once = |after: &Evaluated, saved: &[(Id, i128)]| {
            !after.faults.is_empty()
                || faults.iter().any(|(at, _)| dependents.again[*at])
                || saved
                    .iter()
                    .any(|(id, before)| after.values[*id] != *before)
        };
        let differs = self.again(damage, steps, words, call, at_once)
            && self.again(damage, &dependents.steps, words, call, |after, saved| {
                let mut kept = saved.iter().filter(|(id, _)| self.is_kept[*id]);
                let others = faults.iter().find(|(at, _)| !dependents.again[*at]);
                let first = after.faults.iter().chain(others).min_by_key(|(at, _)| *at);
                first.map(|(_, number)| number) != faults.first().map(|(_, number)| number)
                    || kept.any(|(id, before)| after.values[*id] != *before)
                    || self.calls_again(dependents).any(|call| {
                        let words = self.program.words_of_call(self.number, call);
                        after.state[words.clone()] != state[words]
                    })
            });
        (call.faults, call.state) = (faults, state);
        differs
    }

    /// The calls among what is evaluated again.
    fn calls_again(&self, dependents: &Dependents) -> impl Iterator<Item = usize> {
        let calls = self.function.nodes.iter().zip(&dependents.again);
        calls.filter_map(|(node, again)| match node.op {
            Op::Call(call) if *again => Some(call),
            _ => None,
        })
    }

    /// True where the state is another without this store.
    fn store_counts(&self, store: usize, call: &Evaluated) -> bool {
        let place = |k: usize| self.program.place_of_store(self.number, k);
        let kept = |without: Option<usize>| {
            let mut stores = self.function.stores.iter().enumerate();
            stores
                .rfind(|(k, _)| Some(*k) != without && place(*k) == place(store))
                .map_or(call.state[place(store)], |(_, (_, _, id))| call.values[*id])
        };
        kept(None) != kept(Some(store))
    }

    /// Evaluates steps again with damage, looks at the call and at the values before, and takes them back.
    fn again(
        &self,
        damage: Damage,
        steps: &[(Step, Vec<Id>)],
        words: &[i128],
        call: &mut Evaluated,
        look: impl Fn(&Evaluated, &[(Id, i128)]) -> bool,
    ) -> bool {
        let (inputs, state) = self.split(words);
        let Memory {
            call: after,
            spare,
            saved,
        } = &mut *self.memory.borrow_mut();
        after.start(state, 0);
        std::mem::swap(&mut after.values, &mut call.values);
        saved.clear();
        let made = steps.iter().flat_map(|(_, made)| made);
        saved.extend(made.map(|id| (*id, after.values[*id])));
        let mut run = self
            .program
            .run(self.number, Some(damage), inputs, after, spare);
        steps.iter().for_each(|(step, _)| run.take(*step));
        let seen = look(after, saved);
        for (id, before) in &*saved {
            after.values[*id] = *before;
        }
        std::mem::swap(&mut after.values, &mut call.values);
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::circuit::engine;
    use crate::design::Design;
    use crate::numeric::format::Overflow;
    use crate::vectors::model::models;
    use crate::vectors::stimulus;

    /// The default, and the default with a loop and with overflows that stop it.
    fn designs() -> [Design; 2] {
        let default = crate::design::reader::read(None).expect("the default design");
        let mut stops = default.clone();
        stops.circuit.phase_loop = Some(crate::design::PhaseLoop {
            setpoint_raw: -3_000_000,
            proportional: crate::design::LoopGain { raw: 9, shift: 4 },
            integral: crate::design::LoopGain { raw: -5, shift: 9 },
            integrator_bits: 27,
        });
        let words = [
            &mut stops.circuit.demodulator.product,
            &mut stops.circuit.decimator.output,
        ];
        for word in words {
            word.format = "Q1.9".parse().expect("a format");
            word.overflow = Overflow::Error;
        }
        [default, stops]
    }

    /// Every damage of every recorded function, at random words: the same answer as two whole calls, and the call
    /// without damage is left as it was.
    #[test]
    fn what_depends_on_an_operation_tells_as_much_as_the_whole_function() {
        let (mut told, mut untold, mut faults) = (0, 0, 0);
        for design in designs() {
            for model in models(&design, &engine::trace(&design)) {
                let Some((program, number)) = &model.recorded else {
                    continue;
                };
                let mut vectors: Vec<_> = stimulus::random(&model.inputs, 6, 5).collect();
                vectors.iter_mut().for_each(|words| model.repair(words));
                for (words, shares_state) in vectors.iter().flat_map(|v| [(v, false), (v, true)]) {
                    let mut caller = Caller::new(program, *number);
                    caller.shares_state |= shares_state;
                    let all = caller.evaluated(words).values;
                    let each = (0..all.len()).map(|node| caller.value(words, node));
                    assert!(each.eq(all.iter().copied()), "{}", model.name);
                }
                for (words, shares_state) in vectors.iter().flat_map(|v| [(v, false), (v, true)]) {
                    let mut caller = Caller::new(program, *number);
                    caller.shares_state |= shares_state;
                    let whole = |damage| {
                        let (inputs, state) = caller.split(words);
                        let (mut state, mut outputs) = (state.to_vec(), Vec::new());
                        let fault =
                            program.damaged(*number, damage, inputs, &mut state, &mut outputs);
                        (outputs, state, fault)
                    };
                    let mut call = caller.evaluated(words);
                    let before = call.clone();
                    for damage in program.damages(*number) {
                        let dependents = caller.dependents(damage);
                        let found = caller.differs(damage, &dependents, words, &mut call);
                        let (is, was) = (whole(Some(damage)), whole(None));
                        let context = format!("{}: {damage:?} at {words:?}", model.name);
                        assert_eq!(found, is != was, "{context}");
                        assert_eq!(call, before, "{context}");
                        *(if found { &mut told } else { &mut untold }) += 1;
                        faults += usize::from(is.2 != was.2);
                    }
                }
            }
        }
        // Few damages move a word across a limit that stops the run.
        let counts = [told, untold, faults];
        assert!(told > 1000 && untold > 1000 && faults > 3, "{counts:?}");
    }
}
