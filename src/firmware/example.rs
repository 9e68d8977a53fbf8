//! The call that a bundle's README shows, with what comes of it.

use crate::emit::bundle::Bundle;
use crate::emit::c;
use crate::emit::machine::{Type, Width};
use crate::emit::views::Language;
use crate::vectors::model::Model;

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
    /// Parts of the result `out` and their values.
    pub results: Vec<(String, String)>,
}

/// A call of the last function, each of whose inputs lies at five eighths of its range; `result` is the type of its result.
pub(super) fn example(
    bundle: &Bundle,
    models: &[Model],
    result: &str,
    language: Language,
) -> Option<ExampleView> {
    let (function, lowered) = (bundle.program.functions.last()?, bundle.lowered.last()?);
    let model = models.iter().find(|m| m.name == function.name)?;
    let literal = |raw: i128| match language {
        Language::C if i32::try_from(raw).is_err() => {
            c::constant("", raw, Type::Signed(Width::W64))
        }
        _ => raw.to_string(),
    };
    let inputs: Vec<i128> = model
        .inputs
        .iter()
        .map(|range| range.low + (range.high - range.low) / 8 * 5)
        .collect();
    let mut outputs = vec![0; model.outputs];
    model.call(&inputs, &mut outputs);
    let is_wide = |ty: &Type| matches!(ty, Type::Signed(Width::W128) | Type::Unsigned(Width::W128));
    let types = lowered.inputs.iter();
    if model.state > 0
        || types
            .chain(lowered.outputs.iter().map(|(_, v)| &v.ty))
            .any(is_wide)
    {
        return None;
    }
    let part = |name: &str| match lowered.outputs.len() {
        1 => "out".to_owned(),
        _ => format!("out.{name}"),
    };
    let named = lowered.outputs.iter().zip(outputs);
    Some(ExampleView {
        name: function.name.clone(),
        result: result.to_owned(),
        faults: lowered.may_fault,
        arguments: inputs
            .into_iter()
            .map(literal)
            .collect::<Vec<_>>()
            .join(", "),
        results: named
            .map(|((name, _), raw)| (part(name), literal(raw)))
            .collect(),
    })
}
