//! The one quantiser: `cast(v, format, rounding, overflow)` of `docs/manual.md`.
//!
//! A [`Cast`] is compiled once, when the chain is built, from the fraction bits before it and the
//! format after it; [`Kernel`] is what [`super::fixed::Fixed`] then runs on every word: one
//! branch-free rounding for all six modes, and one of five ends.

use super::format::{Format, Overflow, Quantizer, Rounding};
use super::lane::Lane;

/// Which quantiser of the design a cast is: the dotted key and, where there are several, the channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Label {
    /// Dotted key of the design, e.g. `circuit.demodulator.product`.
    pub key: &'static str,
    /// `drive_i`, `drive_q`, `sense_i`, `sense_q`; `None` where there is one only.
    pub channel: Option<&'static str>,
}

impl Label {
    /// A node that exists once.
    pub const fn of(key: &'static str) -> Self {
        Label { key, channel: None }
    }

    /// A node of one channel.
    pub const fn on(key: &'static str, channel: &'static str) -> Self {
        Label {
            key,
            channel: Some(channel),
        }
    }
}

impl std::fmt::Display for Label {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.channel {
            Some(channel) => write!(f, "{} {channel}", self.key),
            None => write!(f, "{}", self.key),
        }
    }
}

/// The word that a cast makes. Unlike a [`Format`] it may have more fraction bits than bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Target {
    /// False: 0 .. 2^bits - 1.
    pub signed: bool,
    /// Width, 1..=127 if signed, else 1..=126.
    pub bits: u32,
    /// One LSB is 2^-fraction_bits.
    pub fraction_bits: i32,
}

impl Target {
    /// A signed word.
    pub const fn signed(bits: u32, fraction_bits: i32) -> Self {
        Target {
            signed: true,
            bits,
            fraction_bits,
        }
    }

    /// The smallest raw value.
    pub fn min_raw(self) -> i128 {
        if self.signed {
            -1i128 << (self.bits - 1)
        } else {
            0
        }
    }

    /// The largest raw value.
    pub fn max_raw(self) -> i128 {
        let magnitude_bits = self.bits - u32::from(self.signed);
        ((1u128 << magnitude_bits) - 1) as i128
    }
}

impl From<Format> for Target {
    fn from(format: Format) -> Self {
        Target {
            signed: format.signed,
            bits: format.bits(),
            fraction_bits: format.fraction_bits as i32,
        }
    }
}

/// A quantiser with its place in the chain, compiled.
#[derive(Debug, Clone)]
pub struct Cast {
    /// Number of the cast in its chain; given when the chain is complete.
    pub id: usize,
    /// Which node of the design this is.
    pub label: Label,
    /// The word that comes out.
    pub target: Target,
    /// The value is multiplied by 2^gain before it is quantised.
    pub gain: i32,
    /// Raw bits dropped (positive) or appended as zeros (negative).
    pub shift: i32,
    /// How dropped bits are rounded.
    pub rounding: Rounding,
    /// What happens outside the target; `None`: nothing, the word is exact whatever its size.
    pub overflow: Option<Overflow>,
    /// The first operand in a report is a coefficient, aligned by this many bits.
    pub coefficient_shift: Option<u32>,
    narrow: Kernel<i64>,
    wide: Kernel<i128>,
}

impl Cast {
    /// A cast of words with `from_fraction_bits` fraction bits.
    pub fn new(
        label: Label,
        from_fraction_bits: i32,
        gain: i32,
        target: Target,
        rounding: Rounding,
        overflow: Option<Overflow>,
    ) -> Self {
        let shift = from_fraction_bits - gain - target.fraction_bits;
        let (low, high) = match overflow {
            Some(Overflow::SaturateSymmetric) if target.signed => {
                (-target.max_raw(), target.max_raw())
            }
            _ => (target.min_raw(), target.max_raw()),
        };
        Cast {
            id: usize::MAX,
            label,
            target,
            gain,
            shift,
            rounding,
            overflow,
            coefficient_shift: None,
            narrow: Kernel::new(shift, target, rounding, overflow, (low, high)),
            wide: Kernel::new(shift, target, rounding, overflow, (low, high)),
        }
    }

