//! From the recorded program to typed machine operations, once for both languages.
//!
//! Words get the narrowest of 32, 64 and 128 bits that their range fits; casts become shifts,
//! rounding constants and limits, and vanish where ranges prove them idle. A printer then only
//! has to spell the operations.

use super::machine::{
    Expr, Lowered, Statement, Type, Typed, Value, Width, residue_type, visit_operands, word_type,
};
use crate::numeric::trace::ir::{Function, Id, Interval, Op, Program, SlotKind};
use crate::numeric::trace::lanes::is_word;

/// Lowers every function of a program, callees first.
pub fn lower(program: &Program) -> Vec<Lowered> {
    let mut lowered: Vec<Lowered> = Vec::new();
    for function in &program.functions {
        let mut lowering = Lowering::new(program, function);
        lowering.body();
        let called = function.calls.iter().any(|c| lowered[c.function].may_fault);
        lowered.push(lowering.finish(called));
    }
    lowered
}

/// A function being lowered.
pub(super) struct Lowering<'a> {
    program: &'a Program,
    pub(super) function: &'a Function,
    /// The lowered value of each node.
    values: Vec<Option<Typed>>,
    /// Residue width of modular nodes.
    modular: Vec<Option<Width>>,
    /// Open statement lists: the function's, and a loop's inside it.
    blocks: Vec<Vec<Statement>>,
    temps: usize,
    pub(super) may_fault: bool,
}

