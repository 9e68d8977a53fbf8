//! The lines that rounding makes of a tone where noise does not hide them: they are harmonics of it, up to high orders,
//! folded to anywhere in the spectrum, and are neither a pickup nor a spur of the oscillator.
//!
//! Rounding A cos p adds the sum over k of (-1)^k sin(2 pi k A cos p) / (pi k), of which harmonic n has the amplitude
//! 2 / (pi k) J_n(2 pi k A) (Gray 1990). A fit of the error (see [`super::columns::SAW`]) takes them away where the
//! steps are known to a part of a code; a wander of the amplitude or a random instant of sampling leaves some of each.

use super::tone::{Tone, fold};
use std::f64::consts::{PI, TAU};

/// Terms k: a ninth adds less than a twentieth of what the first does.
const TERMS: i32 = 8;
/// Terms up to the highest harmonics of which lines are looked for.
const HIGHEST: f64 = 4.0;

/// The largest amplitude that harmonic `order` of the rounding error of a tone of this amplitude may have, codes.
pub fn largest(order: usize, amplitude: f64) -> f64 {
    (1..=TERMS)
        .map(|k| {
            let k = f64::from(k);
            2.0 / (PI * k) * largest_bessel(order as f64, TAU * k * amplitude)
        })
        .sum()
}

/// A bound of |J_n(x)|: its largest value over all x, and the amplitude of its oscillation beyond x = n; 0 where
/// it is below a hundredth of the largest (Abramowitz and Stegun, 9.3 and 9.5).
fn largest_bessel(n: f64, x: f64) -> f64 {
    let third = n.cbrt();
    let most = 0.675 / third;
    if x > n {
        most.min((2.0 / (PI * (x * x - n * n).sqrt())).sqrt())
    } else if n - x > 3.0 * third {
        0.0
    } else {
        most
    }
}

/// Whether rounding explains lines of these amplitudes (by channel, codes) at a place (turns a sample, to `within`),
/// the tones having the amplitudes `tones`.
pub fn explains(tone: &Tone, tones: [f64; 2], turns: f64, within: f64, lines: [f64; 2]) -> bool {
    let highest = tones.iter().fold(0.0f64, |a, b| a.max(*b)) * TAU * HIGHEST;
    let highest = highest.min(4e6) as usize + 8;
    (2..highest).any(|order| {
        (fold(order as f64 * tone.turns) - turns).abs() < within
            && lines
                .iter()
                .zip(tones)
                .all(|(line, tone)| *line <= largest(order, tone))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustfft::FftPlanner;
    use rustfft::num_complex::Complex;

    /// Amplitudes of the harmonics of round(A cos p + offset), from sums over the phase.
    fn harmonics(amplitude: f64, offset: f64) -> Vec<f64> {
        let count = 1 << 16;
        let code = |i: i32| {
            let p = TAU * (f64::from(i) + 0.37) / f64::from(count);
            Complex::from((amplitude * p.cos() + offset + 0.5).floor())
        };
        let mut sums: Vec<Complex<f64>> = (0..count).map(code).collect();
        FftPlanner::new()
            .plan_fft_forward(sums.len())
            .process(&mut sums);
        sums.iter()
            .map(|sum| 2.0 / f64::from(count) * sum.norm())
            .collect()
    }

    #[test]
    fn no_harmonic_of_rounding_is_larger() {
        for amplitude in [5.3, 40.72, 69.4] {
            for offset in [0.0, 0.23, 0.5] {
                let harmonics = harmonics(amplitude, offset);
                let highest = (3.0 * TAU * amplitude) as usize;
                for (order, is) in harmonics.iter().enumerate().take(highest).skip(2) {
                    let bound = largest(order, amplitude);
                    assert!(
                        *is < bound + 4e-3,
                        "{amplitude} {offset} {order}: {is} {bound}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_larger_or_elsewhere_is_a_line() {
        let tone = Tone {
            word: None,
            turns: 0.130_562_017_4,
            offset_turns: 0.0,
        };
        let at = fold(301.0 * tone.turns);
        let tones = [69.4, 41.0];
        assert!(explains(&tone, tones, at, 1e-6, [0.03, 0.0]));
        assert!(!explains(&tone, tones, at, 1e-6, [0.3, 0.0]));
        // Order 301 is above the steps that the smaller tone crosses in a period.
        assert!(!explains(&tone, [3.0, 1.0], at, 1e-6, [0.03, 0.0]));
        assert!(!explains(&tone, tones, at + 2e-5, 1e-6, [0.03, 0.0]));
    }
}
