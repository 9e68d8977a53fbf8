//! `[[effects]]`: effects that the user suspects, as formulas in a record's columns with named parameters.
//! They are candidates of `gyrogen close`; the simulated gyro's are in [`super::effects`].

use super::effects::EffectKind;
use super::record_columns::is_known;
use super::table::{Doc, Real, Table, Value};
use crate::approx::real::Formula;
use crate::error::{Error, Result};

/// Most effects in a file.
pub const MOST: usize = 32;
/// Most parameters of one that are not amplitudes: their grid is a product.
pub const MOST_SHAPES: usize = 3;
/// Most amplitudes of one.
pub const MOST_AMPLITUDES: usize = 6;

/// An effect of the user's.
#[derive(Debug, Clone, PartialEq)]
pub struct UserEffect {
    /// As it is reported.
    pub id: String,
    /// The formula as it is written, deg/s.
    pub text: String,
    /// The same, read. Its names are parameters and columns of a record.
    pub formula: Formula,
    /// In the file's order.
    pub parameters: Vec<UserParameter>,
    /// What happens, in a sentence; empty: nothing is said.
    pub physics: String,
    /// Whether firmware sees the columns and may subtract it; `None`: decided by the columns.
    pub compensable: Option<bool>,
}

/// A parameter of a user's effect.
#[derive(Debug, Clone, PartialEq)]
pub struct UserParameter {
    /// As in the formula.
    pub name: String,
    /// For readers; may be empty.
    pub unit: String,
    /// `None`: an amplitude, in which the formula is linear. Else where it is looked for.
    pub range: Option<Range>,
}

/// Where a parameter is looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Its least value.
    pub low: f64,
    /// Its greatest value, above the least.
    pub high: f64,
    /// A value that is tried beside the grid.
    pub start: Option<f64>,
}

impl UserEffect {
    /// The columns of a record that it needs, in the formula's order.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        let is_parameter = |name: &str| self.parameters.iter().any(|p| p.name == name);
        let names = self.formula.names().iter().map(String::as_str);
        names.filter(move |name| !is_parameter(name))
    }

    /// Parameters without a range.
    pub fn amplitudes(&self) -> impl Iterator<Item = &UserParameter> {
        self.parameters.iter().filter(|p| p.range.is_none())
    }

    /// Parameters with a range, and the range.
    pub fn shapes(&self) -> impl Iterator<Item = (&UserParameter, Range)> {
        self.parameters.iter().filter_map(|p| Some((p, p.range?)))
    }
}

/// Reads the array `[[effects]]`.
pub(super) fn effects(doc: &Doc, value: &Value) -> Result<Vec<UserEffect>> {
    let tables: Vec<Table> = match value.array("[]") {
        Ok(entries) => entries.iter().map(Value::table).collect::<Result<_>>()?,
        Err(_) => {
            return Err(value
                .error("takes one table for each effect of your own")
                .help(
                    "write their header in double brackets, `[[effects]]`; those of the simulated gyro stand in \
                     `[gyro.effects]`",
                )
                .into());
        }
    };
    if tables.len() > MOST {
        let message = format!("has {} entries; at most {MOST} are tried", tables.len());
        return Err(value.error(message).help("delete some").into());
    }
    let mut out: Vec<UserEffect> = Vec::new();
    for table in &tables {
        let effect = effect(doc, table)?;
        if out.iter().any(|e| e.id == effect.id) {
            let e = table.need("id")?;
            let e = e.error(format!("is `{}`, as that of an effect above", effect.id));
            return Err(e.help("each effect has an id of its own").into());
        }
        out.push(effect);
    }
    Ok(out)
}

const KEYS: [&str; 5] = ["id", "expression", "parameters", "physics", "compensable"];

