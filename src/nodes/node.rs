//! What is known of one node after a run: its range, its errors, its bound.

use super::activity::Sketch;
use super::histogram::Histogram;
use crate::numeric::cast::Label;
use crate::numeric::lane::Lane;
use crate::numeric::paired::Pair;

/// Of an exact intermediate, which is held by no word of the design.
pub const UNLIMITED: (i128, i128) = (i128::MIN, i128::MAX);

/// What a node is.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity {
    /// The dotted key of the design and, where there are several, the channel or the part.
    pub name: String,
    /// Of its values.
    pub unit: &'static str,
    /// One LSB is 2^-fraction_bits of the unit.
    pub fraction_bits: i32,
    /// The raw words that it can hold.
    pub limits: (i128, i128),
    /// A change of the value by less than this is no movement: a quarter of what is rounded there.
    pub step: f64,
}

/// A word that did not fit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Event {
    /// 0-based ADC sample; at the slow rate the period's last.
    pub sample: u64,
    /// The key, with its channel.
    pub label: Label,
    /// The node's own name.
    pub part: String,
    /// The node's number.
    pub node: usize,
    /// What went into it, raw.
    pub operands: Vec<i128>,
    /// The raw word before the overflow step.
    pub value: i128,
}

/// What a node made its word of, in words: the operation, and the raw words that went in by name.
pub fn operation(part: &str, operands: &[i128]) -> String {
    let key = part.split(' ').next().unwrap_or_default();
    match (key, operands) {
        ("circuit.demodulator.product", [code, entry]) => {
            format!("ADC code {code} times table entry {entry}")
        }
        ("circuit.cordic.width", [i, q]) => {
            format!("x or y of the CORDIC, whose inputs are drive_i {i} and drive_q {q}")
        }
        ("compensation.accumulator", [step, input]) if part.contains(" inner ") => {
            format!("step {step} times input {input}")
        }
        ("compensation.accumulator", [coefficient, product]) => {
            format!("aligned coefficient {coefficient} plus product {product}")
        }
        ("compensation.output", [rate, bias]) => format!("rate {rate} less bias {bias}"),
        // The only cast that names none.
        (_, []) => "integrator plus phase error".to_owned(),
        _ => {
            let operands: Vec<String> = operands.iter().map(i128::to_string).collect();
            format!("from the raw word {}", operands.join(" and "))
        }
    }
}

/// Every word of a node, fixed and float.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct History {
    /// Raw.
    pub raw: Vec<i128>,
    /// In the node's unit.
    pub real: Vec<f64>,
}

/// Sums over all samples of a node.
#[derive(Debug, Clone)]
pub struct Node {
    /// Name, unit, format.
    pub identity: Identity,
    /// Different words that went in.
    pub different: Sketch,
    /// Samples.
    pub count: u64,
    /// Least raw word.
    pub min_raw: i128,
    /// Greatest raw word.
    pub max_raw: i128,
    /// Greatest |fixed - float|.
    pub max_abs_error: f64,
    /// Sum of fixed - float.
    pub sum_error: f64,
    /// Sum of its square.
    pub sum_square: f64,
    /// How often fixed - float was how large.
    pub errors: Histogram,
    /// Greatest bound.
    pub max_bound: f64,
    /// Greatest error / bound of a sample, and the ADC sample.
    pub worst: (f64, u64),
    /// Samples whose error is outside their own bound.
    pub outside: u64,
    /// The first of them.
    pub first_outside: Option<u64>,
    /// Rounding of the node's own cast, LSB: sum, sum of squares.
    pub local: (f64, f64),
    /// Samples of `local`.
    pub local_count: u64,
    /// Words outside the format.
    pub overflows: u64,
    /// Greatest and least raw word before the overflow step.
    pub before: (i128, i128),
    /// Sum of squares of the float value.
    pub sum_value_square: f64,
    /// Positive less negative float values.
    pub balance: i64,
    /// Samples whose float value moved by a quarter of an LSB or more, and the last value.
    pub moved: (u64, f64),
    /// Every word, where somebody asked for them.
    pub history: Option<History>,
}

impl Node {
    /// A node that has seen nothing.
    pub fn new(identity: Identity) -> Self {
        Node {
            errors: Histogram::new(crate::numeric::format::pow2(-identity.fraction_bits)),
            identity,
            different: Sketch::new(1 << 14),
            count: 0,
            min_raw: i128::MAX,
            max_raw: i128::MIN,
            max_abs_error: 0.0,
            sum_error: 0.0,
            sum_square: 0.0,
            max_bound: 0.0,
            worst: (0.0, 0),
            outside: 0,
            first_outside: None,
            local: (0.0, 0.0),
            local_count: 0,
            overflows: 0,
            before: (0, 0),
            sum_value_square: 0.0,
            balance: 0,
            moved: (0, 0.0),
            history: None,
        }
    }

