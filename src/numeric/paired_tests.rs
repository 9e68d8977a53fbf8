//! The raw part is `Fixed`'s and the real part `Float`'s, bit for bit; every error is within its bound.

use super::super::arithmetic::{Arithmetic, Ring};
use super::super::cast::{Cast, Label};
use super::super::fixed::Fixed;
use super::super::float::Float;
use super::super::format::{Format, Overflow, Quantizer, Rounding};
use super::super::lane::Lane;
use super::{Pair, Paired, Watch};
use crate::circuit::engine::{self, ArithmeticKind, Rows};
use crate::design::{Design, template::default_design};
use crate::nodes::run::run_with_rows;
use proptest::prelude::*;

/// Looks on; makes the bounds of casts smaller by a factor, 1 for an honest one.
struct Shrunk(f64);

impl Watch for Shrunk {
    fn cast<W: Lane>(&self, _: &Cast, _: &Pair<W>, _: W, _: &[Pair<W>], o: Pair<W>) -> Pair<W> {
        let bound = o.bound * self.0;
        Pair { bound, ..o }
    }
    fn sine<W: Lane>(&self, _: &Pair<W>) {}
    fn table_error(&self, _: usize) -> f64 {
        0.0
    }
    fn phase_cap_turns(&self) -> f64 {
        0.0
    }
    fn tuning_cap_turns(&self) -> f64 {
        0.0
    }
    fn polar<W: Lane>(&self, i: &Pair<W>, q: &Pair<W>) -> [Pair<W>; 2] {
        [*i, *q]
    }
}

/// One operation of the small program that a test makes up.
#[derive(Debug, Clone)]
enum Step {
    Add,
    Sub,
    Mul,
    Neg,
    Read(i32),
    Limit,
    Cast(Rounding, Overflow, u32, u32),
}

fn step() -> impl Strategy<Value = Step> {
    let rounding = prop::sample::select(Rounding::ALL.to_vec());
    let overflow = prop::sample::select(vec![
        Overflow::Saturate,
        Overflow::SaturateSymmetric,
        Overflow::Wrap,
        Overflow::Error,
    ]);
    prop_oneof![
        Just(Step::Add),
        Just(Step::Sub),
        Just(Step::Mul),
        Just(Step::Neg),
        Just(Step::Limit),
        (-3i32..4).prop_map(Step::Read),
        (rounding, overflow, 1u32..12, 0u32..12).prop_map(|(r, o, m, n)| Step::Cast(r, o, m, n)),
    ]
}

/// The program in any arithmetic: every intermediate word. `bits` follows the fraction bits, the same in all.
fn program<A: Arithmetic>(ar: &A, steps: &[Step], start: [i128; 2]) -> Vec<A::Word> {
    let (mut bits, mut b_bits) = (10, 10);
    let (mut a, mut b) = (ar.constant(start[0], bits), ar.constant(start[1], b_bits));
    let mut all = vec![a, b];
    for (id, step) in steps.iter().enumerate() {
        let to = |bits: i32, format: Format, rounding, overflow| {
            let quantizer = Quantizer {
                format,
                rounding,
                overflow,
            };
            let mut cast = Cast::to(Label::of("test"), bits, 0, quantizer);
            cast.id = id;
            cast
        };
        match step {
            Step::Add | Step::Sub | Step::Limit => {
                // Both on 10 fraction bits first.
                let common = Format::q(20, 10);
                let cast = to(bits, common, Rounding::HalfUp, Overflow::Saturate);
                a = ar.cast(a, &cast, &[]);
                let cast = to(b_bits, common, Rounding::Floor, Overflow::Saturate);
                b = ar.cast(b, &cast, &[]);
                (bits, b_bits) = (10, 10);
                a = match step {
                    Step::Add => ar.add(a, b),
                    Step::Sub => ar.sub(a, b),
                    _ => ar.limit(a, -900, 1500, bits),
                };
            }
            Step::Mul => {
                let narrow = to(
                    bits,
                    Format::q(12, 8),
                    Rounding::HalfEven,
                    Overflow::Saturate,
                );
                a = ar.cast(a, &narrow, &[]);
                let narrow = to(b_bits, Format::q(12, 8), Rounding::Ceil, Overflow::Saturate);
                b = ar.cast(b, &narrow, &[]);
                a = ar.mul(a, b);
                (bits, b_bits) = (16, 8);
            }
            Step::Neg => a = ar.neg(a),
            Step::Read(exponent) => {
                a = ar.read_as(a, *exponent);
                bits -= exponent;
            }
            Step::Cast(rounding, overflow, m, n) => {
                let cast = to(bits, Format::q(*m, *n), *rounding, *overflow);
                a = ar.cast(a, &cast, &[]);
                bits = *n as i32;
            }
        }
        all.push(a);
    }
    all
}

