//! Designs with one mistake each, and what is said of it where.

use super::says;
use crate::design::reader::parse;
use crate::design::template::DEFAULT;

/// Old and new piece of the default's text, and substrings of message and help.
type Case = (&'static str, &'static str, &'static str, &'static str);

#[rustfmt::skip]
const BROKEN: &[Case] = &[
    // What is no TOML.
    ("phase_bits = 32", "phase_bits = ¦", "not TOML", "double quotes"),
    ("phase_bits = 32", "phase_bits = 32\n¦phase_bits = 32", "duplicate key", "each key once"),
    ("[fit]", "[fit]\n[¦fit]", "duplicate key", "merge one of the two"),
    ("name = \"gyro\"", "name = ¦gyro", "quoted", "double quotes"),
    ("seed = 20040024", "seed = ¦007", "leading zero", "without leading zeros"),
    ("seed = 20040024", "seed = 2¦,5", "not TOML", "as a point: `seed = 2.5`"),
    ("name = \"gyro\"", "name = ¦flag", "not TOML", "double quotes: `name = \"flag\"`"),
    ("phase_bits = 32", "phase_bits = ¦32 33", "not TOML", "without a blank in it: `phase_bits = 32`. If the key takes several, write them as a list: `phase_bits = [32, 33]`"),
    ("seed = 20040024", "seed = ¦20 040 024", "not TOML", "one number, without a blank in it: `seed = 20040024`."),
    ("step_k = 5.0", "step_k = ¦5 K", "not TOML", "the number alone, the key's name has the unit: `step_k = 5`"),
    ("[record]", "[record]\ncolumns.time_s = { column = \"t_ms, unit = \"¦ms\" }", "not TOML", "is a quote missing before the comma in this line?"),
    ("[record]", "[record]\ncolumns.time_s = ¦t_ms\"", "not TOML", "is a quote missing in this line?"),
    ("seed = 20040024", "seed = 2¦,5 # 3\" tube", "not TOML", "as a point: `seed = 2.5`"),
    ("[circuit.cordic]", "[circuit.cordic¦", "not TOML", "header in this line as `[circuit.cordic]`"),
    ("[circuit.cordic]", "[[circuit.cordic]¦", "not TOML", "header in this line as `[circuit.cordic]`"),
    ("coefficients_raw = [114923930, 800391448, 1415954326]", "coefficients_raw = [114923930\n¦800391448, 1415954326]", "not TOML", "value of `coefficients_raw` that line"),
    ("[circuit.cordic]", "[circuit¦ cordic]", "not TOML", "header in this line as `[circuit.cordic]`"),
    ("phase_bits = 32", "phase_bits ¦32", "not TOML", "have `=` between them: `phase_bits = 32`"),
    ("phase_bits = 32", "phase_bits = 3_2¦_", "not TOML", "without it"),
    ("name = \"gyro\"", "name = \"gyro¦", "not TOML", "close the text with a double quote"),
    // Unknown keys and tables.
    ("sample_rate_hz = ", "¦sample_rate_khz = ", "unknown key `sample_rate_khz` in `[circuit]`", "`sample_rate_hz`? Its value is in Hz: multiply by 1e3"),
    ("tuning_word = ", "¦tunning_word = ", "unknown key `tunning_word`", "did you mean `tuning_word`?"),
    ("ratio = 32", "¦raito = 32", "unknown key `raito`", "did you mean `ratio`?"),
    ("[circuit.cordic]", "[circuit.¦cordick]", "unknown table `[circuit.cordick]`", "did you mean `[circuit.cordic]`?"),
    ("[circuit.adc]", "[¦adc]", "unknown table `[adc]`", "did you mean `[circuit.adc]`?"),
    ("[fit]", "[fit]\n¦dwell_s = 3.0", "unknown key `dwell_s` in `[fit]`", "a key of `[thermal_run]`"),
    ("half_width_k = 3.7", "half_width_k = 3.7\n[gyro.effects.¦sloshing]", "unknown table `[gyro.effects.sloshing]`", "`mode_crossing`"),
    ("#thermal_lag = {", "¦termal_lag = {", "unknown table `[gyro.effects.termal_lag]`", "did you mean `[gyro.effects.thermal_lag]`?"),
    ("[fit]", "[fit]\n¦thermal_lag = 3", "unknown key `thermal_lag` in `[fit]`", "`[gyro.effects.thermal_lag]`"),
    ("#thermal_lag = { dps_per_k = 0.8, tau_s", "thermal_lag = { dps_per_k = 0.8, ¦tau_min", "unknown key `tau_min` in `[gyro.effects.thermal_lag]`", "`tau_s`? Its value is in s: multiply by 60"),
    ("#thermal_lag = { dps_per_k", "thermal_lag = { ¦dps", "unknown key `dps` in `[gyro.effects.thermal_lag]`", "`dps_per_k`"),
    ("name = ", "¦title = \"x\"\nname = ", "outside any table", "`compensation`"),
    ("center_degc = 37.5", "¦center_k = 316.0", "unknown key `center_k`", "subtract 273.15"),
    ("[record]", "[record]\ncolumns.¦rate_out_dph = \"x\"", "unknown key `rate_out_dph`", "`rate_out_dps`"),
    (" rounding = \"half_up\"", " ¦round = \"half_up\"", "unknown key `round` in `circuit.demodulator.product`", "`rounding`"),
    ("address_rounding", "¦address_round", "unknown key `address_round`", "did you mean `address_rounding`?"),
    // Missing ones.
    ("[circuit.nco]¦phase_bits = 32", "¦[circuit.nco]", "`[circuit.nco]` lacks the required key `phase_bits`", "add `phase_bits = 32`"),
    ("[circuit.adc]¦format = \"Q1.15\"", "¦[circuit.adc]", "lacks the required key `format`", "format = \"Q1.15\""),
    ("[compensation]¦input = \"phase\"", "¦[compensation]", "lacks the required key `input`", "input = \"phase\""),
    ("product = { format = \"Q2.22\", ", "product = ¦{ ", "lacks the required key `format`", "product = { format"),
    ("#thermal_lag = { dps_per_k = 0.8, tau_s = 240.0 }", "thermal_lag = ¦{ dps_per_k = 0.8 }", "`[gyro.effects.thermal_lag]` lacks the required key `tau_s`", "add `tau_s = 240.0` under"),
    // Types.
    ("#thermal_lag = { dps_per_k = 0.8, tau_s = 240.0 }", "thermal_lag = ¦0.8", "takes a table, found the real 0.8", "`[gyro.effects.thermal_lag]`"),
    ("phase_bits = 32", "phase_bits = ¦32.0", "takes an integer, found the real 32.0", "`phase_bits = 32`"),
    ("phase_bits = 32", "phase_bits = ¦\"32\"", "takes an integer, found the string \"32\"", "without quotes"),
    ("phase_bits = 32", "phase_bits = ¦true", "found the boolean true", "8 to 64"),
    ("sample_rate_hz = 56000.0", "sample_rate_hz = ¦\"56 kHz\"", "takes a number", "in Hz"),
    ("sample_rate_hz = 56000.0", "sample_rate_hz = ¦1979-05-27", "date", "in Hz"),
    ("adc_noise_lsb = 1.0", "adc_noise_lsb = ¦nan", "not a finite number", "LSB rms"),
    ("dwell_s = 900.0", "dwell_s = ¦1e999", "not a finite number", "zero or positive"),
    ("drive_q = 50.0", "drive_q = ¦-inf", "not a finite number", "positive"),
    ("[fit]", "¦[[fit]]", "takes a table, found the array", "single brackets"),
    ("name = \"gyro\"", "name = ¦5", "takes a string, found the integer 5", "double quotes"),
    ("[114923930, ", "[114923930, ¦1.5, ", "`compensation.coefficients_raw[1]` takes an integer", "coefficient_format"),
    ("coefficients_raw = [114923930, 800391448, 1415954326]", "coefficients_raw = ¦7", "takes an array", "coefficients_raw = ["),
    // Formats.
    ("format = \"Q1.15\"", "format = ¦{ format = \"Q1.15\" }", "a format as a string only", "\"Q1.15\""),
    ("table = \"Q1.15\"", "table = ¦\"Q15\"", "`Q15`", "did you mean \"Q1.15\"?"),
    ("table = \"Q1.15\"", "table = ¦\"Q1.40\"", "41 bits", "2 to 40"),
    ("format = \"Q1.15\"", "format = ¦\"UQ1.15\"", "signed", "signed format"),
    ("format = \"Q1.15\"", "format = ¦\"Q1.32\"", "33 bits", "2 to 32"),
    ("{ format = \"Q2.22\"", "{ format = ¦\"Q0.22\"", "no room for the sign", "m counts the sign bit"),
    ("{ format = \"Q2.22\"", "{ format = ¦\"Q65.0\"", "65 bits", "1 to 64 bits"),
    (" rounding = \"half_up\"", " rounding = ¦\"nearest\"", "`circuit.demodulator.product.rounding` is `nearest`", "did you mean `half_up`?"),
    ("overflow = \"saturate\"", "overflow = ¦\"saturated\"", "`saturated`", "did you mean `saturate`?"),
    // Ranges.
    ("sample_rate_hz = 56000.0", "sample_rate_hz = ¦0", "is 0; it has to be positive", "Hz"),
    ("phase_bits = 32", "phase_bits = ¦7", "is 7; it has to be 8..=64", "width"),
    ("phase_bits = 32", "phase_bits = ¦99999999999999999999999999999999999999999999", "8..=64", "width"),
    ("tuning_word = 134217728", "tuning_word = ¦1750.0", "takes an integer, found the real 1750.0", "f_hz / sample_rate_hz * 2^phase_bits"),
    ("tuning_word = 134217728", "tuning_word = ¦4294967296", "is 4294967296; it has to be", "modulo 2^phase_bits"),
    ("tuning_word = 134217728", "tuning_word = ¦0x1_0000_0000", "is 0x1_0000_0000;", "4294967295"),
    ("table_address_bits = 12", "table_address_bits = ¦17", "2..=16", "at most phase_bits"),
    ("address_rounding = \"half_up\"", "address_rounding = ¦\"half_even\"", "`half_even`", "`floor` or `half_up`"),
    ("ratio = 32", "ratio = ¦4097", "2..=4096", "R"),
    ("differential_delay = 1", "differential_delay = ¦3", "1..=2", "M"),
    ("initial_raw = 67108864", "initial_raw = ¦134213633", "0..=134213632", "within its limits"),
    ("initial_raw = 67108864", "initial_raw = ¦-1", "0..=134213632", "within its limits"),
    ("gain_bits = 16", "gain_bits = ¦33", "2..=32", "width"),
    ("[114923930, ", "[¦2147483648, ", "`compensation.coefficients_raw[0]` is 2147483648", "Q12.20"),
    ("coefficients_raw = [114923930, 800391448, 1415954326]", "coefficients_raw = ¦[]", "has 0 coefficients", "1 to 16"),
    ("rate_full_scale_dps = 2048.0", "rate_full_scale_dps = ¦2000", "is 2000; it has to be a power of two", "1024 or 2048"),
    ("input = \"phase\"", "input = \"phase\"\ninput_format = ¦\"Q9.7\"", "goes only with a thermometer", "delete it"),
    ("input = \"phase\"", "input = ¦\"die_temp\"", "`die_temp`", "`die_degc`"),
    ("rate_full_scale_dps = 2048.0", "rate_full_scale_dps = 2048\nclamp_raw = ¦[5, 4]", "no range", "lower end first"),
    ("rate_full_scale_dps = 2048.0", "rate_full_scale_dps = 2048\nclamp_raw = [0, ¦8388608]", "-8388608..=8388607", "angle_bits"),
    ("rate_full_scale_dps = 2048.0", "rate_full_scale_dps = 2048\nclamp_raw = ¦[1]", "has 1 numbers", "[low, high]"),
    ("name = \"gyro\"", "name = ¦\"while\"", "keyword", "gyro_a"),
    ("name = \"gyro\"", "name = ¦\"1st\"", "no C identifier", "letter"),
    ("name = \"gyro\"", "name = ¦\"\"", "is empty", "letter"),
    ("name = \"gyro\"", "name = ¦\"_x\"", "underscore", "letter"),
    ("drive_q = 50.0", "drive_q = ¦-50", "is -50; it has to be positive", "quality factor"),
    ("stiffness_tempco_per_k = 4.939e-5", "stiffness_tempco_per_k = ¦49.39", "-0.001 to 0.001", "ppm/K"),
    ("#thermal_lag = { dps_per_k = 0.8, tau_s = 240.0 }", "thermal_lag = { dps_per_k = 0.8, tau_s = ¦0 }", "`gyro.effects.thermal_lag.tau_s` is 0; it has to be positive", "time constant in s"),
    ("#adc_missing_codes = { spacing = 64.0", "adc_missing_codes = { spacing = ¦2.5", "is 2.5; it has to be a whole number from 2 to 1048576", "codes"),
    ("#output_saturation = { low_dps = -300.0, high_dps = 300.0 }", "output_saturation = { low_dps = 3, high_dps = ¦-3 }", "is -3, and `low_dps` is 3", "below `high_dps`"),
    ("center_degc = 37.5", "center_degc = ¦-300.0", "absolute zero", "degC"),
    ("start_degc = 0.0", "start_degc = ¦-273.15", "absolute zero", "degC"),
    ("stop_degc = 70.0", "stop_degc = ¦-1.0", "does not rise", "above `start_degc`"),
    ("step_k = 5.0", "step_k = ¦1e-6", "1 to 10000 steps", "step_k"),
    ("step_k = 5.0", "step_k = ¦71", "1 to 10000 steps", "step_k"),
    ("drive_amplitude = 0.5", "drive_amplitude = ¦1.5", "it has to be 0.000001 to 1", "fraction"),
    ("seed = 20040024", "seed = ¦-1", "0..=18446744073709551615", "seed"),
    ("[record]", "[record]\nthermometer = ¦\"die_deg\"", "`die_deg`", "did you mean `die_degc`?"),
    ("#instance = 0", "instance = ¦-1", "0..=255", "number of the gyro"),
    ("axis = \"z\"", "axis = ¦\"w\"", "`w`", "`x`"),
    ("[record]", "[record]\naverage_s = ¦0", "0", "0.001"),
    ("[record]", "[record]\ncolumns.agc = ¦\" \"", "names no column", "header"),
    ("[record]", "[record]\ncolumns.agc = \"a\"\ncolumns.quad_dps = ¦\"a\"", "the column that `agc` is read from", "of its own"),
    ("order = \"by_record\"", "order = ¦9", "0..=8", "auto"),
    ("order = \"by_record\"", "order = ¦\"best\"", "`best`", "`auto`"),
    ("order = \"by_record\"", "order = ¦\"2\"", "found the string", "`order = 2`"),
    ("heldout_blocks = 10", "heldout_blocks = ¦1", "2..=50", "cross-validation"),
];

