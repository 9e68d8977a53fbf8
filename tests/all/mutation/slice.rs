//! Smaller questions about a damaged line than whether its whole function is the same: whether all that is read of it
//! further down is the same, for every word of the operands. Where that is proved, the function is the same.
//!
//! An operand is any word of the range that its comment declares (gyrogen proves it when it emits), or is computed as
//! the function does, so many operations deep.

use super::prover::{Signature, input_range, range};
use std::collections::{BTreeMap, BTreeSet};

/// A line of a function.
struct Line<'a> {
    text: &'a str,
    /// What it defines.
    definition: Option<Definition<'a>>,
}

struct Definition<'a> {
    ty: &'a str,
    name: &'a str,
    expression: &'a str,
    range: Option<(String, String)>,
    /// It can be computed in the question: no call, no state.
    is_plain: bool,
}

/// Steps below the damaged line at which all that is read further down is compared.
const STEPS: [usize; 4] = [0, 1, 3, usize::MAX];
/// Operations above the damaged line, and beside it, that are computed.
const DEPTHS: [usize; 3] = [0, 2, usize::MAX];

/// The questions about a line of a function, the smallest first; none where the line defines no word.
///
/// `body`: the function's lines after its `{`; `at`: the damaged one; `damaged`: its text.
pub fn questions(
    (prefix, declared): (&str, &str),
    signature: &Signature,
    body: &[&str],
    at: usize,
    damaged: &str,
) -> Vec<String> {
    let lines: Vec<Line> = body.iter().map(|text| line(text)).collect();
    let (Some(original), Some(other)) = (&lines[at].definition, line(damaged).definition) else {
        return Vec::new();
    };
    if !original.is_plain || !other.is_plain || original.name != other.name {
        return Vec::new();
    }
    // What depends on the damaged word.
    let mut cone = vec![at];
    let mut names = BTreeSet::from([original.name]);
    for (k, line) in lines.iter().enumerate().skip(at + 1) {
        if let Some(definition) = line.definition.as_ref().filter(|d| d.is_plain)
            && words(definition.expression).any(|word| names.contains(word))
        {
            cone.push(k);
            names.insert(definition.name);
        }
    }
    let slice = Slice {
        prefix,
        declared,
        signature,
        lines: &lines,
        cone: &cone,
    };
    let mut all: Vec<String> = Vec::new();
    for depth in DEPTHS {
        for step in STEPS {
            all.extend(slice.question(step.min(cone.len() - 1), depth, &other));
        }
    }
    let mut seen = BTreeSet::new();
    all.retain(|question| seen.insert(question.clone()));
    all
}

struct Slice<'a> {
    prefix: &'a str,
    declared: &'a str,
    signature: &'a Signature,
    lines: &'a [Line<'a>],
    cone: &'a [usize],
}

