//! Emits and verifies firmware bundles with the binary under test, builds their harness apart from
//! it, and talks to the harness.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use super::harness::binary;

/// The language of a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    C,
    Rust,
}

impl Language {
    /// As `--lang` takes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::C => "c",
            Self::Rust => "rust",
        }
    }
}

/// An emitted bundle, and where its harness is built.
pub struct Bundle {
    pub folder: PathBuf,
    pub language: Language,
    pub manifest: serde_json::Value,
}

fn told(what: &str, output: &Output) -> String {
    format!(
        "{what}: {}\n{}{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}

/// The output of a command that has to succeed.
fn succeed(what: &str, command: &mut Command) -> Result<Output, String> {
    let output = command.output().map_err(|e| format!("{what}: {e}"))?;
    if output.status.success() {
        Ok(output)
    } else {
        Err(told(what, &output))
    }
}

impl Bundle {
    /// Runs `gyrogen emit`.
    pub fn emit(design: &Path, language: Language, folder: PathBuf) -> Result<Self, String> {
        let mut command = Command::new(binary());
        command.arg("emit").arg(design);
        command.args(["--lang", language.name(), "--out"]);
        succeed("emit", command.arg(&folder))?;
        let text = std::fs::read_to_string(folder.join("manifest.json"))
            .map_err(|e| format!("manifest.json: {e}"))?;
        let manifest = serde_json::from_str(&text).map_err(|e| format!("manifest.json: {e}"))?;
        Ok(Self {
            folder,
            language,
            manifest,
        })
    }

    /// Runs `gyrogen verify`: its output.
    pub fn verify(&self) -> Output {
        Command::new(binary())
            .arg("verify")
            .arg(&self.folder)
            .output()
            .expect("the binary under test starts")
    }

    /// `gyrogen verify` has to succeed.
    pub fn expect_verified(&self) -> Result<(), String> {
        let output = self.verify();
        if output.status.success() {
            Ok(())
        } else {
            Err(told("verify", &output))
        }
    }

    fn prefix(&self) -> &str {
        self.manifest["prefix"].as_str().expect("a prefix")
    }

    /// Builds the harness as strictly as the language can be checked: C with the contract's warnings
    /// and, where it can be linked, the undefined-behaviour sanitiser; Rust with overflow checks.
    pub fn build(&self) -> Result<Harness, String> {
        let program = self.folder.join("own_harness");
        match self.language {
            Language::C => self.build_c(&program)?,
            Language::Rust => self.build_rust(&program)?,
        }
        Ok(Harness { program })
    }

    fn build_c(&self, program: &Path) -> Result<(), String> {
        let p = self.prefix();
        let compiler = std::env::var("GYROGEN_TEST_CC").unwrap_or_else(|_| "gcc".to_owned());
        let mut command = Command::new(compiler);
        command.args(["-std=c99", "-O1", "-Wall", "-Wextra", "-Wconversion"]);
        command.args(["-Wshadow", "-pedantic", "-Werror"]);
        command.args(["-fsanitize=undefined", "-fno-sanitize-recover=all"]);
        command.arg("-I").arg(&self.folder);
        for name in ["", "_tables", "_selftest"] {
            command.arg(self.folder.join(format!("{p}{name}.c")));
        }
        command.arg(self.folder.join(format!("test/{p}_harness.c")));
        succeed("gcc", command.arg("-o").arg(program)).map(|_| ())
    }

    fn build_rust(&self, program: &Path) -> Result<(), String> {
        let p = self.prefix();
        let library = self.folder.join(format!("lib{p}.rlib"));
        let flags = ["--edition", "2021", "-D", "warnings"];
        let checks = ["-C", "overflow-checks=on", "-C", "debug-assertions=on"];
        let mut command = Command::new("rustc");
        command.args(flags).args(checks);
        command.args(["--crate-type", "rlib", "--crate-name", p]);
        command.arg(self.folder.join("src/lib.rs"));
        succeed("rustc", command.arg("-o").arg(&library))?;
        let mut command = Command::new("rustc");
        command.args(flags).args(checks);
        command.arg("--extern");
        command.arg(format!("{p}={}", library.display()));
        command.arg(self.folder.join("src/bin/harness.rs"));
        succeed("rustc", command.arg("-o").arg(program)).map(|_| ())
    }

    /// The node of a fault number.
    pub fn fault_node(&self, number: u64) -> String {
        let faults = self.manifest["faults"].as_array().expect("a list");
        let found = faults.iter().find(|f| f["number"] == number);
        found.map_or_else(
            || format!("no fault has the number {number}"),
            |f| f["node"].as_str().expect("a node").to_owned(),
        )
    }

    /// Columns of the chain's rows.
    pub fn columns(&self) -> Vec<String> {
        let columns = self.manifest["chain"]["columns"].as_array();
        let columns = columns.expect("a chain").iter();
        columns
            .map(|c| c.as_str().expect("a name").to_owned())
            .collect()
    }

    /// The vectors of the functions: name, inputs, all words of the rows.
    pub fn vectors(&self) -> Vec<(String, usize, Vec<Vec<i128>>)> {
        let functions = self.manifest["functions"].as_array().expect("a list");
        let one = |f: &serde_json::Value| {
            let name = f["name"].as_str().expect("a name").to_owned();
            let inputs = f["inputs"].as_u64().expect("a count") as usize;
            let path = self.folder.join(format!("vectors/{name}.csv"));
            let text = std::fs::read_to_string(path).expect("vectors");
            let words = |line: &str| {
                let cells = line.split(',');
                cells.map(|c| c.parse().expect("an integer")).collect()
            };
            (name, inputs, text.lines().skip(1).map(words).collect())
        };
        functions.iter().map(one).collect()
    }
}

/// A built test driver.
pub struct Harness {
    program: PathBuf,
}

impl Harness {
    /// Runs a mode on `input`; exit 0 and nothing on stderr are due. Gives the words of the output.
    fn run(&self, arguments: &[&str], input: Vec<u8>) -> Result<Vec<u8>, String> {
        let mut child = Command::new(&self.program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| format!("the harness: {e}"))?;
        let mut stdin = child.stdin.take().expect("a pipe");
        let feeder = std::thread::spawn(move || stdin.write_all(&input));
        let output = child.wait_with_output().map_err(|e| e.to_string())?;
        let fed = feeder.join().expect("a thread that does not panic");
        if output.status.success() && output.stderr.is_empty() && fed.is_ok() {
            Ok(output.stdout)
        } else {
            Err(told(&format!("harness {arguments:?}"), &output))
        }
    }

    fn words(bytes: &[u8]) -> Vec<u64> {
        let word = |c: &[u8]| u64::from_ne_bytes(c.try_into().expect("8 bytes"));
        bytes.chunks_exact(8).map(word).collect()
    }

    /// The start-up check.
    pub fn selftest(&self) -> Result<(), String> {
        self.run(&["selftest"], Vec::new()).map(|_| ())
    }

    /// Rows of the chain, each with `columns` words and the fault.
    pub fn chain(&self, codes: &[(i64, i64)], columns: usize) -> Result<Vec<Vec<u64>>, String> {
        let code = |c: i64| i32::try_from(c).expect("a code").to_ne_bytes();
        let pairs = codes.iter().flat_map(|&(d, s)| [code(d), code(s)]);
        let bytes = self.run(&["chain"], pairs.flatten().collect())?;
        let words = Self::words(&bytes);
        let rows = words.chunks_exact(columns + 1).map(<[u64]>::to_vec);
        Ok(rows.collect())
    }

    /// Compares a function with its vectors.
    pub fn call(&self, name: &str, inputs: usize, rows: &[Vec<i128>]) -> Result<(), String> {
        let words = rows.iter().flat_map(|row| &row[..inputs]);
        let bytes = words.flat_map(|w| (*w as i64).to_ne_bytes()).collect();
        let found = Self::words(&self.run(&["call", name], bytes)?);
        let due = rows.iter().flat_map(|row| &row[inputs..]);
        let due: Vec<u64> = due.map(|w| *w as u64).collect();
        if found == due {
            return Ok(());
        }
        let at = found.iter().zip(&due).position(|(a, b)| a != b);
        Err(format!("{name}: word {at:?} of its vectors differs"))
    }
}
