//! The oscillator's spurs: measured on the circuit's own block in its own arithmetic, held against
//! the formula of phase truncation, and carried through demodulator and decimator into deg/s.

pub use super::lines::Method;
use super::lines::{Line, Lines, lines};
use super::truncation::{Predicted, Word, predict};
use crate::circuit::nco::Oscillator;
use crate::design::{Decimator, Design};
use crate::numeric::arithmetic::Block;
use crate::numeric::fixed::Fixed;
use std::f64::consts::PI;

/// log2 of the longest sequence that is looked at.
const SAMPLE_BITS: u32 = 20;

/// Measured spurs that are listed.
const LISTED: usize = 8;

/// Where truncation dominates, measured and predicted level agree if they differ by no more, dB.
const AGREEMENT_DB: f64 = 1.0;

/// A truncation spur of higher order is 30 dB below the worst: where the two meet, it hardly adds
/// (0.3 dB).
const NEIGHBOURS: i64 = 32;

/// The spurs of a design's oscillator, at the tuning word of the design (a phase loop moves it).
#[derive(Debug, Clone, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct NcoSpurs {
    /// Hz, folded into 0 to half the sample rate.
    pub carrier_hz: f64,
    /// How the spectrum was made.
    pub method: Method,
    /// Samples of the oscillator's sine that were transformed.
    pub samples: usize,
    /// Lines below it are not seen, dBc.
    pub floor_dbc: f64,
    /// What was measured; absent if the sine has no carrier (it stands still, or is sampled at its zeros), or
    /// one too near to zero or half the sample rate to be told from its image.
    pub measured: Option<Measured>,
    /// What theory says.
    pub predicted: Predicted,
    /// What theory says is the strongest.
    pub dominated_by: Dominant,
    /// Where phase truncation dominates: is the measured worst spur within 1 dB of the predicted one, at
    /// the frequency of one of the strongest predicted ones? Absent where the formula says nothing.
    pub agrees: Option<bool>,
    /// Why `agrees` is absent.
    pub reason: Option<String>,
    /// The worst tone that a spur makes of the design's quadrature (`thermal_run.quadrature_dps`), deg/s
    /// of amplitude in the decimated rate: quadrature * 10^(dBc/20) * the decimator's response
    /// at the difference or the sum of spur and carrier, over all measured and the strongest predicted spurs. A tone
    /// above half the decimated rate counts like any other, as decimation folds it into the band;
    /// tones that fold onto one another are not added up.
    pub quadrature_tone_dps: f64,
}

/// The measured spectrum of the sine.
#[derive(Debug, Clone, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct Measured {
    /// Spurious-free dynamic range: carrier over worst spur, dB, positive. Absent: no spur above the floor.
    pub sfdr_dbc: Option<f64>,
    /// The strongest spurs, strongest first; at most 8. Zero frequency is none.
    pub strongest: Vec<Spur>,
    /// Spurs above the floor.
    pub spurs: usize,
    /// Spurs within 20 dB of the strongest, with it.
    pub strong_spurs: usize,
    /// Power of all but carrier and zero frequency, dB from the carrier's; absent: none.
    pub total_dbc: Option<f64>,
}

/// A measured spur.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct Spur {
    /// Hz, above 0 to half the sample rate.
    pub frequency_hz: f64,
    /// dB from the carrier.
    pub level_dbc: f64,
}

/// What makes the strongest spur.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Dominant {
    /// The bits of the phase that do not address the table.
    PhaseTruncation,
    /// The rounding of the table's entries.
    Table,
    /// There is no spur.
    None,
}

/// Measures the spurs of the design's oscillator and compares them with theory.
///
/// If the sine repeats within 2^20 samples, one period is transformed and every line is one bin, exact
/// to the rounding of f64 (floor -260 dBc). Else 2^20 samples under a 7-term Blackman-Harris
/// window (floor -170 dBc), lines interpolated to 0.006 dB; spurs nearer than 8 bins to each other are then
/// one line.
pub fn nco_spurs(design: &Design) -> NcoSpurs {
    let circuit = &design.circuit;
    let oscillator = Oscillator::new(&circuit.nco);
    let quadrature_dps = design.thermal_run.quadrature_dps.abs();
    let (rate, decimator) = (circuit.sample_rate_hz, &circuit.decimator);
    spurs_of(&oscillator, rate, decimator, quadrature_dps)
}

