//! The amplitude loop (AGC): PI on the drive magnitude, giving the drive gain (contract, step 7).

use crate::design;
use crate::numeric::arithmetic::{Arithmetic, Block, Port, StateVisitor};
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::{Rounding, pow2};

/// The amplitude loop's configuration.
#[derive(Debug, Clone)]
pub struct AmplitudeLoop {
    setpoint: i128,
    initial: i128,
    magnitude_fraction_bits: i32,
    gain_limit: i128,
    integrator_limit: i128,
    gain_bits: u32,
    /// ea >> error_shift.
    pub error_shift: Cast,
    /// integrator >> integrator_shift.
    pub integrator_shift: Cast,
}

/// The integral of the amplitude error.
#[derive(Debug, Clone, Copy)]
pub struct AmplitudeLoopState<W> {
    /// Limited so that the gain alone cannot leave its range.
    pub integrator: W,
}

impl AmplitudeLoop {
    /// From the design's `[circuit.amplitude_loop]`; the magnitude has the decimator's LSB.
    pub fn new(design: &design::AmplitudeLoop, magnitude_fraction_bits: u32) -> Self {
        let shift = |key, count: u32| {
            let exact = Target::signed(127, 0);
            Cast::new(
                Label::of(key),
                0,
                -(count as i32),
                exact,
                Rounding::Floor,
                None,
            )
        };
        AmplitudeLoop {
            setpoint: i128::from(design.setpoint_raw),
            initial: i128::from(design.initial_raw),
            magnitude_fraction_bits: magnitude_fraction_bits as i32,
            gain_limit: design.gain_limit(),
            integrator_limit: design.integrator_limit(),
            gain_bits: design.gain_bits,
            error_shift: shift("circuit.amplitude_loop.error_shift", design.error_shift),
            integrator_shift: shift(
                "circuit.amplitude_loop.integrator_shift",
                design.integrator_shift,
            ),
        }
    }

    /// The integrator as the design gives it.
    pub fn start<A: Arithmetic>(&self, ar: &A) -> AmplitudeLoopState<A::Word> {
        AmplitudeLoopState {
            integrator: ar.constant(self.initial, 0),
        }
    }
}

impl AmplitudeLoop {
    /// The state that holds the drive gain `gain` (0 to 1) at no amplitude error, limited to what the
    /// integrator holds.
    pub fn holding<A: Arithmetic>(&self, ar: &A, gain: f64) -> AmplitudeLoopState<A::Word> {
        let counts = gain * pow2(self.gain_bits as i32 - 1 - self.integrator_shift.gain);
        let integrator = (counts.round() as i128).clamp(0, self.integrator_limit);
        AmplitudeLoopState {
            integrator: ar.constant(integrator, 0),
        }
    }

    /// The magnitude that the loop holds, as a word.
    pub fn setpoint<A: Arithmetic>(&self, ar: &A) -> A::Word {
        ar.constant(self.setpoint, self.magnitude_fraction_bits)
    }
}

impl<A: Arithmetic> Block<A, 1, 1> for AmplitudeLoop {
    type State = AmplitudeLoopState<A::Word>;
    const NAME: &'static str = "amplitude_loop";
    const PURPOSE: &'static str =
        "The drive gain that holds the drive's amplitude at its setpoint.";
    const STATE: &'static str = "amplitude_loop";

    fn inputs(&self) -> [Port; 1] {
        let lsb = self.magnitude_fraction_bits;
        [Port::new("magnitude", format!("units of 2^-{lsb}"))]
    }

    fn outputs(&self) -> [Port; 1] {
        let shift = self.gain_bits - 1;
        [Port::new(
            "gain",
            format!("drive gain in units of 2^-{shift}"),
        )]
    }

    #[inline(always)]
    fn step(
        &self,
        ar: &A,
        state: &mut AmplitudeLoopState<A::Word>,
        [magnitude]: [A::Word; 1],
    ) -> [A::Word; 1] {
        let counts = ar.read_as(magnitude, self.magnitude_fraction_bits);
        let error = ar.named(ar.sub(ar.constant(self.setpoint, 0), counts), "error");
        let sum = ar.named(ar.add(state.integrator, error), "integrated");
        state.integrator = ar.limit(sum, 0, self.integrator_limit, 0);
        let proportional = ar.named(ar.cast(error, &self.error_shift, &[]), "proportional");
        let integral = ar.cast(state.integrator, &self.integrator_shift, &[]);
        let gain = ar.add(proportional, ar.named(integral, "integral"));
        let gain = ar.named(gain, "unlimited_gain");
        [ar.limit(gain, 0, self.gain_limit, 0)]
    }

    fn visit(&self, state: &mut AmplitudeLoopState<A::Word>, visitor: &mut dyn StateVisitor<A>) {
        visitor.word(
            "integrator",
            &mut state.integrator,
            0,
            self.integrator_limit,
        );
    }
}