proptest! {
    /// Programs of up to 12 operations, with every rounding and overflow.
    #[test]
    fn every_operation_has_both_arithmetics_bits_and_keeps_its_bound(
        steps in prop::collection::vec(step(), 1..12),
        start in (-3000i128..3000, -3000i128..3000),
    ) {
        let start = [start.0, start.1];
        let pairs = program(&Paired::<i128, i128, Shrunk>::new(&Shrunk(1.0)), &steps, start);
        let raw = program(&Fixed::<i128, i128>::new(), &steps, start);
        let real = program(&Float, &steps, start);
        for (k, pair) in pairs.iter().enumerate() {
            // `Fixed` goes on after an `error`: it saturates and remembers.
            prop_assert_eq!(pair.raw, raw[k], "raw word {}", k);
            prop_assert_eq!(pair.real.to_bits(), real[k].to_bits(), "real word {}", k);
            prop_assert!(pair.error().abs() <= pair.total_bound(), "bound of word {}: {:?}", k, pair);
        }
    }

    /// A CIC's ring: sums that wrap in the integrators, taken out again by the combs.
    #[test]
    fn a_ring_has_both_arithmetics_bits(words in prop::collection::vec(-512i128..512, 8..60)) {
        let ring = Ring { bits: 22, fraction_bits: 9, reach: 12 };
        let paired = Paired::<i64, i64, Shrunk>::new(&Shrunk(1.0));
        let (fixed, float) = (Fixed::<i64, i64>::new(), Float);
        let mut a = [paired.residue_constant(0, &ring); 2];
        let mut b = [fixed.residue_constant(0, &ring); 2];
        let mut c = [float.residue_constant(0, &ring); 2];
        for word in words {
            let input = paired.residue(paired.constant(word, 9), &ring);
            a = [paired.residue_add(a[0], input, &ring), a[0]];
            b = [fixed.residue_add(b[0], fixed.residue(fixed.constant(word, 9), &ring), &ring), b[0]];
            c = [float.residue_add(c[0], float.residue(float.constant(word, 9), &ring), &ring), c[0]];
            let pair = paired.centered(paired.residue_sub(a[0], a[1], &ring), &ring);
            let raw = fixed.centered(fixed.residue_sub(b[0], b[1], &ring), &ring);
            let real = float.centered(float.residue_sub(c[0], c[1], &ring), &ring);
            prop_assert_eq!(pair.raw, raw);
            prop_assert_eq!(pair.real.to_bits(), real.to_bits());
            prop_assert!(pair.error().abs() <= pair.total_bound());
        }
    }
}

#[test]
fn a_bound_that_is_a_tenth_too_small_is_seen() {
    let steps = [Step::Cast(Rounding::HalfUp, Overflow::Saturate, 8, 4)];
    let outside = |factor| {
        let watch = Shrunk(factor);
        let words = (0..64).flat_map(|k| {
            let arithmetic = Paired::<i128, i128, Shrunk>::new(&watch);
            program(&arithmetic, &steps, [k, 0])
        });
        words.filter(|w| w.error().abs() > w.total_bound()).count()
    };
    assert_eq!(outside(1.0), 0);
    assert!(outside(0.9) > 0);
}

fn design(decimator: (u32, u32, u32), address_bits: u32, word: i64) -> Design {
    let mut design = default_design().expect("the default");
    let circuit = &mut design.circuit;
    (
        circuit.decimator.stages,
        circuit.decimator.ratio,
        circuit.decimator.differential_delay,
    ) = decimator;
    circuit.nco.table_address_bits = address_bits;
    circuit.nco.tuning_word = word;
    design
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Whole chains against both engines. (`tests/all/equivalence.rs` does it with designs that vary in everything.)
    #[test]
    fn a_chain_has_both_engines_rows(
        decimator in (1u32..=6, 2u32..40, 1u32..=2),
        address_bits in 2u32..=16,
        word in any::<u32>(),
        codes in prop::collection::vec((-32768i32..=32767, -32768i32..=32767), 200..900),
    ) {
        let design = design(decimator, address_bits, i64::from(word));
        let (drive, sense): (Vec<i32>, Vec<i32>) = codes.into_iter().unzip();
        let (mut raw, mut real) = (Vec::new(), Vec::new());
        let seen = run_with_rows(&design, &drive, &sense, &mut |words, values| {
            raw.extend_from_slice(words);
            real.extend_from_slice(values);
        });
        let rows = |kind| {
            let mut engine = engine::engine(&design, kind);
            let mut rows = engine.no_rows();
            engine.process(&drive, &sense, &mut rows).expect("saturates");
            rows
        };
        prop_assert_eq!(Some(raw), rows(ArithmeticKind::Fixed).raw());
        // The gain's column is in units, the others as they are.
        let columns = engine::columns(&design);
        let Rows::Real(expected) = rows(ArithmeticKind::Float) else { panic!("reals") };
        for (k, (a, b)) in real.iter().zip(&expected).enumerate() {
            if columns[k % columns.len()] != "gain" {
                prop_assert_eq!(a.to_bits(), b.to_bits(), "{}", columns[k % columns.len()]);
            }
        }
        for node in &seen.nodes {
            prop_assert_eq!(node.outside, 0, "{}", node.identity.name);
        }
    }
}
