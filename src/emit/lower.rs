//! From the recorded program to typed machine operations, once for both languages.
//!
//! Words get the narrowest of 32, 64 and 128 bits that their range fits; casts become shifts,
//! rounding constants and limits, and vanish where ranges prove them idle. A printer then only
//! has to spell the operations.

use super::machine::{
    Expr, Lowered, Statement, Type, Typed, Value, Width, parameter_type, residue_type, word_type,
};
use super::{guard, modular, names, tidy};
use crate::numeric::trace::ir::{Function, Id, Interval, Op, Program, SlotKind};
use crate::numeric::trace::lanes::is_word;
use std::collections::BTreeMap;

/// Lowers every function of a program, callees first.
pub fn lower(program: &Program) -> Vec<Lowered> {
    let mut lowered: Vec<Lowered> = Vec::new();
    for function in &program.functions {
        let called = function.calls.iter().any(|c| lowered[c.function].may_fault);
        let of = |guarded: bool| {
            let mut lowering = Lowering::new(program, function, guarded);
            lowering.body();
            lowering.finish(called)
        };
        // Inputs are limited to their ranges where words outside could overflow.
        let plain = of(false);
        lowered.push(match guard::is_safe(program, function, &plain) {
            true => plain,
            false => of(true),
        });
    }
    lowered
}

/// A function being lowered.
pub(super) struct Lowering<'a> {
    pub(super) program: &'a Program,
    pub(super) function: &'a Function,
    /// The lowered value of each node.
    values: Vec<Option<Typed>>,
    /// Residue width of modular nodes.
    pub(super) modular: Vec<Option<Width>>,
    /// Open statement lists: the function's, and a loop's inside it.
    blocks: Vec<Vec<Statement>>,
    /// The name that each temporary asks for.
    pub(super) wishes: Vec<String>,
    notes: BTreeMap<usize, String>,
    /// What each conversion converts.
    converted: BTreeMap<usize, Typed>,
    /// Inputs are limited to their ranges.
    pub(super) guarded: bool,
    pub(super) may_fault: bool,
}

impl<'a> Lowering<'a> {
    fn new(program: &'a Program, function: &'a Function, guarded: bool) -> Self {
        Lowering {
            program,
            function,
            values: vec![None; function.nodes.len()],
            modular: modular::widths(function),
            blocks: vec![Vec::new()],
            wishes: Vec::new(),
            notes: BTreeMap::new(),
            converted: BTreeMap::new(),
            guarded,
            may_fault: false,
        }
    }

    fn finish(mut self, called: bool) -> Lowered {
        let mut outputs = Vec::new();
        for (port, id) in &self.function.outputs {
            // An output without a name belongs to a stage that the design does not have.
            if port.name.is_empty() {
                continue;
            }
            let value = self.value(*id);
            let ty = word_type(self.function.nodes[*id].range);
            outputs.push((port.name, self.convert(value, ty)));
        }
        for (slot, element, id) in &self.function.stores {
            let value = self.value(*id);
            let store = match self.function.slots[*slot].kind {
                SlotKind::Word(range) => self.convert(value, word_type(range)),
                SlotKind::Residue(_) => value,
            };
            self.emit(Statement::Store(*slot, *element, store));
        }
        let mut body = self.blocks.pop().unwrap_or_default();
        tidy::drop_unused(&mut body, &outputs);
        tidy::store_early(&mut body);
        let written_out = tidy::write_out_conversions(&mut body);
        Lowered {
            inputs: self
                .function
                .inputs
                .iter()
                .map(|(_, r)| parameter_type(*r))
                .collect(),
            names: names::distinct(self.program, self.function, &body, &self.wishes),
            outputs,
            body,
            may_fault: self.may_fault || called,
            guarded: self.guarded,
            notes: self.notes,
            written_out,
        }
    }

    pub(super) fn emit(&mut self, statement: Statement) {
        if let Some(block) = self.blocks.last_mut() {
            block.push(statement);
        }
    }

