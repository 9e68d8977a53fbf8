//! How far the emitted bias is from the polynomial that it stands for: proved over the calibrated range, run over
//! its input words, and bounded outside.

use super::{Evaluation, alternatives, one_rounding};
use crate::approx::form::stored::Stored;
use crate::approx::real::{Domain, Dyadic, Enclosure};
use crate::design::{Compensation, Design, Outside, limits};
use crate::error::{Error, InputError, Result};
use crate::nodes::repair::{self, Repair};
use crate::tabulate::choice;
use crate::tabulate::describe;
use crate::text::{at_most, constant, number};
use serde::Serialize;

/// Words that are all run; of more, as many evenly spread.
const MOST_WORDS: i128 = 1 << 24;
/// Words of a piece that one thread runs.
const PIECE: i128 = 1 << 16;

/// Bounds of the emitted bias's distance from the fitted polynomial (from the design's own coefficients, where no
/// fit is known), deg/s, inside the calibrated range and unless a word saturates.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Bounds {
    /// Fitted polynomial against the rounded coefficients, real arithmetic: a proved supremum.
    pub coefficients_dps: f64,
    /// Roundings of the Horner steps, by analysis.
    pub evaluation_dps: f64,
    /// The rounding of the bias to the output.
    pub output_dps: f64,
    /// Their sum.
    pub certified_max_dps: f64,
    /// Intervals cannot exclude that a word saturates (or wraps) on the way.
    pub may_saturate: bool,
    /// Outside the calibrated range.
    pub outside: Option<Beyond>,
}

/// What the firmware does outside the calibrated range.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Beyond {
    /// `clamp`, `hold_slope` or `flag`.
    pub contract: &'static str,
    /// Largest distance from the polynomial continued to every word that can come in, deg/s. Nothing was
    /// measured there: the polynomial is a guess itself.
    pub worst_dps: f64,
}

/// The bounds, and what running the bias over its words showed.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Certainty {
    /// By proof.
    pub bounds: Bounds,
    /// The largest error over the words that were run, deg/s.
    pub exhaustive_max_dps: f64,
    /// The first word with it.
    pub at_input_raw: i128,
    /// Words that were run.
    pub inputs_checked: u64,
    /// They were all of the calibrated range.
    pub exhaustive: bool,
    /// A word saturates (or wraps) on the way: the bounds do not hold.
    pub saturates: bool,
}

/// The bounds of a design's compensation; `None` if it has none.
///
/// # Errors
/// A polynomial that cannot be enclosed.
pub fn bounds(design: &Design) -> Result<Option<Bounds>> {
    let Some(c) = &design.compensation else {
        return Ok(None);
    };
    let evaluation = Evaluation::new(&design.circuit, c);
    let wanted = evaluation.wanted();
    let calibrated = calibrated(&evaluation, &wanted)?;
    let fraction_bits = c.coefficient_format.fraction_bits as i32;
    let terms = c.coefficients_raw.iter();
    let terms: Vec<Dyadic> = terms.map(|v| Dyadic::new(*v, fraction_bits)).collect();
    let coefficients_dps = match c.fitted {
        Some(_) => calibrated.supremum_over_domain(&terms).upper,
        // The coefficients are the polynomial.
        None => 0.0,
    };
    let (low, high) = evaluation.calibrated();
    let p_max = [low, high].map(|word| evaluation.variable(word).abs());
    let evaluation_dps = evaluation.steps_bound_dps(p_max[0].max(p_max[1]));
    let output_dps = evaluation.output_bound_dps();
    if let Some(form) = &c.form {
        return of_form(design, &evaluation, form).map(Some);
    }
    Ok(Some(Bounds {
        coefficients_dps,
        evaluation_dps,
        output_dps,
        certified_max_dps: (coefficients_dps + evaluation_dps + output_dps) * (1.0 + 1e-12),
        may_saturate: evaluation.may_saturate(),
        outside: beyond(&evaluation, &wanted)?,
    }))
}

/// The bounds where a form stands for the polynomial.
fn of_form(design: &Design, evaluation: &Evaluation, form: &Stored) -> Result<Bounds> {
    let c = evaluation.compensation;
    let settled = form.settle(c.codes(&design.circuit), c.output.format)?;
    let measured = choice::quick(&settled, &alternatives::function(evaluation)?)?;
    let pieces = settled.form.pieces().into_iter();
    let evaluation_dps = pieces.map(|p| p.evaluation_bound).fold(0.0, f64::max);
    Ok(Bounds {
        coefficients_dps: measured.data_only,
        evaluation_dps,
        output_dps: evaluation.output_bound_dps(),
        certified_max_dps: measured.certified * (1.0 + 1e-12),
        may_saturate: evaluation.may_saturate(),
        outside: beyond(evaluation, &evaluation.wanted())?,
    })
}

