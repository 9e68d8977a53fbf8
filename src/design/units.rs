//! Units: those that names, headers and the design state, and how they become the contract's.

use super::record_columns::{KNOWN, unit_of};

/// A unit, and how its values become those of the contract's column of the same quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// As messages spell it.
    pub name: &'static str,
    /// The contract's unit of the quantity.
    pub of: &'static str,
    /// A value times this ...
    pub times: f64,
    /// ... plus this is in the contract's unit.
    pub plus: f64,
}

impl Unit {
    /// True for the contract's own unit.
    pub fn is_own(&self) -> bool {
        self.times == 1.0 && self.plus == 0.0
    }

    /// A value in the contract's unit.
    pub fn convert(&self, value: f64) -> f64 {
        value * self.times + self.plus
    }

    /// Read in steps of how much it is: "times 0.001", "times 0.555556 less 17.7778".
    pub fn rule(&self) -> String {
        let times = format!("times {}", short(self.times));
        match self.plus {
            0.0 => times,
            plus if plus < 0.0 => format!("{times} less {}", short(-plus)),
            plus => format!("{times} plus {}", short(plus)),
        }
    }
}

fn short(value: f64) -> String {
    if value != 0.0 && value.abs() < 1e-3 {
        return format!("{value:e}");
    }
    format!("{:.6}", value)
        .trim_end_matches('0')
        .trim_end_matches('.')
        .to_owned()
}

const DEGREES: f64 = 180.0 / std::f64::consts::PI;
const GRAVITY: f64 = 9.806_65;
const FAHRENHEIT: f64 = 1.0 / 1.8;

/// Spellings (without blanks, in small letters), unit, the contract's unit, factor, summand.
const UNITS: [(&[&str], &str, &str, f64, f64); 36] = [
    (
        &["s", "sec", "secs", "second", "seconds"],
        "s",
        "s",
        1.0,
        0.0,
    ),
    (
        &[
            "ms",
            "msec",
            "msecs",
            "millis",
            "milliseconds",
            "millisecond",
        ],
        "ms",
        "s",
        1e-3,
        0.0,
    ),
    (
        &[
            "us",
            "usec",
            "usecs",
            "\u{b5}s",
            "\u{3bc}s",
            "micros",
            "microseconds",
            "microsecond",
        ],
        "us",
        "s",
        1e-6,
        0.0,
    ),
    (
        &["ns", "nsec", "nanos", "nanoseconds"],
        "ns",
        "s",
        1e-9,
        0.0,
    ),
    (&["min", "mins", "minute", "minutes"], "min", "s", 60.0, 0.0),
    (&["h", "hr", "hour", "hours"], "h", "s", 3600.0, 0.0),
    (
        &[
            "dps",
            "deg/s",
            "deg_s",
            "deg_per_s",
            "degps",
            "deg_sec",
            "deg/sec",
            "\u{b0}/s",
            "degrees/s",
        ],
        "deg/s",
        "deg/s",
        1.0,
        0.0,
    ),
    (
        &["mdps", "mdeg/s", "mdeg_s", "mdegps", "m\u{b0}/s"],
        "mdeg/s",
        "deg/s",
        1e-3,
        0.0,
    ),
    (
        &[
            "rad/s",
            "rad_s",
            "radps",
            "rads",
            "rps",
            "rad_per_s",
            "rad_sec",
            "rad/sec",
            "radians/s",
        ],
        "rad/s",
        "deg/s",
        DEGREES,
        0.0,
    ),
    (
        &["mrad/s", "mrad_s", "mradps"],
        "mrad/s",
        "deg/s",
        1e-3 * DEGREES,
        0.0,
    ),
    (
        &["urad/s", "urad_s", "uradps"],
        "urad/s",
        "deg/s",
        1e-6 * DEGREES,
        0.0,
    ),
    (
        &[
            "deg/h",
            "deg_h",
            "dph",
            "deg/hr",
            "deg_hr",
            "deg_per_h",
            "\u{b0}/h",
        ],
        "deg/h",
        "deg/s",
        1.0 / 3600.0,
        0.0,
    ),
    (&["rpm", "rev/min", "rev_min"], "rpm", "deg/s", 6.0, 0.0),
    (
        &["degc", "deg_c", "c", "celsius", "\u{b0}c", "\u{2103}"],
        "degC",
        "degC",
        1.0,
        0.0,
    ),
    (
        &["degf", "deg_f", "f", "fahrenheit", "\u{b0}f", "\u{2109}"],
        "degF",
        "degC",
        FAHRENHEIT,
        -32.0 * FAHRENHEIT,
    ),
    (&["k", "kelvin", "degk", "deg_k"], "K", "degC", 1.0, -273.15),
    (
        &["mdegc", "millidegc", "milli_degc", "mc", "m\u{b0}c"],
        "mdegC",
        "degC",
        1e-3,
        0.0,
    ),
    (
        &["cdegc", "centidegc", "centi_degc"],
        "cdegC",
        "degC",
        1e-2,
        0.0,
    ),
    (&["rad", "radian", "radians"], "rad", "rad", 1.0, 0.0),
    (
        &["deg", "degree", "degrees", "\u{b0}"],
        "deg",
        "rad",
        1.0 / DEGREES,
        0.0,
    ),
    (&["mrad", "millirad"], "mrad", "rad", 1e-3, 0.0),
    (
        &["turn", "turns", "rev", "cycles"],
        "turn",
        "rad",
        std::f64::consts::TAU,
        0.0,
    ),
    (&["hz", "hertz"], "Hz", "Hz", 1.0, 0.0),
    (&["khz"], "kHz", "Hz", 1e3, 0.0),
    (&["mhz"], "MHz", "Hz", 1e6, 0.0),
    (&["v", "volt", "volts"], "V", "V", 1.0, 0.0),
    (&["mv", "millivolt", "millivolts"], "mV", "V", 1e-3, 0.0),
    (&["uv", "microvolt", "microvolts"], "uV", "V", 1e-6, 0.0),
    (&["g", "gee"], "g", "g", 1.0, 0.0),
    (&["mg", "milli_g", "millig"], "mg", "g", 1e-3, 0.0),
    (
        &[
            "m/s2",
            "m/s^2",
            "m_s2",
            "ms2",
            "mps2",
            "m_per_s2",
            "mss",
            "m/s/s",
            "m/s\u{b2}",
        ],
        "m/s^2",
        "g",
        1.0 / GRAVITY,
        0.0,
    ),
    (
        &["mm/s2", "mm/s^2", "mm_s2"],
        "mm/s^2",
        "g",
        1e-3 / GRAVITY,
        0.0,
    ),
    (&["1", "ratio", "rel", "relative"], "1", "1", 1.0, 0.0),
    (&["%", "pct", "percent"], "%", "1", 1e-2, 0.0),
    (&["ppm"], "ppm", "1", 1e-6, 0.0),
    (&["permille"], "permille", "1", 1e-3, 0.0),
];

