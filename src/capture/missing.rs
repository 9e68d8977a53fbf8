//! `adc_missing_codes`: codes that never appear though they should; their inputs go to a neighbour.
//!
//! The histogram decides, not the mean. What a code should count is what the tone with its noise makes of it, and no
//! more than what surrounds it bears out ([`super::code_counts`]), so that an offset or a bend, or a coherent tone that
//! hits few codes, makes no code look missing. Codes in an even spacing count together, as each may be expected too
//! seldom to be missed alone; adjacent codes are one gap.

use super::code_counts::{Counts, Run};
use super::columns::Model;
use super::input::Capture;
use super::missing_moves;
pub use super::signal::Missing;

/// A set of missing codes and how surely it is one.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// By channel.
    pub missing: [Missing; 2],
    /// Gain in log-likelihood, the search taken off.
    pub gain: f64,
    /// Spacing and residue, where it is even.
    pub spacing: Option<(i64, i64)>,
    /// Rows that the codes should have had.
    pub expected_rows: f64,
}

/// Least gain of a set: one in ten thousand captures.
const LEAST_GAIN: f64 = 12.0;
/// Largest spacing.
const SPACING: i64 = 8192;
/// What is gained by `count` instead of `expected` rows.
fn poisson_gain(count: f64, expected: f64) -> f64 {
    if count >= expected {
        return 0.0;
    }
    let log = if count > 0.0 {
        count * (count / expected).ln()
    } else {
        0.0
    };
    expected - count + log
}

/// Looks for missing codes in the training rows: in an even spacing in both channels or one, or run by
/// run of adjacent codes.
pub fn find(capture: &Capture, model: &Model) -> Option<Found> {
    let counts = [0, 1].map(|c: usize| Counts::of(capture, model, c));
    let cells: [Vec<Cell>; 2] = [0, 1].map(|c: usize| {
        let counts = counts.get(c).and_then(Option::as_ref);
        counts.map(Counts::cells).unwrap_or_default()
    });
    let mut best: Option<(f64, Vec<usize>, i64, i64)> = None;
    for channels in [vec![0, 1], vec![0], vec![1]] {
        let of = channels.iter().filter_map(|c| cells.get(*c));
        if let Some((gain, spacing, residue)) = spaced(&of.map(Vec::as_slice).collect::<Vec<_>>())
            && best.as_ref().is_none_or(|b| gain > b.0)
        {
            best = Some((gain, channels, spacing, residue));
        }
    }
    let all = cells.iter().map(Vec::len).sum::<usize>().max(1) as f64;
    let mut gaps = [0, 1].map(|c: usize| {
        let counts = counts.get(c).and_then(Option::as_ref);
        counts.map(|counts| sure(counts, all)).unwrap_or_default()
    });
    let mut gain: f64 = gaps.iter().flatten().map(|(gain, _)| gain).sum();
    let mut spacing = None;
    if let Some((even, channels, step, residue)) = best.filter(|b| b.0 >= gain) {
        (gain, spacing) = (even, Some((step, residue)));
        for (c, (gaps, cells)) in gaps.iter_mut().zip(&cells).enumerate() {
            let of = |cell: &&Cell| channels.contains(&c) && cell.0.rem_euclid(step) == residue;
            let one = |&(code, seen, expected): &Cell| Run {
                first: code,
                last: code,
                seen,
                expected,
            };
            *gaps = cells.iter().filter(of).map(|x| (0.0, one(x))).collect();
        }
    }
    if gain < LEAST_GAIN {
        return None;
    }
    let mut out = Found {
        missing: Default::default(),
        gain,
        spacing,
        expected_rows: gaps.iter().flatten().map(|(_, run)| run.expected).sum(),
    };
    let runs = gaps.map(|gaps| gaps.into_iter().map(|(_, run)| run).collect::<Vec<_>>());
    let moves = missing_moves::of(&counts, &runs, spacing.is_some());
    for ((missing, runs), moves) in out.missing.iter_mut().zip(&runs).zip(moves) {
        let codes = runs.iter().flat_map(|run| run.first..=run.last);
        missing.codes = codes.map(|code| code as i32).collect();
        missing.moves = moves;
    }
    Some(out)
}

/// Code, rows, rows that there should at least be.
type Cell = (i64, f64, f64);

/// The runs that are missing each for itself, with their gain.
fn sure(counts: &Counts, all: f64) -> Vec<(f64, Run)> {
    let own = |run: Run| (poisson_gain(run.seen, run.expected) - all.ln(), run);
    let runs = counts.runs().into_iter().map(own);
    runs.filter(|(gain, _)| *gain > 3.0).collect()
}

