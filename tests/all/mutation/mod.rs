//! Damages emitted C one token at a time, and asks the bundle's own harness whether it notices.

mod damage;
mod limited;
mod prover;
mod slice;

use crate::common::compiler::cc;
pub use damage::mutants;
use limited::limited;
pub use prover::Answer;
use prover::Prover;
use std::path::{Path, PathBuf};
use std::process::Stdio;

/// Seconds of processor time; a harness that takes more has been noticed.
const LIMIT_S: u32 = 10;

/// One damaged line.
#[derive(Clone, Debug)]
pub struct Mutant {
    pub file: String,
    pub line: usize,
    pub before: String,
    pub after: String,
}

/// What became of a mutant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fate {
    /// The harness, or the compiler, noticed.
    Killed,
    /// It is in a function of which every input was run.
    Exhausted,
    /// The compiler makes the same instructions of it.
    SameInstructions,
    /// The model checker proves that it computes the same.
    Proved,
    /// With words at which it differs, where the model checker finds some.
    Alive(Answer),
}

/// A bundle ready for mutants.
pub struct Bundle {
    pub folder: PathBuf,
    pub prefix: String,
    build: PathBuf,
    names: Vec<String>,
    checks: Vec<Vec<String>>,
    /// Functions of which the harness runs every input.
    exhausted: Vec<String>,
    prover: Option<Prover>,
}

impl Bundle {
    /// Compiles the bundle in `folder` in `build`, another folder.
    pub fn new(folder: PathBuf, build: PathBuf) -> Self {
        let text = std::fs::read_to_string(folder.join("manifest.json")).expect("a manifest");
        let manifest: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let prefix = manifest["prefix"].as_str().expect("a prefix").to_owned();
        let names = ["", "_tables", "_selftest", "_harness"];
        let names = names.map(|part| format!("{prefix}{part}.c")).to_vec();
        let mut checks = vec![vec!["selftest".to_owned()]];
        let mut check = |name: &str| checks.push(vec!["check".to_owned(), name.to_owned()]);
        for function in manifest["functions"].as_array().expect("functions") {
            check(function["name"].as_str().expect("a name"));
        }
        check("tables");
        for (key, name) in [("sequence", "sequence"), ("chain", "chain")] {
            if !manifest[key].is_null() {
                check(name);
            }
        }
        check("every");
        if !manifest["long_run"].is_null() {
            check("long");
        }
        let functions = manifest["functions"].as_array().expect("functions");
        let exhausted = functions.iter().filter(|f| !f["every_input"].is_null());
        let exhausted = exhausted.map(|f| f["name"].as_str().expect("a name").to_owned());
        let bundle = Bundle {
            exhausted: exhausted.collect(),
            prover: Prover::find(),
            folder,
            prefix,
            build,
            names,
            checks,
        };
        for name in &bundle.names {
            let source = bundle.source(name);
            assert!(
                bundle.compile(&source, &bundle.object(name), &[]),
                "{name} compiles"
            );
        }
        bundle
    }

    fn source(&self, name: &str) -> PathBuf {
        let test = self.folder.join("test").join(name);
        if test.exists() {
            test
        } else {
            self.folder.join(name)
        }
    }

    fn object(&self, name: &str) -> PathBuf {
        self.build.join(format!("{name}.o"))
    }

    /// Compiles a source with headers from `before`, then from the bundle.
    fn compile(&self, source: &Path, object: &Path, before: &[&Path]) -> bool {
        let mut command = cc();
        command.args(["-std=c99", "-O1", "-w", "-c"]);
        command.args(
            before
                .iter()
                .flat_map(|folder| ["-I".as_ref(), folder.as_os_str()]),
        );
        command
            .arg("-I")
            .arg(&self.folder)
            .arg(source)
            .arg("-o")
            .arg(object);
        let status = command.stderr(Stdio::null()).status();
        status.expect("a C compiler").success()
    }