fn effect(doc: &Doc, table: &Table) -> Result<UserEffect> {
    table.only(&KEYS)?;
    let id = table.need("id")?;
    let name = id.text("the effect's name")?.to_owned();
    check_id(&id, &name)?;
    let expression = table.need("expression")?;
    let text = expression.text("the formula")?;
    let formula = Formula::parse(text).map_err(|e| inside(doc, &expression, text, e))?;
    let parameters = parameters(&table.need("parameters")?)?;
    let physics = table.take("physics", Some(String::new()), |v| {
        Ok(v.text("what happens")?.to_owned())
    })?;
    let compensable = table.take("compensable", Some(None), |v| Ok(Some(v.flag()?)))?;
    let effect = UserEffect {
        id: name,
        text: text.to_owned(),
        formula,
        parameters,
        physics,
        compensable,
    };
    check(doc, table, &expression, &effect)?;
    Ok(effect)
}

/// Refuses an id that is no name or that the catalogue has.
fn check_id(value: &Value, id: &str) -> Result<()> {
    let letters = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let fits = id.starts_with(|c: char| c.is_ascii_lowercase()) && id.chars().all(letters);
    if !fits || id.len() > 48 {
        return Err(value
            .error(format!("is \"{id}\", which is no id"))
            .help("an id has lower-case letters, digits and `_`, begins with a letter and is at most 48 long")
            .into());
    }
    if EffectKind::named(id).is_some() || ["covariate", "outside"].contains(&id) {
        return Err(value
            .error(format!("is `{id}`, which the catalogue has"))
            .help(format!("choose another one, such as `my_{id}`"))
            .into());
    }
    Ok(())
}

fn parameters(value: &Value) -> Result<Vec<UserParameter>> {
    let table = value.table()?;
    let mut out = Vec::new();
    for (name, value) in table.entries() {
        let fits = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !fits {
            return Err(value
                .error("is no name of a parameter")
                .help("a name has letters, digits and `_`, and begins with a letter or `_`")
                .into());
        }
        if is_known(name) {
            return Err(value
                .error(format!("has the name of the column {name}"))
                .help("give the parameter another name")
                .into());
        }
        out.push(parameter(name, &value)?);
    }
    Ok(out)
}

fn parameter(name: &str, value: &Value) -> Result<UserParameter> {
    let table = value.table()?;
    table.only(&["unit", "range", "start"])?;
    let unit = table.take("unit", Some(String::new()), |v| {
        Ok(v.text("the parameter's unit")?.to_owned())
    })?;
    let start = table.take("start", Some(None), |v| {
        Ok(Some(v.real(Real::Any, "where to look first")?))
    })?;
    let range = match table.get("range") {
        Some(given) => Some(range(&given, &table, start)?),
        None if start.is_some() => {
            let message = format!("{} has a start and no range", table.title());
            let help = "give `range = [low, high]`; an amplitude needs neither";
            return Err(table.error(message).help(help).into());
        }
        None => None,
    };
    Ok(UserParameter {
        name: name.to_owned(),
        unit,
        range,
    })
}

fn range(given: &Value, table: &Table, start: Option<f64>) -> Result<Range> {
    let ends = given.array("[5.0, 200.0]")?;
    let [low, high] = ends.as_slice() else {
        let e = given.error(format!("has {} values", ends.len()));
        return Err(e
            .help("write the least and the greatest value: [low, high]")
            .into());
    };
    let low = low.real(Real::Any, "the least value")?;
    let high = high.real(Real::Any, "the greatest value")?;
    if low >= high {
        return Err(given
            .error(format!("goes from {low} to {high}"))
            .help("write the least value first, and a greater one after it")
            .into());
    }
    if let Some(at) = start
        && !(low..=high).contains(&at)
        && let Some(value) = table.get("start")
    {
        return Err(value
            .error(format!("is {at}, outside the range from {low} to {high}"))
            .help("give a start within the range, or none")
            .into());
    }
    Ok(Range { low, high, start })
}

