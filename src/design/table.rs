//! A TOML table that remembers where everything stands, so that every mistake can be shown in
//! its place: file, line, column, offending value, reason, remedy.

pub use super::ranges::Real;
use super::{keys, suggest};
use crate::error::{Error, InputError, Result};
use crate::numeric::format::{Format, Overflow, Quantizer, Rounding};
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The text that is read, without a byte-order mark, and its file.
pub(super) struct Doc<'a> {
    pub text: &'a str,
    pub file: Option<&'a Path>,
}

impl Doc<'_> {
    /// An error at a byte offset of the text.
    pub fn error(&self, offset: usize, message: impl Into<String>) -> InputError {
        let e = InputError::new(message).at_offset(self.text, offset);
        match self.file {
            Some(file) => e.in_file(file),
            None => e,
        }
    }
}

/// A table of the file; one that the file leaves out reads as empty.
pub(super) struct Table<'a> {
    doc: &'a Doc<'a>,
    /// Dotted; empty for the top level.
    path: String,
    /// Byte offset of the header (of the enclosing one's if the table is left out).
    at: usize,
    entries: Option<&'a DeTable<'a>>,
}

impl<'a> Table<'a> {
    /// The top level of the file, its keys checked against the known ones.
    pub fn root(doc: &'a Doc<'a>, entries: &'a DeTable<'a>) -> Result<Self> {
        let root = Table {
            doc,
            path: String::new(),
            at: 0,
            entries: Some(entries),
        };
        root.only(&keys::names(""))?;
        Ok(root)
    }

    /// True if the file has this table.
    pub fn is_given(&self) -> bool {
        self.entries.is_some()
    }

    /// The table as a reader knows it: `[circuit.nco]`.
    pub fn title(&self) -> String {
        keys::title(&self.path)
    }

    fn dotted(&self, key: &str) -> String {
        match self.path.as_str() {
            "" => key.to_owned(),
            path => format!("{path}.{key}"),
        }
    }

    /// An error at the table's header.
    pub fn error(&self, message: impl Into<String>) -> InputError {
        self.doc.error(self.at, message)
    }

    /// The keys that are there, in the file's order.
    pub fn entries(&self) -> Vec<(&'a str, Value<'a>)> {
        let mut found: Vec<_> = self.entries.into_iter().flat_map(|t| t.iter()).collect();
        found.sort_by_key(|(key, _)| key.span().start);
        found
            .into_iter()
            .map(|(key, value)| (&**key.get_ref(), self.value(key.get_ref(), value)))
            .collect()
    }

    fn value(&self, key: &str, value: &'a Spanned<DeValue<'a>>) -> Value<'a> {
        Value {
            doc: self.doc,
            key: self.dotted(key),
            value,
        }
    }

    /// Refuses the first key that is not among `known`, in its place.
    pub fn only(&self, known: &[&str]) -> Result<()> {
        let unknown = self
            .entries
            .into_iter()
            .flat_map(|t| t.iter())
            .filter(|(key, _)| !known.contains(&&**key.get_ref()))
            .min_by_key(|(key, _)| key.span().start);
        let Some((key, value)) = unknown else {
            return Ok(());
        };
        let name = key.get_ref();
        let what = if value.get_ref().is_table() {
            format!("unknown table `[{}]`", self.dotted(name))
        } else if self.path.is_empty() {
            format!("unknown key `{name}` outside any table")
        } else {
            format!("unknown key `{name}` in {}", self.title())
        };
        Err(self
            .doc
            .error(key.span().start, what)
            .help(suggest::remedy(&self.path, known, name))
            .into())
    }

    /// The value of a key, if it is there.
    pub fn get(&self, key: &str) -> Option<Value<'a>> {
        let value = self.entries?.get(key)?;
        Some(self.value(key, value))
    }

    /// The value of a required key.
    pub fn need(&self, key: &str) -> Result<Value<'a>> {
        self.get(key).ok_or_else(|| self.missing(key))
    }

    /// The value of a key as `read` reads it; `default` if it is left out.
    pub fn take<T>(
        &self,
        key: &str,
        default: Option<T>,
        read: impl FnOnce(Value<'a>) -> Result<T>,
    ) -> Result<T> {
        match self.get(key) {
            Some(value) => read(value),
            None => default.ok_or_else(|| self.missing(key)),
        }
    }

    /// The error for a required key or table that is not there.
    pub fn missing(&self, key: &str) -> Error {
        let path = self.dotted(key);
        let example = keys::example(&self.path, key);
        let e = if keys::is_table(&path) {
            self.error(format!(
                "{} lacks the required table `[{path}]`",
                self.title()
            ))
            .help(format!(
                "add `[{path}]` with its keys (`gyrogen init` writes a complete file to copy it from)"
            ))
        } else {
            self.error(format!("{} lacks the required key `{key}`", self.title()))
                .help(format!("add `{key} = {example}` under {}", self.title()))
        };
        e.into()
    }

    /// A table inside this one, its keys checked; an absent one reads as empty.
    pub fn section(&self, key: &str) -> Result<Table<'a>> {
        match self.get(key) {
            Some(value) => {
                let table = value.table()?;
                table.only(&keys::names(&table.path))?;
                Ok(table)
            }
            None => Ok(Table {
                doc: self.doc,
                path: self.dotted(key),
                at: self.at,
                entries: None,
            }),
        }
    }

    /// A table inside this one that has to be there.
    pub fn need_section(&self, key: &str) -> Result<Table<'a>> {
        self.need(key)?;
        self.section(key)
    }
}

