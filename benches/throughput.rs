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
use std::process::Command;
use std::time::Instant;

/// Samples that are processed at a time, as `gyrogen replay` does.
const BLOCK: usize = 1 << 16;

/// Runs of a contestant before the next one's turn.
const RUNS: usize = 3;

const FLAGS: [(&str, &[&str]); 2] = [("native", &["-march=native"]), ("portable", &[])];

struct Contestant {
    name: String,
    seconds: f64,
    checksum: u64,
    run: Run,
}

enum Run {
    Here(Instructions),
    Program(PathBuf, &'static str),
}

fn main() {
    let numbers: Vec<usize> = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse().ok())
        .collect();
    let samples = numbers.first().copied().unwrap_or(1 << 25) / 64 * 64;
    let rounds = numbers.get(1).copied().unwrap_or(5);
    let text = include_str!("opponents/chain.toml");
    let design = reader::parse(text, None).expect("the benchmark's design");
    let (drive, sense) = capture(samples);
    let folder = tempfile::tempdir().expect("a folder for the programs");
    let cases = [
        ("coherent tuning word", 33_554_432, 0),
        ("tuning word that is not coherent", 33_555_666, 0),
        ("not coherent, product rounded by 8 bits", 33_555_666, 8),
    ];
    for (title, word, dropped) in cases {
        let mut design = design.clone();
        design.circuit.nco.tuning_word = word;
        design.circuit.demodulator.product.format = Format::q(2, 30 - dropped);
        let mut contestants = contestants(folder.path(), dropped);
        for _ in 0..rounds {
            for contestant in &mut contestants {
                let (seconds, checksum) = match &contestant.run {
                    Run::Here(instructions) => here(&design, *instructions, &drive, &sense),
                    Run::Program(path, way) => program(path, way, word, samples),
                };
                contestant.seconds = contestant.seconds.min(seconds);
                contestant.checksum = checksum;
            }
        }
        report(title, samples, &contestants);
    }
}

/// This program with every instruction set, and C by every compiler that is found.
fn contestants(folder: &Path, dropped: u32) -> Vec<Contestant> {
    let contestant = |name, run| Contestant {
        name,
        seconds: f64::INFINITY,
        checksum: 0,
        run,
    };
    let there = Instructions::ALL.into_iter().filter(|i| i.are_there());
    let mut all: Vec<Contestant> = there
        .map(|i| contestant(format!("gyrogen {i:?}"), Run::Here(i)))
        .collect();
    for compiler in ["gcc", "clang", "clang-19"] {
        for (flags, given) in FLAGS {
            let to = folder.join(format!("{compiler}_{flags}_{dropped}"));
            let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/opponents/chain.c");
            let mut command = Command::new(compiler);
            command
                .arg("-O3")
                .args(given)
                .arg(source)
                .arg("-o")
                .arg(&to)
                .arg("-lm");
            if dropped > 0 {
                command.arg(format!("-DPROD_SHIFT={dropped}"));
            }
            if !command.status().is_ok_and(|status| status.success()) {
                continue;
            }
            for way in ["serial", "block"] {
                let name = format!("C {way}, {compiler} {flags}");
                all.push(contestant(name, Run::Program(to.clone(), way)));
            }
        }
    }
    all
}

fn here(design: &Design, with: Instructions, drive: &[i32], sense: &[i32]) -> (f64, u64) {
    // Memory that has been written to, as the opponents have it.
    let mut rows = Rows::Integer(vec![1; drive.len() / 64 * 8]);
    let mut seconds = f64::INFINITY;
    for _ in 0..RUNS {
        let mut engine = engine_with(design, ArithmeticKind::Fixed, with);
        if let Rows::Integer(words) = &mut rows {
            words.clear();
        }
        let start = Instant::now();
        for (d, s) in drive.chunks(BLOCK).zip(sense.chunks(BLOCK)) {
            engine.process(d, s, &mut rows).expect("no cast stops");
        }
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    let mut checksum = 0xcbf2_9ce4_8422_2325_u64;
    if let Rows::Integer(words) = &rows {
        for row in words.chunks_exact(7) {
            for word in [row[6], row[4], row[5]] {
                checksum = (checksum ^ u64::from(word as u32)).wrapping_mul(0x100_0000_01b3);
            }
        }
    }
    (seconds, checksum)
}

fn program(path: &Path, way: &str, word: i64, samples: usize) -> (f64, u64) {
    let arguments = [
        way.to_owned(),
        word.to_string(),
        samples.to_string(),
        RUNS.to_string(),
    ];
    let output = Command::new(path)
        .args(arguments)
        .output()
        .expect("the program runs");
    let text = String::from_utf8_lossy(&output.stdout);
    let (seconds, checksum) = text.trim().split_once(' ').expect("seconds and checksum");
    let checksum = u64::from_str_radix(checksum, 16).expect("a checksum");
    (seconds.parse().expect("seconds"), checksum)
}

fn report(title: &str, samples: usize, contestants: &[Contestant]) {
    let is_c = |c: &&Contestant| matches!(c.run, Run::Program(..));
    let fastest = |one: Option<&Contestant>| one.map_or(f64::NAN, |c| c.seconds);
    let best = fastest(
        contestants
            .iter()
            .filter(is_c)
            .min_by(|a, b| a.seconds.total_cmp(&b.seconds)),
    );
    println!("{title}, {samples} samples, one thread");
    for c in contestants {
        println!(
            "  {:<28} {:>8.1} M samples/s   {:>5.2} of the best C   {:016x}",
            c.name,
            samples as f64 / c.seconds / 1e6,
            best / c.seconds,
            c.checksum,
        );
    }
    let alike = contestants
        .windows(2)
        .all(|pair| pair[0].checksum == pair[1].checksum);
    println!(
        "  checksums: {}",
        if alike { "all alike" } else { "NOT ALIKE" }
    );
}

/// The capture of the manual's golden values.
fn capture(samples: usize) -> (Vec<i32>, Vec<i32>) {
    let sine = |k: u32| (32767.0 * (std::f64::consts::TAU * f64::from(k) / 1024.0).sin()).round();
    let table: Vec<i32> = (0..1024).map(|k| sine(k) as i32).collect();
    let entry = |phase: u32, quarter: u32| table[((phase >> 22) + quarter) as usize & 1023];
    let (mut phase, mut slow, mut random) = (0u32, 0u32, 0x1234_5678u32);
    let mut noise = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 24) as i32 - 128
    };
    let one = |_| {
        phase = phase.wrapping_add(33_555_666);
        slow = slow.wrapping_add(77_777);
        let (si, co, m) = (entry(phase, 0), entry(phase, 256), entry(slow, 0));
        let (first, second) = (noise(), noise());
        let drive = ((26000 * si) >> 15) + first;
        let sense = (((((m * 3000) >> 15) + 9000) * co) >> 15) + ((2000 * si) >> 15) + second;
        (drive.clamp(-32768, 32767), sense.clamp(-32768, 32767))
    };
    (0..samples).map(one).unzip()
}
