//! The JSON Schema of a design file, from the table of its keys that the reader refuses by.

use super::effects::CATALOGUE;
use super::keys::{KEYS, USER_EFFECT};
use serde_json::{Map, Value, json};

/// The schema of a design: its TOML as JSON. Every key may be left out as far as a schema can tell (a `[circuit]`
/// that is given has to be whole, which the reader checks).
pub fn json_schema() -> Value {
    let mut root = table("");
    if let Some(root) = root.as_object_mut() {
        let head = [
            ("$schema", "https://json-schema.org/draft/2020-12/schema"),
            ("title", "A design of gyrogen"),
            (
                "description",
                "The design file (TOML) as JSON; `gyrogen init` writes one with every key explained",
            ),
        ];
        for (key, text) in head {
            root.insert(key.to_owned(), text.into());
        }
    }
    root
}

/// Of a table with its keys.
fn table(path: &str) -> Value {
    let keys = KEYS.iter().find(|(t, _)| *t == path);
    let keys = keys.map_or(&[][..], |(_, keys)| keys);
    let mut properties = Map::new();
    for (key, example) in keys {
        let inner = if path.is_empty() {
            (*key).to_owned()
        } else {
            format!("{path}.{key}")
        };
        let schema = match inner.as_str() {
            "effects" => json!({ "type": "array", "items": object(USER_EFFECT) }),
            "gyro.effects" => effects(),
            _ if KEYS.iter().any(|(t, _)| *t == inner) => table(&inner),
            _ => value(key, example),
        };
        properties.insert((*key).to_owned(), schema);
    }
    json!({ "type": "object", "properties": properties, "additionalProperties": false })
}

fn object(keys: &[(&str, &str)]) -> Value {
    let properties: Map<String, Value> = keys
        .iter()
        .map(|(key, example)| ((*key).to_owned(), value(key, example)))
        .collect();
    json!({ "type": "object", "properties": properties, "additionalProperties": false })
}

/// The effects of the simulated gyro, each with its parameters.
fn effects() -> Value {
    let effect = |parameters: &[super::effects::Parameter]| {
        let numbers = parameters.iter();
        let numbers: Map<String, Value> = numbers
            .map(|p| {
                (
                    p.key.to_owned(),
                    json!({ "type": "number", "description": p.meaning }),
                )
            })
            .collect();
        json!({ "type": "object", "properties": numbers, "additionalProperties": false })
    };
    let properties: Map<String, Value> = CATALOGUE
        .iter()
        .map(|kind| (kind.id.to_owned(), effect(kind.parameters)))
        .collect();
    json!({ "type": "object", "properties": properties, "additionalProperties": false })
}

/// Of a value like this example.
fn value(key: &str, example: &str) -> Value {
    let format = json!({ "type": "string", "pattern": "^U?Q[0-9]+\\.[0-9]+$" });
    // "auto" and "by_record" stand beside a number.
    if key == "order" {
        return json!({ "type": ["integer", "string"], "examples": [2, "auto"] });
    }
    if example.starts_with("{ format") {
        let whole = json!({
            "type": "object",
            "properties": {
                "format": format,
                "rounding": { "enum": crate::numeric::format::Rounding::ALL.map(|r| r.name()) },
                "overflow": { "enum": crate::numeric::format::Overflow::ALL.map(|o| o.name()) },
            },
            "required": ["format"],
            "additionalProperties": false,
        });
        return json!({ "anyOf": [format, whole] });
    }
    let is_format = example.starts_with("\"Q") || example.starts_with("\"UQ");
    match example.chars().next() {
        Some('"') if is_format => format,
        Some('"') => json!({ "type": "string", "examples": [example.trim_matches('"')] }),
        Some('[') => json!({ "type": "array" }),
        Some('{') => json!({ "type": "object" }),
        Some('t' | 'f') => json!({ "type": "boolean" }),
        _ if example.contains(['.', 'e']) => json!({ "type": "number" }),
        _ => json!({ "type": "integer" }),
    }
}
