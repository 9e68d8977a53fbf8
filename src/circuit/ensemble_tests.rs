//! Every design of an ensemble against the same design alone, over random designs.

use super::Ensemble;
use crate::circuit::block_kernel::Instructions;
use crate::circuit::block_kernel::tests::{Draw, codes, design};
use crate::circuit::engine::{self, ArithmeticKind};
use crate::design::{Design, limits};
use crate::numeric::format::{Overflow, Rounding};

/// The design with other words at one place after the codes, or at none.
fn varied(draw: &mut Draw, design: &Design) -> Design {
    let mut other = design.clone();
    let place = draw.within(0, 14);
    let circuit = &mut other.circuit;
    let (output, cordic) = (&mut circuit.decimator.output, &mut circuit.cordic);
    match place {
        0 => circuit.nco.tuning_word ^= 1,
        1 => output.format.fraction_bits = draw.within(4, 22),
        2 => output.rounding = Rounding::Floor,
        3 => output.overflow = Overflow::Error,
        4 => output.overflow = Overflow::Wrap,
        5 => cordic.iterations = draw.within(6, 24),
        6 => cordic.guard_bits = draw.within(0, 8),
        7 => cordic.width -= draw.within(0, 6),
        8 => cordic.angle_bits -= draw.within(1, 3),
        9 => cordic.gain_bits -= draw.within(1, 6),
        10 => other.compensation = None,
        11 | 12 => {
            if let Some(compensation) = &mut other.compensation {
                compensation.output.format.fraction_bits = draw.within(3, 9);
            }
        }
        _ => (),
    }
    other
}

#[test]
fn an_ensemble_is_its_designs_alone() {
    let (mut compared, mut shared, mut stopped) = (0, 0, 0);
    // Members that take their combs and their CORDIC from another.
    let mut by_stages = [0, 0];
    for case in 0..300u64 {
        let mut draw = Draw(case << 32 | 77);
        let first = design(&mut draw);
        let designs = (0..6).map(|k| {
            // Every other one differs in two places, perhaps.
            let one = varied(&mut draw, &first);
            if k % 2 == 0 {
                one
            } else {
                varied(&mut draw, &one)
            }
        });
        let designs: Vec<Design> = std::iter::once(first.clone())
            .chain(designs)
            .filter(|d| limits::check(d).is_ok())
            .collect();
        let count = first.circuit.decimator.ratio as usize * 11 + 3;
        let format = first.circuit.adc.format;
        let [drive, sense] = [0, 1].map(|_| codes(&mut draw, format, count));
        let piece = draw.within(1, count as u32) as usize;
        for kind in [ArithmeticKind::Fixed, ArithmeticKind::Float] {
            let mut ensemble = Ensemble::new(&designs, kind);
            shared += usize::from(ensemble.groups.len() < designs.len());
            for group in &ensemble.groups {
                let [combs, cordics] = group.members.shared();
                by_stages = [by_stages[0] + combs, by_stages[1] + cordics];
            }
            let mut rows = ensemble.no_rows();
            let mut results: Vec<Result<(), _>> = designs.iter().map(|_| Ok(())).collect();
            for (d, s) in drive.chunks(piece).zip(sense.chunks(piece)) {
                for (result, now) in results.iter_mut().zip(ensemble.process(d, s, &mut rows)) {
                    // The first counts.
                    if result.is_ok() {
                        *result = now;
                    }
                }
            }
            for ((design, rows), result) in designs.iter().zip(&rows).zip(results) {
                let mut alone = engine::engine(design, kind);
                let mut own = alone.no_rows();
                let own_result = alone.process(&drive, &sense, &mut own);
                assert_eq!(result, own_result, "case {case}");
                if own_result.is_ok() {
                    assert!(*rows == own, "case {case}");
                }
                compared += 1;
                stopped += usize::from(own_result.is_err());
            }
        }
    }
    assert!(
        compared > 4000 && shared > 200 && stopped > 4,
        "{compared} {shared} {stopped}"
    );
    // Without SIMD each makes its rows one by one.
    let [combs, cordics] = by_stages;
    let staged = Instructions::Avx2.are_there();
    assert!(!staged || combs > cordics && cordics > 100, "{by_stages:?}");
}
