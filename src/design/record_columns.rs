//! The columns that a thermal record may have, by name (`docs/manual.md`, "Thermal records").

/// The contract's columns, with their units.
pub const KNOWN: [(&str, &str); 12] = [
    ("time_s", "s"),
    ("time_since_power_on_s", "s"),
    ("rate_out_dps", "deg/s"),
    ("rate_dps", "deg/s"),
    ("chamber_degc", "degC"),
    ("phase_rad", "rad"),
    ("freq_hz", "Hz"),
    ("die_degc", "degC"),
    ("agc", "1"),
    ("quad_dps", "deg/s"),
    ("supply_v", "V"),
    ("accel_g", "g"),
];

/// The thermometers, in the order in which the bias model takes the first that a record has.
pub const THERMOMETERS: [&str; 4] = ["phase_rad", "freq_hz", "die_degc", "chamber_degc"];

/// True for a column of the contract.
pub fn is_known(name: &str) -> bool {
    KNOWN.iter().any(|(known, _)| *known == name)
}

/// [`unit_of`] a column, to stand behind a number; empty where there is none.
pub fn unit_behind(name: &str) -> &'static str {
    match unit_of(name) {
        "1" => "",
        unit => unit,
    }
}

/// The unit of a column: the contract's, or by the suffix of an auxiliary column's name;
/// `"1"` where the name carries none.
pub fn unit_of(name: &str) -> &'static str {
    const SUFFIXES: [(&str, &str); 17] = [
        // Before `_s`, which they end with.
        ("_rad_s", "rad/s"),
        ("_dps", "deg/s"),
        ("_mdps", "mdeg/s"),
        ("_ms", "ms"),
        ("_degc", "degC"),
        ("_rad", "rad"),
        ("_hz", "Hz"),
        ("_ppm", "ppm"),
        ("_pct", "%"),
        ("_hpa", "hPa"),
        ("_pa", "Pa"),
        ("_mv", "mV"),
        ("_ma", "mA"),
        ("_v", "V"),
        ("_a", "A"),
        ("_g", "g"),
        ("_s", "s"),
    ];
    if let Some((_, unit)) = KNOWN.iter().find(|(known, _)| *known == name) {
        return unit;
    }
    SUFFIXES
        .iter()
        .find(|(suffix, _)| name.ends_with(suffix))
        .map_or("1", |(_, unit)| unit)
}
