//! One channel's CIC decimator (Hogenauer 1981): N integrators at the sample rate, N combs with
//! delay M after every R samples, the gain divided out by a power of two (contract, steps 3 and 4).

use crate::design::Circuit;
use crate::numeric::arithmetic::{Arithmetic, Block, Port, Ring, StateVisitor};
use crate::numeric::cast::{Cast, Label};
use crate::numeric::format::pow2;
use crate::numeric::trace::ir::Interval;

/// The largest differential delay.
const MAX_DELAY: usize = 2;

/// The decimator's configuration; N is the number of stages.
#[derive(Debug, Clone)]
pub struct Cic<const N: usize> {
    /// The accumulators: product bits + G, so that the result is exact.
    pub ring: Ring,
    /// R.
    pub ratio: u32,
    /// M.
    pub delay: usize,
    /// Every value that S can have.
    pub sum_range: Interval,
    /// To `circuit.decimator.output`, with the factor 2^-G.
    pub output: Cast,
    meanings: [String; 2],
}

/// Integrators, and what the combs remember.
#[derive(Debug, Clone, Copy)]
pub struct CicState<R, const N: usize> {
    /// In order.
    pub integrators: [R; N],
    /// The last M inputs of each comb, newest first; only the first M are used.
    pub delays: [[R; MAX_DELAY]; N],
}

impl<const N: usize> Cic<N> {
    /// The decimator of a channel whose products are within `product`, raw.
    pub fn new(circuit: &Circuit, channel: &'static str, product: Interval) -> Self {
        let decimator = &circuit.decimator;
        let format = circuit.demodulator.product.format;
        let gain_bits = decimator.gain_bits();
        let gain = i128::from(decimator.ratio * decimator.differential_delay).pow(N as u32);
        // Without quantisation the products keep their exact size, whatever the format holds.
        let exact_peak = pow2(circuit.adc.format.integer_bits as i32 - 1)
            * pow2(circuit.nco.table.integer_bits as i32 - 1)
            * gain as f64;
        Cic {
            ring: Ring {
                bits: format.signed_bits() + gain_bits,
                fraction_bits: format.fraction_bits as i32,
                reach: exact_peak.log2().ceil() as i32 + 1,
            },
            ratio: decimator.ratio,
            delay: decimator.differential_delay as usize,
            // Every tap of the equivalent FIR is positive and they add up to (R M)^N.
            sum_range: Interval::new(
                product.low.min(0).saturating_mul(gain),
                product.high.max(0).saturating_mul(gain),
            ),
            output: Cast::to(
                Label::on("circuit.decimator.output", channel),
                format.fraction_bits as i32,
                -(gain_bits as i32),
                decimator.output,
            ),
            meanings: [
                format!("demodulated, {format}"),
                format!("decimated, {}", decimator.output),
            ],
        }
    }

    /// All zero.
    pub fn start<A: Arithmetic>(&self, ar: &A) -> CicState<A::Residue, N> {
        let zero = ar.residue_constant(0, &self.ring);
        CicState {
            integrators: [zero; N],
            delays: [[zero; MAX_DELAY]; N],
        }
    }

    fn visit_state<A: Arithmetic>(
        &self,
        state: &mut CicState<A::Residue, N>,
        visitor: &mut dyn StateVisitor<A>,
    ) {
        const NAMES: [&str; 6] = [
            "delay_1", "delay_2", "delay_3", "delay_4", "delay_5", "delay_6",
        ];
        visitor.residues("integrator", &mut state.integrators, &self.ring);
        for (name, delays) in NAMES.iter().zip(&mut state.delays) {
            visitor.residues(name, &mut delays[..self.delay], &self.ring);
        }
    }
}

/// The sample-rate half of a decimator.
#[derive(Debug, Clone, Copy)]
pub struct Integrate<'a, const N: usize>(pub &'a Cic<N>);

/// The slow half of a decimator.
#[derive(Debug, Clone, Copy)]
pub struct Decimate<'a, const N: usize>(pub &'a Cic<N>);

impl<A: Arithmetic, const N: usize> Block<A, 1, 0> for Integrate<'_, N> {
    type State = CicState<A::Residue, N>;
    const NAME: &'static str = "integrate";
    const PURPOSE: &'static str =
        "Takes a product into the decimator's integrators, once a sample.";
    const STATE: &'static str = "cic";

    fn inputs(&self) -> [Port; 1] {
        [Port::new("product", self.0.meanings[0].clone())]
    }

    fn outputs(&self) -> [Port; 0] {
        []
    }

    #[inline(always)]
    fn step(
        &self,
        ar: &A,
        state: &mut CicState<A::Residue, N>,
        [product]: [A::Word; 1],
    ) -> [A::Word; 0] {
        let mut carried = ar.residue(product, &self.0.ring);
        for integrator in &mut state.integrators {
            *integrator = ar.residue_add(*integrator, carried, &self.0.ring);
            carried = *integrator;
        }
        []
    }

    fn visit(&self, state: &mut CicState<A::Residue, N>, visitor: &mut dyn StateVisitor<A>) {
        self.0.visit_state(state, visitor);
    }
}

impl<A: Arithmetic, const N: usize> Block<A, 0, 1> for Decimate<'_, N> {
    type State = CicState<A::Residue, N>;
    const NAME: &'static str = "decimate";
    const PURPOSE: &'static str =
        "The decimated word by the decimator's combs, once a decimation period.";
    const STATE: &'static str = "cic";

    fn inputs(&self) -> [Port; 0] {
        []
    }

    fn outputs(&self) -> [Port; 1] {
        [Port::new("decimated", self.0.meanings[1].clone())]
    }

    #[inline(always)]
    fn step(&self, ar: &A, state: &mut CicState<A::Residue, N>, []: [A::Word; 0]) -> [A::Word; 1] {
        let cic = self.0;
        let mut carried = state.integrators[N - 1];
        for delays in &mut state.delays {
            let input = carried;
            carried = ar.residue_sub(input, delays[cic.delay - 1], &cic.ring);
            delays[1] = delays[0];
            delays[0] = input;
        }
        let sum = ar.centered(carried, &cic.ring);
        let sum = ar.named(
            ar.within(sum, cic.sum_range.low, cic.sum_range.high),
            "comb_sum",
        );
        [ar.cast(sum, &cic.output, &[sum])]
    }

    fn visit(&self, state: &mut CicState<A::Residue, N>, visitor: &mut dyn StateVisitor<A>) {
        self.0.visit_state(state, visitor);
    }
}
