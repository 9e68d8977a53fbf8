//! A form as data: what a design file keeps of it, and the same form again.

use super::coefficient_formats::CoefficientFormats;
use super::piecewise::{HIGHEST_DEGREE, Piecewise};
use super::polynomial::{Formats, Monomials, Polynomial, Scheme};
use super::split::{Spacing, Split, Symmetry};
use super::table::{Bipartite, Kind, Table};
use super::{Codes, Form, Settled};
use crate::error::{InputError, Result};
use crate::numeric::arithmetic::Table as Entries;
use crate::numeric::cast::Target;
use crate::numeric::format::Format;

/// The largest entry of a table: exact as a double.
pub const LARGEST_ENTRY: i64 = 9_000_000_000_000_000;
/// The most entries of a table.
const MOST_ENTRIES: usize = 1 << 18;
/// The widest input word.
pub const WIDEST_BITS: u32 = 48;

/// A form's data. Input codes and the output's format belong to where it is used.
#[derive(Debug, Clone, PartialEq)]
pub enum Stored {
    /// One polynomial by Horner's rule, with the casts of [`super::polynomial`].
    Polynomial {
        /// Which monomials.
        monomials: Monomials,
        /// One a monomial, lowest order first.
        formats: Vec<Format>,
        /// Of the cast after each step.
        intermediate: Format,
        /// From order 0 to the degree.
        raw: Vec<i128>,
    },
    /// Tables.
    Tables {
        /// How they are read.
        read: Read,
        /// The symmetry that is used.
        symmetry: Option<Symmetry>,
        /// Length of segments.
        spacing: Spacing,
        /// Fraction bits of every entry.
        fraction_bits: u32,
        /// The entries: one table, two of a bipartite one, one an order of segments.
        entries: Vec<Vec<i64>>,
    },
}

/// How tables are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Read {
    /// One table.
    Table(Kind),
    /// Values and corrections; the logarithm of the number of segments that share corrections.
    Bipartite(u32),
    /// A polynomial for each segment.
    Piecewise,
}

impl Stored {
    /// The data of a form.
    pub fn of(form: &Form) -> Self {
        let tables = |read, split: &Split, tables: &[&Entries]| Stored::Tables {
            read,
            symmetry: split.symmetry,
            spacing: split.spacing,
            fraction_bits: tables.first().map_or(0, |t| t.fraction_bits.max(0) as u32),
            entries: tables.iter().map(|t| t.entries.to_vec()).collect(),
        };
        match form {
            Form::Polynomial(p) => {
                let degree = p.coefficients.len().saturating_sub(1);
                let t = p.formats.intermediate;
                let fraction_bits = t.fraction_bits.max(0) as u32;
                Stored::Polynomial {
                    monomials: p.monomials,
                    formats: p.formats.coefficients.each(p.monomials, degree),
                    intermediate: Format::q(t.bits.saturating_sub(fraction_bits), fraction_bits),
                    raw: p.coefficients.clone(),
                }
            }
            Form::Piecewise(p) => {
                let all: Vec<&Entries> = p.tables.iter().collect();
                tables(Read::Piecewise, &p.split, &all)
            }
            Form::Table(t) => tables(Read::Table(t.kind), &t.split, &[&t.entries]),
            Form::Bipartite(b) => {
                let read = Read::Bipartite(b.middle_bits);
                tables(read, &b.split, &[&b.values, &b.corrections])
            }
        }
    }

    /// The form, with its casts' ranges proved.
    ///
    /// # Errors
    /// Data that do not belong together, or that need words of more than 127 bits.
    pub fn settle(&self, codes: Codes, output: Format) -> Result<Settled> {
        self.build(codes, output)?.settle()
    }