/// A value of the file with its dotted key and its place.
pub(super) struct Value<'a> {
    doc: &'a Doc<'a>,
    key: String,
    value: &'a Spanned<DeValue<'a>>,
}

impl<'a> Value<'a> {
    /// The value as the file spells it, cut if it is long.
    pub fn shown(&self) -> String {
        let text = self.doc.text.get(self.value.span()).unwrap_or("?");
        let line = text.lines().next().unwrap_or("");
        if line.chars().count() > 48 || line.len() < text.len() {
            let head: String = line.chars().take(45).collect();
            format!("{head}...")
        } else {
            line.to_owned()
        }
    }

    /// An error at this value; `{key}` is put in front of the message.
    pub fn error(&self, message: impl Display) -> InputError {
        let message = format!("`{}` {message}", self.key);
        self.doc.error(self.value.span().start, message)
    }

    fn wrong_type(&self, expected: &str, help: impl Into<String>) -> Error {
        let found = match self.value.get_ref() {
            DeValue::String(_) => "the string ",
            DeValue::Integer(_) => "the integer ",
            DeValue::Float(_) => "the real ",
            DeValue::Boolean(_) => "the boolean ",
            DeValue::Datetime(_) => "the date or time ",
            DeValue::Array(_) => "the array ",
            DeValue::Table(_) => "the table ",
        };
        self.error(format!("takes {expected}, found {found}{}", self.shown()))
            .help(help)
            .into()
    }

    /// The last part of the dotted key.
    fn name(&self) -> &str {
        self.key.rsplit('.').next().unwrap_or(&self.key)
    }

