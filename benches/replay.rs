//! `cargo bench --bench replay -- SAMPLES ROUNDS`: `gyrogen replay` from NPY to NPY against a C program
//! that does the same file work, in the same run.
//!
//! All take turns, and the fastest run of each counts, by wall time.
//! All have to write the same bytes: what the checksum is of. Nothing is asserted of times.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Instant;

mod common;
use common::Contestant;

struct Run {
    program: PathBuf,
    arguments: Vec<String>,
    /// The file that it writes.
    written: String,
}

fn main() {
    let [samples, rounds] = common::numbers([1 << 26, 5]);
    let samples = samples / 64 * 64;
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    let text = |path: PathBuf| path.to_string_lossy().into_owned();
    let (capture, own, other) = (
        text(file("capture.npy")),
        text(file("own.npy")),
        text(file("other.npy")),
    );
    let design = text(common::opponents().join("chain.toml"));
    let run = |program: PathBuf, arguments: &[&str]| Run {
        program,
        arguments: arguments.iter().map(|a| (*a).to_owned()).collect(),
        written: arguments
            .last()
            .map_or_else(String::new, |a| (*a).to_owned()),
    };
    let own_arguments = ["replay", &design, "--capture", &capture, "--out", &own];
    let ours = run(env!("CARGO_BIN_EXE_gyrogen").into(), &own_arguments);
    let mut contestants = vec![Contestant::new("gyrogen replay".into(), false, ours)];
    let word = common::COHERENT_WORD.to_string();
    let built = common::built(folder.path(), "replay.c", &[]);
    for built in &built {
        for way in ["serial", "block"] {
            let arguments = [way, &word, &capture, &other];
            let run = run(built.program.clone(), &arguments);
            let name = format!("C {way}, {}", built.name);
            contestants.push(Contestant::new(name, true, run));
        }
    }
    let Some(maker) = built.first() else {
        println!("no C compiler is here");
        return;
    };
    done(&run(
        maker.program.clone(),
        &["make", &samples.to_string(), &capture],
    ));
    common::take_turns(&mut contestants, rounds, |run| {
        let start = Instant::now();
        done(run);
        let seconds = start.elapsed().as_secs_f64();
        (seconds, checksum(&run.written))
    });
    common::report("replay from NPY to NPY", samples, &contestants);
}

/// Of a file's bytes, in fours.
fn checksum(path: &str) -> u64 {
    let bytes = std::fs::read(path).expect("the rows");
    let words = bytes.as_chunks::<4>().0.iter();
    words.fold(common::NO_WORDS, |sum, word| {
        common::with_word(sum, u32::from_le_bytes(*word))
    })
}

fn done(run: &Run) {
    let status = Command::new(&run.program)
        .args(&run.arguments)
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .status();
    assert!(
        status.is_ok_and(|s| s.success()),
        "{}",
        run.program.display()
    );
}
