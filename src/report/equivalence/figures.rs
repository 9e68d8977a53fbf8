//! Headroom, errors beside their predicted distributions, the oscillator's spectrum.

use super::{proved_of, short};
use crate::check::proved::Proved;
use crate::design::Design;
use crate::equivalence::outcome::{Equivalence, NodeReport};
use crate::report::axis::{Axis, Interval};
use crate::report::figure::{DOT, Figure, SMALL};
use crate::report::svg::{Shape, Svg, Swatch};
use crate::report::text::{fixed, significant};
use crate::spectrum::nco::spectrum;
use crate::statistics::tail::erfc_parts;
use std::f64::consts::SQRT_2;

/// Headroom beyond which a bar is cut off, bits.
const MOST_BITS: f64 = 12.0;
/// Lines up to which each is a stroke of its own.
const STROKES: usize = 300;
/// Highest harmonic of the carrier that gives its name to a spur.
const HARMONICS: u32 = 64;
/// Points of a predicted curve.
const CURVE: usize = 160;

/// Those that are drawn for wide pages and for narrow ones.
pub(super) fn wide(e: &Equivalence, proved: &[Proved], design: &Design, width: f64) -> Vec<Figure> {
    vec![headroom(e, proved, width), oscillator(e, design, width)]
}

fn axis(interval: Interval, quantity: &str, unit: &str) -> Axis {
    Axis {
        interval,
        quantity: quantity.to_owned(),
        unit: unit.to_owned(),
    }
}

/// Bits by which each node's words could grow: proved for every code, and seen.
fn headroom(e: &Equivalence, proved: &[Proved], width: f64) -> Figure {
    let names: Vec<String> = e.nodes.iter().map(|n| short(&n.name).to_owned()).collect();
    let of = |n: &NodeReport| proved_of(proved, &n.name).and_then(Proved::headroom_bits);
    let all = e
        .nodes
        .iter()
        .flat_map(|n| [of(n), n.headroom_bits])
        .flatten();
    let ends = all.map(|b| b.clamp(-MOST_BITS, MOST_BITS)).chain([0.0]);
    let mut svg = Svg::new(width);
    let x = axis(Interval::of(ends).padded(0.03), "headroom", "bits");
    svg.legend(
        [
            ("bar-of third", Swatch::Area, "seen in this run"),
            ("bar-of", Swatch::Area, "proved for every ADC code"),
            (
                "bar-of bad",
                Swatch::Area,
                "proved range is wider than the format",
            ),
        ]
        .map(|(class, swatch, words)| (class, swatch, words.to_owned())),
    );
    let is_roomy = svg.is_roomy();
    let mut frame = svg.rows(24.0, &names, x);
    for (k, n) in e.nodes.iter().enumerate() {
        let middle = (e.nodes.len() - k) as f64 - if is_roomy { 0.0 } else { 0.18 };
        let mut said = vec![n.name.clone()];
        for (class, bits, offset, words) in [
            ("bar-of third", n.headroom_bits, 0.12, "seen"),
            ("bar-of", of(n), -0.12, "proved"),
        ] {
            let Some(bits) = bits else { continue };
            let class = if bits < 0.0 { "bar-of bad" } else { class };
            let (low, high) = (middle + offset - 0.11, middle + offset + 0.11);
            let end = bits.clamp(-MOST_BITS, MOST_BITS);
            frame.band(class, &[(0.0, low, high), (end, low, high)]);
            said.push(format!("{words}: {} bits", fixed(bits, 2)));
        }
        frame.hint(8.0, (0.0, middle), &said.join("\n"));
    }
    frame.upright("zero", 0.0);
    svg.add(&frame);
    svg.figure(
        "Headroom of each node",
        format!(
            "log2 of the factor by which the words could grow before the format ends; bars end at {MOST_BITS} bits. A word that \
             wraps or is limited by its function has no proved bar."
        ),
    )
}

/// Error of each node beside what theory predicts.
pub(super) fn errors(e: &Equivalence) -> Figure {
    let shown = e.nodes.iter().filter(|n| n.count > 0);
    Figure::grid(
        "Error of each node, and its predicted distribution",
        "Counted: fixed less float of every word. Predicted: the node's own rounding, which is uniform, and all that comes into \
         it, which is normal, with the rms of theory; the place of the middle is the observed one. Where the oscillator visits few \
         phases, errors of table and products are few values, of which theory has the rms alone. No prediction: a condition of \
         the theory does not hold; the table's flags say which."
            .to_owned(),
        shown.map(error).collect(),
    )
}

