//! The compensation as a block of its own: bias, subtraction, and both together.

use super::compensation::{Bias, Rate};
use super::in_range::InRange;
use crate::design::Design;
use crate::numeric::arithmetic::{Arithmetic, Block, Port};

/// Bias, subtraction, and both together.
#[derive(Debug, Clone)]
pub struct Compensate {
    /// The polynomial.
    pub bias: Bias,
    /// The subtraction.
    pub rate: Rate,
}

impl<A: Arithmetic> Block<A, 2, 2> for Compensate {
    type State = ();
    const NAME: &'static str = "compensate";
    const PURPOSE: &'static str =
        "The compensation of one reading: its bias and its compensated rate.";

    fn inputs(&self) -> [Port; 2] {
        let [thermometer] = Block::<A, 1, 1>::inputs(&self.bias);
        let [raw_rate, _] = Block::<A, 2, 1>::inputs(&self.rate);
        [thermometer, raw_rate]
    }

    fn outputs(&self) -> [Port; 2] {
        let [bias] = Block::<A, 1, 1>::outputs(&self.bias);
        let [rate] = Block::<A, 2, 1>::outputs(&self.rate);
        [bias, rate]
    }

    fn step(&self, ar: &A, _: &mut (), [thermometer, raw_rate]: [A::Word; 2]) -> [A::Word; 2] {
        let [bias] = ar.call(&self.bias, "", &mut (), [thermometer]);
        let [rate] = ar.call(&self.rate, "", &mut (), [raw_rate, bias]);
        [bias, rate]
    }
}

/// The compensation's blocks with their casts numbered as in a program of their own.
pub fn compensation_alone(design: &Design) -> Option<(Bias, Rate)> {
    let compensation = design.compensation.as_ref()?;
    let mut bias = Bias::new(&design.circuit, compensation);
    let mut rate = Rate::new(&design.circuit, compensation);
    let casts = bias.casts_mut().into_iter().chain(rate.casts_mut());
    for (id, cast) in casts.enumerate() {
        cast.id = id;
    }
    Some((bias, rate))
}

/// The flag of the calibrated range, where the design asks for it.
pub fn in_range(design: &Design) -> Option<InRange> {
    let compensation = design.compensation.as_ref()?;
    InRange::new(&design.circuit, compensation)
}
