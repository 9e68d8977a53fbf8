//! Lowering of casts: shifts, rounding constants and limits, and nothing where ranges prove that a step
//! is idle.

use super::lower::Lowering;
use super::machine::{Expr, Type, Typed, Width, word_type};
use crate::numeric::cast::{Cast, round_shift, rounding_intermediate};
use crate::numeric::format::{Overflow, Rounding};
use crate::numeric::trace::ir::{Id, Interval};

impl Lowering<'_> {
    pub(super) fn cast(&mut self, a: Id, cast: &Cast, ty: Type, range: Interval) -> Typed {
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
        let intermediate = before.join(Interval::new(low, high));
        if cast.shift < 0 {
            let factor = 1i128 << (-cast.shift).min(126);
            // A word that is never above zero may be narrower than the factor.
            let working = word_type(intermediate.join(Interval::point(factor)));
            let v = self.convert(v, working);
            let factor = Self::constant(factor, working);
            let scaled = self.bind(working, Expr::Mul(v, factor), Some(after));
            return self.call_it(scaled, "scaled");
        }
        let shift = cast.shift as u32;
        if shift >= 127 {
            return self.sign_only(v, before, cast.rounding, after);
        }
        let half = 1i128 << (shift - 1);
        let ones = half - 1 + half;
        if cast.rounding == Rounding::Floor {
            return self.floor_shift(v, intermediate, shift, after);
        }
        // The constants have to fit too: a range below zero may be narrower than they are.
        let working = word_type(intermediate.join(Interval::new(0, ones)));
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
        let rounded = self.shift_right(biased, shift, intermediate, after);
        self.call_it(rounded, "rounded")
    }

    /// Floor of v / 2^shift in a type that holds v, whatever its width: beyond it the sign is left.
    fn floor_shift(&mut self, v: Typed, before: Interval, shift: u32, after: Interval) -> Typed {
        let width = Width::of_range(before);
        let x = self.convert(v, Type::Signed(width));
        let count = shift.min(width.bits() - 1);
        let floor = self.shift_right(x, count, before, after);
        self.call_it(floor, "floored")
    }

    fn plus(&mut self, x: Typed, constant: i128) -> Typed {
        let c = Self::constant(constant, x.ty);
        let biased = self.bind(x.ty, Expr::Add(x, c), None);
        self.call_it(biased, "biased")
    }

    fn plus_if_negative(&mut self, x: Typed, constant: i128) -> Typed {
        let negative = self.bind(Type::Bool, Expr::IsNegative(x), None);
        let yes = Self::constant(constant, x.ty);
        let no = Self::constant(0, x.ty);
        let c = self.bind(x.ty, Expr::Select(negative, yes, no), None);
        self.bind(x.ty, Expr::Add(x, c), None)
    }

    /// More bits are dropped than the word has: only its sign decides.
    fn sign_only(
        &mut self,
        v: Typed,
        before: Interval,
        rounding: Rounding,
        after: Interval,
    ) -> Typed {
        let ty = word_type(after);
        let test = match rounding {
            Rounding::Floor => v,
            Rounding::Ceil => {
                // The least word's negative may need one bit more.
                let negated = Interval::new(-before.high, -before.low);
                let working = word_type(before.join(negated));
                let v = self.convert(v, working);
                let zero = Self::constant(0, working);
                self.bind(working, Expr::Sub(zero, v), None)
            }
            _ => return Self::constant(0, ty),
        };
        let negative = self.bind(Type::Bool, Expr::IsNegative(test), None);
        let unit = if rounding == Rounding::Floor { -1 } else { 1 };
        let (yes, no) = (Self::constant(unit, ty), Self::constant(0, ty));
        self.bind(ty, Expr::Select(negative, yes, no), Some(after))
    }
}
