//! Every key of a design file, with an example of its value.

use super::effects::{CATALOGUE, EffectKind};

/// Each table but the effects with its keys and, for each key, an example of a value; `[` marks a
/// table.
pub(super) const KEYS: &[(&str, &[(&str, &str)])] = &[
    (
        "",
        &[
            ("name", "\"gyro\""),
            ("circuit", "["),
            ("compensation", "["),
            ("correction", "["),
            ("gyro", "["),
            ("thermal_run", "["),
            ("record", "["),
            ("fit", "["),
            ("study", "["),
            ("requirements", "["),
            ("effects", "["),
        ],
    ),
    (
        "circuit",
        &[
            ("sample_rate_hz", "56000.0"),
            ("adc", "["),
            ("nco", "["),
            ("demodulator", "["),
            ("decimator", "["),
            ("cordic", "["),
            ("phase_loop", "["),
            ("amplitude_loop", "["),
        ],
    ),
    ("circuit.adc", &[("format", "\"Q1.15\"")]),
    (
        "circuit.nco",
        &[
            ("phase_bits", "32"),
            ("tuning_word", "134217728"),
            ("table_address_bits", "12"),
            ("address_rounding", "\"half_up\""),
            ("table", "\"Q1.15\""),
        ],
    ),
    (
        "circuit.demodulator",
        &[(
            "product",
            "{ format = \"Q2.22\", rounding = \"half_up\", overflow = \"saturate\" }",
        )],
    ),
    (
        "circuit.decimator",
        &[
            ("stages", "3"),
            ("ratio", "32"),
            ("differential_delay", "1"),
            (
                "output",
                "{ format = \"Q2.22\", rounding = \"half_up\", overflow = \"saturate\" }",
            ),
        ],
    ),
    (
        "circuit.cordic",
        &[
            ("iterations", "20"),
            ("guard_bits", "6"),
            ("width", "32"),
            ("angle_bits", "24"),
            ("gain_bits", "24"),
        ],
    ),
    (
        "circuit.phase_loop",
        &[
            ("setpoint_raw", "-4194304"),
            ("proportional", "{ raw = 9, shift = 6 }"),
            ("integral", "{ raw = 9, shift = 11 }"),
            ("integrator_bits", "48"),
        ],
    ),
    ("circuit.phase_loop.proportional", LOOP_GAIN),
    ("circuit.phase_loop.integral", LOOP_GAIN),
    (
        "circuit.amplitude_loop",
        &[
            ("setpoint_raw", "1048576"),
            ("error_shift", "7"),
            ("integrator_shift", "12"),
            ("initial_raw", "67108864"),
            ("gain_bits", "16"),
        ],
    ),
    (
        "compensation",
        &[
            ("input", "\"phase\""),
            ("coefficients_raw", "[114923930, 800391448, 1415954326]"),
            ("coefficient_format", "\"Q12.20\""),
            (
                "accumulator",
                "{ format = \"Q13.27\", rounding = \"half_up\", overflow = \"saturate\" }",
            ),
            ("rate_full_scale_dps", "2048.0"),
            (
                "output",
                "{ format = \"Q12.12\", rounding = \"half_up\", overflow = \"saturate\" }",
            ),
            ("clamp_raw", "[-5900000, -3900000]"),
            ("outside", "\"clamp\""),
            ("bound_dps", "0.01"),
            ("form", "\"auto\""),
            ("target", "\"cortex-m4\""),
            ("fitted", "["),
            ("evaluation", "["),
            ("input_format", "\"Q9.7\""),
            ("input_offset_raw", "0"),
            ("input_scale_bits", "15"),
            ("rate_input_format", "\"Q2.22\""),
        ],
    ),
    (
        "compensation.fitted",
        &[
            ("coefficients_dps", "[109.60, 763.31, 1350.36]"),
            ("std_max_dps", "0.01"),
            ("heldout_rms_dps", "0.02"),
            ("loop_rms_dps", "0.05"),
        ],
    ),
    (
        "compensation.evaluation",
        &[
            ("kind", "\"linear\""),
            ("segment_bits", "17"),
            ("halvings", "3"),
            ("shared_bits", "4"),
            ("symmetry", "\"even\""),
            ("symmetry_about_raw", "0"),
            ("fraction_bits", "13"),
            ("entries", "[[-3, -1, 2]]"),
            ("monomials", "\"all\""),
            ("formats", "[\"Q12.14\"]"),
            ("intermediate", "\"Q12.20\""),
            ("raw", "[1, 2, 3]"),
        ],
    ),
    (
        "correction",
        &[
            ("period_s", "10.0"),
            ("full_scale_dps", "500.0"),
            ("noise_dps", "1e-3"),
            ("heldout_rms_dps", "2e-3"),
            (
                "inputs",
                "[{ column = \"phase_rad\", offset = -1.8, scale = 0.4 }]",
            ),
            (
                "terms",
                "[{ kind = \"lag\", gain_dps = 0.5, input = 0, tau_s = 600.0 }]",
            ),
        ],
    ),
    (
        "gyro",
        &[
            ("drive_frequency_hz", "1750.0"),
            ("drive_q", "50.0"),
            ("sense_frequency_hz", "2000.0"),
            ("sense_q", "3.0"),
            ("reference_temperature_k", "300.0"),
            ("stiffness_tempco_per_k", "4.939e-5"),
            ("stiffness_law", "\"linear\""),
            ("demodulation_error_rad", "0.436"),
            ("bias", "["),
            ("electronics", "["),
            ("thermal", "["),
            ("effects", "["),
        ],
    ),
    (
        "gyro.bias",
        &[
            ("offset_dps", "109.60"),
            ("linear_dps_per_rad", "242.97"),
            ("quadratic_dps_per_rad2", "136.82"),
        ],
    ),
    (
        "gyro.electronics",
        &[
            ("phase_offset_rad", "0.0"),
            ("phase_slope_rad_per_k", "-6.5e-3"),
            ("reference_temperature_degc", "0.0"),
            ("loop_share", "0.0"),
        ],
    ),
    (
        "gyro.thermal",
        &[
            ("structure_heat_j_per_k", "0.6"),
            ("structure_chamber_w_per_k", "0.01"),
            ("electronics_heat_j_per_k", "0.9"),
            ("electronics_chamber_w_per_k", "0.01"),
            ("exchange_w_per_k", "0.002"),
            ("power_w", "0.0"),
        ],
    ),
    (
        "thermal_run",
        &[
            ("start_degc", "0.0"),
            ("stop_degc", "70.0"),
            ("step_k", "5.0"),
            ("ramp_k_per_min", "1.0"),
            ("dwell_s", "900.0"),
            ("readings_per_dwell", "3"),
            ("samples_per_reading", "512"),
            ("drive_amplitude", "0.5"),
            ("sense_full_scale_dps", "1024.0"),
            ("quadrature_dps", "500.0"),
            ("adc_noise_lsb", "1.0"),
            ("rate_noise_dps_rthz", "0.0073"),
            ("flicker_dph", "30.0"),
            ("rate_random_walk_dph_rth", "10.0"),
            ("scale_rate_dps", "100.0"),
            ("seed", "20040024"),
        ],
    ),
    (
        "record",
        &[
            ("columns", "["),
            ("row_period_s", "10.0"),
            ("thermometer", "\"die_degc\""),
            ("axis", "\"x\""),
            ("instance", "0"),
            ("average_s", "10.0"),
            ("ignore", "[\"gyro_x\", \"gyro_y\"]"),
        ],
    ),
    (
        "record.columns",
        &[
            ("time_s", "\"t\""),
            ("time_since_power_on_s", "\"t_on\""),
            ("rate_out_dps", "\"gyro_x_dps\""),
            ("rate_dps", "\"table_dps\""),
            ("chamber_degc", "\"chamber\""),
            ("phase_rad", "\"drive_phase\""),
            ("freq_hz", "\"drive_freq\""),
            ("die_degc", "\"temp\""),
            ("agc", "\"gain\""),
            ("quad_dps", "\"quad\""),
            ("supply_v", "\"vdd\""),
            ("accel_g", "\"acc\""),
        ],
    ),
    ("fit", &[("order", "2"), ("heldout_blocks", "10")]),
    (
        "study",
        &[
            ("words", "[\"circuit.adc.format\", \"circuit.nco.table\"]"),
            (
                "tied",
                "[[\"circuit.demodulator.product\", \"circuit.decimator.output\"]]",
            ),
            ("targets", "[\"cortex-m4\", \"fpga\"]"),
            ("exhaustive", "2000"),
            ("ranges", "["),
        ],
    ),
    (
        "study.ranges",
        &[
            ("circuit.adc.format", "[10, 18]"),
            ("circuit.nco.phase_bits", "[24, 34]"),
            ("circuit.nco.table_address_bits", "[8, 14]"),
            ("circuit.nco.table", "[10, 18]"),
            ("circuit.demodulator.product", "[14, 26]"),
            ("circuit.decimator.output", "[14, 26]"),
            ("circuit.cordic.iterations", "[10, 22]"),
            ("circuit.cordic.guard_bits", "[0, 8]"),
            ("circuit.cordic.angle_bits", "[14, 26]"),
            ("circuit.cordic.gain_bits", "[14, 26]"),
            ("circuit.phase_loop.proportional", "[3, 8]"),
            ("circuit.phase_loop.integral", "[8, 13]"),
            ("circuit.phase_loop.integrator_bits", "[40, 50]"),
            ("circuit.amplitude_loop.gain_bits", "[10, 18]"),
            ("compensation.coefficient_format", "[22, 34]"),
            ("compensation.accumulator", "[28, 42]"),
            ("compensation.output", "[16, 26]"),
        ],
    ),
    (
        "requirements",
        &[
            ("bias_dps", "0.01"),
            ("drift_dps", "0.02"),
            ("noise_dps_rthz", "0.001"),
            ("arw_deg_rth", "0.04"),
            ("scale_factor_ppm", "100.0"),
            ("spur_dps", "0.01"),
            ("bandwidth_hz", "100.0"),
            ("rom_bytes", "8192.0"),
            ("cycles_per_row", "4000.0"),
        ],
    ),
];

