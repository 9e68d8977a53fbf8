//! What the word lengths do to the readings: the fixed-point path less the float path, measured over all of them,
//! and which word does most of it, found by giving each one more bits while the others stay.

use super::coefficients;
use super::own_run::{Overflowing, OwnRun};
use crate::design::{Design, limits};
use crate::error::Result;
use crate::numeric::format::Format;
use crate::thermal::BaselineFit;
use serde::Serialize;

/// Bits that a word gets more, if the engine holds them.
const MORE_BITS: u32 = 8;
/// A word that takes less than this share of the rms away is not called the largest.
const NOTABLE: f64 = 0.05;

/// What the readings passed in fixed point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Covers {
    /// From the ADC's codes to the compensated rate.
    CircuitAndCompensation,
    /// A record's thermometer and rate, through the compensation alone.
    Compensation,
}

/// One word with more bits, the others as they are.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Widened {
    /// The dotted key.
    pub key: &'static str,
    /// As it is.
    pub from: String,
    /// As it was tried.
    pub to: String,
    /// Root mean square of fixed less float that is left, deg/s.
    pub left_rms_dps: f64,
}

/// How far fixed-point readings are from those of the float path.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct WordLengths {
    /// Which words are in it.
    pub covers: Covers,
    /// Readings.
    pub readings: usize,
    /// Root mean square of fixed less float, deg/s.
    pub rms_dps: f64,
    /// Mean of it, deg/s.
    pub mean_dps: f64,
    /// Greatest distance, deg/s.
    pub max_dps: f64,
    /// The word that does most; null where none does a notable part alone, and for a record.
    pub largest: Option<Widened>,
    /// What overflows, looked for where the word lengths limit the design's own run; then no word is tried longer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overflow: Option<Overflowing>,
    /// Every word that was tried, the one that does most first.
    pub widened: Vec<Widened>,
}

impl WordLengths {
    /// Of readings in deg/s; `run` is the design's own, which can be repeated with other words.
    ///
    /// # Errors
    /// A circuit that stops on an overflow.
    pub fn measure(
        design: &Design,
        fit: &BaselineFit,
        fixed: &[f64],
        float: &[f64],
        run: Option<&OwnRun>,
    ) -> Result<Self> {
        let apart = apart(fixed, float);
        let rms_dps = rms(&apart);
        let is_limiting = rms_dps >= fit.heldout_rms_dps;
        let overflow = run
            .filter(|_| is_limiting)
            .and_then(|run| run.overflow(design));
        let mut widened = Vec::new();
        for (key, widen) in WORDS {
            // More fraction bits hold no larger value.
            let Some(run) = run.filter(|_| overflow.is_none()) else {
                break;
            };
            let Some((from, to, other)) = tried(design, fit, *widen) else {
                continue;
            };
            let fixed = run.fixed_dps(&other)?;
            widened.push(Widened {
                key,
                from,
                to,
                left_rms_dps: rms(&self::apart(&fixed, float)),
            });
        }
        widened.sort_by(|a, b| a.left_rms_dps.total_cmp(&b.left_rms_dps));
        let first = widened.first();
        let largest = first.filter(|w| w.left_rms_dps < (1.0 - NOTABLE) * rms_dps);
        Ok(WordLengths {
            covers: match run {
                Some(_) => Covers::CircuitAndCompensation,
                None => Covers::Compensation,
            },
            readings: apart.len(),
            rms_dps,
            mean_dps: apart.iter().sum::<f64>() / apart.len().max(1) as f64,
            max_dps: apart.iter().fold(0.0, |m, v| m.max(v.abs())),
            largest: largest.cloned(),
            overflow,
            widened,
        })
    }

