//! Asks a model checker of C (esbmc) whether a damaged function computes what the undamaged one does: the same
//! outputs and state, for every input and every state that the bundle says are possible (the ranges in its comments,
//! which gyrogen proves when it emits).
//!
//! `GYROGEN_ESBMC` names the program (else `esbmc` of the PATH). Without one nothing is proved.

use super::limited::limited;
use super::slice;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Seconds of processor time after which a question counts as not answered.
const LIMIT_S: u32 = 20;
/// The same of the smaller questions.
const SLICE_LIMIT_S: u32 = 4;
/// Memory after which it does.
const LIMIT_MIB: u32 = 3000;

/// What the model checker says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Proved: the same outputs, state and fault.
    Equal,
    /// They differ at these words.
    Differs(String),
    /// No answer in time, or the question could not be put.
    Unknown,
}

/// A model checker that answers.
#[derive(Clone, Debug)]
pub struct Prover {
    program: PathBuf,
}

/// A function as its head says.
#[derive(Debug)]
pub struct Signature {
    result: String,
    name: String,
    /// Type, whether it is a pointer, name.
    pub parameters: Vec<(String, bool, String)>,
}

/// A scalar inside a value: its place, and its range where one is declared.
struct Leaf {
    place: String,
    range: Option<(String, String)>,
}

impl Prover {
    /// The one that is installed, if any.
    pub fn find() -> Option<Self> {
        let program = std::env::var_os("GYROGEN_ESBMC").unwrap_or_else(|| "esbmc".into());
        let prover = Prover {
            program: program.into(),
        };
        let mut version = Command::new(&prover.program);
        version
            .arg("--version")
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        version.status().ok()?.success().then_some(prover)
    }

    /// Compares the functions that a damaged line of a bundle's source is in or is used by.
    ///
    /// `place`: a folder for the question; `damaged`: the whole text of the file, with the damage in that line.
    pub fn compare(
        &self,
        place: &Path,
        bundle: &Path,
        prefix: &str,
        (file, line): (&str, usize),
        damaged: &str,
    ) -> Answer {
        let read = |part: &str| {
            std::fs::read_to_string(bundle.join(format!("{prefix}{part}"))).expect("a source")
        };
        let (main, header, arith) = (read(".c"), read(".h"), read("_arith.h"));
        let is_helper = file.ends_with("_arith.h");
        for part in [".c", ".h", "_arith.h", "_tables.c", "_tables.h"] {
            let name = format!("{prefix}{part}");
            let (original, other) = (
                read(part),
                if name == file {
                    damaged.to_owned()
                } else {
                    read(part)
                },
            );
            let [original, other] =
                [original, other].map(|t| if is_helper { t } else { plain_shifts(&t) });
            std::fs::write(place.join(&name), original).expect("written");
            std::fs::write(place.join(format!("mutant{part}")), renamed(&other, prefix))
                .expect("written");
        }
        let original = std::fs::read_to_string(bundle.join(file)).expect("a source");
        let name = enclosing(&original, line);
        let declared = [header.as_str(), &main, &arith].concat();
        if file.ends_with(".c") && !file.ends_with("_tables.c") {
            let Some(signature) = name.and_then(|name| signature(&main, &name)) else {
                return Answer::Unknown;
            };
            let lines: Vec<&str> = original.lines().collect();
            let start = lines[..line].iter().rposition(|l| *l == "{");
            let end = lines.iter().skip(line).position(|l| *l == "}");
            if let (Some(start), Some(end)) = (start, end) {
                let body = &lines[start + 1..line + end];
                let changed = damaged.lines().nth(line).unwrap_or("");
                let of = (prefix, declared.as_str());
                for question in slice::questions(of, &signature, body, line - start - 1, changed) {
                    std::fs::write(place.join("question.c"), question).expect("written");
                    if self.answer(place, SLICE_LIMIT_S) == Answer::Equal {
                        return Answer::Equal;
                    }
                }
            }
            return self.ask(place, prefix, &declared, &signature);
        }
        // A helper is the same for all words, or in all functions that use it.
        let helper = name
            .filter(|_| file.ends_with(".h"))
            .and_then(|name| signature(&arith, &name));
        if let Some(helper) = helper
            && self.ask(place, prefix, &declared, &helper) == Answer::Equal
        {
            return Answer::Equal;
        }
        for head in heads(&main) {
            let Some(signature) = signature(&main, &name_of(&head)) else {
                return Answer::Unknown;
            };
            match self.ask(place, prefix, &declared, &signature) {
                Answer::Equal => {}
                other => return other,
            }
        }
        Answer::Equal
    }

    /// Puts the question of one function.
    fn ask(&self, place: &Path, prefix: &str, declared: &str, signature: &Signature) -> Answer {
        let text = question(prefix, declared, signature);
        std::fs::write(place.join("question.c"), text).expect("written");
        self.answer(place, LIMIT_S)
    }

