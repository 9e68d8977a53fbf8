//! The design with the fitted compensation as a design file of its own: what reproduces the firmware.

use crate::correction::Planned;
use crate::design::bound::evaluation_text;
use crate::design::target::Target;
use crate::design::{BiasBound, Compensation, CompensationInput, Design, Outside};
use crate::numeric::format::Quantizer;
use std::fmt::Write as _;

/// Stands above a compensation that was fitted.
const FITTED: &str = "# Fitted; the calibrated range is clamp_raw.";

/// Stands above a correction that was found.
const CORRECTED: &str = "\
# The correction of averaged readings that `close` found, in real numbers; `emit` chooses the words.
# Each term is subtracted from the rate, deg/s. An input is (column - offset) / scale, held within
# -1 to 1; terms name it by its position, from 0.
# kept = \"yes\": the lag goes on through a restart, as the gyro's temperature does; \"no\": it begins
# anew at power-on. once = \"yes\": a step that has come on stays on.";

/// The text of the user's design (or of the default) with its `[compensation]` replaced by the one
/// that was fitted.
pub fn text(design: &Design) -> String {
    let mut text = without(&design.source.text, "compensation");
    if let Some(c) = &design.compensation {
        text = text
            .trim_end()
            .trim_end_matches(FITTED)
            .trim_end()
            .to_owned();
        text += &format!("\n\n{FITTED}\n");
        text += &compensation(c, design.bound);
    }
    text
}

/// The text of the user's design (or of the default) with a correction: the augmented model as a design file.
pub fn with_correction(design: &Design, planned: &Planned) -> String {
    let text = without(&design.source.text, "correction");
    let text = text.trim_end().trim_end_matches(CORRECTED).trim_end();
    format!("{text}\n\n{CORRECTED}\n{}", planned.to_toml())
}

/// Cuts a table, and its subtables, out of a design's text.
fn without(text: &str, table: &str) -> String {
    let mut kept = String::new();
    let mut inside = false;
    for line in text.lines() {
        let start = line.trim_start();
        if start.starts_with('[') {
            let name = start.trim_start_matches('[').trim_start();
            let rest = name.strip_prefix(table);
            let ends = |r: &str| r.trim_start().starts_with([']', '.']);
            inside = rest.is_some_and(ends);
        }
        if !inside {
            kept += line;
            kept.push('\n');
        }
    }
    kept
}

fn compensation(c: &Compensation, bound: Option<BiasBound>) -> String {
    let mut text = String::from("[compensation]\n");
    match &c.input {
        CompensationInput::Phase => text += "input = \"phase\"\n",
        CompensationInput::TuningWord(t) => {
            text += "input = \"tuning_word\"\n";
            _ = writeln!(text, "input_offset_raw = {}", t.offset_raw);
            _ = writeln!(text, "input_scale_bits = {}", t.scale_bits);
        }
        CompensationInput::Channel(channel) => {
            _ = writeln!(text, "input = \"{}\"", channel.column);
            _ = writeln!(text, "input_format = \"{}\"", channel.format);
            _ = writeln!(text, "input_offset_raw = {}", channel.offset_raw);
            _ = writeln!(text, "input_scale_bits = {}", channel.scale_bits);
            _ = writeln!(text, "rate_input_format = \"{}\"", channel.rate_format);
        }
    }
    _ = writeln!(text, "coefficients_raw = {:?}", c.coefficients_raw);
    _ = writeln!(text, "coefficient_format = \"{}\"", c.coefficient_format);
    _ = writeln!(text, "accumulator = {}", quantizer(c.accumulator));
    _ = writeln!(text, "rate_full_scale_dps = {:?}", c.rate_full_scale_dps);
    _ = writeln!(text, "output = {}", quantizer(c.output));
    if let Some((low, high)) = c.clamp_raw {
        _ = writeln!(text, "clamp_raw = [{low}, {high}]");
    }
    if c.outside != Outside::Clamp {
        _ = writeln!(text, "outside = \"{}\"", c.outside.name());
    }
    if let Some(bound) = bound {
        _ = writeln!(text, "bound_dps = {:?}", bound.bound_dps);
        if bound.auto {
            text += "form = \"auto\"\n";
        }
        if bound.target != Target::default() {
            _ = writeln!(text, "target = \"{}\"", bound.target.name());
        }
    }
    if let Some(form) = &c.form {
        text += "\n# The form that stands for the polynomial.\n";
        text += &evaluation_text(form);
    }
    if let Some(fitted) = &c.fitted {
        text += "\n# The fit before its coefficients were put into their format; for the error budget.\n";
        text += "[compensation.fitted]\n";
        _ = writeln!(text, "coefficients_dps = {:?}", fitted.coefficients_dps);
        _ = writeln!(text, "std_max_dps = {:?}", fitted.std_max_dps);
        _ = writeln!(text, "heldout_rms_dps = {:?}", fitted.heldout_rms_dps);
        if let Some(rms) = fitted.loop_rms_dps {
            _ = writeln!(text, "loop_rms_dps = {rms:?}");
        }
    }
    text
}

