//! The tables about the fit, its coefficients and the formats.

use super::Shown;
use super::page::{Alternative, Order};
use super::text::{bounding, grouped, minus, significant, superscript, trimmed};
use crate::design::CompensationInput;

/// The fit: name, value.
pub fn fit(shown: &Shown) -> Vec<[String; 2]> {
    let f = shown.fit;
    let unit = f.unit;
    let outside = if shown.is_clamped() {
        "nothing was measured there; what the firmware does, and how far from the continued polynomial that \
         may be, is said below the budget"
    } else {
        "the firmware does not limit its input, so the polynomial extrapolates; how large the worst \
         error is there is unknown"
    };
    let dps = |v: f64| format!("{} deg/s", significant(v, 4));
    let line = |name: &str, value: String| [name.to_owned(), value];
    let mut lines = vec![
        line("thermometer", format!("{} ({unit})", f.thermometer)),
        line(
            "calibrated range",
            format!(
                "{} to {} {unit}",
                trimmed(&significant(f.range.0, 7)),
                trimmed(&significant(f.range.1, 7))
            ),
        ),
        line("outside this range", outside.to_owned()),
        line("order", f.order.to_string()),
        line("reason", f.reason.clone()),
        line("rms over the fitted rows", dps(f.in_sample_rms_dps)),
        line(
            "rms over held-out blocks",
            format!("{} ({} blocks)", dps(f.heldout_rms_dps), f.blocks.len()),
        ),
        line("largest held-out error", dps(f.heldout_max_abs_dps)),
        line("noise floor of the output, rms", dps(f.noise_floor_rms_dps)),
        line("largest sigma of the fitted curve", dps(f.std_max_dps())),
        line(
            "rows fitted",
            format!(
                "{}, of which {} stand out as spikes and hardly count",
                grouped(f.rows.len() as u64),
                f.outliers.len()
            ),
        ),
    ];
    if let Some(l) = f.sweep_loop {
        lines.push(line(
            "heating against cooling",
            format!(
                "they differ by {} rms at the same reading; noise with the rms and autocorrelation of the residuals would \
                 make {} rms: {}",
                dps(l.rms_dps),
                dps(l.noise_dps),
                l.finding(f.noise_floor_rms_dps)
            ),
        ));
    }
    lines
}

/// The forms that keep to the design's bound.
pub fn alternatives(shown: &Shown) -> Vec<Alternative> {
    let Some(kept) = &shown.summary.bound else {
        return Vec::new();
    };
    let line = |l: &crate::job::bound::Line| Alternative {
        detail: l.detail.clone(),
        numbers: [
            grouped(l.cost.rom_bytes),
            l.cost.multiplies.to_string(),
            l.cost.adds.to_string(),
            l.cost.cycles.to_string(),
            bounding(l.certified_max_dps, 4),
            bounding(l.certified_max_lsb, 4),
        ],
        chosen: l.chosen,
        mark: match (l.chosen, l.undominated) {
            (true, _) => "chosen",
            (false, true) => "not beaten",
            (false, false) => "",
        },
    };
    kept.alternatives.iter().map(line).collect()
}

/// The orders that were tried.
pub fn orders(shown: &Shown) -> Vec<Order> {
    let trials = shown.fit.orders_tried.iter();
    trials
        .map(|t| Order {
            order: t.order,
            used: t.order == shown.fit.order,
            rms: [
                t.in_sample_rms_dps,
                t.heldout_rms_dps,
                t.heldout_clean_rms_dps,
            ]
            .map(|v| significant(v, 4)),
        })
        .collect()
}

/// The firmware's variable in words.
pub fn variable(shown: &Shown) -> String {
    match shown.design.compensation.as_ref().map(|c| &c.input) {
        Some(CompensationInput::Phase) => "the drive phase in half turns, −1 to 1".to_owned(),
        Some(CompensationInput::TuningWord(t)) => format!(
            "(steps − {}) · 2{}, steps = what the phase loop adds to the tuning word",
            t.offset_raw,
            superscript(-(t.scale_bits as i32))
        ),
        Some(CompensationInput::Channel(channel)) => format!(
            "(raw − {}) · 2{}, raw = the word of {} in {}",
            channel.offset_raw,
            superscript(-(channel.scale_bits as i32)),
            channel.column,
            channel.format
        ),
        None => "–".to_owned(),
    }
}

/// Order, physical, of the variable, raw, rounding error.
pub fn coefficients(shown: &Shown) -> Vec<[String; 5]> {
    let format = shown
        .design
        .compensation
        .as_ref()
        .map(|c| c.coefficient_format);
    let lsb = format.map_or(f64::NAN, |f| f.lsb());
    let raw = &shown.summary.fit.coefficients_raw;
    let count = shown.fit.coefficients.len();
    (0..count)
        .map(|k| {
            let exact = shown.rounded.exact.get(k).copied().unwrap_or(f64::NAN);
            let word = raw.get(k);
            let error = word.map_or(f64::NAN, |w| *w as f64 * lsb - exact);
            [
                k.to_string(),
                significant(shown.fit.coefficients[k], 8),
                significant(exact, 9),
                word.map_or("–".to_owned(), |w| minus(&w.to_string())),
                significant(error, 2),
            ]
        })
        .collect()
}

/// Formats of the compensation: name, value.
pub fn formats(shown: &Shown) -> Vec<[String; 2]> {
    let Some(c) = &shown.design.compensation else {
        return Vec::new();
    };
    let line = |name: &str, value: String| [name.to_owned(), value];
    let mut lines = match &c.input {
        CompensationInput::Phase => {
            let bits = shown.design.circuit.cordic.angle_bits;
            vec![line(
                "input: drive phase",
                format!("signed {bits} bits, a full turn"),
            )]
        }
        CompensationInput::TuningWord(_) => {
            let step = crate::job::coefficients::tuning_step_hz(&shown.design.circuit);
            vec![line(
                "input: tuning word",
                format!("a step is {} Hz", significant(step, 4)),
            )]
        }
        CompensationInput::Channel(channel) => vec![
            line(
                "input: thermometer",
                format!(
                    "{}, LSB {} {}",
                    channel.format,
                    significant(channel.format.lsb(), 4),
                    shown.fit.unit
                ),
            ),
            line(
                "input: rate",
                format!(
                    "{}, LSB {} deg/s",
                    channel.rate_format,
                    significant(channel.rate_format.lsb() * c.rate_full_scale_dps, 4)
                ),
            ),
        ],
    };
    let word = |format: crate::numeric::format::Format| {
        format!("{format}, LSB {} deg/s", significant(format.lsb(), 4))
    };
    lines.extend([
        line("coefficients", word(c.coefficient_format)),
        line("accumulator", word(c.accumulator.format)),
        line("output: bias and rate", word(c.output.format)),
    ]);
    if c.input.is_of_chain() {
        lines.push(line(
            "input: rate",
            format!("sense I times {} deg/s", c.rate_full_scale_dps),
        ));
    }
    if let Some(kept) = shown.summary.bound.as_ref().filter(|_| c.form.is_some()) {
        lines.push(line(
            "evaluated, instead of the polynomial, by",
            kept.chosen.clone(),
        ));
    }
    if let Some((low, high)) = c.clamp_raw {
        lines.push(line(
            "input limited to (raw)",
            minus(&format!("{low} .. {high}")),
        ));
    }
    lines
}
