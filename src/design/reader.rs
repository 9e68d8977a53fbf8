//! From a design file to a checked [`Design`], with the place of every mistake.

use super::table::{Doc, Table};
use super::{
    bound, circuit_tables, correction_table, device_tables, limits, record_table, study_tables,
    template, user_effects,
};
use crate::base_name::name_of;
use crate::design::schema::*;
use crate::digest::sha256;
use crate::error::{Error, InputError, Result};
use crate::input;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Reads a design file; `None` is the embedded default.
pub fn read(path: Option<&Path>) -> Result<Design> {
    let Some(path) = path else {
        return template::default_design();
    };
    let bytes = input::text_bytes(
        input::open(path, "design")?,
        path,
        "design",
        input::MOST_OF_A_DESIGN,
    )?;
    match String::from_utf8(bytes) {
        Ok(text) => parse(&text, Some(path)),
        Err(e) => {
            let valid = e.utf8_error().valid_up_to();
            let bytes = e.as_bytes();
            let start = String::from_utf8_lossy(&bytes[..valid]);
            let utf16 = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
            let what = match utf16 {
                true => "the file is UTF-16, and a design is UTF-8".to_owned(),
                false => format!("the byte 0x{:02x} is not UTF-8 text", bytes[valid]),
            };
            Err(InputError::new(what)
                .in_file(path)
                .at_offset(&start, valid)
                .help("save the file as UTF-8 text")
                .into())
        }
    }
}

/// Reads a design's text; `file` is only named. What the text leaves out is the default design's.
pub fn parse(text: &str, file: Option<&Path>) -> Result<Design> {
    build(text, file, Some(&template::default_design()?))
}

/// Reads the default design's text, which leaves nothing out.
pub(super) fn parse_default(text: &str) -> Result<Design> {
    build(text, None, None)
}

fn build(text: &str, file: Option<&Path>, base: Option<&Design>) -> Result<Design> {
    let doc = Doc {
        text: text.strip_prefix('\u{feff}').unwrap_or(text),
        file,
    };
    let parsed = DeTable::parse(doc.text).map_err(|e| syntax(&doc, &e))?;
    let root = Table::root(&doc, parsed.get_ref())?;

    let name = root.take("name", base.map(|b| b.name.clone()), device_tables::name)?;
    let given = root.section("circuit")?;
    let circuit = match base {
        Some(base) if !given.is_given() => base.circuit.clone(),
        _ => circuit_tables::circuit(&root.need_section("circuit")?)?,
    };
    let own = root.section("compensation")?;
    let asked = bound::only_asks(&own);
    let compensation = if own.is_given() && !asked {
        Some(circuit_tables::compensation(&own, &circuit)?)
    } else if given.is_given() {
        None
    } else {
        base.and_then(|b| b.compensation.clone())
    };
    // The embedded default's formats are nobody's choice, even where a file repeats them, as that of `init` does.
    let differs = base.is_some_and(|b| b.compensation != compensation);
    let compensation_is_own = own.is_given() && !asked && differs;
    let section = |key| root.section(key);
    let planned = section("correction")?;
    let correction = planned
        .is_given()
        .then(|| correction_table::correction(&planned))
        .transpose()?;
    let design = Design {
        name,
        circuit,
        compensation,
        correction,
        bound: bound::bound(&own)?,
        compensation_is_own,
        gyro: device_tables::gyro(&section("gyro")?, base.map(|b| &b.gyro))?,
        thermal_run: device_tables::thermal_run(
            &section("thermal_run")?,
            base.map(|b| &b.thermal_run),
        )?,
        record: record_table::record(&section("record")?, base.map(|b| &b.record))?,
        fit: device_tables::fit(&section("fit")?, base.map(|b| &b.fit))?,
        study: study_tables::study(&section("study")?)?,
        requirements: study_tables::requirements(&section("requirements")?)?,
        effects: match root.get("effects") {
            Some(value) => user_effects::effects(&doc, &value)?,
            None => Vec::new(),
        },
        source: Source {
            path: file.map(Path::to_path_buf),
            text: text.to_owned(),
            sha256: sha256(text.as_bytes()),
        },
    };
    limits::check(&design).map_err(|excess| {
        doc.error(
            locate(parsed.get_ref(), excess.key),
            format!("`{}` {excess}", excess.key),
        )
        .help(excess.remedy())
    })?;
    Ok(design)
}

impl Design {
    /// An error at the place of a dotted key in the design's text (of its table, where the key is left out).
    pub fn error_at(&self, key: &str, message: impl Into<String>) -> InputError {
        let text = &self.source.text;
        let doc = Doc {
            text: text.strip_prefix('\u{feff}').unwrap_or(text),
            file: self.source.path.as_deref(),
        };
        // A design has been read from this text.
        let offset = DeTable::parse(doc.text).map_or(0, |root| locate(root.get_ref(), key));
        doc.error(offset, message)
    }