    /// The same in a clause.
    pub fn clause(&self, fit_dps: f64) -> String {
        let whose = match self.covers {
            Covers::CircuitAndCompensation => "word lengths",
            Covers::Compensation => "word lengths of the compensation",
        };
        let largest = self.largest.as_ref();
        let mut largest = largest.map_or(String::new(), |w| {
            format!(" (largest part: {} = {})", w.key, w.from)
        });
        if let Some(overflow) = &self.overflow {
            largest = format!(" ({} overflows)", overflow.word);
        }
        format!(
            "{} deg/s from the fit, {} deg/s from {whose}{largest}",
            shown(fit_dps, 3),
            shown(self.rms_dps, 2)
        )
    }

    /// What it says, beside what the fit leaves (`fit_dps`, rms).
    pub fn sentence(&self, fit_dps: f64) -> String {
        let limiting = if self.rms_dps < fit_dps {
            "The fit limits the result"
        } else {
            "The word lengths limit the result"
        };
        let whose = match self.covers {
            Covers::CircuitAndCompensation => "word lengths of circuit and compensation",
            Covers::Compensation => "word lengths of the compensation",
        };
        // `simulate` compares two runs, one of them without the ADC's rounding.
        let codes = match self.covers {
            Covers::CircuitAndCompensation => {
                "; both had the same ADC codes: the ADC's rounding is not in it, unlike in the figure of `simulate`"
            }
            Covers::Compensation => "",
        };
        let mut text = format!(
            "{limiting}: fit {} deg/s held-out rms, {whose} {} deg/s rms. Over these {} readings the compensated rate in fixed point \
             differed from that in floating point by {} deg/s at most (measured{codes})",
            shown(fit_dps, 3),
            shown(self.rms_dps, 2),
            self.readings,
            shown(self.max_dps, 2)
        );
        if self.covers == Covers::Compensation {
            text += ". The circuit before the compensation is not in it: a record begins after it";
        }
        if let Some(overflow) = &self.overflow {
            text += &format!(". {} overflows", overflow.word);
            let mend = overflow.mend();
            text += &mend.map_or(String::new(), |mend| format!(". {mend}"));
        }
        match &self.largest {
            Some(w) => {
                text += &format!(
                    ". The largest part is that of {} ({}). With {} the word lengths make {} deg/s rms instead of {}",
                    w.key,
                    w.from,
                    w.to,
                    shown(w.left_rms_dps, 2),
                    shown(self.rms_dps, 2)
                );
            }
            None if !self.widened.is_empty() => {
                text += ". No word alone makes a notable part of it"
            }
            None => {}
        }
        text + "."
    }
}

/// With so many significant digits.
fn shown(value: f64, digits: i32) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = f64::from(digits - 1) - value.abs().log10().floor();
    format!("{value:.*}", decimals.clamp(0.0, 12.0) as usize)
}

fn apart(fixed: &[f64], float: &[f64]) -> Vec<f64> {
    let pairs = fixed.iter().zip(float);
    let apart = pairs.map(|(a, b)| a - b);
    apart.filter(|d| d.is_finite()).collect()
}

fn rms(values: &[f64]) -> f64 {
    let sum: f64 = values.iter().map(|v| v * v).sum();
    (sum / values.len().max(1) as f64).sqrt()
}

/// Gives a word of a design so many bits more: what it was, what it is.
type Widen = fn(&mut Design, u32) -> Option<(String, String)>;

