//! One channel's demodulator: code times carrier, quantised (contract, step 2).

use crate::design::Circuit;
use crate::numeric::arithmetic::{Arithmetic, Block, Port};
use crate::numeric::cast::{Cast, Label, round_shift};
use crate::numeric::trace::ir::Interval;

/// The demodulator's configuration.
#[derive(Debug, Clone)]
pub struct Mixer {
    /// To `circuit.demodulator.product`.
    pub product: Cast,
    meanings: [String; 3],
}

impl Mixer {
    /// The demodulator of one of [`super::CHANNELS`].
    pub fn new(circuit: &Circuit, channel: &'static str) -> Self {
        let product = &circuit.demodulator.product;
        let exact = circuit.adc.format.fraction_bits + circuit.nco.table.fraction_bits;
        Mixer {
            product: Cast::to(
                Label::on("circuit.demodulator.product", channel),
                exact as i32,
                0,
                *product,
            ),
            meanings: [
                format!("ADC code, {}", circuit.adc.format),
                format!("NCO output, {}", circuit.nco.table),
                format!("code * carrier, {product}"),
            ],
        }
    }

    /// Every value that the product can have, raw, given the codes' and the carrier's ranges.
    pub fn product_range(&self, code: Interval, carrier: Interval) -> Interval {
        let corners = [
            code.low * carrier.low,
            code.low * carrier.high,
            code.high * carrier.low,
            code.high * carrier.high,
        ];
        let rounded = corners
            .map(|v| Interval::point(round_shift(v, self.product.shift, self.product.rounding)))
            .into_iter()
            .reduce(Interval::join)
            .unwrap_or(Interval::point(0));
        let (low, high) = self.product.limits();
        if rounded.is_within(low, high) {
            rounded
        } else {
            Interval::new(low, high)
        }
    }
}

impl<A: Arithmetic> Block<A, 2, 1> for Mixer {
    type State = ();
    const NAME: &'static str = "demodulate";
    const PURPOSE: &'static str = "Product of an ADC code and a carrier.";

    fn inputs(&self) -> [Port; 2] {
        [
            Port::new("code", self.meanings[0].clone()),
            Port::new("carrier", self.meanings[1].clone()),
        ]
    }

    fn outputs(&self) -> [Port; 1] {
        [Port::new("product", self.meanings[2].clone())]
    }

    #[inline(always)]
    fn step(&self, ar: &A, _state: &mut (), [code, carrier]: [A::Word; 2]) -> [A::Word; 1] {
        let exact = ar.named(ar.mul(code, carrier), "exact");
        [ar.cast(exact, &self.product, &[code, carrier])]
    }
}
