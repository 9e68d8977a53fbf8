//! What is left after the last step: lines, a mean that goes with the phase or with the code, and instants that remember each
//! other.

use super::columns::{CHUNK, Model, Rows, chunks};
use super::errors::residuals;
use super::input::Capture;
use super::memory;
use super::spectrum::Spectrum;
use crate::statistics::tail::chi_square_surprise;
use crate::verdict::Structure;

/// Names of the columns.
const CHANNELS: [&str; 2] = ["drive_code", "sense_code"];
/// Bins of the phase and of the code.
const BINS: usize = 64;
/// Least variance of noise that whitens the quantiser's pattern, codes squared.
const LEAST_WHITE: f64 = 0.08;
/// Minus the logarithm of the probability below which something is left: one in ten thousand.
const SURPRISE: f64 = 9.2;

/// What the residual at these coefficients (the wander's among them) still has.
pub fn left(capture: &Capture, model: &Model, coefficients: &[Vec<f64>; 2]) -> Structure {
    let residuals = residuals(capture, model, coefficients, true);
    let mut worst = (SURPRISE, None);
    for (channel, residual) in residuals.iter().enumerate() {
        for (surprise, what) in binned(capture, model, channel, residual) {
            if surprise > worst.0 {
                worst = (
                    surprise,
                    Some(format!("{} against {what}", CHANNELS[channel])),
                );
            }
        }
    }
    let [drive, sense] = &residuals;
    if let Some((channel, surprise)) = memory::remembered(capture, model, [drive, sense])
        && surprise > worst.0
    {
        let name = CHANNELS[channel];
        worst = (
            surprise,
            Some(format!("{name}, instants that remember each other")),
        );
    }
    let spectrum = Spectrum::of([drive, sense], capture.used_rows());
    let lines = spectrum.lines(&model.tone, 1, 3.0, [LEAST_WHITE; 2]);
    if let Some(line) = lines.first() {
        let surprise = line.surprise - (capture.rows() as f64).ln();
        if surprise > worst.0 {
            let name = CHANNELS[line.channel];
            let place = match capture.meta.fs_hz {
                Some(fs) => format!("{:.3} Hz", line.turns * fs),
                None => format!("{:.6} per sample", line.turns),
            };
            worst = (surprise, Some(format!("{name}, line at {place}")));
        }
    }
    Structure {
        left: worst.1.is_some(),
        strongest_channel: worst.1,
    }
}

/// Surprise of the means by phase and by signal.
fn binned(
    capture: &Capture,
    model: &Model,
    channel: usize,
    residual: &[f64],
) -> [(f64, &'static str); 2] {
    let mut sums = [vec![[0.0; 2]; BINS], vec![[0.0; 2]; BINS]];
    let mut rows = Rows::new();
    for chunk in chunks(0..capture.rows()) {
        let start = chunk.start;
        let n = chunk.len().min(CHUNK);
        rows.fill(capture, model, chunk);
        for i in 0..n {
            // With less noise the quantiser's pattern is not white.
            let weight = rows.weight[channel][i].min(1.0 / LEAST_WHITE);
            if weight == 0.0 {
                continue;
            }
            let r = residual.get(start + i).copied().unwrap_or(0.0);
            let phase = model.tone.phase(start + i);
            let place = 0.5 + 0.5 * rows.signal[channel][i] / model.span_codes;
            for (sums, at) in sums.iter_mut().zip([phase, place]) {
                let bin = ((at * BINS as f64).max(0.0) as usize).min(BINS - 1);
                if let Some(sum) = sums.get_mut(bin) {
                    sum[0] += weight;
                    sum[1] += weight * r;
                }
            }
        }
    }
    let surprise = |sums: &[[f64; 2]]| {
        let filled = sums.iter().filter(|s| s[0] > 0.0);
        let chi: f64 = filled.clone().map(|s| s[1] * s[1] / s[0]).sum();
        let degrees = filled.count();
        // The noise's level itself is known to a per cent.
        chi_square_surprise(degrees.max(1), chi / 1.03)
    };
    [(surprise(&sums[0]), "phase"), (surprise(&sums[1]), "code")]
}
