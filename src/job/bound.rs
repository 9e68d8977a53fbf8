//! `compensation.bound_dps`: a fitted compensation is brought to keep to it, or the reason why it cannot is said.
//!
//! The bound covers what fixed point does to the fitted polynomial at every calibrated input word: coefficients (or
//! entries), evaluation, the rounding of the bias to the output, and that of the rate beside it. What the thermometer's word leaves
//! out, the noise of the calibration and the error of the fit are other lines of the budget.

use super::coefficients::nearest;
use super::{budget, compensation};
use crate::compensation::alternatives;
use crate::compensation::alternatives::Way;
use crate::compensation::certainty::{Bounds, Certainty, bounds};
use crate::compensation::{Evaluation, coefficients, one_rounding};
use crate::cost::function::FunctionCost;
use crate::design::bound::hindrance;
use crate::design::target::Target;
use crate::design::{BiasBound, Compensation, CompensationInput, Design, limits};
use crate::error::{InputError, Result};
use crate::numeric::format::Format;
use crate::tabulate::choice;
use crate::text::{at_most, number};
use crate::thermal::BaselineFit;
use serde::Serialize;

/// The widest format that is chosen or proposed.
const WIDEST_BITS: u32 = 64;

/// How the bound is kept.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Kept {
    /// What was asked, deg/s.
    pub bound_dps: f64,
    /// What is proved: the bias against the fitted polynomial, and the rounding of the rate.
    pub covered_dps: f64,
    /// The part of the rate's rounding.
    pub rate_rounding_dps: f64,
    /// `polynomial` or `auto`, as asked.
    pub form: &'static str,
    /// The processor of the costs.
    pub target: Target,
    /// What is done, in words.
    pub chosen: String,
    /// Every form that keeps to the bound, the polynomial first if it does.
    pub alternatives: Vec<Line>,
}

/// A form that keeps to the bound.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Line {
    /// `polynomial`, `table` or `piecewise`.
    pub form: &'static str,
    /// In words.
    pub detail: String,
    /// Of the whole bias function.
    #[serde(flatten)]
    pub cost: FunctionCost,
    /// The bias against the fitted polynomial: proved, deg/s.
    pub certified_max_dps: f64,
    /// The same in LSB of the output.
    pub certified_max_lsb: f64,
    /// No other one is at least as good in ROM, multiplications, additions and error.
    pub undominated: bool,
    /// This one is the firmware's.
    pub chosen: bool,
}

/// Brings the design's fitted compensation to keep to its bound: `None` if it has none. Says what was changed.
///
/// # Errors
/// A bound that the words of input or output are too coarse for, or that the formats of the design's own do not reach.
pub fn keep(design: &mut Design, fit: &BaselineFit) -> Result<Option<(Kept, Vec<String>)>> {
    let Some(asked) = design.bound else {
        return Ok(None);
    };
    refuse_coarse_words(design, fit, asked)?;
    let rate_rounding_dps = output_rounding_dps(compensation(design)?);
    let room = asked.bound_dps - rate_rounding_dps;
    if asked.auto
        && let Some((reason, help)) = hindrance(compensation(design)?)
    {
        return Err(InputError::new(reason).help(help).into());
    }
    let mut said = Vec::new();
    let mut ways = Vec::new();
    match polynomial_within(design, room)? {
        Reached::Kept(c, bounds, changed) => {
            ways.push(alternatives::horner(design, &c, &bounds, asked.target));
            said.extend(changed);
            design.compensation = Some(*c);
        }
        // Another form may do.
        Reached::Not(_) if asked.auto => {}
        Reached::Not(error) => return Err(error.into()),
    }
    let c = compensation(design)?.clone();
    ways.extend(alternatives::forms(design, &c, room, asked.target)?);
    let chosen = match asked.auto {
        true => (0..ways.len()).min_by_key(|k| ways[*k].listed.cost.price()),
        false => (!ways.is_empty()).then_some(0),
    };
    let Some(way) = chosen.and_then(|k| ways.get(k)) else {
        return Err(InputError::new(format!(
            "no form keeps within compensation.bound_dps = {} deg/s of the fitted polynomial",
            asked.bound_dps
        ))
        .help("give `compensation.output` more fraction bits, or a wider bound")
        .into());
    };
    let c = Compensation {
        form: way.form.clone(),
        ..c
    };
    let kept = Kept {
        bound_dps: asked.bound_dps,
        covered_dps: way.listed.certified_max_abs + rate_rounding_dps,
        rate_rounding_dps,
        form: if asked.auto { "auto" } else { "polynomial" },
        target: asked.target,
        chosen: way.listed.detail.clone(),
        alternatives: lines(&ways, chosen.unwrap_or(0), c.output.format),
    };
    design.compensation = Some(c);
    Ok(Some((kept, said)))
}

