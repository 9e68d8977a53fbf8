//! The reference of the detection chain, checked by itself.

use std::collections::BTreeSet;

use crate::oracle::design::{AmplitudeLoop, Cordic, Design, Gain, PhaseLoop, Verdict};
use crate::oracle::generate::{self, Aim};
use crate::oracle::number::{CastTo, Format, Overflow, Rounding};
use crate::oracle::{capture, constants, fixed, float, golden, number};
use crate::rng::Rng;
use num_bigint::BigInt;

/// The text's example rows and its checksums up to 65536 samples.
#[test]
fn golden_checksums() {
    let design = golden::design();
    for (samples, wanted) in &golden::CHECKSUMS[..3] {
        let rows = fixed::replay(&design, &golden::capture(*samples)).expect("no overflow");
        assert_eq!(rows.len(), samples / 64);
        let found = golden::checksum(rows.iter().map(golden::words_of));
        assert_eq!(found, *wanted, "{samples} samples: {found:016x}");
        for (row, first) in rows.iter().zip(golden::FIRST_ROWS) {
            assert_eq!(golden::words_of(row), [first.0, first.1, first.2]);
        }
    }
}

/// Sines, arc tangents and magnitude constants agree with double precision.
#[test]
fn constants_agree_with_f64() {
    for address_bits in [2, 3, 7, 10, 16] {
        for bits in [2, 3, 16, 30, 40] {
            let format = Format::q(1, bits - 1);
            let table = constants::sine_table(format, address_bits);
            assert_eq!(table.len(), 1 << address_bits);
            for (k, &entry) in table.iter().enumerate() {
                let angle = std::f64::consts::TAU * k as f64 / table.len() as f64;
                let real = format.greatest() as f64 * angle.sin();
                assert!((entry as f64 - real).abs() < 0.502, "{format} entry {k}");
            }
        }
    }
    for angle_bits in [4, 16, 32, 48] {
        for (i, &entry) in constants::atan_table(30, angle_bits).iter().enumerate() {
            let real =
                0.5f64.powi(i as i32).atan() / std::f64::consts::TAU * 2f64.powi(angle_bits as i32);
            assert!(
                (entry as f64 - real).abs() < 0.51,
                "atan {i} of {angle_bits}"
            );
        }
    }
    for iterations in 4..=30 {
        let product: f64 = (0..iterations)
            .map(|i| (1.0 + 0.25f64.powi(i as i32)).sqrt())
            .product();
        for gain_bits in [1, 2, 16, 40] {
            let real = 2f64.powi(gain_bits as i32) / product;
            let entry = constants::magnitude_constant(iterations, gain_bits) as f64;
            assert!((entry - real).abs() < 0.51, "{iterations} {gain_bits}");
        }
        // 62 bits: relative agreement is all that f64 can say
        let entry = constants::magnitude_constant(iterations, 62) as f64;
        assert!((entry * product / 2f64.powi(62) - 1.0).abs() < 1e-14);
    }
}

/// The rotation of the sine table loses nothing against the series, up to the
/// range where the series itself converges fast.
#[test]
fn sine_rotation_agrees_with_the_series() {
    let quarter = constants::finest_quarter();
    for k in [1usize, 2, 77, 4096, 8192, 12_345, 16_383, 16_384] {
        let (sin, _) = constants::sin_cos_series(&constants::finest_angle(k as u64));
        let difference = (&quarter[k] - sin).magnitude().clone();
        assert!(difference.bits() < 24, "entry {k}: {difference}");
    }
}