    /// A table.
    pub fn table(&self) -> Result<Table<'a>> {
        match self.value.get_ref() {
            DeValue::Table(entries) => Ok(Table {
                doc: self.doc,
                path: self.key.clone(),
                at: self.value.span().start,
                entries: Some(entries),
            }),
            DeValue::Array(_) => Err(self.wrong_type(
                "a table",
                format!(
                    "write the header once, in single brackets: `[{}]`",
                    self.key
                ),
            )),
            _ => Err(self.wrong_type("a table", format!("write a table, `[{}]`", self.key))),
        }
    }

    /// Its bytes in the text.
    pub fn span(&self) -> std::ops::Range<usize> {
        self.value.span()
    }

    /// `true` or `false`.
    pub fn flag(&self) -> Result<bool> {
        let flag = self.value.get_ref().as_bool();
        flag.ok_or_else(|| {
            self.wrong_type("true or false", "write `true` or `false`, without quotes")
        })
    }

    /// True if the value is a string.
    pub fn is_text(&self) -> bool {
        self.value.get_ref().is_str()
    }

    /// True if the value is a table.
    pub fn is_table(&self) -> bool {
        self.value.get_ref().is_table()
    }

    /// A string.
    pub fn text(&self, meaning: &str) -> Result<&'a str> {
        self.value.get_ref().as_str().ok_or_else(|| {
            self.wrong_type(
                "a string",
                format!("write {meaning} as a string, in double quotes"),
            )
        })
    }

    /// An integer in a range.
    pub fn integer<T: TryFrom<i128>>(
        &self,
        range: RangeInclusive<i128>,
        meaning: &str,
    ) -> Result<T> {
        let (low, high) = (range.start(), range.end());
        let help = format!("give an integer from {low} to {high}: {meaning}");
        let integer = match self.value.get_ref() {
            DeValue::Integer(integer) => integer,
            DeValue::Float(real) => {
                let near = real.as_str().parse::<f64>().unwrap_or(f64::NAN);
                let is_raw = ["_raw", "_word"].iter().any(|w| self.name().contains(w));
                let help = if is_raw {
                    // A real here is rather a quantity in its unit than a word with a point.
                    format!("a raw word is an integer, and no value in a unit; {help}")
                } else if near.fract() == 0.0 && near.abs() < 1e15 {
                    format!(
                        "an integer key takes no real: write `{} = {near}`",
                        self.name()
                    )
                } else {
                    help
                };
                return Err(self.wrong_type("an integer", help));
            }
            DeValue::String(text) if text.trim().parse::<i128>().is_ok() => {
                let help = format!(
                    "write it without quotes: `{} = {}`",
                    self.name(),
                    text.trim()
                );
                return Err(self.wrong_type("an integer", help));
            }
            _ => return Err(self.wrong_type("an integer", help)),
        };
        i128::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .filter(|v| range.contains(v))
            .and_then(|v| T::try_from(v).ok())
            .ok_or_else(|| {
                self.error(format!("is {}; it has to be {low}..={high}", self.shown()))
                    .help(help)
                    .into()
            })
    }

    /// A real; a TOML integer will do.
    pub fn real(&self, accepted: Real, meaning: &str) -> Result<f64> {
        let help = || format!("give a number, {}: {meaning}", accepted.rule());
        let x = match self.value.get_ref() {
            DeValue::Float(real) => real.as_str().parse::<f64>().ok(),
            DeValue::Integer(integer) => {
                let parsed = i128::from_str_radix(integer.as_str(), integer.radix());
                parsed.ok().map(|v| v as f64)
            }
            DeValue::String(text) if text.trim().parse::<f64>().is_ok() => {
                let help = format!(
                    "write it without quotes: `{} = {}`",
                    self.name(),
                    text.trim()
                );
                return Err(self.wrong_type("a number", help));
            }
            _ => return Err(self.wrong_type("a number", help())),
        };
        match x {
            Some(x) if x.is_finite() && accepted.accepts(x) => Ok(x),
            Some(x) if x.is_finite() => Err(self
                .error(format!(
                    "is {}; it has to be {}",
                    self.shown(),
                    accepted.rule()
                ))
                .help(help())
                .into()),
            _ => Err(self
                .error(format!("is {}, which is not a finite number", self.shown()))
                .help(help())
                .into()),
        }
    }

    /// The elements of an array.
    pub fn array(&self, example: &str) -> Result<Vec<Value<'a>>> {
        let DeValue::Array(array) = self.value.get_ref() else {
            return Err(self.wrong_type("an array", format!("write `{} = {example}`", self.name())));
        };
        let element = |(i, value)| Value {
            doc: self.doc,
            key: format!("{}[{i}]", self.key),
            value,
        };
        Ok(array.iter().enumerate().map(element).collect())
    }

    /// One of a few words.
    pub fn choice<T: Copy>(&self, options: &[(&str, T)]) -> Result<T> {
        let list = keys::one_of(options.iter().map(|(name, _)| *name));
        let text = match self.value.get_ref().as_str() {
            Some(text) => text,
            None => return Err(self.wrong_type("a string", format!("write {list}"))),
        };
        if let Some((_, value)) = options.iter().find(|(name, _)| *name == text) {
            return Ok(*value);
        }
        let names: Vec<&str> = options.iter().map(|(name, _)| *name).collect();
        let help = match suggest::nearest_word(text, &names) {
            Some(near) => format!("did you mean `{near}`? It takes {list}"),
            None => format!("write {list}"),
        };
        Err(self
            .error(format!("is `{text}`, which is not one of its values"))
            .help(help)
            .into())
    }

    /// A format; a table with rounding and overflow is refused.
    pub fn format(&self) -> Result<Format> {
        match self.value.get_ref() {
            DeValue::String(text) => text.parse().map_err(|rule: String| {
                let remedy = suggest::format_remedy(text);
                // The remedy says it with the rule.
                let rule = match rule.split_once("; did you mean") {
                    Some((rule, _)) if remedy.starts_with("did you mean") => rule,
                    _ => &rule,
                };
                let e = self.error(format!("is no format: {rule}"));
                e.help(remedy).into()
            }),
            DeValue::Table(_) => Err(self.wrong_type(
                "a format as a string only",
                "write just the format, such as \"Q1.15\": nothing is rounded or overflows here",
            )),
            _ => Err(self.wrong_type(
                "a format as a string",
                "write a format such as \"Q1.15\", in double quotes",
            )),
        }
    }

    /// A format, alone or with rounding and overflow.
    pub fn quantizer(&self) -> Result<Quantizer> {
        match self.value.get_ref() {
            DeValue::String(_) => Ok(Quantizer::default_of(self.format()?)),
            DeValue::Table(_) => {
                let table = self.table()?;
                table.only(&["format", "rounding", "overflow"])?;
                let format = table.get("format").ok_or_else(|| {
                    table
                        .error(format!("`{}` lacks the required key `format`", self.key))
                        .help(format!(
                            "write `{} = {{ format = \"Q1.15\", rounding = \"half_up\", overflow = \"saturate\" }}`",
                            self.name()
                        ))
                })?;
                let rounding = Rounding::ALL.map(|r| (r.name(), r));
                let overflow = Overflow::ALL.map(|o| (o.name(), o));
                Ok(Quantizer {
                    format: format.format()?,
                    rounding: table.take("rounding", Some(Rounding::default()), |v| {
                        v.choice(&rounding)
                    })?,
                    overflow: table.take("overflow", Some(Overflow::default()), |v| {
                        v.choice(&overflow)
                    })?,
                })
            }
            _ => Err(self.wrong_type(
                "a format",
                "write a string such as \"Q1.15\", or { format = \"Q1.15\", rounding = \"half_up\", overflow = \"saturate\" }",
            )),
        }
    }
}