    fn temp(&mut self, wish: impl Into<String>) -> usize {
        self.wishes.push(wish.into());
        self.wishes.len() - 1
    }

    /// Gives the temporary a name.
    pub(super) fn call_it(&mut self, v: Typed, name: &str) -> Typed {
        if let Value::Temp(k) = v.value {
            name.clone_into(&mut self.wishes[k]);
        }
        v
    }

    /// Says what the temporary is, in words.
    pub(super) fn note(&mut self, v: Typed, what: String) {
        if let Value::Temp(k) = v.value {
            self.notes.entry(k).or_insert(what);
        }
    }

    pub(super) fn bind(&mut self, ty: Type, expr: Expr, range: Option<Interval>) -> Typed {
        let wish = names::of_operation(self.program, self.function, &expr);
        let temp = self.temp(wish);
        self.emit(Statement::Let(temp, ty, expr, range));
        Typed {
            value: Value::Temp(temp),
            ty,
        }
    }

    pub(super) fn value(&self, id: Id) -> Typed {
        // Every operand has been lowered before its user.
        self.values[id].unwrap_or(Typed {
            value: Value::Constant(0),
            ty: Type::Signed(Width::W32),
        })
    }

    /// The same number in another signed type that holds it.
    pub(super) fn convert(&mut self, v: Typed, ty: Type) -> Typed {
        match v.value {
            _ if v.ty == ty => v,
            Value::Constant(_) => Typed { value: v.value, ty },
            Value::Temp(k) if self.converted.get(&k).is_some_and(|from| from.ty == ty) => {
                self.converted[&k]
            }
            _ => {
                let converted = self.bind(ty, Expr::Convert(v), None);
                if let Value::Temp(k) = converted.value {
                    self.converted.insert(k, v);
                }
                converted
            }
        }
    }

    /// The low bits in an unsigned type.
    pub(super) fn low(&mut self, v: Typed, width: Width) -> Typed {
        let ty = Type::Unsigned(width);
        if v.ty == ty {
            return v;
        }
        if let Value::Constant(c) = v.value {
            let bits = if width == Width::W128 {
                c
            } else {
                c & ((1i128 << width.bits()) - 1)
            };
            return Typed {
                value: Value::Constant(bits),
                ty,
            };
        }
        self.bind(ty, Expr::Low(v), None)
    }

    pub(super) fn constant(raw: i128, ty: Type) -> Typed {
        Typed {
            value: Value::Constant(raw),
            ty,
        }
    }