/// The two ways to round agree, by enumeration and on random words.
#[test]
fn rounding_by_its_definition() {
    for rounding in Rounding::ALL {
        for raw in -40i128..=40 {
            for drop in 1..=4i64 {
                let divisor = BigInt::from(1) << (drop as u64);
                let wanted = number::round_quotient_big(&raw.into(), &divisor, rounding);
                let found = number::round_to(raw, drop, 0, rounding);
                assert_eq!(BigInt::from(found), wanted, "{raw} / 2^{drop} {rounding:?}");
            }
        }
    }
    let mut rng = Rng::new(1);
    for _ in 0..2000 {
        let wide = (i128::from(rng.next_u64() as i64) << 62) | i128::from(rng.next_u64() >> 2);
        let raw = wide >> rng.bits(0, 120);
        let drop = rng.range(1, 120);
        let divisor = BigInt::from(1) << (drop as u64);
        for rounding in Rounding::ALL {
            let wanted = number::round_quotient_big(&raw.into(), &divisor, rounding);
            let found = number::round_to(raw, drop, 0, rounding);
            assert_eq!(BigInt::from(found), wanted, "{raw} / 2^{drop} {rounding:?}");
        }
    }
    // one and a half, and minus one and a half
    let ties = [
        (Rounding::Floor, 1, -2),
        (Rounding::HalfUp, 2, -1),
        (Rounding::HalfEven, 2, -2),
        (Rounding::HalfAway, 2, -2),
        (Rounding::TowardZero, 1, -1),
        (Rounding::Ceil, 2, -1),
    ];
    for (rounding, plus, minus) in ties {
        assert_eq!(number::round_to(3, 1, 0, rounding), plus);
        assert_eq!(number::round_to(-3, 1, 0, rounding), minus);
    }
}

/// The overflow steps at the ends of signed and unsigned formats.
#[test]
fn overflow_by_its_definition() {
    let cast = |format, overflow| CastTo::new(format, Rounding::Floor, overflow);
    let signed = Format::q(3, 1);
    let unsigned = Format::uq(3, 1);
    let cases = [
        (signed, Overflow::Wrap, 8, Ok(-8)),
        (signed, Overflow::Wrap, -9, Ok(7)),
        (signed, Overflow::Saturate, 8, Ok(7)),
        (signed, Overflow::Saturate, -9, Ok(-8)),
        (signed, Overflow::SaturateSymmetric, -8, Ok(-7)),
        (signed, Overflow::SaturateSymmetric, 9, Ok(7)),
        (signed, Overflow::Error, -8, Ok(-8)),
        (signed, Overflow::Error, 8, Err(number::Overflowed)),
        (unsigned, Overflow::Wrap, -1, Ok(15)),
        (unsigned, Overflow::Wrap, 16, Ok(0)),
        (unsigned, Overflow::Saturate, -1, Ok(0)),
        (unsigned, Overflow::SaturateSymmetric, 16, Ok(15)),
        (unsigned, Overflow::SaturateSymmetric, -1, Ok(0)),
        (unsigned, Overflow::Error, -1, Err(number::Overflowed)),
    ];
    for (format, overflow, word, wanted) in cases {
        assert_eq!(
            cast(format, overflow).cast(word, 1),
            wanted,
            "{word} {overflow:?}"
        );
    }
}

/// The golden design with word lengths so fine that the bit-accurate chain is
/// within about 1e-9 of real numbers (its phase never falls between addresses).
fn fine_design() -> Design {
    let mut design = golden::design();
    design.nco.table = Format::q(1, 39);
    design.product.format = Format::q(2, 54);
    design.output.format = Format::q(3, 48);
    design.cordic = Cordic {
        iterations: 30,
        guard_bits: 8,
        width: 64,
        angle_bits: 48,
        gain_bits: 60,
    };
    let compensation = design.compensation.as_mut().expect("a compensation");
    compensation.accumulator.format = Format::q(20, 40);
    compensation.output.format = Format::q(24, 40);
    design
}

/// The real chain against the bit-accurate one: the two are written apart, so
/// signs, delays, scales and modes of each are checked by the other.
#[test]
fn float_is_near_fixed() {
    let capture = golden::capture(64 * 60);
    for (stages, delay) in [(3, 1), (2, 2), (5, 1), (1, 2)] {
        let mut design = fine_design();
        design.stages = stages;
        design.differential_delay = delay;
        design.ratio = 60;
        let rows = fixed::replay(&design, &capture).expect("no overflow");
        let reals = float::replay(&design, &capture, [0.0; 3]);
        let units = [0.0, 48.0, 48.0, 48.0, 48.0, 48.0, 48.0, 40.0];
        let tolerances = [0.0, 1e-9, 1e-9, 1e-9, 1e-9, 1e-8, 1e-8, 1e-4];
        assert_eq!(rows.len(), reals.len());
        for (index, (row, real)) in rows.iter().zip(&reals).enumerate() {
            for (column, value) in real.values(index).into_iter().enumerate().skip(1) {
                let raw = row.values(index)[column] as f64;
                let difference = raw * 2f64.powi(-(units[column] as i32)) - value;
                assert!(
                    difference.abs() < tolerances[column],
                    "{stages} stages, row {index}, column {column}: {difference:e}"
                );
            }
        }
    }
}

