//! Results in JSON.

use serde_json::Value;

/// The number at a path of keys with points between them.
pub fn number(value: &Value, path: &str) -> f64 {
    let found = path.split('.').fold(value, |v, key| &v[key]);
    found
        .as_f64()
        .unwrap_or_else(|| panic!("{path} is {found}"))
}
