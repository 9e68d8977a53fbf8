//! Numbers of about 106 bits as the unevaluated sum of two doubles, and their operations rounded
//! downwards or upwards.
//!
//! The algorithms are those whose relative error is proved by M. Joldes, J.-M. Muller and V. Popescu,
//! "Tight and rigorous error bounds for basic building blocks of double-word arithmetic", ACM TOMS 44
//! (2017): with u = 2^-53 at most 3 u^2 for the sum, 7 u^2 for the product, 15 u^2 + 56 u^3 for
//! the quotient. Directed results move by more than that, unless the operation is seen to be exact:
//! dyadic arguments therefore stay dyadic points. The root is checked by squaring. Whatever overflows becomes an
//! infinity on the safe side.

use std::cmp::Ordering;

/// `hi + lo` with `hi` the double nearest to the sum; `lo` is 0 when `hi` is infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wide {
    hi: f64,
    lo: f64,
}

/// More than the relative error of sum and product, with the rounding of the move itself.
const MARGIN: f64 = f64::from_bits((1023 - 102) << 52);
/// More than the relative error of the quotient.
const QUOTIENT_MARGIN: f64 = f64::from_bits((1023 - 100) << 52);
/// More than the relative error of the quotient of the leading doubles.
const COARSE_MARGIN: f64 = f64::from_bits((1023 - 50) << 52);
/// More than the absolute error where parts of a product underflow (Dekker's product is then off by
/// at most 7/2 of the smallest subnormal: S. Boldo, IJCAR 2006).
const UNDERFLOW: f64 = f64::from_bits((1023 - 1000) << 52);
/// Products above this have no underflowing part.
const SAFE: f64 = f64::from_bits((1023 - 900) << 52);

/// Which way a result may be wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Toward {
    /// At most the exact result.
    Down,
    /// At least the exact result.
    Up,
}

fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let of_b = sum - a;
    (sum, (a - (sum - of_b)) + (b - of_b))
}

/// For |a| >= |b| or a = 0.
fn fast_two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}

/// Dekker's product with Veltkamp's splitting: needs no fused multiply-add.
fn two_product(a: f64, b: f64) -> (f64, f64) {
    const SPLITTER: f64 = 134_217_729.0; // 2^27 + 1
    let product = a * b;
    let (ca, cb) = (SPLITTER * a, SPLITTER * b);
    let (ah, bh) = (ca - (ca - a), cb - (cb - b));
    let (al, bl) = (a - ah, b - bh);
    let error = ((ah * bh - product) + ah * bl + al * bh) + al * bl;
    (product, error)
}

impl From<f64> for Wide {
    fn from(value: f64) -> Self {
        Wide { hi: value, lo: 0.0 }
    }
}

impl PartialOrd for Wide {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        match self.hi.partial_cmp(&other.hi) {
            Some(Ordering::Equal) => self.lo.partial_cmp(&other.lo),
            order => order,
        }
    }
}

impl std::ops::Neg for Wide {
    type Output = Wide;
    fn neg(self) -> Wide {
        Wide {
            hi: -self.hi,
            lo: -self.lo,
        }
    }
}

impl Wide {
    /// Zero.
    pub const ZERO: Wide = Wide { hi: 0.0, lo: 0.0 };
    /// One.
    pub const ONE: Wide = Wide { hi: 1.0, lo: 0.0 };

    /// Below every number.
    pub const NEGATIVE_INFINITY: Wide = Wide {
        hi: f64::NEG_INFINITY,
        lo: 0.0,
    };
    /// Above every number.
    pub const INFINITY: Wide = Wide {
        hi: f64::INFINITY,
        lo: 0.0,
    };

    /// `a + b`, exactly.
    pub fn of_sum(a: f64, b: f64) -> Wide {
        let (hi, lo) = two_sum(a, b);
        Wide { hi, lo }
    }

    /// The nearest double.
    pub fn to_f64(self) -> f64 {
        self.hi
    }

    /// What [`Wide::to_f64`] leaves out.
    pub fn rest(self) -> f64 {
        self.lo
    }

    /// The largest double that is not above.
    pub fn floor_f64(self) -> f64 {
        if self.lo < 0.0 {
            self.hi.next_down()
        } else {
            self.hi
        }
    }

    /// The smallest double that is not below.
    pub fn ceil_f64(self) -> f64 {
        if self.lo > 0.0 {
            self.hi.next_up()
        } else {
            self.hi
        }
    }

    /// Whether both parts are finite.
    pub fn is_finite(self) -> bool {
        self.hi.is_finite() && self.lo.is_finite()
    }

    /// Whether the number is 0.
    pub fn is_zero(self) -> bool {
        self.hi == 0.0
    }

    /// The smaller of two.
    pub fn min(self, other: Wide) -> Wide {
        if other < self { other } else { self }
    }

    /// The larger of two.
    pub fn max(self, other: Wide) -> Wide {
        if other > self { other } else { self }
    }

    /// The magnitude.
    pub fn abs(self) -> Wide {
        if self.hi < 0.0 { -self } else { self }
    }

    /// Moves a result with a relative error below `margin` to the safe side.
    fn moved(self, margin: f64, toward: Toward) -> Wide {
        let by = self.hi.abs() * margin + UNDERFLOW;
        let by = if toward == Toward::Up { by } else { -by };
        let (hi, lo) = two_sum(self.hi, self.lo + by);
        Wide { hi, lo }.settled(toward)
    }

