//! The kernel against the blocks as they are written, over random designs and pieces.

use crate::circuit::block_kernel::{BlockKernel, Instructions};
use crate::circuit::chain::Chain;
use crate::circuit::engine::{ArithmeticKind, engine, engine_with, lane_bits};
use crate::design::template::default_design;
use crate::design::{Design, LoopGain, PhaseLoop, limits};
use crate::numeric::format::{Format, Overflow, Quantizer, Rounding};
use crate::numeric::splitmix::{GOLDEN, mix};

pub(crate) struct Draw(pub u64);

impl Draw {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        mix(self.0)
    }
    pub fn within(&mut self, low: u32, high: u32) -> u32 {
        low + (self.next() % u64::from(high - low + 1)) as u32
    }
    fn one_in(&mut self, n: u64) -> bool {
        self.next().is_multiple_of(n)
    }
    fn of<T: Copy>(&mut self, these: &[T]) -> T {
        these[(self.next() % these.len() as u64) as usize]
    }
}

const ROUNDINGS: [Rounding; 6] = [
    Rounding::Floor,
    Rounding::HalfUp,
    Rounding::HalfEven,
    Rounding::HalfAway,
    Rounding::TowardZero,
    Rounding::Ceil,
];

/// A design whose sample rate is drawn; the rest is the default's.
pub(crate) fn design(draw: &mut Draw) -> Design {
    let mut design = default_design().expect("the default");
    if draw.one_in(2) {
        design.compensation = None;
    }
    let circuit = &mut design.circuit;
    circuit.amplitude_loop = None;
    circuit.adc.format = Format::q(1, draw.within(1, 23));
    let table = Format::q(1, draw.within(1, 31));
    circuit.nco.table = table;
    circuit.nco.phase_bits = draw.within(8, 64);
    circuit.nco.table_address_bits = draw.within(2, circuit.nco.phase_bits.min(12));
    circuit.nco.address_rounding = draw.of(&[Rounding::Floor, Rounding::HalfUp]);
    let circle = circuit.nco.phase_bits.min(63);
    circuit.nco.tuning_word = (draw.next() & ((1 << circle) - 1)) as i64;
    if draw.one_in(3) {
        // Few different periods: a coherent word.
        circuit.nco.tuning_word &= !((1 << (circle - 5)) - 1);
    }
    let exact = circuit.adc.format.fraction_bits + table.fraction_bits;
    let fraction_bits = if draw.one_in(3) {
        exact
    } else {
        draw.within(0, exact + 3)
    };
    let signed = !draw.one_in(5);
    circuit.demodulator.product = Quantizer {
        format: Format {
            signed,
            integer_bits: draw.within(1, 3),
            fraction_bits: fraction_bits.min(60),
        },
        rounding: draw.of(&ROUNDINGS),
        overflow: draw.of(&[
            Overflow::Wrap,
            Overflow::Saturate,
            Overflow::SaturateSymmetric,
        ]),
    };
    circuit.decimator.stages = draw.within(1, 6);
    circuit.decimator.ratio = draw.within(2, 200);
    circuit.decimator.differential_delay = draw.within(1, 2);
    let gain = |raw, shift| LoopGain { raw, shift };
    circuit.phase_loop = draw.one_in(2).then(|| PhaseLoop {
        setpoint_raw: -4_194_304,
        proportional: gain(9, 6),
        integral: gain(9, 11),
        integrator_bits: 48,
    });
    if draw.one_in(3) {
        // Words of the CORDIC that wrap, some of them.
        circuit.cordic.width = draw.within(20, 36);
        circuit.cordic.guard_bits = draw.within(0, 9);
    }
    design
}

/// Codes of the design's ADC, its extremes among them.
pub(crate) fn codes(draw: &mut Draw, format: Format, count: usize) -> Vec<i32> {
    let (low, high) = (format.min_raw() as i64, format.max_raw() as i64);
    let span = (high - low + 1) as u64;
    let mut one = || match draw.next() % 8 {
        0 => low,
        1 => high,
        _ => low + (draw.next() % span) as i64,
    };
    (0..count).map(|_| one() as i32).collect()
}

fn has_kernel(design: &Design) -> bool {
    let chain = Chain::<3>::new(design);
    let bits = lane_bits(&chain, &chain.trace());
    bits.fast <= 64
        && bits.residue <= 64
        && BlockKernel::new(&chain, Instructions::Portable).is_some()
}

/// Compares `cases` designs; gives how many have three stages, and how many of those a kernel.
pub fn compare(cases: u64) -> (usize, usize) {
    let (mut three, mut with_kernel) = (0, 0);
    for case in 0..cases {
        let mut draw = Draw(case << 32);
        let design = design(&mut draw);
        if limits::check(&design).is_err() {
            continue;
        }
        if design.circuit.decimator.stages == 3 {
            three += 1;
            with_kernel += usize::from(has_kernel(&design));
        }
        let ratio = design.circuit.decimator.ratio as usize;
        let format = design.circuit.adc.format;
        let count = ratio * 9 + 5;
        let (drive, sense) = (
            codes(&mut draw, format, count),
            codes(&mut draw, format, count),
        );
        let rows = |instructions, piece: usize| {
            let mut engine = engine_with(&design, ArithmeticKind::Fixed, instructions);
            let mut rows = engine.no_rows();
            for (d, s) in drive.chunks(piece).zip(sense.chunks(piece)) {
                engine.process(d, s, &mut rows).expect("no cast stops");
            }
            rows
        };
        let plain = rows(Instructions::Plain, count);
        for instructions in Instructions::ALL.into_iter().filter(|i| i.are_there()) {
            let pieces = draw.within(1, 3 * ratio as u32) as usize;
            for piece in [count, pieces] {
                let these = rows(instructions, piece);
                assert!(
                    these == plain,
                    "case {case}, {instructions:?}, pieces of {piece}"
                );
            }
        }
    }
    (three, with_kernel)
}

#[test]
fn every_instruction_set_gives_the_bits_of_the_blocks() {
    let (three, with_kernel) = compare(600);
    assert!(
        three > 40 && with_kernel * 3 > three,
        "{with_kernel} of {three}"
    );
}

#[test]
fn codes_of_16_bits_give_the_rows_of_the_same_codes_widened() {
    let mut design = default_design().expect("the embedded design");
    let mut draw = Draw(0);
    // Periods shorter and longer than what is widened at a time.
    for (ratio, count) in [
        (32, 0),
        (32, 1),
        (32, 999),
        (100, 999),
        (128, 999),
        (300, 2000),
    ] {
        design.circuit.decimator.ratio = ratio;
        let [drive, sense] = [(); 2].map(|()| codes(&mut draw, design.circuit.adc.format, count));
        let narrow = |codes: &[i32]| codes.iter().map(|c| *c as i16).collect::<Vec<i16>>();
        let mut both = [(); 2].map(|()| engine(&design, ArithmeticKind::Fixed));
        let mut rows = both.each_ref().map(|engine| engine.no_rows());
        let [wide, of_16_bits] = &mut both;
        let [due, found] = &mut rows;
        // The second round starts where the first left the state.
        for _ in 0..2 {
            wide.process(&drive, &sense, due).expect("saturates");
            of_16_bits
                .process_16_bits(&narrow(&drive), &narrow(&sense), found)
                .expect("saturates");
        }
        assert_eq!(found, due, "{count} codes");
        assert_eq!(due.raw().map(|r| r.is_empty()), Some(count < 32));
    }
}