/// The unit that a text names.
pub fn parse(text: &str) -> Option<Unit> {
    let text: String = text.chars().filter(|c| !c.is_whitespace()).collect();
    let text = text.to_lowercase();
    let found = UNITS.iter().find(|u| u.0.contains(&text.as_str()));
    found.map(|(_, name, of, times, plus)| Unit {
        name,
        of,
        times: *times,
        plus: *plus,
    })
}

/// The spellings of the units that a column can have, for messages.
pub fn accepted(column: &str) -> String {
    names_of(unit_of(column)).join(", ")
}

/// The units of the quantity whose unit of the contract is `of`, that one first.
pub fn names_of(of: &str) -> Vec<&'static str> {
    UNITS.iter().filter(|u| u.2 == of).map(|u| u.1).collect()
}

/// The unit that one of `seen` is, where `seen` was found in values that were converted from `taken`. `None`: none that is known.
pub fn product(taken: Unit, seen: Unit) -> Option<&'static str> {
    let times = taken.times * seen.times;
    let is_scale = taken.plus == 0.0 && seen.plus == 0.0 && taken.of == seen.of;
    let mut units = UNITS
        .iter()
        .filter(|u| is_scale && u.2 == taken.of && u.4 == 0.0);
    units
        .find(|u| (u.3 / times - 1.0).abs() < 1e-9)
        .map(|u| u.1)
}

/// The unit that a file's column states for a quantity: in brackets behind its name, or as the end of it. `None`: it
/// states none. A letter alone counts where it can be meant.
pub fn stated(file_name: &str, column: &str) -> Option<Unit> {
    let of = unit_of(column);
    if let Some((_, text)) = bracketed(file_name) {
        return of_quantity(text, of, true);
    }
    suffixes(file_name).find_map(|(_, text)| of_quantity(text, of, false))
}

/// A unit by its text; one of another quantity too, where the text can mean nothing else.
fn of_quantity(text: &str, of: &str, bracketed: bool) -> Option<Unit> {
    let text = match (of, text.trim().to_lowercase().as_str()) {
        // What a thermometer's header calls deg is no angle.
        ("degC", "deg" | "degrees" | "\u{b0}") => "degC",
        ("deg/s", "deg" | "degrees") => return None,
        _ => text,
    };
    let unit = parse(text)?;
    let plain = text.trim().chars().count() > 2 && !matches!(unit.of, "1" | "rad");
    (unit.of == of || (plain || bracketed) && of != "1").then_some(unit)
}