fn error(n: &NodeReport) -> Figure {
    let bins = n.errors.bins();
    let width = n.errors.width() / n.lsb;
    let density = |count: u64| count as f64 / (n.count as f64 * width);
    let stairs: Vec<(f64, f64, f64)> = bins
        .iter()
        .flat_map(|(middle, count)| {
            let at = middle / n.lsb;
            [at - 0.5 * width, at + 0.5 * width].map(|x| (x, 0.0, density(*count)))
        })
        .collect();
    let reach = Interval::of(stairs.iter().map(|p| p.0)).padded(0.1);
    let predicted = predicted(n, reach);
    let tops = stairs
        .iter()
        .map(|p| p.2)
        .chain(predicted.iter().map(|p| p.1));
    let top = Interval::of(tops.chain([0.0])).high;
    let mut svg = Svg::new(SMALL);
    svg.legend([
        ("counted", Swatch::Area, "counted".to_owned()),
        ("fixed", Swatch::Line, "predicted".to_owned()),
        ("bound", Swatch::Line, "± predicted rms".to_owned()),
    ]);
    let x = axis(reach, short(&n.name), "LSB");
    let y = axis(
        Interval {
            low: 0.0,
            high: 1.1 * top,
        },
        "density",
        "1/LSB",
    );
    let mut frame = svg.frame(130.0, y.room(), x, y);
    frame.band("counted", &stairs);
    frame.line("fixed", &predicted);
    if let Some(rms) = n.predicted_rms.filter(|_| is_few_values(n)) {
        for edge in [-rms / n.lsb, rms / n.lsb] {
            frame.upright("bound", edge);
        }
    }
    svg.add(&frame);
    svg.figure(format!("Error of {}", n.name), "")
}

/// Whether the error has few values and no density: of a table that is read at few phases, and of products with it.
fn is_few_values(n: &NodeReport) -> bool {
    let early = ["circuit.nco", "circuit.demodulator"];
    early.iter().any(|k| n.name.starts_with(k))
        && n.flags.iter().any(|f| f.ends_with("coherent_nco"))
}

/// Density of the sum of a uniform and a normal error, LSB; empty where theory says nothing.
fn predicted(n: &NodeReport, x: Interval) -> Vec<(f64, f64)> {
    let Some(rms) = n.predicted_rms.filter(|_| !is_few_values(n)) else {
        return Vec::new();
    };
    let (rms, mean) = (rms / n.lsb, n.mean_error / n.lsb);
    let own = n.predicted_local_rms.map_or(0.0, |l| l / n.lsb);
    let spread = (rms * rms - mean * mean).max(0.01 * rms * rms);
    let half = 3f64.sqrt() * own;
    let rest = (spread - own * own).max(1e-6 * spread).sqrt();
    let at = (0..=CURVE).map(|k| x.low + (x.high - x.low) * k as f64 / CURVE as f64);
    at.map(|x| {
        let z = x - mean;
        let density = if half > 1e-3 * rest {
            (below((z + half) / rest) - below((z - half) / rest)) / (2.0 * half)
        } else {
            (-0.5 * (z / rest).powi(2)).exp() / (rest * std::f64::consts::TAU.sqrt())
        };
        (x, density)
    })
    .collect()
}

/// Share of a normal distribution below `z` standard deviations.
fn below(z: f64) -> f64 {
    let x = z.abs() / SQRT_2;
    let (t, exponent) = erfc_parts(x);
    let tail = 0.5 * t * (exponent - x * x).exp();
    if z < 0.0 { tail } else { 1.0 - tail }
}

/// A spur with what makes it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Named {
    /// Hz.
    pub frequency_hz: f64,
    /// dB from the carrier, measured.
    pub level_dbc: f64,
    /// Of the formula, where there is one.
    pub predicted_dbc: Option<f64>,
    /// In words.
    pub name: String,
}