fn quantizer(q: Quantizer) -> String {
    format!(
        "{{ format = \"{}\", rounding = \"{}\", overflow = \"{}\" }}",
        q.format,
        q.rounding.name(),
        q.overflow.name()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{ChannelInput, Fitted, reader};
    use crate::numeric::format::Format;

    #[test]
    fn a_fitted_design_reads_back_as_itself() {
        let mut design = reader::read(None).expect("the default");
        let mut inputs = vec![CompensationInput::Phase];
        inputs.push(CompensationInput::Channel(ChannelInput {
            column: "die_degc".into(),
            format: Format::q(8, 8),
            offset_raw: 11674,
            scale_bits: 13,
            rate_format: Format::q(4, 28),
        }));
        for input in inputs {
            if let Some(c) = &mut design.compensation {
                c.input = input;
                c.coefficients_raw = vec![1, -2, 3, -4];
                c.clamp_raw = Some((-5, 6));
                c.outside = Outside::Flag;
                c.fitted = Some(Fitted {
                    coefficients_dps: vec![1.5, -0.1, 1e-300, 4e9],
                    std_max_dps: 0.0,
                    heldout_rms_dps: 0.25,
                    loop_rms_dps: Some(0.125),
                });
            }
            let back = reader::parse(&text(&design), None).expect("a design");
            assert_eq!(back.compensation, design.compensation);
            assert_eq!(back.circuit, design.circuit);
        }
    }

    #[test]
    fn a_correction_is_explained_once_however_often_it_is_replaced() {
        let toml = "[correction]\nperiod_s = 1.0\nfull_scale_dps = 250.0\nnoise_dps = 0.01\n\
                    inputs = [{ column = \"die_degc\", offset = 25.0, scale = 60.0 }]\n\
                    terms = [{ kind = \"lag\", gain_dps = 1.0, input = 0, tau_s = 30.0, kept = \"no\" }]\n";
        let mut design = reader::parse(toml, None).expect("a design");
        let planned = design.correction.clone().expect("a correction");
        for _ in 0..2 {
            let text = with_correction(&design, &planned);
            assert_eq!(
                text.matches("the lag goes on through a restart").count(),
                1,
                "{text}"
            );
            design = reader::parse(&text, None).expect("a design");
            assert_eq!(design.correction.as_ref(), Some(&planned));
        }
    }

    #[test]
    fn a_small_design_gets_the_table_appended() {
        let mut design = reader::parse("[fit]\norder = 3\n", None).expect("a design");
        design.compensation_is_own = true;
        let back = reader::parse(&text(&design), None).expect("a design");
        assert_eq!(back.compensation, design.compensation);
        assert_eq!(back.fit, design.fit);
    }
}
