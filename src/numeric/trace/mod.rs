//! The arithmetic that records: each block becomes a function of integer operations, each value
//! an interval. Emission prints the program; the engine takes its lanes and its idle casts from the
//! ranges.
//!
//! A loop is recorded once and evaluated, as intervals, for every index; a node's range is the hull
//! over the iterations, so that the values after the loop keep the last iteration's.

pub mod ir;
pub mod lanes;
mod state;

use super::arithmetic::{Arithmetic, Block, IndexTable, LoopBody, Port, Ring, SineTable, Table};
use super::cast::{Cast, round_shift};
use super::format::Overflow;
use ir::{CallSite, Function, Id, Interval, Loop, Node, Op, Program};
use state::{Loader, Storer};
use std::cell::RefCell;
use std::sync::Arc;

/// Records every operation.
#[derive(Debug, Default)]
pub struct Trace {
    recorder: RefCell<Recorder>,
}

#[derive(Debug, Default)]
struct Recorder {
    program: Program,
    /// The innermost function that is open; outermost, one that no program has.
    frame: Frame,
}

/// A function under construction.
#[derive(Debug, Default)]
struct Frame {
    function: Function,
    /// Interval of each node in the iteration at hand.
    current: Vec<Interval>,
    /// Hull of each node over the iterations before.
    earlier: Vec<Option<Interval>>,
    /// Where the next node goes: the end, or inside a loop that is evaluated once more.
    cursor: usize,
}

/// The loop's index: symbolic in what is recorded, a number for the intervals.
#[derive(Debug, Clone, Copy)]
pub struct TraceIndex(u32);

impl Trace {
    /// Nothing recorded yet.
    pub fn new() -> Self {
        Trace::default()
    }

    /// Records `block` as a function of the program. `ranges` are those of the inputs; the state
    /// handed in serves as a pattern.
    pub fn record<const I: usize, const O: usize, B: Block<Self, I, O>>(
        &self,
        block: &B,
        state: &B::State,
        ranges: [Interval; I],
    ) -> usize {
        let outer = self.open([B::NAME, B::PURPOSE, B::STATE], block.inputs(), ranges);
        let mut state = state.clone();
        block.visit(&mut state, &mut Loader { trace: self });
        let inputs = std::array::from_fn(|k| self.push(Op::Input(k), ranges[k]));
        let outputs = block.step(self, &mut state, inputs);
        block.visit(
            &mut state,
            &mut Storer {
                trace: self,
                slot: 0,
            },
        );
        self.close(outer, block.outputs(), outputs)
    }

    /// Notes the call of a function, with the name and the type of its state: the call's number, and the results' ranges.
    fn called(
        &self,
        function: usize,
        instance: &'static str,
        state: &'static str,
        arguments: Vec<Id>,
    ) -> (usize, Vec<Interval>) {
        let outputs = {
            let recorder = self.recorder.borrow();
            let callee = &recorder.program.functions[function];
            let ranges = callee.outputs.iter().map(|(_, id)| callee.nodes[*id].range);
            ranges.collect()
        };
        let number = self.with(|frame| {
            let (members, calls) = (&mut frame.function.members, &mut frame.function.calls);
            if !state.is_empty() && !members.iter().any(|(m, _)| *m == instance) {
                members.push((instance, state));
            }
            calls.push(CallSite {
                function,
                instance: if state.is_empty() { "" } else { instance },
                arguments,
            });
            calls.len() - 1
        });
        self.push(Op::Call(number), Interval::point(0));
        (number, outputs)
    }

    /// What was recorded.
    pub fn finish(self) -> Program {
        self.recorder.into_inner().program
    }

