//! JSON Schemas of the design and of everything that is written as JSON, from the types themselves.

use crate::{
    check, design, equivalence, firmware, job, record, selftest, simulation, study, tabulate,
    timing, verdict, verify,
};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::Value;

/// Every name, and what it is the schema of.
pub const NAMES: [(&str, &str); 13] = [
    ("design", "the design file, its TOML as JSON"),
    ("run", "summary.json of `run`"),
    ("simulate", "simulate.json"),
    ("equiv", "equiv.json"),
    ("check", "check.json"),
    ("study", "study.json"),
    ("approx", "approx.json"),
    ("close", "closure.json"),
    ("selftest", "selftest.json"),
    ("replay", "what `replay --format json` prints"),
    ("bundle", "manifest.json of a bundle"),
    ("verify", "verify.json"),
    ("timing", "timing.json, the wall times of any command"),
];

/// The schema of that name.
pub fn schema(name: &str) -> Option<Value> {
    Some(match name {
        "design" => design::json_schema(),
        "run" => of::<job::outcome::Summary>(),
        "simulate" => of::<simulation::outcome::Summary>(),
        "equiv" => of::<equivalence::outcome::Equivalence>(),
        "check" => of::<check::outcome::Check>(),
        "study" => of::<study::outcome::Study>(),
        "approx" => of::<tabulate::outcome::Outcome>(),
        "close" => of::<verdict::Closure>(),
        "selftest" => of::<selftest::outcome::Outcome>(),
        "replay" => of::<record::replayed::Replayed>(),
        "bundle" => of::<firmware::manifest::Manifest>(),
        "verify" => of::<verify::bundle::Verification>(),
        "timing" => of::<timing::Timing>(),
        _ => return None,
    })
}

fn of<T: JsonSchema>() -> Value {
    let settings = SchemaSettings::draft2020_12().for_serialize();
    settings
        .into_generator()
        .into_root_schema_for::<T>()
        .to_value()
}
