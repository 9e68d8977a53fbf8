//! The bias compensation: a polynomial in the virtual thermometer by Horner's rule, subtracted from
//! the rate (contract, step 6; seed paper, eq. 9).
//!
//! The polynomial is evaluated as it is ([`Horner`]) or by a form that stands for it ([`Evaluation::Form`]).
//!
//! Two blocks: [`Bias`] depends on the thermometer alone, so that its emitted code can be compared
//! with the model over every input code; [`Rate`] subtracts it.

use crate::approx::form::Form;
use crate::design::record_columns::unit_behind;
use crate::design::{Circuit, Compensation, CompensationInput, Outside};
use crate::numeric::arithmetic::{Arithmetic, Block, Port};
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::Format;
use crate::numeric::trace::ir::Interval;
use std::fmt::Display;

const ACCUMULATOR: Label = Label::of("compensation.accumulator");
const OUTPUT: Label = Label::of("compensation.output");

/// The bias's configuration.
#[derive(Debug, Clone)]
pub struct Bias {
    /// Every raw input code.
    pub input_range: Interval,
    /// Fraction bits of the input word as it comes.
    input_fraction_bits: i32,
    /// The input is limited to this, raw.
    clamp: Option<(i128, i128)>,
    /// Subtracted from the limited input, raw.
    offset: i128,
    /// The input is read in another unit: its value times 2^this.
    read_exponent: i32,
    /// From the variable to the bias.
    pub evaluation: Evaluation,
    ports: [Port; 2],
}

/// How the bias follows from the variable.
#[derive(Debug, Clone)]
pub enum Evaluation {
    /// The design's polynomial.
    Horner(Box<Horner>),
    /// What `form = "auto"` chose: see [`crate::approx::form`].
    Form(Box<Form>),
}

/// Horner's rule in the design's formats.
#[derive(Debug, Clone)]
pub struct Horner {
    coefficients: Vec<i128>,
    coefficient_fraction_bits: i32,
    accumulator_fraction_bits: i32,
    /// c_n * p.
    pub first: Cast,
    /// t * p after that.
    pub inner: Cast,
    /// c_k + t * p.
    pub outer: Cast,
    /// The polynomial's value to the output format.
    pub output: Cast,
    /// Beyond the calibrated range: the tangent.
    tangent: Option<Tangent>,
}

/// The polynomial's slopes at both ends of the calibrated range, with which it goes on beyond them.
#[derive(Debug, Clone)]
struct Tangent {
    /// Raw, at the lower and the upper end.
    slopes: [i128; 2],
    /// slope * (p - limited p).
    rise: Cast,
    /// t + rise.
    sum: Cast,
}

impl Bias {
    /// From the design's `[compensation]`.
    pub fn new(circuit: &Circuit, compensation: &Compensation) -> Self {
        let angle_bits = circuit.cordic.angle_bits;
        let port = |meaning: String| Port::new("thermometer", meaning);
        // (raw range, fraction bits as they come, offset, exponent of the reading, in words)
        let (input_range, input_fraction_bits, offset, read_exponent, thermometer) =
            match &compensation.input {
                CompensationInput::Phase => (
                    Interval::of_bits(angle_bits),
                    angle_bits as i32,
                    0,
                    1,
                    port(format!("phase in units of 2^-{angle_bits} turn")).in_unit(
                        "phase",
                        -(angle_bits as i32),
                        "turn",
                    ),
                ),
                CompensationInput::TuningWord(tuning) => {
                    let bits = circuit.nco.phase_bits;
                    (
                        Interval::of_bits(bits),
                        bits as i32,
                        tuning.offset_raw,
                        bits as i32 - tuning.scale_bits as i32,
                        port("what the phase loop adds to the tuning word".to_owned()),
                    )
                }
                CompensationInput::Channel(channel) => {
                    let fraction_bits = channel.format.fraction_bits as i32;
                    (
                        Interval::new(channel.format.min_raw(), channel.format.max_raw()),
                        fraction_bits,
                        channel.offset_raw,
                        fraction_bits - channel.scale_bits as i32,
                        port(format!(
                            "{} = raw * 2^-{fraction_bits}, {}",
                            channel.column, channel.format
                        ))
                        .in_unit(
                            &channel.column,
                            -fraction_bits,
                            unit_behind(&channel.column),
                        ),
                    )
                }
            };
        let evaluation = match form(circuit, compensation) {
            Some(form) => Evaluation::Form(Box::new(form)),
            None => {
                let p = input_fraction_bits - read_exponent;
                Evaluation::Horner(Box::new(Horner::new(circuit, compensation, p)))
            }
        };
        Bias {
            input_range,
            input_fraction_bits,
            clamp: compensation.clamp_raw,
            offset,
            read_exponent,
            evaluation,
            ports: [
                thermometer,
                port_in_dps(
                    "bias",
                    "bias",
                    0,
                    compensation.output.format,
                    &compensation.output,
                ),
            ],
        }
    }
}