    /// Begins a function inside the innermost one, which it gives back: what `close` goes on with.
    fn open<const I: usize>(
        &self,
        [name, purpose, state]: [&'static str; 3],
        ports: [Port; I],
        ranges: [Interval; I],
    ) -> Frame {
        let frame = Frame {
            function: Function {
                name: name.to_owned(),
                purpose,
                state,
                slots: Vec::new(),
                members: Vec::new(),
                inputs: ports.into_iter().zip(ranges).collect(),
                outputs: Vec::new(),
                stores: Vec::new(),
                nodes: Vec::new(),
                loops: Vec::new(),
                calls: Vec::new(),
                names: std::collections::BTreeMap::new(),
            },
            ..Frame::default()
        };
        std::mem::replace(&mut self.recorder.borrow_mut().frame, frame)
    }

    /// Ends the innermost function; an equal one that exists already is used again.
    fn close<const O: usize>(&self, outer: Frame, ports: [Port; O], outputs: [Id; O]) -> usize {
        let mut recorder = self.recorder.borrow_mut();
        let mut function = std::mem::replace(&mut recorder.frame, outer).function;
        function.outputs = ports.into_iter().zip(outputs).collect();
        let functions = &mut recorder.program.functions;
        let base = function.name.clone();
        let mut variant = 1;
        loop {
            match functions.iter().position(|f| f.name == function.name) {
                Some(k) if functions[k] == function => return k,
                Some(_) => {
                    variant += 1;
                    function.name = format!("{base}_{variant}");
                }
                None => {
                    functions.push(function);
                    return functions.len() - 1;
                }
            }
        }
    }

    fn with<T>(&self, f: impl FnOnce(&mut Frame) -> T) -> T {
        f(&mut self.recorder.borrow_mut().frame)
    }

    fn push(&self, op: Op, range: Interval) -> Id {
        self.with(|frame| {
            let id = frame.cursor;
            frame.cursor += 1;
            if id < frame.function.nodes.len() {
                let node = &mut frame.function.nodes[id];
                assert_eq!(node.op, op, "a loop's body differs between iterations");
                frame.earlier[id] = Some(node.range);
                node.range = node.range.join(range);
                frame.current[id] = range;
            } else {
                frame.function.nodes.push(Node { op, range });
                frame.current.push(range);
                frame.earlier.push(None);
            }
            id
        })
    }

    fn range(&self, id: Id) -> Interval {
        self.with(|frame| frame.current[id])
    }

    /// Narrows a node's range in the iteration at hand by what is proved elsewhere.
    fn narrow(&self, id: Id, low: i128, high: i128) -> Id {
        self.with(|frame| {
            let narrowed = frame.current[id].meet(low, high);
            frame.current[id] = narrowed;
            frame.function.nodes[id].range =
                frame.earlier[id].map_or(narrowed, |hull| hull.join(narrowed));
        });
        id
    }

    fn register_cast(&self, cast: &Cast, before_overflow: Interval) -> usize {
        let mut recorder = self.recorder.borrow_mut();
        let program = &mut recorder.program;
        while program.casts.len() <= cast.id {
            program.casts.push(cast.clone());
            program.cast_ranges.push(None);
        }
        program.casts[cast.id] = cast.clone();
        let seen = &mut program.cast_ranges[cast.id];
        *seen = Some(seen.map_or(before_overflow, |r| r.join(before_overflow)));
        // Channels share a function where their casts do the same and need not be told apart: no fault is ever
        // noted here, or none at all.
        let (low, high) = cast.limits();
        let is_quiet =
            cast.overflow != Some(Overflow::Error) || before_overflow.is_within(low, high);
        let seen = program.casts.iter().zip(&program.cast_ranges);
        let mut seen = seen.map(|(other, range)| range.map(|_| other));
        let first = seen.position(|other| other.is_some_and(|o| is_quiet && o.does_as(cast)));
        first.unwrap_or(cast.id)
    }
}

impl Arithmetic for Trace {
    type Word = Id;
    type Residue = Id;
    type Truth = Id;
    type Index = TraceIndex;
    type Radius = f64;

