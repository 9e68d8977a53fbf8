//! Runs a design's chain in both arithmetics at once over captured codes.

use super::probe::{Probe, Seen, Tap};
use crate::circuit::chain::{Chain, FastState, SlowState};
use crate::design::Design;
use crate::numeric::cast::HasKernel;
use crate::numeric::format::Overflow;
use crate::numeric::lane::Lane;
use crate::numeric::paired::{Pair, PairResidue, Paired, exp2i};

/// Rows that a run hands over: raw words and float values in the columns of
/// [`crate::circuit::engine::columns`], float values in the units of the words (turns for the tuning word).
pub type RowSink<'a> = &'a mut dyn FnMut(&[i128], &[f64]);

/// Runs `design` over the codes. An overflow where the design says `error` saturates and is counted.
pub fn run(design: &Design, drive: &[i32], sense: &[i32]) -> Seen {
    run_with_rows(design, drive, sense, &mut |_, _| {})
}

/// The same; every node keeps every word ([`super::node::History`]).
pub fn run_remembering(design: &Design, drive: &[i32], sense: &[i32]) -> Seen {
    staged(design, drive, sense, Extra::History, &mut |_, _| {})
}

/// The same; every row is handed over.
pub fn run_with_rows(design: &Design, drive: &[i32], sense: &[i32], rows: RowSink) -> Seen {
    staged(design, drive, sense, Extra::Nothing, rows)
}

/// The same; `tap` sees every raw word.
pub fn run_tapped(
    design: &Design,
    drive: &[i32],
    sense: &[i32],
    tap: Box<dyn Tap>,
    rows: RowSink,
) -> Seen {
    staged(design, drive, sense, Extra::Tap(tap), rows)
}

/// What is kept beside the sums.
enum Extra {
    Nothing,
    /// Every word of every node.
    History,
    Tap(Box<dyn Tap>),
}

fn staged(design: &Design, drive: &[i32], sense: &[i32], extra: Extra, rows: RowSink) -> Seen {
    match design.circuit.decimator.stages {
        1 => with_stages::<1>(design, drive, sense, extra, rows),
        2 => with_stages::<2>(design, drive, sense, extra, rows),
        3 => with_stages::<3>(design, drive, sense, extra, rows),
        4 => with_stages::<4>(design, drive, sense, extra, rows),
        5 => with_stages::<5>(design, drive, sense, extra, rows),
        _ => with_stages::<6>(design, drive, sense, extra, rows),
    }
}

fn with_stages<const N: usize>(
    design: &Design,
    drive: &[i32],
    sense: &[i32],
    extra: Extra,
    rows: RowSink,
) -> Seen {
    let chain = Chain::<N>::new(design);
    let probe = Probe::new(design, &chain);
    let probe = match extra {
        Extra::Nothing => probe,
        Extra::History => probe.remembering(),
        Extra::Tap(tap) => probe.with_tap(tap),
    };
    if fits_narrow_lanes(design, &chain) {
        Running::<i64, i64, N>::new(&chain, &probe).process(drive, sense, rows);
    } else {
        Running::<i128, i128, N>::new(&chain, &probe).process(drive, sense, rows);
    }
    probe.finish()
}

/// Unlike the engine, an overflow has to be seen: no word may leave its lane where a wrap follows.
fn fits_narrow_lanes<const N: usize>(design: &Design, chain: &Chain<N>) -> bool {
    let circuit = &design.circuit;
    let product = &chain.mixers[0].product;
    let exact = circuit.adc.format.bits() + circuit.nco.table.bits();
    let left = (-product.shift).max(0) as u32;
    let residues = chain.cics[0].ring.bits.max(chain.nco.ring.bits);
    let wraps_silently = product.overflow == Some(Overflow::Wrap) && product.shift >= 64;
    exact + left <= 62 && residues <= 64 && !wraps_silently
}

/// A chain at work, `W` at the sample rate, 128 bits at the decimated rate.
struct Running<'a, W, R: Lane, const N: usize> {
    chain: &'a Chain<N>,
    probe: &'a Probe,
    fast: Paired<'a, W, R, Probe>,
    slow: Paired<'a, i128, R, Probe>,
    fast_state: FastState<PairResidue<R>, N>,
    slow_state: SlowState<Pair<i128>>,
}

impl<'a, W: HasKernel, R: Lane, const N: usize> Running<'a, W, R, N> {
    fn new(chain: &'a Chain<N>, probe: &'a Probe) -> Self {
        let (fast, slow) = (Paired::new(probe), Paired::new(probe));
        Running {
            fast_state: chain.start_fast(&fast),
            slow_state: chain.start_slow(&slow),
            chain,
            probe,
            fast,
            slow,
        }
    }

    fn process(&mut self, drive: &[i32], sense: &[i32], rows: RowSink) {
        let ratio = self.chain.cics[0].ratio as usize;
        let fraction_bits = self.chain.code_fraction_bits;
        let mut sample = 0u64;
        for (d, s) in drive.chunks(ratio).zip(sense.chunks(ratio)) {
            let peak = d.iter().map(|c| c.unsigned_abs()).max().unwrap_or(0);
            self.probe.drive_peak(f64::from(peak));
            for (d, s) in d.iter().zip(s) {
                self.probe.at_sample(sample);
                let codes = [
                    self.fast.code(*d, fraction_bits),
                    self.fast.code(*s, fraction_bits),
                ];
                self.chain.sample(&self.fast, &mut self.fast_state, codes);
                sample += 1;
            }
            if d.len() == ratio {
                self.end_of_period(rows);
            }
        }
    }

    fn end_of_period(&mut self, rows: RowSink) {
        let row = self
            .chain
            .period(&self.slow, &mut self.fast_state, &mut self.slow_state);
        let places = self.probe.places();
        let mut words: Vec<Pair<i128>> = row.channels.to_vec();
        words.extend([row.phase, row.magnitude]);
        words.extend(row.compensation.map(|[_, rate]| rate));
        let mut raw: Vec<i128> = words.iter().map(|w| w.raw).collect();
        let mut real: Vec<f64> = words.iter().map(|w| w.real).collect();
        if let Some(at) = places.phase_loop {
            let (word, turns) = self.tuning(at + 1);
            raw.push(word);
            real.push(turns);
        }
        if let (Some(at), Some(gain), Some(state)) = (
            places.amplitude_loop,
            &row.gain,
            &self.slow_state.amplitude_loop,
        ) {
            self.probe.note(at, &state.integrator);
            self.probe.note(at + 1, gain);
            raw.push(gain.raw);
            real.push(gain.real);
        }
        // A word without a rounding: where float and fixed thermometers lie on both sides of an end, that of fixed.
        raw.extend(row.in_range.map(|w| w.raw));
        real.extend(row.in_range.map(|w| w.real));
        rows(&raw, &real);
    }

    /// Notes the tuning word: both are residues, so their distance is exact. Raw, and turns a sample.
    fn tuning(&self, node: usize) -> (i128, f64) {
        let bits = self.chain.nco.ring.bits;
        let tuning = self.fast_state.oscillator.tuning;
        let word = tuning.raw.wide() & ((1i128 << bits) - 1);
        // The float's grid has 2^128 steps in a turn.
        let aligned = word.wrapping_shl(128 - bits);
        let error = aligned.wrapping_sub(tuning.grid) as f64 * exp2i(-128);
        let bound = tuning.phase_bound as f64 * exp2i(-124);
        let turns = tuning.grid as u128 as f64 * exp2i(-128);
        self.probe.note_error(node, word, error, bound, turns);
        (word, turns)
    }
}
