//! The error budget: what each word adds to the figures, by theory and measured.
//!
//! A word is *alone on* where every other word is made so fine that it adds nothing, and *alone off* where it alone is
//! made so. The two differ where roundings interact; neither is a sum of the others, so nothing is counted twice. The
//! theory is that of [`crate::equivalence::predicted`], of the rate's error in the run with the word alone on; where one
//! of its conditions does not hold the line has the measured figures and says which.

use super::figures::{Figures, added};
use super::measure::run;
use super::retune::with_lengths;
use super::verify::Verifier;
use crate::circuit::engine::ArithmeticKind;
use crate::circuit::scale::sense_lsb_dps;
use crate::cosim::stream::stimulus;
use crate::design::Design;
use crate::design::word::Word;
use crate::equivalence::predicted::predict;
use crate::error::Result;
use crate::nodes::quantisation::cic_noise_gain;
use crate::parallel::in_parallel;
use serde::Serialize;

/// A word's line.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Line {
    /// The dotted key.
    pub name: &'static str,
    /// Its length.
    pub length: u32,
    /// rms of the rate's error in a row with this word alone on, by theory, deg/s.
    pub predicted_rms_dps: Option<f64>,
    /// The same measured, deg/s; null of the ADC's code, before which that run does not begin (see `alone_on`).
    pub measured_rms_dps: Option<f64>,
    /// Conditions of the theory that do not hold, as in `equiv.json`; without a prediction the reason.
    pub flags: Vec<&'static str>,
    /// What the word adds alone; null where no design has the others fine enough.
    pub alone_on: Option<Figures>,
    /// What goes away without it: figures of the design less those with this word made fine, noise and rms in squares.
    pub alone_off: Option<Figures>,
}

/// The budget of a design.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Budget {
    /// By word, in the order of the circuit.
    pub lines: Vec<Line>,
    /// All words together.
    pub total: Figures,
    /// With every word made fine: what the measurement itself does not resolve.
    pub floor: Option<Figures>,
}

/// Bits more that make a word fine.
const FINER: u32 = 8;
/// ADC samples that theory and measurement of the rate's error are taken over.
const SAMPLES: usize = 120_000;

/// The budget of a design of which `verifier` knows the twin.
///
/// # Errors
/// A phase loop that cannot lock.
pub fn budget(design: &Design, verifier: &Verifier, threads: usize) -> Result<Budget> {
    let words: Vec<Word> = Word::ALL
        .into_iter()
        .filter(|w| w.length(design).is_some())
        .collect();
    let figures = |d: &Design| {
        let output = run(&d.without_stops(), ArithmeticKind::Fixed, &verifier.plan).ok()?;
        Some(added(&verifier.plan, &output, &verifier.twin))
    };
    let total = verifier.figures(&design.without_stops())?;
    let all_fine = fine(design, &words);
    let floor = figures(&all_fine);
    let lines = in_parallel(&words, threads, &|_| {}, |word| {
        let length = word.length(design).unwrap_or(0);
        let others: Vec<Word> = words.iter().copied().filter(|w| w != word).collect();
        let on = fine(design, &others);
        let off = figures(&fine(design, &[*word]));
        let theory = theory(&on, *word);
        let (predicted_rms_dps, measured_rms_dps, flags) = theory.unwrap_or_default();
        Line {
            name: word.key(),
            length,
            predicted_rms_dps,
            measured_rms_dps,
            flags,
            alone_on: figures(&on),
            alone_off: off.map(|off| less(&total, &off)),
        }
    });
    Ok(Budget {
        lines,
        total,
        floor,
    })
}

/// The design with these words longer, as far as there are such designs, word by word.
fn fine(design: &Design, words: &[Word]) -> Design {
    let mut lengths: Vec<(Word, u32)> = Vec::new();
    // Accumulator before coefficients: it has to hold them.
    let mut ordered = words.to_vec();
    ordered.sort_by_key(|w| (*w == Word::Coefficients, *w));
    let mut out = design.clone();
    for word in ordered {
        let given = word.length(design).unwrap_or(0);
        for more in (1..=FINER).rev() {
            let mut tried = lengths.clone();
            tried.push((word, given + more));
            if let Ok(finer) = with_lengths(design, &tried) {
                (lengths, out) = (tried, finer);
                break;
            }
        }
    }
    out
}

/// Predicted and measured rms of the rate's error, with the flags.
fn theory(design: &Design, word: Word) -> Result<(Option<f64>, Option<f64>, Vec<&'static str>)> {
    if word == Word::Adc {
        // The twin of that run starts at the codes. Of a rounding that is uniform: an LSB over the root of twelve.
        let d = &design.circuit.decimator;
        let width = d.ratio as usize * d.differential_delay as usize;
        let gain = (2.0 * cic_noise_gain(d.stages, width) / 12.0).sqrt();
        let predicted = sense_lsb_dps(design) * gain;
        // With less noise than half an LSB the codes repeat, and so do their errors.
        let busy = design.thermal_run.adc_noise_lsb >= 0.5;
        let flags = if busy { vec![] } else { vec!["few_words"] };
        return Ok((busy.then_some(predicted), None, flags));
    }
    let (drive, sense) = stimulus(design, SAMPLES)?;
    let seen = crate::nodes::run::run(design, &drive, &sense);
    let at = seen
        .places
        .bias
        .map_or(seen.places.decimator + 2, |b| b + 2);
    let prediction = predict(design, &seen)
        .into_iter()
        .nth(at)
        .unwrap_or_default();
    let scale = if seen.places.bias.is_some() {
        1.0
    } else {
        crate::circuit::scale::full_scale_dps(design)
    };
    let node = seen.nodes.get(at);
    let measured = node.map(|n| scale * (n.sum_square / n.count.max(1) as f64).sqrt());
    Ok((
        prediction.rms.map(|r| r * scale),
        measured,
        prediction.flags,
    ))
}

/// What goes away from `all` to `without`: signed figures as they are, others in squares.
fn less(all: &Figures, without: &Figures) -> Figures {
    let squares = |a: f64, b: f64| {
        let d = a * a - b * b;
        d.abs().sqrt().copysign(d)
    };
    let noise = squares(all.noise_dps_rthz, without.noise_dps_rthz);
    Figures {
        bias_dps: all.bias_dps - without.bias_dps,
        drift_dps: all.drift_dps - without.drift_dps,
        noise_dps_rthz: noise,
        arw_deg_rth: super::figures::arw_deg_rth(noise),
        scale_factor_ppm: all.scale_factor_ppm - without.scale_factor_ppm,
        spur_dps: squares(all.spur_dps, without.spur_dps),
        ..*all
    }
}
