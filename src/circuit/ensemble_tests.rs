//! Every design of an ensemble against the same design alone, over random designs.

use super::Ensemble;
use crate::circuit::block_kernel::tests::{Draw, codes, design};
use crate::circuit::engine::{self, ArithmeticKind};
use crate::design::{Design, limits};
use crate::numeric::format::Overflow;

/// The design with other words after the decimator's sums.
fn varied(draw: &mut Draw, design: &Design) -> Design {
    let mut other = design.clone();
    let circuit = &mut other.circuit;
    circuit.decimator.output.format.fraction_bits = draw.within(4, 22);
    if draw.within(0, 3) == 0 {
        circuit.decimator.output.overflow = Overflow::Error;
    }
    circuit.cordic.iterations = draw.within(6, 24);
    circuit.cordic.guard_bits = draw.within(0, 8);
    if draw.within(0, 3) == 0 {
        other.compensation = None;
    }
    if draw.within(0, 3) == 0 {
        // Another front.
        other.circuit.nco.tuning_word ^= 1;
    }
    other
}

#[test]
fn an_ensemble_is_its_designs_alone() {
    let (mut compared, mut shared, mut stopped) = (0, 0, 0);
    for case in 0..300u64 {
        let mut draw = Draw(case << 32 | 77);
        let first = design(&mut draw);
        let designs = (0..6).map(|_| varied(&mut draw, &first));
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
}
