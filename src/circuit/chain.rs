//! The wiring of the blocks: what happens at every sample, and what after every R samples.

use super::CHANNELS;
use super::amplitude_loop::{AmplitudeLoop, AmplitudeLoopState};
use super::compensation::{Bias, Rate, port_in_dps};
use super::cordic::Vectoring;
use super::decimator::{Cic, CicState, Decimate, Integrate};
use super::demodulator::Mixer;
use super::in_range::InRange;
use super::nco::{Oscillator, OscillatorState};
use super::phase_loop::{PhaseLoop, PhaseLoopState};
use super::row_blocks::RowBlocks;
pub use super::row_blocks::{Held, Row, SlowState, compensated};
use crate::design::{Circuit, Compensation, CompensationInput, Design};
use crate::numeric::arithmetic::{Arithmetic, Block, Port};
use crate::numeric::cast::Cast;
use crate::numeric::format::Overflow;
use crate::numeric::trace::Trace;
use crate::numeric::trace::ir::{Interval, Program};

/// A chain with N-stage decimators.
#[derive(Debug, Clone)]
pub struct Chain<const N: usize> {
    /// Fraction bits of an ADC code.
    pub code_fraction_bits: i32,
    /// Every ADC code.
    pub code_range: Interval,
    /// The oscillator.
    pub nco: Oscillator,
    /// Demodulators by channel.
    pub mixers: [Mixer; 4],
    /// Decimators by channel.
    pub cics: [Cic<N>; 4],
    /// Vectoring on the drive channels.
    pub cordic: Vectoring,
    /// The compensation, where its thermometer is the chain's own.
    pub compensation: Option<(Bias, Rate)>,
    /// Whether the thermometer is inside the calibrated range, where the design asks for it.
    pub in_range: Option<InRange>,
    /// That thermometer is the tuning word (else the phase).
    by_tuning_word: bool,
    /// The phase loop.
    pub phase_loop: Option<PhaseLoop>,
    /// The amplitude loop.
    pub amplitude_loop: Option<AmplitudeLoop>,
    /// Formats of the columns, for documentation.
    meanings: Vec<Port>,
}

/// What changes at every sample.
#[derive(Debug, Clone, Copy)]
pub struct FastState<R, const N: usize> {
    /// The oscillator's.
    pub oscillator: OscillatorState<R>,
    /// The decimators', by channel.
    pub cics: [CicState<R, N>; 4],
}

/// What a period leaves at the sample rate: the last integrators by channel, all that the combs take.
pub type Front = [i128; 4];

/// Names of the decimators in the state, by channel.
const CIC_MEMBERS: [&str; 4] = ["cic_drive_i", "cic_drive_q", "cic_sense_i", "cic_sense_q"];

impl<const N: usize> Chain<N> {
    /// From a design whose decimator has N stages; the casts that ranges prove idle are marked.
    pub fn new(design: &Design) -> Self {
        let mut chain = Chain::bare(&design.circuit, design.compensation.as_ref());
        for (id, cast) in chain.casts_mut().into_iter().enumerate() {
            cast.id = id;
        }
        let program = chain.trace();
        for cast in chain.casts_mut() {
            if program.is_proved_in_range(cast.id) {
                cast.prove_in_range();
            }
        }
        chain.cordic.prove(&program);
        chain
    }

    fn bare(circuit: &Circuit, compensation: Option<&Compensation>) -> Self {
        let format = circuit.adc.format;
        let code_range = Interval::new(format.min_raw(), format.max_raw());
        let nco = Oscillator::new(&circuit.nco);
        let peak = nco.table.entries.iter().copied().max().unwrap_or(0);
        let carrier = Interval::new(-i128::from(peak), i128::from(peak));
        let mixers = CHANNELS.map(|channel| Mixer::new(circuit, channel));
        let cics = std::array::from_fn(|k| {
            Cic::new(
                circuit,
                CHANNELS[k],
                mixers[k].product_range(code_range, carrier),
            )
        });
        let of_chain = compensation.filter(|c| c.input.is_of_chain());
        let angle_bits = circuit.cordic.angle_bits;
        let output = circuit.decimator.output.format;
        Chain {
            code_fraction_bits: format.fraction_bits as i32,
            code_range,
            nco,
            mixers,
            cics,
            cordic: Vectoring::new(circuit),
            by_tuning_word: of_chain
                .is_some_and(|c| matches!(c.input, CompensationInput::TuningWord(_))),
            compensation: of_chain.map(|c| (Bias::new(circuit, c), Rate::new(circuit, c))),
            in_range: of_chain.and_then(|c| InRange::new(circuit, c)),
            phase_loop: circuit
                .phase_loop
                .as_ref()
                .map(|l| PhaseLoop::new(l, angle_bits)),
            amplitude_loop: circuit
                .amplitude_loop
                .as_ref()
                .map(|l| AmplitudeLoop::new(l, output.fraction_bits)),
            meanings: meanings(circuit, of_chain),
        }
    }

