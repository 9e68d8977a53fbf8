//! CORDIC in vectoring mode (Volder 1959): phase and magnitude of the drive vector (contract,
//! step 5).

use crate::design::Circuit;
use crate::numeric::arithmetic::{Arithmetic, Block, IndexTable, LoopBody, Port};
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::constants;
use crate::numeric::format::{Overflow, Rounding};
use crate::numeric::trace::Trace;
use crate::numeric::trace::ir::Program;

/// The CORDIC's configuration.
#[derive(Debug, Clone)]
pub struct Vectoring {
    iterations: u32,
    width: u32,
    /// Ranges have proved that the rotations' x and y never leave the width.
    stays_inside: bool,
    angle_bits: u32,
    /// Fraction bits of x and y.
    fraction_bits: i32,
    /// I and Q with guard bits below, wrapped to the width.
    pub widen: Cast,
    angles: IndexTable,
    gain: i64,
    gain_bits: u32,
    /// x times the gain, back to the decimator's LSB.
    pub magnitude: Cast,
    meanings: [String; 3],
}

impl Vectoring {
    /// From the design's `[circuit.cordic]`.
    pub fn new(circuit: &Circuit) -> Self {
        let cordic = &circuit.cordic;
        let output = circuit.decimator.output.format;
        let from = output.fraction_bits as i32;
        let fraction_bits = from + cordic.guard_bits as i32;
        Vectoring {
            iterations: cordic.iterations,
            width: cordic.width,
            stays_inside: false,
            angle_bits: cordic.angle_bits,
            fraction_bits,
            widen: Cast::new(
                Label::of("circuit.cordic.guard_bits"),
                from,
                0,
                Target::signed(cordic.width, fraction_bits),
                Rounding::Floor,
                Some(Overflow::Wrap),
            ),
            angles: IndexTable {
                name: "cordic_angle",
                entries: constants::arc_tangents(cordic.iterations, cordic.angle_bits).into(),
                fraction_bits: cordic.angle_bits,
            },
            gain: constants::cordic_gain(cordic.iterations, cordic.gain_bits),
            gain_bits: cordic.gain_bits,
            magnitude: Cast::new(
                Label::of("circuit.cordic.gain_bits"),
                fraction_bits + cordic.gain_bits as i32,
                0,
                Target::signed(64, from),
                Rounding::HalfUp,
                Some(Overflow::Wrap),
            ),
            meanings: [
                format!("decimated, {output}"),
                format!("phase in units of 2^-{} turn", cordic.angle_bits),
                format!("magnitude in units of 2^-{from}"),
            ],
        }
    }
}

impl Vectoring {
    /// Takes from the program that this block is traced in whether x and y may leave their width.
    pub fn prove(&mut self, program: &Program) {
        let idle = program.idle_wraps(<Self as Block<Trace, 2, 2>>::NAME);
        self.stays_inside = matches!(idle[..], [true, true, ..]);
    }
}

impl<A: Arithmetic> Block<A, 2, 2> for Vectoring {
    type State = ();
    const NAME: &'static str = "cordic";
    const PURPOSE: &'static str =
        "Phase and magnitude of a vector by its in-phase and quadrature words.";

    fn inputs(&self) -> [Port; 2] {
        [
            Port::new("in_phase", self.meanings[0].clone()),
            Port::new("quadrature", self.meanings[0].clone()),
        ]
    }

    fn outputs(&self) -> [Port; 2] {
        [
            Port::new("phase", self.meanings[1].clone()),
            Port::new("magnitude", self.meanings[2].clone()),
        ]
    }

    #[inline(always)]
    fn step(&self, ar: &A, _state: &mut (), [i, q]: [A::Word; 2]) -> [A::Word; 2] {
        if let Some(polar) = ar.ideal_polar(i, q) {
            return polar;
        }
        let x = ar.named(ar.cast(i, &self.widen, &[i]), "wide_i");
        let y = ar.named(ar.cast(q, &self.widen, &[q]), "wide_q");
        let radius = ar.radius(x, y);

        // Into the right half plane by a quarter turn.
        let (left, below) = (ar.is_negative(x), ar.is_negative(y));
        let minus_x = ar.named(
            ar.wrap(ar.neg(x), self.width, self.fraction_bits),
            "minus_i",
        );
        let minus_y = ar.named(
            ar.wrap(ar.neg(y), self.width, self.fraction_bits),
            "minus_q",
        );
        let angle = self.angle_bits as i32;
        let quarter = 1i128 << (self.angle_bits - 2);
        let z_left = ar.select(
            below,
            ar.constant(-quarter, angle),
            ar.constant(quarter, angle),
        );
        let z_left = ar.named(z_left, "quarter_turn");
        let x_left = ar.named(ar.select(below, minus_y, y), "turned_i");
        let y_left = ar.named(ar.select(below, x, minus_x), "turned_q");
        // Left of it stands |y|: not below zero, unless -y wraps.
        let start_x = ar.named(ar.select(left, x_left, x), "start_x");
        let start = [
            ar.not_negative(start_x, radius, self.width),
            ar.named(ar.select(left, y_left, y), "start_y"),
            ar.named(ar.select(left, z_left, ar.constant(0, angle)), "start_z"),
        ];

        let [x, _, phase] = ar.repeat(self.iterations, start, radius, self);
        let phase = ar.settled(phase, self.angle_bits);
        let gain = ar.constant(i128::from(self.gain), self.gain_bits as i32);
        let magnitude = ar.cast(ar.mul(x, gain), &self.magnitude, &[x]);
        [phase, magnitude]
    }
}

/// One micro-rotation, toward y = 0.
impl<A: Arithmetic> LoopBody<A, 3> for Vectoring {
    #[inline(always)]
    fn step(
        &self,
        ar: &A,
        index: A::Index,
        [x, y, z]: [A::Word; 3],
        radius: &mut A::Radius,
    ) -> [A::Word; 3] {
        let (x, y, z) = (ar.named(x, "x"), ar.named(y, "y"), ar.named(z, "z"));
        let below = ar.is_negative(y);
        let dx = ar.named(ar.shift_right_by(y, index), "step_x");
        let dy = ar.named(ar.shift_right_by(x, index), "step_y");
        let dz = ar.named(ar.entry(&self.angles, index), "step_z");
        let next_x = ar.select(below, ar.sub(x, dx), ar.add(x, dx));
        let next_y = ar.select(below, ar.add(y, dy), ar.sub(y, dy));
        let next_z = ar.select(below, ar.sub(z, dz), ar.add(z, dz));
        let next_y = ar.named(next_y, "next_y");
        let next_z = ar.named(next_z, "next_z");
        let longer = ar.rotated(*radius, index);
        // Toward y = 0 means that x grows by |y|, floored: from x >= 0 it stays there, unless it wraps.
        let next_x = ar.not_negative(ar.bounded(next_x, longer), longer, self.width);
        let next_x = ar.named(next_x, "next_x");
        let next_y = ar.bounded(next_y, longer);
        let (inside, point) = (self.stays_inside, self.fraction_bits);
        let next = [
            ar.wrap_unless(inside, next_x, self.width, point),
            ar.wrap_unless(inside, next_y, self.width, point),
            // Nothing but the next sum looks at the angle.
            ar.wrap_in_sum(next_z, self.angle_bits, self.angle_bits as i32),
        ];
        *radius = ar.wrapped_radius(longer, self.width);
        next
    }
}
