//! Formats, and `cast(v, format, rounding, overflow)`.

use num_bigint::BigInt;

/// `Qm.n` or `UQm.n`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// `Q` is signed, `UQ` is not.
    pub signed: bool,
    /// Integer bits (the sign is one of them).
    pub m: u32,
    /// Fraction bits.
    pub n: u32,
}

impl Format {
    /// `Qm.n`.
    pub const fn q(m: u32, n: u32) -> Self {
        Self { signed: true, m, n }
    }

    /// `UQm.n`.
    pub const fn uq(m: u32, n: u32) -> Self {
        Self {
            signed: false,
            m,
            n,
        }
    }

    /// Bits of the word.
    pub fn bits(self) -> u32 {
        self.m + self.n
    }

    /// Bits of the word as a two's-complement operand: an unsigned one has one more.
    pub fn operand_bits(self) -> u32 {
        self.bits() + u32::from(!self.signed)
    }

    /// Least raw value.
    pub fn least(self) -> i128 {
        if self.signed {
            -(1i128 << (self.bits() - 1))
        } else {
            0
        }
    }

    /// Greatest raw value.
    pub fn greatest(self) -> i128 {
        if self.signed {
            (1i128 << (self.bits() - 1)) - 1
        } else {
            (1i128 << self.bits()) - 1
        }
    }

    /// True when the format holds the raw value.
    pub fn holds(self, raw: i128) -> bool {
        (self.least()..=self.greatest()).contains(&raw)
    }

    /// Full scale in units of 1: 2^(m-1), unsigned 2^m.
    pub fn full_scale(self) -> f64 {
        let exponent = self.m as i32 - i32::from(self.signed);
        2f64.powi(exponent)
    }
}

impl std::fmt::Display for Format {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let prefix = if self.signed { "Q" } else { "UQ" };
        write!(out, "{prefix}{}.{}", self.m, self.n)
    }
}

/// The six roundings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounding {
    Floor,
    HalfUp,
    HalfEven,
    HalfAway,
    TowardZero,
    Ceil,
}

impl Rounding {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Floor,
        Self::HalfUp,
        Self::HalfEven,
        Self::HalfAway,
        Self::TowardZero,
        Self::Ceil,
    ];

    /// The name in a design file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Floor => "floor",
            Self::HalfUp => "half_up",
            Self::HalfEven => "half_even",
            Self::HalfAway => "half_away",
            Self::TowardZero => "toward_zero",
            Self::Ceil => "ceil",
        }
    }
}

/// The four overflows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overflow {
    Wrap,
    Saturate,
    SaturateSymmetric,
    Error,
}

impl Overflow {
    /// The name in a design file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Wrap => "wrap",
            Self::Saturate => "saturate",
            Self::SaturateSymmetric => "saturate_symmetric",
            Self::Error => "error",
        }
    }
}

/// What a key that holds a cast says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CastTo {
    pub format: Format,
    pub rounding: Rounding,
    pub overflow: Overflow,
}

/// An overflow of a cast whose overflow is `error`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overflowed;

impl CastTo {
    /// A cast with all three parts given.
    pub const fn new(format: Format, rounding: Rounding, overflow: Overflow) -> Self {
        Self {
            format,
            rounding,
            overflow,
        }
    }

    /// The cast of the exact number `raw * 2^-fraction_bits`.
    pub fn cast(&self, raw: i128, fraction_bits: i64) -> Result<i128, Overflowed> {
        self.overflow(self.round(raw, fraction_bits))
    }

    /// The rounding step alone: the word before its overflow step.
    pub fn round(&self, raw: i128, fraction_bits: i64) -> i128 {
        round_to(raw, fraction_bits, i64::from(self.format.n), self.rounding)
    }

    /// The overflow step alone.
    pub fn overflow(&self, word: i128) -> Result<i128, Overflowed> {
        let (least, greatest) = (self.format.least(), self.format.greatest());
        if self.overflow == Overflow::SaturateSymmetric && self.format.signed {
            // +-(2^(m+n-1) - 1): the least value itself is never given.
            return Ok(word.clamp(-greatest, greatest));
        }
        if (least..=greatest).contains(&word) {
            return Ok(word);
        }
        match self.overflow {
            Overflow::Wrap if self.format.signed => Ok(wrap(word, self.format.bits())),
            Overflow::Wrap => Ok(word.rem_euclid(1i128 << self.format.bits())),
            Overflow::Saturate | Overflow::SaturateSymmetric => Ok(word.clamp(least, greatest)),
            Overflow::Error => Err(Overflowed),
        }
    }
}

/// Two's complement wrap to `bits` bits (1 to 127).
pub fn wrap(word: i128, bits: u32) -> i128 {
    let unused = 128 - bits;
    (word << unused) >> unused
}

/// `raw * 2^-from` as a multiple of `2^-to`, rounded.
pub fn round_to(raw: i128, from: i64, to: i64, rounding: Rounding) -> i128 {
    if to >= from {
        let shifted = BigInt::from(raw) << ((to - from) as u64);
        return i128::try_from(shifted).expect("more than 127 bits: such a design is refused");
    }
    let drop = (from - to) as u64;
    if drop > 120 {
        let rounded = round_quotient_big(&BigInt::from(raw), &(BigInt::from(1) << drop), rounding);
        return i128::try_from(rounded).expect("a quotient is not wider than its dividend");
    }
    let divisor = 1i128 << drop;
    let floor = raw.div_euclid(divisor);
    let remainder = raw.rem_euclid(divisor);
    let tie = 2 * remainder == divisor;
    let above = 2 * remainder > divisor;
    let up = match rounding {
        Rounding::Floor => false,
        Rounding::Ceil => remainder != 0,
        Rounding::TowardZero => remainder != 0 && raw < 0,
        Rounding::HalfUp => above || tie,
        Rounding::HalfEven => above || (tie && floor.rem_euclid(2) == 1),
        Rounding::HalfAway => above || (tie && raw > 0),
    };
    floor + i128::from(up)
}

/// `dividend / divisor` (divisor > 0) rounded to an integer, by distance to the
/// two neighbouring integers.
pub fn round_quotient_big(dividend: &BigInt, divisor: &BigInt, rounding: Rounding) -> BigInt {
    let zero = BigInt::from(0);
    let one = BigInt::from(1);
    let mut floor = dividend / divisor;
    if &floor * divisor > *dividend {
        floor -= &one; // the operator truncates toward zero
    }
    let below = dividend - &floor * divisor;
    if below == zero {
        return floor;
    }
    let ceil = &floor + &one;
    let above = &ceil * divisor - dividend;
    let negative = *dividend < zero;
    let nearest = |tie_up: bool| match below.cmp(&above) {
        std::cmp::Ordering::Less => floor.clone(),
        std::cmp::Ordering::Greater => ceil.clone(),
        std::cmp::Ordering::Equal if tie_up => ceil.clone(),
        std::cmp::Ordering::Equal => floor.clone(),
    };
    match rounding {
        Rounding::Floor => floor,
        Rounding::Ceil => ceil,
        Rounding::TowardZero if negative => ceil,
        Rounding::TowardZero => floor,
        Rounding::HalfUp => nearest(true),
        Rounding::HalfEven => nearest(&ceil % 2 == zero),
        Rounding::HalfAway => nearest(!negative),
    }
}