/// The stored form, if the design has one; a design with one that cannot be built has been refused.
fn form(circuit: &Circuit, compensation: &Compensation) -> Option<Form> {
    let stored = compensation.form.as_ref()?;
    let codes = compensation.codes(circuit);
    let built = stored.build(codes, compensation.output.format);
    built.ok()
}

impl Horner {
    /// `p` are the variable's fraction bits.
    fn new(circuit: &Circuit, compensation: &Compensation, p: i32) -> Self {
        let coefficient = compensation.coefficient_format.fraction_bits as i32;
        let accumulator = compensation.accumulator.format.fraction_bits as i32;
        let last = if compensation.coefficients_raw.len() > 1 {
            accumulator
        } else {
            coefficient
        };
        let has_slope = compensation.coefficients_raw.len() > 1;
        let holds = compensation.outside == Outside::HoldSlope && has_slope;
        let tangent = compensation.clamp_raw.filter(|_| holds);
        let tangent = tangent.map(|(low, high)| Tangent {
            slopes: [low, high].map(|end| compensation.slope_raw(circuit, end)),
            rise: Cast::to(ACCUMULATOR, coefficient + p, 0, compensation.accumulator),
            sum: Cast::to(ACCUMULATOR, accumulator, 0, compensation.accumulator),
        });
        Horner {
            tangent,
            coefficients: compensation.coefficients_raw.clone(),
            coefficient_fraction_bits: coefficient,
            accumulator_fraction_bits: accumulator,
            first: Cast::to(ACCUMULATOR, coefficient + p, 0, compensation.accumulator)
                .with_coefficient(accumulator - coefficient),
            inner: Cast::to(ACCUMULATOR, accumulator + p, 0, compensation.accumulator),
            outer: Cast::to(ACCUMULATOR, accumulator, 0, compensation.accumulator)
                .with_coefficient(accumulator - coefficient),
            output: Cast::to(OUTPUT, last, 0, compensation.output),
        }
    }

    fn casts_mut(&mut self) -> Vec<&mut Cast> {
        let mut casts = vec![
            &mut self.first,
            &mut self.inner,
            &mut self.outer,
            &mut self.output,
        ];
        if let Some(tangent) = &mut self.tangent {
            casts.extend([&mut tangent.rise, &mut tangent.sum]);
        }
        casts
    }

    /// The bias at the variable p; `beyond` is how far the word is outside the calibrated range.
    #[inline(always)]
    fn evaluate<A: Arithmetic>(
        &self,
        ar: &A,
        p: A::Word,
        beyond: impl FnOnce() -> A::Word,
    ) -> A::Word {
        let (fine, coarse) = (
            self.accumulator_fraction_bits,
            self.coefficient_fraction_bits,
        );
        let mut orders = self.coefficients.iter().enumerate().rev();
        let mut t = match orders.next() {
            Some((_, highest)) => ar.constant(*highest, coarse),
            None => ar.constant(0, coarse),
        };
        let highest = self.coefficients.len().saturating_sub(1);
        let aligned = self
            .coefficients
            .last()
            .map_or(0, |c| c << (fine - coarse).max(0));
        let mut reported = ar.constant(aligned, fine);
        for (order, coefficient) in orders {
            let cast = if order + 1 == highest {
                &self.first
            } else {
                &self.inner
            };
            // An overflow is reported with all words in the accumulator's LSB.
            let inner = ar.cast(ar.mul(t, p), cast, &[reported, p]);
            // Exact: the accumulator has at least the coefficients' fraction bits.
            let c = ar.constant(coefficient << (fine - coarse), fine);
            let partial_sum = ar.named(ar.add(c, inner), "partial_sum");
            t = ar.cast(partial_sum, &self.outer, &[c, inner]);
            reported = t;
        }
        if let Some(tangent) = &self.tangent {
            let beyond = beyond();
            let [below, above] = tangent.slopes.map(|s| ar.constant(s, coarse));
            let slope = ar.select(ar.is_negative(beyond), below, above);
            let rise = ar.cast(ar.mul(slope, beyond), &tangent.rise, &[slope, beyond]);
            t = ar.cast(ar.add(t, rise), &tangent.sum, &[t, rise]);
        }
        ar.cast(t, &self.output, &[t])
    }
}

impl Bias {
    /// Fraction bits of the thermometer's word as it comes.
    pub fn input_fraction_bits(&self) -> i32 {
        self.input_fraction_bits
    }

    /// What the thermometer's word is, for emitted code.
    pub fn input_meaning(&self) -> &str {
        let [input, _] = &self.ports;
        &input.meaning
    }

    /// Every cast, in a fixed order.
    pub fn casts_mut(&mut self) -> Vec<&mut Cast> {
        match &mut self.evaluation {
            Evaluation::Horner(horner) => horner.casts_mut(),
            Evaluation::Form(form) => form.casts_mut(),
        }
    }

