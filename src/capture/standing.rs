//! Lines that stand out of what a model leaves, and which of them are new ones: neither the quantiser's nor a bend's.

use super::around::{Around, around, without_wander};
use super::candidates::Known;
use super::columns::{LINES, Model};
use super::gram::Combo;
use super::input::Capture;
use super::spectrum::{self, Line};
use super::{harmonics, mains, rounding, skirts, spur, steps};

/// Lines at places of truncation that are tried together in a bend's place: a spur of the phase is a pair.
const PAIR: usize = 2;

/// Resolutions by which a line of the quantiser may be off its place where the tone comes back to its codes after few rows,
/// and how many rows a place such a capture has: slow noise moves the codes over the steps by and by, and the places are too
/// few to be met by chance.
const BESIDE: f64 = 8.0;
const ROWS_OF_A_PLACE: u64 = 320;

/// What stands out around a model.
struct Standing<'a> {
    known: &'a Known,
    model: &'a Model,
    around: &'a Around,
    /// Strongest first.
    lines: Vec<Line>,
    /// Amplitudes of both tones, codes.
    tones: [f64; 2],
    /// The quantiser's steps show.
    sharp: bool,
    /// Turns a sample.
    resolution: f64,
    /// Turns a sample by which a line of the quantiser may be off its place.
    beside: f64,
}

impl<'a> Standing<'a> {
    fn of(capture: &Capture, known: &'a Known, model: &'a Model, around: &'a Around) -> Self {
        let spectrum = around.spectrum(capture);
        let lines = skirts::with_hidden(capture, around, &spectrum, &model.tone, (12, 3.0));
        let resolution = 1.0 / capture.rows() as f64;
        let is_short = |period: u64| period * ROWS_OF_A_PLACE <= capture.rows() as u64;
        let short = model.tone.period().is_some_and(is_short);
        Standing {
            known,
            model,
            around,
            lines: without_wander(model, around, lines),
            tones: around.free.map(|[sin, cos]| sin.hypot(cos)),
            sharp: steps::is_sharp(&model.neutral, model),
            resolution,
            beside: resolution * if short { BESIDE } else { 1.0 },
        }
    }

    /// Where the steps show, those lines that are none of the quantiser's own, unless they are the mains', are lines.
    fn is_rounding(&self, line: &Line) -> bool {
        let tone = &self.model.tone;
        self.sharp
            && !mains::is_mains(self.known, line.turns, 0.5 * self.resolution)
            && rounding::explains(tone, self.tones, line.turns, self.beside, line.amplitudes)
    }

    fn refined(&self, line: &Line) -> f64 {
        let [drive, sense] = &self.around.training;
        spectrum::refine([drive, sense], self.around.noise, line.turns)
    }

    /// The order of the harmonic that is within so many resolutions of a frequency (turns a sample).
    fn order(&self, turns: f64, within: f64) -> Option<usize> {
        let is_mains = mains::is_mains(self.known, turns, 0.5 * self.resolution);
        harmonics::order(&self.model.tone, turns, within * self.resolution).filter(|_| !is_mains)
    }

    /// The same, of a bin: it tells the frequency to half a resolution, its surroundings to a tenth of one where it
    /// stands out at all.
    fn order_of(&self, line: &Line) -> Option<usize> {
        self.order(line.turns, 0.7)
    }

    /// The strongest low harmonic at a place that no truncation has: it tells that the tone is bent.
    fn telling(&self) -> Option<&Line> {
        let is_place = |turns| spur::is_place(&self.model.tone, turns, self.resolution);
        let is_told = |turns| is_low(self.order(turns, 0.3)) && !is_place(turns);
        let mut low = self.lines.iter().filter(|l| is_low(self.order_of(l)));
        low.find(|line| is_told(self.refined(line)) && !self.is_rounding(line))
    }

    /// The strongest lines at places of truncation, turns a sample.
    fn spurs(&self) -> Vec<f64> {
        let lines = self.lines.iter().filter(|line| !self.is_rounding(line));
        let places = lines.map(|line| self.refined(line));
        let is_place = |turns: &f64| spur::is_place(&self.model.tone, *turns, self.resolution);
        let is_new = |turns: &f64| !self.is_known(*turns);
        let room = LINES.saturating_sub(self.model.lines.len()).min(PAIR);
        places.filter(is_place).filter(is_new).take(room).collect()
    }

    /// A line that is known is not found again: its rest is the frequency's error.
    fn is_known(&self, turns: f64) -> bool {
        let near = |t: &f64| (t - turns).abs() < self.resolution;
        self.model.lines.iter().any(near)
    }