impl<'a> Slice<'a> {
    fn definition(&self, k: usize) -> &Definition<'a> {
        self.lines[k].definition.as_ref().expect("a definition")
    }

    /// Are all words the same that lines below read, after so many steps? None where nothing is read, or a structure.
    fn question(&self, step: usize, depth: usize, damaged: &Definition) -> Option<String> {
        let cone = &self.cone[..=step];
        let last = cone[step];
        let inside: BTreeSet<&str> = cone.iter().map(|k| self.definition(*k).name).collect();
        // Lines that read without being followed: all below, and before them assignments and calls.
        let outside = (cone[0]..self.lines.len()).filter(|k| *k > last || !cone.contains(k));
        let read: BTreeSet<&str> = outside.flat_map(|k| words(self.lines[k].text)).collect();
        let compared: Vec<&Definition> = cone
            .iter()
            .map(|k| self.definition(*k))
            .filter(|definition| read.contains(definition.name))
            .collect();
        if compared.is_empty() || compared.iter().any(|d| !is_scalar(d.ty)) {
            return None;
        }
        let mut needed = BTreeMap::new();
        let expressions = cone.iter().map(|k| self.definition(*k).expression);
        for word in expressions.chain([damaged.expression]).flat_map(words) {
            if !inside.contains(word) {
                self.need(word, last, depth, &mut needed);
            }
        }
        Some(self.text(cone, &inside, &needed, &compared, damaged))
    }

    /// Notes an operand: its line (none: a parameter), and how deep it is computed.
    fn need(
        &self,
        word: &'a str,
        before: usize,
        depth: usize,
        needed: &mut BTreeMap<&'a str, (Option<usize>, bool, usize)>,
    ) {
        let is_defined = |line: &Line| line.definition.as_ref().is_some_and(|d| d.name == word);
        let place = self.lines[..before].iter().position(is_defined);
        let is_parameter = self
            .signature
            .parameters
            .iter()
            .any(|(.., name)| name == word);
        if place.is_none() && !is_parameter {
            return;
        }
        let definition = place.map(|k| self.definition(k)).filter(|d| d.is_plain);
        let computed = definition.filter(|d| d.range.is_none() || depth > 0);
        if let Some((_, known, deep)) = needed.get(word)
            && (*known, *deep) >= (computed.is_some(), depth)
        {
            return;
        }
        needed.insert(word, (place, computed.is_some(), depth));
        if let Some(definition) = computed {
            let left = match definition.range {
                Some(_) => depth - 1,
                None => depth,
            };
            for word in words(definition.expression) {
                self.need(word, before, left, needed);
            }
        }
    }

    fn text(
        &self,
        cone: &[usize],
        inside: &BTreeSet<&str>,
        needed: &BTreeMap<&str, (Option<usize>, bool, usize)>,
        compared: &[&Definition],
        damaged: &Definition,
    ) -> String {
        let (mut heads, mut text) = (String::new(), String::new());
        let assume = |name: &str, range: &Option<(String, String)>| match range {
            Some((low, high)) => {
                format!("    __ESBMC_assume({name} >= {low} && {name} <= {high});\n")
            }
            None => String::new(),
        };
        let mut free = |ty: &str, name: &str, range: &Option<(String, String)>| {
            heads += &format!("{ty} nondet_{name}(void);\n");
            format!("    const {ty} {name} = nondet_{name}();\n") + &assume(name, range)
        };
        for (ty, is_pointer, name) in &self.signature.parameters {
            if needed.contains_key(name.as_str()) && !is_pointer {
                let mark = format!("{name}_in_range");
                let is_guarded = self
                    .lines
                    .iter()
                    .any(|line| words(line.text).any(|w| w == mark));
                let range = match is_guarded {
                    true => None,
                    false => input_range(self.declared, self.prefix, self.signature, name),
                };
                text += &free(ty, name, &range);
            }
        }
        let mut lines: BTreeMap<usize, bool> = needed
            .values()
            .filter_map(|(place, computed, _)| place.map(|k| (k, *computed)))
            .collect();
        lines.extend(cone.iter().map(|k| (*k, true)));
        for (k, computed) in lines {
            let Definition {
                ty,
                name,
                expression,
                range,
                ..
            } = self.definition(k);
            match computed {
                true => {
                    text += &format!("    const {ty} {name} = {expression};\n");
                    text += &assume(name, range);
                }
                false => text += &free(ty, name, range),
            }
        }
        for k in cone {
            let definition = self.definition(*k);
            let expression = match *k == cone[0] {
                true => damaged.expression,
                false => definition.expression,
            };
            let expression = renamed(expression, inside);
            let (ty, name) = (definition.ty, definition.name);
            text += &format!("    const {ty} {name}_other = {expression};\n");
        }
        for definition in compared {
            let name = definition.name;
            text += &format!("    __ESBMC_assert({name} == {name}_other, \"{name}\");\n");
        }
        let prefix = self.prefix;
        format!(
            "#include \"{prefix}_tables.c\"\n#include \"{prefix}.c\"\n{heads}int main(void)\n{{\n{text}    return 0;\n}}\n"
        )
    }
}

fn line(text: &str) -> Line<'_> {
    Line {
        text,
        definition: definition(text),
    }
}

/// Of a line `    const type name = expression; /* range */`, outside of loops.
fn definition(text: &str) -> Option<Definition<'_>> {
    let (code, comment) = text.split_once(';')?;
    let code = code
        .strip_prefix("    ")
        .filter(|code| !code.starts_with(' '))?;
    let (left, expression) = code.split_once(" = ")?;
    let constant = left.strip_prefix("const ");
    let (ty, name) = constant.unwrap_or(left).split_once(' ')?;
    let has_state = words(expression).any(|word| word == "s" || word == "fault");
    let calls = expression.contains("()");
    Some(Definition {
        ty,
        name,
        expression,
        range: range(comment),
        is_plain: constant.is_some() && !has_state && !calls && !expression.contains('.'),
    })
}

fn is_scalar(ty: &str) -> bool {
    ty == "bool" || ty.starts_with("int") || ty.starts_with("uint")
}

/// The names and numbers of an expression.
fn words(text: &str) -> impl Iterator<Item = &str> {
    let parts = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    parts.filter(|word| !word.is_empty())
}

fn renamed(expression: &str, inside: &BTreeSet<&str>) -> String {
    let is_letter = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut text = String::new();
    let mut rest = expression;
    while let Some(first) = rest.chars().next() {
        let end = match is_letter(first) {
            true => rest.find(|c| !is_letter(c)).unwrap_or(rest.len()),
            false => first.len_utf8(),
        };
        let (word, after) = rest.split_at(end);
        text += word;
        if inside.contains(word) {
            text += "_other";
        }
        rest = after;
    }
    text
}
