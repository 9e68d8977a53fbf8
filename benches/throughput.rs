//! `cargo bench --bench throughput`: ADC samples per second of the circuit, from codes in memory to rows in
//! memory, against hand-written C by the compilers that are here, in the same run.
//!
//! Every contestant runs in turn, round after round, and its fastest run counts, so that another load of
//! the machine hits all of them. All have to give the same checksum. Nothing is asserted of times.
//! Arguments: samples (a multiple of 64) and rounds.

use gyrogen::circuit::block_kernel::Instructions;
use gyrogen::circuit::engine::{ArithmeticKind, Rows, engine_with};
use gyrogen::design::{Design, reader};
use gyrogen::numeric::format::Format;
use std::path::{Path, PathBuf};
use std::time::Instant;

mod common;
use common::{Contestant, RUNS};

enum Run {
    Here(Instructions),
    Program(PathBuf, &'static str),
}

fn main() {
    let [samples, rounds] = common::numbers([1 << 25, 5]);
    let samples = samples / 64 * 64;
    let text = include_str!("opponents/chain.toml");
    let design = reader::parse(text, None).expect("the benchmark's design");
    let (drive, sense) = common::capture(samples);
    // As the opponents have them.
    let [drive, sense] =
        [drive, sense].map(|codes| codes.iter().map(|c| *c as i16).collect::<Vec<i16>>());
    let folder = tempfile::tempdir().expect("a folder for the programs");
    let cases = [
        ("coherent tuning word", common::COHERENT_WORD, 0),
        (
            "tuning word that is not coherent",
            common::INCOHERENT_WORD,
            0,
        ),
        (
            "not coherent, product rounded by 8 bits",
            common::INCOHERENT_WORD,
            8,
        ),
    ];
    for (title, word, dropped) in cases {
        let mut design = design.clone();
        design.circuit.nco.tuning_word = word;
        design.circuit.demodulator.product.format = Format::q(2, 30 - dropped);
        let mut contestants = contestants(folder.path(), dropped);
        common::take_turns(&mut contestants, rounds, |run| match run {
            Run::Here(instructions) => here(&design, *instructions, &drive, &sense),
            Run::Program(path, way) => {
                let arguments = [
                    *way,
                    &word.to_string(),
                    &samples.to_string(),
                    &RUNS.to_string(),
                ];
                common::program(path, &arguments.map(String::from))
            }
        });
        common::report(title, samples, &contestants);
    }
}

/// This program with every instruction set, and C by every compiler that is found.
fn contestants(folder: &Path, dropped: u32) -> Vec<Contestant<Run>> {
    let there = Instructions::ALL.into_iter().filter(|i| i.are_there());
    let mut all: Vec<Contestant<Run>> = there
        .map(|i| Contestant::new(format!("gyrogen {i:?}"), false, Run::Here(i)))
        .collect();
    let define = format!("-DPROD_SHIFT={dropped}");
    let flags: &[&str] = if dropped > 0 { &[&define] } else { &[] };
    for built in common::built(folder, "chain.c", flags) {
        for way in ["serial", "block"] {
            let name = format!("C {way}, {}", built.name);
            let run = Run::Program(built.program.clone(), way);
            all.push(Contestant::new(name, true, run));
        }
    }
    all
}

fn here(design: &Design, with: Instructions, drive: &[i16], sense: &[i16]) -> (f64, u64) {
    // Memory that has been written to, as the opponents have it.
    let mut rows = Rows::Integer(vec![1; drive.len() / 64 * 8]);
    let mut seconds = f64::INFINITY;
    for _ in 0..RUNS {
        let mut engine = engine_with(design, ArithmeticKind::Fixed, with);
        rows.clear();
        let start = Instant::now();
        let done = engine.process_16_bits(drive, sense, &mut rows);
        done.expect("no cast stops");
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    let mut checksum = common::NO_WORDS;
    if let Rows::Integer(words) = &rows {
        for row in words.chunks_exact(7) {
            for word in [row[6], row[4], row[5]] {
                checksum = common::with_word(checksum, word as u32);
            }
        }
    }
    (seconds, checksum)
}
