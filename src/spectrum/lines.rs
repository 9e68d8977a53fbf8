//! Spectral lines of a real sequence: over whole periods with a rectangular window (a line is
//! exactly one bin), else with a window and interpolation between bins.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

/// A 7-term Blackman-Harris window of least sidelobes (of the family of Albrecht, ICASSP 2001): none
/// above -179.9 dB, which a test measures, the main lobe 7 bins to each side.
const COSINES: [f64; 7] = [
    0.271_051_400_693_424,
    -0.433_297_939_234_485,
    0.218_122_999_543_110,
    -0.065_925_446_388_031,
    0.010_811_742_098_371,
    -0.000_776_584_825_226,
    0.000_013_887_217_352,
];

/// How a sequence is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The sequence is one whole period: each line is exactly one bin.
    WholePeriod,
    /// A part of a longer period, under a 7-term Blackman-Harris window.
    BlackmanHarris7,
}

impl Method {
    /// Lines below it, dB from the largest, cannot be told from the method's own errors: rounding
    /// of the Fourier transform, sidelobes (-180 dB) of the window.
    pub fn floor_dbc(self) -> f64 {
        match self {
            Method::WholePeriod => -260.0,
            Method::BlackmanHarris7 => -170.0,
        }
    }

    /// Half the width of a line, bins: nearer to another line it is not seen for itself.
    pub fn half_width_bins(self) -> usize {
        match self {
            Method::WholePeriod => 0,
            Method::BlackmanHarris7 => 7,
        }
    }

    fn weight(self, n: usize, count: usize) -> f64 {
        match self {
            Method::WholePeriod => 1.0,
            Method::BlackmanHarris7 => {
                let angle = TAU * n as f64 / count as f64;
                let term = |(k, c): (usize, &f64)| c * (angle * k as f64).cos();
                COSINES.iter().enumerate().map(term).sum()
            }
        }
    }
}

/// A line of a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Cycles per sample, above 0 to 0.5.
    pub frequency: f64,
    /// Amplitude of the sine, in the sequence's unit.
    pub amplitude: f64,
}

/// What a spectrum shows.
#[derive(Debug, Clone)]
pub struct Lines {
    /// The largest line.
    pub largest: Line,
    /// Every other line above the method's floor, by frequency; zero frequency is none.
    pub others: Vec<Line>,
    /// Power of everything but the largest line and zero frequency.
    pub rest_power: f64,
}

/// The lines of a sequence; `None` if there is none but at zero frequency.
pub fn lines(sequence: &[f64], method: Method) -> Option<Lines> {
    let count = sequence.len();
    let mut weights = (0.0, 0.0);
    let mut buffer: Vec<Complex<f64>> = Vec::with_capacity(count);
    for (n, x) in sequence.iter().enumerate() {
        let weight = method.weight(n, count);
        weights.0 += weight;
        weights.1 += weight * weight;
        buffer.push(Complex::new(x * weight, 0.0));
    }
    FftPlanner::new()
        .plan_fft_forward(count)
        .process(&mut buffer);
    let powers: Vec<f64> = buffer
        .iter()
        .take(count / 2 + 1)
        .map(|c| c.norm_sqr())
        .collect();
    let half_width = method.half_width_bins();
    // Bins that belong to zero frequency (and its half width) hold no line of their own.
    let found = found(&powers, count, method, weights.0, half_width + 1);
    let (top, largest) = found
        .iter()
        .copied()
        .reduce(|a, b| if b.1.amplitude > a.1.amplitude { b } else { a })?;
    let floor = largest.amplitude * 10f64.powf(method.floor_dbc() / 20.0);
    let is_rest = |bin: usize| bin > half_width && bin.abs_diff(top) > half_width;
    // Every bin stands for itself and its image, but half the sample rate for itself only.
    let images = |bin: usize| if 2 * bin == count { 1.0 } else { 2.0 };
    let rest: f64 = powers
        .iter()
        .enumerate()
        .filter(|(bin, _)| is_rest(*bin))
        .map(|(bin, power)| images(bin) * power)
        .sum();
    let others = found
        .into_iter()
        .filter(|(bin, line)| *bin != top && line.amplitude > floor)
        .map(|(_, line)| line)
        .collect();
    Some(Lines {
        largest,
        others,
        rest_power: rest / (count as f64 * weights.1),
    })
}