/// What formula and parameters say of each other.
fn check(doc: &Doc, table: &Table, expression: &Value, effect: &UserEffect) -> Result<()> {
    let names = effect.formula.names();
    let unused = |p: &&UserParameter| !names.contains(&p.name);
    if let Some(p) = effect.parameters.iter().find(unused) {
        let columns: Vec<&str> = effect.columns().collect();
        let meant = crate::nearest::nearest(&p.name, &columns);
        let help = match meant {
            Some(name) => format!("the formula has `{name}`: is that the same?"),
            None => "use it there, or delete it".to_owned(),
        };
        let message = format!("has no `{}`, which is among the parameters", p.name);
        return Err(expression.error(message).help(help).into());
    }
    if effect.parameters.is_empty() {
        return Err(table
            .error("an effect without parameters: nothing would be estimated")
            .help("put an amplitude before the formula, `gain*(...)`, and list it: `gain = {}`")
            .into());
    }
    if let Some(name) = effect.columns().find(|n| *n == "rate_out_dps") {
        let at = effect.text.find(name).unwrap_or(0);
        return Err(doc
            .error(
                place(doc, expression, &effect.text, at),
                "`rate_out_dps` is what effects explain, and explains none",
            )
            .help("use the columns that move it")
            .into());
    }
    if effect.columns().next().is_none() {
        let e = expression.error("has no column of a record: it is a constant");
        return Err(e
            .help("use columns by their names, such as `time_s` or `die_degc`")
            .into());
    }
    if effect.shapes().count() > MOST_SHAPES || effect.amplitudes().count() > MOST_AMPLITUDES {
        let message = "has too many parameters";
        let help = format!(
            "at most {MOST_SHAPES} with a range and {MOST_AMPLITUDES} without are estimated"
        );
        return Err(expression.error(message).help(help).into());
    }
    linear(doc, expression, effect)
}

/// Refuses a formula that is not linear in its amplitudes.
fn linear(doc: &Doc, expression: &Value, effect: &UserEffect) -> Result<()> {
    let amplitudes: Vec<&str> = effect.amplitudes().map(|p| p.name.as_str()).collect();
    let refused = match effect.formula.degree(|name| amplitudes.contains(&name)) {
        Ok(_) => return Ok(()),
        Err(refused) => refused,
    };
    let before = effect.text.chars().take(refused.column.saturating_sub(1));
    let at = place(
        doc,
        expression,
        &effect.text,
        before.map(char::len_utf8).sum(),
    );
    let listed = amplitudes.join("`, `");
    let error = if refused.is_sum {
        doc.error(
            at,
            format!(
                "`{}` adds a part with an amplitude (`{listed}`) to one without",
                refused.part
            ),
        )
        .help("give every part an amplitude of its own, or take all amplitudes out")
    } else {
        doc.error(
            at,
            format!("`{}` is not linear in `{listed}`", refused.part),
        )
        .help(
            "a parameter without a range is an amplitude, a factor before a part of the formula; give any other \
             one a range: { unit = \"s\", range = [5.0, 200.0] }",
        )
    };
    Err(error.into())
}

/// The byte of the file at which a byte of a string stands.
fn place(doc: &Doc, value: &Value, text: &str, byte: usize) -> usize {
    let span = value.span();
    let raw = doc.text.get(span.clone()).unwrap_or("");
    // A string with escapes is not found in its own source: then the value's place has to do.
    raw.find(text)
        .map_or(span.start, |start| span.start + start + byte)
}

/// An error inside a formula as one of the file.
fn inside(doc: &Doc, value: &Value, text: &str, error: Error) -> Error {
    let Error::Input(e) = error else { return error };
    let before = text.lines().take(e.line.unwrap_or(1).saturating_sub(1));
    let line: usize = before.map(|l| l.len() + 1).sum();
    let rest = text.get(line..).unwrap_or("");
    let column = e.column.unwrap_or(1).saturating_sub(1);
    let byte = line + rest.chars().take(column).map(char::len_utf8).sum::<usize>();
    let moved = doc.error(place(doc, value, text, byte), e.message.clone());
    match &e.help {
        Some(help) => moved.help(help.clone()).into(),
        None => moved.into(),
    }
}

#[cfg(test)]
#[path = "user_effects_tests.rs"]
mod tests;