    /// Infinity on the safe side for whatever is not finite.
    fn settled(self, toward: Toward) -> Wide {
        if self.is_finite() {
            return self;
        }
        Wide::from(match toward {
            Toward::Down => f64::NEG_INFINITY,
            Toward::Up => f64::INFINITY,
        })
    }

    /// The sum and whether it is exact.
    fn sum(self, other: Wide) -> (Wide, bool) {
        let (sh, sl) = two_sum(self.hi, other.hi);
        let (th, tl) = two_sum(self.lo, other.lo);
        let (c, lost) = two_sum(sl, th);
        let (vh, vl) = fast_two_sum(sh, c);
        let (w, lost_too) = two_sum(tl, vl);
        let (hi, lo) = fast_two_sum(vh, w);
        (Wide { hi, lo }, lost == 0.0 && lost_too == 0.0)
    }

    /// The product and whether it is exact (seen for two doubles, and for powers of two).
    fn product(self, other: Wide) -> (Wide, bool) {
        if (self.is_zero() && other.is_finite()) || (other.is_zero() && self.is_finite()) {
            return (Wide::ZERO, true);
        }
        let (ph, pl) = two_product(self.hi, other.hi);
        if self.lo == 0.0 && other.lo == 0.0 {
            let (hi, lo) = fast_two_sum(ph, pl);
            return (Wide { hi, lo }, ph.abs() > SAFE);
        }
        let cross = self.hi * other.lo + self.lo * other.hi;
        let (hi, lo) = fast_two_sum(ph, pl + cross);
        let power = |w: Wide| w.lo == 0.0 && w.hi.to_bits() & ((1 << 52) - 1) == 0;
        let exact = (power(self) || power(other)) && ph.abs() > SAFE && cross.abs() > UNDERFLOW;
        (Wide { hi, lo }, exact)
    }

    /// `self + other`, rounded.
    pub(super) fn add(self, other: Wide, toward: Toward) -> Wide {
        match self.sum(other) {
            (sum, true) => sum.settled(toward),
            (sum, false) => sum.moved(MARGIN, toward),
        }
    }

    /// `self - other`, rounded.
    pub(super) fn sub(self, other: Wide, toward: Toward) -> Wide {
        self.add(-other, toward)
    }

    /// `self * other`, rounded.
    pub(super) fn mul(self, other: Wide, toward: Toward) -> Wide {
        match self.product(other) {
            (product, true) => product.settled(toward),
            (product, false) => product.moved(MARGIN, toward),
        }
    }

    /// `self / other`, rounded; an infinity on the safe side where `other` is 0.
    pub(super) fn div(self, other: Wide, toward: Toward) -> Wide {
        if self.is_zero() && !other.is_zero() && other.is_finite() {
            return Wide::ZERO;
        }
        let first = self.hi / other.hi;
        if self.hi.abs() < SAFE || other.hi.abs() < SAFE {
            // Parts below would underflow; the leading doubles alone are right to 3 u.
            return Wide::from(first).moved(COARSE_MARGIN, toward);
        }
        // first * other in double-word arithmetic (DWTimesFP1).
        let (ch, cl) = two_product(other.hi, first);
        let (th, tl) = fast_two_sum(ch, other.lo * first);
        let (rh, rl) = fast_two_sum(th, tl + cl);
        let rest = (self.hi - rh) + (self.lo - rl);
        let (hi, lo) = fast_two_sum(first, rest / other.hi);
        let quotient = Wide { hi, lo };
        match quotient.product(other) {
            (back, true) if back == self => quotient.settled(toward),
            _ => quotient.moved(QUOTIENT_MARGIN, toward),
        }
    }

    /// The square root of a number that is not negative, rounded; checked by squaring it.
    pub(super) fn sqrt(self, toward: Toward) -> Wide {
        if self.is_zero() {
            return Wide::ZERO;
        }
        if self.hi < f64::from_bits((1023 - 600) << 52) {
            return self.scaled(800, toward).sqrt(toward).scaled(-400, toward);
        }
        let first = self.hi.sqrt();
        let (square, error) = two_product(first, first);
        let rest = ((self.hi - square) - error) + self.lo;
        let (hi, lo) = fast_two_sum(first, rest / (2.0 * first));
        let root = Wide { hi, lo };
        if let (back, true) = root.product(root)
            && back == self
        {
            return root.settled(toward);
        }
        let mut margin = QUOTIENT_MARGIN;
        while margin < 1.0 {
            let candidate = root.moved(margin, toward);
            let holds = match toward {
                Toward::Down => candidate.hi < 0.0 || candidate.mul(candidate, Toward::Up) <= self,
                Toward::Up => candidate.mul(candidate, Toward::Down) >= self,
            };
            if holds {
                return candidate.max(Wide::ZERO);
            }
            margin *= 16.0;
        }
        match toward {
            Toward::Down => Wide::ZERO,
            Toward::Up => Wide::from(f64::INFINITY),
        }
    }

    /// `self * 2^exponent`, rounded only where it underflows; `|exponent| <= 2000`.
    pub(super) fn scaled(self, exponent: i32, toward: Toward) -> Wide {
        let (half, rest) = (exponent / 2, exponent - exponent / 2);
        let (one, two) = (f64::powi(2.0, half), f64::powi(2.0, rest));
        let scaled = Wide {
            hi: self.hi * one * two,
            lo: self.lo * one * two,
        };
        let kept = self.lo == 0.0 || scaled.lo.abs() > UNDERFLOW;
        if self.is_zero() || (scaled.hi.abs() > SAFE && kept) {
            scaled.settled(toward)
        } else {
            scaled.moved(MARGIN, toward)
        }
    }
}
