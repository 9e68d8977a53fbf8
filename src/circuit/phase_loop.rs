//! The phase loop: PI on the drive phase, moving the tuning word (contract, step 7).

use crate::design;
use crate::numeric::arithmetic::{Arithmetic, Block, Port, StateVisitor};
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::{Overflow, Rounding, pow2};

/// The phase loop's configuration.
#[derive(Debug, Clone)]
pub struct PhaseLoop {
    setpoint: i128,
    angle_bits: u32,
    proportional: i128,
    integral: i128,
    integrator_bits: u32,
    /// integral + e, wrapped.
    pub accumulate: Cast,
    /// (kp e) >> shift.
    pub proportional_shift: Cast,
    /// (ki integral) >> shift.
    pub integral_shift: Cast,
}

/// The integral of the phase error, in units of 2^-b turn.
#[derive(Debug, Clone, Copy)]
pub struct PhaseLoopState<W> {
    /// Wraps in `integrator_bits`.
    pub integral: W,
}

impl PhaseLoop {
    /// From the design's `[circuit.phase_loop]`; the error has `angle_bits` bits.
    pub fn new(design: &design::PhaseLoop, angle_bits: u32) -> Self {
        let shift = |key, gain: design::LoopGain| {
            let exact = Target::signed(127, 0);
            Cast::new(
                Label::of(key),
                0,
                -(gain.shift as i32),
                exact,
                Rounding::Floor,
                None,
            )
        };
        PhaseLoop {
            setpoint: i128::from(design.setpoint_raw),
            angle_bits,
            proportional: i128::from(design.proportional.raw),
            integral: i128::from(design.integral.raw),
            integrator_bits: design.integrator_bits,
            accumulate: Cast::new(
                Label::of("circuit.phase_loop.integrator_bits"),
                0,
                0,
                Target::signed(design.integrator_bits, 0),
                Rounding::Floor,
                Some(Overflow::Wrap),
            ),
            proportional_shift: shift("circuit.phase_loop.proportional", design.proportional),
            integral_shift: shift("circuit.phase_loop.integral", design.integral),
        }
    }

    /// Zero.
    pub fn start<A: Arithmetic>(&self, ar: &A) -> PhaseLoopState<A::Word> {
        PhaseLoopState {
            integral: ar.constant(0, 0),
        }
    }

    /// The state that holds a correction of `steps` tuning word steps at no phase error, limited to
    /// what the integrator holds: `steps * 2^shift / ki`, to the nearest integer.
    pub fn holding<A: Arithmetic>(&self, ar: &A, steps: f64) -> PhaseLoopState<A::Word> {
        let gain = self.integral as f64 * pow2(self.integral_shift.gain);
        let half = 1i128 << (self.integrator_bits - 1);
        let integral = if gain == 0.0 { 0.0 } else { steps / gain };
        PhaseLoopState {
            integral: ar.constant((integral.round() as i128).clamp(-half, half - 1), 0),
        }
    }

    /// The phase that the loop holds, as a word.
    pub fn setpoint<A: Arithmetic>(&self, ar: &A) -> A::Word {
        ar.constant(self.setpoint, self.angle_bits as i32)
    }
}

impl<A: Arithmetic> Block<A, 1, 1> for PhaseLoop {
    type State = PhaseLoopState<A::Word>;
    const NAME: &'static str = "phase_loop";
    const PURPOSE: &'static str =
        "The correction of the tuning word that holds the drive phase at its setpoint.";
    const STATE: &'static str = "phase_loop";

    fn inputs(&self) -> [Port; 1] {
        [Port::new(
            "phase",
            format!("units of 2^-{} turn", self.angle_bits),
        )]
    }

    fn outputs(&self) -> [Port; 1] {
        [Port::new("correction", "tuning word steps")]
    }

    #[inline(always)]
    fn step(
        &self,
        ar: &A,
        state: &mut PhaseLoopState<A::Word>,
        [phase]: [A::Word; 1],
    ) -> [A::Word; 1] {
        let angle = self.angle_bits as i32;
        let off = ar.named(ar.sub(phase, self.setpoint(ar)), "difference");
        let error = ar.named(ar.wrap(off, self.angle_bits, angle), "error");
        let error = ar.read_as(error, angle);
        state.integral = ar.cast(ar.add(state.integral, error), &self.accumulate, &[]);
        let p = ar.named(
            ar.mul(error, ar.constant(self.proportional, 0)),
            "proportional",
        );
        let i = ar.named(
            ar.mul(state.integral, ar.constant(self.integral, 0)),
            "weighted_integral",
        );
        [ar.add(
            ar.cast(p, &self.proportional_shift, &[]),
            ar.cast(i, &self.integral_shift, &[]),
        )]
    }

    fn visit(&self, state: &mut PhaseLoopState<A::Word>, visitor: &mut dyn StateVisitor<A>) {
        let half = 1i128 << (self.integrator_bits - 1);
        visitor.word("integral", &mut state.integral, -half, half - 1);
    }
}