/// Every line of the design's sine above the method's floor but the carrier, by frequency: (Hz, dB from the carrier). Empty
/// where there is no carrier to measure them from.
pub fn spectrum(design: &Design) -> Vec<(f64, f64)> {
    let oscillator = Oscillator::new(&design.circuit.nco);
    let (method, samples) = method(&Word::of(&oscillator));
    let found = lines(&sine(&oscillator, samples), method);
    let rate = design.circuit.sample_rate_hz;
    found.map_or(Vec::new(), |l| {
        let line = |o: &Line| (o.frequency * rate, level_dbc(o, &l.largest));
        l.others.iter().map(line).collect()
    })
}

/// How a sine is looked at, and how many samples of it.
fn method(word: &Word) -> (Method, usize) {
    match word.period_bits() {
        bits @ 0..=SAMPLE_BITS => (Method::WholePeriod, 1usize << bits),
        _ => (Method::BlackmanHarris7, 1 << SAMPLE_BITS),
    }
}

/// The spurs of any oscillator, such as one with another table.
pub(super) fn spurs_of(
    oscillator: &Oscillator,
    sample_rate_hz: f64,
    decimator: &Decimator,
    quadrature_dps: f64,
) -> NcoSpurs {
    let word = Word::of(oscillator);
    let (method, samples) = method(&word);
    let carrier = word.frequency(0);
    let from_edge = carrier.min(0.5 - carrier) * samples as f64;
    let is_apart =
        from_edge > (method.half_width_bins() + 1) as f64 || method == Method::WholePeriod;
    let spectrum = lines(&sine(oscillator, samples), method)
        .filter(|l| is_apart && (l.largest.frequency - carrier).abs() * (samples as f64) < 1.0);
    let predicted = predict(oscillator, sample_rate_hz);
    let dominated_by = dominant(&predicted);
    let measured = spectrum.as_ref().map(|l| measured(l, sample_rate_hz));
    let verdict = match &measured {
        _ if word.period_bits() < 2 => {
            Err("the sine has no carrier at this tuning word".to_owned())
        }
        None => Err("the carrier is too near to zero or half the sample rate".to_owned()),
        Some(measured) => formula_holds(&word, &predicted, dominated_by, method, samples)
            .map(|()| agrees(measured, &predicted, sample_rate_hz / samples as f64)),
    };
    let strongest = predicted.strongest.iter();
    let theory = strongest.map(|s| (s.frequency_hz / sample_rate_hz, s.level_dbc));
    let seen = spectrum.iter().flat_map(|l| {
        let level = |o: &Line| (o.frequency, level_dbc(o, &l.largest));
        l.others.iter().map(level)
    });
    let quadrature_tone_dps = theory
        .chain(seen)
        .map(|(spur, dbc)| {
            let through = product_gain(decimator, spur, carrier);
            quadrature_dps * 10f64.powf(dbc / 20.0) * through
        })
        .fold(0.0, f64::max);
    NcoSpurs {
        carrier_hz: carrier * sample_rate_hz,
        method,
        samples,
        floor_dbc: method.floor_dbc(),
        measured,
        predicted,
        dominated_by,
        agrees: verdict.as_ref().ok().copied(),
        reason: verdict.err(),
        quadrature_tone_dps,
    }
}

/// The sine of the circuit's own block, bit for bit, from the design's start, raw.
pub(super) fn sine(oscillator: &Oscillator, samples: usize) -> Vec<f64> {
    // A phase has at most 64 bits and an entry 40.
    let fixed = Fixed::<i64, i64>::new();
    let mut state = oscillator.start(&fixed);
    let step = |_| {
        let [sine, _cosine] = oscillator.step(&fixed, &mut state, []);
        sine as f64
    };
    (0..samples).map(step).collect()
}

fn level_dbc(line: &Line, carrier: &Line) -> f64 {
    20.0 * (line.amplitude / carrier.amplitude).log10()
}