    /// A cast to a quantiser of the design.
    pub fn to(label: Label, from_fraction_bits: i32, gain: i32, q: Quantizer) -> Self {
        Cast::new(
            label,
            from_fraction_bits,
            gain,
            q.format.into(),
            q.rounding,
            Some(q.overflow),
        )
    }

    /// Says that the first operand is a coefficient that was aligned by `shift` bits.
    pub fn with_coefficient(mut self, shift: i32) -> Self {
        self.coefficient_shift = Some(shift.max(0) as u32);
        self
    }

    /// True if the other cast, of the same key, does the same to every word.
    pub fn does_as(&self, other: &Cast) -> bool {
        self.label.key == other.label.key
            && (self.target, self.gain, self.shift) == (other.target, other.gain, other.shift)
            && (self.rounding, self.overflow) == (other.rounding, other.overflow)
    }

    /// The limits of the target as the overflow mode states them.
    pub fn limits(&self) -> (i128, i128) {
        (self.wide.low, self.wide.high)
    }

    /// The same cast with its rounding constant moved by `step`: damage that test vectors have to
    /// find. `None` where there is no constant.
    pub fn nudged(&self, step: i128) -> Option<Cast> {
        let mut cast = self.clone();
        cast.narrow.base = cast.narrow.base.plus(i64::low(step));
        cast.wide.base = cast.wide.base.plus(i128::low(step));
        ((1..127).contains(&self.shift) && self.rounding != Rounding::Floor).then_some(cast)
    }

    /// The same cast with one bit of damage: `bit` more are dropped and wrapped to, the limits move.
    pub fn with_damage(&self, bit: i32, (low, high): (i128, i128)) -> Cast {
        let mut cast = self.clone();
        let kernel = &mut cast.wide;
        kernel.right = kernel.right.saturating_add_signed(bit).min(127);
        kernel.bits = kernel.bits.saturating_add_signed(bit).clamp(1, 127);
        kernel.low = kernel.low.saturating_add(low);
        kernel.high = kernel.high.saturating_add(high).max(kernel.low);
        cast
    }

    /// Tells the cast what the ranges prove: that the value before the overflow step always lies
    /// within the limits, so that the step can go (and the whole cast, if it does not shift).
    pub fn prove_in_range(&mut self) {
        self.narrow.end = End::Exact;
        self.wide.end = End::Exact;
        self.narrow.idle = self.shift == 0;
        self.wide.idle = self.shift == 0;
    }

    /// True if ranges have proved that no word is ever outside the limits.
    pub fn is_proved(&self) -> bool {
        self.wide.end == End::Exact
    }

    /// True if ranges have proved that the cast never changes a word.
    pub fn is_idle(&self) -> bool {
        self.wide.idle
    }

    /// The compiled form for the lane `L`.
    #[inline(always)]
    pub fn kernel<L: HasKernel>(&self) -> &Kernel<L> {
        L::kernel(self)
    }
}

/// Lanes that a cast is compiled for.
pub trait HasKernel: Lane {
    /// The compiled cast.
    fn kernel(cast: &Cast) -> &Kernel<Self>;
}

impl HasKernel for i64 {
    #[inline(always)]
    fn kernel(cast: &Cast) -> &Kernel<i64> {
        &cast.narrow
    }
}

impl HasKernel for i128 {
    #[inline(always)]
    fn kernel(cast: &Cast) -> &Kernel<i128> {
        &cast.wide
    }
}

/// How much a cast has to do: a constant of the loop that it is in, chosen when the loop is compiled.
pub mod form {
    /// Nothing.
    pub const IDLE: u8 = 0;
    /// A constant is added, bits are dropped, nothing can overflow.
    pub const ROUNDED: u8 = 1;
    /// Any rounding, any overflow.
    pub const ANY: u8 = 2;
}

/// What a kernel does with a word outside its limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// Nothing: no word is outside.
    Exact,
    /// Keeps the low bits, sign-extended.
    WrapSigned,
    /// Keeps the low bits.
    WrapUnsigned,
    /// The nearest limit.
    Clamp,
    /// The nearest limit, and a report.
    Report,
}