/// Stem and text of `stem [unit]`, `stem (unit)` or `stem {unit}`.
fn bracketed(name: &str) -> Option<(&str, &str)> {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}')] {
        if let Some(inner) = name.strip_suffix(close)
            && let Some((stem, unit)) = inner.rsplit_once(open)
        {
            return Some((stem.trim(), unit.trim()));
        }
    }
    None
}

/// Stem and last part of a name, the longest part of at most three first.
fn suffixes(name: &str) -> impl Iterator<Item = (&str, &str)> {
    let marks: Vec<usize> = name
        .char_indices()
        .filter(|(_, c)| matches!(c, '_' | ' ' | '-' | '/' | '.'))
        .map(|(i, _)| i)
        .collect();
    let from = marks.len().saturating_sub(3);
    marks
        .into_iter()
        .skip(from)
        .filter_map(move |i| Some((name.get(..i)?, name.get(i + 1..)?)))
}

/// The contract's column that a name means in another unit or spelling: `time_ms`, `die [K]`, `rate_out_rad_s`.
pub fn meant(file_name: &str) -> Option<&'static str> {
    let file_name = file_name.trim();
    let parts = bracketed(file_name).into_iter().chain(suffixes(file_name));
    for (stem, text) in parts {
        let Some(unit) = parse(text) else { continue };
        let found = KNOWN.iter().find(|(known, of)| {
            let own = known.rsplit_once('_').map_or(*known, |(stem, _)| stem);
            *of == unit.of && (own == stem || *known == stem)
        });
        if let Some((known, _)) = found {
            return Some(known);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spelling_is_of_one_unit_and_values_convert() {
        for (i, (spellings, ..)) in UNITS.iter().enumerate() {
            for spelling in *spellings {
                let of = UNITS.iter().position(|u| u.0.contains(spelling));
                assert_eq!(of, Some(i), "{spelling}");
            }
        }
        for (text, value, expected) in [
            ("F", 212.0, 100.0),
            ("K", 273.15, 0.0),
            ("rad/s", std::f64::consts::PI, 180.0),
            ("mdps", 250.0, 0.25),
            ("\u{b5}s", 2e6, 2.0),
            ("m/s^2", 9.80665, 1.0),
            ("mV", 3300.0, 3.3),
            ("%", 98.0, 0.98),
        ] {
            let unit = parse(text).unwrap();
            assert!((unit.convert(value) - expected).abs() < 1e-12, "{text}");
        }
    }

    #[test]
    fn names_state_units() {
        let name = |file: &str, column: &str| stated(file, column).map(|u| u.name);
        for (file, column, expected) in [
            ("timestamp_ms", "time_s", Some("ms")),
            ("timestamp", "time_s", None),
            ("t [us]", "time_s", Some("us")),
            ("gyro_z_rad_s", "rate_out_dps", Some("rad/s")),
            ("gyro_z", "rate_out_dps", None),
            ("gyro_z (mdps)", "rate_out_dps", Some("mdeg/s")),
            ("Gyro Z [deg/s]", "rate_out_dps", Some("deg/s")),
            ("gyro_g", "rate_out_dps", None),
            ("accel_m_s2", "rate_out_dps", Some("m/s^2")),
            ("temp_c", "die_degc", Some("degC")),
            ("temp_f", "die_degc", Some("degF")),
            ("temp_k", "die_degc", Some("K")),
            ("Temp [deg]", "die_degc", Some("degC")),
            ("vdd_mv", "supply_v", Some("mV")),
            ("phase_deg", "phase_rad", Some("deg")),
            ("rate_out_dps", "rate_out_dps", Some("deg/s")),
        ] {
            assert_eq!(name(file, column), expected, "{file}");
        }
    }

    #[test]
    fn contract_columns_in_other_units_are_known() {
        for (file, expected) in [
            ("time_ms", Some("time_s")),
            ("time [us]", Some("time_s")),
            ("rate_out_rad_s", Some("rate_out_dps")),
            ("rate_out_dps [rad/s]", Some("rate_out_dps")),
            ("die_k", Some("die_degc")),
            ("chamber_degf", Some("chamber_degc")),
            ("freq_khz", Some("freq_hz")),
            ("supply_mv", Some("supply_v")),
            ("accel_m_s2", Some("accel_g")),
            ("gyro_x_dps", None),
            ("case_degc", None),
            ("time", None),
        ] {
            assert_eq!(meant(file), expected, "{file}");
        }
    }
}