    /// Every cast of the chain, in a fixed order.
    fn casts_mut(&mut self) -> Vec<&mut Cast> {
        let mut casts: Vec<&mut Cast> = Vec::new();
        casts.extend(self.mixers.iter_mut().map(|m| &mut m.product));
        casts.extend(self.cics.iter_mut().map(|c| &mut c.output));
        casts.extend([&mut self.cordic.widen, &mut self.cordic.magnitude]);
        if let Some((bias, rate)) = &mut self.compensation {
            casts.extend(bias.casts_mut());
            casts.extend(rate.casts_mut());
        }
        if let Some(l) = &mut self.phase_loop {
            casts.extend([
                &mut l.accumulate,
                &mut l.proportional_shift,
                &mut l.integral_shift,
            ]);
        }
        if let Some(l) = &mut self.amplitude_loop {
            casts.extend([&mut l.error_shift, &mut l.integrator_shift]);
        }
        casts
    }

    /// The chain as a program: functions `sample` and `period`, and one for each block.
    pub fn trace(&self) -> Program {
        let trace = Trace::new();
        // Words of the pattern state are never looked at.
        let state = ChainState {
            fast: FastState {
                oscillator: OscillatorState {
                    phase: 0,
                    tuning: 0,
                },
                cics: [CicState {
                    integrators: [0; N],
                    delays: [[0; 2]; N],
                }; 4],
            },
            slow: SlowState {
                phase_loop: self
                    .phase_loop
                    .as_ref()
                    .map(|_| PhaseLoopState { integral: 0 }),
                amplitude_loop: self
                    .amplitude_loop
                    .as_ref()
                    .map(|_| AmplitudeLoopState { integrator: 0 }),
            },
        };
        trace.record(&Sample(self), &state, [self.code_range; 2]);
        trace.record(&Period(self), &state, []);
        trace.finish()
    }

    /// The state before the first sample.
    pub fn start_fast<A: Arithmetic>(&self, ar: &A) -> FastState<A::Residue, N> {
        FastState {
            oscillator: self.nco.start(ar),
            cics: std::array::from_fn(|k| self.cics[k].start(ar)),
        }
    }

    /// The loops' state before the first sample.
    pub fn start_slow<A: Arithmetic>(&self, ar: &A) -> SlowState<A::Word> {
        SlowState {
            phase_loop: self.phase_loop.as_ref().map(|l| l.start(ar)),
            amplitude_loop: self.amplitude_loop.as_ref().map(|l| l.start(ar)),
        }
    }

    /// Puts the loops where they hold a tuning word correction (steps) and a drive gain (0 to 1)
    /// with no error; gives the gain that is then put out.
    pub fn hold<A: Arithmetic>(
        &self,
        ar: &A,
        fast: &mut FastState<A::Residue, N>,
        slow: &mut SlowState<A::Word>,
        held: Held,
    ) -> Option<A::Word> {
        let blocks = self.row_blocks();
        blocks.hold(ar, &mut fast.oscillator, slow, held)
    }

    /// One ADC sample: drive and sense code.
    #[inline(always)]
    pub fn sample<A: Arithmetic>(
        &self,
        ar: &A,
        state: &mut FastState<A::Residue, N>,
        [drive, sense]: [A::Word; 2],
    ) {
        let [sine, cosine] = ar.call(&self.nco, "nco", &mut state.oscillator, []);
        let inputs = [
            [drive, sine],
            [drive, cosine],
            [sense, sine],
            [sense, cosine],
        ];
        // All four products first: the order in which an overflow is the earliest.
        let mut products = [sine; 4];
        for k in 0..4 {
            [products[k]] = ar.call(&self.mixers[k], "", &mut (), inputs[k]);
        }
        for k in 0..4 {
            let block = Integrate(&self.cics[k]);
            let [] = ar.call(&block, CIC_MEMBERS[k], &mut state.cics[k], [products[k]]);
        }
    }

    /// The channels at the end of a decimation period.
    #[inline(always)]
    pub fn decimated<A: Arithmetic>(
        &self,
        ar: &A,
        fast: &mut FastState<A::Residue, N>,
    ) -> [A::Word; 4] {
        let mut channels = [ar.constant(0, 0); 4];
        for k in 0..4 {
            let block = Decimate(&self.cics[k]);
            [channels[k]] = ar.call(&block, CIC_MEMBERS[k], &mut fast.cics[k], []);
        }
        channels
    }

    /// True if no row needs the one before it but by the decimators, and no cast can stop the run.
    pub fn is_row_by_row_free(&mut self) -> bool {
        let closed = self.phase_loop.is_some() || self.amplitude_loop.is_some();
        let stops =
            |cast: &mut &mut Cast| cast.overflow == Some(Overflow::Error) && !cast.is_proved();
        !closed && !self.by_tuning_word && !self.casts_mut().iter_mut().any(stops)
    }