/// The bounds, with the bias run over its calibrated words; `None` if the design has no compensation.
///
/// # Errors
/// A polynomial that cannot be enclosed; an error beyond the proved bound (a fault of this program).
pub fn certainty(design: &Design) -> Result<Option<Certainty>> {
    let (Some(c), Some(bounds)) = (&design.compensation, bounds(design)?) else {
        return Ok(None);
    };
    let evaluation = Evaluation::new(&design.circuit, c);
    let run = run(&evaluation, &calibrated(&evaluation, &evaluation.wanted())?);
    let saturates = run.lower > bounds.certified_max_dps;
    if saturates && !bounds.may_saturate {
        return Err(Error::Check(format!(
            "internal: at input {} the bias is {:e} deg/s from the polynomial, beyond the proved {:e}; please \
             report this",
            run.at, run.largest, bounds.certified_max_dps
        )));
    }
    let (low, high) = evaluation.calibrated();
    Ok(Some(Certainty {
        exhaustive_max_dps: match saturates {
            true => run.largest,
            // Both bound it.
            false => run.largest.min(bounds.certified_max_dps),
        },
        bounds,
        at_input_raw: run.at,
        inputs_checked: run.words,
        exhaustive: i128::from(run.words) == high - low + 1,
        saturates,
    }))
}

/// The smallest change of one format with which no word of the bias saturates in the calibrated range; `None` where no such
/// change is enough, or a form was made for the formats.
///
/// # Errors
/// See [`certainty`].
pub fn mend(design: &Design, found: &Certainty) -> Result<Option<Repair>> {
    let has_form = |c: &Compensation| c.form.is_some();
    if design.compensation.as_ref().is_some_and(has_form) {
        return Ok(None);
    }
    for key in ["compensation.output", "compensation.accumulator"] {
        let (mut wide, mut found) = (design.clone(), found.clone());
        let from =
            repair::quantizer_mut(&mut wide, key).map_or(String::new(), |q| q.format.to_string());
        while let Some(quantizer) = repair::quantizer_mut(&mut wide, key) {
            let format = &mut quantizer.format;
            format.integer_bits += 1;
            let (bits, to) = (format.bits(), format.to_string());
            if bits > 64 || limits::check(&wide).is_err() {
                break;
            }
            // The farthest word first: all of them take long.
            if is_far(&wide, &found) {
                continue;
            }
            match certainty(&wide)? {
                Some(again) if again.saturates => found = again,
                _ => {
                    return Ok(Some(Repair {
                        key: key.to_owned(),
                        from: from.clone(),
                        to,
                    }));
                }
            }
        }
    }
    Ok(None)
}

/// True if the word that was farthest from the polynomial is still beyond the bound.
fn is_far(design: &Design, found: &Certainty) -> bool {
    let Some(c) = &design.compensation else {
        return false;
    };
    let evaluation = Evaluation::new(&design.circuit, c);
    let variable = evaluation.variable(found.at_input_raw);
    let terms = evaluation.wanted().into_iter().rev();
    let wanted = terms.fold(0.0, |sum, term| sum * variable + term);
    let error = (evaluation.bias_dps(found.at_input_raw) - wanted).abs();
    // Far beyond what double precision adds, and far below what a word that saturates loses.
    error > 2.0 * found.bounds.certified_max_dps
}

fn calibrated(evaluation: &Evaluation, wanted: &[f64]) -> Result<Enclosure> {
    let (low, high) = evaluation.calibrated();
    enclosure(
        wanted,
        (evaluation.variable(low), evaluation.variable(high)),
    )
}

fn enclosure(wanted: &[f64], (low, high): (f64, f64)) -> Result<Enclosure> {
    let domain = Domain::between(low, high)?;
    Enclosure::of_polynomial(wanted, &domain).map_err(|e| {
        InputError::new(format!(
            "the bias polynomial cannot be bounded: {}",
            e.reason
        ))
        .into()
    })
}

#[derive(Debug, Clone, Copy)]
struct Run {
    /// Certified from above.
    largest: f64,
    /// Certified from below.
    lower: f64,
    at: i128,
    words: u64,
}

