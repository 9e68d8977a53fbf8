//! From the recorded program to typed machine operations, once for both languages.
//!
//! Words get the narrowest of 32, 64 and 128 bits that their range fits; casts become shifts,
//! rounding constants and limits, and vanish where ranges prove them idle. A printer then only
//! has to spell the operations.

use crate::numeric::cast::{Cast, round_shift, rounding_intermediate};
use crate::numeric::format::{Overflow, Rounding};
use crate::numeric::trace::ir::{Function, Id, Interval, Op, Program};
use crate::numeric::trace::lanes::is_word;

/// A machine type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Width {
    /// 32 bits.
    W32,
    /// 64 bits.
    W64,
    /// 128 bits.
    W128,
}

/// Signed words, unsigned residues.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Type {
    /// Two's complement; operations never overflow.
    Signed(Width),
    /// Modulo 2^width.
    Unsigned(Width),
    /// A test.
    Bool,
}

impl Width {
    /// Bits.
    pub fn bits(self) -> u32 {
        match self {
            Width::W32 => 32,
            Width::W64 => 64,
            Width::W128 => 128,
        }
    }

    fn of_bits(bits: u32) -> Self {
        match bits {
            0..=32 => Width::W32,
            33..=64 => Width::W64,
            _ => Width::W128,
        }
    }

    /// The narrowest for an interval of signed words.
    pub fn of_range(range: Interval) -> Self {
        Width::of_bits(range.bits())
    }
}

/// A value: a named temporary or a constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Value {
    /// Temporary k of the function.
    Temp(usize),
    /// A constant (for unsigned types, its bits).
    Constant(i128),
    /// Input k.
    Input(usize),
}

/// A typed value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Typed {
    /// Which.
    pub value: Value,
    /// Its type.
    pub ty: Type,
}

/// One machine operation. Operands of an arithmetic operation have the result's type.
#[derive(Debug, Clone, PartialEq)]
pub enum Expr {
    /// The same number in another signed width, which holds it.
    Convert(Typed),
    /// The low bits as an unsigned number of the result's width.
    Low(Typed),
    /// The low `bits` bits of an unsigned value as a two's-complement number.
    SignExtend(Typed, u32),
    /// Sum; modular if unsigned.
    Add(Typed, Typed),
    /// Difference; modular if unsigned.
    Sub(Typed, Typed),
    /// Product.
    Mul(Typed, Typed),
    /// Negative.
    Neg(Typed),
    /// Floor of a signed value / 2^count.
    Asr(Typed, u32),
    /// Floor of a signed value / 2^index.
    AsrIndex(Typed),
    /// Unsigned value * 2^count, modular.
    Shl(Typed, u32),
    /// Unsigned value / 2^count.
    Shr(Typed, u32),
    /// Unsigned value modulo 2^bits.
    Mask(Typed, u32),
    /// Unsigned value, known to be smaller than the signed result's range, as a signed one.
    ToSigned(Typed),
    /// a < 0.
    IsNegative(Typed),
    /// Test, yes, no.
    Select(Typed, Typed, Typed),
    /// Limited.
    Clamp(Typed, i128, i128),
    /// Limited; outside, the fault with this number is noted.
    Check(Typed, i128, i128, u32),
    /// Entry of a sine table at an unsigned 32-bit index that is in range.
    Sine(usize, Typed),
    /// Entry of a table at the loop's index.
    Entry(usize),
    /// State: slot, element.
    Load(usize, usize),
}

/// A statement.
#[derive(Debug, Clone, PartialEq)]
pub enum Statement {
    /// Temporary k := expression; the range is for a comment (words only).
    Let(usize, Type, Expr, Option<Interval>),
    /// Variables that a loop carries: temporary, type, initial value.
    Carry(usize, Type, Typed),
    /// A counted loop.
    Loop(u32, Vec<Statement>),
    /// At the end of an iteration: carried temporary := value, all at once.
    Next(Vec<(usize, Typed)>),
    /// A call: number in the function's list; arguments; temporaries that take the outputs.
    Call(usize, Vec<Typed>, Vec<(usize, Type)>),
    /// State: slot, element := value.
    Store(usize, usize, Typed),
}

