//! The design file of a point: the user's own text with the changed values in it, comments and order kept.

use crate::design::template::DEFAULT;
use crate::design::{CompensationInput, Design, reader};
use crate::numeric::format::Quantizer;
use toml_edit::{DocumentMut, Item, Value};

/// The text of `given` with the values of `point`.
///
/// # Errors
/// Why there is no such text, in words.
pub fn text(given: &Design, point: &Design) -> Result<String, String> {
    let mut text = given.source.text.clone();
    let parsed = |t: &str| t.parse::<DocumentMut>().map_err(|e| e.to_string());
    let mut doc = parsed(&text)?;
    if !doc.contains_key("circuit") {
        // Such a file takes the default's circuit, and its compensation unless it has its own.
        let mut tables = vec!["circuit"];
        if !doc.contains_key("compensation") && given.compensation.is_some() {
            tables.push("compensation");
        }
        text = text.trim_end().to_owned();
        for table in tables {
            text += "\n\n";
            text += section(DEFAULT, table).trim_end();
        }
        text.push('\n');
        doc = parsed(&text)?;
    }
    for (key, value) in changes(given, point) {
        set(&mut doc, &key, value);
    }
    let text = doc.to_string();
    let back = reader::parse(&text, None).map_err(|e| e.to_string())?;
    let same = back.circuit == point.circuit
        && back.compensation == point.compensation
        && back.gyro == point.gyro
        && back.thermal_run == point.thermal_run;
    same.then_some(text)
        .ok_or_else(|| "its design file would read back as another design".to_owned())
}

/// The lines of a table and of those inside it.
fn section(text: &str, table: &str) -> String {
    let mut kept = String::new();
    let mut inside = false;
    for line in text.lines() {
        if let Some(name) = line.trim_start().strip_prefix('[') {
            let rest = name.strip_prefix(table);
            inside = rest.is_some_and(|r| r.starts_with([']', '.']));
        }
        // Commented tables would come to stand inside of another one; only their lines are comments anyway.
        if inside && !line.starts_with("# ----") {
            kept += line;
            kept.push('\n');
        }
    }
    kept
}

/// Keys with another value, dotted; a quantiser's is its format.
pub fn changes(given: &Design, point: &Design) -> Vec<(String, Value)> {
    let (before, after) = (values(given), values(point));
    let changed = after.into_iter().zip(before);
    changed
        .filter(|((_, new), (_, old))| new.to_string() != old.to_string())
        .map(|(new, _)| new)
        .collect()
}

