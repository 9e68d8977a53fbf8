//! Can a word outside a parameter's range, but inside its type, make an operation overflow?
//!
//! The ranges of a program hold for inputs inside their ranges. Here a lowered function is walked through
//! once more with every parameter as wide as its type. Where nothing overflows and nothing leaves the
//! range that its state is proved for, the function needs no guard; else its inputs are limited.

use super::machine::{Expr, Lowered, Statement, Type, Typed, Value, Width};
use crate::numeric::trace::ir::{Function, Interval, Program, SlotKind};
use std::collections::BTreeMap;

/// True if no argument of the parameters' types makes an operation overflow, an index leave its table or a
/// state leave its range.
pub(super) fn is_safe(program: &Program, function: &Function, lowered: &Lowered) -> bool {
    let all = |ty: &Type, range: Interval| match ty {
        Type::Signed(width) => width.interval() == range,
        _ => true,
    };
    let mut inputs = function.inputs.iter().zip(&lowered.inputs);
    if inputs.all(|((_, range), ty)| all(ty, *range)) {
        return true;
    }
    let mut walk = Walk {
        program,
        function,
        lowered,
        known: BTreeMap::new(),
        safe: true,
    };
    walk.body(&lowered.body);
    for (_, v) in &lowered.outputs {
        walk.value(v);
    }
    walk.safe
}

struct Walk<'a> {
    program: &'a Program,
    function: &'a Function,
    lowered: &'a Lowered,
    /// What each temporary can be.
    known: BTreeMap<usize, Interval>,
    safe: bool,
}

/// Every word of a type.
fn of_type(ty: Type) -> Interval {
    match ty {
        Type::Signed(width) => width.interval(),
        Type::Unsigned(Width::W128) => Interval::new(0, i128::MAX),
        Type::Unsigned(width) => Interval::new(0, (1 << width.bits()) - 1),
        Type::Bool => Interval::new(0, 1),
    }
}

impl Walk<'_> {
    fn value(&mut self, v: &Typed) -> Interval {
        match v.value {
            Value::Constant(raw) => Interval::point(raw),
            Value::Input(k) => of_type(self.lowered.inputs[k]),
            Value::Temp(k) => match (self.known.get(&k), self.lowered.written_out.get(&k)) {
                (Some(range), _) => *range,
                (None, Some((ty, expr))) => self.expression(*ty, expr),
                (None, None) => of_type(v.ty),
            },
        }
    }

    fn body(&mut self, body: &[Statement]) {
        for statement in body {
            match statement {
                Statement::Let(k, ty, expr, _) => {
                    let range = self.expression(*ty, expr);
                    self.known.insert(*k, range);
                }
                // What a loop does to words outside their range is not followed.
                Statement::Carry(..) | Statement::Loop(..) | Statement::Next(_) => {
                    self.safe = false
                }
                Statement::Call(number, arguments, results) => {
                    let callee = &self.program.functions[self.function.calls[*number].function];
                    for (argument, (_, range)) in arguments.iter().zip(&callee.inputs) {
                        let given = self.value(argument);
                        self.safe &= given.is_within(range.low, range.high);
                    }
                    for ((k, _), (_, id)) in results.iter().zip(&callee.outputs) {
                        self.known.insert(*k, callee.nodes[*id].range);
                    }
                }
                Statement::Store(slot, _, v) => {
                    let given = self.value(v);
                    if let SlotKind::Word(range) = self.function.slots[*slot].kind {
                        self.safe &= given.is_within(range.low, range.high);
                    }
                }
            }
        }
    }

    fn expression(&mut self, ty: Type, expr: &Expr) -> Interval {
        let of: Vec<Interval> = expr.operands().iter().map(|v| self.value(v)).collect();
        let corners = |f: fn(i128, i128) -> i128| {
            let (a, b) = (of[0], of[1]);
            let all = [
                (a.low, b.low),
                (a.low, b.high),
                (a.high, b.low),
                (a.high, b.high),
            ];
            let points = all.map(|(a, b)| Interval::point(f(a, b)));
            points.into_iter().reduce(Interval::join).unwrap_or(a)
        };
        let clamped = |low: i128, high: i128| {
            Interval::new(of[0].low.clamp(low, high), of[0].high.clamp(low, high))
        };
        let result = match *expr {
            Expr::Convert(_) | Expr::Low(_) | Expr::ToSigned(_) => of[0],
            Expr::Add(..) => corners(i128::saturating_add),
            Expr::Sub(..) => corners(i128::saturating_sub),
            Expr::Mul(..) => corners(i128::saturating_mul),
            Expr::Neg(_) => Interval::new(of[0].high.saturating_neg(), of[0].low.saturating_neg()),
            Expr::Asr(_, n) | Expr::ShrPositive(_, n) if n < 127 => {
                self.safe &= of[0].low >= 0 || matches!(expr, Expr::Asr(..));
                Interval::new(of[0].low >> n, of[0].high >> n)
            }
            Expr::Shr(_, n) if n < 127 => Interval::new(of[0].low.max(0) >> n, of[0].high >> n),
            Expr::Mask(_, n) if n < 127 => Interval::new(0, (1 << n) - 1),
            Expr::SignExtend(_, n) if n < 128 => Interval::of_bits(n),
            Expr::Select(..) => of[1].join(of[2]),
            Expr::Clamp(_, low, high) | Expr::Check(_, low, high, _) => clamped(low, high),
            Expr::Sine(k, _) => self.entry(of[0], &self.program.sine_tables[k].entries.clone()),
            Expr::Lookup(k, _) => self.entry(of[0], &self.program.tables[k].entries.clone()),
            Expr::Load(slot, _) => match self.function.slots[slot].kind {
                SlotKind::Word(range) => range,
                SlotKind::Residue(_) => of_type(ty),
            },
            _ => of_type(ty),
        };
        let all = of_type(ty);
        if result.is_within(all.low, all.high) {
            return result;
        }
        // Unsigned words wrap, and so do those of 128 bits.
        self.safe &= !matches!(ty, Type::Signed(width) if width != Width::W128);
        all
    }

    fn entry(&mut self, index: Interval, entries: &[i64]) -> Interval {
        self.safe &= index.is_within(0, entries.len() as i128 - 1);
        let words = entries.iter().map(|v| Interval::point(i128::from(*v)));
        words.reduce(Interval::join).unwrap_or(Interval::point(0))
    }
}
