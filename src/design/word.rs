//! The words of a circuit that a study may shorten or lengthen, each by the key that states it.

use super::schema::Design;

/// A word, or a size that acts like one: more of it is finer and costs more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Word {
    /// The ADC's code.
    Adc,
    /// The oscillator's accumulator.
    Phase,
    /// The sine table's address.
    Address,
    /// A sine table's entry.
    Table,
    /// Code times carrier.
    Product,
    /// The decimated sample.
    Decimated,
    /// Micro-rotations of the CORDIC.
    Iterations,
    /// Bits below the decimated sample's LSB inside the CORDIC.
    Guard,
    /// The CORDIC's phase.
    Angle,
    /// The constant that takes the CORDIC's gain out.
    Gain,
    /// The phase loop's proportional factor.
    Proportional,
    /// The phase loop's integral factor.
    Integral,
    /// The phase loop's integrator.
    Integrator,
    /// The drive gain.
    DriveGain,
    /// The polynomial's coefficients.
    Coefficients,
    /// The polynomial's accumulator.
    Accumulator,
    /// Bias and rate.
    Output,
}

impl Word {
    /// All, in the order of the circuit.
    pub const ALL: [Word; 17] = [
        Word::Adc,
        Word::Phase,
        Word::Address,
        Word::Table,
        Word::Product,
        Word::Decimated,
        Word::Iterations,
        Word::Guard,
        Word::Angle,
        Word::Gain,
        Word::Proportional,
        Word::Integral,
        Word::Integrator,
        Word::DriveGain,
        Word::Coefficients,
        Word::Accumulator,
        Word::Output,
    ];

    /// The dotted key of the design.
    pub fn key(self) -> &'static str {
        match self {
            Word::Adc => "circuit.adc.format",
            Word::Phase => "circuit.nco.phase_bits",
            Word::Address => "circuit.nco.table_address_bits",
            Word::Table => "circuit.nco.table",
            Word::Product => "circuit.demodulator.product",
            Word::Decimated => "circuit.decimator.output",
            Word::Iterations => "circuit.cordic.iterations",
            Word::Guard => "circuit.cordic.guard_bits",
            Word::Angle => "circuit.cordic.angle_bits",
            Word::Gain => "circuit.cordic.gain_bits",
            Word::Proportional => "circuit.phase_loop.proportional",
            Word::Integral => "circuit.phase_loop.integral",
            Word::Integrator => "circuit.phase_loop.integrator_bits",
            Word::DriveGain => "circuit.amplitude_loop.gain_bits",
            Word::Coefficients => "compensation.coefficient_format",
            Word::Accumulator => "compensation.accumulator",
            Word::Output => "compensation.output",
        }
    }

    /// The word of a key.
    pub fn of_key(key: &str) -> Option<Word> {
        Word::ALL.into_iter().find(|w| w.key() == key)
    }

    /// What its number counts.
    pub fn counts(self) -> &'static str {
        match self {
            Word::Iterations => "micro-rotations",
            Word::Proportional | Word::Integral => "fraction bits",
            _ => "bits",
        }
    }

    /// The least and the largest number that a design may have.
    pub fn limits(self) -> (u32, u32) {
        match self {
            Word::Adc => (2, 32),
            Word::Phase => (8, 64),
            Word::Address => (2, 16),
            Word::Table => (2, 40),
            Word::Iterations => (4, 30),
            Word::Guard => (0, 32),
            Word::Angle => (4, 64),
            Word::Gain => (1, 62),
            Word::Proportional | Word::Integral => (0, 63),
            Word::Integrator => (2, 64),
            Word::DriveGain => (2, 32),
            Word::Product
            | Word::Decimated
            | Word::Coefficients
            | Word::Accumulator
            | Word::Output => (1, 64),
        }
    }

    /// Its number in a design; `None` if the design has no such word, or cannot vary it: a form that stands for
    /// the polynomial was made for one phase word and one output word.
    pub fn length(self, design: &Design) -> Option<u32> {
        let circuit = &design.circuit;
        let phase_loop = circuit.phase_loop.as_ref();
        let compensation = design.compensation.as_ref();
        let compensation = compensation.filter(|c| c.input.is_of_chain());
        let polynomial = compensation.filter(|c| c.form.is_none());
        match self {
            Word::Adc => Some(circuit.adc.format.bits()),
            Word::Phase => Some(circuit.nco.phase_bits),
            Word::Address => Some(circuit.nco.table_address_bits),
            Word::Table => Some(circuit.nco.table.bits()),
            Word::Product => Some(circuit.demodulator.product.format.bits()),
            Word::Decimated => Some(circuit.decimator.output.format.bits()),
            Word::Iterations => Some(circuit.cordic.iterations),
            Word::Guard => Some(circuit.cordic.guard_bits),
            Word::Angle => {
                let fixed = compensation.is_some_and(|c| c.form.is_some());
                (!fixed).then_some(circuit.cordic.angle_bits)
            }
            Word::Gain => circuit
                .amplitude_loop
                .as_ref()
                .map(|_| circuit.cordic.gain_bits),
            Word::Proportional => phase_loop.map(|l| l.proportional.shift),
            Word::Integral => phase_loop.map(|l| l.integral.shift),
            Word::Integrator => phase_loop.map(|l| l.integrator_bits),
            Word::DriveGain => circuit.amplitude_loop.as_ref().map(|l| l.gain_bits),
            Word::Coefficients => polynomial.map(|c| c.coefficient_format.bits()),
            Word::Accumulator => polynomial.map(|c| c.accumulator.format.bits()),
            Word::Output => polynomial.map(|c| c.output.format.bits()),
        }
    }

    /// The number as the design file spells the word: a format where it is one.
    pub fn spelled(self, design: &Design) -> String {
        let circuit = &design.circuit;
        let compensation = design.compensation.as_ref();
        let format = match self {
            Word::Adc => Some(circuit.adc.format),
            Word::Table => Some(circuit.nco.table),
            Word::Product => Some(circuit.demodulator.product.format),
            Word::Decimated => Some(circuit.decimator.output.format),
            Word::Coefficients => compensation.map(|c| c.coefficient_format),
            Word::Accumulator => compensation.map(|c| c.accumulator.format),
            Word::Output => compensation.map(|c| c.output.format),
            _ => None,
        };
        match (format, self.length(design)) {
            (Some(format), _) => format.to_string(),
            (None, Some(length)) => length.to_string(),
            (None, None) => "-".to_owned(),
        }
    }
}
