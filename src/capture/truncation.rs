//! How many phase bits the oscillator's table is addressed with and how they are rounded, if truncation shows in the
//! codes (`table_address_bits` and `address_rounding` of the contract's oscillator).

use super::around::{LEAST_VARIANCE, generous};
use super::candidates::{base_ridge, per_column};
use super::columns::{LINES, Model, TRUNCATED, line};
use super::gram::{Combo, Detail, Gram, Summed, solve};
use super::input::Capture;
pub use super::signal::Truncation;
use super::spectrum::{self, Spectrum};
use super::spur::{self, ADDRESS_BITS};
use std::f64::consts::TAU;

/// Least gain in log-likelihood for a number of bits to be looked at.
const LEAST_GAIN: f64 = 8.0;

/// Least surprise of the two strongest lines together.
const LEAST_SURPRISE: f64 = 12.0;

/// Nats by which lines must be better than a truncated tone: where they are the same, their fits differ by rounding.
const ALIKE: f64 = 1.0;

/// The address bits and their rounding whose truncated tone explains most of the residuals (zero where rows are
/// left out; constant and tone already taken off); `None` if none does, or the tuning word is not known. `tones` are
/// sine and cosine of both tones as they are in the codes.
pub fn best(
    capture: &Capture,
    model: &Model,
    base: &[Combo],
    residuals: [&[f64]; 2],
    tones: [[f64; 2]; 2],
    spectrum: &Spectrum,
) -> Option<Truncation> {
    let word = model.tone.word?;
    let variances = [0, 1].map(|c: usize| spectrum.variance(c).max(LEAST_VARIANCE));
    let mut best: Option<(f64, Truncation)> = None;
    for bits in ADDRESS_BITS {
        let modulus = 1u64 << (32 - bits);
        if u64::from(word) % modulus == 0 {
            continue;
        }
        // The strongest two first.
        let places = spur::places_of(&model.tone, bits);
        let tells = |at: &&f64| tells(capture, model, **at);
        let surprise = |at: &f64| spectrum.surprise_at(*at, &model.tone, [LEAST_VARIANCE; 2]);
        let strongest = places.iter().take(2).filter(tells);
        if strongest.map(surprise).sum::<f64>() < LEAST_SURPRISE {
            continue;
        }
        for way in Truncation::both(bits) {
            let gain = gain(capture, model, residuals, tones, variances, way);
            if gain > LEAST_GAIN && best.is_none_or(|b| gain > b.0) {
                best = Some((gain, way));
            }
        }
    }
    let way = best?.1;
    let mut places = spur::places_of(&model.tone, way.bits);
    places.retain(|at| tells(capture, model, *at));
    let gain = |at: &f64| line_gain(residuals, variances, *at);
    places.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    (!is_lines(capture, model, base, way, &places)).then_some(way)
}

/// Whether a line at the first of some places (turns a sample), or a pair at two of them, explains the codes better than
/// a truncated tone, with all else fitted beside each. Of what truncation makes no two lines are all, but where so few
/// bits are lost that a line has the truncated tone's columns in other words.
fn is_lines(
    capture: &Capture,
    model: &Model,
    base: &[Combo],
    way: Truncation,
    places: &[f64],
) -> bool {
    let resolution = 1.0 / capture.rows() as f64;
    let first = places.first().copied();
    let apart = |at: &&f64| first.is_some_and(|f| (*at - f).abs() > resolution);
    let second = places.iter().find(apart).copied();
    let known = model.lines.len();
    let mut trial = model.clone();
    trial.truncation = Some(way);
    let room = LINES.saturating_sub(known);
    trial
        .lines
        .extend(first.into_iter().chain(second).take(room));
    let of = |columns: [usize; 2]| {
        let each = [0, 1].into_iter().flat_map(|c| columns.map(|k| (c, k)));
        each.map(|(c, k)| Combo::one("", c, k)).collect::<Vec<_>>()
    };
    let rest = generous(base, model);
    let truncated = of([TRUNCATED, TRUNCATED + 1]);
    let lines = (known..trial.lines.len()).flat_map(|i| of([line(i).0, line(i).1]));
    let lines: Vec<Combo> = lines.collect();
    let all: Vec<&Combo> = rest.iter().chain(&truncated).chain(&lines).collect();
    let gram = Gram::over(capture, &trial, &Summed::of(&all, 1));
    let gain = |own: &[Combo]| {
        let combos: Vec<&Combo> = rest.iter().chain(own).collect();
        let mut ridge = base_ridge(base);
        ridge.resize(combos.len(), 0.0);
        solve(gram.all(), &combos, &ridge, Detail::Gain).gain
    };
    let single = gain(lines.get(..4).unwrap_or_default());
    let more = lines.len().saturating_sub(4) as f64 * per_column(capture.training_rows());
    single.max(gain(&lines) - more) > gain(&truncated) + ALIKE
}

/// Whether a line at a place (turns a sample) tells of truncation: near the tone or near zero frequency it may be noise
/// of the amplitude or of the offset.
fn tells(capture: &Capture, model: &Model, place: f64) -> bool {
    let apart = (place - model.tone.folded()).abs().min(place);
    apart * (capture.rows() as f64) >= 12.0
}