/// A function ready for printing.
#[derive(Debug, Clone)]
pub struct Lowered {
    /// Types of the inputs.
    pub inputs: Vec<Type>,
    /// Outputs: name and value.
    pub outputs: Vec<(&'static str, Typed)>,
    /// The body.
    pub body: Vec<Statement>,
    /// It (or a callee) may note a fault.
    pub may_fault: bool,
}

/// The type of a state variable of `bits` bits.
pub fn residue_type(bits: u32) -> Type {
    Type::Unsigned(Width::of_bits(bits))
}

/// The type of words in `range`.
pub fn word_type(range: Interval) -> Type {
    Type::Signed(Width::of_range(range))
}

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

struct Lowering<'a> {
    program: &'a Program,
    function: &'a Function,
    /// The lowered value of each node.
    values: Vec<Option<Typed>>,
    /// Residue width of modular nodes.
    modular: Vec<Option<Width>>,
    /// Open statement lists: the function's, and a loop's inside it.
    blocks: Vec<Vec<Statement>>,
    temps: usize,
    may_fault: bool,
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
                crate::numeric::trace::ir::SlotKind::Word(range) => {
                    self.convert(value, word_type(range))
                }
                crate::numeric::trace::ir::SlotKind::Residue(_) => value,
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

    fn emit(&mut self, statement: Statement) {
        if let Some(block) = self.blocks.last_mut() {
            block.push(statement);
        }
    }

    fn temp(&mut self) -> usize {
        self.temps += 1;
        self.temps - 1
    }

    fn bind(&mut self, ty: Type, expr: Expr, range: Option<Interval>) -> Typed {
        let temp = self.temp();
        self.emit(Statement::Let(temp, ty, expr, range));
        Typed {
            value: Value::Temp(temp),
            ty,
        }
    }

    fn value(&self, id: Id) -> Typed {
        // Every operand has been lowered before its user.
        self.values[id].unwrap_or(Typed {
            value: Value::Constant(0),
            ty: Type::Signed(Width::W32),
        })
    }

    /// The same number in another signed type that holds it.
    fn convert(&mut self, v: Typed, ty: Type) -> Typed {
        match v.value {
            _ if v.ty == ty => v,
            Value::Constant(_) => Typed { value: v.value, ty },
            _ => self.bind(ty, Expr::Convert(v), None),
        }
    }

    /// The low bits in an unsigned type.
    fn low(&mut self, v: Typed, width: Width) -> Typed {
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

    fn constant(raw: i128, ty: Type) -> Typed {
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
                    crate::numeric::trace::ir::SlotKind::Residue(bits) => bits,
                    crate::numeric::trace::ir::SlotKind::Word(r) => r.bits(),
                };
                self.bind(residue_type(bits), Expr::Load(slot, element), None)
            }
            Op::Add(a, b) => self.sum(id, a, b, Expr::Add),
            Op::Sub(a, b) => self.sum(id, a, b, Expr::Sub),
            Op::Mul(a, b) => {
                let (a, b) = (self.value(a), self.value(b));
                let (a, b) = (self.convert(a, ty), self.convert(b, ty));
                self.bind(ty, Expr::Mul(a, b), comment)
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
        // A range narrowed by a proof may be smaller than its operands'.
        let range = self.function.nodes[id].range;
        let width = [a.ty, b.ty]
            .iter()
            .fold(Width::of_range(range), |w, ty| match ty {
                Type::Signed(x) => w.max(*x),
                _ => w,
            });
        let working = Type::Signed(width);
        let (a, b) = (self.convert(a, working), self.convert(b, working));
        let sum = self.bind(working, make(a, b), Some(range));
        self.convert(sum, word_type(range))
    }