/// Lines with the bins of their peaks, from bin `first` on: every bin, or each local maximum.
fn found(
    powers: &[f64],
    count: usize,
    method: Method,
    weight: f64,
    first: usize,
) -> Vec<(usize, Line)> {
    let line = |bin: usize, position: f64, power: f64| {
        let images = if 2 * bin == count { 1.0 } else { 2.0 };
        let line = Line {
            frequency: position / count as f64,
            amplitude: images * power.sqrt() / weight,
        };
        (bin, line)
    };
    let bins = powers.iter().copied().enumerate().skip(first);
    let bins = bins.filter(|(_, power)| *power > 0.0);
    if method == Method::WholePeriod {
        return bins.map(|(k, power)| line(k, k as f64, power)).collect();
    }
    bins.filter_map(|(k, power)| {
        let (before, after) = (*powers.get(k - 1)?, *powers.get(k + 1)?);
        if power < before || power <= after {
            return None;
        }
        let (offset, peak) = parabola(before.ln(), power.ln(), after.ln());
        Some(line(k, k as f64 + offset, peak.exp()))
    })
    .collect()
}

/// Place (-0.5 to 0.5, from the middle) and height of the top of the parabola through three points.
/// The logarithm of this window's main lobe is one nearly.
fn parabola(before: f64, middle: f64, after: f64) -> (f64, f64) {
    let bend = before - 2.0 * middle + after;
    if !(bend < 0.0 && bend.is_finite()) {
        return (0.0, middle);
    }
    let offset = 0.5 * (before - after) / bend;
    (offset, middle - 0.25 * (before - after) * offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tones(count: usize, tones: &[(f64, f64)]) -> Vec<f64> {
        let value = |n: usize| {
            let tone = |(f, a): &(f64, f64)| a * (TAU * f * n as f64 + 0.7).sin();
            tones.iter().map(tone).sum()
        };
        (0..count).map(value).collect()
    }

    #[test]
    fn a_whole_period_gives_exact_lines() {
        let n = 256;
        let frequency = |bin: f64| bin / 256.0;
        let x = tones(n, &[(frequency(17.0), 3.0), (frequency(100.0), 3e-9)]);
        let found = lines(&x, Method::WholePeriod).unwrap();
        assert_eq!(found.largest.frequency, frequency(17.0));
        assert!((found.largest.amplitude - 3.0).abs() < 1e-13);
        let other = found
            .others
            .iter()
            .find(|l| l.frequency == frequency(100.0));
        assert!((other.unwrap().amplitude / 3e-9 - 1.0).abs() < 1e-5);
        assert!((found.rest_power / (4.5e-18) - 1.0).abs() < 1e-4);
        assert!(lines(&[1.0; 8], Method::WholePeriod).is_none());
        // Half the sample rate has no image.
        let nyquist = lines(&[1.0, -1.0, 1.0, -1.0], Method::WholePeriod).unwrap();
        assert_eq!(
            (nyquist.largest.frequency, nyquist.largest.amplitude),
            (0.5, 1.0)
        );
    }

    /// Levels and frequencies between bins, small beside large, and nothing that is not there.
    #[test]
    fn the_window_finds_small_lines_between_bins() {
        let n = 1 << 12;
        let bins = |b: f64| b / n as f64;
        for shift in [0.0, 0.13, 0.25, 0.49, 0.5, 0.77] {
            let [big, near, far] = [500.0 + shift, 516.0, 1500.5 + shift];
            let of = [(bins(big), 1.0), (bins(near), 1e-6), (bins(far), 1e-8)];
            let found = lines(&tones(n, &of), Method::BlackmanHarris7).unwrap();
            assert_eq!(found.others.len(), 2, "{:?}", found.others);
            for (line, (f, a)) in [found.largest].iter().chain(&found.others).zip(of) {
                // The parabola is off by 0.0057 dB at most, sidelobes of the largest add 1e-9.
                let within_db = 0.0058 + 20.0 * (1.0 + 1e-9 / a).log10();
                let error_db = 20.0 * (line.amplitude / a).log10();
                assert!(error_db.abs() < within_db, "{shift} {error_db} dB");
                assert!((line.frequency - f).abs() * (n as f64) < 0.05, "{shift}");
            }
            let rest = (0.5e-12 + 0.5e-16) / found.rest_power;
            assert!((rest - 1.0).abs() < 1e-3, "{rest}");
        }
    }

    /// The floor that is stated is that of the window.
    #[test]
    fn the_window_has_the_sidelobes_that_its_source_gives() {
        let (count, stretch) = (1024, 32);
        let mut padded = vec![0.0; count * stretch];
        for (n, value) in padded.iter_mut().take(count).enumerate() {
            *value = Method::BlackmanHarris7.weight(n, count);
        }
        let mut buffer: Vec<Complex<f64>> = padded.iter().map(|x| Complex::new(*x, 0.0)).collect();
        FftPlanner::new()
            .plan_fft_forward(buffer.len())
            .process(&mut buffer);
        let db = |c: &Complex<f64>| 20.0 * (c.norm() / buffer[0].norm()).log10();
        let side = buffer[7 * stretch..buffer.len() / 2].iter().map(db);
        let worst = side.fold(f64::NEG_INFINITY, f64::max);
        assert!((-180.5..-179.9).contains(&worst), "{worst}");
    }
}
