//! The order of a polynomial's steps: Horner's rule or Estrin's scheme, over the same words.
//!
//! Words t_0 .. t_m begin as the coefficients, lowest order first, in the variable v. A step is
//! t_j = cast_i(t_(j+s) v^s + t_j); the result is t_0.
//!
//! | evaluation | steps |
//! |---|---|
//! | Horner | s = 1; j = m-1 .. 0 |
//! | Estrin | s = 1, 2, 4, .. up to m; j = 0, 2s, 4s, .. with j + s <= m; v^2s = cast_i(v^s v^s) |
//!
//! Estrin: G. Estrin, "Organization of computer systems: the fixed plus variable structure computer", Western Joint
//! IRE-AIEE-ACM Computer Conference (1960). It multiplies more, but the steps of one s do not wait for each other.

use super::polynomial::HIGHEST_DEGREE;
use crate::error::{InputError, Result};
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::{Overflow, Rounding, pow2};

/// Names of the steps, by the order at which they add.
const STEPS: [&str; HIGHEST_DEGREE + 1] = [
    "c0", "c1", "c2", "c3", "c4", "c5", "c6", "c7", "c8", "c9", "c10", "c11", "c12", "c13", "c14",
    "c15", "c16", "c17", "c18", "c19", "c20", "c21", "c22", "c23", "c24",
];
/// Names of the variable's powers.
const POWERS: [&str; 4] = ["v^2", "v^4", "v^8", "v^16"];

/// The order of the steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scheme {
    /// One step after the other: fewest multiplications.
    #[default]
    Horner,
    /// Pairs, then pairs of pairs: more multiplications, a shorter chain of steps.
    Estrin,
}

impl Scheme {
    /// (s as a power of two, j) of each step, for t_0 .. t_m.
    fn steps(self, m: usize) -> Vec<(usize, usize)> {
        match self {
            Scheme::Horner => (0..m).rev().map(|j| (0, j)).collect(),
            Scheme::Estrin => {
                let levels = (0..).take_while(|level| 1usize << level <= m);
                let pairs = |level: usize| {
                    let s = 1 << level;
                    (0..=m - s).step_by(2 * s).map(move |j| (level, j))
                };
                levels.flat_map(pairs).collect()
            }
        }
    }
}

/// A coefficient: raw, fraction bits.
pub(super) type Coefficient = (i128, i32);

/// A word that a step reads.
#[derive(Debug, Clone, Copy)]
enum Operand {
    /// A coefficient, aligned.
    Constant(i128, i32),
    /// t_j.
    Word(usize),
}

/// t_j = cast(t_(j+s) v^s + t_j).
#[derive(Debug, Clone)]
struct Step {
    /// s = 2^level.
    level: usize,
    to: usize,
    high: Operand,
    low: Operand,
    /// Appends zeros to a product with fewer fraction bits than what is added.
    align: Option<Cast>,
    /// The same for a word that is added to a finer product.
    align_low: Option<Cast>,
    cast: Cast,
}

/// The compiled steps.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    coefficients: Vec<Coefficient>,
    /// v^2, v^4, ..
    powers: Vec<Cast>,
    steps: Vec<Step>,
    /// Fraction bits of the result.
    pub(super) fraction_bits: i32,
}

impl Plan {
    /// For coefficients in a variable of so many fraction bits; `orders` are what the steps are named after.
    pub(super) fn new(
        scheme: Scheme,
        coefficients: Vec<Coefficient>,
        orders: &[usize],
        variable: i32,
        intermediate: Target,
    ) -> Result<Plan> {
        let inner = intermediate.fraction_bits;
        let quantise = |label, from| {
            let (half_up, saturate) = (Rounding::HalfUp, Some(Overflow::Saturate));
            Cast::new(label, from, 0, intermediate, half_up, saturate)
        };
        let m = coefficients.len().saturating_sub(1);
        let mut words: Vec<Operand> = coefficients
            .iter()
            .map(|(raw, bits)| Operand::Constant(*raw, *bits))
            .collect();
        let mut bits: Vec<i32> = coefficients.iter().map(|(_, bits)| *bits).collect();
        let mut steps = Vec::new();
        let mut highest = 0;
        for (level, j) in scheme.steps(m) {
            highest = highest.max(level);
            let power = if level == 0 { variable } else { inner };
            let other = j + (1 << level);
            let product = bits[other] + power;
            let sum = product.max(bits[j]);
            let name = orders.get(j).and_then(|k| STEPS.get(*k));
            let label = Label::on("polynomial step", name.copied().unwrap_or("c"));
            let zeros = |from: i32| {
                let target = Target::signed(127, sum);
                (sum > from).then(|| Cast::new(label, from, 0, target, Rounding::Floor, None))
            };
            let (low, align_low) = match words[j] {
                Operand::Constant(raw, own) => {
                    let low = Operand::Constant(aligned(raw, (sum - own) as u32)?, sum);
                    (low, None)
                }
                word => (word, zeros(bits[j])),
            };
            steps.push(Step {
                level,
                to: j,
                high: words[other],
                low,
                align: zeros(product),
                align_low,
                cast: quantise(label, sum),
            });
            words[j] = Operand::Word(j);
            bits[j] = inner;
        }
        let powers = (0..highest).map(|level| {
            let from = if level == 0 { variable } else { inner };
            let name = POWERS.get(level).copied().unwrap_or("v");
            quantise(Label::on("polynomial power", name), 2 * from)
        });
        Ok(Plan {
            powers: powers.collect(),
            steps,
            fraction_bits: bits.first().copied().unwrap_or(0),
            coefficients,
        })
    }

