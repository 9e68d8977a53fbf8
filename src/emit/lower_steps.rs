//! Steps that several operations are lowered with: sums in a type that holds them, sign extension, limits,
//! shifts, the address of a sine, and inputs.

use super::lower::Lowering;
use super::machine::{Expr, Type, Typed, Value, Width, parameter_type, word_type};
use crate::numeric::trace::ir::{Id, Interval};

impl Lowering<'_> {
    pub(super) fn sum(&mut self, id: Id, a: Id, b: Id, make: fn(Typed, Typed) -> Expr) -> Typed {
        let (a, b) = (self.value(a), self.value(b));
        if let Some(width) = self.modular[id] {
            let (a, b) = (self.low(a, width), self.low(b, width));
            return self.bind(Type::Unsigned(width), make(a, b), None);
        }
        self.in_common(a, b, self.function.nodes[id].range, make)
    }

    /// Computes in a type that holds both operands and the result: a range narrowed by a proof and a
    /// product with zero may be smaller than the operands'.
    pub(super) fn in_common(
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

    pub(super) fn sine(&mut self, phase: Id, number: usize, ty: Type, range: Interval) -> Typed {
        let table = &self.program.sine_tables[number];
        let phase = self.value(phase);
        let dropped = table.phase_bits - table.address_bits;
        let stepped = if table.half_step && dropped > 0 {
            let half = Self::constant(1i128 << (dropped - 1), phase.ty);
            let stepped = self.bind(phase.ty, Expr::Add(phase, half), None);
            self.call_it(stepped, "half_step_on")
        } else {
            phase
        };
        let shifted = if dropped > 0 {
            let shifted = self.bind(phase.ty, Expr::Shr(stepped, dropped), None);
            self.call_it(shifted, "top_bits")
        } else {
            stepped
        };
        let index = self.low(shifted, Width::W32);
        let masked = self.bind(index.ty, Expr::Mask(index, table.address_bits), None);
        self.call_it(masked, "address");
        self.bind(ty, Expr::Sine(number, masked), Some(range))
    }

    /// Floor of `v / 2^count`, `count` less than the width of `v`; `before`: every value of `v`.
    pub(super) fn shift_right(
        &mut self,
        v: Typed,
        count: u32,
        before: Interval,
        after: Interval,
    ) -> Typed {
        let width = match v.ty {
            Type::Signed(width) => width,
            _ => return v,
        };
        if before.low >= 0 {
            return self.bind(v.ty, Expr::ShrPositive(v, count), Some(after));
        }
        if count + 1 < width.bits() {
            return self.bind(v.ty, Expr::Asr(v, count), Some(after));
        }
        // Nothing is left but the sign.
        let negative = self.bind(Type::Bool, Expr::IsNegative(v), None);
        let (minus, zero) = (Self::constant(-1, v.ty), Self::constant(0, v.ty));
        self.bind(v.ty, Expr::Select(negative, minus, zero), Some(after))
    }

    /// An input as a word of at least 32 bits.
    pub(super) fn input(&mut self, k: usize) -> Typed {
        let (port, range) = &self.function.inputs[k];
        let (narrow, ty) = (parameter_type(*range), word_type(*range));
        let given = Typed {
            value: Value::Input(k),
            ty: narrow,
        };
        let word = self.convert(given, ty);
        let holds_more = matches!(narrow, Type::Signed(w) if w.interval() != *range);
        if !self.guarded || !holds_more {
            return word;
        }
        let guarded = Expr::Clamp(word, range.low, range.high);
        let limited = self.bind(ty, guarded, Some(*range));
        if let Value::Temp(temp) = limited.value {
            self.wishes[temp] = format!("{}_in_range", port.name);
        }
        limited
    }
}