fn measured(spectrum: &Lines, sample_rate_hz: f64) -> Measured {
    let spur = |line: &Line| Spur {
        frequency_hz: line.frequency * sample_rate_hz,
        level_dbc: level_dbc(line, &spectrum.largest),
    };
    let mut strongest: Vec<Spur> = spectrum.others.iter().map(spur).collect();
    strongest.sort_by(|a, b| b.level_dbc.total_cmp(&a.level_dbc));
    let spurs = strongest.len();
    let worst_dbc = strongest.first().map(|s| s.level_dbc);
    let is_strong = |s: &&Spur| worst_dbc.is_some_and(|w| s.level_dbc >= w - 20.0);
    let strong_spurs = strongest.iter().filter(is_strong).count();
    strongest.truncate(LISTED);
    let carrier_power = spectrum.largest.amplitude.powi(2) / 2.0;
    let total_dbc = 10.0 * (spectrum.rest_power / carrier_power).log10();
    Measured {
        sfdr_dbc: worst_dbc.map(|w| -w),
        strongest,
        spurs,
        strong_spurs,
        total_dbc: (spurs > 0).then_some(total_dbc),
    }
}

fn dominant(predicted: &Predicted) -> Dominant {
    match (predicted.truncation_dbc(), predicted.table_dbc) {
        (None, None) => Dominant::None,
        (Some(truncation), table) if table.is_none_or(|t| truncation >= t) => {
            Dominant::PhaseTruncation
        }
        _ => Dominant::Table,
    }
}

/// Whether the formula of phase truncation says what the measured worst spur should be, and if not,
/// why.
fn formula_holds(
    word: &Word,
    predicted: &Predicted,
    dominated_by: Dominant,
    method: Method,
    samples: usize,
) -> Result<(), String> {
    let Some(truncation) = predicted.truncation_dbc() else {
        let bits = predicted.dropped_bits;
        return Err(format!(
            "the tuning word is a multiple of 2^{bits}: nothing of the phase is truncated"
        ));
    };
    if let (Dominant::Table, Some(table)) = (dominated_by, predicted.table_dbc) {
        return Err(format!(
            "the table's harmonics ({table:.1} dBc) are above the truncation spurs ({truncation:.1} dBc)"
        ));
    }
    if method == Method::WholePeriod {
        return Ok(());
    }
    // Lines that may be taken for the worst spur, or raise it.
    let bins = |order: i64| word.frequency(order) * samples as f64;
    let edges = [bins(0), 0.0, samples as f64 / 2.0];
    let orders = word.orders(NEIGHBOURS);
    let apart = (method.half_width_bins() + 1) as f64;
    for worst in orders.iter().copied().filter(|k| k.abs() == 1) {
        let others = orders.iter().filter(|k| **k != worst).map(|k| bins(*k));
        let nearest = others
            .chain(edges)
            .map(|b| (b - bins(worst)).abs())
            .fold(f64::INFINITY, f64::min);
        if nearest < apart {
            return Err(format!(
                "a strong truncation spur is {nearest:.2} bins of {samples} samples from another line; \
                 {apart} are needed to tell them apart"
            ));
        }
    }
    Ok(())
}

fn agrees(measured: &Measured, predicted: &Predicted, bin_hz: f64) -> bool {
    let (Some(worst), Some(truncation)) = (measured.strongest.first(), predicted.truncation_dbc())
    else {
        return false;
    };
    let is_there = predicted
        .strongest
        .iter()
        .filter(|s| s.level_dbc > truncation - AGREEMENT_DB)
        .any(|s| (s.frequency_hz - worst.frequency_hz).abs() < 0.5 * bin_hz);
    is_there && (worst.level_dbc - truncation).abs() <= AGREEMENT_DB
}

/// What the decimator leaves of the larger of the two products (each of half the factors' amplitudes, doubled
/// here as the rate is) of a spur with an input at the carrier; both in cycles per sample, 0 to 0.5. The sum
/// is never nearer to zero than the difference, but the difference may fall on a zero of the decimator.
pub(super) fn product_gain(decimator: &Decimator, spur: f64, carrier: f64) -> f64 {
    response(decimator, spur - carrier).max(response(decimator, spur + carrier))
}

/// The decimator's response relative to zero frequency, at a frequency in cycles per ADC sample:
/// |sin(pi f R M) / (R M sin(pi f))|^N (Hogenauer 1981).
fn response(decimator: &Decimator, frequency: f64) -> f64 {
    let length = f64::from(decimator.ratio * decimator.differential_delay);
    let below = (PI * frequency).sin();
    if below.abs() < 1e-12 {
        return 1.0;
    }
    let ratio = (PI * frequency * length).sin() / (length * below);
    ratio.abs().powi(decimator.stages as i32)
}
