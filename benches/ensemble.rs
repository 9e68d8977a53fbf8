//! `cargo bench --bench ensemble -- SAMPLES ROUNDS`: 16 designs that differ after the decimator's sums over one
//! capture, together and one by one, in the same run, on one thread.
//!
//! Both take turns, and the fastest run of each counts. The rows have to be the same. Nothing is asserted of times.

use gyrogen::circuit::engine::{ArithmeticKind, Rows, engine};
use gyrogen::circuit::ensemble::Ensemble;
use gyrogen::design::{Design, reader};
use std::time::Instant;

mod common;
use common::{Contestant, RUNS};

/// Designs.
const COUNT: usize = 16;

/// Samples that are processed at a time.
const BLOCK: usize = 1 << 14;

#[derive(Clone, Copy, PartialEq)]
enum Run {
    One,
    Together,
    OneByOne,
}

fn main() {
    let [samples, rounds] = common::numbers([1 << 22, 10]);
    let samples = samples / 64 * 64;
    let text = include_str!("opponents/chain.toml");
    let design = reader::parse(text, None).expect("the benchmark's design");
    for (title, word) in [
        ("coherent tuning word", common::COHERENT_WORD),
        ("tuning word that is not coherent", common::INCOHERENT_WORD),
    ] {
        let mut design = design.clone();
        design.circuit.nco.tuning_word = word;
        let designs: Vec<Design> = (0..COUNT).map(|k| varied(&design, k)).collect();
        let (drive, sense) = common::capture(samples);
        let codes = [&drive[..], &sense[..]];
        let contestant = |name: &str, run| Contestant::new(name.to_owned(), false, run);
        let mut contestants = [
            contestant("one design", Run::One),
            contestant("16 together", Run::Together),
            contestant("16 one by one", Run::OneByOne),
        ];
        common::take_turns(&mut contestants, rounds, |run| match run {
            Run::One => one_by_one(&designs[..1], codes),
            Run::Together => together(&designs, codes),
            Run::OneByOne => one_by_one(&designs, codes),
        });
        println!("{title}, {samples} samples, one thread");
        let one = contestants[0].seconds;
        for c in &contestants {
            println!(
                "  {:<16} {:>8.1} ms   {:>5.2} times one design   {:016x}",
                c.name,
                1e3 * c.seconds,
                c.seconds / one,
                c.checksum
            );
        }
        let alike = contestants[1].checksum == contestants[2].checksum;
        println!("  rows: {}", if alike { "alike" } else { "NOT ALIKE" });
    }
}

/// The k-th design: other words of CORDIC and compensation.
fn varied(design: &Design, k: usize) -> Design {
    let mut design = design.clone();
    design.circuit.cordic.iterations = 13 + (k as u32) % 4;
    design.circuit.cordic.guard_bits = 3 + (k as u32) / 4;
    if let Some(compensation) = &mut design.compensation {
        compensation.output.format.fraction_bits = 5 + (k as u32) % 4;
    }
    design
}

fn one_by_one(designs: &[Design], codes: [&[i32]; 2]) -> (f64, u64) {
    fastest(|| {
        let of = |design: &Design| {
            let mut engine = engine(design, ArithmeticKind::Fixed);
            let mut rows = [engine.no_rows()];
            let process = |d: &[i32], s: &[i32], rows: &mut [Rows]| {
                for rows in rows {
                    engine.process(d, s, rows).expect("no cast stops");
                }
            };
            by_blocks(codes, &mut rows, process)
        };
        let (seconds, sums): (Vec<f64>, Vec<Vec<u64>>) = designs.iter().map(of).unzip();
        (seconds.iter().sum(), sums.concat())
    })
}

fn together(designs: &[Design], codes: [&[i32]; 2]) -> (f64, u64) {
    fastest(|| {
        let mut ensemble = Ensemble::new(designs, ArithmeticKind::Fixed);
        let mut rows = ensemble.no_rows();
        let process = |d: &[i32], s: &[i32], rows: &mut [Rows]| {
            for result in ensemble.process(d, s, rows) {
                result.expect("no cast stops");
            }
        };
        by_blocks(codes, &mut rows, process)
    })
}

/// The seconds of processing alone, and a checksum of each design's rows: these are looked at and dropped block by
/// block, as one who writes them out does.
fn by_blocks(
    [drive, sense]: [&[i32]; 2],
    rows: &mut [Rows],
    mut process: impl FnMut(&[i32], &[i32], &mut [Rows]),
) -> (f64, Vec<u64>) {
    let mut sums = vec![common::NO_WORDS; rows.len()];
    let mut seconds = 0.0;
    for (d, s) in drive.chunks(BLOCK).zip(sense.chunks(BLOCK)) {
        let start = Instant::now();
        process(d, s, rows);
        seconds += start.elapsed().as_secs_f64();
        for (rows, sum) in rows.iter_mut().zip(&mut sums) {
            if let Rows::Integer(words) = rows {
                let add = |sum, word: &i64| common::with_word(sum, *word as u32);
                *sum = words.iter().fold(*sum, add);
                words.clear();
            }
        }
    }
    (seconds, sums)
}

/// The seconds of the fastest of some runs, and a checksum of all designs' rows.
fn fastest(run: impl Fn() -> (f64, Vec<u64>)) -> (f64, u64) {
    let mut seconds = f64::INFINITY;
    let mut checksum = common::NO_WORDS;
    for _ in 0..RUNS {
        let (took, sums) = run();
        seconds = seconds.min(took);
        let add = |all, sum: &u64| common::with_word(all, (*sum >> 32) as u32 ^ *sum as u32);
        checksum = sums.iter().fold(common::NO_WORDS, add);
    }
    (seconds, checksum)
}