    /// Frequencies of new lines, turns a sample. Besides the strongest, those are taken that are no sidelobe of a
    /// stronger one. Where a harmonic tells that the tone is bent, all its harmonics are the bend's.
    fn new_lines(&self) -> Vec<f64> {
        let telling = self.telling();
        // Harmonics fall with their order: a line of a high one that is stronger than what tells is not of them.
        let is_own = |line: &Line| {
            let order = self.order_of(line);
            telling.is_some_and(|t| is_low(order) || order.is_some() && line.surprise < t.surprise)
        };
        let mut out = Vec::new();
        let mut stronger: Vec<&Line> = Vec::new();
        for line in &self.lines {
            if self.model.lines.len() + out.len() >= LINES {
                break;
            }
            let sidelobe = stronger.iter().any(|s| {
                let apart = (s.turns - line.turns) / self.resolution;
                apart.abs() < 8.0 || line.surprise * apart * apart < 4.0 * s.surprise
            });
            if sidelobe || self.is_known(line.turns) {
                continue;
            }
            if is_own(line) {
                // What is beside it may be its sidelobe.
                stronger.push(line);
            } else if !self.is_rounding(line) {
                out.push(self.refined(line));
                stronger.push(line);
            }
        }
        out
    }
}

fn is_low(order: Option<usize>) -> bool {
    order.is_some_and(|k| k <= harmonics::TELLING)
}

/// Looks for new lines; true if any was added.
pub fn add_lines(capture: &Capture, known: &Known, model: &mut Model, around: &Around) -> bool {
    let new = Standing::of(capture, known, model, around).new_lines();
    model.lines.extend(&new);
    !new.is_empty()
}

/// Adds spurs where they are all that seemed to tell of a bend; true if any was added. A line that goes with the phase
/// is in part a function of the signal, and what the tables of the generous fit take of it leaves harmonics of their own:
/// beside the line they are gone, as the harmonics of a bend are not.
pub fn add_spurs(
    capture: &Capture,
    known: &Known,
    model: &mut Model,
    base: &[Combo],
    seen: &mut Around,
) -> bool {
    let standing = Standing::of(capture, known, model, seen);
    if standing.telling().is_none() {
        return false;
    }
    let spurs = standing.spurs();
    if spurs.is_empty() {
        return false;
    }
    let mut trial = model.clone();
    trial.lines.extend(spurs);
    let beside = around(capture, &mut trial, base, false);
    if Standing::of(capture, known, &trial, &beside)
        .telling()
        .is_some()
    {
        return false;
    }
    *model = trial;
    *seen = beside;
    true
}

#[cfg(test)]
mod tests {
    use super::super::synthetic_rows::{WORDS, codes, judged, meta, names};
    use crate::thermal::synthetic::Random;
    use std::f64::consts::TAU;

    #[test]
    fn beside_its_place_a_line_of_the_quantiser_is_one_where_slow_noise_moves_the_codes() {
        const ROWS: usize = 65_536;
        let word: u32 = 5 << 25;
        for seed in 1..5 {
            let mut random = Random::new(seed);
            let made = [0, 1].map(|channel| {
                let slow: Vec<Vec<f64>> = [0.999, 0.9999]
                    .iter()
                    .map(|rho| random.coloured(ROWS, *rho))
                    .collect();
                let code = |row: usize| {
                    let angle = TAU * f64::from(word.wrapping_mul(row as u32)) / 4_294_967_296.0;
                    let tone = match channel {
                        0 => -1500.0 * angle.cos(),
                        _ => 300.0 * (angle + 0.3).sin() + 90.0 * (angle + 0.3).cos(),
                    };
                    let slow: f64 = slow.iter().map(|s| s[row]).sum();
                    (tone + 0.03 * slow + 0.05 * random.normal()).round() as i32
                };
                (0..ROWS).map(code).collect::<Vec<i32>>()
            });
            let (_, _, found) = judged(made, meta(word));
            assert!(names(&found).is_empty(), "{seed}: {:?}", names(&found));
        }
    }

    #[test]
    fn a_spur_of_the_phase_that_goes_with_it_is_no_bend() {
        // Phase modulation at 16 times the tone: lines at 15 and 17 times.
        let word = WORDS[1];
        for (depth, phase) in [
            (1e-3, 0.3),
            (1e-3, 3.6),
            (1e-2, 0.3),
            (1e-2, 1.9),
            (1e-2, 3.6),
        ] {
            let codes = codes(3, word, |channel, row, x| {
                let turns = f64::from(word.wrapping_mul(row as u32)) / 4_294_967_296.0;
                let late = depth * (TAU * 16.0 * turns + phase).sin();
                let tone = |angle: f64| match channel {
                    0 => -1500.0 * angle.cos(),
                    _ => 300.0 * (angle + 0.3).sin() + 90.0 * (angle + 0.3).cos(),
                };
                x + tone(TAU * turns + late) - tone(TAU * turns)
            });
            let found = judged(codes, meta(word)).2;
            let told = (names(&found), found.structure.left);
            assert_eq!(told, (vec!["nco_spur"], false), "{depth} {phase}");
        }
    }

    #[test]
    fn a_bend_that_harmonics_tell_of_is_no_spur() {
        for seed in 1..4 {
            let codes = codes(seed, WORDS[1], |channel, _, x| {
                let u: f64 = x / [1500.0, 330.0][channel];
                x + 4.0 * u.powi(3) + 2.0 * (9.0 * u).sin()
            });
            let found = judged(codes, meta(WORDS[1])).2;
            let names = names(&found);
            assert!(
                names.contains(&"adc_integral_nonlinearity"),
                "{seed} {names:?}"
            );
            assert!(!names.contains(&"nco_spur"), "{seed} {names:?}");
        }
    }
}