/// What running the bias shows about a bound that is kept on paper.
///
/// # Errors
/// A word that saturates, or that may and was not run: the proof does not hold then.
pub fn refuse_saturation(certainty: &Certainty) -> Result<()> {
    let unproved = certainty.bounds.may_saturate && !certainty.exhaustive;
    if !certainty.saturates && !unproved {
        return Ok(());
    }
    let what = match certainty.saturates {
        true => format!("at input {} a word saturates", certainty.at_input_raw),
        false => "a word may saturate, and there are too many inputs to run all".to_owned(),
    };
    Err(
        InputError::new(format!("compensation.bound_dps is not kept: {what}"))
            .help("give `compensation.accumulator` and `compensation.output` more integer bits")
            .into(),
    )
}

fn lines(ways: &[Way], chosen: usize, output: Format) -> Vec<Line> {
    let listed = ways.iter().map(|w| w.listed.clone()).collect();
    let line = |a: crate::tabulate::outcome::Alternative| Line {
        form: a.form,
        detail: a.detail,
        cost: a.cost,
        certified_max_dps: a.certified_max_abs,
        certified_max_lsb: a.certified_max_abs / output.lsb(),
        undominated: a.undominated,
        chosen: a.chosen,
    };
    choice::judged(listed, chosen)
        .into_iter()
        .map(line)
        .collect()
}

fn output_rounding_dps(c: &Compensation) -> f64 {
    one_rounding(c.output.rounding) * c.output.format.lsb()
}

/// Neither coefficients nor entries help where the words at the ends are too coarse.
fn refuse_coarse_words(design: &Design, fit: &BaselineFit, asked: BiasBound) -> Result<()> {
    let c = compensation(design)?;
    let bound = asked.bound_dps;
    let half_step = budget::thermometer_half_step_dps(design, c, fit);
    if half_step > bound {
        let more = (half_step / bound).log2().ceil() as u32;
        let help = match &c.input {
            CompensationInput::Phase => format!(
                "give `circuit.cordic.angle_bits` at least {}, or a wider bound",
                design.circuit.cordic.angle_bits + more
            ),
            CompensationInput::TuningWord(_) => format!(
                "give `circuit.nco.phase_bits` at least {}, or a wider bound",
                design.circuit.nco.phase_bits + more
            ),
            CompensationInput::Channel(_) if !design.compensation_is_own => wider(half_step),
            CompensationInput::Channel(channel) => format!(
                "give `compensation.input_format` at least {} fraction bits, or a wider bound",
                channel.format.fraction_bits + more
            ),
        };
        let said = format!(
            "compensation.bound_dps = {bound} cannot be kept: half a step of the thermometer's word moves the bias by \
             {half_step} deg/s",
            half_step = number(half_step, 3)
        );
        return Err(design
            .error_at("compensation.bound_dps", said)
            .help(help)
            .into());
    }
    // Bias and rate are each rounded once.
    let rounding = 2.0 * output_rounding_dps(c);
    if rounding < bound {
        return Ok(());
    }
    let format = c.output.format;
    let needed = (1..=WIDEST_BITS)
        .map(|k| format.fraction_bits + k)
        .find(|f| rounding / format.lsb() * (-f64::from(*f)).exp2() < bound)
        .unwrap_or(WIDEST_BITS);
    let said = format!(
        "compensation.bound_dps = {bound} cannot be kept: rounding bias and rate to {format} costs {rounding} deg/s, \
         whatever the coefficients",
        rounding = number(rounding, 3)
    );
    let help = match design.compensation_is_own {
        true => {
            format!("give `compensation.output` at least {needed} fraction bits, or a wider bound")
        }
        // The bias itself needs room beside them.
        false => wider(2.0 * rounding),
    };
    Err(design
        .error_at("compensation.bound_dps", said)
        .help(help)
        .into())
}

/// The least bound that chosen formats keep: they are as fine as any that is chosen.
fn wider(least_dps: f64) -> String {
    format!(
        "write `bound_dps = {}` or more: no finer words are chosen. For finer ones, give [compensation] formats of your own",
        at_most(least_dps, 2)
    )
}

/// What became of the polynomial.
enum Reached {
    /// It keeps to the room, in these formats; what was changed.
    Kept(Box<Compensation>, Bounds, Option<String>),
    /// It does not.
    Not(InputError),
}