/// The same with both loops at work: the address steps of the table now limit
/// the agreement.
#[test]
fn float_loops_are_near_fixed() {
    let mut design = fine_design();
    design.nco.address_bits = 16;
    design.nco.address_half_up = true;
    design.nco.phase_bits = 48;
    design.nco.tuning_word <<= 16;
    design.phase_loop = Some(PhaseLoop {
        setpoint_raw: -(1 << 44),
        proportional: Gain { raw: 9, shift: 13 },
        integral: Gain { raw: -9, shift: 17 },
        integrator_bits: 64,
    });
    design.amplitude_loop = Some(AmplitudeLoop {
        setpoint_raw: 1 << 46,
        error_shift: 33,
        integrator_shift: 36,
        initial_raw: 1 << 50,
        gain_bits: 16,
    });
    let capture = golden::capture(64 * 60);
    let rows = fixed::replay(&design, &capture).expect("no overflow");
    let reals = float::replay(&design, &capture, [0.0; 3]);
    let mut words = Vec::new();
    for (row, real) in rows.iter().zip(&reals) {
        let word = row.tuning_word.expect("a loop") as f64 * 2f64.powi(-48) * 224_000.0;
        let wanted = real.tuning_word.expect("a loop");
        assert!((word - wanted).abs() < 1e-1, "{word} {wanted}");
        words.push(word);
        let gain = row.gain.expect("a loop") as f64 * 2f64.powi(-15);
        let wanted = real.gain.expect("a loop");
        assert!((gain - wanted).abs() < 1e-3, "{gain} {wanted}");
    }
    let moved = words.iter().map(|word| (word - 1750.0).abs());
    assert!(moved.fold(0.0, f64::max) > 10.0, "the loop is at work");
}

/// The generator meets every aim, the designs it calls accepted run, and every
/// node is among those that stop, every cast among those that are too wide.
#[test]
fn generated_designs_run() {
    let mut nodes = BTreeSet::new();
    let mut keys = BTreeSet::new();
    for seed in 0..1200 {
        let mut rng = Rng::new(seed);
        let aims = [Aim::Accepted, Aim::Edge, Aim::Refused, Aim::Accepted];
        let aim = aims[seed as usize % 4];
        let design = generate::design(&mut rng, aim);
        if let Verdict::Refused(reasons) = design.verdict() {
            assert_eq!(aim, Aim::Refused, "seed {seed}");
            keys.extend(reasons.iter().map(|reason| reason.key));
            continue;
        }
        assert_ne!(aim, Aim::Refused, "seed {seed}");
        let mut capture = capture::random(&mut rng, &design);
        capture.truncate(600);
        if let Err(stop) = fixed::replay(&design, &capture) {
            nodes.insert((stop.node, stop.operands.len()));
        }
    }
    let casts = [
        "circuit.demodulator.product",
        "circuit.decimator.output",
        "compensation.accumulator",
        "compensation.output",
    ];
    for key in casts {
        assert!(keys.contains(key), "{key} is never too wide");
    }
    for (key, operands) in [
        (casts[0], 2),
        (casts[1], 1),
        (casts[2], 2),
        (casts[3], 1),
        (casts[3], 2),
    ] {
        let stops = |(node, count): &(String, usize)| node.starts_with(key) && *count == operands;
        assert!(nodes.iter().any(stops), "{key} never stops");
    }
    for channel in fixed::CHANNELS {
        let stops = nodes.iter().any(|(node, _)| node.ends_with(channel));
        assert!(stops, "{channel} never stops");
    }
}
