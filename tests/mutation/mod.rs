//! Damages emitted C one token at a time, and asks the bundle's own harness whether it notices.

mod prover;

use prover::{Answer, Prover};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A harness that runs longer has been noticed.
const LIMIT: Duration = Duration::from_secs(30);

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

/// Every mutant of a source: operators, constants by one, comparisons, shifts, entries of tables, lost
/// assignments and calls.
pub fn mutants(file: &str, text: &str) -> Vec<Mutant> {
    let mut all = Vec::new();
    let mut depth = 0;
    for (line, whole) in text.lines().enumerate() {
        let inside = depth > 0;
        let code = whole.split("/*").next().unwrap_or("");
        depth += code.matches('{').count();
        depth -= code.matches('}').count();
        if !inside || whole.starts_with(" *") || code.trim().is_empty() {
            continue;
        }
        let rest = &whole[code.len()..];
        all.extend(of_line(code).into_iter().map(|after| Mutant {
            file: file.to_owned(),
            line,
            before: whole.to_owned(),
            after: after + rest,
        }));
    }
    all
}

const OPERATORS: [(&str, &[&str]); 16] = [
    (" + ", &[" - "]),
    (" - ", &[" + "]),
    (" * ", &[" + "]),
    (" & ", &[" | "]),
    (" | ", &[" & "]),
    (" << ", &[" >> "]),
    (" >> ", &[" << "]),
    (" < ", &[" <= ", " >= "]),
    (" > ", &[" >= ", " <= "]),
    (" <= ", &[" < "]),
    (" >= ", &[" > "]),
    (" == ", &[" != "]),
    (" != ", &[" == "]),
    (" && ", &[" || "]),
    (" || ", &[" && "]),
    ("_add(", &["_sub("]),
];

fn of_line(code: &str) -> Vec<String> {
    let mut all = Vec::new();
    let replaced =
        |at: usize, from: usize, to: &str| format!("{}{to}{}", &code[..at], &code[at + from..]);
    for (from, to) in OPERATORS {
        for (at, _) in code.match_indices(from) {
            all.extend(to.iter().map(|to| replaced(at, from.len(), to)));
        }
    }
    for (at, _) in code.match_indices(" ? ") {
        let start = code[..at].rfind("= ").map_or(0, |k| k + 2);
        all.push(format!(
            "{}!({}){}",
            &code[..start],
            &code[start..at],
            &code[at..]
        ));
    }
    for (at, len) in numbers(code) {
        if let Ok(value) = code[at..at + len].parse::<u128>() {
            all.push(replaced(at, len, &(value + 1).to_string()));
            if value > 0 {
                all.push(replaced(at, len, &(value - 1).to_string()));
            }
        }
    }
    let trimmed = code.trim();
    let is_state =
        trimmed.starts_with("s->") || trimmed.starts_with("out.") || trimmed.starts_with("g->");
    let is_carried = trimmed.starts_with('t') && trimmed.contains(" = ");
    let is_call = !trimmed.contains('=')
        && trimmed.contains("_")
        && trimmed.ends_with(");")
        && !trimmed.starts_with("return");
    if let (true, Some((target, _))) = (trimmed.starts_with("out."), trimmed.split_once(" = ")) {
        all.push(format!("    {target} = 0;"));
    } else if (is_state && trimmed.contains(" = ")) || is_carried || is_call {
        all.push(String::new());
    }
    all
}

/// Decimal numbers that stand for themselves: in a constant macro, with a suffix, as an entry or an index.
fn numbers(code: &str) -> Vec<(usize, usize)> {
    let bytes = code.as_bytes();
    let mut all = Vec::new();
    let mut k = 0;
    while k < bytes.len() {
        if !bytes[k].is_ascii_digit() {
            k += 1;
            continue;
        }
        let start = k;
        while k < bytes.len() && bytes[k].is_ascii_digit() {
            k += 1;
        }
        let before = start.checked_sub(1).map_or(b' ', |b| bytes[b]);
        let after = bytes.get(k).copied().unwrap_or(b' ');
        let in_name =
            before.is_ascii_alphabetic() || before == b'_' || after == b'_' || after == b'x';
        // The width of an exact type is in a name; a digit that follows another name is too.
        if !in_name {
            all.push((start, k - start));
        }
    }
    all
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
        let mut command = Command::new("cc");
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
        let mut command = Command::new("cc");
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

    fn fate_in(&self, mutant: &Mutant, place: &Path) -> Fate {
        let text = std::fs::read_to_string(self.folder.join(&mutant.file)).expect("a source");
        let lines = text.lines().enumerate();
        let damaged: Vec<&str> = lines
            .map(|(k, line)| {
                if k == mutant.line {
                    mutant.after.as_str()
                } else {
                    line
                }
            })
            .collect();
        let damaged_text = damaged.join("\n") + "\n";
        std::fs::write(place.join(&mutant.file), &damaged_text).expect("written");
        let is_header = mutant.file.ends_with(".h");
        let main = format!("{}.c", self.prefix);
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
                return Fate::Killed;
            }
        }
        let name = if is_header { &main } else { &mutant.file };
        let source = place.join(name);
        let program = place.join("harness");
        let mut link = Command::new("cc");
        link.args(self.names.iter().map(|n| match damaged.contains(&n) {
            true => object(n),
            false => self.object(n),
        }));
        let linked = link.arg("-o").arg(&program).stderr(Stdio::null()).status();
        if !linked.expect("a C compiler").success() {
            return Fate::Killed;
        }
        if self
            .checks
            .iter()
            .any(|check| !self.passes(&program, check))
        {
            return Fate::Killed;
        }
        if self.is_exhausted(mutant, &text) {
            return Fate::Exhausted;
        }
        let original = self.source(name);
        if self.instructions(&original, &[]) == self.instructions(&source, &[place]) {
            return Fate::SameInstructions;
        }
        match self.proved(mutant, &damaged_text, place) {
            Answer::Equal => Fate::Proved,
            answer => Fate::Alive(answer),
        }
    }

    /// What the model checker says of the mutant.
    fn proved(&self, mutant: &Mutant, damaged: &str, place: &Path) -> Answer {
        let Some(prover) = &self.prover else {
            return Answer::Unknown;
        };
        let question = place.join("question");
        std::fs::create_dir_all(&question).expect("a folder");
        let file = (mutant.file.as_str(), mutant.line);
        prover.compare(&question, &self.folder, &self.prefix, file, damaged)
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
        let mut child = Command::new(program)
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
        let started = Instant::now();
        let passed = loop {
            if let Some(status) = child.try_wait().expect("a child") {
                break status.success();
            }
            if started.elapsed() > LIMIT {
                let _ = child.kill();
                let _ = child.wait();
                break false;
            }
            std::thread::sleep(Duration::from_millis(1));
        };
        let _ = feeder.join();
        passed
    }

    /// The undamaged program.
    pub fn whole(&self) -> PathBuf {
        let program = self.build.join("whole");
        let mut link = Command::new("cc");
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