fn values(design: &Design) -> Vec<(String, Value)> {
    let mut out: Vec<(String, Value)> = Vec::new();
    let mut put = |key: &str, value: Value| out.push((key.to_owned(), value));
    let c = &design.circuit;
    let format = |q: &Quantizer| Value::from(q.format.to_string());
    let integer = |v: i64| Value::from(v);
    let bits = |v: u32| Value::from(i64::from(v));
    put("circuit.adc.format", c.adc.format.to_string().into());
    put("circuit.nco.phase_bits", bits(c.nco.phase_bits));
    put("circuit.nco.tuning_word", integer(c.nco.tuning_word));
    put(
        "circuit.nco.table_address_bits",
        bits(c.nco.table_address_bits),
    );
    put("circuit.nco.table", c.nco.table.to_string().into());
    put(
        "circuit.demodulator.product",
        format(&c.demodulator.product),
    );
    put("circuit.decimator.output", format(&c.decimator.output));
    put("circuit.cordic.iterations", bits(c.cordic.iterations));
    put("circuit.cordic.guard_bits", bits(c.cordic.guard_bits));
    put("circuit.cordic.width", bits(c.cordic.width));
    put("circuit.cordic.angle_bits", bits(c.cordic.angle_bits));
    put("circuit.cordic.gain_bits", bits(c.cordic.gain_bits));
    if let Some(l) = &c.phase_loop {
        put("circuit.phase_loop.setpoint_raw", integer(l.setpoint_raw));
        put(
            "circuit.phase_loop.proportional.raw",
            integer(l.proportional.raw),
        );
        put(
            "circuit.phase_loop.proportional.shift",
            bits(l.proportional.shift),
        );
        put("circuit.phase_loop.integral.raw", integer(l.integral.raw));
        put("circuit.phase_loop.integral.shift", bits(l.integral.shift));
        put(
            "circuit.phase_loop.integrator_bits",
            bits(l.integrator_bits),
        );
    }
    if let Some(l) = &c.amplitude_loop {
        put(
            "circuit.amplitude_loop.setpoint_raw",
            integer(l.setpoint_raw),
        );
        put("circuit.amplitude_loop.error_shift", bits(l.error_shift));
        put(
            "circuit.amplitude_loop.integrator_shift",
            bits(l.integrator_shift),
        );
        put("circuit.amplitude_loop.initial_raw", integer(l.initial_raw));
        put("circuit.amplitude_loop.gain_bits", bits(l.gain_bits));
    }
    if let Some(c) = &design.compensation {
        let wide = |v: i128| i64::try_from(v).unwrap_or(i64::MAX);
        let list = |all: &[i128]| {
            let raw = all.iter().map(|v| Value::from(wide(*v)));
            Value::Array(raw.collect())
        };
        put("compensation.coefficients_raw", list(&c.coefficients_raw));
        put(
            "compensation.coefficient_format",
            c.coefficient_format.to_string().into(),
        );
        put("compensation.accumulator", format(&c.accumulator));
        put("compensation.output", format(&c.output));
        if let Some((low, high)) = c.clamp_raw {
            put("compensation.clamp_raw", list(&[low, high]));
        }
        if let CompensationInput::TuningWord(t) = &c.input {
            put("compensation.input_offset_raw", integer(wide(t.offset_raw)));
            put("compensation.input_scale_bits", bits(t.scale_bits));
        }
    }
    put(
        "thermal_run.adc_noise_lsb",
        design.thermal_run.adc_noise_lsb.into(),
    );
    for (kind, parameters) in design.gyro.effects.iter() {
        for (parameter, value) in kind.parameters.iter().zip(parameters) {
            put(
                &format!("gyro.effects.{}.{}", kind.id, parameter.key),
                (*value).into(),
            );
        }
    }
    out
}

/// Puts a value at a dotted key; where a table with a `format` stands, at that.
fn set(doc: &mut DocumentMut, key: &str, value: Value) {
    let mut item: &mut Item = doc.as_item_mut();
    for part in key.split('.') {
        item = &mut item[part];
    }
    let is_quantizer = value.is_str() && item.as_table_like().is_some();
    if is_quantizer {
        item = &mut item["format"];
    }
    match item.as_value_mut() {
        Some(old) => {
            let decor = old.decor().clone();
            *old = value;
            *old.decor_mut() = decor;
        }
        None => *item = toml_edit::value(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::word::Word;
    use crate::study::retune::with_lengths;

    #[test]
    fn the_file_of_a_point_reads_back_with_its_comments() {
        let lengths = [
            (Word::Adc, 14),
            (Word::Product, 18),
            (Word::Decimated, 20),
            (Word::Coefficients, 28),
        ];
        for file in [
            DEFAULT.to_owned(),
            "name = \"mine\" # my gyro\n[fit]\norder = 3\n".to_owned(),
        ] {
            let given = reader::parse(&file, None).expect("a design");
            let point = with_lengths(&given, &lengths).expect("a design");
            let text = text(&given, &point).expect("a file");
            assert!(
                text.contains("format = \"Q2.16\", rounding = \"half_up\""),
                "{text}"
            );
            assert!(text.contains("adc_noise_lsb = 0.25"));
            if file.len() < 100 {
                assert!(text.contains("# my gyro") && text.contains("order = 3"));
            }
        }
    }
}