/// A cast in the lanes `L`: shift, rounding constants, limits.
///
/// All six roundings of `v / 2^shift` are
/// `(v + base + (v < 0 ? negative : 0) + (odd & (v >> shift))) >> shift` with a floor shift:
///
/// | mode | base | negative | odd |
/// |---|---|---|---|
/// | floor | 0 | 0 | 0 |
/// | half_up | half | 0 | 0 |
/// | half_even | half - 1 | 0 | 1 |
/// | half_away | half | -1 | 0 |
/// | toward_zero | 0 | 2^shift - 1 | 0 |
/// | ceil | 2^shift - 1 | 0 | 0 |
#[derive(Debug, Clone)]
pub struct Kernel<L> {
    idle: bool,
    /// No shift exceeds the lane.
    follows_the_table: bool,
    /// Zeros appended.
    pub(crate) left: u32,
    /// Bits dropped.
    pub(crate) right: u32,
    /// Of the table above.
    pub(crate) base: L,
    /// Of the table above.
    pub(crate) negative: L,
    /// Of the table above.
    pub(crate) odd: L,
    /// Drops more bits than any word has: the result depends on the sign alone.
    sign_only: Option<(L, L)>,
    /// The overflow step.
    pub(crate) end: End,
    /// Bits that a wrap keeps.
    pub(crate) bits: u32,
    /// The lower limit.
    pub(crate) low: L,
    /// The upper limit.
    pub(crate) high: L,
}

impl<L: Lane> Kernel<L> {
    fn new(
        shift: i32,
        target: Target,
        rounding: Rounding,
        overflow: Option<Overflow>,
        (low, high): (i128, i128),
    ) -> Self {
        let right = shift.max(0) as u32;
        // 127-bit words shifted by at most 126 keep `v + base` inside an i128.
        let (base, negative, odd) = if (1..127).contains(&right) {
            rounding_constants(rounding, right)
        } else {
            (0, 0, 0)
        };
        let sign_only = (right >= 127).then(|| match rounding {
            Rounding::Floor => (L::low(-1), L::low(0)),
            Rounding::Ceil => (L::low(0), L::low(1)),
            _ => (L::low(0), L::low(0)),
        });
        let end = match overflow {
            None => End::Exact,
            Some(Overflow::Wrap) if target.signed => End::WrapSigned,
            Some(Overflow::Wrap) => End::WrapUnsigned,
            Some(Overflow::Saturate | Overflow::SaturateSymmetric) => End::Clamp,
            Some(Overflow::Error) => End::Report,
        };
        let left = (-shift).max(0) as u32;
        Kernel {
            idle: false,
            follows_the_table: left < L::BITS && sign_only.is_none(),
            left,
            right: right.min(L::BITS - 1),
            base: L::low(base),
            negative: L::low(negative),
            odd: L::low(odd),
            sign_only,
            end,
            bits: target.bits.min(L::BITS),
            low: L::saturated(low),
            high: L::saturated(high),
        }
    }

    /// What it has to do, of [`form`].
    pub fn form(&self) -> u8 {
        let zero = L::default();
        let rounds_by_sum = self.left == 0 && self.negative == zero && self.odd == zero;
        match self.end {
            End::Exact if self.left == 0 && self.right == 0 => form::IDLE,
            End::Exact if rounds_by_sum && self.follows_the_table => form::ROUNDED,
            _ => form::ANY,
        }
    }

    /// Runs a cast of the form [`form::ROUNDED`].
    #[inline(always)]
    pub fn rounded(&self, v: L) -> L {
        v.plus(self.base).shr(self.right)
    }

    /// Runs the cast. `outside` is called once with the word before the overflow step if the
    /// design says `error` and the word is outside; the word then saturates.
    #[inline(always)]
    pub fn apply(&self, v: L, outside: impl FnOnce(L)) -> L {
        if self.idle {
            return v;
        }
        let v = self.round(v);
        match self.end {
            End::Exact => v,
            End::Clamp => v.clamp(self.low, self.high),
            _ => self.wrapped_or_reported(v, outside),
        }
    }