    pub(super) fn casts_mut(&mut self) -> impl Iterator<Item = &mut Cast> {
        let steps = self.steps.iter_mut().flat_map(|s| {
            let aligned = s.align.iter_mut().chain(&mut s.align_low);
            aligned.chain([&mut s.cast])
        });
        self.powers.iter_mut().chain(steps)
    }

    /// The polynomial's word for the variable's.
    #[inline(always)]
    pub(super) fn evaluate<A: Arithmetic>(&self, ar: &A, variable: A::Word) -> A::Word {
        let mut powers = [variable; POWERS.len() + 1];
        for (level, cast) in self.powers.iter().enumerate() {
            let v = powers[level];
            powers[level + 1] = ar.cast(ar.mul(v, v), cast, &[v, v]);
        }
        let mut words = [variable; HIGHEST_DEGREE + 1];
        for step in &self.steps {
            let high = match step.high {
                Operand::Constant(raw, bits) => ar.constant(raw, bits),
                Operand::Word(k) => words[k],
            };
            let power = powers[step.level];
            let product = ar.mul(high, power);
            let product = match &step.align {
                Some(cast) => ar.cast(product, cast, &[high, power]),
                None => product,
            };
            let (low, is_zero) = match step.low {
                Operand::Constant(raw, bits) => (ar.constant(raw, bits), raw == 0),
                Operand::Word(k) => (words[k], false),
            };
            let low = match &step.align_low {
                Some(cast) => ar.cast(low, cast, &[low]),
                None => low,
            };
            let sum = if is_zero {
                product
            } else {
                ar.add(product, low)
            };
            words[step.to] = ar.cast(sum, &step.cast, &[product, low]);
        }
        match (self.steps.as_slice(), self.coefficients.first()) {
            ([], Some((raw, bits))) => ar.constant(*raw, *bits),
            _ => words[0],
        }
    }

    /// What the casts add for variables up to `v` that are off by up to `v_error`: each cast's half LSB times what
    /// follows it.
    pub(super) fn error_bound(&self, v: f64, v_error: f64) -> f64 {
        let mut powers = vec![(v, v_error)];
        for cast in &self.powers {
            let (v, e) = powers.last().copied().unwrap_or((v, v_error));
            powers.push((v * v, (2.0 * v + e) * e + half(cast)));
        }
        // Size and error of each word.
        let exact = |(raw, bits): &Coefficient| (raw.unsigned_abs() as f64 * pow2(-bits), 0.0);
        let mut words: Vec<(f64, f64)> = self.coefficients.iter().map(exact).collect();
        for step in &self.steps {
            let (v, v_error) = powers[step.level];
            let (size, error) = words[step.to + (1 << step.level)];
            let (low, low_error) = words[step.to];
            let error = error * (v + v_error) + size * v_error + low_error + half(&step.cast);
            words[step.to] = (size * v + low, error);
        }
        words.first().map_or(0.0, |(_, error)| *error)
    }
}

/// What a cast may round.
pub(super) fn half(cast: &Cast) -> f64 {
    match cast.shift > 0 {
        true => pow2(-cast.target.fraction_bits - 1),
        false => 0.0,
    }
}

fn aligned(raw: i128, shift: u32) -> Result<i128> {
    let room = if raw < 0 {
        raw.leading_ones()
    } else {
        raw.leading_zeros()
    };
    if raw != 0 && shift + 2 > room {
        return Err(InputError::new(format!(
            "coefficient {raw} aligned by {shift} bits needs more than 126 bits"
        ))
        .help("give input or intermediate fewer fraction bits")
        .into());
    }
    Ok(if raw == 0 { 0 } else { raw << shift })
}