    /// The form.
    ///
    /// # Errors
    /// Data that do not belong together.
    pub fn build(&self, codes: Codes, output: Format) -> Result<Form> {
        let refuse = |message: String| InputError::new(message).help(REMEDY);
        if codes.high < codes.low || (codes.high - codes.low) >> WIDEST_BITS != 0 {
            return Err(refuse(format!("an input of more than {WIDEST_BITS} bits")).into());
        }
        match self {
            Stored::Polynomial {
                monomials,
                formats,
                intermediate,
                raw,
            } => {
                let degree = raw.len().saturating_sub(1);
                let coefficients = CoefficientFormats::new(formats, *monomials, degree)?;
                if raw.is_empty() || monomials.exponents(degree).is_empty() {
                    return Err(refuse("a polynomial without coefficients".into()).into());
                }
                let held = |(order, c): (usize, &i128)| coefficients.of(order).contains(*c);
                if let Some((_, c)) = raw.iter().enumerate().find(|one| !held(*one)) {
                    return Err(refuse(format!("a coefficient {c} beyond its format")).into());
                }
                let formats = Formats {
                    codes,
                    coefficients,
                    intermediate: Target::from(*intermediate),
                    output,
                    scheme: Scheme::Horner,
                };
                let form = Polynomial::new(formats, *monomials, raw.clone())?;
                Ok(Form::Polynomial(Box::new(form)))
            }
            Stored::Tables {
                read,
                symmetry,
                spacing,
                fraction_bits,
                entries,
            } => {
                let about = symmetry.map_or(codes.low, |s| s.about_raw);
                if !(codes.low..=codes.high).contains(&about) {
                    return Err(refuse(format!("a symmetry about {about}, outside")).into());
                }
                if !spacing_fits(*spacing, codes) {
                    return Err(refuse("segments that do not fit the input".into()).into());
                }
                let split = Split::new(codes, *symmetry, *spacing);
                check_entries(*read, &split, entries)?;
                let one = |k: usize| entries.get(k).cloned().unwrap_or_default();
                Ok(match read {
                    Read::Table(kind) => {
                        let table = Table::new(split, *kind, output, *fraction_bits, one(0));
                        Form::Table(Box::new(table))
                    }
                    Read::Bipartite(middle_bits) => {
                        let both = [one(0), one(1)];
                        let b = Bipartite::new(split, *middle_bits, output, *fraction_bits, both);
                        Form::Bipartite(Box::new(b))
                    }
                    Read::Piecewise => {
                        let of = |i: usize| entries.iter().filter_map(move |t| t.get(i).copied());
                        let all: Vec<Vec<i64>> =
                            (0..split.count).map(|i| of(i).collect()).collect();
                        let p = Piecewise::new(split, output, *fraction_bits, &all);
                        Form::Piecewise(Box::new(p))
                    }
                })
            }
        }
    }
}

const REMEDY: &str = "an evaluation is written by `gyrogen run`: take it as it is there, with the formats and the range \
                      beside it, or delete the table and run again";

fn spacing_fits(spacing: Spacing, codes: Codes) -> bool {
    let width = 128 - (codes.count() - 1).leading_zeros();
    match spacing {
        Spacing::Uniform { bits } => {
            bits <= WIDEST_BITS && (codes.count() >> bits) < MOST_ENTRIES as u128
        }
        Spacing::PowerOfTwo { steps } => (1..=4).contains(&steps) && width >= 1 << steps,
    }
}

/// As many entries as the segments need, none too large.
fn check_entries(read: Read, split: &Split, entries: &[Vec<i64>]) -> Result<()> {
    let refuse = |message: String| Err(InputError::new(message).help(REMEDY).into());
    let count = split.count;
    let lengths = match read {
        Read::Table(kind) => vec![kind.entries(count)],
        Read::Bipartite(middle_bits) => {
            if split.bits == 0 || middle_bits > WIDEST_BITS {
                return refuse("a bipartite table with segments of one code".into());
            }
            let half = 1usize << (split.bits - 1).min(40);
            vec![count, ((count >> middle_bits) + 1) * half]
        }
        Read::Piecewise => vec![count; entries.len().clamp(2, HIGHEST_DEGREE + 1)],
    };
    let has: Vec<usize> = entries.iter().map(Vec::len).collect();
    if has != lengths {
        return refuse(format!(
            "tables of {has:?} entries where {lengths:?} are needed"
        ));
    }
    let large = entries
        .iter()
        .flatten()
        .find(|v| v.unsigned_abs() > LARGEST_ENTRY as u64);
    if let Some(v) = large {
        return refuse(format!("an entry {v}, beyond {LARGEST_ENTRY}"));
    }
    Ok(())
}