/// The polynomial with the coarsest formats, from the compensation's own on, that keep it within `room`.
fn polynomial_within(design: &Design, room: f64) -> Result<Reached> {
    let c = compensation(design)?;
    let keeps = |c: &Compensation| -> Result<Option<Bounds>> {
        Ok(bounds_of(design, c)?.filter(|b| b.certified_max_dps <= room))
    };
    if let Some(bounds) = keeps(c)? {
        return Ok(Reached::Kept(Box::new(c.clone()), bounds, None));
    }
    let exact = Evaluation::new(&design.circuit, c).wanted();
    // Plain rounding may have the smaller proved bound.
    if let Some(plain) = rounded(c, &exact)
        && let Some(bounds) = keeps(&plain)?
    {
        return Ok(Reached::Kept(Box::new(plain), bounds, None));
    }
    let found = finer(design, c, &exact, room)?;
    let own = design.compensation_is_own;
    let Some((finer, finer_bounds)) = found else {
        return Ok(Reached::Not(unreached(design, c, room, None)?));
    };
    if own {
        return Ok(Reached::Not(unreached(design, c, room, Some(&finer))?));
    }
    let said = format!(
        "coefficients {} and accumulator {}, which keep the bound; {} and {} do not",
        finer.coefficient_format,
        finer.accumulator.format,
        c.coefficient_format,
        c.accumulator.format
    );
    let raw = coefficients::best(&design.circuit, &finer, &exact, &finer.coefficients_raw)?;
    let searched = Compensation {
        coefficients_raw: raw,
        ..finer.clone()
    };
    Ok(match keeps(&searched)? {
        Some(bounds) => Reached::Kept(Box::new(searched), bounds, Some(said)),
        None => Reached::Kept(Box::new(finer), finer_bounds, Some(said)),
    })
}

/// Fraction bits are added, each time to what contributes more, until the bound is kept or words are full.
fn finer(
    design: &Design,
    c: &Compensation,
    exact: &[f64],
    room: f64,
) -> Result<Option<(Compensation, Bounds)>> {
    let mut next = c.clone();
    loop {
        let Some(plain) = rounded(&next, exact).filter(|c| is_exact(design, c)) else {
            return Ok(None);
        };
        let Some(bounds) = bounds_of(design, &plain)? else {
            return Ok(None);
        };
        if bounds.certified_max_dps <= room {
            return Ok(Some((plain, bounds)));
        }
        if bounds.coefficients_dps > bounds.evaluation_dps {
            next.coefficient_format.fraction_bits += 1;
        } else {
            next.accumulator.format.fraction_bits += 1;
        }
        let fine = next.coefficient_format.fraction_bits;
        let accumulator = &mut next.accumulator.format;
        accumulator.fraction_bits = accumulator.fraction_bits.max(fine);
        let widest = accumulator.bits().max(next.coefficient_format.bits());
        if widest > WIDEST_BITS {
            return Ok(None);
        }
    }
}

/// The same with plainly rounded coefficients; `None` if the format does not hold one.
fn rounded(c: &Compensation, exact: &[f64]) -> Option<Compensation> {
    let format = c.coefficient_format;
    let raw = exact.iter().map(|v| nearest(*v, format));
    Some(Compensation {
        coefficients_raw: raw.collect::<Option<_>>()?,
        ..c.clone()
    })
}

/// True if the 127-bit rule takes the formats.
fn is_exact(design: &Design, c: &Compensation) -> bool {
    limits::check(&with(design, c)).is_ok()
}

fn with(design: &Design, c: &Compensation) -> Design {
    Design {
        compensation: Some(Compensation {
            form: None,
            ..c.clone()
        }),
        ..design.clone()
    }
}

fn bounds_of(design: &Design, c: &Compensation) -> Result<Option<Bounds>> {
    bounds(&with(design, c))
}

fn unreached(
    design: &Design,
    c: &Compensation,
    room: f64,
    finer: Option<&Compensation>,
) -> Result<InputError> {
    let has = bounds_of(design, c)?.map_or(f64::INFINITY, |b| b.certified_max_dps);
    let bound = design.bound.map_or(f64::NAN, |b| b.bound_dps);
    let message = format!(
        "compensation.bound_dps = {bound} is not kept: coefficients {} and accumulator {} leave {has} deg/s, where the \
         rounding of the rate leaves room for {room}",
        c.coefficient_format,
        c.accumulator.format,
        has = at_most(has, 3),
        room = number(room, 3)
    );
    Ok(InputError::new(message).help(match finer {
        Some(f) => format!(
            "these would do: `coefficient_format = \"{}\"`, `accumulator` with \"{}\"; or set `form = \"auto\"`, or a \
             wider bound",
            f.coefficient_format, f.accumulator.format
        ),
        None => format!(
            "no words of up to {WIDEST_BITS} bits do: set `form = \"auto\"`, fit a lower order, or give a wider bound"
        ),
    }))
}

#[cfg(test)]
#[path = "bound_tests.rs"]
mod tests;