/// Gain in log-likelihood of the truncated tone in the channel or channels that have it.
fn gain(
    capture: &Capture,
    model: &Model,
    residuals: [&[f64]; 2],
    tones: [[f64; 2]; 2],
    variances: [f64; 2],
    way: Truncation,
) -> f64 {
    // The mean error of the phase, turns: that of the tone itself, late or not.
    let mean = (0.5 - way.added()) / way.steps();
    let mut with = [[0.0; 2]; 2];
    let mut energy = 0.0;
    for row in 0..capture.rows() {
        let phase = model.tone.phase(row);
        let late = way.phase(phase) - phase + mean;
        let (sin, cos) = model.phases.at(row);
        let small = TAU * late;
        energy += 0.5 * small * small;
        for (with, residual) in with.iter_mut().zip(residuals) {
            let r = residual.get(row).copied().unwrap_or(0.0);
            with[0] += r * small * cos;
            with[1] -= r * small * sin;
        }
    }
    if energy <= 0.0 {
        return 0.0;
    }
    let of = |c: usize| {
        // Where a single bit is lost, one rounding is early where the other is late: only the tone's sign tells them.
        let along: f64 = with[c].iter().zip(tones[c]).map(|(w, t)| w * t).sum();
        if along <= 0.0 {
            return 0.0;
        }
        with[c].iter().map(|w| w * w).sum::<f64>() / (2.0 * energy * variances[c])
    };
    of(0).max(of(1)).max(of(0) + of(1) - 2.0)
}

/// The same of a single sinusoid of any phase at a frequency (turns a sample).
fn line_gain(residuals: [&[f64]; 2], variances: [f64; 2], turns: f64) -> f64 {
    let of = |c: usize| {
        let rows = residuals[c].len().max(1) as f64;
        spectrum::power(residuals[c], turns) / (rows * variances[c])
    };
    of(0).max(of(1)).max(of(0) + of(1) - 2.0)
}

#[cfg(test)]
mod tests {
    use super::super::report::Findings;
    use super::super::synthetic_rows::{WORDS, codes, judged, meta, names};
    use super::*;

    /// What is found in codes of 12 bits whose tones are read at truncated phases, `added` steps early.
    fn found(word: u32, bits: u32, added: f64) -> Findings {
        let steps = f64::powi(2.0, bits as i32);
        let codes = codes(5, word, |channel, row, x| {
            let turns = f64::from(word.wrapping_mul(row as u32)) / 4_294_967_296.0;
            let read = (turns * steps + added).floor() / steps;
            let tone = |turns: f64| match channel {
                0 => -1500.0 * (TAU * turns).cos(),
                _ => 300.0 * (TAU * turns + 0.3).sin() + 90.0 * (TAU * turns + 0.3).cos(),
            };
            x + tone(read) - tone(turns)
        });
        judged(codes, meta(word)).2
    }

    #[test]
    fn both_roundings_of_the_address_are_named_and_explained() {
        for (bits, half_up) in [(7, false), (7, true), (9, false), (9, true)] {
            let found = found(WORDS[1], bits, if half_up { 0.5 } else { 0.0 });
            let told = (names(&found), found.structure.left);
            assert_eq!(told, (vec!["nco_spur"], false), "{bits} {half_up}");
            let truncation = found.models[1].truncation;
            assert_eq!(truncation, Some(Truncation { bits, half_up }));
        }
    }

    #[test]
    fn a_step_tells_the_address_and_the_largest_spur_from_the_tone() {
        let step = &found(WORDS[1], 7, 0.5).steps[0];
        let of = |name: &str| (step.parameters[name], step.parameter_std[name]);
        assert_eq!(of("address_bits"), (7.0, 0.0));
        assert_eq!(of("address_rounding_half_up"), (1.0, 0.0));
        let (tone, _) = of("drive_truncated_tone_amplitude_codes");
        assert!((tone - 1500.0).abs() < 5.0, "{tone}");
        // 2^-7 of the tone.
        let (spur, std) = of("drive_largest_spur_codes");
        assert!((spur - 1500.0 / 127.0).abs() < 0.1, "{spur}");
        assert!(std > 0.0 && std < 0.01, "{std}");
    }

    #[test]
    fn a_single_line_at_the_strongest_place_is_no_truncation() {
        let word = WORDS[1];
        for size in [4.0, 40.0] {
            let codes = codes(5, word, |channel, row, x| {
                let steps = (-63 * i64::from(word) * row as i64).rem_euclid(1 << 32);
                let wave = (TAU * steps as f64 / 4_294_967_296.0 + 1.1).sin();
                x + [size, 0.2 * size][channel] * wave
            });
            let found = judged(codes, meta(word)).2;
            let told = (names(&found), found.structure.left);
            assert_eq!(told, (vec!["nco_spur"], false), "{size}");
            let step = &found.steps[0];
            assert!(found.models[1].truncation.is_none(), "{size}");
            let amplitude = step.parameters["line1_drive_amplitude_codes"];
            assert!((amplitude / size - 1.0).abs() < 0.02, "{size} {amplitude}");
        }
    }

    #[test]
    fn where_one_bit_is_lost_the_sign_tells_the_rounding() {
        for (half_up, added) in [(false, 0.0), (true, 0.5)] {
            // 3/1024 turn: with 9 bits every second phase is between two addresses.
            let found = found(3 << 22, 9, added);
            let truncation = found.models[1].truncation;
            assert_eq!(truncation, Some(Truncation { bits: 9, half_up }));
        }
    }
}
