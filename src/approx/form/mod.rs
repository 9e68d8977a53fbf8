//! A function in fixed point: one input word, one output word.
//!
//! Every form is a [`Block`], written once over [`Arithmetic`]: exhaustive checks run it in integers, emission
//! prints its trace. A form also says which exact piecewise polynomial its data stand for ([`Piece`]): what
//! is left between the two is rounding.

pub mod coefficient_formats;
pub mod generate;
pub mod measure;
pub mod monomials;
pub mod overflow;
pub mod piecewise;
pub mod plan;
pub mod polynomial;
pub mod split;
pub mod stored;
pub mod table;
mod words;

use crate::error::{InputError, Result};
use crate::numeric::arithmetic::{Arithmetic, Block, Port};
use crate::numeric::cast::{Cast, HasKernel};
use crate::numeric::fixed::Fixed;
use crate::numeric::format::Format;
use crate::numeric::trace::Trace;
use crate::numeric::trace::ir::Program;
use piecewise::Piecewise;
use polynomial::Polynomial;
use split::Split;
use table::{Bipartite, Table};
pub(crate) use words::integer_bits_of;
pub use words::{Codes, Doubles, Number, Piece};

/// A function in fixed point.
#[derive(Debug, Clone)]
pub enum Form {
    /// One polynomial over the whole domain.
    Polynomial(Box<Polynomial>),
    /// A polynomial for each segment.
    Piecewise(Box<Piecewise>),
    /// A table, with or without interpolation.
    Table(Box<Table>),
    /// Two tables, whose entries are added.
    Bipartite(Box<Bipartite>),
}

macro_rules! each {
    ($form:expr, $inner:ident => $body:expr) => {
        match $form {
            Form::Polynomial($inner) => $body,
            Form::Piecewise($inner) => $body,
            Form::Table($inner) => $body,
            Form::Bipartite($inner) => $body,
        }
    };
}

impl Form {
    /// The name of the kind, as the command line spells it.
    pub fn name(&self) -> &'static str {
        match self {
            Form::Polynomial(_) => "polynomial",
            Form::Piecewise(_) => "piecewise",
            Form::Table(_) | Form::Bipartite(_) => "table",
        }
    }

    /// The segments, if it has any.
    pub fn split(&self) -> Option<&Split> {
        match self {
            Form::Polynomial(_) => None,
            Form::Piecewise(f) => Some(&f.split),
            Form::Table(f) => Some(&f.split),
            Form::Bipartite(f) => Some(&f.split),
        }
    }

    /// The cast to the output.
    pub(crate) fn output_cast(&self) -> &Cast {
        each!(self, f => f.output_cast())
    }

    /// The input's codes.
    pub fn codes(&self) -> Codes {
        each!(self, f => f.codes)
    }

    /// The output's format.
    pub fn output(&self) -> Format {
        each!(self, f => f.output)
    }

    /// What the data stand for, from the first code of the domain to the last.
    pub fn pieces(&self) -> Vec<Piece> {
        each!(self, f => f.pieces())
    }

    /// Every cast, in a fixed order; the output's is the last.
    pub(crate) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        each!(self, f => f.casts_mut())
    }

    /// Copies in which one rounding constant is off by one.
    pub fn with_nudged_casts(&self) -> Vec<Form> {
        let mut all = Vec::new();
        let count = self.clone().casts_mut().len();
        for k in 0..count {
            for step in [-1, 1] {
                let mut copy = self.clone();
                let mut casts = copy.casts_mut();
                let cast = casts.get_mut(k);
                if let Some((cast, moved)) = cast.and_then(|c| c.nudged(step).map(|m| (c, m))) {
                    **cast = moved;
                    all.push(copy);
                }
            }
        }
        all
    }

    /// Numbers the casts, records the program, and lets go of the casts' limits where ranges prove that they
    /// never act.
    ///
    /// # Errors
    /// An intermediate of more than 127 bits.
    pub fn settle(mut self) -> Result<Settled> {
        for (id, cast) in self.casts_mut().into_iter().enumerate() {
            cast.id = id;
        }
        let trace = Trace::new();
        trace.record(&self, &(), [self.codes().all()]);
        let program = trace.finish();
        let bits = program.functions.iter().map(|f| program.word_bits(f)).max();
        let bits = bits.unwrap_or(1);
        if bits > 127 {
            return Err(InputError::new(format!(
                "the evaluation needs an exact intermediate of {bits} bits; 127 is the most"
            ))
            .help("give input, coefficients or intermediate fewer fraction bits")
            .into());
        }
        let mut unproved = Vec::new();
        for (id, cast) in self.casts_mut().into_iter().enumerate() {
            if program.is_proved_in_range(id) {
                cast.prove_in_range();
            } else {
                unproved.push(id);
            }
        }
        Ok(Settled {
            form: self,
            program,
            bits,
            unproved,
        })
    }
}

impl<A: Arithmetic> Block<A, 1, 1> for Form {
    type State = ();
    const NAME: &'static str = "evaluate";
    const PURPOSE: &'static str = "The function at a word of its input.";

    fn inputs(&self) -> [Port; 1] {
        let codes = self.codes();
        let all = codes.all();
        let above = (codes.high < all.high)
            .then(|| format!("words above {0} give the result at {0}", codes.high));
        let below = (all.low < codes.low)
            .then(|| format!("words below {0} give the result at {0}", codes.low));
        let parts = [Some(codes.format.to_string()), below, above];
        let meaning: Vec<String> = parts.into_iter().flatten().collect();
        let port = Port::new("x", meaning.join("; ")).limited(codes.low, codes.high);
        [port.in_unit("x", -(codes.format.fraction_bits as i32), "")]
    }

    fn outputs(&self) -> [Port; 1] {
        let format = self.output();
        let port = Port::new("y", format.to_string());
        [port.in_unit("y", -(format.fraction_bits as i32), "")]
    }

    #[inline(always)]
    fn step(&self, ar: &A, _state: &mut (), [input]: [A::Word; 1]) -> [A::Word; 1] {
        [each!(self, f => f.evaluate(ar, input))]
    }
}

/// A form with its recorded program.
#[derive(Debug, Clone)]
pub struct Settled {
    /// The form, its casts numbered.
    pub form: Form,
    /// One function, `evaluate`.
    pub program: Program,
    /// The widest word of the evaluation.
    pub bits: u32,
    /// Numbers of the casts whose limits may act, as far as intervals can tell.
    pub unproved: Vec<usize>,
}

impl Settled {
    /// The output for an input word, raw.
    pub fn run(&self, input: i128) -> i128 {
        if self.bits <= 64 {
            i128::from(run_in::<i64>(&self.form, input as i64))
        } else {
            run_in::<i128>(&self.form, input)
        }
    }
}

/// The output for an input word in lanes `L`, which hold every word.
#[inline]
pub fn run_in<L: HasKernel>(form: &Form, input: L) -> L {
    let ar = Fixed::<L, L>::new();
    let [output] = Block::<_, 1, 1>::step(form, &ar, &mut (), [input]);
    output
}

#[cfg(test)]
mod tests;
