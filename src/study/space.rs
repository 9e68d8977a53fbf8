//! The designs of a study: variables (a word, or words tied together), each with a range.

use super::retune;
use crate::design::Design;
use crate::design::word::Word;
use crate::error::{InputError, Result};

/// The length of every variable, in the space's order. Of tied words: of the first.
pub type Lengths = Vec<u32>;

/// A word that varies, or words that do so together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Variable {
    /// The words; the first names the variable.
    pub words: Vec<Word>,
    /// The given design's length of the first.
    pub given: u32,
    /// The least length of the first.
    pub low: u32,
    /// Its largest.
    pub high: u32,
}

impl Variable {
    /// The first word's key.
    pub fn key(&self) -> &'static str {
        self.words.first().map_or("", |w| w.key())
    }
}

/// All variables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Space {
    /// In the order of the circuit.
    pub variables: Vec<Variable>,
}

/// Without `[study.ranges]`: so much shorter, and so much longer.
const SHORTER: u32 = 10;
pub(super) const LONGER: u32 = 3;

/// A word is not made shorter than this by default, and never longer than the design's limits.
fn least_sensible(word: Word) -> u32 {
    match word {
        Word::Adc | Word::DriveGain => 8,
        Word::Address | Word::Table => 4,
        Word::Phase => 12,
        Word::Product | Word::Decimated => 8,
        Word::Iterations => 6,
        Word::Guard => 0,
        Word::Angle | Word::Gain => 8,
        Word::Proportional | Word::Integral => 0,
        Word::Integrator => 16,
        Word::Coefficients | Word::Accumulator | Word::Output => 12,
    }
}

impl Space {
    /// As the design's `[study]` says.
    ///
    /// # Errors
    /// A word that the design does not have, a range without the given length in `words`.
    pub fn new(design: &Design) -> Result<Space> {
        let options = &design.study;
        let has = |w: &Word| w.length(design).is_some();
        let asked = options
            .words
            .iter()
            .flatten()
            .chain(options.tied.iter().flatten());
        if let Some(word) = asked.chain(options.ranges.keys()).find(|w| !has(w)) {
            return Err(InputError::new(format!(
                "`[study]` names `{}`, and this design has no such word",
                word.key()
            ))
            .help(
                "delete it there; `gyrogen study` without `[study]` takes every word that there is",
            )
            .into());
        }
        let words: Vec<Word> = match &options.words {
            Some(words) => words.clone(),
            None => Word::ALL.into_iter().filter(has).collect(),
        };
        let mut variables = Vec::new();
        for word in &words {
            let group = options.tied.iter().find(|g| g.contains(word));
            let words = match group {
                Some(group) if group.first() != Some(word) => continue,
                Some(group) => group.clone(),
                None => vec![*word],
            };
            let given = word.length(design).unwrap_or(0);
            let (least, most) = word.limits();
            let default = (
                given
                    .saturating_sub(SHORTER)
                    .max(least_sensible(*word))
                    .min(given),
                (given + LONGER).min(most),
            );
            let (low, high) = options.ranges.get(word).copied().unwrap_or(default);
            variables.push(Variable {
                words,
                given,
                low: low.max(least),
                high: high.min(most),
            });
        }
        if variables.is_empty() {
            let e = InputError::new("`[study]` leaves no word to vary");
            return Err(e
                .help("name the first word of each group in `words`")
                .into());
        }
        Ok(Space { variables })
    }

    /// The lengths of the design as given; a length outside its range is kept.
    pub fn given(&self) -> Lengths {
        self.variables.iter().map(|v| v.given).collect()
    }

    /// The design with these lengths.
    ///
    /// # Errors
    /// Why there is none.
    pub fn design(&self, given: &Design, lengths: &[u32]) -> std::result::Result<Design, String> {
        let mut all = Vec::new();
        for (variable, length) in self.variables.iter().zip(lengths) {
            let by = *length as i64 - i64::from(variable.given);
            for word in &variable.words {
                let own = i64::from(word.length(given).unwrap_or(0)) + by;
                let own = u32::try_from(own);
                all.push((
                    *word,
                    own.map_err(|_| format!("`{}` would be negative", word.key()))?,
                ));
            }
        }
        retune::with_lengths(given, &all)
    }

    /// How many combinations of lengths there are.
    pub fn size(&self) -> u128 {
        let sizes = self
            .variables
            .iter()
            .map(|v| u128::from(v.high - v.low + 1));
        sizes.fold(1, u128::saturating_mul)
    }

    /// The k-th combination, the last variable running fastest; `k` below [`size`](Self::size).
    pub fn nth(&self, k: u128) -> Lengths {
        let mut rest = k;
        let mut lengths = vec![0; self.variables.len()];
        for (length, v) in lengths.iter_mut().zip(&self.variables).rev() {
            let count = u128::from(v.high - v.low + 1);
            *length = v.low + (rest % count) as u32;
            rest /= count;
        }
        lengths
    }

    /// True if every length is in its range.
    pub fn contains(&self, lengths: &[u32]) -> bool {
        let mut pairs = self.variables.iter().zip(lengths);
        pairs.all(|(v, l)| (v.low..=v.high).contains(l))
    }

    /// `lengths` with one of them `by` longer, if that is in its range.
    pub fn moved(&self, lengths: &[u32], variable: usize, by: i32) -> Option<Lengths> {
        let v = self.variables.get(variable)?;
        let length = lengths.get(variable)?.checked_add_signed(by)?;
        (v.low..=v.high).contains(&length).then(|| {
            let mut out = lengths.to_vec();
            out[variable] = length;
            out
        })
    }
}