/// Words that the readings pass. What is stated in another word's LSB moves with it; the loops' own words are
/// not among them: the codes are those of the run, whatever the loops would do.
const WORDS: &[(&str, Widen)] = &[
    ("circuit.nco.table_address_bits", |d, more| {
        let nco = &mut d.circuit.nco;
        let from = nco.table_address_bits;
        let most = nco.phase_bits.min(16);
        nco.table_address_bits = (from + more).min(most);
        (nco.table_address_bits > from).then(|| bits(from, nco.table_address_bits))
    }),
    ("circuit.nco.table", |d, more| {
        longer(&mut d.circuit.nco.table, more, 40)
    }),
    ("circuit.demodulator.product", |d, more| {
        longer(&mut d.circuit.demodulator.product.format, more, 64)
    }),
    ("circuit.decimator.output", |d, more| {
        d.circuit.cordic.width = Some(d.circuit.cordic.width + more).filter(|w| *w <= 64)?;
        if let Some(l) = &mut d.circuit.amplitude_loop {
            l.setpoint_raw = l.setpoint_raw.checked_mul(1 << more)?;
            l.error_shift = shift(l.error_shift, more)?;
            l.integrator_shift = shift(l.integrator_shift, more)?;
            l.initial_raw = l.initial_raw.checked_mul(1 << more)?;
        }
        longer(&mut d.circuit.decimator.output.format, more, 64)
    }),
    ("circuit.cordic.iterations", |d, more| {
        let from = d.circuit.cordic.iterations;
        d.circuit.cordic.iterations = (from + more).min(30);
        let to = d.circuit.cordic.iterations;
        (to > from).then(|| bits(from, to))
    }),
    ("circuit.cordic.guard_bits", |d, more| {
        let cordic = &mut d.circuit.cordic;
        let from = cordic.guard_bits;
        cordic.guard_bits = from + more;
        cordic.width += more;
        (cordic.guard_bits <= 32 && cordic.width <= 64).then(|| bits(from, from + more))
    }),
    ("circuit.cordic.angle_bits", |d, more| {
        let from = d.circuit.cordic.angle_bits;
        d.circuit.cordic.angle_bits = Some(from + more).filter(|b| *b <= 64)?;
        if let Some(l) = &mut d.circuit.phase_loop {
            l.setpoint_raw = l.setpoint_raw.checked_mul(1 << more)?;
            l.proportional.shift = shift(l.proportional.shift, more)?;
            l.integral.shift = shift(l.integral.shift, more)?;
            l.integrator_bits = (l.integrator_bits + more).min(64);
        }
        Some(bits(from, from + more))
    }),
    ("compensation.coefficient_format", |d, more| {
        let c = d.compensation.as_mut()?;
        let wide = c.coefficient_format.fraction_bits + more <= c.accumulator.format.fraction_bits;
        wide.then(|| longer(&mut c.coefficient_format, more, 64))?
    }),
    ("compensation.accumulator", |d, more| {
        longer(&mut d.compensation.as_mut()?.accumulator.format, more, 64)
    }),
    ("compensation.output", |d, more| {
        longer(&mut d.compensation.as_mut()?.output.format, more, 64)
    }),
];

/// A shift of at most 63.
fn shift(from: u32, more: u32) -> Option<u32> {
    Some(from + more).filter(|to| *to <= 63)
}

fn bits(from: u32, to: u32) -> (String, String) {
    (from.to_string(), to.to_string())
}

fn longer(format: &mut Format, more: u32, most: u32) -> Option<(String, String)> {
    let from = format.to_string();
    format.fraction_bits += more;
    (format.bits() <= most).then(|| (from, format.to_string()))
}

/// The design with a word of as many more bits as the engine holds, and the fit rounded into it anew.
fn tried(design: &Design, fit: &BaselineFit, widen: Widen) -> Option<(String, String, Design)> {
    // A form that stands for the polynomial was made for its words.
    let has_form = design
        .compensation
        .as_ref()
        .is_some_and(|c| c.form.is_some());
    (1..=MORE_BITS).rev().find_map(|more| {
        let mut other = design.clone();
        let (from, to) = widen(&mut other, more)?;
        limits::check(&other).ok()?;
        let is_compensated = other.compensation != design.compensation
            || other.circuit.cordic.angle_bits != design.circuit.cordic.angle_bits;
        if is_compensated {
            if has_form {
                return None;
            }
            coefficients::round(&mut other, fit).ok()?;
            limits::check(&other).ok()?;
        }
        Some((from, to, other))
    })
}

#[cfg(test)]
#[path = "word_lengths_tests.rs"]
mod tests;