    /// The instructions that the compiler makes of a source.
    fn instructions(&self, source: &Path, before: &[&Path]) -> Vec<u8> {
        let mut command = cc();
        command.args(["-std=c99", "-O2", "-w", "-S", "-o", "-"]);
        command.args(
            before
                .iter()
                .flat_map(|folder| ["-I".as_ref(), folder.as_os_str()]),
        );
        command.arg("-I").arg(&self.folder).arg(source);
        let text = command
            .stderr(Stdio::null())
            .output()
            .expect("a C compiler")
            .stdout;
        // The file's own name stands in one line.
        let lines = text.split(|b| *b == b'\n');
        lines
            .filter(|l| !l.starts_with(b"\t.file"))
            .flatten()
            .copied()
            .collect()
    }

    /// Sources whose mutants are taken.
    pub fn sources(&self) -> Vec<(String, String)> {
        let p = &self.prefix;
        let names = [
            format!("{p}.c"),
            format!("{p}_tables.c"),
            format!("{p}_arith.h"),
        ];
        let read = |name: String| {
            let text = std::fs::read_to_string(self.folder.join(&name)).expect("a source");
            (name, text)
        };
        names.map(read).to_vec()
    }

    /// Builds the mutant in its own folder and runs the harness.
    pub fn fate(&self, mutant: &Mutant, number: usize) -> Fate {
        let place = self.build.join(format!("m{number}"));
        std::fs::create_dir_all(&place).expect("a folder");
        let fate = self.fate_in(mutant, &place);
        let _ = std::fs::remove_dir_all(&place);
        fate
    }

    /// The harness, or the compiler, notices the mutant.
    pub fn is_noticed(&self, mutant: &Mutant, number: usize) -> bool {
        !self.noticed_by(mutant, number, &self.checks).is_empty()
    }

    /// The checks, of these, that notice the mutant; all, where it does not compile.
    pub fn noticed_by(
        &self,
        mutant: &Mutant,
        number: usize,
        checks: &[Vec<String>],
    ) -> Vec<Vec<String>> {
        let place = self.build.join(format!("n{number}"));
        std::fs::create_dir_all(&place).expect("a folder");
        let program = self.built(mutant, &place);
        let passes = |check: &[String]| program.as_ref().is_some_and(|p| self.passes(p, check));
        let noticed = checks.iter().filter(|check| !passes(check)).cloned();
        let noticed = noticed.collect();
        let _ = std::fs::remove_dir_all(&place);
        noticed
    }

    /// The harness with the mutant; none where it does not compile.
    fn built(&self, mutant: &Mutant, place: &Path) -> Option<PathBuf> {
        std::fs::write(place.join(&mutant.file), self.damaged(mutant)).expect("written");
        let is_header = mutant.file.ends_with(".h");
        // All that a damaged header goes into is compiled with it: copies beside it.
        let damaged: Vec<&String> = match is_header {
            true => self.names.iter().collect(),
            false => vec![&mutant.file],
        };
        if is_header {
            let headers = ["", "_tables"].map(|part| format!("{}{part}.h", self.prefix));
            for name in headers {
                std::fs::copy(self.folder.join(&name), place.join(&name)).expect("copied");
            }
            for name in &damaged {
                std::fs::copy(self.source(name), place.join(name)).expect("copied");
            }
        }
        let object = |name: &String| place.join(format!("{name}.o"));
        for name in &damaged {
            if !self.compile(&place.join(name), &object(name), &[place]) {
                return None;
            }
        }
        let program = place.join("harness");
        let mut link = cc();
        link.args(self.names.iter().map(|n| match damaged.contains(&n) {
            true => object(n),
            false => self.object(n),
        }));
        let linked = link.arg("-o").arg(&program).stderr(Stdio::null()).status();
        let is_linked = linked.expect("a C compiler").success();
        is_linked.then_some(program)
    }