    /// The cast to the bias's format.
    pub fn output_cast(&self) -> &Cast {
        match &self.evaluation {
            Evaluation::Horner(horner) => &horner.output,
            Evaluation::Form(form) => form.output_cast(),
        }
    }
}

impl<A: Arithmetic> Block<A, 1, 1> for Bias {
    type State = ();
    const NAME: &'static str = "bias";
    const PURPOSE: &'static str = "Bias at a quantised temperature (or phase or frequency), from the polynomial or the table that replaces it.";

    fn inputs(&self) -> [Port; 1] {
        [self.ports[0].clone()]
    }

    fn outputs(&self) -> [Port; 1] {
        [self.ports[1].clone()]
    }

    #[inline(always)]
    fn step(&self, ar: &A, _state: &mut (), [input]: [A::Word; 1]) -> [A::Word; 1] {
        let limited = match self.clamp {
            Some((low, high)) => ar.limit(input, low, high, self.input_fraction_bits),
            None => input,
        };
        let from_centre = match self.offset {
            0 => limited,
            offset => {
                let centre = ar.constant(offset, self.input_fraction_bits);
                ar.named(ar.sub(limited, centre), "from_centre")
            }
        };
        let p = ar.read_as(from_centre, self.read_exponent);

        [match &self.evaluation {
            Evaluation::Horner(horner) => horner.evaluate(ar, p, || {
                ar.read_as(ar.sub(input, limited), self.read_exponent)
            }),
            Evaluation::Form(form) => by_form(ar, form, p),
        }]
    }
}

/// Apart, so that chains without a form do not carry its code in their loops.
#[inline(never)]
fn by_form<A: Arithmetic>(ar: &A, form: &Form, p: A::Word) -> A::Word {
    let [bias] = Block::<A, 1, 1>::step(form, ar, &mut (), [p]);
    bias
}

/// A port whose words are `what` in deg/s: full scale is 2^`exponent` deg/s.
pub(super) fn port_in_dps(
    name: &'static str,
    what: &str,
    exponent: i32,
    format: Format,
    shown: &dyn Display,
) -> Port {
    let exponent = exponent - format.fraction_bits as i32;
    let meaning = format!("{what} = raw * 2^{exponent} deg/s, {shown}");
    Port::new(name, meaning).in_unit(what, exponent, "deg/s")
}

/// The subtraction's configuration.
#[derive(Debug, Clone)]
pub struct Rate {
    /// Every raw rate input, where it does not come from the chain.
    pub input_range: Interval,
    /// The rate input in deg/s, rounded to the output's fraction bits, no overflow step.
    pub scale: Cast,
    /// q - bias to the output format.
    pub output: Cast,
    ports: [Port; 3],
}

impl Rate {
    /// From the design's `[compensation]`.
    pub fn new(circuit: &Circuit, compensation: &Compensation) -> Self {
        let (format, what) = match &compensation.input {
            CompensationInput::Phase | CompensationInput::TuningWord(_) => {
                (circuit.decimator.output.format, "sense I")
            }
            CompensationInput::Channel(channel) => (channel.rate_format, "uncompensated rate"),
        };
        let output = compensation.output;
        let fraction_bits = output.format.fraction_bits as i32;
        Rate {
            input_range: Interval::new(format.min_raw(), format.max_raw()),
            scale: Cast::new(
                OUTPUT,
                format.fraction_bits as i32,
                compensation.rate_full_scale_exponent(),
                Target::signed(127, fraction_bits),
                output.rounding,
                None,
            ),
            output: Cast::to(OUTPUT, fraction_bits, 0, output),
            ports: [
                port_in_dps(
                    "raw_rate",
                    what,
                    compensation.rate_full_scale_exponent(),
                    format,
                    &format,
                ),
                port_in_dps("bias", "bias", 0, output.format, &output),
                port_in_dps("rate", "compensated rate", 0, output.format, &output),
            ],
        }
    }
}

impl Rate {
    /// Every cast, in a fixed order.
    pub fn casts_mut(&mut self) -> Vec<&mut Cast> {
        vec![&mut self.scale, &mut self.output]
    }
}

impl<A: Arithmetic> Block<A, 2, 1> for Rate {
    type State = ();
    const NAME: &'static str = "rate";
    const PURPOSE: &'static str = "The compensated rate: the raw rate less the bias.";

    fn inputs(&self) -> [Port; 2] {
        [self.ports[0].clone(), self.ports[1].clone()]
    }

    fn outputs(&self) -> [Port; 1] {
        [self.ports[2].clone()]
    }

    #[inline(always)]
    fn step(&self, ar: &A, _state: &mut (), [raw_rate, bias]: [A::Word; 2]) -> [A::Word; 1] {
        let q = ar.named(ar.cast(raw_rate, &self.scale, &[raw_rate]), "uncompensated");
        let difference = ar.named(ar.sub(q, bias), "difference");
        [ar.cast(difference, &self.output, &[q, bias])]
    }
}