impl<'a> Lowering<'a> {
    fn new(program: &'a Program, function: &'a Function) -> Self {
        Lowering {
            program,
            function,
            values: vec![None; function.nodes.len()],
            modular: modular_widths(function),
            blocks: vec![Vec::new()],
            temps: 0,
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
        drop_unused(&mut body, &outputs);
        Lowered {
            inputs: self
                .function
                .inputs
                .iter()
                .map(|(_, r)| word_type(*r))
                .collect(),
            outputs,
            body,
            may_fault: self.may_fault || called,
        }
    }

    pub(super) fn emit(&mut self, statement: Statement) {
        if let Some(block) = self.blocks.last_mut() {
            block.push(statement);
        }
    }

    fn temp(&mut self) -> usize {
        self.temps += 1;
        self.temps - 1
    }

    pub(super) fn bind(&mut self, ty: Type, expr: Expr, range: Option<Interval>) -> Typed {
        let temp = self.temp();
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
            _ => self.bind(ty, Expr::Convert(v), None),
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
            let ty = word_type(range);
            let init = self.value(*init);
            let init = self.convert(init, ty);
            let temp = self.temp();
            self.emit(Statement::Carry(temp, ty, init));
            let variable = Typed {
                value: Value::Temp(temp),
                ty,
            };
            self.values[phi] = Some(variable);
            carried.push((temp, ty));
        }
        self.blocks.push(Vec::new());
        for id in l.start + l.inits.len()..l.end {
            self.node(id);
        }
        let mut next = Vec::new();
        for ((temp, ty), out) in carried.iter().zip(&l.outs) {
            let value = self.value(*out);
            let mut value = self.convert(value, *ty);
            let is_variable = carried.iter().any(|(t, _)| value.value == Value::Temp(*t));
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
                let (temp, ty) = carried[k];
                self.values[id] = Some(Typed {
                    value: Value::Temp(temp),
                    ty,
                });
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
        let lowered = match node.op.clone() {
            Op::Input(k) => Typed {
                value: Value::Input(k),
                ty: word_type(self.function.inputs[k].1),
            },
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
            Op::Cast(a, number) => self.cast(a, &self.program.casts[number], ty, range),
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
                self.bind(Type::Bool, Expr::IsNegative(a), None)
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
                let before = word_type(self.function.nodes[a].range);
                let a = self.value(a);
                let a = self.convert(a, before);
                let shifted = self.bind(before, Expr::AsrIndex(a), comment);
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
    }

    fn sum(&mut self, id: Id, a: Id, b: Id, make: fn(Typed, Typed) -> Expr) -> Typed {
        let (a, b) = (self.value(a), self.value(b));
        if let Some(width) = self.modular[id] {
            let (a, b) = (self.low(a, width), self.low(b, width));
            return self.bind(Type::Unsigned(width), make(a, b), None);
        }
        self.in_common(a, b, self.function.nodes[id].range, make)
    }

    /// Computes in a type that holds both operands and the result: a range narrowed by a proof and a
    /// product with zero may be smaller than the operands'.
    fn in_common(
        &mut self,
        a: Typed,
        b: Typed,
        range: Interval,
        make: fn(Typed, Typed) -> Expr,
    ) -> Typed {
        let width = [a.ty, b.ty]
            .iter()
            .fold(Width::of_range(range), |w, ty| match ty {
                Type::Signed(x) => w.max(*x),
                _ => w,
            });
        let working = Type::Signed(width);
        let (a, b) = (self.convert(a, working), self.convert(b, working));
        let result = self.bind(working, make(a, b), Some(range));
        self.convert(result, word_type(range))
    }

    /// The low `bits` bits of a value as a two's-complement number of type `ty`.
    pub(super) fn sign_extend(&mut self, v: Typed, bits: u32, ty: Type, range: Interval) -> Typed {
        let width = match v.ty {
            Type::Unsigned(width) => width,
            _ => Width::of_bits(bits),
        };
        let unsigned = self.low(v, width.min(Width::of_bits(bits)));
        let signed = Type::Signed(Width::of_bits(bits));
        let extended = self.bind(signed, Expr::SignExtend(unsigned, bits), Some(range));
        self.convert(extended, ty)
    }

    pub(super) fn clamp(
        &mut self,
        v: Typed,
        before: Interval,
        low: i128,
        high: i128,
        ty: Type,
    ) -> Typed {
        if before.is_within(low, high) {
            return self.convert(v, ty);
        }
        // Compared in a type that holds the value and both limits.
        let working = word_type(before.join(Interval::new(low, high)));
        let v = self.convert(v, working);
        let range = Interval::new(before.low.clamp(low, high), before.high.clamp(low, high));
        let limited = self.bind(working, Expr::Clamp(v, low, high), Some(range));
        self.convert(limited, ty)
    }

    fn sine(&mut self, phase: Id, number: usize, ty: Type, range: Interval) -> Typed {
        let table = &self.program.sine_tables[number];
        let phase = self.value(phase);
        let dropped = table.phase_bits - table.address_bits;
        let stepped = if table.half_step && dropped > 0 {
            let half = Self::constant(1i128 << (dropped - 1), phase.ty);
            self.bind(phase.ty, Expr::Add(phase, half), None)
        } else {
            phase
        };
        let shifted = if dropped > 0 {
            self.bind(phase.ty, Expr::Shr(stepped, dropped), None)
        } else {
            stepped
        };
        let index = self.low(shifted, Width::W32);
        let masked = self.bind(index.ty, Expr::Mask(index, table.address_bits), None);
        self.bind(ty, Expr::Sine(number, masked), Some(range))
    }

    fn call(&mut self, id: Id, number: usize) {
        let site = &self.function.calls[number];
        let callee = &self.program.functions[site.function];
        let mut arguments = Vec::new();
        for (argument, (_, range)) in site.arguments.iter().zip(&callee.inputs) {
            let value = self.value(*argument);
            arguments.push(self.convert(value, word_type(*range)));
        }
        let mut results = Vec::new();
        for (k, (_, out)) in callee.outputs.iter().enumerate() {
            let ty = word_type(callee.nodes[*out].range);
            let temp = self.temp();
            results.push((temp, ty));
            self.values[id + 1 + k] = Some(Typed {
                value: Value::Temp(temp),
                ty,
            });
        }
        self.emit(Statement::Call(number, arguments, results));
    }
}

/// Removes temporaries that nothing reads; notes of faults and calls stay.
fn drop_unused(body: &mut Vec<Statement>, outputs: &[(&'static str, Typed)]) {
    let mut used = std::collections::BTreeSet::new();
    let mut note = |v: &Typed| {
        if let Value::Temp(t) = v.value {
            used.insert(t);
        }
    };
    outputs.iter().for_each(|(_, v)| note(v));
    visit_operands(body, &mut note);
    let before = count(body);
    retain(body, &|s| match s {
        Statement::Let(t, _, expr, _) => used.contains(t) || matches!(expr, Expr::Check(..)),
        _ => true,
    });
    if count(body) < before {
        drop_unused(body, outputs);
    }
}

fn count(body: &[Statement]) -> usize {
    body.iter()
        .map(|s| match s {
            Statement::Loop(_, inner) => 1 + count(inner),
            _ => 1,
        })
        .sum()
}

fn retain(body: &mut Vec<Statement>, keep: &dyn Fn(&Statement) -> bool) {
    body.retain(|s| keep(s));
    for s in body {
        if let Statement::Loop(_, inner) = s {
            retain(inner, keep);
        }
    }
}

/// For each modular node, how many low bits its users look at, as a width.
fn modular_widths(function: &Function) -> Vec<Option<Width>> {
    let modular = function.modular();
    let mut bits = vec![0u32; function.nodes.len()];
    for id in (0..function.nodes.len()).rev() {
        let wanted = match function.nodes[id].op {
            Op::Wrap(_, b) | Op::Residue(_, b) => b,
            _ if modular[id] => bits[id],
            _ => continue,
        };
        for operand in function.operands(id) {
            bits[operand] = bits[operand].max(wanted);
        }
    }
    (0..function.nodes.len())
        .map(|id| modular[id].then(|| Width::of_bits(bits[id])))
        .collect()
}