    /// Notes a word at an ADC sample.
    #[inline(always)]
    pub fn note<W: Lane>(&mut self, word: &Pair<W>, sample: u64) {
        self.note_error(
            word.raw.wide(),
            word.error(),
            word.total_bound(),
            word.real,
            sample,
        );
    }

    /// Notes a raw word and a float value with their distance and its bound.
    #[inline(always)]
    pub fn note_error(&mut self, raw: i128, error: f64, bound: f64, real: f64, sample: u64) {
        self.min_raw = self.min_raw.min(raw);
        self.max_raw = self.max_raw.max(raw);
        if let Some(history) = &mut self.history {
            history.raw.push(raw);
            history.real.push(real);
        }
        let size = error.abs();
        self.count += 1;
        self.balance += i64::from(real > 0.0) - i64::from(real < 0.0);
        self.sum_error += error;
        self.sum_square += error * error;
        self.errors.add(error);
        self.max_abs_error = self.max_abs_error.max(size);
        self.max_bound = self.max_bound.max(bound);
        if size > self.worst.0 * bound {
            self.worst = (size / bound, sample);
        }
        // Written so that a NaN is outside.
        let inside = size <= bound;
        if !inside {
            self.outside += 1;
            self.first_outside.get_or_insert(sample);
        }
        self.sum_value_square += real * real;
        let moved = (real - self.moved.1).abs() >= self.identity.step;
        self.moved = (self.moved.0 + u64::from(moved), real);
    }

    /// Notes the rounding error of the node's own cast, LSB.
    #[inline(always)]
    pub fn note_local(&mut self, lsb: f64) {
        self.local.0 += lsb;
        self.local.1 += lsb * lsb;
        self.local_count += 1;
    }

    /// Notes a word before the overflow step.
    #[inline(always)]
    pub fn note_before(&mut self, word: i128) {
        self.before.0 = self.before.0.max(word);
        self.before.1 = self.before.1.min(word);
    }

    /// Root mean square of fixed - float.
    pub fn rms_error(&self) -> f64 {
        (self.sum_square / self.count.max(1) as f64).sqrt()
    }

    /// Mean of fixed - float.
    pub fn mean_error(&self) -> f64 {
        self.sum_error / self.count.max(1) as f64
    }

    /// Root mean square of the cast's own rounding, LSB; `None` where it never rounds.
    pub fn local_rms_lsb(&self) -> Option<f64> {
        (self.local_count > 0).then(|| (self.local.1 / self.local_count as f64).sqrt())
    }

    /// Mean square of the float value.
    pub fn mean_square_value(&self) -> f64 {
        self.sum_value_square / self.count.max(1) as f64
    }

    /// True if the float value moves by a quarter of an LSB or more at a share of all samples, and the node's input takes
    /// at least so many different words.
    pub fn is_active(&self, share: f64, words: f64) -> bool {
        self.moving() >= share && self.different.count() >= words
    }

    /// Share of samples at which the float value moved by a quarter of an LSB or more.
    pub fn moving(&self) -> f64 {
        self.moved.0 as f64 / self.count.max(1) as f64
    }

    /// log2 of how many times larger the words could become before the format is left: of the
    /// tighter end. `None` for a node that never left 0 or saw nothing.
    pub fn headroom_bits(&self) -> Option<f64> {
        if self.count == 0 || self.identity.limits == UNLIMITED {
            return None;
        }
        let (low, high) = self.identity.limits;
        let room = |seen: i128, limit: i128| match (seen.signum(), limit.signum()) {
            (0, _) => f64::INFINITY,
            _ => (limit as f64 / seen as f64).log2(),
        };
        let up = if self.max_raw > 0 {
            room(self.max_raw, high)
        } else {
            f64::INFINITY
        };
        let down = if self.min_raw < 0 {
            room(self.min_raw, low)
        } else {
            f64::INFINITY
        };
        let bits = up.min(down);
        bits.is_finite().then_some(bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_word_was_made_of_is_named_with_its_operation() {
        assert_eq!(
            operation("circuit.cordic.width", &[-32047, -185_330]),
            "x or y of the CORDIC, whose inputs are drive_i -32047 and drive_q -185330"
        );
        assert_eq!(
            operation("circuit.demodulator.product sense_i", &[3, -5]),
            "ADC code 3 times table entry -5"
        );
        assert_eq!(
            operation("compensation.accumulator inner 1", &[7, 9]),
            "step 7 times input 9"
        );
        assert_eq!(
            operation("compensation.accumulator outer 1", &[7, 9]),
            "aligned coefficient 7 plus product 9"
        );
        assert_eq!(
            operation("circuit.decimator.output sense_i", &[7]),
            "from the raw word 7"
        );
    }
}
