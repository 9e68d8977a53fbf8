//! The call that a bundle's README shows, with what comes of it.

use crate::emit::bundle::Bundle;
use crate::emit::c;
use crate::emit::machine::{Type, Width};
use crate::emit::views::{FunctionView, Language};
use crate::numeric::arithmetic::{Port, Scale};
use crate::text::{Place, constant, shown};

/// Digits of a quantity in a comment (convention).
const SHOWN_DIGITS: usize = 6;

/// A call with what comes of it.
#[derive(Debug, Clone)]
pub struct ExampleView {
    /// The function, without the prefix.
    pub name: String,
    /// Type of the result.
    pub result: String,
    /// It may note a fault.
    pub faults: bool,
    /// Between the brackets.
    pub arguments: String,
    /// What the arguments stand for; empty where they are words of the circuit alone.
    pub given: String,
    /// Parts of the result `out` and their values.
    pub results: Vec<(String, String)>,
    /// What the result stands for.
    pub found: String,
}

/// The call of `rate` with what `bias` gives, which is a wider word than `rate` takes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ByHand {
    /// What `rate` takes.
    pub parameter: String,
    /// What `bias` gives.
    pub result: String,
    /// The call, with a cast.
    pub call: String,
}

impl ByHand {
    /// Of the two functions; `None` where the types are the same, or the bias is not all that is given.
    pub(super) fn of(
        prefix: &str,
        language: Language,
        bias: &FunctionView,
        rate: &FunctionView,
    ) -> Option<Self> {
        let (parameter, result) = (rate.inputs.last()?.ty.clone(), bias.result.clone());
        // A bias that comes with a flag is a part of a structure.
        if parameter == result || bias.outputs.len() != 1 {
            return None;
        }
        let fault = |f: &FunctionView, to: &'static str| if f.faults { to } else { "" };
        let call = match language {
            Language::C => format!(
                "{prefix}_rate(raw_rate, ({parameter}){prefix}_bias(thermometer{}){})",
                fault(bias, ", &fault"),
                fault(rate, ", &fault"),
            ),
            Language::Rust => format!(
                "{prefix}::rate(raw_rate, {prefix}::bias(thermometer{}) as {parameter}{})",
                fault(bias, ", &mut fault"),
                fault(rate, ", &mut fault"),
            ),
        };
        Some(ByHand {
            parameter,
            result,
            call,
        })
    }
}

/// A call of the last function, each of whose inputs lies at five eighths of its range, or of the limits that the function
/// has for it (a flag is set); `result` is the type
/// of its result, `model` gives the words that are due. `None` where a word has more than 64 bits, or the model has no result.
pub(super) fn example(
    bundle: &Bundle,
    result: &str,
    language: Language,
    model: impl FnOnce(&[i128]) -> Vec<i128>,
) -> Option<ExampleView> {
    let (function, lowered) = (bundle.program.functions.last()?, bundle.lowered.last()?);
    let literal = |raw: i128| match language {
        Language::C if i32::try_from(raw).is_err() => {
            c::constant("", raw, Type::Signed(Width::W64))
        }
        _ => raw.to_string(),
    };
    let is_wide = |ty: &Type| matches!(ty, Type::Signed(Width::W128) | Type::Unsigned(Width::W128));
    let types = lowered.inputs.iter();
    if types
        .chain(lowered.outputs.iter().map(|(_, v)| &v.ty))
        .any(is_wide)
    {
        return None;
    }
    let ranges = function.inputs.iter();
    let ranges = ranges.map(|(port, range)| port.limits.unwrap_or((range.low, range.high)));
    let inputs: Vec<i128> = ranges
        .map(|(low, high)| match high - low {
            1 => high,
            span => low + span / 8 * 5,
        })
        .collect();
    let outputs = model(&inputs);
    let named = function.outputs.iter().map(|(port, _)| port);
    let named: Vec<&Port> = named.filter(|port| !port.name.is_empty()).collect();
    if outputs.is_empty() || outputs.len() != named.len() {
        return None;
    }
    let part = |port: &&Port| match named.len() {
        1 => "out".to_owned(),
        _ => format!("out.{}", port.name),
    };
    let ports = function.inputs.iter().map(|(port, _)| port);
    Some(ExampleView {
        name: function.name.clone(),
        result: result.to_owned(),
        faults: lowered.may_fault,
        given: quantities(ports.zip(&inputs)),
        found: quantities(named.iter().copied().zip(&outputs)),
        arguments: inputs
            .into_iter()
            .map(literal)
            .collect::<Vec<_>>()
            .join(", "),
        results: named
            .iter()
            .map(part)
            .zip(outputs.into_iter().map(literal))
            .collect(),
    })
}

/// What words stand for: `die_degc = 31.98 degC, rate = 12.5 deg/s`.
fn quantities<'a>(words: impl Iterator<Item = (&'a Port, &'a i128)>) -> String {
    let quantity = |(port, raw): (&Port, &i128)| {
        let Scale {
            quantity,
            offset,
            factor,
            unit,
        } = port.scale.as_ref()?;
        let value = constant(offset + factor * *raw as f64, SHOWN_DIGITS);
        Some(format!("{quantity} = {value} {unit}").trim_end().to_owned())
    };
    let all: Vec<String> = words.filter_map(quantity).collect();
    shown(&all.join(", "), Place::Source)
}