/// Of each `[[effects]]`.
pub(super) const USER_EFFECT: &[(&str, &str)] = &[
    ("id", "\"bearing_wobble\""),
    ("expression", "\"gain*sin(2*pi*time_s/period)\""),
    (
        "parameters",
        "{ gain = { unit = \"deg/s\" }, period = { unit = \"s\", range = [5.0, 200.0] } }",
    ),
    ("physics", "\"the table's bearing is not round\""),
    ("compensable", "false"),
];

const LOOP_GAIN: &[(&str, &str)] = &[("raw", "9"), ("shift", "6")];

/// The thermometers that a polynomial or a bias model can be in, besides the circuit's phase.
pub(super) const THERMOMETERS: &[&str] = &["phase_rad", "freq_hz", "die_degc", "chamber_degc"];

/// The table that holds the effects' tables.
pub(super) const EFFECTS: &str = "gyro.effects";

fn keys_of(table: &str) -> Vec<(&'static str, &'static str)> {
    let effect = table.strip_prefix(EFFECTS);
    match effect.map(|rest| rest.strip_prefix('.').unwrap_or(rest)) {
        Some("") => CATALOGUE.iter().map(|kind| (kind.id, "[")).collect(),
        Some(id) => EffectKind::named(id).map_or(Vec::new(), |kind| {
            let parameters = kind.parameters.iter();
            parameters.map(|p| (p.key, p.example)).collect()
        }),
        None if table.starts_with("effects[") => USER_EFFECT.to_vec(),
        None => {
            let known = KEYS.iter().find(|(t, _)| *t == table);
            known.map_or(Vec::new(), |t| t.1.to_vec())
        }
    }
}

/// The keys of a table.
pub(super) fn names(table: &str) -> Vec<&'static str> {
    keys_of(table).iter().map(|(key, _)| *key).collect()
}

/// An example of a value of a key.
pub(super) fn example(table: &str, key: &str) -> &'static str {
    let found = keys_of(table).into_iter().find(|(k, _)| *k == key);
    found.map_or("...", |(_, example)| example)
}

/// True if the dotted path names a table of a design file.
pub(super) fn is_table(path: &str) -> bool {
    let (table, key) = path.rsplit_once('.').unwrap_or(("", path));
    example(table, key) == "["
}

/// A table as a reader knows it.
pub(super) fn title(path: &str) -> String {
    match path {
        "" => "the top level".to_owned(),
        // Written in one line, not under a header.
        path if !is_table(path) => format!("`{path}`"),
        path => format!("`[{path}]`"),
    }
}

/// "`a`, `b` or `c`".
pub(super) fn one_of<'a>(words: impl Iterator<Item = &'a str>) -> String {
    let quoted: Vec<String> = words.map(|w| format!("`{w}`")).collect();
    match quoted.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
        None => "nothing".to_owned(),
    }
}
