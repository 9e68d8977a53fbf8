//! Breaks of the sample clock: samples that were lost, or came twice, between ADC and file.
//!
//! The tone's phase steps at one row, by the same angle in both channels, and stays. The number of samples is the
//! least that makes such a step. The rows after it are put where they belong in time, so that all that goes with
//! the phase is judged as if nothing had happened: lost samples are rows that are left out, repeated ones are taken away.

use super::blocks::{self, Block, noise, phase, wrapped};
use super::first_break::first_break;
use super::input::Capture;
use super::tone::Tone;
use crate::statistics::normal::median;

/// Blocks to each side of a row, the medians of which tell a step.
const SIDE: usize = 4;
/// The same for its size, at most.
const LONG_SIDE: usize = 64;
/// Typical changes of the phase from block to block, of which a step is no fewer.
const STEPS: f64 = 12.0;
/// Noise of the phase that is taken as there, codes rms: that of rounding, whose pattern is no noise.
const LEAST_NOISE: f64 = 0.5;
/// Part of a sample's phase below which a step that no whole number of samples makes is none of the sample clock.
const LEAST_OF_A_SAMPLE: f64 = 0.25;
/// Deviations by which a number of samples may miss the step.
const MATCH: f64 = 5.0;
/// Times that the steps are looked for again, beside those that were mended.
const ROUNDS: usize = 8;
/// Blocks to each side between which a step is abrupt: at first the next ones, then, where two breaks are close
/// together, those beyond. What is between close breaks stands out of the codes at its phase.
const ABRUPT: [usize; 2] = [1, 2];
/// Rows of a stretch that came twice which are looked at first.
const FIRST_ROWS: usize = 32;
/// Share of equal rows in a stretch that came twice.
const SAME: f64 = 0.9;

/// A break.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Break {
    /// First row after it, of the rows as they were at the time.
    pub row: usize,
    /// Step of the phase, turns in -1/2 .. 1/2.
    pub turns: f64,
    /// Samples lost (positive) or repeated (negative); `None` if no number makes the step.
    pub samples: Option<i64>,
}

/// The rows of a capture in time.
#[derive(Debug, Clone)]
pub struct Retimed {
    /// With lost samples as rows that are left out.
    pub capture: Capture,
    /// The breaks, by their rows in the file.
    pub breaks: Vec<Break>,
    /// Start of each stretch in `capture`, and its row in the file.
    starts: Vec<(usize, usize)>,
}

impl Retimed {
    /// The row in the file of a row of the capture.
    pub fn row_in_file(&self, row: usize) -> usize {
        let last = self.starts.iter().rev().find(|s| s.0 <= row);
        last.map_or(row, |(at, from)| from + (row - at))
    }
}

/// Finds the breaks and puts the rows where they belong. What no number of samples explains ends the search: the
/// capture then has the rows before it alone.
pub fn retimed(capture: Capture, tone: &Tone) -> Retimed {
    let mut out = Retimed {
        capture,
        breaks: Vec::new(),
        starts: vec![(0, 0)],
    };
    let mut abrupt = ABRUPT.into_iter();
    let mut within = abrupt.next();
    for _ in 0..ROUNDS {
        let Some(reach) = within else { break };
        let found = breaks(&out.capture, tone, reach);
        if found.is_empty() {
            within = abrupt.next();
            continue;
        }
        for b in found.iter().rev() {
            out.mend(*b);
        }
        if found.iter().any(|b| b.samples.is_none()) {
            break;
        }
    }
    if out.breaks.iter().all(|b| b.samples.is_some())
        && let Some(first) = first_break(&out.capture, tone)
    {
        out.mend(first);
    }
    out.breaks.sort_by_key(|b| b.row);
    out
}

impl Retimed {
    /// Moves what is after a break (the last one first, so that the rows of the others stay).
    fn mend(&mut self, b: Break) {
        let row_in_file = self.row_in_file(b.row);
        self.breaks.push(Break {
            row: row_in_file,
            ..b
        });
        let rows = self.capture.rows();
        let mut out = self.capture.left_out.clone();
        out.resize(rows, false);
        let mut codes = self.capture.codes.clone();
        let Some(samples) = b.samples else {
            codes.iter_mut().for_each(|c| c.truncate(b.row));
            out.truncate(b.row);
            self.starts.retain(|s| s.0 < b.row);
            self.capture = self.capture.with_rows(codes, out);
            return;
        };
        let count = samples.unsigned_abs() as usize;
        let (removed, added) = if samples < 0 { (count, 0) } else { (0, count) };
        let gone = b.row..(b.row + removed).min(rows);
        for c in &mut codes {
            c.splice(gone.clone(), std::iter::repeat_n(0, added));
        }
        out.splice(gone.clone(), std::iter::repeat_n(true, added));
        let from = self.row_in_file(gone.end);
        for start in self.starts.iter_mut().filter(|s| s.0 > b.row) {
            start.0 = (start.0 + added).saturating_sub(gone.len());
        }
        self.starts.push((b.row + added, from));
        self.starts.sort_unstable();
        self.capture = self.capture.with_rows(codes, out);
    }
}