    fn fate_in(&self, mutant: &Mutant, place: &Path) -> Fate {
        let program = self.built(mutant, place);
        let passes = |check| program.as_ref().is_some_and(|p| self.passes(p, check));
        if !self.checks.iter().all(|check| passes(check)) {
            return Fate::Killed;
        }
        let text = std::fs::read_to_string(self.folder.join(&mutant.file)).expect("a source");
        if self.is_exhausted(mutant, &text) {
            return Fate::Exhausted;
        }
        let main = format!("{}.c", self.prefix);
        let name = match mutant.file.ends_with(".h") {
            true => &main,
            false => &mutant.file,
        };
        let [original, damaged] = [self.source(name), place.join(name)];
        if self.instructions(&original, &[]) == self.instructions(&damaged, &[place]) {
            return Fate::SameInstructions;
        }
        match self.proved(mutant, place) {
            Answer::Equal => Fate::Proved,
            answer => Fate::Alive(answer),
        }
    }

    /// There is a model checker.
    pub fn has_prover(&self) -> bool {
        self.prover.is_some()
    }

    /// What the model checker says of the mutant, whatever the vectors say.
    pub fn asked(&self, mutant: &Mutant, number: usize) -> Answer {
        let place = self.build.join(format!("q{number}"));
        std::fs::create_dir_all(&place).expect("a folder");
        let answer = self.proved(mutant, &place);
        let _ = std::fs::remove_dir_all(&place);
        answer
    }

    /// The whole text of the source with the damaged line.
    fn damaged(&self, mutant: &Mutant) -> String {
        let text = std::fs::read_to_string(self.folder.join(&mutant.file)).expect("a source");
        let lines = text
            .lines()
            .enumerate()
            .map(|(k, line)| match k == mutant.line {
                true => mutant.after.as_str(),
                false => line,
            });
        lines.collect::<Vec<_>>().join("\n") + "\n"
    }

    /// What the model checker says of the mutant.
    fn proved(&self, mutant: &Mutant, place: &Path) -> Answer {
        let Some(prover) = &self.prover else {
            return Answer::Unknown;
        };
        let question = place.join("question");
        std::fs::create_dir_all(&question).expect("a folder");
        let file = (mutant.file.as_str(), mutant.line);
        prover.compare(
            &question,
            &self.folder,
            &self.prefix,
            file,
            &self.damaged(mutant),
        )
    }

    /// The mutant is in a function of which every input has just been run.
    fn is_exhausted(&self, mutant: &Mutant, text: &str) -> bool {
        let before = text.lines().take(mutant.line + 1);
        let heads =
            before.filter(|l| !l.starts_with([' ', '{', '}', '/', '#']) && l.ends_with(')'));
        let head = heads.last().unwrap_or("");
        let name = head
            .split('(')
            .next()
            .unwrap_or("")
            .rsplit(' ')
            .next()
            .unwrap_or("");
        let name = name
            .strip_prefix(&format!("{}_", self.prefix))
            .unwrap_or("");
        self.exhausted.iter().any(|f| f == name)
    }

    /// One run of the harness, its input the vectors of that name.
    pub fn passes(&self, program: &Path, check: &[String]) -> bool {
        let vectors = |name: &str| self.folder.join(format!("vectors/{name}.csv"));
        let read = |name: &str| std::fs::read(vectors(name)).unwrap_or_default();
        let input = match check {
            [_, name] if name == "chain" => [read("chain_input"), read("chain_output")].concat(),
            [_, name] => read(name),
            _ => Vec::new(),
        };
        let mut child = limited(program, LIMIT_S)
            .args(check)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the harness starts");
        let stdin = child.stdin.take();
        let feeder = std::thread::spawn(move || {
            if let Some(mut stdin) = stdin {
                let _ = std::io::Write::write_all(&mut stdin, &input);
            }
        });
        let passed = child.wait().expect("a child").success();
        let _ = feeder.join();
        passed
    }

    /// The undamaged program.
    pub fn whole(&self) -> PathBuf {
        let program = self.build.join("whole");
        let mut link = cc();
        link.args(self.names.iter().map(|n| self.object(n)))
            .arg("-o")
            .arg(&program);
        assert!(link.status().expect("a C compiler").success());
        program
    }

    pub fn checks(&self) -> &[Vec<String>] {
        &self.checks
    }
}