    /// The overflow steps that few designs have. A call, so that the loops over casts stay short.
    #[inline(never)]
    fn wrapped_or_reported(&self, v: L, outside: impl FnOnce(L)) -> L {
        match self.end {
            End::WrapSigned => v.sign_extend(self.bits),
            End::WrapUnsigned => v.and(self.high),
            End::Report if v < self.low || v > self.high => {
                outside(v);
                v.clamp(self.low, self.high)
            }
            End::Report | End::Exact | End::Clamp => v,
        }
    }

    /// True if the word before the overflow step is what the table says: no shift exceeds the lane.
    pub(crate) fn follows_the_table(&self) -> bool {
        self.follows_the_table
    }

    /// The word before the overflow step: rounded, not limited.
    #[inline(always)]
    pub fn round(&self, v: L) -> L {
        if !self.follows_the_table {
            return self.shifted_out(v);
        }
        if self.left > 0 {
            return v.shl(self.left);
        }
        let sign = v.shr(L::BITS - 1);
        v.plus(self.base)
            .plus(self.negative.and(sign))
            .plus(self.odd.and(v.shr(self.right)))
            .shr(self.right)
    }

    /// The same where a shift leaves no bit of a word.
    #[inline(never)]
    fn shifted_out(&self, v: L) -> L {
        // After zeros alone a wrap can follow, or the word is 0.
        let (below, above) = self.sign_only.unwrap_or_default();
        match v.cmp(&L::default()) {
            std::cmp::Ordering::Less => below,
            std::cmp::Ordering::Equal => L::default(),
            std::cmp::Ordering::Greater => above,
        }
    }
}

/// (base, negative, odd) of the table above for `1 <= shift <= 126`.
fn rounding_constants(rounding: Rounding, shift: u32) -> (i128, i128, i128) {
    let half = 1i128 << (shift - 1);
    let ones = half - 1 + half;
    match rounding {
        Rounding::Floor => (0, 0, 0),
        Rounding::HalfUp => (half, 0, 0),
        Rounding::HalfEven => (half - 1, 0, 1),
        Rounding::HalfAway => (half, -1, 0),
        Rounding::TowardZero => (0, ones, 0),
        Rounding::Ceil => (ones, 0, 0),
    }
}

/// The interval that `round` needs before its shift, for lane selection: the extremes of
/// `v + constants` over `v` in `[low, high]`. For a left shift, the shifted extremes.
pub fn rounding_intermediate(cast: &Cast, low: i128, high: i128) -> (i128, i128) {
    if cast.shift <= 0 {
        let left = (-cast.shift) as u32;
        return (shl_saturating(low, left), shl_saturating(high, left));
    }
    if cast.shift >= 127 {
        return (low, high);
    }
    let (base, negative, odd) = rounding_constants(cast.rounding, cast.shift as u32);
    (
        low + base.min(0) + negative.min(0),
        high + base + negative.max(0) + odd,
    )
}

/// `v * 2^count`, clamped to the range of an i128.
pub fn shl_saturating(v: i128, count: u32) -> i128 {
    if v == 0 {
        return 0;
    }
    let room = if v > 0 {
        v.leading_zeros()
    } else {
        v.leading_ones()
    };
    if count < room {
        v << count
    } else if v > 0 {
        i128::MAX
    } else {
        i128::MIN
    }
}

/// Rounds an exact integer `v / 2^shift` as a cast does, without any overflow step: for intervals
/// and for constants. `shift` may be negative (saturating left shift).
pub fn round_shift(v: i128, shift: i32, rounding: Rounding) -> i128 {
    if shift <= 0 {
        return shl_saturating(v, (-shift) as u32);
    }
    Kernel::<i128>::new(
        shift,
        Target::signed(127, 0),
        rounding,
        None,
        (i128::MIN, i128::MAX),
    )
    .round(v)
}

#[cfg(test)]
#[path = "cast_tests.rs"]
mod tests;