    fn constant(&self, raw: i128, _fraction_bits: i32) -> Id {
        self.push(Op::Constant(raw), Interval::point(raw))
    }
    fn add(&self, a: Id, b: Id) -> Id {
        let (x, y) = (self.range(a), self.range(b));
        let range = Interval::new(x.low.saturating_add(y.low), x.high.saturating_add(y.high));
        self.push(Op::Add(a, b), range)
    }
    fn sub(&self, a: Id, b: Id) -> Id {
        let (x, y) = (self.range(a), self.range(b));
        let range = Interval::new(x.low.saturating_sub(y.high), x.high.saturating_sub(y.low));
        self.push(Op::Sub(a, b), range)
    }
    fn mul(&self, a: Id, b: Id) -> Id {
        let (x, y) = (self.range(a), self.range(b));
        let products = [
            x.low.saturating_mul(y.low),
            x.low.saturating_mul(y.high),
            x.high.saturating_mul(y.low),
            x.high.saturating_mul(y.high),
        ];
        let range = products[1..]
            .iter()
            .fold(Interval::point(products[0]), |r, p| {
                r.join(Interval::point(*p))
            });
        self.push(Op::Mul(a, b), range)
    }
    fn neg(&self, a: Id) -> Id {
        let x = self.range(a);
        let range = Interval::new(x.high.saturating_neg(), x.low.saturating_neg());
        self.push(Op::Neg(a), range)
    }
    fn named(&self, a: Id, name: &'static str) -> Id {
        self.with(|frame| frame.function.names.insert(a, name));
        a
    }
    fn read_as(&self, a: Id, _exponent: i32) -> Id {
        a
    }
    fn cast(&self, a: Id, cast: &Cast, _operands: &[Id]) -> Id {
        let x = self.range(a);
        // Every rounding is monotone, so the ends of the interval give the ends of the result.
        let rounded = Interval::new(
            round_shift(x.low, cast.shift, cast.rounding),
            round_shift(x.high, cast.shift, cast.rounding),
        );
        let number = self.register_cast(cast, rounded);
        let (low, high) = cast.limits();
        let range = match cast.overflow {
            None => rounded,
            _ if rounded.is_within(low, high) => rounded,
            Some(Overflow::Wrap) => Interval::new(low, high),
            Some(_) => Interval::new(rounded.low.clamp(low, high), rounded.high.clamp(low, high)),
        };
        self.push(Op::Cast(a, number), range)
    }
    fn wrap(&self, a: Id, bits: u32, _fraction_bits: i32) -> Id {
        let x = self.range(a);
        let all = Interval::of_bits(bits);
        let range = if x.is_within(all.low, all.high) {
            x
        } else {
            all
        };
        self.push(Op::Wrap(a, bits), range)
    }
    fn limit(&self, a: Id, low: i128, high: i128, _fraction_bits: i32) -> Id {
        let x = self.range(a);
        let range = Interval::new(x.low.clamp(low, high), x.high.clamp(low, high));
        self.push(Op::Limit(a, low, high), range)
    }
    fn is_negative(&self, a: Id) -> Id {
        self.push(Op::IsNegative(a), Interval::new(0, 1))
    }
    fn select(&self, test: Id, yes: Id, no: Id) -> Id {
        let range = self.range(yes).join(self.range(no));
        self.push(Op::Select(test, yes, no), range)
    }

    fn residue(&self, a: Id, ring: &Ring) -> Id {
        self.push(Op::Residue(a, ring.bits), Interval::point(0))
    }
    fn residue_constant(&self, raw: i128, ring: &Ring) -> Id {
        let mask = (1u128 << ring.bits) - 1;
        let op = Op::ResidueConstant(raw as u128 & mask, ring.bits);
        self.push(op, Interval::point(0))
    }
    fn residue_add(&self, a: Id, b: Id, ring: &Ring) -> Id {
        self.push(Op::ResidueAdd(a, b, ring.bits), Interval::point(0))
    }
    fn residue_sub(&self, a: Id, b: Id, ring: &Ring) -> Id {
        self.push(Op::ResidueSub(a, b, ring.bits), Interval::point(0))
    }
    fn centered(&self, a: Id, ring: &Ring) -> Id {
        self.push(Op::Centered(a, ring.bits), Interval::of_bits(ring.bits))
    }
    fn sine(&self, phase: Id, table: &SineTable) -> Id {
        let number = {
            let tables = &mut self.recorder.borrow_mut().program.sine_tables;
            match tables
                .iter()
                .position(|t| Arc::ptr_eq(&t.entries, &table.entries))
            {
                Some(k) => k,
                None => {
                    tables.push(table.clone());
                    tables.len() - 1
                }
            }
        };
        let range = hull(&table.entries);
        self.push(Op::Sine(phase, number), range)
    }

    fn lookup(&self, address: Id, table: &Table) -> Id {
        let number = {
            let tables = &mut self.recorder.borrow_mut().program.tables;
            match tables.iter().position(|t| t.name == table.name) {
                Some(k) => k,
                None => {
                    tables.push(table.clone());
                    tables.len() - 1
                }
            }
        };
        let inside = self.range(address);
        assert!(
            inside.is_within(0, table.entries.len() as i128 - 1),
            "an address leaves the table {}",
            table.name
        );
        let range = hull(&table.entries[inside.low as usize..=inside.high as usize]);
        self.push(Op::Lookup(address, number), range)
    }

