//! The page of `equiv`: the circuit with its formats, every node's error beside theory, the oscillator's spurs.
//!
//! [`diagram`] is the circuit as blocks, [`figures`] are the others.

pub mod diagram;
pub mod figures;

use super::figure::{Figure, both, one};
use super::narrow::rendered;
use super::page::Equivalent;
use super::text::{bounding, fixed, grouped, significant, trimmed};
use crate::check::proved::{self, Proved};
use crate::circuit::engine;
use crate::design::Design;
use crate::equivalence::outcome::{Equivalence, NodeReport};
use crate::error::Result;
use askama::Template;

/// The page.
#[derive(Debug, Template)]
#[template(path = "report/equiv.html")]
struct Page {
    name: String,
    headline: String,
    finding: String,
    holds: bool,
    reasons: Vec<String>,
    diagram: Figure,
    figures: Vec<Figure>,
    /// Frequency, level, predicted level, what makes it.
    spurs: Vec<[String; 4]>,
    spur_sentence: String,
    nodes: Vec<Line>,
    equivalence: Vec<Equivalent>,
    equivalence_sum: [String; 2],
    notes: Vec<String>,
    provenance: Vec<[String; 2]>,
}

/// A node in the table.
#[derive(Debug)]
struct Line {
    name: String,
    /// Greatest error, greatest bound, worst share of a bound in %, rms, predicted rms (LSB), headroom in bits or none, overflows.
    numbers: [String; 7],
    within: bool,
    flags: String,
}

/// The report as one HTML file.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub fn html(design: &Design, e: &Equivalence) -> Result<String> {
    let proved = proved::nodes(design, &engine::trace(design));
    let emitted = || [&e.model_vs_c, &e.model_vs_rust].into_iter().flatten();
    let compared: u64 = emitted().map(|m| m.compared).sum();
    let mismatches: u64 = emitted().map(|m| m.mismatches).sum();
    let spurs = figures::named(e, design.circuit.sample_rate_hz);
    let mut figures = both(|width| figures::wide(e, &proved, design, width));
    figures.insert(1, figures::errors(e));
    let page = Page {
        name: design.name.clone(),
        headline: headline(e, compared, mismatches),
        finding: format!(
            "{} ADC samples, {} rows: {}. Each error is the distance of fixed point and float in the same circuit on the same \
             codes; each bound is computed beside it, sample by sample.",
            grouped(e.samples),
            grouped(e.rows),
            e.stimulus
        ),
        holds: e.holds,
        reasons: e.reasons.clone(),
        diagram: one(|width| diagram::diagram(design, &proved, width)),
        figures,
        spurs: spurs
            .iter()
            .map(|s| {
                let level = |l: Option<f64>| l.map_or("–".to_owned(), |l| fixed(l, 2));
                [
                    trimmed(&significant(s.frequency_hz, 7)),
                    fixed(s.level_dbc, 2),
                    level(s.predicted_dbc),
                    s.name.clone(),
                ]
            })
            .collect(),
        spur_sentence: spur_sentence(e),
        nodes: e.nodes.iter().map(line).collect(),
        equivalence: emitted()
            .flat_map(|m| m.parts.iter().map(Equivalent::of))
            .collect(),
        equivalence_sum: [grouped(compared), grouped(mismatches)],
        notes: {
            let warnings = e.warnings.iter().map(|w| w.message.clone());
            warnings.chain(e.notes.iter().cloned()).collect()
        },
        provenance: [
            ("command", e.command.clone()),
            ("version", e.version.to_owned()),
            ("design's SHA-256", e.design_sha256.clone()),
        ]
        .map(|(name, value)| [name.to_owned(), value])
        .to_vec(),
    };
    rendered(&page)
}

fn headline(e: &Equivalence, compared: u64, mismatches: u64) -> String {
    let nodes = e.nodes.len();
    let outside = e.nodes.iter().filter(|n| n.outside_bound > 0).count();
    let overflows: u64 = e.nodes.iter().map(|n| n.overflows).sum();
    let words = match (outside, overflows) {
        (0, 0) => {
            format!("Every word of all {nodes} nodes stays within its bound, and none overflows.")
        }
        (0, _) => format!("{} words overflow.", grouped(overflows)),
        _ => format!("{outside} of {nodes} nodes leave their bound."),
    };
    let emitted = match (compared, mismatches) {
        (0, _) => "No emitted code was built.".to_owned(),
        (_, 0) => format!(
            "The emitted code has the model's bits in all {} words compared.",
            grouped(compared)
        ),
        _ => format!(
            "The emitted code differs from the model at {} inputs.",
            grouped(mismatches)
        ),
    };
    format!("{words} {emitted}")
}

fn spur_sentence(e: &Equivalence) -> String {
    let s = &e.nco_spurs;
    let Some(measured) = &s.measured else {
        return "There is no carrier to measure spurs against.".to_owned();
    };
    let worst = measured
        .sfdr_dbc
        .map_or("none above the floor".to_owned(), |db| {
            format!("{} dB below the carrier", fixed(db, 2))
        });
    let why = s.reason.as_ref().map_or(String::new(), |r| {
        let (first, rest) = r.split_at(r.chars().next().map_or(0, char::len_utf8));
        format!(" {}{rest}.", first.to_uppercase())
    });
    // What no rate of any use could show is none.
    let tone = if s.quadrature_tone_dps < 1e-12 {
        "no tone in the rate".to_owned()
    } else {
        format!("a tone of {} deg/s", significant(s.quadrature_tone_dps, 2))
    };
    format!(
        "The carrier is at {} Hz; the worst of {} spurs is {worst}. With the design's quadrature the spurs make {tone}.{why}",
        trimmed(&significant(s.carrier_hz, 7)),
        measured.spurs
    )
}

/// What a node's name says without its room.
fn short(name: &str) -> &str {
    name.strip_prefix("circuit.").unwrap_or(name)
}

fn line(n: &NodeReport) -> Line {
    let lsb = |v: f64| significant(v / n.lsb, 3);
    Line {
        name: n.name.clone(),
        numbers: [
            lsb(n.max_abs_error),
            bounding(n.bound / n.lsb, 3),
            fixed(100.0 * n.worst_error_to_bound, 1),
            lsb(n.rms_error),
            n.predicted_rms.map_or("–".to_owned(), lsb),
            n.headroom("–"),
            grouped(n.overflows),
        ],
        within: n.outside_bound == 0,
        flags: n.flags.join(", "),
    }
}

/// What is proved of the word that a node belongs to.
fn proved_of<'a>(proved: &'a [Proved], node: &str) -> Option<&'a Proved> {
    proved.iter().find(|p| node.starts_with(&p.name))
}
