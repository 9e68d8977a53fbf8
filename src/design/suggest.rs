//! What to say of a word that is no key, no value or no format: the nearest one that is.

use super::effects::EffectKind;
use super::keys::{EFFECTS, KEYS, example, is_table, one_of, title};
use crate::nearest::nearest;
use crate::numeric::format::Format;

/// Endings of keys that are units, and their names; the longer before the shorter.
const UNITS: &[(&str, &str)] = &[
    ("dps_per_rad3", "deg/s/rad^3"),
    ("dps_per_rad2", "deg/s/rad^2"),
    ("dps_per_rad", "deg/s/rad"),
    ("dps_rthz", "deg/s/sqrt(Hz)"),
    ("dps_s_per_k", "deg/s per K/s"),
    ("dps_per_k", "deg/s/K"),
    ("dps_per_v", "deg/s/V"),
    ("rad_per_k", "rad/K"),
    ("per_k", "1/K"),
    ("hz", "Hz"),
    ("degc", "degC"),
    ("dps", "deg/s"),
    ("rad", "rad"),
    ("raw", "raw integers"),
    ("bits", "bits"),
    ("lsb", "LSB"),
    ("v", "V"),
    ("s", "s"),
    ("k", "K"),
];

/// Units that people put instead.
const OTHER_UNITS: &[&str] = &[
    "khz",
    "mhz",
    "ghz",
    "rad_s",
    "rads",
    "rad_per_s",
    "c",
    "celsius",
    "deg_c",
    "kelvin",
    "f",
    "degf",
    "degk",
    "ms",
    "us",
    "ns",
    "sec",
    "seconds",
    "min",
    "minutes",
    "h",
    "hours",
    "deg",
    "degrees",
    "mrad",
    "urad",
    "deg_s",
    "deg_per_s",
    "degps",
    "dph",
    "deg_h",
    "deg_per_h",
    "per_c",
    "per_degc",
    "ppm",
    "ppm_k",
    "ppm_per_k",
    "ppm_per_c",
    "codes",
    "counts",
    "v",
    "mv",
    "percent",
    "rad_per_degc",
    "mrad_per_k",
    "deg_per_k",
    "dps_rthz",
    "value",
    "int",
];

/// How to convert from the first unit to the second.
const CONVERSIONS: &[(&str, &str, &str)] = &[
    ("khz", "hz", "multiply by 1e3"),
    ("mhz", "hz", "multiply by 1e6"),
    ("ms", "s", "divide by 1e3"),
    ("us", "s", "divide by 1e6"),
    ("min", "s", "multiply by 60"),
    ("h", "s", "multiply by 3600"),
    ("k", "degc", "subtract 273.15"),
    ("kelvin", "degc", "subtract 273.15"),
    ("degc", "k", "add 273.15 to a temperature"),
    ("c", "k", "add 273.15 to a temperature"),
    ("celsius", "k", "add 273.15 to a temperature"),
    ("deg", "rad", "multiply by pi/180"),
    ("mrad", "rad", "divide by 1e3"),
    ("dph", "dps", "divide by 3600"),
    ("ppm_per_k", "per_k", "multiply by 1e-6"),
    ("ppm", "per_k", "multiply by 1e-6"),
    ("deg_per_k", "rad_per_k", "multiply by pi/180"),
    ("mrad_per_k", "rad_per_k", "divide by 1e3"),
];

/// What other tools call a rounding or an overflow.
const ALIASES: &[(&str, &str)] = &[
    ("round", "half_up"),
    ("nearest", "half_up"),
    ("convergent", "half_even"),
    ("even", "half_even"),
    ("bankers", "half_even"),
    ("half_to_even", "half_even"),
    ("truncate", "floor"),
    ("trunc", "toward_zero"),
    ("zero", "toward_zero"),
    ("fix", "toward_zero"),
    ("ceiling", "ceil"),
    ("up", "ceil"),
    ("down", "floor"),
    ("sat", "saturate"),
    ("clip", "saturate"),
    ("clamp", "saturate"),
    ("symmetric", "saturate_symmetric"),
    ("modulo", "wrap"),
    ("wraparound", "wrap"),
    ("trap", "error"),
    ("panic", "error"),
    ("abort", "error"),
];

/// What to do about an unknown key or table `unknown` of the table `path`.
pub(super) fn remedy(path: &str, known: &[&str], unknown: &str) -> String {
    let dotted = |key: &str| match path {
        "" => key.to_owned(),
        path => format!("{path}.{key}"),
    };
    let spelled = |key: &str| match is_table(&dotted(key)) {
        true => format!("`[{}]`", dotted(key)),
        false => format!("`{key}`"),
    };
    let plain = unknown.to_lowercase().replace(['-', ' ', '.'], "_");
    if let Some(key) = known.iter().find(|key| **key == plain) {
        return format!("did you mean {}?", spelled(key));
    }
    if let Some(said) = unit_confusion(known, &plain) {
        return said;
    }
    if let Some(key) = nearest(&plain, known) {
        return format!("did you mean {}?", spelled(key));
    }
    let begins =
        |key: &&&str| plain.len() > 3 && (key.starts_with(&plain) || plain.starts_with(**key));
    if let [key] = known.iter().filter(begins).collect::<Vec<_>>()[..] {
        return format!("did you mean {}?", spelled(key));
    }
    // Many tables have an `id` or a `name`: those of an array of tables are not moved elsewhere.
    if let Some(array) = array_title(path) {
        return own_keys(&array, known);
    }
    let known_table = KEYS.iter().find_map(|(table, keys)| {
        let found = keys.iter().find(|(key, _)| *key == plain)?;
        (*table != path && known.iter().all(|k| *k != plain)).then_some((*table, found.0))
    });
    // Not the effects' parameters: many effects have an amplitude.
    let effect = EffectKind::named(&plain).map(|kind| (EFFECTS, kind.id));
    match known_table.or(effect) {
        Some((table, key)) if example(table, key) == "[" => {
            let full = if table.is_empty() {
                key.to_owned()
            } else {
                format!("{table}.{key}")
            };
            format!("did you mean `[{full}]`?")
        }
        Some((table, key)) => format!("`{key}` is a key of {}: move it there", title(table)),
        None if path == EFFECTS => format!(
            "delete it: the effects that a device can be given here are {}",
            one_of(known.iter().copied())
        ),
        None => own_keys(&title(path), known),
    }
}