/// The strongest measured spurs with their names; `rate` is the ADC's, Hz.
pub(super) fn named(e: &Equivalence, rate: f64) -> Vec<Named> {
    let s = &e.nco_spurs;
    let Some(measured) = &s.measured else {
        return Vec::new();
    };
    let near = 0.6 * rate / s.samples as f64;
    let folded = |hz: f64| {
        let turns = (hz / rate).rem_euclid(1.0);
        rate * turns.min(1.0 - turns)
    };
    let name = |hz: f64| {
        let mut orders = s.predicted.strongest.iter();
        if let Some(t) = orders.find(|t| (t.frequency_hz - hz).abs() < near) {
            return (
                format!("phase truncation, order {}", t.order),
                Some(t.level_dbc),
            );
        }
        let harmonic =
            (2..=HARMONICS).find(|k| (folded(f64::from(*k) * s.carrier_hz) - hz).abs() < near);
        match harmonic {
            Some(k) => (
                format!("table rounding, harmonic {k}"),
                s.predicted.table_dbc,
            ),
            None => ("table rounding".to_owned(), s.predicted.table_dbc),
        }
    };
    let spurs = measured.strongest.iter().enumerate();
    spurs
        .map(|(k, spur)| {
            let (name, predicted) = name(spur.frequency_hz);
            let is_truncation = name.starts_with("phase");
            Named {
                frequency_hz: spur.frequency_hz,
                level_dbc: spur.level_dbc,
                // Of the table, theory knows the worst line only.
                predicted_dbc: predicted.filter(|_| is_truncation || k == 0),
                name,
            }
        })
        .collect()
}

/// Spectrum of the oscillator's sine with named spurs.
fn oscillator(e: &Equivalence, design: &Design, width: f64) -> Figure {
    let lines = spectrum(design);
    let named = named(e, design.circuit.sample_rate_hz);
    let truncation = &e.nco_spurs.predicted.strongest;
    let predicted: Vec<(f64, f64)> = truncation
        .iter()
        .take(8)
        .map(|t| (1e-3 * t.frequency_hz, t.level_dbc))
        .collect();
    let points: Vec<(f64, f64)> = lines.iter().map(|(hz, db)| (1e-3 * hz, *db)).collect();
    let levels = points.iter().chain(&predicted).map(|p| p.1);
    let found = Interval::of(levels.chain([0.0]));
    let y = axis(
        Interval {
            low: found.low - 8.0,
            high: 12.0,
        },
        "level",
        "dBc",
    );
    let half = 0.5e-3 * design.circuit.sample_rate_hz;
    let x = axis(
        Interval {
            low: 0.0,
            high: half,
        },
        "frequency",
        "kHz",
    );
    let mut svg = Svg::new(width);
    svg.legend(
        [
            ("cooling", Swatch::Marker(Shape::Down), "carrier"),
            ("before dots", DOT, "every line of the sine"),
            (
                "fixed",
                Swatch::Marker(Shape::Circle),
                "the strongest spurs, named",
            ),
            (
                "c",
                Swatch::Marker(Shape::Cross),
                "predicted phase truncation",
            ),
        ]
        .map(|(class, swatch, words)| (class, swatch, words.to_owned())),
    );
    let mut frame = svg.frame(280.0, y.room(), x, y.clone());
    if points.len() <= STROKES {
        let strokes: Vec<_> = points.iter().map(|p| (p.0, y.interval.low, p.1)).collect();
        frame.bars("before", &strokes);
    }
    frame.cloud("before", points.into_iter());
    let carrier = (1e-3 * e.nco_spurs.carrier_hz, 0.0);
    frame.bars("cooling", &[(carrier.0, y.interval.low, 0.0)]);
    frame.markers("cooling", Shape::Down, 5.0, &[carrier]);
    frame.markers("c", Shape::Cross, 5.0, &predicted);
    let strongest: Vec<_> = named
        .iter()
        .map(|s| (1e-3 * s.frequency_hz, s.level_dbc))
        .collect();
    frame.markers("fixed", Shape::Circle, 6.0, &strongest);
    // Numbers of the table, where they do not cover one another.
    let mut taken: Vec<f64> = vec![carrier.0];
    for (k, (spur, place)) in named.iter().zip(&strongest).enumerate() {
        if taken.iter().all(|x| (x - place.0).abs() > 0.05 * half) {
            frame.note_above("tick", *place, &(k + 1).to_string());
            taken.push(place.0);
        }
        let said = format!(
            "{}: {}\n{} Hz, {} dBc",
            k + 1,
            spur.name,
            significant(spur.frequency_hz, 7),
            fixed(spur.level_dbc, 2)
        );
        frame.hint(9.0, *place, &said);
    }
    svg.add(&frame);
    svg.figure(
        "Spectrum of the oscillator",
        "The sine of the circuit's own block, bit for bit, at the design's tuning word. Numbers are those of the table.",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_normal_distribution() {
        for (z, share) in [(0.0, 0.5), (1.0, 0.841_344_7), (-2.0, 0.022_750_1)] {
            assert!((below(z) - share).abs() < 1e-6, "{z}");
        }
    }
}