/// The breaks that stand out now, ascending.
fn breaks(capture: &Capture, tone: &Tone, reach: usize) -> Vec<Break> {
    let blocks = blocks::blocks(capture, tone);
    if blocks.len() < 2 * SIDE {
        return Vec::new();
    }
    let channel = clearest(&blocks);
    let course = Course::of(&blocks, channel, tone);
    let steps = course.steps(reach);
    let places: Vec<usize> = steps.iter().map(|s| s.0).collect();
    let mut out = Vec::new();
    for (k, (at, _)) in steps.iter().enumerate() {
        let from = k
            .checked_sub(1)
            .and_then(|k| places.get(k))
            .map_or(0, |p| p + 1);
        let to = places.get(k + 1).copied().unwrap_or(blocks.len());
        let (turns, std) = course.size(*at, from..to);
        let is_step =
            turns.abs() > STEPS * std && is_common(&blocks, tone, channel, *at, turns, std);
        if !is_step {
            continue;
        }
        let row = place(capture, tone, &blocks, *at);
        let samples = samples(capture, tone, row, turns, MATCH * std);
        // Less than a sample that is no whole number of samples: the tone itself, not its sampling.
        if samples.is_some() || turns.abs() > LEAST_OF_A_SAMPLE * blocks::of_a_sample(tone) {
            out.push(Break {
                row,
                turns,
                samples,
            });
        }
    }
    out
}

/// The channel whose tone is farther above its noise.
fn clearest(blocks: &[Block]) -> usize {
    let clear = |c: usize| {
        let [_, sin, cos] = blocks::median_tone(blocks, c);
        sin.hypot(cos) / noise(blocks, c).sqrt()
    };
    usize::from(clear(1) > clear(0))
}

/// The tone's phase, block by block.
struct Course {
    /// Turns, the drift of a fitted tone taken off.
    turns: Vec<f64>,
    /// Typical change from block to block, as a deviation.
    change: f64,
    /// Blocks to each side that tell the size of a step.
    side: usize,
    /// Deviation of the drift that was taken off, turns a block.
    drift: f64,
}

impl Course {
    fn of(blocks: &[Block], channel: usize, tone: &Tone) -> Self {
        let phases: Vec<f64> = blocks.iter().map(|b| phase(&b.tone[channel])).collect();
        let changes = || phases.windows(2).map(|w| wrapped(w[1] - w[0]));
        // A frequency that was fitted across a break is a little off.
        let drift = match tone.word {
            Some(_) => 0.0,
            None => median(&mut changes().collect::<Vec<f64>>()).unwrap_or(0.0),
        };
        let mut sizes: Vec<f64> = changes().map(|c| wrapped(c - drift).abs()).collect();
        let typical = 1.4826 * median(&mut sizes).unwrap_or(0.0);
        let [_, sin, cos] = blocks::median_tone(blocks, channel);
        let rows = blocks.first().map_or(1, |b| b.rows.len()) as f64;
        let rounding = LEAST_NOISE / sin.hypot(cos).max(1e-9) * (4.0 / rows).sqrt();
        let length = blocks.get(1).map_or(1.0, |b| b.middle()) - blocks[0].middle();
        let steady = |(phase, b): (&f64, &Block)| {
            let passed = (b.middle() - blocks[0].middle()) / length.max(1.0);
            wrapped(phase - drift * passed)
        };
        let change = typical.max(rounding / std::f64::consts::TAU);
        Course {
            turns: phases.iter().zip(blocks).map(steady).collect(),
            change,
            // That of a median, 1.25 of a mean's.
            drift: if tone.word.is_some() {
                0.0
            } else {
                1.25 * change / (phases.len() as f64).sqrt()
            },
            side: if tone.word.is_some() { LONG_SIDE } else { SIDE },
        }
    }

    /// Median over some blocks of the phase against that of block `to`.
    fn against(&self, to: usize, blocks: std::ops::Range<usize>) -> f64 {
        let zero = self.turns.get(to).copied().unwrap_or(0.0);
        let near = self.turns.get(blocks).unwrap_or_default();
        let mut near: Vec<f64> = near.iter().map(|t| wrapped(t - zero)).collect();
        median(&mut near).unwrap_or(0.0)
    }

    /// Step across block `k`, by the medians of `side` blocks before and after it, the nearest of them `reach` away.
    fn across(&self, k: usize, reach: usize, side: usize) -> f64 {
        let end = (k + 1).saturating_sub(reach);
        let before = self.against(k - 1, end.saturating_sub(side)..end);
        let start = (k + reach).min(self.turns.len() - 1);
        let after = self.against(k - 1, start..(start + side).min(self.turns.len()));
        wrapped(after - before)
    }