    fn body(&mut self) {
        let mut id = 0;
        let mut next_loop = 0;
        while id < self.function.nodes.len() {
            match self.function.loops.get(next_loop) {
                Some(l) if l.start == id => {
                    self.counted_loop(next_loop);
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

    fn counted_loop(&mut self, number: usize) {
        let l = &self.function.loops[number];
        let mut carried = Vec::new();
        for (k, init) in l.inits.iter().enumerate() {
            let (phi, out) = (l.start + k, l.outs[k]);
            // The variable holds the first value, every value between, and the last.
            let range = self.function.nodes[phi]
                .range
                .join(self.function.nodes[out].range);
            let deferred = modular::deferred(self.function, number, k);
            let init = self.value(*init);
            let (init, ty) = match deferred {
                Some(d) => {
                    let width = Width::of_bits(d.bits);
                    (self.low(init, width), Type::Unsigned(width))
                }
                None => (self.convert(init, word_type(range)), word_type(range)),
            };
            let temp =
                self.temp(names::of_node(self.function, phi).unwrap_or_else(|| "carried".into()));
            self.emit(Statement::Carry(temp, ty, init));
            let variable = Typed {
                value: Value::Temp(temp),
                ty,
            };
            self.values[phi] = Some(variable);
            carried.push((temp, ty, deferred));
        }
        self.blocks.push(Vec::new());
        for id in l.start + l.inits.len()..l.end {
            self.node(id);
        }
        let mut next = Vec::new();
        for ((temp, ty, deferred), out) in carried.iter().zip(&l.outs) {
            let mut value = match deferred {
                Some(d) => {
                    let value = self.value(d.before);
                    self.low(value, Width::of_bits(d.bits))
                }
                None => {
                    let value = self.value(*out);
                    self.convert(value, *ty)
                }
            };
            let is_variable = carried.iter().any(|(t, ..)| value.value == Value::Temp(*t));
            if is_variable && value.value != Value::Temp(*temp) {
                // Assigned one after the other: keep the old value of another variable.
                value = self.bind(*ty, Expr::Convert(value), None);
            }
            next.push((*temp, value));
        }
        self.emit(Statement::Next(next));
        let body = self.blocks.pop().unwrap_or_default();
        self.emit(Statement::Loop(l.count, body));
        // What comes after the loop reads the variables.
        for id in l.end..self.function.nodes.len() {
            if let Op::LoopOut(n, k) = self.function.nodes[id].op
                && n == number
            {
                let (temp, ty, deferred) = carried[k];
                let mut last = Typed {
                    value: Value::Temp(temp),
                    ty,
                };
                if let Some(d) = deferred {
                    let range = self.function.nodes[id].range;
                    last = self.sign_extend(last, d.bits, word_type(range), range);
                    if let (Value::Temp(t), Some(name)) =
                        (last.value, names::of_node(self.function, id))
                    {
                        self.wishes[t] = name;
                    }
                }
                self.values[id] = Some(last);
            }
        }
    }

    fn node(&mut self, id: Id) {
        if self.values[id].is_some() {
            return;
        }
        let node = &self.function.nodes[id];
        let range = node.range;
        let ty = if is_word(&node.op) {
            word_type(range)
        } else {
            Type::Bool
        };
        let comment = Some(range);
        let before = self.wishes.len();
        let lowered = match node.op.clone() {
            Op::Input(k) => self.input(k),
            Op::Constant(raw) => Self::constant(raw, ty),
            Op::LoadWord(slot, element) => self.bind(ty, Expr::Load(slot, element), comment),
            Op::LoadResidue(slot, element) => {
                let bits = match self.function.slots[slot].kind {
                    SlotKind::Residue(bits) => bits,
                    SlotKind::Word(r) => r.bits(),
                };
                self.bind(residue_type(bits), Expr::Load(slot, element), None)
            }
            Op::Add(a, b) => self.sum(id, a, b, Expr::Add),
            Op::Sub(a, b) => self.sum(id, a, b, Expr::Sub),
            Op::Mul(a, b) => {
                let (a, b) = (self.value(a), self.value(b));
                self.in_common(a, b, range, Expr::Mul)
            }
            Op::Neg(a) => match self.modular[id] {
                Some(width) => {
                    let a = self.value(a);
                    let a = self.low(a, width);
                    let zero = Self::constant(0, Type::Unsigned(width));
                    self.bind(Type::Unsigned(width), Expr::Sub(zero, a), None)
                }
                None => {
                    let a = self.value(a);
                    let a = self.convert(a, ty);
                    self.bind(ty, Expr::Neg(a), comment)
                }
            },
            Op::Cast(a, number) => {
                let cast = &self.program.casts[number];
                let v = self.cast(a, cast, ty, range);
                if matches!(v.value, Value::Temp(k) if k >= before) {
                    self.note(v, names::of_cast(cast));
                }
                v
            }
            Op::Wrap(a, bits) => {
                let before = self.function.nodes[a].range;
                let v = self.value(a);
                let all = Interval::of_bits(bits);
                if self.modular[a].is_none() && before.is_within(all.low, all.high) {
                    self.convert(v, ty)
                } else {
                    self.sign_extend(v, bits, ty, range)
                }
            }
            Op::Limit(a, low, high) => {
                let before = self.function.nodes[a].range;
                let v = self.value(a);
                self.clamp(v, before, low, high, ty)
            }
            Op::IsNegative(a) => {
                let a = self.value(a);
                let name = match a.value {
                    Value::Temp(k) => self.wishes[k].clone(),
                    Value::Input(k) => self.function.inputs[k].0.name.to_owned(),
                    Value::Constant(_) => "constant".to_owned(),
                };
                let test = self.bind(Type::Bool, Expr::IsNegative(a), None);
                self.call_it(test, &format!("{name}_is_negative"))
            }
            Op::Select(t, a, b) => {
                let (t, a, b) = (self.value(t), self.value(a), self.value(b));
                match self.modular[id] {
                    Some(width) => {
                        let (a, b) = (self.low(a, width), self.low(b, width));
                        self.bind(Type::Unsigned(width), Expr::Select(t, a, b), None)
                    }
                    None => {
                        let (a, b) = (self.convert(a, ty), self.convert(b, ty));
                        self.bind(ty, Expr::Select(t, a, b), comment)
                    }
                }
            }
            Op::Residue(a, bits) => {
                let a = self.value(a);
                self.low(a, Width::of_bits(bits))
            }
            Op::ResidueConstant(raw, bits) => Self::constant(raw as i128, residue_type(bits)),
            Op::ResidueAdd(a, b, bits) => {
                let expr = Expr::Add(self.value(a), self.value(b));
                self.bind(residue_type(bits), expr, None)
            }
            Op::ResidueSub(a, b, bits) => {
                let expr = Expr::Sub(self.value(a), self.value(b));
                self.bind(residue_type(bits), expr, None)
            }
            Op::Centered(a, bits) => {
                let v = self.value(a);
                self.sign_extend(v, bits, ty, range)
            }
            Op::Sine(phase, table) => self.sine(phase, table, ty, range),
            Op::Lookup(address, table) => {
                let index = self.value(address);
                let index = self.low(index, Width::W32);
                self.bind(ty, Expr::Lookup(table, index), comment)
            }
            Op::ShiftByIndex(a) => {
                let operand = self.function.nodes[a].range;
                let before = word_type(operand);
                let a = self.value(a);
                let a = self.convert(a, before);
                let shifted = match operand.low >= 0 {
                    true => Expr::ShrIndex(a),
                    false => Expr::AsrIndex(a),
                };
                let shifted = self.bind(before, shifted, comment);
                self.convert(shifted, ty)
            }
            Op::Entry(table) => self.bind(ty, Expr::Entry(table), comment),
            Op::Phi(..) | Op::LoopOut(..) => return,
            Op::Call(call) => {
                self.call(id, call);
                return;
            }
            // Bound by the call itself.
            Op::CallOut(..) => return,
        };
        self.values[id] = Some(lowered);
        // What was made for this node has the node's name.
        if let (Value::Temp(k), Some(name)) = (lowered.value, names::of_node(self.function, id))
            && k >= before
        {
            self.wishes[k] = name;
        }
    }

    fn call(&mut self, id: Id, number: usize) {
        let site = &self.function.calls[number];
        let callee = &self.program.functions[site.function];
        let mut arguments = Vec::new();
        for (argument, (_, range)) in site.arguments.iter().zip(&callee.inputs) {
            let value = self.value(*argument);
            arguments.push(self.convert(value, parameter_type(*range)));
        }
        let mut results = Vec::new();
        for (k, (port, out)) in callee.outputs.iter().enumerate() {
            let ty = word_type(callee.nodes[*out].range);
            let name = names::of_node(self.function, id + 1 + k);
            let temp = self.temp(name.unwrap_or_else(|| port.name.to_owned()));
            results.push((temp, ty));
            self.values[id + 1 + k] = Some(Typed {
                value: Value::Temp(temp),
                ty,
            });
        }
        self.emit(Statement::Call(number, arguments, results));
    }
}