/// The keys that a table has.
fn own_keys(title: &str, known: &[&str]) -> String {
    format!(
        "delete it, or use one of the keys of {title}: {}",
        one_of(known.iter().copied())
    )
}

/// What a table in an array, as `effects[0]`, is called: `[[effects]]`; `None` for any other table.
fn array_title(path: &str) -> Option<String> {
    let (array, rest) = path.split_once('[')?;
    Some(match rest.contains('.') {
        true => title(path),
        false => format!("`[[{array}]]`"),
    })
}

/// A key with another unit than the one it has, or with none.
fn unit_confusion(known: &[&str], unknown: &str) -> Option<String> {
    known.iter().find_map(|key| {
        let (stem, unit, name) = UNITS.iter().find_map(|(unit, name)| {
            let stem = key.strip_suffix(unit)?;
            (stem.is_empty() || stem.ends_with('_')).then_some((stem, *unit, *name))
        })?;
        // A key that is nothing but its unit.
        let stem = stem.strip_suffix('_')?;
        let given = unknown.strip_prefix(stem)?;
        if given.is_empty() {
            return Some(format!("did you mean `{key}`? Its value is in {name}"));
        }
        let given = given.strip_prefix('_')?;
        if !OTHER_UNITS.contains(&given) && !UNITS.iter().any(|(unit, _)| *unit == given) {
            return None;
        }
        let how = CONVERSIONS
            .iter()
            .find(|(from, to, _)| *from == given && *to == unit)
            .map_or(String::new(), |(_, _, how)| format!(": {how}"));
        Some(format!("did you mean `{key}`? Its value is in {name}{how}"))
    })
}

/// As [`nearest`], for words that other tools spell differently.
pub(crate) fn nearest_word<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let plain = word.trim().to_lowercase().replace(['-', ' '], "_");
    let alias = ALIASES.iter().find(|(other, _)| *other == plain);
    alias
        .and_then(|(_, ours)| known.iter().find(|k| *k == ours).copied())
        .or_else(|| nearest(&plain, known))
}

/// What to write instead of a format that cannot be read.
pub(super) fn format_remedy(text: &str) -> String {
    let rule = "a format is Qm.n (signed; m counts the sign bit) or UQm.n, with 1 to 64 bits";
    let plain = text.trim().to_uppercase().replace([',', '_'], ".");
    let ours = plain.strip_prefix('S').unwrap_or(&plain);
    if let Ok(format) = ours.parse::<Format>() {
        return format!("did you mean \"{format}\"? {rule}");
    }
    // `Q15` is a DSP's short word for `Q1.15`; `Q0.15` leaves the sign bit out.
    let short = ours.strip_prefix('Q').map(|n| n.strip_prefix("0."));
    let fraction = match short {
        Some(Some(n)) => Some(n),
        Some(None) => ours.strip_prefix('Q'),
        None => None,
    };
    match fraction.and_then(|n| n.parse::<u32>().ok()) {
        Some(n @ 1..=63) => format!("did you mean \"Q1.{n}\"? {rule}"),
        _ => rule.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::keys::names;
    use super::*;

    #[test]
    fn remedies_name_the_key_the_unit_and_the_place() {
        let circuit = names("circuit");
        let said = remedy("circuit", &circuit, "sample_rate_khz");
        assert!(said.contains("`sample_rate_hz`") && said.contains("multiply by 1e3"));
        assert!(remedy("circuit", &circuit, "sample_rate").contains("in Hz"));
        assert!(remedy("circuit", &circuit, "Sample-Rate-Hz").contains("`sample_rate_hz`"));
        assert!(remedy("circuit", &circuit, "cordik").contains("`[circuit.cordic]`"));
        assert!(remedy("circuit", &circuit, "phase_bits").contains("`[circuit.nco]`"));
        assert!(remedy("", &names(""), "nco").contains("`[circuit.nco]`"));
        assert!(remedy("", &names(""), "zzzzzzzz").contains("delete it"));
        let said = remedy("effects[0]", &["id", "expression"], "name");
        assert!(
            said.contains("`[[effects]]`: `id` or `expression`"),
            "{said}"
        );
        let thermal = names("thermal_run");
        assert!(remedy("thermal_run", &thermal, "start_k").contains("subtract 273.15"));
    }

    #[test]
    fn formats_of_other_notations_get_ours() {
        for (text, ours) in [
            ("q1.15", "\"Q1.15\""),
            ("Q15", "\"Q1.15\""),
            ("Q0.15", "\"Q1.15\""),
            ("sQ2.14", "\"Q2.14\""),
            ("Q1,15", "\"Q1.15\""),
        ] {
            assert!(format_remedy(text).contains(ours), "{text}");
        }
        assert!(!format_remedy("Q99.99").contains("did you mean"));
    }
}