/// The default with a piece replaced; in `[header]¦line` the header gets the mark and the line goes.
fn mutated(old: &str, new: &str) -> String {
    if let Some((header, line)) = old.split_once('¦') {
        let at = DEFAULT.find(&format!("\n{header}\n")).expect(header) + 1;
        let (head, tail) = DEFAULT.split_at(at);
        assert!(tail.contains(line), "{line}");
        let tail = tail.replacen(line, "", 1).replacen(header, new, 1);
        return format!("{head}{tail}");
    }
    // A table's header or a key at the start of a line, anything else wherever it comes first.
    let at = DEFAULT.find(&format!("\n{old}")).map(|p| p + 1);
    let at = at.or_else(|| DEFAULT.find(old)).expect(old);
    format!("{}{new}{}", &DEFAULT[..at], &DEFAULT[at + old.len()..])
}

#[test]
fn broken_designs_are_refused_in_their_place() {
    assert!(BROKEN.len() >= 40);
    for (old, new, message, help) in BROKEN {
        says(&mutated(old, new), message, help);
    }
}

#[test]
fn extremes_inside_the_ranges_are_taken() {
    for (old, new) in [
        ("tuning_word = 134217728", "tuning_word = 4294967295"),
        (
            "tuning_word = 134217728",
            "tuning_word = -9223372036854775808",
        ),
        ("phase_bits = 32", "phase_bits = 64"),
        ("table_address_bits = 12", "table_address_bits = 16"),
        ("initial_raw = 67108864", "initial_raw = 134213632"),
        ("table = \"Q1.15\"", "table = \"Q1.39\""),
        ("[114923930, ", "[2147483647, "),
        (
            "rate_full_scale_dps = 2048.0",
            "rate_full_scale_dps = 0.0078125",
        ),
        ("seed = 20040024", "seed = 18446744073709551615"),
        ("order = \"by_record\"", "order = 0"),
        ("step_k = 5.0", "step_k = 70"),
    ] {
        parse(&mutated(old, new), None).unwrap_or_else(|e| panic!("{new}: {e}"));
    }
    // Widths whose values are beyond 64 bits.
    let d = parse(
        "[compensation]\ninput = \"phase\"\ncoefficients_raw = [18446744073709551615]\n\
         coefficient_format = \"UQ64.0\"\naccumulator = \"UQ64.0\"\nrate_full_scale_dps = 1\n\
         output = \"Q16.8\"\n",
        None,
    );
    assert_eq!(
        d.unwrap().compensation.unwrap().coefficients_raw,
        [i128::from(u64::MAX)]
    );
}
