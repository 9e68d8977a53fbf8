//! Lines that hide themselves. Where held-out rows are left out, a line has skirts, as high beside a strong line as the
//! line itself over a hundred: the noise around it, as a median of bins tells it, then is the line, and no line of any
//! strength stands out. So the strongest are taken off, and what stood there is held against what is left around it.

use super::around::{Around, LEAST_VARIANCE};
use super::input::{Capture, Part};
use super::spectrum::{self, Line, Spectrum};
use super::tone::Tone;
use std::f64::consts::TAU;

/// Lines that are taken off.
const MOST: usize = 4;
/// Periods in the record from which on. The spectrum of a wander is steep below, so that its first bins stand out of
/// what is left without them: slow mains are looked for beside it.
const LEAST_PERIODS: f64 = 17.0;
/// Amplitude of the held-out rows' highest sidelobes, relative: of what is slower than [`LEAST_PERIODS`] no line beside
/// it has more by skirts alone.
const SKIRT: f64 = 0.28;
/// Resolutions between lines: nearer ones are a line's own sidelobes, and of a wander's bins, each taken off, none would
/// be left to tell it.
const APART: f64 = 8.0;
/// Two peaks of one line are nearer than this, in resolutions.
const SAME: f64 = 1.5;

/// Some lines and those that hide themselves, strongest first. `lines` are those of the training rows' `spectrum` that
/// stand out at once, harmonics of the tone up to `harmonics` and what is within `apart` resolutions of them aside.
pub fn with_hidden(
    capture: &Capture,
    around: &Around,
    spectrum: &Spectrum,
    tone: &Tone,
    (harmonics, apart): (usize, f64),
) -> Vec<Line> {
    let least = [LEAST_VARIANCE; 2];
    let mut lines = spectrum.lines(tone, harmonics, apart, least);
    let (taken, left) = strongest(capture, around, spectrum, tone, (harmonics, apart));
    let Some(left) = left else { return lines };
    let rows = capture.rows() as f64;
    let is_near = |all: &[Line], line: &Line| {
        let near = |l: &Line| (l.turns - line.turns).abs() * rows < SAME;
        all.iter().any(near)
    };
    let places: Vec<f64> = taken.iter().map(|l| l.turns).collect();
    let floors = left.floors(tone, least, &places);
    for line in spectrum.lines_over(&floors, tone, harmonics, apart) {
        if is_near(&taken, &line) && !is_near(&lines, &line) {
            lines.push(line);
        }
    }
    lines.sort_by(|a, b| b.surprise.total_cmp(&a.surprise));
    lines
}

/// The strongest lines over the white noise, each looked for in what the ones before it leave, and the spectrum of what
/// all of them leave.
fn strongest(
    capture: &Capture,
    around: &Around,
    spectrum: &Spectrum,
    tone: &Tone,
    (harmonics, apart): (usize, f64),
) -> (Vec<Line>, Option<Spectrum>) {
    let least = [LEAST_VARIANCE; 2];
    let used = used(capture);
    let mut rest = around.training.clone();
    let mut taken: Vec<Line> = Vec::new();
    let mut left: Option<Spectrum> = None;
    for _ in 0..MOST {
        let now = left.as_ref().unwrap_or(spectrum);
        let lines = now.lines_over(&now.white(least), tone, harmonics, apart);
        let rows = capture.rows() as f64;
        let slow = now.largest_below(LEAST_PERIODS / rows);
        let is_fast = |line: &Line| {
            let c = line.channel;
            line.turns * rows >= LEAST_PERIODS && line.amplitudes[c] > SKIRT * slow[c]
        };
        let is_apart = |line: &Line| {
            let apart = |t: &Line| (t.turns - line.turns).abs() * rows > APART;
            taken.iter().all(apart)
        };
        let Some(line) = lines.into_iter().find(|l| is_fast(l) && is_apart(l)) else {
            break;
        };
        let [drive, sense] = &rest;
        let turns = spectrum::refine([drive, sense], around.noise, line.turns);
        rest.iter_mut().for_each(|r| take_off(r, &used, turns));
        let [drive, sense] = &rest;
        left = Some(Spectrum::of([drive, sense], capture.training_rows()));
        taken.push(line);
    }
    (taken, left)
}

/// Whether a row is a training row, by row.
fn used(capture: &Capture) -> Vec<bool> {
    let mut out = vec![false; capture.rows()];
    for segment in capture.segments.iter().filter(|s| s.part != Part::HeldOut) {
        for row in segment.rows.clone() {
            if let Some(used) = out.get_mut(row) {
                *used = !capture.is_left_out(row);
            }
        }
    }
    out
}

