//! `compensation.bound_dps`, `form` and `target`: what the compensation's fixed-point error is asked to be; and
//! `[compensation.evaluation]`, the form that was chosen for it.

use super::compensation::BiasBound;
use super::schema::{Circuit, Compensation, Outside};
use super::table::{Real, Table, Value};
use crate::approx::form::polynomial::Monomials;
use crate::approx::form::split::{Spacing, Symmetry};
use crate::approx::form::stored::{LARGEST_ENTRY, Read, Stored, WIDEST_BITS};
use crate::approx::form::table::Kind;
use crate::design::target::Target;
use crate::error::{Error, Result};
use crate::numeric::format::{Overflow, Rounding};

/// The keys that say what is asked, and not how it is done.
const ASKED: [&str; 3] = ["bound_dps", "form", "target"];

/// True if the table says what is asked and nothing else: formats are then chosen.
pub(super) fn only_asks(t: &Table) -> bool {
    let entries = t.entries();
    !entries.is_empty() && entries.iter().all(|(key, _)| ASKED.contains(key))
}

/// Reads what is asked.
pub(super) fn bound(t: &Table) -> Result<Option<BiasBound>> {
    let auto = match t.get("form") {
        Some(value) => value.choice(&[("polynomial", false), ("auto", true)])?,
        None => false,
    };
    let targets: Vec<(&str, Target)> = Target::named().collect();
    let target = t.take("target", Some(Target::default()), |v| v.choice(&targets))?;
    let Some(value) = t.get("bound_dps") else {
        let alone = ["form", "target"].iter().find_map(|key| t.get(key));
        return match alone {
            Some(value) => Err(value
                .error(
                    "goes only with `bound_dps`: forms are compared by what they cost for a bound",
                )
                .help("add `bound_dps = 0.01`, the error that is acceptable, in deg/s")
                .into()),
            None => Ok(None),
        };
    };
    let meaning = "the most that bias and rate may be from the fitted polynomial, deg/s";
    Ok(Some(BiasBound {
        bound_dps: value.real(Real::Positive, meaning)?,
        auto,
        target,
    }))
}

/// What stands in the way of a form other than the polynomial, and what to do.
pub fn hindrance(c: &Compensation) -> Option<(&'static str, &'static str)> {
    let (rounding, overflow) = (c.output.rounding, c.output.overflow);
    if rounding != Rounding::HalfUp || overflow != Overflow::Saturate {
        return Some((
            "forms other than the polynomial round half up and saturate, and `compensation.output` says otherwise",
            "set `rounding = \"half_up\"` and `overflow = \"saturate\"` in `compensation.output`, or \
             `form = \"polynomial\"`",
        ));
    }
    (c.outside == Outside::HoldSlope).then_some((
        "`outside = \"hold_slope\"` continues the polynomial, and other forms have no slope to hold",
        "set `outside = \"clamp\"` or \"flag\", or `form = \"polynomial\"`",
    ))
}

/// Reads `[compensation.evaluation]` of a compensation that is otherwise complete.
pub(super) fn evaluation(t: &Table, c: &Compensation, circuit: &Circuit) -> Result<Option<Stored>> {
    let table = t.section("evaluation")?;
    if !table.is_given() {
        return Ok(None);
    }
    if let Some((reason, help)) = hindrance(c) {
        return Err(table.error(reason).help(help).into());
    }
    let stored = stored(&table)?;
    let settled = stored.settle(c.codes(circuit), c.output.format);
    settled.map_err(|e| match e {
        Error::Input(e) => {
            let help = e.help.clone().unwrap_or_default();
            let message = format!("`[compensation.evaluation]` cannot be used: {}", e.message);
            table.error(message).help(help).into()
        }
        other => other,
    })?;
    Ok(Some(stored))
}

