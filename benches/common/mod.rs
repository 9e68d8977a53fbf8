//! What the benchmarks share: the compilers that are here, turns, and the table of a comparison.

#![allow(dead_code)] // Each benchmark uses a part of it.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs of a contestant before the next one's turn.
pub const RUNS: usize = 3;

/// The compilers that are looked for.
const COMPILERS: [&str; 3] = ["gcc", "clang", "clang-19"];

/// What a program is compiled for.
const TARGETS: [(&str, &[&str]); 2] = [("native", &["-march=native"]), ("portable", &[])];

/// A program of `benches/opponents`.
pub struct Built {
    /// Compiler and target.
    pub name: String,
    /// Where it is.
    pub program: PathBuf,
}

/// `source` of `benches/opponents` by every compiler that is found, with `-O3`, with and without `-march=native`,
/// and these flags.
pub fn built(folder: &Path, source: &str, flags: &[&str]) -> Vec<Built> {
    let mut all = Vec::new();
    for compiler in COMPILERS {
        for (target, given) in TARGETS {
            let program = folder.join(format!("{source}_{compiler}_{target}_{}", flags.concat()));
            let mut command = Command::new(compiler);
            command.arg("-O3").args(given).args(flags);
            command.arg(opponents().join(source));
            command.arg("-o").arg(&program).arg("-lm");
            if command.status().is_ok_and(|status| status.success()) {
                all.push(Built {
                    name: format!("{compiler} {target}"),
                    program,
                });
            }
        }
    }
    all
}

/// The folder of the opponents.
pub fn opponents() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/opponents")
}

/// The whole numbers among the program's arguments, by place.
pub fn numbers<const N: usize>(defaults: [usize; N]) -> [usize; N] {
    let mut numbers = defaults;
    let given = std::env::args().skip(1).filter_map(|a| a.parse().ok());
    for (to, given) in numbers.iter_mut().zip(given) {
        *to = given;
    }
    numbers
}

/// Who takes part.
pub struct Contestant<R> {
    /// For the table.
    pub name: String,
    /// Of its fastest run so far.
    pub seconds: f64,
    /// Of what it gave.
    pub checksum: u64,
    /// What is run.
    pub run: R,
    /// Hand-written C.
    pub is_c: bool,
}

impl<R> Contestant<R> {
    /// Who has not run.
    pub fn new(name: String, is_c: bool, run: R) -> Self {
        Contestant {
            name,
            seconds: f64::INFINITY,
            checksum: 0,
            run,
            is_c,
        }
    }
}

/// All run in turn, round after round; the fastest run counts.
pub fn take_turns<R>(
    contestants: &mut [Contestant<R>],
    rounds: usize,
    run: impl Fn(&R) -> (f64, u64),
) {
    for _ in 0..rounds {
        for contestant in contestants.iter_mut() {
            let (seconds, checksum) = run(&contestant.run);
            contestant.seconds = contestant.seconds.min(seconds);
            contestant.checksum = checksum;
        }
    }
}

/// What a program of the opponents prints: seconds and checksum.
pub fn program(path: &Path, arguments: &[String]) -> (f64, u64) {
    let output = Command::new(path)
        .args(arguments)
        .output()
        .expect("the program runs");
    let text = String::from_utf8_lossy(&output.stdout);
    let (seconds, checksum) = text.trim().split_once(' ').expect("seconds and checksum");
    let checksum = u64::from_str_radix(checksum, 16).expect("a checksum");
    (seconds.parse().expect("seconds"), checksum)
}

/// The table: samples a second, and how much faster than the best C.
pub fn report<R>(title: &str, samples: usize, contestants: &[Contestant<R>]) {
    let of_c = contestants.iter().filter(|c| c.is_c).map(|c| c.seconds);
    let best = of_c.fold(f64::INFINITY, f64::min);
    println!("{title}, {samples} samples, one thread");
    for c in contestants {
        println!(
            "  {:<36} {:>8.1} M samples/s   {:>5.2} of the best C   {:016x}",
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

/// A checksum with one more 32-bit word.
pub fn with_word(checksum: u64, word: u32) -> u64 {
    (checksum ^ u64::from(word)).wrapping_mul(0x100_0000_01b3)
}

/// The checksum of nothing.
pub const NO_WORDS: u64 = 0xcbf2_9ce4_8422_2325;

/// The tuning word of `opponents/chain.toml`: 128 samples a turn.
pub const COHERENT_WORD: i64 = 33_554_432;

/// One near it whose phases hardly repeat.
pub const INCOHERENT_WORD: i64 = 33_555_666;

/// The capture of the manual's golden values: codes of drive and sense.
pub fn capture(samples: usize) -> (Vec<i32>, Vec<i32>) {
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
