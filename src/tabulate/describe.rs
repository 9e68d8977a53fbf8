//! A form for the report: in words, and its data.

use super::outcome::{Formats, TableData, Word};
use super::request::Request;
use crate::approx::form::Form;
use crate::approx::form::polynomial::{Monomials, Scheme};
use crate::approx::form::split::{Spacing, Split};
use crate::approx::form::table::Kind;
use crate::numeric::arithmetic::Table as Entries;
use crate::numeric::cast::Target as Quantised;
use crate::text::counted;

/// A form in words.
pub fn detail(form: &Form) -> String {
    let segments = |split: &Split| {
        let symmetry = match split.symmetry {
            Some(s) => format!(
                ", {} about code {}",
                if s.odd { "odd" } else { "even" },
                s.about_raw
            ),
            None => String::new(),
        };
        match split.spacing {
            Spacing::Uniform { bits } => {
                let segments = counted(split.count as u64, "segment");
                format!("{segments} of 2^{bits} codes{symmetry}")
            }
            Spacing::PowerOfTwo { .. } => {
                format!(
                    "{} segments, each half as long as the one above it{symmetry}",
                    split.count
                )
            }
        }
    };
    match form {
        Form::Polynomial(p) => {
            let degree = p.coefficients.len() - 1;
            let kind = match p.monomials {
                Monomials::All => "",
                Monomials::Odd => "odd ",
                Monomials::Even => "even ",
            };
            let estrin = match p.formats.scheme {
                Scheme::Horner => "",
                Scheme::Estrin => ", by Estrin's scheme",
            };
            format!(
                "{kind}polynomial of degree {degree}, coefficients {}{estrin}",
                p.formats.coefficients.name(p.monomials, degree)
            )
        }
        Form::Piecewise(p) => {
            format!("degree {} on {}", p.degree(), segments(&p.split))
        }
        Form::Table(t) => {
            let kind = format!("{:?}", t.kind).to_lowercase();
            format!(
                "{kind} table of {} entries, {}",
                t.entries.entries.len(),
                segments(&t.split)
            )
        }
        Form::Bipartite(b) => format!(
            "bipartite tables of {} and {} entries, {}",
            b.values.entries.len(),
            b.corrections.entries.len(),
            segments(&b.split)
        ),
    }
}

/// The formats of a form, in words.
pub(super) fn formats(form: &Form, request: &Request) -> Formats {
    let signed = |t: Quantised| {
        let u = if t.signed { "" } else { "U" };
        format!(
            "{u}Q{}.{}",
            t.bits as i32 - t.fraction_bits,
            t.fraction_bits
        )
    };
    let (coefficients, intermediate) = match form {
        Form::Polynomial(p) => (
            p.formats
                .coefficients
                .name(p.monomials, p.coefficients.len().saturating_sub(1)),
            Some(signed(p.formats.intermediate)),
        ),
        Form::Piecewise(p) => {
            let f = p.fraction_bits;
            (
                format!("2^-{f}"),
                (p.degree() > 1).then(|| format!("2^-{f}")),
            )
        }
        Form::Table(t) => (format!("2^-{}", t.entries.fraction_bits), None),
        Form::Bipartite(b) => (format!("2^-{}", b.values.fraction_bits), None),
    };
    Formats {
        input: request.input.to_string(),
        output: request.output.to_string(),
        coefficients,
        intermediate,
    }
}

/// The coefficients of a polynomial, or the data of a table.
pub(super) fn data(form: &Form) -> (Option<Vec<Word>>, Option<TableData>) {
    let table = |kind, split: &Split, tables: &[&Entries]| TableData {
        kind,
        spacing: split.spacing,
        segments: split.count,
        middle_bits: None,
        symmetry: split.symmetry,
        fraction_bits: tables.first().map_or(0, |t| t.fraction_bits),
        entries: tables
            .iter()
            .map(|t| (t.name, t.entries.to_vec()))
            .collect(),
    };
    match form {
        Form::Polynomial(p) => {
            let word = |(order, raw): (usize, &i128)| Word {
                raw: *raw,
                value: *raw as f64 * p.formats.coefficients.of(order).lsb(),
            };
            let words = p.coefficients.iter().enumerate().map(word);
            (Some(words.collect()), None)
        }
        Form::Piecewise(p) => {
            let tables: Vec<_> = p.tables.iter().collect();
            (None, Some(table("piecewise", &p.split, &tables)))
        }
        Form::Table(t) => {
            let kind = match t.kind {
                Kind::Plain => "plain",
                Kind::Linear => "linear",
                Kind::Quadratic => "quadratic",
            };
            (None, Some(table(kind, &t.split, &[&t.entries])))
        }
        Form::Bipartite(b) => {
            let tables = [&b.values, &b.corrections];
            let data = TableData {
                middle_bits: Some(b.middle_bits),
                ..table("bipartite", &b.split, &tables)
            };
            (None, Some(data))
        }
    }
}