    /// The low `bits` bits of a value as a two's-complement number of type `ty`.
    fn sign_extend(&mut self, v: Typed, bits: u32, ty: Type, range: Interval) -> Typed {
        let width = match v.ty {
            Type::Unsigned(width) => width,
            _ => Width::of_bits(bits),
        };
        let unsigned = self.low(v, width.min(Width::of_bits(bits)));
        let signed = Type::Signed(Width::of_bits(bits));
        let extended = self.bind(signed, Expr::SignExtend(unsigned, bits), Some(range));
        self.convert(extended, ty)
    }

    fn clamp(&mut self, v: Typed, before: Interval, low: i128, high: i128, ty: Type) -> Typed {
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

    fn cast(&mut self, a: Id, cast: &Cast, ty: Type, range: Interval) -> Typed {
        let before = self.function.nodes[a].range;
        let v = self.value(a);
        let rounded_range = Interval::new(
            round_shift(before.low, cast.shift, cast.rounding),
            round_shift(before.high, cast.shift, cast.rounding),
        );
        let (low, high) = cast.limits();
        let acts = cast.overflow.is_some() && !rounded_range.is_within(low, high);
        if acts && cast.overflow == Some(Overflow::Wrap) && cast.shift <= 0 {
            return self.wrapped_left_shift(v, cast, ty, range);
        }
        let rounded = self.round(v, before, cast, rounded_range);
        match cast.overflow {
            Some(_) if !acts => self.convert(rounded, ty),
            None => self.convert(rounded, ty),
            Some(Overflow::Wrap) => self.wrap_to_target(rounded, cast, ty, range),
            Some(Overflow::Saturate | Overflow::SaturateSymmetric) => {
                self.clamp(rounded, rounded_range, low, high, ty)
            }
            Some(Overflow::Error) => {
                self.may_fault = true;
                let working = word_type(rounded_range.join(Interval::new(low, high)));
                let v = self.convert(rounded, working);
                let fault = cast.id as u32 + 1;
                let checked = self.bind(working, Expr::Check(v, low, high, fault), Some(range));
                self.convert(checked, ty)
            }
        }
    }

    fn wrap_to_target(&mut self, v: Typed, cast: &Cast, ty: Type, range: Interval) -> Typed {
        let bits = cast.target.bits;
        if cast.target.signed {
            return self.sign_extend(v, bits, ty, range);
        }
        let unsigned = self.low(v, Width::of_bits(bits));
        let masked = self.bind(unsigned.ty, Expr::Mask(unsigned, bits), None);
        self.bind(ty, Expr::ToSigned(masked), Some(range))
    }

    fn wrapped_left_shift(&mut self, v: Typed, cast: &Cast, ty: Type, range: Interval) -> Typed {
        let count = (-cast.shift) as u32;
        let width = Width::of_bits(cast.target.bits);
        let unsigned = self.low(v, width);
        let shifted = match count {
            0 => unsigned,
            c if c >= width.bits() => Self::constant(0, unsigned.ty),
            c => self.bind(unsigned.ty, Expr::Shl(unsigned, c), None),
        };
        self.wrap_to_target(shifted, cast, ty, range)
    }

    /// v / 2^shift by the cast's rounding, exact in a wide enough type.
    fn round(&mut self, v: Typed, before: Interval, cast: &Cast, after: Interval) -> Typed {
        if cast.shift == 0 {
            return v;
        }
        let (low, high) = rounding_intermediate(cast, before.low, before.high);
        let working = word_type(before.join(Interval::new(low, high)));
        if cast.shift < 0 {
            let v = self.convert(v, working);
            let factor = Self::constant(1i128 << (-cast.shift).min(126), working);
            return self.bind(working, Expr::Mul(v, factor), Some(after));
        }
        let shift = cast.shift as u32;
        if shift >= 127 {
            return self.sign_only(v, cast.rounding, after);
        }
        let half = 1i128 << (shift - 1);
        let ones = half - 1 + half;
        let x = self.convert(v, working);
        let biased = match cast.rounding {
            Rounding::Floor => x,
            Rounding::HalfUp => self.plus(x, half),
            Rounding::Ceil => self.plus(x, ones),
            Rounding::TowardZero => self.plus_if_negative(x, ones),
            Rounding::HalfAway => {
                let near = self.plus_if_negative(x, -1);
                self.plus(near, half)
            }
            Rounding::HalfEven => {
                // The bit above the dropped ones decides a tie.
                let Type::Signed(width) = working else {
                    return x;
                };
                let bits = self.low(x, width);
                let odd = self.bind(bits.ty, Expr::Shr(bits, shift), None);
                let odd = self.bind(bits.ty, Expr::Mask(odd, 1), None);
                let odd = self.bind(working, Expr::ToSigned(odd), None);
                let near = self.plus(x, half - 1);
                self.bind(working, Expr::Add(near, odd), None)
            }
        };
        self.bind(working, Expr::Asr(biased, shift), Some(after))
    }

    fn plus(&mut self, x: Typed, constant: i128) -> Typed {
        let c = Self::constant(constant, x.ty);
        self.bind(x.ty, Expr::Add(x, c), None)
    }

    fn plus_if_negative(&mut self, x: Typed, constant: i128) -> Typed {
        let negative = self.bind(Type::Bool, Expr::IsNegative(x), None);
        let yes = Self::constant(constant, x.ty);
        let no = Self::constant(0, x.ty);
        let c = self.bind(x.ty, Expr::Select(negative, yes, no), None);
        self.bind(x.ty, Expr::Add(x, c), None)
    }

    /// More bits are dropped than the word has: only its sign decides.
    fn sign_only(&mut self, v: Typed, rounding: Rounding, after: Interval) -> Typed {
        let ty = word_type(after);
        let test = match rounding {
            Rounding::Floor => v,
            Rounding::Ceil => {
                let zero = Self::constant(0, v.ty);
                self.bind(v.ty, Expr::Sub(zero, v), None)
            }
            _ => return Self::constant(0, ty),
        };
        let negative = self.bind(Type::Bool, Expr::IsNegative(test), None);
        let unit = if rounding == Rounding::Floor { -1 } else { 1 };
        let (yes, no) = (Self::constant(unit, ty), Self::constant(0, ty));
        self.bind(ty, Expr::Select(negative, yes, no), Some(after))
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

/// Shows every operand of every statement to `note`.
pub fn visit_operands(body: &[Statement], note: &mut dyn FnMut(&Typed)) {
    for statement in body {
        match statement {
            Statement::Let(_, _, expr, _) => expr.operands().iter().for_each(&mut *note),
            Statement::Carry(_, _, v) | Statement::Store(_, _, v) => note(v),
            Statement::Loop(_, inner) => visit_operands(inner, note),
            Statement::Next(values) => values.iter().for_each(|(_, v)| note(v)),
            Statement::Call(_, arguments, _) => arguments.iter().for_each(&mut *note),
        }
    }
}

impl Expr {
    /// The values that the operation reads.
    pub fn operands(&self) -> Vec<Typed> {
        match *self {
            Expr::Convert(a)
            | Expr::Low(a)
            | Expr::SignExtend(a, _)
            | Expr::Neg(a)
            | Expr::Asr(a, _)
            | Expr::AsrIndex(a)
            | Expr::Shl(a, _)
            | Expr::Shr(a, _)
            | Expr::Mask(a, _)
            | Expr::ToSigned(a)
            | Expr::IsNegative(a)
            | Expr::Clamp(a, _, _)
            | Expr::Check(a, _, _, _)
            | Expr::Sine(_, a) => vec![a],
            Expr::Add(a, b) | Expr::Sub(a, b) | Expr::Mul(a, b) => vec![a, b],
            Expr::Select(t, a, b) => vec![t, a, b],
            Expr::Entry(_) | Expr::Load(_, _) => Vec::new(),
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