    /// The place of a dotted key as words, with the file's base name: `design.toml, line 63`.
    pub fn place_of(&self, key: &str) -> String {
        let place = self.error_at(key, "").position();
        let file = place.file.as_deref();
        let file = file.map_or("the embedded default design".to_owned(), name_of);
        format!("{file}, line {}", place.line.unwrap_or(1))
    }
}

/// The byte offset of a dotted key's value, or of the innermost table on the way that is there.
fn locate(root: &DeTable, key: &str) -> usize {
    let (mut offset, mut here) = (0, Some(root));
    for part in key.split('.') {
        let Some(value): Option<&Spanned<DeValue>> = here.and_then(|t| t.get(part)) else {
            break;
        };
        offset = value.span().start;
        here = value.get_ref().as_table();
    }
    offset
}

/// A text that is no TOML.
fn syntax(doc: &Doc, e: &toml::de::Error) -> Error {
    let said = e.message();
    let help = if said.contains("duplicate key") {
        "a table has each key once, and a file each table once: delete or merge one of the two"
    } else if said.contains("invalid basic string") {
        "close the text with a double quote, as in `table = \"Q1.15\"`"
    } else if said.contains("between digits") {
        "a `_` may stand between two digits only: write the number without it"
    } else if said.contains("string") {
        "put a text in double quotes, as in `table = \"Q1.15\"`"
    } else if said.contains("newline") {
        "write one `key = value` in a line"
    } else if said.contains("leading zero") {
        "write the number without leading zeros"
    } else if said.contains("radix") {
        "write a negative number in decimal"
    } else if said.contains("extend") {
        "give all keys of a table in one place"
    } else if said.contains("recurs") {
        "a design nests tables at most three deep"
    } else {
        "write `key = value` in a line of its own, `[table]` before the keys of a table"
    };
    let offset = e.span().map_or(0, |span| span.start);
    let bracket = ["unclosed", "between array elements"];
    let open = bracket.iter().any(|word| said.contains(word));
    let help = open_header(doc.text, offset)
        .or_else(|| no_equals(doc.text, offset).filter(|_| said.contains("key with no value")))
        .or_else(|| {
            let text = Some(doc.text).filter(|_| !said.contains("string"))?;
            odd_quotes(text, offset)
        })
        .or_else(|| open.then(|| open_bracket(doc.text, offset)).flatten())
        .or_else(|| of_value(doc.text, offset))
        .unwrap_or(help.to_owned());
    doc.error(offset, format!("this is not TOML: {said}"))
        .help(help)
        .into()
}

/// What to ask where the line of a mistake has an odd number of quotes, with and without what looks like its comment.
fn odd_quotes(text: &str, offset: usize) -> Option<String> {
    let start = text.get(..offset)?.rfind('\n').map_or(0, |p| p + 1);
    let line = text.get(start..)?.lines().next()?;
    let is_odd = |part: &str| part.replace("\\\"", "").matches('"').count() % 2 == 1;
    let odd = is_odd(line) && line.split('#').next().is_some_and(is_odd);
    // Three quotes begin a text of several lines.
    (odd && !line.contains("\"\"\"")).then(|| {
        let before = match line.contains(',') {
            true => " before the comma",
            false => "",
        };
        format!("is a quote missing{before} in this line? It has an odd number of them")
    })
}

/// What to do about a table's header that is not closed in the line of a mistake.
fn open_header(text: &str, offset: usize) -> Option<String> {
    let start = text.get(..offset)?.rfind('\n').map_or(0, |p| p + 1);
    let line = text.get(start..)?.lines().next()?;
    let written = line.split('#').next()?.trim();
    let name = written.trim_matches(['[', ']']);
    let name = name.split_whitespace().collect::<Vec<_>>().join(".");
    let is_name = |part: &str| {
        let part = part.trim();
        let is_bare = |c: char| c.is_ascii_alphanumeric() || "_-".contains(c);
        part.starts_with(|c: char| c.is_ascii_alphabetic()) && part.chars().all(is_bare)
    };
    let is_array = name == "effects";
    let header = if is_array {
        format!("[[{name}]]")
    } else {
        format!("[{name}]")
    };
    let is_header = written.starts_with('[') && name.split('.').all(is_name) && written != header;
    // Between the brackets of an array's value such a line is an element.
    (is_header && unclosed(text.get(..start)?).is_none())
        .then(|| format!("write the table's header in this line as `{header}`"))
}