    fn shift_right_by(&self, a: Id, index: TraceIndex) -> Id {
        let x = self.range(a);
        let range = Interval::new(x.low >> index.0, x.high >> index.0);
        self.push(Op::ShiftByIndex(a), range)
    }
    fn entry(&self, table: &IndexTable, index: TraceIndex) -> Id {
        let number = {
            let tables = &mut self.recorder.borrow_mut().program.index_tables;
            match tables.iter().position(|t| t.name == table.name) {
                Some(k) => k,
                None => {
                    tables.push(table.clone());
                    tables.len() - 1
                }
            }
        };
        let value = i128::from(table.entries[index.0 as usize]);
        self.push(Op::Entry(number), Interval::point(value))
    }
    fn repeat<const S: usize, B: LoopBody<Self, S>>(
        &self,
        count: u32,
        state: [Id; S],
        mut radius: f64,
        body: &B,
    ) -> [Id; S] {
        let number = self.with(|frame| {
            frame.function.loops.push(Loop {
                start: frame.cursor,
                end: frame.cursor,
                count,
                inits: state.to_vec(),
                outs: Vec::new(),
            });
            frame.function.loops.len() - 1
        });
        let start = self.with(|frame| frame.cursor);
        let mut carried = state;
        for index in 0..count {
            let ranges = carried.map(|id| self.range(id));
            self.with(|frame| frame.cursor = start);
            let phis = std::array::from_fn(|k| self.push(Op::Phi(number, k), ranges[k]));
            carried = body.step(self, TraceIndex(index), phis, &mut radius);
        }
        self.with(|frame| {
            let end = frame.cursor;
            frame.function.loops[number].end = end;
            frame.function.loops[number].outs = carried.to_vec();
        });
        let ranges = carried.map(|id| self.range(id));
        std::array::from_fn(|k| self.push(Op::LoopOut(number, k), ranges[k]))
    }
    fn within(&self, a: Id, low: i128, high: i128) -> Id {
        self.narrow(a, low, high)
    }
    fn radius(&self, x: Id, y: Id) -> f64 {
        let reach = |id| {
            let r = self.range(id);
            (r.low as f64).abs().max((r.high as f64).abs())
        };
        outward(reach(x).hypot(reach(y)))
    }
    fn bounded(&self, a: Id, radius: f64) -> Id {
        // Beyond 2^120 no interval of the chain would be narrowed by it.
        if radius < 1e36 {
            let reach = radius as i128 + 1;
            self.narrow(a, -reach, reach)
        } else {
            a
        }
    }
    fn not_negative(&self, a: Id, radius: f64, width: u32) -> Id {
        if radius + 1.0 < f64::powi(2.0, width as i32 - 1) {
            self.narrow(a, 0, i128::MAX)
        } else {
            a
        }
    }
    fn rotated(&self, radius: f64, index: TraceIndex) -> f64 {
        // Two components, each moved by less than one: less than sqrt(2).
        outward(radius * (1.0 + 0.25f64.powi(index.0 as i32)).sqrt() + 1.5)
    }
    fn wrapped_radius(&self, radius: f64, width: u32) -> f64 {
        let half = f64::powi(2.0, width as i32 - 1);
        if radius + 1.0 < half {
            radius
        } else {
            outward(half * std::f64::consts::SQRT_2)
        }
    }

    fn call<const I: usize, const O: usize, B: Block<Self, I, O>>(
        &self,
        block: &B,
        instance: &'static str,
        state: &mut B::State,
        inputs: [Id; I],
    ) -> [Id; O] {
        let ranges = inputs.map(|id| self.range(id));
        let function = self.record(block, state, ranges);
        let (number, outputs) = self.called(function, instance, B::STATE, inputs.to_vec());
        std::array::from_fn(|k| self.push(Op::CallOut(number, k), outputs[k]))
    }
}

/// The interval of a table's entries.
fn hull(entries: &[i64]) -> Interval {
    entries
        .iter()
        .map(|v| Interval::point(i128::from(*v)))
        .reduce(Interval::join)
        .unwrap_or(Interval::point(0))
}

/// A bound made larger than any rounding of the floating-point arithmetic that it came from.
fn outward(radius: f64) -> f64 {
    radius * (1.0 + 1e-12)
}
