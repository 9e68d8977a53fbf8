//! Against dashu's functions at 300 bits, and integer series of another formula.

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use num_bigint::BigInt;
use proptest::prelude::*;

use super::wide::Toward;
use super::*;

pub(super) type Real = FBig<HalfEven, 2>;

pub(super) const BITS: usize = 300;

/// Exactly, or to 2000 bits.
pub(super) fn real(value: f64) -> Real {
    Real::try_from(value).unwrap().with_precision(2000).value()
}

pub(super) fn exact(w: Wide) -> Real {
    real(w.to_f64()) + real(w.rest())
}

pub(super) fn short(value: Real) -> Real {
    value.with_precision(BITS).value()
}

/// That `value` lies inside, up to dashu's own error.
pub(super) fn holds(interval: Interval, value: &Real) -> bool {
    let error = value.clone().with_precision(BITS).value() * real(f64::powi(2.0, -280));
    let error = if error < Real::ZERO { -error } else { error };
    exact(interval.low) - &error <= *value && *value <= exact(interval.high) + &error
}

/// Width over magnitude.
fn relative_width(i: Interval) -> f64 {
    match i.magnitude() {
        0.0 => 0.0,
        size => i.radius() / size,
    }
}

fn wide() -> impl Strategy<Value = Wide> {
    let part = (-1.0f64..1.0, -40i32..40, -1.0f64..1.0);
    part.prop_map(|(a, e, b)| {
        let hi = a * f64::powi(2.0, e);
        Wide::of_sum(hi, hi * b * f64::EPSILON / 4.0)
    })
}

fn one_sign() -> impl Strategy<Value = Interval> {
    (wide(), 0.0f64..1.0).prop_map(|(w, s)| {
        let other = w.mul(Wide::from(1.0 + s), Toward::Up);
        Interval::new(w.min(other), w.max(other))
    })
}

/// Sum over a (sign, q) of `factor * atan(1/q)` or atanh in units of 2^-400.
fn series(terms: &[(i64, i64)], alternating: bool) -> BigInt {
    let one = BigInt::from(1) << 400;
    let mut total = BigInt::from(0);
    for (factor, q) in terms {
        let (mut power, mut n) = (&one / q, 1i64);
        while power != BigInt::from(0) {
            let sign = if alternating && n % 4 == 3 { -1 } else { 1 };
            total += &power / n * (sign * factor);
            power /= q * q;
            n += 2;
        }
    }
    total
}