/// Every word of the calibrated range, or as many as may be run.
fn run(evaluation: &Evaluation, wanted: &Enclosure) -> Run {
    let (low, high) = evaluation.calibrated();
    let step = ((high - low) / MOST_WORDS).max(1);
    let starts: Vec<i128> = (low..=high).step_by((PIECE * step) as usize).collect();
    let piece = |start: &i128| {
        let end = (start + PIECE * step - 1).min(high);
        let mut piece = Run {
            largest: -1.0,
            lower: 0.0,
            at: *start,
            words: 0,
        };
        for word in (*start..=end).step_by(step as usize) {
            let (value, radius) = wanted.at(evaluation.variable(word));
            let error = (evaluation.bias_dps(word) - value).abs();
            piece.lower = piece.lower.max(error - radius);
            if error + radius > piece.largest {
                (piece.largest, piece.at) = (error + radius, word);
            }
            piece.words += 1;
        }
        piece
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let pieces = crate::parallel::in_parallel(&starts, threads, &|_| (), piece);
    let first = Run {
        largest: -1.0,
        lower: 0.0,
        at: low,
        words: 0,
    };
    // The first word of the largest error, whatever the number of threads.
    pieces.into_iter().fold(first, |a, b| Run {
        largest: a.largest.max(b.largest),
        lower: a.lower.max(b.lower),
        at: if b.largest > a.largest { b.at } else { a.at },
        words: a.words + b.words,
    })
}

/// The polynomial continued on both sides, against the constant or the tangent that the firmware takes.
fn beyond(evaluation: &Evaluation, wanted: &[f64]) -> Result<Option<Beyond>> {
    let c = evaluation.compensation;
    let Some(ends) = c.clamp_raw else {
        return Ok(None);
    };
    let (first, last) = evaluation.words();
    let mut worst_dps = 0.0f64;
    for (end, far) in [(ends.0, first), (ends.1, last)] {
        if end == far {
            continue;
        }
        let (p_end, p_far) = (evaluation.variable(end), evaluation.variable(far));
        let (low, high) = (p_end.min(p_far), p_end.max(p_far));
        let side = enclosure(wanted, (low, high))?;
        let value = evaluation.bias_dps(end);
        // The emitted word is on this line but for the rounding of the end's word, of the rise and of its own.
        let (slope, rounding) = match c.outside {
            Outside::Clamp | Outside::Flag => (0.0, 0.0),
            Outside::HoldSlope => (
                evaluation.slope_dps(end),
                2.0 * evaluation.output_bound_dps() + evaluation.step_bound_dps(),
            ),
        };
        let line = [Dyadic::from_f64(value), Dyadic::from_f64(slope)];
        let about = Dyadic::from_f64(p_end);
        let distance = side.supremum_about(&line, about, low, high).upper + rounding;
        worst_dps = worst_dps
            .max(distance)
            .max(farthest(evaluation, &side, end, far));
    }
    Ok(Some(Beyond {
        contract: c.outside.name(),
        worst_dps,
    }))
}

/// Where the tangent saturates, the line does not hold: words on the way, evenly spread.
fn farthest(evaluation: &Evaluation, wanted: &Enclosure, end: i128, far: i128) -> f64 {
    const WORDS: i128 = 256;
    let words = (0..=WORDS).map(|k| end + (far - end) * k / WORDS);
    words
        .map(|word| {
            let (value, radius) = wanted.at(evaluation.variable(word));
            (evaluation.bias_dps(word) - value).abs() + radius
        })
        .fold(0.0, f64::max)
}

/// What a run knows beside the bounds.
#[derive(Debug, Clone, Copy)]
pub struct OfRun<'a> {
    /// The reading of the thermometer at which the fitted polynomial has its largest standard deviation, with its unit.
    pub least_certain: Option<&'a str>,
    /// See [`Certainty::saturates`].
    pub saturates: bool,
}

/// Sentences for the head of emitted sources.
pub fn sentences(design: &Design, bounds: &Bounds) -> Vec<String> {
    sentences_with(design, bounds, None)
}