fn stored(t: &Table) -> Result<Stored> {
    const KINDS: [&str; 6] = [
        "polynomial",
        "plain",
        "linear",
        "quadratic",
        "bipartite",
        "piecewise",
    ];
    let kind = t.need("kind")?.choice(&KINDS.map(|k| (k, k)))?;
    if kind == "polynomial" {
        return polynomial(t);
    }
    let read = match kind {
        "plain" => Read::Table(Kind::Plain),
        "linear" => Read::Table(Kind::Linear),
        "quadratic" => Read::Table(Kind::Quadratic),
        "bipartite" => Read::Bipartite(t.need("shared_bits")?.integer(
            0..=i128::from(WIDEST_BITS),
            "the logarithm of the segments that share corrections",
        )?),
        _ => Read::Piecewise,
    };
    let spacing = match t.get("halvings") {
        Some(value) => Spacing::PowerOfTwo {
            steps: value.integer(1..=4, "the normalising steps of power-of-two segments")?,
        },
        None => Spacing::Uniform {
            bits: t.need("segment_bits")?.integer(
                0..=i128::from(WIDEST_BITS),
                "the logarithm of a segment's codes",
            )?,
        },
    };
    let fraction_bits = t
        .need("fraction_bits")?
        .integer(0..=60, "fraction bits of every entry")?;
    let symmetry = match t.get("symmetry") {
        Some(value) => {
            let odd = value.choice(&[("odd", true), ("even", false)])?;
            let about_raw = t.need("symmetry_about_raw")?;
            Some(Symmetry {
                about_raw: about_raw.integer(I64, "the input less its offset")?,
                odd,
            })
        }
        None => None,
    };
    let most = i128::from(LARGEST_ENTRY);
    let table = |v: &Value| {
        let entries = v.array("[1, 2]")?;
        let entries = entries.iter().map(|e| e.integer(-most..=most, "an entry"));
        entries.collect::<Result<Vec<i64>>>()
    };
    let entries = t.need("entries")?.array("[[1, 2], [3, 4]]")?;
    Ok(Stored::Tables {
        read,
        symmetry,
        spacing,
        fraction_bits,
        entries: entries.iter().map(table).collect::<Result<_>>()?,
    })
}

const I64: std::ops::RangeInclusive<i128> = i64::MIN as i128..=i64::MAX as i128;

fn polynomial(t: &Table) -> Result<Stored> {
    let monomials = [
        ("all", Monomials::All),
        ("odd", Monomials::Odd),
        ("even", Monomials::Even),
    ];
    let formats = t.need("formats")?.array("[\"Q12.20\"]")?;
    let raw = t.need("raw")?.array("[1, 2]")?;
    Ok(Stored::Polynomial {
        monomials: t.need("monomials")?.choice(&monomials)?,
        formats: formats.iter().map(Value::format).collect::<Result<_>>()?,
        intermediate: t.need("intermediate")?.format()?,
        raw: raw
            .iter()
            .map(|v| v.integer(I64, "a raw coefficient"))
            .collect::<Result<_>>()?,
    })
}

/// The table as text.
pub fn evaluation_text(stored: &Stored) -> String {
    let mut lines = Vec::new();
    match stored {
        Stored::Polynomial {
            monomials,
            formats,
            intermediate,
            raw,
        } => {
            let monomials = match monomials {
                Monomials::All => "all",
                Monomials::Odd => "odd",
                Monomials::Even => "even",
            };
            let formats: Vec<String> = formats.iter().map(|f| f.to_string()).collect();
            lines.push("kind = \"polynomial\"".to_owned());
            lines.push(format!("monomials = \"{monomials}\""));
            lines.push(format!("formats = {formats:?}"));
            lines.push(format!("intermediate = \"{intermediate}\""));
            lines.push(format!("raw = {raw:?}"));
        }
        Stored::Tables {
            read,
            symmetry,
            spacing,
            fraction_bits,
            entries,
        } => {
            let kind = match read {
                Read::Table(Kind::Plain) => "plain",
                Read::Table(Kind::Linear) => "linear",
                Read::Table(Kind::Quadratic) => "quadratic",
                Read::Bipartite(_) => "bipartite",
                Read::Piecewise => "piecewise",
            };
            lines.push(format!("kind = \"{kind}\""));
            if let Read::Bipartite(bits) = read {
                lines.push(format!("shared_bits = {bits}"));
            }
            lines.push(match spacing {
                Spacing::Uniform { bits } => format!("segment_bits = {bits}"),
                Spacing::PowerOfTwo { steps } => format!("halvings = {steps}"),
            });
            if let Some(s) = symmetry {
                let name = if s.odd { "odd" } else { "even" };
                lines.push(format!("symmetry = \"{name}\""));
                lines.push(format!("symmetry_about_raw = {}", s.about_raw));
            }
            lines.push(format!("fraction_bits = {fraction_bits}"));
            lines.push("entries = [".to_owned());
            for table in entries {
                lines.push("  [".to_owned());
                for row in table.chunks(10) {
                    let row: Vec<String> = row.iter().map(i64::to_string).collect();
                    lines.push(format!("    {},", row.join(", ")));
                }
                lines.push("  ],".to_owned());
            }
            lines.push("]".to_owned());
        }
    }
    format!("[compensation.evaluation]\n{}\n", lines.join("\n"))
}
