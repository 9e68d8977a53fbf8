//! `cargo bench --bench replay -- SAMPLES ROUNDS`: `gyrogen replay` from NPY to NPY against a C program
//! that does the same file work, in the same run.
//!
//! All take turns, and the fastest run of each counts, by wall time.
//! All have to write the same bytes. Nothing is asserted of times.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// The tuning word of `opponents/chain.toml`.
const TUNING_WORD: &str = "33554432";

struct Contestant {
    name: String,
    program: PathBuf,
    arguments: Vec<String>,
    seconds: f64,
}

fn main() {
    let numbers: Vec<u64> = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse().ok())
        .collect();
    let samples = numbers.first().copied().unwrap_or(1 << 26) / 64 * 64;
    let rounds = numbers.get(1).copied().unwrap_or(5);
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/opponents");
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    let text = |path: PathBuf| path.to_string_lossy().into_owned();
    let (capture, own, other) = (
        text(file("capture.npy")),
        text(file("own.npy")),
        text(file("other.npy")),
    );
    let mut contestants = vec![Contestant {
        name: "gyrogen replay".into(),
        program: env!("CARGO_BIN_EXE_gyrogen").into(),
        arguments: [
            "replay",
            &text(here.join("chain.toml")),
            "--capture",
            &capture,
            "--out",
            &own,
        ]
        .map(String::from)
        .to_vec(),
        seconds: f64::INFINITY,
    }];
    for compiler in ["gcc", "clang", "clang-19"] {
        let program = file(compiler);
        let built = Command::new(compiler)
            .args(["-O3", "-march=native"])
            .arg(here.join("replay.c"))
            .arg("-o")
            .arg(&program)
            .arg("-lm")
            .status();
        if !built.is_ok_and(|status| status.success()) {
            continue;
        }
        for way in ["serial", "block"] {
            contestants.push(Contestant {
                name: format!("C {way}, {compiler} native"),
                program: program.clone(),
                arguments: [way, TUNING_WORD, &capture, &other]
                    .map(String::from)
                    .to_vec(),
                seconds: f64::INFINITY,
            });
        }
    }
    let Some(maker) = contestants.get(1).map(|c| c.program.clone()) else {
        println!("no C compiler is here");
        return;
    };
    run(
        &maker,
        &["make".into(), samples.to_string(), capture.clone()],
    );
    for _ in 0..rounds {
        for contestant in &mut contestants {
            let start = Instant::now();
            run(&contestant.program, &contestant.arguments);
            contestant.seconds = contestant.seconds.min(start.elapsed().as_secs_f64());
        }
    }
    let of_c = contestants.iter().skip(1).map(|c| c.seconds);
    let best = of_c.fold(f64::INFINITY, f64::min);
    println!("{samples} samples, NPY to NPY");
    for c in &contestants {
        println!(
            "  {:<28} {:>8.1} M samples/s   {:>5.2} of the best C",
            c.name,
            samples as f64 / c.seconds / 1e6,
            best / c.seconds,
        );
    }
    let bytes = |path: &str| std::fs::read(path).expect("the rows");
    let alike = if bytes(&own) == bytes(&other) {
        "alike"
    } else {
        "NOT ALIKE"
    };
    println!("  bytes: {alike}");
}

fn run(program: &Path, arguments: &[String]) {
    let status = Command::new(program)
        .args(arguments)
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .status();
    assert!(status.is_ok_and(|s| s.success()), "{}", program.display());
}