    fn answer(&self, place: &Path, limit_s: u32) -> Answer {
        let mut command = limited(&self.program, limit_s);
        command.current_dir(place).arg("question.c");
        command.args(["-I", ".", "--overflow-check", "--ub-shift-check"]);
        command.args(["--memlimit", &format!("{LIMIT_MIB}m")]);
        let output = command
            .stdin(Stdio::null())
            .output()
            .expect("the model checker starts");
        let text = [output.stdout, output.stderr].concat();
        let text = String::from_utf8_lossy(&text);
        if text.contains("VERIFICATION SUCCESSFUL") {
            Answer::Equal
        } else if text.contains("VERIFICATION FAILED") {
            Answer::Differs(words(&text))
        } else {
            Answer::Unknown
        }
    }
}

/// A source in which the helpers of arithmetic shifts are the machine's own shift, about which questions are easier.
/// That they are the same is proved by [`Prover::shifts_are_plain`].
pub fn plain_shifts(text: &str) -> String {
    let mut lines = Vec::new();
    let mut is_shift = false;
    for line in text.lines() {
        match line {
            "{" if is_shift => lines.push("{ return a >> n; }"),
            "}" if is_shift => is_shift = false,
            _ if is_shift => {}
            _ => {
                is_shift = line.starts_with("static inline int") && line.contains("_asr_");
                lines.push(line);
            }
        }
    }
    lines.join("\n") + "\n"
}

/// A source with every name of the bundle replaced.
fn renamed(text: &str, prefix: &str) -> String {
    text.replace(&format!("{prefix}_"), "mutant_")
        .replace(&format!("{}_", prefix.to_uppercase()), "MUTANT_")
        .replace(&format!("\"{prefix}."), "\"mutant.")
}

/// Heads of the functions that a source defines.
fn heads(text: &str) -> Vec<String> {
    let lines: Vec<&str> = text.lines().collect();
    let mut all = Vec::new();
    for (k, _) in lines.iter().enumerate().filter(|(_, line)| **line == "{") {
        let start = (0..k)
            .rev()
            .find(|i| !lines[*i].starts_with(' '))
            .unwrap_or(0);
        all.push(
            lines[start..k]
                .iter()
                .map(|line| line.trim())
                .collect::<Vec<_>>()
                .join(" "),
        );
    }
    all
}

fn name_of(head: &str) -> String {
    let before = head.split('(').next().unwrap_or("");
    before.rsplit([' ', '*']).next().unwrap_or("").to_owned()
}

/// The function that a line of a source is in.
fn enclosing(text: &str, line: usize) -> Option<String> {
    let before: Vec<&str> = text.lines().take(line + 1).collect();
    if before.last()?.starts_with(|c: char| !c.is_whitespace()) {
        return None;
    }
    heads(&before.join("\n")).last().map(|head| name_of(head))
}

fn signature(text: &str, name: &str) -> Option<Signature> {
    let head = heads(text).into_iter().find(|head| name_of(head) == name)?;
    let (before, after) = head.split_once('(')?;
    let result = before.strip_suffix(name)?.trim();
    let result = result
        .trim_start_matches("static ")
        .trim_start_matches("inline ");
    let parameter = |text: &str| -> Option<(String, bool, String)> {
        let (ty, name) = text.trim().rsplit_once([' ', '*'])?;
        let is_pointer = text.contains('*');
        let ty = ty
            .replace('*', "")
            .trim()
            .trim_start_matches("const ")
            .to_owned();
        Some((ty, is_pointer, name.to_owned()))
    };
    let list = after.trim_end_matches(')');
    let parameters = list.split(',').filter(|p| *p != "void").map(parameter);
    Some(Signature {
        result: result.to_owned(),
        name: name.to_owned(),
        parameters: parameters.collect::<Option<_>>()?,
    })
}

/// The scalars inside a value of a type.
fn leaves(declared: &str, ty: &str, place: &str) -> Vec<Leaf> {
    let end = declared.find(&format!("}} {ty};\n"));
    let Some((end, start)) =
        end.and_then(|end| Some((end, declared[..end].rfind("typedef struct")?)))
    else {
        let (place, range) = (place.to_owned(), None);
        return vec![Leaf { place, range }];
    };
    let mut all = Vec::new();
    for line in declared[start..end].lines().skip(1) {
        let (member, comment) = line.split_once(';').expect("a member");
        let (ty, name) = member.trim().rsplit_once(' ').expect("a type and a name");
        let (name, count) = match name.split_once('[') {
            Some((name, count)) => (name, count.trim_end_matches(']').parse::<usize>().ok()),
            None => (name, None),
        };
        let places = match count {
            Some(count) => (0..count).map(|k| format!("{place}.{name}[{k}]")).collect(),
            None => vec![format!("{place}.{name}")],
        };
        for place in places {
            let mut inside = leaves(declared, ty, &place);
            if let [leaf] = &mut inside[..]
                && leaf.place == place
            {
                leaf.range = range(comment);
            }
            all.extend(inside);
        }
    }
    all
}