    /// The end of a decimation period.
    #[inline(always)]
    pub fn period<A: Arithmetic>(
        &self,
        ar: &A,
        fast: &mut FastState<A::Residue, N>,
        slow: &mut SlowState<A::Word>,
    ) -> Row<A::Word> {
        let channels = self.decimated(ar, fast);
        let blocks = self.row_blocks();
        blocks.row(ar, channels, &mut fast.oscillator, slow)
    }

    fn row_blocks(&self) -> RowBlocks<'_> {
        RowBlocks {
            nco: &self.nco,
            cordic: &self.cordic,
            compensation: self.compensation.as_ref(),
            in_range: self.in_range.as_ref(),
            by_tuning_word: self.by_tuning_word,
            phase_loop: self.phase_loop.as_ref(),
            amplitude_loop: self.amplitude_loop.as_ref(),
        }
    }
}

/// The columns of a decimated sample that are words, in the contract's order (bias is not one of the
/// contract's); an empty name = the design has no such stage.
fn meanings(circuit: &Circuit, compensation: Option<&Compensation>) -> Vec<Port> {
    let output = circuit.decimator.output;
    let mut ports: Vec<Port> = CHANNELS
        .iter()
        .map(|name| Port::new(name, format!("decimated, {output}")))
        .collect();
    let angle = circuit.cordic.angle_bits;
    ports.push(Port::new(
        "phase",
        format!("drive phase in units of 2^-{angle} turn"),
    ));
    let lsb = output.format.fraction_bits;
    ports.push(Port::new(
        "magnitude",
        format!("drive magnitude in units of 2^-{lsb}"),
    ));
    let absent = Port::absent();
    match compensation {
        Some(c) => {
            let port = |name, what| port_in_dps(name, what, 0, c.output.format, &c.output);
            ports.push(port("bias", "bias"));
            ports.push(port("rate", "compensated rate"));
        }
        None => ports.extend([absent.clone(), absent.clone()]),
    }
    ports.push(match &circuit.amplitude_loop {
        Some(l) => Port::new(
            "gain",
            format!("drive gain in units of 2^-{}", l.gain_bits - 1),
        ),
        None => absent.clone(),
    });
    ports.push(match compensation.and_then(Compensation::flagged_range) {
        Some((low, high)) => Port::new(
            "in_range",
            format!("1 if the thermometer is within {low} .. {high}, else 0"),
        ),
        None => absent,
    });
    ports
}

/// A chain's whole state, as emitted code holds it.
#[derive(Debug, Clone, Copy)]
pub struct ChainState<R, W, const N: usize> {
    fast: FastState<R, N>,
    slow: SlowState<W>,
}

/// [`Chain::sample`] as a block, for tracing.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a, const N: usize>(pub &'a Chain<N>);

/// [`Chain::period`] as a block, for tracing.
#[derive(Debug, Clone, Copy)]
pub struct Period<'a, const N: usize>(pub &'a Chain<N>);

impl<A: Arithmetic, const N: usize> Block<A, 2, 0> for Sample<'_, N> {
    type State = ChainState<A::Residue, A::Word, N>;
    const NAME: &'static str = "sample";
    const PURPOSE: &'static str = "One ADC sample of both channels: oscillator, mixers and the integrators of the decimators.";
    const STATE: &'static str = "chain";

    fn inputs(&self) -> [Port; 2] {
        [
            Port::new("drive", "ADC code"),
            Port::new("sense", "ADC code"),
        ]
    }

    fn outputs(&self) -> [Port; 0] {
        []
    }

    fn step(&self, ar: &A, state: &mut Self::State, inputs: [A::Word; 2]) -> [A::Word; 0] {
        self.0.sample(ar, &mut state.fast, inputs);
        []
    }
}

impl<A: Arithmetic, const N: usize> Block<A, 0, 10> for Period<'_, N> {
    type State = ChainState<A::Residue, A::Word, N>;
    const NAME: &'static str = "period";
    const PURPOSE: &'static str = "A row of the chain at the end of a decimation period: combs, CORDIC, loops and compensation.";
    const STATE: &'static str = "chain";

    fn inputs(&self) -> [Port; 0] {
        []
    }

    fn outputs(&self) -> [Port; 10] {
        std::array::from_fn(|k| self.0.meanings[k].clone())
    }

    fn step(&self, ar: &A, state: &mut Self::State, []: [A::Word; 0]) -> [A::Word; 10] {
        let row = self.0.period(ar, &mut state.fast, &mut state.slow);
        let [a, b, c, d] = row.channels;
        let absent = row.phase;
        let [bias, rate] = row.compensation.unwrap_or([absent; 2]);
        let gain = row.gain.unwrap_or(absent);
        let in_range = row.in_range.unwrap_or(absent);
        let (phase, magnitude) = (row.phase, row.magnitude);
        [a, b, c, d, phase, magnitude, bias, rate, gain, in_range]
    }
}
