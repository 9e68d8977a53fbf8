//! The flat top of a limited tone: rows whose phase puts the tone above a level all have the same mean.

use super::clipping::{Limits, training};
use super::columns::{COS, Model, SIN, TRUNCATED};
use super::input::Capture;
use super::truncation::Truncation;
use nalgebra::{Matrix3, Vector3};

/// Phases that the mean is taken over.
const BINS: usize = 1024;

/// The address of a channel's tone, if most of it is at truncated phases in the model.
fn truncated(model: &Model, channel: usize) -> Option<Truncation> {
    let coefficients = &model.coefficients[channel];
    let at = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
    let [sin, cos] = model.declared[channel];
    let tone = (sin + at(SIN)).hypot(cos + at(COS));
    let replaced = at(TRUNCATED).hypot(at(TRUNCATED + 1));
    model.truncation.filter(|_| replaced > 0.5 * tone)
}

/// The tone by the rows inside of the limits.
#[derive(Debug, Clone, Default)]
pub struct Inside {
    /// Constant, sine and cosine, codes.
    pub tone: [f64; 3],
    /// The sums of products that told it.
    sums: Matrix3<f64>,
}

/// Means by phase.
pub struct Profile {
    /// Rows, means of the codes, of the sine and of the cosine, by phase.
    bins: Vec<[f64; 4]>,
}

impl Profile {
    /// Of the training rows of a channel.
    pub fn of(capture: &Capture, model: &Model, channel: usize) -> Self {
        let mut bins = vec![[0.0; 4]; BINS];
        // The tone of a truncated oscillator is at the phases of its table.
        let truncated = truncated(model, channel);
        for (row, code) in training(capture, channel) {
            let phase = model.tone.phase(row);
            let phase = truncated.map_or(phase, |t| t.phase(phase));
            let (sin, cos) = (std::f64::consts::TAU * phase).sin_cos();
            if let Some(bin) = bins.get_mut((phase * BINS as f64) as usize % BINS) {
                for (sum, value) in bin.iter_mut().zip([1.0, f64::from(code), sin, cos]) {
                    *sum += value;
                }
            }
        }
        for bin in &mut bins {
            let [n, rest @ ..] = bin;
            rest.iter_mut().for_each(|v| *v /= n.max(1.0));
        }
        Profile { bins }
    }

    fn filled(&self) -> impl Iterator<Item = &[f64; 4]> {
        self.bins.iter().filter(|b| b[0] > 0.0)
    }

    /// Limits a little inside the outermost means.
    pub fn first_guess(&self) -> Option<Limits> {
        let mut means: Vec<f64> = self.filled().map(|b| b[1]).collect();
        means.sort_by(f64::total_cmp);
        let n = means.len();
        if n < 8 {
            return None;
        }
        let at = |share: f64| means.get((share * n as f64) as usize).copied();
        Some(Limits {
            low: at(0.02)?,
            high: at(0.98)?,
            is_front: false,
        })
    }

    /// Least squares of constant, sine and cosine over what is inside the limits by phase; the
    /// first time by code.
    pub fn fit(&self, limits: Limits, margin: f64) -> Option<Inside> {
        let mut found: Option<Inside> = None;
        for _ in 0..3 {
            let inside = |b: &&[f64; 4]| {
                let x = found.as_ref().map_or(b[1], |f| value(&f.tone, b));
                x < limits.high - margin && x > limits.low + margin
            };
            let mut sums = Matrix3::<f64>::zeros();
            let mut right = Vector3::<f64>::zeros();
            for b in self.filled().filter(inside) {
                let row = terms(b);
                sums += row * row.transpose() * b[0];
                right += row * (b[0] * b[1]);
            }
            let solved = sums.cholesky()?.solve(&right);
            let tone = [solved.x, solved.y, solved.z];
            found = Some(Inside { tone, sums });
        }
        found
    }

    /// Means of what the tone puts beyond the limits.
    pub fn levels(&self, tone: &[f64; 3], limits: Limits, margin: f64) -> Limits {
        let mean = |beyond: &dyn Fn(f64) -> bool, old: f64| {
            let (n, sum) = self
                .filled()
                .filter(|b| beyond(value(tone, b)))
                .fold((0.0, 0.0), |(n, sum), b| (n + b[0], sum + b[0] * b[1]));
            if n > 0.0 { sum / n } else { old }
        };
        Limits {
            low: mean(&|x| x < limits.low - 0.3 * margin, limits.low),
            high: mean(&|x| x > limits.high + 0.3 * margin, limits.high),
            is_front: false,
        }
    }

    /// The limits with a flat top: beyond them the mean is the level and not the tone. What the tone is there is known
    /// as well as the rows inside tell it: of a tone that noise nearly hides they tell little, and a slope that chance
    /// gave them is no limit. The chi-square of what is beyond about the tone is therefore that with the covariance of
    /// the prediction (by Woodbury's identity), not that of the noise alone.
    pub fn significant(&self, inside: &Inside, limits: Limits, sigma: f64) -> (Limits, usize) {
        let mut out = Limits::NONE;
        let mut rows = 0;
        for upper in [true, false] {
            let level = if upper { limits.high } else { limits.low };
            let sign = if upper { 1.0 } else { -1.0 };
            let (mut n, mut gain, mut deepest) = (0.0, 0.0, 0.0f64);
            let (mut sums, mut apart) = (inside.sums, Vector3::<f64>::zeros());
            for b in self.filled() {
                let x = value(&inside.tone, b);
                if sign * (x - level) > 0.0 {
                    deepest = deepest.max(sign * (x - level));
                    let (with, without) = (b[1] - level, b[1] - x);
                    gain += 0.5 * b[0] * (without * without - with * with) / (sigma * sigma);
                    n += b[0];
                    let row = terms(b);
                    sums += row * row.transpose() * b[0];
                    apart += row * (b[0] * without);
                }
            }
            let known = sums.cholesky().map_or(0.0, |c| apart.dot(&c.solve(&apart)));
            gain -= 0.5 * known / (sigma * sigma);
            // The quantiser itself is flat for half a code.
            if gain > 12.0 && n >= 3.0 && deepest > 0.75 {
                rows += n as usize;
                if upper {
                    out.high = level;
                } else {
                    out.low = level;
                }
            }
        }
        (out, rows)
    }
}

/// Constant, sine and cosine of a phase.
fn terms(bin: &[f64; 4]) -> Vector3<f64> {
    Vector3::new(1.0, bin[2], bin[3])
}

fn value(tone: &[f64; 3], bin: &[f64; 4]) -> f64 {
    tone[0] + tone[1] * bin[2] + tone[2] * bin[3]
}

#[cfg(test)]
mod tests {
    use super::super::clipping::find;
    use super::super::synthetic::{Made, model};
    use super::*;

    #[test]
    fn a_tone_that_noise_nearly_hides_has_no_flat_top() {
        // Of 65 codes: three deviations of the noise leave few rows about the middle to tell it by.
        let words = [0x0734_5679, 0x0411_0a1b, 0x1321_0777];
        let all = words.map(|word| [19.0, 20.0, 20.5, 21.0].map(|noise| (word, noise)));
        for (word, noise) in all.into_iter().flatten() {
            let made = Made {
                rows: 60_000,
                word,
                noise,
                ..Made::CLEAN
            };
            let capture = made.capture();
            let (_, model) = model(&capture, &made);
            let found = find(&capture, &model, 1).map_or(Limits::NONE, |f| f.limits);
            assert_eq!(found, Limits::NONE, "{word} {noise}");
        }
    }
}