/// Takes the sinusoid of a frequency (turns a sample) that fits the used rows best off them.
fn take_off(residual: &mut [f64], used: &[bool], turns: f64) {
    let wave = |row: usize| (TAU * (turns * row as f64).fract()).sin_cos();
    let (mut ss, mut sc, mut cc, mut s, mut c) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (row, (r, _)) in residual.iter().zip(used).enumerate().filter(|p| *p.1.1) {
        let (sin, cos) = wave(row);
        ss += sin * sin;
        sc += sin * cos;
        cc += cos * cos;
        s += sin * r;
        c += cos * r;
    }
    let size = ss * cc - sc * sc;
    if size <= 1e-9 * ss * cc {
        return;
    }
    let (a, b) = ((s * cc - c * sc) / size, (c * ss - s * sc) / size);
    for (row, (r, _)) in residual.iter_mut().zip(used).enumerate().filter(|p| *p.1.1) {
        let (sin, cos) = wave(row);
        *r -= a * sin + b * cos;
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::Made;
    use super::*;
    use crate::plant::noise::Noise;

    /// What would be known around a model that leaves this in the drive, and noise of variance 1 in both channels.
    fn seen(capture: &Capture, stream: u64, drive: impl Fn(usize) -> f64) -> Around {
        let noise = Noise::new(17, stream);
        let used = used(capture);
        let mut residuals = [Vec::new(), Vec::new()];
        for row in 0..capture.rows() {
            let (d, s) = noise.gaussian_pair(row as u64);
            residuals[0].push(d + drive(row));
            residuals[1].push(s);
        }
        let training = residuals.clone().map(|r| {
            let rows = r.into_iter().zip(&used);
            rows.map(|(r, used)| if *used { r } else { 0.0 }).collect()
        });
        Around {
            residuals,
            training,
            free: [[0.0; 2]; 2],
            noise: [1.0; 2],
            lines: [Vec::new(), Vec::new()],
        }
    }

    fn lines(capture: &Capture, seen: &Around, tone: &Tone) -> [Vec<Line>; 2] {
        let spectrum = seen.spectrum(capture);
        let at_once = spectrum.lines(tone, 12, 3.0, [LEAST_VARIANCE; 2]);
        [
            at_once,
            with_hidden(capture, seen, &spectrum, tone, (12, 3.0)),
        ]
    }

    fn bench() -> (Capture, Tone) {
        let made = Made {
            rows: 16_384,
            word: 0x0e00_5679,
            ..Made::CLEAN
        };
        let capture = made.capture();
        let tone = Tone::of(&capture).unwrap();
        (capture, tone)
    }

    #[test]
    fn a_line_that_is_its_own_surroundings_is_found() {
        let (capture, tone) = bench();
        for periods in [17.5, 18.5, 24.6] {
            let turns = periods / capture.rows() as f64;
            let of = |k: f64, row: usize| (TAU * k * turns * row as f64 + k).sin();
            let seen = seen(&capture, 1, |row| {
                2.0 * of(1.0, row) + 1.2 * of(5.0 / 3.0, row)
            });
            let [at_once, all] = lines(&capture, &seen, &tone);
            let has = |lines: &[Line], at: f64| {
                let near = |l: &Line| (l.turns / turns - at).abs() * periods < 1.0;
                lines.iter().any(near)
            };
            assert!(!has(&at_once, 1.0), "{periods}");
            assert!(has(&all, 1.0) && has(&all, 5.0 / 3.0), "{periods} {all:?}");
        }
    }

    #[test]
    fn noise_and_wander_hide_no_line() {
        let (capture, tone) = bench();
        for stream in 0..12 {
            let noise = Noise::new(23, stream);
            // A random walk that is twenty deviations of the noise from its beginning in the end.
            let mut walk = vec![0.0; capture.rows()];
            for row in 1..walk.len() {
                walk[row] = walk[row - 1] + 0.16 * noise.gaussian_pair(row as u64).0;
            }
            for share in [0.0, 0.1, 1.0] {
                let seen = seen(&capture, stream, |row| share * walk[row]);
                let [at_once, all] = lines(&capture, &seen, &tone);
                assert_eq!(all.len(), at_once.len(), "{stream} {share} {all:?}");
            }
        }
    }
}