    /// Blocks across which the phase steps, and by how much, ascending; between blocks `reach` before and after. The
    /// outermost two blocks on each side tell of a break in them too little.
    fn steps(&self, reach: usize) -> Vec<(usize, f64)> {
        let least = STEPS * self.change;
        let mut seen: Vec<(usize, f64)> = (2..self.turns.len().saturating_sub(2))
            .filter_map(|k| {
                let (wide, near) = (self.across(k, reach, SIDE), self.across(k, reach, 1));
                let abrupt = wrapped(near - wide).abs() < 0.25 * wide.abs() + 0.5 * least;
                (wide.abs() > least && abrupt).then_some((k, wide))
            })
            .collect();
        seen.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        let mut out: Vec<(usize, f64)> = Vec::new();
        for step in seen {
            if out.iter().all(|o| o.0.abs_diff(step.0) > SIDE) {
                out.push(step);
            }
        }
        out.sort_by_key(|s| s.0);
        out
    }

    /// The step across block `k` and its deviation, from blocks of `within` alone.
    fn size(&self, k: usize, within: std::ops::Range<usize>) -> (f64, f64) {
        let before = k.saturating_sub(self.side).max(within.start)
            ..k.saturating_sub(1).max(within.start + 1);
        let after = (k + 2).min(within.end - 1)..(k + 2 + self.side).min(within.end);
        let share = |n: usize| 1.0 / n.max(1) as f64;
        let std = 0.9 * self.change * (share(before.len()) + share(after.len())).sqrt();
        let apart = 0.5 * (after.start + after.end - before.start - before.end) as f64;
        let step = self.against(k - 1, after) - self.against(k - 1, before);
        (wrapped(step), std.hypot(apart * self.drift))
    }
}

/// Whether the other channel's tone, where it is clear enough, makes the same step.
fn is_common(
    blocks: &[Block],
    tone: &Tone,
    channel: usize,
    at: usize,
    turns: f64,
    std: f64,
) -> bool {
    let other = Course::of(blocks, 1 - channel, tone);
    let least = STEPS * other.change;
    if turns.abs() < least || other.change > 0.02 {
        return true;
    }
    wrapped(other.across(at, 1, SIDE) - turns).abs() < 0.25 * turns.abs() + least + MATCH * std
}

/// The first row after a step across block `at`: that at which the tones before and after it, each on its side, leave
/// least of the codes.
fn place(capture: &Capture, tone: &Tone, blocks: &[Block], at: usize) -> usize {
    let side = |range: std::ops::Range<usize>| {
        let range = range.start.min(blocks.len())..range.end.min(blocks.len());
        let near = blocks.get(range).unwrap_or_default();
        [0, 1].map(|c: usize| blocks::median_tone(near, c))
    };
    let before = side(at.saturating_sub(SIDE + 1)..at.saturating_sub(1).max(1));
    let after = side((at + 2).min(blocks.len() - 1)..at + 2 + SIDE);
    let of = |k: usize| blocks.get(k.min(blocks.len() - 1)).map(|b| b.rows.clone());
    let from = of(at.saturating_sub(1)).map_or(0, |r| r.start);
    let to = of(at + 1).map_or(from, |r| r.end);
    let variances = [noise(blocks, 0), noise(blocks, 1)];
    // What the row costs on the left side less what it costs on the right.
    let (mut sum, mut best) = (0.0, (0.0, from));
    for row in from..to {
        let x = blocks::at(tone, row);
        for channel in 0..2 {
            let code = f64::from(capture.codes[channel].get(row).copied().unwrap_or(0));
            let cost = |tones: &[[f64; 3]; 2]| {
                let value: f64 = tones[channel].iter().zip(x).map(|(a, b)| a * b).sum();
                // A wrong code decides nothing.
                ((code - value).powi(2) / variances[channel]).min(25.0)
            };
            if !capture.is_left_out(row) {
                sum += cost(&before) - cost(&after);
            }
        }
        if sum < best.0 {
            best = (sum, row + 1);
        }
    }
    best.1
}

/// The number of samples that makes a step of the phase at a row: those that are there twice, or the fewest lost.
fn samples(capture: &Capture, tone: &Tone, row: usize, turns: f64, within: f64) -> Option<i64> {
    let makes = |n: i64| wrapped(n as f64 * tone.turns - turns).abs() <= within;
    let most = (capture.rows() / 2) as i64;
    let mut repeated = (1..=(row as i64).min(most)).filter(|n| makes(-n));
    if let Some(n) = repeated.find(|n| is_twice(capture, row, *n as usize)) {
        return Some(-n);
    }
    (1..=most).find(|n| makes(*n))
}

/// Whether the `count` rows from `row` on are those before it once more.
fn is_twice(capture: &Capture, row: usize, count: usize) -> bool {
    let code = |channel: usize, row: usize| capture.codes[channel].get(row);
    let is_same =
        |r: usize| (0..2).all(|c| code(c, r).is_some() && code(c, r) == code(c, r - count));
    let enough = |rows: usize| {
        let same = (row..row + rows).filter(|r| is_same(*r)).count();
        same as f64 >= SAME * rows as f64
    };
    enough(count.min(FIRST_ROWS)) && enough(count)
}
