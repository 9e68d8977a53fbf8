//! The rounding kernel against definitions that share nothing with it: exhaustively over all words
//! of up to 12 bits, all modes and all shifts, and against the `fixed` crate where that has the mode.

use super::*;

/// Rounding from its definition: the two neighbours by division, then the mode's rule.
fn defined_round(v: i128, shift: u32, rounding: Rounding) -> i128 {
    let unit = 1i128 << shift;
    let below = v.div_euclid(unit);
    let rest = v.rem_euclid(unit);
    if rest == 0 {
        return below;
    }
    let up = match rounding {
        Rounding::Floor => false,
        Rounding::Ceil => true,
        Rounding::TowardZero => v < 0,
        nearest => match (2 * rest).cmp(&unit) {
            std::cmp::Ordering::Less => false,
            std::cmp::Ordering::Greater => true,
            std::cmp::Ordering::Equal => match nearest {
                Rounding::HalfUp => true,
                Rounding::HalfEven => below.rem_euclid(2) == 1,
                _ => v > 0,
            },
        },
    };
    below + i128::from(up)
}

/// Overflow from its definition, by repeated comparison and modular arithmetic.
fn defined_overflow(v: i128, target: Target, overflow: Overflow) -> i128 {
    let count = 1i128 << target.bits;
    let (min, max) = if target.signed {
        (-count / 2, count / 2 - 1)
    } else {
        (0, count - 1)
    };
    match overflow {
        Overflow::Wrap => (v - min).rem_euclid(count) + min,
        Overflow::SaturateSymmetric if target.signed => v.max(-max).min(max),
        _ => v.max(min).min(max),
    }
}

fn check_all<L: HasKernel>(bits: u32) -> u64 {
    let mut compared = 0;
    for rounding in Rounding::ALL {
        for overflow in Overflow::ALL {
            for shift in -3..=(bits as i32 + 2) {
                for signed in [true, false] {
                    let target = Target {
                        signed,
                        bits: 5,
                        fraction_bits: 0,
                    };
                    let label = Label::of("test");
                    let cast = Cast::new(label, shift, 0, target, rounding, Some(overflow));
                    for v in -(1i128 << (bits - 1))..(1i128 << (bits - 1)) {
                        let rounded = if shift < 0 {
                            v << -shift
                        } else {
                            defined_round(v, shift as u32, rounding)
                        };
                        let expected = defined_overflow(rounded, target, overflow);
                        let mut reported = None;
                        let got = cast
                            .kernel::<L>()
                            .apply(L::low(v), |w| reported = Some(w.wide()));
                        assert_eq!(
                            got.wide(),
                            expected,
                            "{v} / 2^{shift} {rounding:?} {overflow:?} signed {signed}"
                        );
                        let outside = rounded < target.min_raw() || rounded > target.max_raw();
                        let report = (overflow == Overflow::Error && outside).then_some(rounded);
                        assert_eq!(reported, report);
                        compared += 1;
                    }
                }
            }
        }
    }
    compared
}

#[test]
fn every_word_of_up_to_12_bits_in_every_mode_and_shift() {
    let mut compared = 0;
    for bits in 1..=12 {
        compared += check_all::<i64>(bits);
    }
    compared += check_all::<i128>(12);
    assert!(compared > 10_000_000, "{compared}");
}

#[test]
fn the_fixed_crate_agrees_where_it_has_the_mode() {
    use fixed::types::I6F10;
    for v in i16::MIN..=i16::MAX {
        let word = I6F10::from_bits(v);
        for (rounding, theirs) in [
            (Rounding::Floor, word.wrapping_floor()),
            (Rounding::Ceil, word.wrapping_ceil()),
            (Rounding::HalfAway, word.wrapping_round()),
            (Rounding::HalfEven, word.wrapping_round_ties_even()),
            (Rounding::TowardZero, word.round_to_zero()),
        ] {
            let cast = Cast::new(
                Label::of("test"),
                10,
                0,
                Target::signed(6, 0),
                rounding,
                Some(Overflow::Wrap),
            );
            let got = cast.kernel::<i64>().apply(i64::from(v), |_| ());
            assert_eq!(got, i64::from(theirs.to_bits() >> 10), "{v} {rounding:?}");
        }
    }
}

#[test]
fn long_words_and_long_shifts_round_like_short_ones() {
    // 127-bit words around ties, for every shift up to the longest.
    for shift in 1..=126u32 {
        for k in [-3i128, -2, -1, 0, 1, 2, 3] {
            for d in [-1i128, 0, 1] {
                let half = 1i128 << (shift - 1);
                let v = k.saturating_mul(half).saturating_add(d);
                if v.unsigned_abs() >= 1 << 126 {
                    continue;
                }
                for rounding in Rounding::ALL {
                    assert_eq!(
                        round_shift(v, shift as i32, rounding),
                        defined_round(v, shift, rounding),
                        "{v} {shift} {rounding:?}"
                    );
                }
            }
        }
    }
    for (rounding, below, above) in [
        (Rounding::Floor, -1, 0),
        (Rounding::Ceil, 0, 1),
        (Rounding::HalfUp, 0, 0),
        (Rounding::HalfAway, 0, 0),
    ] {
        assert_eq!(round_shift(-5, 400, rounding), below);
        assert_eq!(round_shift(5, 400, rounding), above);
        assert_eq!(round_shift(0, 400, rounding), 0);
    }
}

#[test]
fn a_left_shift_of_all_bits_leaves_nothing_for_a_wrap() {
    let cast = |to| {
        Cast::new(
            Label::of("test"),
            0,
            0,
            Target::signed(32, to),
            Rounding::HalfUp,
            Some(Overflow::Wrap),
        )
    };
    assert_eq!(cast(70).kernel::<i64>().apply(-1, |_| ()), 0);
    assert_eq!(cast(4).kernel::<i64>().apply(-1, |_| ()), -16);
}
