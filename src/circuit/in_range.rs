//! The calibrated range's flag: 1 where the thermometer was calibrated, 0 beyond (`outside = "flag"`).

use super::compensation::Bias;
use crate::design::{Circuit, Compensation};
use crate::numeric::arithmetic::{Arithmetic, Block, Port};

/// Tells whether a thermometer word is inside the calibrated range, its ends included.
#[derive(Debug, Clone)]
pub struct InRange {
    /// Limits of the words that can come in, raw.
    pub input_range: crate::numeric::trace::ir::Interval,
    /// Fraction bits of the word as it comes.
    fraction_bits: i32,
    /// First and last calibrated word, raw.
    ends: [i128; 2],
    input_meaning: String,
}

impl InRange {
    /// From the design's `[compensation]`; `None` unless it says `flag` and has a calibrated range.
    pub fn new(circuit: &Circuit, compensation: &Compensation) -> Option<Self> {
        let (low, high) = compensation.flagged_range()?;
        let bias = Bias::new(circuit, compensation);
        Some(InRange {
            input_range: bias.input_range,
            fraction_bits: bias.input_fraction_bits(),
            ends: [low, high],
            input_meaning: bias.input_meaning().to_owned(),
        })
    }
}

impl<A: Arithmetic> Block<A, 1, 1> for InRange {
    type State = ();
    const NAME: &'static str = "in_range";
    const PURPOSE: &'static str = "Whether a word of the thermometer is in the calibrated range.";

    fn inputs(&self) -> [Port; 1] {
        [Port::new("thermometer", self.input_meaning.clone())]
    }

    fn outputs(&self) -> [Port; 1] {
        let [low, high] = self.ends;
        let meaning = format!("1 for calibrated inputs, {low} .. {high}; 0 outside");
        [Port::new("in_range", meaning)]
    }

    #[inline(always)]
    fn step(&self, ar: &A, _state: &mut (), [input]: [A::Word; 1]) -> [A::Word; 1] {
        let [low, high] = self.ends.map(|end| ar.constant(end, self.fraction_bits));
        let [no, yes] = [ar.constant(0, 0), ar.constant(1, 0)];
        let above = ar.is_negative(ar.sub(high, input));
        let below = ar.is_negative(ar.sub(input, low));
        [ar.select(below, no, ar.select(above, no, yes))]
    }
}