/// What to write in the line of a mistake that has a key and a value and no `=`.
fn no_equals(text: &str, offset: usize) -> Option<String> {
    let start = text.get(..offset)?.rfind('\n').map_or(0, |p| p + 1);
    let line = text.get(start..)?.lines().next()?.split('#').next()?.trim();
    let (key, value) = line.split_once(|c: char| c.is_whitespace() || c == ':')?;
    let value = value.trim_start_matches([':', ' ']);
    (!value.is_empty() && !key.is_empty())
        .then(|| format!("a key and its value have `=` between them: `{key} = {value}`"))
}

/// The last `key = [` or `key = {` of a text whose value the text does not close: where its `=` is, and what closes it.
/// Brackets in texts and comments count as brackets: what is given is a remedy, no judgement.
fn unclosed(before: &str) -> Option<(usize, char)> {
    before.rmatch_indices('=').find_map(|(at, _)| {
        let value = before[at + 1..].trim_start();
        let (open, close) = match value.chars().next()? {
            '[' => ('[', ']'),
            '{' => ('{', '}'),
            _ => return None,
        };
        let is_open = value.matches(open).count() > value.matches(close).count();
        is_open.then_some((at, close))
    })
}

/// What to do about a value in brackets that is open at a mistake.
fn open_bracket(text: &str, offset: usize) -> Option<String> {
    let before = text.get(..offset)?;
    let (equals, close) = unclosed(before)?;
    let line = before[..equals].matches('\n').count() + 1;
    let key = before[..equals].lines().last().unwrap_or("").trim();
    Some(match text[offset..].trim().is_empty() {
        true => format!(
            "the file ends inside the value of `{key}` that line {line} begins: write its `{close}`, or, if a copy of the file was cut \
             short, copy it again"
        ),
        false => format!(
            "the value of `{key}` that line {line} begins is still open here: write its `{close}`, and a comma between two elements"
        ),
    })
}

/// What to write instead of the value in the line of a mistake: a decimal comma, several numbers, a number with its unit, a text
/// without quotes.
fn of_value(text: &str, offset: usize) -> Option<String> {
    let start = text.get(..offset)?.rfind('\n').map_or(0, |p| p + 1);
    let (key, value) = text.get(start..)?.lines().next()?.split_once('=')?;
    if offset < start + key.len() {
        return None;
    }
    let (key, value) = (key.trim(), value.split('#').next()?.trim());
    let is_digits = |t: &str| !t.is_empty() && t.bytes().all(|b| b.is_ascii_digit());
    let unsigned = value.trim_start_matches(['-', '+']);
    if let Some((whole, rest)) = unsigned.split_once(',')
        && is_digits(whole)
        && is_digits(rest)
    {
        let value = value.replacen(',', ".", 1);
        return Some(format!(
            "write the decimal mark as a point: `{key} = {value}`"
        ));
    }
    if let Some(help) = of_numbers(key, value) {
        return Some(help);
    }
    if let Some((number, unit)) = value.split_once(' ')
        && number.parse::<f64>().is_ok_and(f64::is_finite)
        && !unit.contains(['"', '\'', '='])
    {
        return Some(format!(
            "give the number alone, the key's name has the unit: `{key} = {number}`"
        ));
    }
    let is_text = value.starts_with(|c: char| c.is_ascii_alphabetic())
        && value
            .chars()
            .all(|c| c.is_alphanumeric() || "_-. ".contains(c));
    let is_truth = ["true", "false"].contains(&value.to_lowercase().as_str());
    (is_text && !is_truth).then(|| format!("put the text in double quotes: `{key} = \"{value}\"`"))
}

/// What to write instead of numbers in a row, `None` for any other value: one of them; all as one, where blanks part its digits by the
/// thousand; or a list.
fn of_numbers(key: &str, value: &str) -> Option<String> {
    let numbers: Vec<&str> = value.split_whitespace().collect();
    let [first, others @ ..] = numbers.as_slice() else {
        return None;
    };
    let is_number = |word: &&str| word.parse::<f64>().is_ok_and(f64::is_finite);
    if others.is_empty() || !numbers.iter().all(is_number) {
        return None;
    }
    let is_thousands = |word: &&str| word.len() == 3 && word.bytes().all(|b| b.is_ascii_digit());
    let one = match others.len() > 1 && others.iter().all(is_thousands) {
        true => numbers.concat(),
        false => (*first).to_owned(),
    };
    Some(format!(
        "give one number, without a blank in it: `{key} = {one}`. If the key takes several, write them as a list: `{key} = [{}]`",
        numbers.join(", ")
    ))
}

#[cfg(test)]
#[path = "reader_tests.rs"]
mod tests;