/// The same for the terminal and the report, which say what a run says of heating and cooling elsewhere.
pub fn sentences_with(design: &Design, bounds: &Bounds, of_run: Option<OfRun>) -> Vec<String> {
    let Some(c) = &design.compensation else {
        return Vec::new();
    };
    let against = match c.fitted {
        Some(_) => "fitted polynomial",
        None => "polynomial as given",
    };
    let unless = if bounds.may_saturate {
        ", unless a word saturates"
    } else {
        ""
    };
    let saturates = of_run.is_some_and(|r| r.saturates);
    let mut lines = vec![if saturates {
        "The firmware's bias keeps to no bound: a word saturates inside the calibrated range."
            .to_owned()
    } else {
        format!(
            "For a given word of the thermometer the firmware's bias is at most {} from the {against} (proved{unless}). Of this the coefficients' words make {}, the \
         rounding of the steps {} and that of the output {} deg/s.",
            figure(design, bounds.certified_max_dps),
            at_most(bounds.coefficients_dps, 3),
            at_most(bounds.evaluation_dps, 3),
            at_most(bounds.output_dps, 3)
        )
    }];
    if let Some(asked) = design.bound.filter(|_| !saturates) {
        let covered = bounds.certified_max_dps + output_rounding_dps(c);
        let word = if covered <= asked.bound_dps {
            "kept"
        } else {
            "NOT kept"
        };
        lines.push(format!(
            "Bias and rate were asked to be within {} deg/s of it at every calibrated word of the thermometer. With the rounding of \
             the rate they are within {}: {word}. The thermometer's own rounding to its word is not in that.",
            asked.bound_dps,
            at_most(covered, 3)
        ));
    }
    if let Some(form) = c.form.as_ref() {
        let built = form.build(c.codes(&design.circuit), c.output.format);
        let detail = built.map_or(String::new(), |f| describe::detail(&f));
        lines.push(format!(
            "Firmware evaluates the bias by a form that replaces the polynomial: {detail}."
        ));
    }
    if let Some(fitted) = &c.fitted {
        lines.push(format!(
            "Where the fitted polynomial is least certain{}, its standard deviation is {} deg/s. Rows that the fit has not seen are \
             {} deg/s rms from it.",
            of_run
                .and_then(|r| r.least_certain)
                .map_or(String::new(), |at| format!(" (at {at})")),
            number(fitted.std_max_dps, 3),
            number(fitted.heldout_rms_dps, 3)
        ));
        if let (Some(rms), None) = (fitted.loop_rms_dps, of_run) {
            lines.push(format!(
                "Heating and cooling differ by {} deg/s rms at the same reading of the thermometer. No polynomial in it follows both: \
                 `gyrogen close` looks for the cause.",
                number(rms, 3)
            ));
        }
    }
    if let Some((low, high)) = c.flagged_range() {
        let bound = match saturates {
            true => "",
            false => " for which the bound above holds,",
        };
        lines.push(format!(
            "guaranteed: in_range is 1 for the inputs {low} .. {high},{bound} and 0 for every \
             other one, for which no error is promised: the bias is that of the nearer end"
        ));
    }
    if let Some(outside) = &bounds.outside {
        lines.push(format!(
            "Outside the calibrated inputs {}. Nothing was measured there. If the bias went on as the polynomial does, the firmware \
             would be off by at most {} deg/s, over all inputs that its word can hold ({}).",
            match outside.contract {
                "clamp" => "the bias keeps its value at the nearer end (clamp)".to_owned(),
                "hold_slope" => "the bias goes on with the nearer end's slope (hold_slope)".to_owned(),
                other => format!("the contract is {other}"),
            },
            at_most(outside.worst_dps, 3),
            every_reading(&Evaluation::new(&design.circuit, c))
        ));
    }
    lines
}

/// What the first and the last word that can come in stand for.
fn every_reading(evaluation: &Evaluation) -> String {
    let (first, last) = evaluation.words();
    let [(low, unit), (high, _)] = [first, last].map(|word| evaluation.reading(word));
    format!("{} .. {} {unit}", constant(low, 5), constant(high, 5))
}

/// What running it showed, in a sentence.
pub fn run_sentence(design: &Design, certainty: &Certainty) -> String {
    let c = certainty;
    format!(
        "{} on {}{} {}: the bias was at most {} from the polynomial (at input word {}){}.",
        match c.saturates {
            true => "The bias was run",
            false => "The bound of the bias was tried",
        },
        if c.exhaustive { "all " } else { "" },
        c.inputs_checked,
        match design.compensation.as_ref().and_then(|c| c.clamp_raw) {
            Some(_) => "calibrated inputs",
            None => "input words",
        },
        figure(design, c.exhaustive_max_dps),
        c.at_input_raw,
        if c.saturates {
            "; a word saturates"
        } else {
            ""
        }
    )
}

/// What one rounding to the output can add, deg/s.
fn output_rounding_dps(c: &Compensation) -> f64 {
    one_rounding(c.output.rounding) * c.output.format.lsb()
}

fn figure(design: &Design, dps: f64) -> String {
    let output = design.compensation.as_ref().map(|c| c.output.format.lsb());
    format!(
        "{} deg/s ({} output LSB)",
        at_most(dps, 3),
        at_most(dps / output.unwrap_or(1.0), 3)
    )
}