#[test]
fn pi_and_log_2_by_other_formulas() {
    // Gauss, and log 2 = 18 atanh(1/26) - 2 atanh(1/4801) + 8 atanh(1/8749).
    let pi = series(&[(48, 18), (32, 57), (-20, 239)], true);
    let log_2 = series(&[(18, 26), (-2, 4801), (8, 8749)], false);
    for (ours, digits) in [(*constants::PI, pi), (*constants::LOG_2, log_2)] {
        let digits: dashu_int::IBig = digits.to_string().parse().unwrap();
        let value = Real::from_parts(digits, -400);
        assert!(exact(ours.low) < value && value < exact(ours.high));
        assert!(relative_width(ours) < 1e-31);
    }
    assert!(holds(*constants::PI, &Real::pi(BITS)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn sums_products_quotients_and_roots_hold_the_exact_ones(a in wide(), b in wide()) {
        let (x, y) = (exact(a), exact(b));
        let (sum, product) = (&x + &y, &x * &y);
        prop_assert!(exact(a.add(b, Toward::Down)) <= sum && sum <= exact(a.add(b, Toward::Up)));
        prop_assert!(exact(a.mul(b, Toward::Down)) <= product);
        prop_assert!(product <= exact(a.mul(b, Toward::Up)));
        let i = Interval::from(a) * Interval::from(b);
        prop_assert!(relative_width(i) < 1e-30);
        if !b.is_zero() {
            let q = Interval::from(a) / Interval::from(b);
            let (low, high) = (exact(q.low) * &y, exact(q.high) * &y);
            let rising = y > Real::ZERO;
            let inside = match rising {
                true => low <= x && x <= high,
                false => high <= x && x <= low,
            };
            prop_assert!(inside);
            prop_assert!(relative_width(q) < 1e-29);
        }
        let root = Interval::from(a.abs()).sqrt();
        let x = exact(a.abs());
        prop_assert!(exact(root.low) * exact(root.low) <= x);
        prop_assert!(x <= exact(root.high) * exact(root.high));
        prop_assert!(a.is_zero() || relative_width(root) < 1e-29);
    }

    #[test]
    fn interval_products_hold_all_corners(a in one_sign(), b in one_sign(), flip in 0..4) {
        // Also across 0.
        let across = |i: Interval| Interval::new(i.low.min(-i.high), i.high.max(-i.low));
        let a = if flip & 1 == 1 { across(a) } else { a };
        let b = if flip & 2 == 2 { across(b) } else { b };
        let product = a * b;
        for x in [a.low, a.middle(), a.high] {
            for y in [b.low, b.middle(), b.high] {
                let one = exact(x) * exact(y);
                prop_assert!(exact(product.low) <= one && one <= exact(product.high));
                if !b.contains_zero() {
                    let q = a / b;
                    let low = exact(q.low) * exact(y);
                    let high = exact(q.high) * exact(y);
                    let (low, high) = if low < high { (low, high) } else { (high, low) };
                    prop_assert!(low <= exact(x) && exact(x) <= high);
                }
            }
        }
        prop_assert!(a.square().encloses(Interval::from(a.middle()).square()));
    }
}

/// Ours, dashu's, the arguments, and the relative (else absolute) width that is allowed.
type Case = (
    &'static str,
    fn(Interval) -> Interval,
    fn(Real) -> Real,
    f64,
    f64,
    bool,
);

const FUNCTIONS: [Case; 9] = [
    ("exp", Interval::exp, |x| x.exp(), -40.0, 40.0, true),
    ("log", Interval::log, |x| x.ln(), 1e-9, 50.0, false),
    ("sin", Interval::sin, |x| x.sin(), -40.0, 40.0, false),
    ("cos", Interval::cos, |x| x.cos(), -40.0, 40.0, false),
    ("tan", Interval::tan, |x| x.tan(), -1.5, 1.5, true),
    ("atan", Interval::atan, |x| x.atan(), -60.0, 60.0, true),
    ("asin", Interval::asin, |x| x.asin(), -1.0, 1.0, false),
    ("acos", Interval::acos, |x| x.acos(), -1.0, 1.0, false),
    (
        "x^2.7",
        |x| x.real_power(Interval::from(2.7)),
        |x| (x.ln() * real(2.7).with_precision(BITS).value()).exp(),
        1e-6,
        30.0,
        true,
    ),
];

#[test]
fn functions_at_points_hold_dashus_value_and_are_narrow() {
    for (name, ours, theirs, low, high, relative) in FUNCTIONS {
        let mut worst: f64 = 0.0;
        for k in 1..400 {
            // All scales: also close to the ends and to 0.
            let s = f64::from(k) / 400.0;
            let places = [
                low + (high - low) * s,
                low + (high - low) * s.powi(9),
                high - (high - low) * s.powi(9),
                (high * 0.7) * (s - 0.5).powi(5),
            ];
            for x in places.into_iter().filter(|x| *x > low && *x < high) {
                let x = Wide::of_sum(x, x * 1e-17 * s);
                let found = ours(Interval::from(x));
                assert!(holds(found, &theirs(short(exact(x)))), "{name} {x:?}");
                let width = match relative {
                    true => relative_width(found),
                    false => found.radius(),
                };
                worst = worst.max(width);
                assert!(width < 3e-28, "{name} {x:?} {width}");
            }
        }
        println!("{name}: {worst:e}");
    }
}

/// Values over intervals hold those at points, extrema included.
#[test]
fn functions_over_intervals_hold_those_at_points() {
    let mut extrema = 0;
    for (name, ours, _, low, high, _) in FUNCTIONS {
        for k in 0..200 {
            let s = f64::from(k) / 200.0;
            let a = low + (high - low) * s;
            for width in [1e-12, 1e-3, 0.4, 2.0, 7.0] {
                let b = (a + width).min(high);
                let all = ours(Interval::new(Wide::from(a), Wide::from(b)));
                let mut seen: Option<Interval> = None;
                for j in 0..=20 {
                    let x = (a + (b - a) * f64::from(j) / 20.0).clamp(a, b);
                    let one = ours(Interval::from(x));
                    assert!(all.encloses(one), "{name} {a} {b} {x}");
                    seen = Some(seen.map_or(one, |s| s.hull(one)));
                }
                let seen = seen.unwrap();
                extrema += usize::from(all.high > seen.high && all.high == Wide::ONE);
                // Not wider than needed: 20 points see the range to a few percent.
                if all.is_bounded() {
                    assert!(
                        all.radius() <= seen.radius() * 1.2 + 1e-27,
                        "{name} {a} {b}"
                    );
                }
            }
        }
    }
    assert!(extrema > 10, "{extrema}");
}

#[test]
fn what_is_not_known_is_the_whole_line() {
    let i = |a: f64, b: f64| Interval::new(Wide::from(a), Wide::from(b));
    assert_eq!(i(1.0, 2.0) / i(-1.0, 1.0), Interval::WHOLE);
    assert_eq!(Interval::ONE / Interval::ZERO, Interval::WHOLE);
    assert_eq!(i(1.5, 1.6).tan(), Interval::WHOLE);
    assert_eq!(i(-2.0, -1.0).log(), Interval::WHOLE);
    assert_eq!(i(-2.0, -1.0).sqrt(), Interval::WHOLE);
    assert_eq!(i(2.0, 3.0).asin(), Interval::WHOLE);
    assert!(!i(0.0, 1e300).square().is_bounded());
    assert!(!Interval::from(800.0).exp().is_bounded());
    assert!(Interval::from(-800.0).exp().low >= Wide::ZERO);
    assert_eq!(Interval::from(f64::NAN), Interval::WHOLE);
    let tiny = Interval::from(1e-300) * Interval::from(1e-300);
    assert!(tiny.low <= Wide::ZERO && tiny.high > Wide::ZERO);
    // Exact arguments stay points.
    assert!((Interval::from(0.5) * Interval::from(0.75)).is_point());
    assert!((Interval::from(3.0) / Interval::from(8.0)).is_point());
    assert!((Interval::ONE - Interval::from(0.25).square()).is_point());
    assert!(Interval::from(2.25).sqrt().is_point());
}

#[test]
fn ratios_and_dyadics_are_rounded_outwards() {
    use dashu_int::IBig;
    let tenth = Interval::from_ratio(&IBig::ONE, &IBig::from(10));
    let ten = real(10.0);
    assert!(exact(tenth.low) * &ten < real(1.0) && exact(tenth.high) * &ten > real(1.0));
    assert!(relative_width(tenth) < 1e-31);
    for raw in [
        0i128,
        1,
        -3,
        i128::MAX,
        i128::MIN,
        (1 << 110) + 1,
        -(1 << 104),
    ] {
        for bits in [-3, 0, 15, 140] {
            let found = Interval::from_dyadic(raw, bits);
            let value = Real::from_parts(IBig::from(raw), -bits as isize);
            assert!(
                exact(found.low) <= value && value <= exact(found.high),
                "{raw} {bits}"
            );
            assert!(raw == 0 || relative_width(found) < 1e-30);
        }
    }
    for value in [0.1, -3.5, 1e-20, 7e18] {
        assert_eq!(Dyadic::from_f64(value).to_interval(), Interval::from(value));
        assert_eq!(Dyadic::from_f64(value).to_f64(), value);
    }
}
