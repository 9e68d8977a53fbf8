//! The numerically controlled oscillator: a phase accumulator and a sine table (contract, step 1).

use crate::design::Nco;
use crate::numeric::arithmetic::{Arithmetic, Block, Port, Ring, SineTable, StateVisitor};
use crate::numeric::constants;
use crate::numeric::format::{Rounding, pow2};

/// The oscillator's configuration.
#[derive(Debug, Clone)]
pub struct Oscillator {
    /// One turn is the whole circle; words are in turns.
    pub ring: Ring,
    /// The sine.
    pub table: SineTable,
    /// FCW as given, modulo 2^w.
    pub tuning_word: i128,
    /// The table's format, for documentation.
    format: String,
}

/// Phase and tuning word.
#[derive(Debug, Clone, Copy)]
pub struct OscillatorState<R> {
    /// Accumulated phase.
    pub phase: R,
    /// Step per sample; the phase loop moves it.
    pub tuning: R,
}

impl Oscillator {
    /// From the design's `[circuit.nco]`.
    pub fn new(nco: &Nco) -> Self {
        let bits = nco.table.bits();
        let fraction_bits = nco.table.fraction_bits;
        let peak = ((1i64 << (bits - 1)) - 1) as f64;
        Oscillator {
            ring: Ring::cyclic(nco.phase_bits, nco.phase_bits as i32),
            table: SineTable {
                entries: constants::sine_table(nco.table_address_bits, bits).into(),
                address_bits: nco.table_address_bits,
                phase_bits: nco.phase_bits,
                half_step: nco.address_rounding == Rounding::HalfUp,
                fraction_bits,
                amplitude: peak * pow2(-(fraction_bits as i32)),
            },
            tuning_word: i128::from(nco.tuning_word) & ((1i128 << nco.phase_bits) - 1),
            format: nco.table.to_string(),
        }
    }

    /// Phase 0, the tuning word as given.
    pub fn start<A: Arithmetic>(&self, ar: &A) -> OscillatorState<A::Residue> {
        OscillatorState {
            phase: ar.residue_constant(0, &self.ring),
            tuning: ar.residue_constant(self.tuning_word, &self.ring),
        }
    }

    fn visit_state<A: Arithmetic>(
        &self,
        state: &mut OscillatorState<A::Residue>,
        visitor: &mut dyn StateVisitor<A>,
    ) {
        visitor.residues("phase", std::slice::from_mut(&mut state.phase), &self.ring);
        visitor.residues(
            "tuning_word",
            std::slice::from_mut(&mut state.tuning),
            &self.ring,
        );
    }
}

impl<A: Arithmetic> Block<A, 0, 2> for Oscillator {
    type State = OscillatorState<A::Residue>;
    const NAME: &'static str = "nco";
    const PURPOSE: &'static str =
        "One step of the oscillator: the phase moves on by the tuning word; sine and cosine of it.";
    const STATE: &'static str = "oscillator";

    fn inputs(&self) -> [Port; 0] {
        []
    }

    fn outputs(&self) -> [Port; 2] {
        let port = |name| Port::new(name, format!("{name} of the phase, {}", self.format));
        [port("sine"), port("cosine")]
    }

    #[inline(always)]
    fn step(
        &self,
        ar: &A,
        state: &mut OscillatorState<A::Residue>,
        []: [A::Word; 0],
    ) -> [A::Word; 2] {
        state.phase = ar.residue_add(state.phase, state.tuning, &self.ring);
        let quarter = ar.residue_constant(1i128 << (self.ring.bits - 2), &self.ring);
        let ahead = ar.residue_add(state.phase, quarter, &self.ring);
        [
            ar.sine(state.phase, &self.table),
            ar.sine(ahead, &self.table),
        ]
    }

    fn visit(&self, state: &mut OscillatorState<A::Residue>, visitor: &mut dyn StateVisitor<A>) {
        self.visit_state(state, visitor);
    }
}

/// What the tuning word is off the design's, in turns a sample: the resonance's drift where a phase
/// loop tracks it.
#[derive(Debug, Clone, Copy)]
pub struct Detuning<'a>(pub &'a Oscillator);

impl<A: Arithmetic> Block<A, 0, 1> for Detuning<'_> {
    type State = OscillatorState<A::Residue>;
    const NAME: &'static str = "detuning";
    const PURPOSE: &'static str = "How far the tuning word is from the design's.";
    const STATE: &'static str = "oscillator";

    fn inputs(&self) -> [Port; 0] {
        []
    }

    fn outputs(&self) -> [Port; 1] {
        [Port::new("correction", "tuning word steps")]
    }

    #[inline(always)]
    fn step(
        &self,
        ar: &A,
        state: &mut OscillatorState<A::Residue>,
        []: [A::Word; 0],
    ) -> [A::Word; 1] {
        let ring = &self.0.ring;
        let given = ar.residue_constant(self.0.tuning_word, ring);
        [ar.centered(ar.residue_sub(state.tuning, given, ring), ring)]
    }

    fn visit(&self, state: &mut OscillatorState<A::Residue>, visitor: &mut dyn StateVisitor<A>) {
        self.0.visit_state(state, visitor);
    }
}

/// Gives the oscillator a new tuning word: the design's plus a correction in FCW steps.
#[derive(Debug, Clone, Copy)]
pub struct Retune<'a>(pub &'a Oscillator);

impl<A: Arithmetic> Block<A, 1, 0> for Retune<'_> {
    type State = OscillatorState<A::Residue>;
    const NAME: &'static str = "retune";
    const PURPOSE: &'static str =
        "Gives the oscillator a new tuning word: the design's plus a correction.";
    const STATE: &'static str = "oscillator";

    fn inputs(&self) -> [Port; 1] {
        [Port::new("correction", "tuning word steps")]
    }

    fn outputs(&self) -> [Port; 0] {
        []
    }

    #[inline(always)]
    fn step(
        &self,
        ar: &A,
        state: &mut OscillatorState<A::Residue>,
        [correction]: [A::Word; 1],
    ) -> [A::Word; 0] {
        let ring = &self.0.ring;
        // Steps as turns, the unit of the ring.
        let turns = ar.read_as(correction, -(ring.bits as i32));
        let given = ar.residue_constant(self.0.tuning_word, ring);
        state.tuning = ar.residue_add(given, ar.residue(turns, ring), ring);
        []
    }

    fn visit(&self, state: &mut OscillatorState<A::Residue>, visitor: &mut dyn StateVisitor<A>) {
        self.0.visit_state(state, visitor);
    }
}
