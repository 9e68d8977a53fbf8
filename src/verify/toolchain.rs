//! Builds a bundle's test driver with the system's compilers and talks to it.

use super::process;
use crate::emit::views::Language;
use crate::error::{Error, InputError, Result, io_error};
use crate::leftovers::{self, TemporaryFolder};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::RecvTimeoutError;
use std::time::Instant;

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
    let (compiler, version) = compiler(language)?;
    let toolchain = match language {
        Language::C => {
            let mut command = compiler.command();
            command.args(C_FLAGS).arg("-I").arg(folder);
            let c_files = sources.iter().filter(|path| path.ends_with(".c"));
            command.args(c_files.map(|path| folder.join(path)));
            command.arg("-o").arg(&program);
            compile(command, "the emitted C", made.path())?;
            format!("{version}; {}", C_FLAGS.join(" "))
        }
        Language::Rust => {
            let crates = [(prefix.to_owned(), folder.join("src/lib.rs"))];
            let main = folder.join("src/bin/harness.rs");
            rust_program(&compiler, &crates, &main, made.path(), &program)?;
            format!("{version}; {}", RUST_FLAGS.join(" "))
        }
    };
    Ok(Harness {
        program,
        emulator: None,
        toolchain,
        _folder: made,
    })
}

/// Builds the program of a product's parts together in Rust: `crates` by their names, each with its `lib.rs`.
///
/// # Errors
/// As [`build`].
pub fn build_crates(crates: &[(String, PathBuf)], main: &Path) -> Result<Harness> {
    let made = TemporaryFolder::of_the_system()
        .map_err(|e| io_error(std::env::temp_dir(), "make a folder for the build", &e))?;
    let program = made.path().join("harness");
    let (compiler, version) = compiler(Language::Rust)?;
    rust_program(&compiler, crates, main, made.path(), &program)?;
    Ok(Harness {
        program,
        emulator: None,
        toolchain: format!("{version}; {}", RUST_FLAGS.join(" ")),
        _folder: made,
    })
}

/// Compiles crates, and a program that uses them.
fn rust_program(
    compiler: &Compiler,
    crates: &[(String, PathBuf)],
    main: &Path,
    made: &Path,
    program: &Path,
) -> Result<()> {
    let mut linked = Vec::new();
    for (name, source) in crates {
        let library = made.join(format!("lib{name}.rlib"));
        let mut command = compiler.command();
        command
            .args(RUST_FLAGS)
            .args(["--crate-type", "rlib", "--crate-name", name]);
        command.arg(source).arg("-o").arg(&library);
        compile(command, "the emitted Rust", made)?;
        let mut argument = std::ffi::OsString::from(format!("{name}="));
        argument.push(&library);
        linked.push(argument);
    }
    let mut command = compiler.command();
    command.args(RUST_FLAGS);
    for argument in linked {
        command.arg("--extern").arg(argument);
    }
    command.arg(main).arg("-o").arg(program);
    compile(command, "the emitted Rust", made)
}

/// A compiler's command: its program and the arguments that go before all others (`gcc -m64`).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Compiler(Vec<String>);

impl Compiler {
    /// A command, its words between blanks; what is a file's name with blanks is one word.
    fn new(named: &str) -> Self {
        if Path::new(named).is_file() {
            return Compiler(vec![named.to_owned()]);
        }
        Compiler(named.split_whitespace().map(str::to_owned).collect())
    }

    pub(super) fn command(&self) -> Command {
        let mut words = self.0.iter();
        let mut command = Command::new(words.next().map_or("", String::as_str));
        command.args(words);
        command
    }

    /// What it says of itself; or why it is none.
    fn answer(&self) -> std::result::Result<String, String> {
        let mut command = self.command();
        command.arg("--version");
        let said = process::output(command, "the compiler").map_err(|e| match e {
            Error::Input(e) => e.message.clone(),
            other => other.to_string(),
        })?;
        if !said.status.success() {
            return Err(format!("`--version` ends with {}", said.status));
        }
        let text = String::from_utf8_lossy(&said.stdout).into_owned();
        let line = text.lines().next().unwrap_or("").trim().to_owned();
        Ok(if line.is_empty() {
            self.to_string()
        } else {
            line
        })
    }
}

impl std::fmt::Display for Compiler {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.0.join(" "))
    }
}

/// The compiler that the environment names (`CC`, `RUSTC`), or the first that answers, and what it says of
/// itself.
fn compiler(language: Language) -> Result<(Compiler, String)> {
    let (variable, names): (&str, &[&str]) = match language {
        Language::C => ("CC", &["cc", "gcc", "clang"]),
        Language::Rust => ("RUSTC", &["rustc"]),
    };
    let named = std::env::var(variable)
        .ok()
        .filter(|name| !name.trim().is_empty());
    if let Some(name) = named {
        let compiler = Compiler::new(&name);
        return match compiler.answer() {
            Ok(version) => Ok((compiler, version)),
            Err(why) => Err(InputError::new(format!(
                "`{compiler}`, which {variable} names, is no compiler that can be used: {why}"
            ))
            .help(format!(
                "name a working compiler in {variable}, or unset it"
            ))
            .into()),
        };
    }
    for name in names {
        let compiler = Compiler::new(name);
        if let Ok(version) = compiler.answer() {
            return Ok((compiler, version));
        }
    }
    Err(InputError::new(format!(
        "there is no compiler to build the emitted code with (tried {})",
        names.join(", ")
    ))
    .help(format!(
        "install one, or name it in the environment variable {variable}"
    ))
    .into())
}