/// The best even spacing: gain (the search taken off), spacing, residue.
fn spaced(channels: &[&[Cell]]) -> Option<(f64, i64, i64)> {
    let total: f64 = channels.iter().flat_map(|c| c.iter()).map(|x| x.2).sum();
    let widest = channels.iter().map(|c| c.len()).max().unwrap_or(0);
    let longest = SPACING.min((total / 20.0) as i64).min(widest as i64 / 3);
    let mut best: Option<(f64, i64, i64)> = None;
    for spacing in 2..=longest {
        for residue in 0..spacing {
            let classes = channels.iter().map(|cells| class(cells, spacing, residue));
            // What appears at all is not missing: most classes end within a few codes.
            let allowed = 0.002 * total / spacing as f64;
            let mut count = 0.0;
            for cell in classes.clone().flatten() {
                count += cell.1;
                if count > allowed {
                    break;
                }
            }
            if count > allowed {
                continue;
            }
            let expected: f64 = classes.flatten().map(|x| x.2).sum();
            let gain = poisson_gain(count, expected) - 2.0 * (spacing as f64).ln() - 2.0;
            if best.is_none_or(|b| gain > b.0) {
                best = Some((gain, spacing, residue));
            }
        }
    }
    best
}

/// The cells (of ascending, contiguous codes) of a residue.
fn class(cells: &[Cell], spacing: i64, residue: i64) -> impl Iterator<Item = &Cell> + Clone {
    let first = cells.first().map_or(0, |x| x.0);
    let skip = (residue - first).rem_euclid(spacing) as usize;
    cells
        .get(skip..)
        .unwrap_or_default()
        .iter()
        .step_by(spacing.max(1) as usize)
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{Made, model};
    use super::*;

    /// What is found where drive codes go to others (`from`, `to`), with a model that is off by `offset` codes.
    fn found(made: &Made, moved: &[(i32, i32)], offset: f64) -> Option<Found> {
        let mut capture = made.capture();
        for code in &mut capture.codes[0] {
            let to = moved.iter().find(|(from, _)| from == code);
            *code = to.map_or(*code, |(_, to)| *to);
        }
        let (_, mut model) = model(&capture, made);
        model.coefficients[0][super::super::columns::ONE] = offset;
        find(&capture, &model)
    }

    const QUIET: Made = Made {
        noise: 0.4,
        ..Made::CLEAN
    };

    #[test]
    fn codes_at_the_crest_are_missed_as_others_are() {
        // The amplitude is 200.3 codes: the outermost code of the tone itself, and some inside of it, both sides.
        for code in [200, 199, 198, 195, -200, -199, -197] {
            for by in [-1, 1] {
                let found = found(&QUIET, &[(code, code + by)], 0.0).unwrap().missing;
                assert_eq!(found[0].codes, [code], "{by}");
                assert_eq!(found[0].moves, [f64::from(by)], "{code}");
                assert!(found[1].codes.is_empty());
            }
        }
    }

    #[test]
    fn a_gap_is_one_event_and_its_rows_go_where_they_went() {
        let halves = [(195, 194), (196, 194), (197, 199), (198, 199)];
        let below = halves.map(|(code, _)| (code, 194));
        let above = halves.map(|(code, _)| (code, 199));
        for gap in [halves, below, above] {
            let found = found(&QUIET, &gap, 0.0).unwrap();
            assert_eq!(found.missing[0].codes, [195, 196, 197, 198]);
            let moves = gap.map(|(from, to)| f64::from(to - from));
            assert_eq!(found.missing[0].moves, moves);
        }
    }

    #[test]
    fn no_code_is_missing_where_none_is() {
        for noise in [0.05, 0.15, 0.4, 1.0, 3.0] {
            for offset in [-0.4, 0.0, 0.4] {
                for word in [0x0734_5679, 1 << 24, 3 << 20] {
                    let made = Made {
                        noise,
                        word,
                        ..Made::CLEAN
                    };
                    assert_eq!(found(&made, &[], offset), None, "{noise} {word:x}");
                }
            }
        }
    }

    #[test]
    fn codes_that_a_wander_leaves_are_not_missing() {
        // 1024 phases, each of them moved through several codes in the course of the capture.
        let made = Made {
            rows: 100_000,
            word: 13 << 22,
            ..QUIET
        };
        let mut capture = made.capture();
        for (row, code) in capture.codes[0].iter_mut().enumerate() {
            let slow = std::f64::consts::TAU * row as f64 / 100_000.0;
            *code += (4.0 * slow.sin() + 2.0 * (2.3 * slow).sin()).round() as i32;
        }
        let (_, model) = model(&capture, &made);
        assert_eq!(find(&capture, &model), None);
    }

    #[test]
    fn what_no_code_is_beyond_is_a_limit_and_not_missing() {
        for limit in [200.0, 199.0, 195.0] {
            let made = Made { limit, ..QUIET };
            assert_eq!(found(&made, &[], 0.0), None, "{limit}");
        }
    }
}
