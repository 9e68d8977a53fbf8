//! The typed machine operations that [`super::lower`] makes of a program and the printers spell.

use crate::numeric::trace::ir::Interval;
use std::collections::BTreeMap;

/// A machine type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Width {
    /// 8 bits: parameters only.
    W8,
    /// 16 bits: parameters only.
    W16,
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
            Width::W8 => 8,
            Width::W16 => 16,
            Width::W32 => 32,
            Width::W64 => 64,
            Width::W128 => 128,
        }
    }

    /// The narrowest of at least `bits` bits.
    pub fn of_bits(bits: u32) -> Self {
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

    /// Every signed word of this width.
    pub fn interval(self) -> Interval {
        match self {
            Width::W128 => Interval::new(i128::MIN, i128::MAX),
            width => Interval::of_bits(width.bits()),
        }
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
    /// A signed value / 2^index, where the value is never below zero.
    ShrIndex(Typed),
    /// A signed value / 2^count, where the value is never below zero.
    ShrPositive(Typed, u32),
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
    /// Entry of a table at an unsigned 32-bit index that is in range.
    Lookup(usize, Typed),
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
    /// Its inputs are limited to their ranges.
    pub guarded: bool,
    /// The names of the temporaries.
    pub names: Vec<String>,
    /// What a temporary is, in words, where its name and its operation do not say it.
    pub notes: BTreeMap<usize, String>,
    /// Temporaries that are nothing but another one in another type: written where they are used.
    pub written_out: BTreeMap<usize, (Type, Expr)>,
}

impl Lowered {
    /// Numbers of the inputs that nothing reads: a constant polynomial does not look at its
    /// thermometer.
    pub fn unused_inputs(&self) -> Vec<usize> {
        let mut used = vec![false; self.inputs.len()];
        let mut note = |v: &Typed| {
            if let Value::Input(k) = v.value {
                used[k] = true;
            }
        };
        self.outputs.iter().for_each(|(_, v)| note(v));
        visit_operands(&self.body, &mut note);
        let written_out = self.written_out.values();
        written_out.for_each(|(_, expr)| expr.operands().iter().for_each(&mut note));
        (0..used.len()).filter(|k| !used[*k]).collect()
    }
}

/// The type of a state variable of `bits` bits.
pub fn residue_type(bits: u32) -> Type {
    Type::Unsigned(Width::of_bits(bits))
}

/// The type of a parameter in `range`: the narrowest there is. Nothing is computed in fewer than 32 bits.
pub fn parameter_type(range: Interval) -> Type {
    Type::Signed(match range.bits() {
        0..=8 => Width::W8,
        9..=16 => Width::W16,
        bits => Width::of_bits(bits),
    })
}

/// The type of words in `range`.
pub fn word_type(range: Interval) -> Type {
    Type::Signed(Width::of_range(range))
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
            | Expr::ShrPositive(a, _)
            | Expr::AsrIndex(a)
            | Expr::ShrIndex(a)
            | Expr::Shl(a, _)
            | Expr::Shr(a, _)
            | Expr::Mask(a, _)
            | Expr::ToSigned(a)
            | Expr::IsNegative(a)
            | Expr::Clamp(a, _, _)
            | Expr::Check(a, _, _, _)
            | Expr::Sine(_, a)
            | Expr::Lookup(_, a) => vec![a],
            Expr::Add(a, b) | Expr::Sub(a, b) | Expr::Mul(a, b) => vec![a, b],
            Expr::Select(t, a, b) => vec![t, a, b],
            Expr::Entry(_) | Expr::Load(_, _) => Vec::new(),
        }
    }
}
