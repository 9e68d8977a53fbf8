//! Builds a bundle's test driver with the system's compilers and talks to it.

use crate::emit::views::Language;
use crate::error::{Error, InputError, Result, io_error};
use crate::leftovers::{self, TemporaryFolder};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What the C is compiled with, apart from paths.
pub const C_FLAGS: [&str; 8] = [
    "-std=c99",
    "-O2",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wshadow",
    "-pedantic",
    "-Werror",
];

/// What the Rust is compiled with, apart from paths.
pub const RUST_FLAGS: [&str; 5] = ["--edition", "2021", "-O", "-D", "warnings"];

/// A built test driver.
#[derive(Debug)]
pub struct Harness {
    program: PathBuf,
    /// Runs the program, where this machine does not.
    emulator: Option<&'static str>,
    /// First line of the compiler's version and the flags.
    pub toolchain: String,
    // Removed with the harness.
    _folder: TemporaryFolder,
}

/// Builds the driver of the bundle in `folder`. `sources` are the bundle's paths.
///
/// # Errors
/// No compiler on this machine (exit 2); sources that do not compile (a check that does not hold).
pub fn build(
    language: Language,
    prefix: &str,
    folder: &Path,
    sources: &[String],
) -> Result<Harness> {
    let made = TemporaryFolder::of_the_system()
        .map_err(|e| io_error(std::env::temp_dir(), "make a folder for the build", &e))?;
    let program = made.path().join("harness");
    let compiler = compiler(language)?;
    let toolchain = match language {
        Language::C => {
            let mut command = Command::new(&compiler);
            command.args(C_FLAGS).arg("-I").arg(folder);
            let c_files = sources.iter().filter(|path| path.ends_with(".c"));
            command.args(c_files.map(|path| folder.join(path)));
            command.arg("-o").arg(&program);
            compile(command, "the emitted C", made.path())?;
            format!("{}; {}", version(&compiler), C_FLAGS.join(" "))
        }
        Language::Rust => {
            let library = made.path().join(format!("lib{prefix}.rlib"));
            let mut command = Command::new(&compiler);
            command
                .args(RUST_FLAGS)
                .args(["--crate-type", "rlib", "--crate-name", prefix]);
            command
                .arg(folder.join("src/lib.rs"))
                .arg("-o")
                .arg(&library);
            compile(command, "the emitted Rust", made.path())?;
            let mut command = Command::new(&compiler);
            let mut library_argument = std::ffi::OsString::from(format!("{prefix}="));
            library_argument.push(&library);
            command
                .args(RUST_FLAGS)
                .arg("--extern")
                .arg(library_argument);
            command
                .arg(folder.join("src/bin/harness.rs"))
                .arg("-o")
                .arg(&program);
            compile(command, "the emitted Rust", made.path())?;
            format!("{}; {}", version(&compiler), RUST_FLAGS.join(" "))
        }
    };
    Ok(Harness {
        program,
        emulator: None,
        toolchain,
        _folder: made,
    })
}

/// The compiler that the environment names (`CC`, `RUSTC`), or the first that answers.
fn compiler(language: Language) -> Result<String> {
    let (variable, names): (&str, &[&str]) = match language {
        Language::C => ("CC", &["cc", "gcc", "clang"]),
        Language::Rust => ("RUSTC", &["rustc"]),
    };
    let named = std::env::var(variable).ok().filter(|name| !name.is_empty());
    let candidates: Vec<String> = match named {
        Some(name) => vec![name],
        None => names.iter().map(|&name| name.to_owned()).collect(),
    };
    let answers = |name: &&String| {
        let answer = leftovers::output(Command::new(name).arg("--version"));
        answer.is_ok_and(|answer| answer.status.success())
    };
    match candidates.iter().find(answers) {
        Some(name) => Ok(name.clone()),
        None => Err(InputError::new(format!(
            "there is no compiler to build the emitted code with (tried {})",
            candidates.join(", ")
        ))
        .help(format!(
            "install one, or name it in the environment variable {variable}"
        ))
        .into()),
    }
}

pub(super) fn version(compiler: &str) -> String {
    let output = leftovers::output(Command::new(compiler).arg("--version"));
    let text = output.map(|o| String::from_utf8_lossy(&o.stdout).into_owned());
    let line = text
        .unwrap_or_default()
        .lines()
        .next()
        .unwrap_or("")
        .to_owned();
    if line.is_empty() {
        compiler.to_owned()
    } else {
        line
    }
}

/// Runs a compiler; what it puts aside goes into `scratch`, which is removed with all that is in it.
pub(super) fn compile(mut command: Command, what: &str, scratch: &Path) -> Result<()> {
    let output = leftovers::output(command.env("TMPDIR", scratch))
        .map_err(|e| InputError::new(format!("cannot run the compiler: {e}")))?;
    if output.status.success() {
        return Ok(());
    }
    let messages = String::from_utf8_lossy(&output.stderr);
    let shown: Vec<&str> = messages.lines().take(20).collect();
    Err(Error::Check(format!(
        "{what} does not compile:\n{}",
        shown.join("\n")
    )))
}

impl Harness {
    /// A driver that an emulator runs; `folder` is removed with it.
    pub(super) fn emulated(
        emulator: &'static str,
        program: PathBuf,
        toolchain: String,
        folder: TemporaryFolder,
    ) -> Harness {
        Harness {
            program,
            emulator: Some(emulator),
            toolchain,
            _folder: folder,
        }
    }

    /// Runs the driver with these arguments and input; hands its output to `each`, record by record
    /// of `record` 64-bit words. Gives the exit status.
    ///
    /// # Errors
    /// A driver that cannot be started or that breaks off.
    pub fn run(
        &self,
        arguments: &[String],
        input: Vec<u8>,
        record: usize,
        each: &mut dyn FnMut(&[u64]),
    ) -> Result<Option<i32>> {
        let failed = |e: std::io::Error| io_error(&self.program, "run the test driver", &e);
        let mut command = match self.emulator {
            Some(emulator) => {
                let mut command = Command::new(emulator);
                command.arg(&self.program);
                command
            }
            None => Command::new(&self.program),
        };
        command
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        let mut child = leftovers::spawn(&mut command).map_err(failed)?;
        let stdin = child.process.stdin.take();
        let feeder = std::thread::spawn(move || {
            if let Some(mut stdin) = stdin {
                // A driver that stops reading shows in its output.
                let _ = stdin.write_all(&input);
            }
        });
        if let Some(mut stdout) = child.process.stdout.take() {
            let mut bytes = vec![0u8; 1 << 16];
            let mut held = Vec::new();
            let mut words = Vec::new();
            loop {
                let count = stdout.read(&mut bytes).map_err(failed)?;
                if count == 0 {
                    break;
                }
                held.extend_from_slice(&bytes[..count]);
                let whole = held.len() / 8 * 8;
                words.extend(held[..whole].chunks_exact(8).map(|c| {
                    let mut word = [0; 8];
                    word.copy_from_slice(c);
                    u64::from_ne_bytes(word)
                }));
                held.drain(..whole);
                let complete = words.len() / record * record;
                words[..complete].chunks_exact(record).for_each(&mut *each);
                words.drain(..complete);
            }
        }
        let status = child.wait().map_err(failed)?;
        let _ = feeder.join();
        Ok(status.code())
    }
}