/// The languages that emitted code can be built in on this machine, of those that are asked for (`None`: both), and
/// for each other one why not. To be asked before work begins.
///
/// # Errors
/// No compiler for any of them.
pub fn languages(asked: Option<Language>) -> Result<(Vec<Language>, Vec<String>)> {
    let wanted = match asked {
        Some(language) => vec![language],
        None => vec![Language::C, Language::Rust],
    };
    let (mut found, mut lacking) = (Vec::new(), Vec::new());
    for language in wanted {
        match compiler(language) {
            Ok(_) => found.push(language),
            Err(error) => lacking.push(error),
        }
    }
    if found.is_empty() {
        return Err(lacking.swap_remove(0));
    }
    Ok((found, lacking.iter().map(within_a_sentence).collect()))
}

/// Why a compiler is lacking, for the end of a note: what is wrong and what to do about it.
fn within_a_sentence(error: &Error) -> String {
    match error {
        Error::Input(e) => {
            let said = [Some(&e.message), e.help.as_ref()];
            let said: Vec<&str> = said.into_iter().flatten().map(String::as_str).collect();
            said.join("; ")
        }
        other => other.to_string(),
    }
}

pub(super) fn version(compiler: &str) -> String {
    let compiler = Compiler::new(compiler);
    compiler.answer().unwrap_or_else(|_| compiler.to_string())
}

/// Runs a compiler; what it puts aside goes into `scratch`, which is removed with all that is in it.
pub(super) fn compile(mut command: Command, what: &str, scratch: &Path) -> Result<()> {
    command.env("TMPDIR", scratch);
    let said = process::output(command, "the compiler")?;
    if said.status.success() {
        return Ok(());
    }
    let messages = String::from_utf8_lossy(&said.stderr);
    let printable = |line: &str| -> String {
        line.chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .take(400)
            .collect()
    };
    let shown: Vec<String> = messages.lines().take(20).map(printable).collect();
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
    /// of `record` 64-bit words, at most `most` of them and one more: then it is ended. Gives the exit status,
    /// `None` where it was ended.
    ///
    /// # Errors
    /// A driver that cannot be started or that breaks off; one that does not end in time (a check that does not hold).
    pub fn run(
        &self,
        arguments: &[String],
        input: Vec<u8>,
        (record, most): (usize, u64),
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
        let limit = process::limit();
        let until = Instant::now() + limit;
        let mut child = leftovers::spawn(&mut command).map_err(failed)?;
        let (stdin, mut stdout) = (child.process.stdin.take(), child.process.stdout.take());
        let (send, receive) = std::sync::mpsc::sync_channel::<Vec<u8>>(16);
        std::thread::scope(|scope| {
            scope.spawn(move || {
                if let Some(mut stdin) = stdin {
                    // A driver that stops reading shows in its output.
                    let _ = stdin.write_all(&input);
                }
            });
            scope.spawn(move || {
                let mut bytes = vec![0u8; 1 << 16];
                while let Some(stdout) = &mut stdout {
                    let count = std::io::Read::read(stdout, &mut bytes).unwrap_or(0);
                    if count == 0 || send.send(bytes[..count].to_vec()).is_err() {
                        break;
                    }
                }
            });
            let mut records = Records {
                size: record,
                left: most.saturating_add(1),
                held: Vec::new(),
            };
            let mut ended = false;
            loop {
                let left = until.saturating_duration_since(Instant::now());
                match receive.recv_timeout(left) {
                    Ok(bytes) if records.take(&bytes, each) => {}
                    Err(RecvTimeoutError::Disconnected) => break,
                    // More than is due, or no end.
                    Ok(_) | Err(RecvTimeoutError::Timeout) => {
                        ended = true;
                        break;
                    }
                }
            }
            if ended {
                child.end().map_err(failed)?;
            }
            drop(receive);
            let status = child.wait(until).map_err(failed)?;
            // What it started may hold its pipes open.
            child.end().map_err(failed)?;
            if status.is_none() || ended && records.left > 0 {
                return Err(Error::Check(format!(
                    "the emitted code's test driver did not end within {} s and was ended (GYROGEN_TIME_LIMIT gives \
                     another limit, in seconds)",
                    limit.as_secs()
                )));
            }
            Ok(status.filter(|_| !ended).and_then(|status| status.code()))
        })
    }
}

/// Gathers records from bytes.
struct Records {
    size: usize,
    /// How many more are wanted.
    left: u64,
    held: Vec<u8>,
}

impl Records {
    /// Hands on what is whole; false if no more are wanted.
    fn take(&mut self, bytes: &[u8], each: &mut dyn FnMut(&[u64])) -> bool {
        self.held.extend_from_slice(bytes);
        let size = 8 * self.size.max(1);
        let whole = self.held.len() / size * size;
        let mut words = Vec::with_capacity(self.size);
        for record in self.held[..whole].chunks_exact(size) {
            if self.left == 0 {
                break;
            }
            words.clear();
            words.extend(record.chunks_exact(8).map(|c| {
                let mut word = [0; 8];
                word.copy_from_slice(c);
                u64::from_ne_bytes(word)
            }));
            each(&words);
            self.left -= 1;
        }
        self.held.drain(..whole);
        self.left > 0
    }
}