/// `low .. high` of a comment.
pub fn range(comment: &str) -> Option<(String, String)> {
    let (before, after) = comment.split_once(" .. ")?;
    let is_number = |text: &&str| {
        text.trim_start_matches('-')
            .bytes()
            .all(|b| b.is_ascii_digit())
    };
    let low = before.rsplit(' ').next().filter(is_number)?;
    let high = after.split([' ', ';']).next().filter(is_number)?;
    Some((constant(low)?, constant(high)?))
}

/// A number of at most 64 bits as an expression.
fn constant(number: &str) -> Option<String> {
    let value: i128 = number.parse().ok()?;
    if value == i128::from(i64::MIN) {
        return Some("(-9223372036854775807LL - 1)".to_owned());
    }
    if let Ok(value) = i64::try_from(value) {
        return Some(format!("({value}LL)"));
    }
    u64::try_from(value)
        .ok()
        .map(|value| format!("({value}ULL)"))
}

/// The ranges that a function's comment declares of the inputs that it does not limit for itself.
pub fn input_range(
    declared: &str,
    prefix: &str,
    signature: &Signature,
    name: &str,
) -> Option<(String, String)> {
    let short = signature.name.strip_prefix(&format!("{prefix}_"))?;
    let start = declared.find(&format!("/* {short}\n"))?;
    let comment = declared[start..].split("*/").next()?;
    let mark = format!(" *   in  {name}: ");
    let line = comment.lines().find_map(|line| line.strip_prefix(&mark))?;
    range(&format!(" {line}"))
}

/// A program of which every assertion holds just if the two functions do the same.
fn question(prefix: &str, declared: &str, signature: &Signature) -> String {
    let renamed = |text: &str| renamed(text, prefix);
    // Where it is defined, and not where it is declared or called.
    let is_definition = |rest: &&str| {
        let head = rest.split_once(')');
        head.is_some_and(|(_, after)| after.starts_with("\n{"))
    };
    let mention = format!("{}(", signature.name);
    let mut mentions = declared.split(&mention).skip(1);
    let body = mentions.find(is_definition).unwrap_or("");
    let body = body.split("\n}").next().unwrap_or("");
    let (mut before, mut after, mut arguments) =
        (String::new(), String::new(), [Vec::new(), Vec::new()]);
    let mut nondeterminate = String::new();
    let assumed = |place: &str, (low, high): &(String, String)| {
        format!("    __ESBMC_assume({place} >= {low} && {place} <= {high});\n")
    };
    for (k, (ty, is_pointer, name)) in signature.parameters.iter().enumerate() {
        nondeterminate += &format!("{ty} nondet_{k}(void);\n");
        before += &format!(
            "    {ty} word_{k} = nondet_{k}();\n    {} other_{k};\n",
            renamed(ty)
        );
        for leaf in leaves(declared, ty, &format!("word_{k}")) {
            let other = leaf.place.replacen("word", "other", 1);
            let place = &leaf.place;
            before += &format!("    {other} = {place};\n");
            let guarded = body.contains(&format!(" {name}_in_range = "));
            let range = match is_pointer {
                true => leaf.range.clone(),
                false if guarded => None,
                false => input_range(declared, prefix, signature, name),
            };
            if let Some(range) = &range {
                before += &assumed(place, range);
            }
            if *is_pointer {
                after += &format!("    __ESBMC_assert({place} == {other}, \"state\");\n");
            }
        }
        let address = if *is_pointer { "&" } else { "" };
        arguments[0].push(format!("{address}word_{k}"));
        arguments[1].push(format!("{address}other_{k}"));
    }
    let [words, others] = arguments.map(|a| a.join(", "));
    let (name, result) = (&signature.name, &signature.result);
    let mut calls = format!("    {name}({words});\n    {}({others});\n", renamed(name));
    if result != "void" {
        calls = format!(
            "    {result} word = {name}({words});\n    {} other = {}({others});\n",
            renamed(result),
            renamed(name)
        );
        for leaf in leaves(declared, result, "word") {
            let other = leaf.place.replacen("word", "other", 1);
            after += &format!(
                "    __ESBMC_assert({} == {other}, \"result\");\n",
                leaf.place
            );
        }
    }
    format!(
        "#include \"{prefix}_tables.c\"\n#include \"{prefix}.c\"\n#include \"mutant_tables.c\"\n#include \"mutant.c\"\n\
         {nondeterminate}int main(void)\n{{\n{before}{calls}{after}    return 0;\n}}\n"
    )
}

/// The words that are put in, of a counter-example.
fn words(text: &str) -> String {
    let lines = text.lines().map(str::trim);
    let given = lines.filter(|line| {
        line.starts_with("word_") && line.contains(" = ")
            || line.starts_with("Violated")
            || line.starts_with("(_Bool)")
    });
    let short = given.map(|line| {
        line.split(" (0")
            .next()
            .unwrap_or(line)
            .split(" (1")
            .next()
            .unwrap_or(line)
    });
    short.collect::<Vec<_>>().join("; ")
}
