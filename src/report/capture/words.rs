//! What the page of a capture says.

use crate::capture::Closed;
use crate::capture::input::Part;
use crate::report::closure::tables::{TakenStep, next, probability, value, with_deviation};
use crate::report::text::{fixed, grouped, significant};
use crate::verdict::Closure;

/// What happens, and the equation, of an effect of the contract.
fn sheet(id: &str) -> [&'static str; 2] {
    match id {
        "adc_offset" => ["a constant is added to the code", "code = x + c"],
        "adc_gain_error" => [
            "the code is larger than declared by a factor",
            "code = (1 + g) x",
        ],
        "adc_integral_nonlinearity" => [
            "the converter's characteristic bends",
            "code = x + g(x), g of the code alone",
        ],
        "adc_missing_codes" => [
            "codes never appear; their inputs go to a neighbour",
            "count(k) = 0",
        ],
        "adc_clipping" => [
            "the code does not pass a level",
            "code = min(max(x, low), high)",
        ],
        "aperture_jitter" => [
            "each sample is taken a random time late",
            "variance = a + tau^2 (dx/dt)^2",
        ],
        "harmonic_distortion" => [
            "the tone has harmonics before it is converted",
            "code = x + sum of a_k sin(k p + phase_k)",
        ],
        "drive_feedthrough" => [
            "part of the drive is added to the sense channel",
            "sense = sense + k drive",
        ],
        "sample_latency" => ["samples are taken late", "code(t) = x(t - tau)"],
        "mains_pickup" => [
            "a line that neither the tone nor its oscillator makes",
            "code = x + a sin(2 pi f t + phase)",
        ],
        "nco_spur" => [
            "lines at places that follow from the tuning word",
            "x at the truncated phase, or lines at (1 + k 2^P) f",
        ],
        _ => ["", ""],
    }
}

/// The unit that a parameter's name carries.
fn unit(name: &str) -> &'static str {
    let units = [
        ("_codes", "LSB"),
        ("_per_sample", "per sample"),
        ("_hz", "Hz"),
        ("_samples", "samples"),
        ("_s", "s"),
    ];
    let unit = units.iter().find(|(suffix, _)| name.ends_with(suffix));
    unit.map_or("", |(_, unit)| unit)
}

/// Over the table of errors.
pub fn lead(c: &Closure) -> String {
    let firmware = if c.firmware.compensable {
        "Firmware can take all causes off by arithmetic on codes and phase."
    } else {
        "Firmware cannot take all of this off by arithmetic on codes and phase."
    };
    format!(
        "Codes less the declared tones (and less the causes), both channels together, in LSB. Held-out rows are whole \
         stretches of time that no estimate has seen. The noise floor, from the residual's spectrum, is {} LSB rms. \
         {firmware}",
        value(c.noise_floor_rms)
    )
}

/// What follows from the verdict.
pub fn finding(c: &Closure) -> String {
    let floor = value(c.noise_floor_rms);
    format!("The noise floor is {floor} LSB rms.{}", next(c))
}

/// The steps in their order.
pub fn steps(c: &Closure) -> Vec<TakenStep> {
    let told = c.steps.iter().map(|step| {
        let [physics, equation] = sheet(&step.effect);
        let parameter = |(name, value): (&String, &f64)| {
            let std = step.parameter_std.get(name).copied().unwrap_or(0.0);
            let text = with_deviation(*value, std);
            [name.clone(), text, unit(name).to_owned(), String::new()]
        };
        TakenStep {
            effect: step.effect.clone(),
            physics: physics.to_owned(),
            equation: equation.to_owned(),
            channels: step.channels.join(", "),
            parameters: step.parameters.iter().map(parameter).collect(),
            heldout_rms: value(step.heldout_rms),
            p_value: probability(step.p_value),
            frequency: format!("{}\u{202f}%", fixed(100.0 * step.selection_frequency, 0)),
            rivals: step.indistinguishable_from.clone(),
            experiment: step.separating_experiment.clone().unwrap_or_default(),
        }
    });
    told.collect()
}

/// Where it comes from. The wall time is not among it: the same capture gives the same page.
pub fn provenance(closed: &Closed) -> Vec<[String; 2]> {
    let (c, capture) = (&closed.closure, &closed.capture);
    let held = capture.segments.iter().filter(|s| s.part == Part::HeldOut);
    let held: usize = held.map(|s| s.rows.len()).sum();
    let rows = format!(
        "{}, {} of them held out",
        grouped(capture.rows() as u64),
        grouped(held as u64)
    );
    let rate = |what: f64| significant(what, 7);
    let [_, after] = &closed.findings.models;
    let turns = after.tone.folded();
    let tone = match capture.meta.fs_hz {
        Some(fs) => format!("{} Hz of {} Hz", rate(turns * fs), rate(fs)),
        None => format!("{} turns a sample", rate(turns)),
    };
    let noise = after.variance.base.map(|v| value(v.sqrt()));
    [
        ("command", c.command.clone()),
        ("version", c.version.to_owned()),
        ("design's SHA-256", c.design_sha256.clone()),
        ("rows", rows),
        ("tone and sample rate", tone),
        (
            "full scale",
            format!("{} LSB", grouped(capture.full_scale_codes as u64)),
        ),
        (
            "noise",
            format!("drive {}, sense {} LSB rms", noise[0], noise[1]),
        ),
    ]
    .map(|(name, value)| [name.to_owned(), value])
    .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::candidates::Effect;

    #[test]
    fn every_effect_has_its_words() {
        for effect in Effect::ALL {
            assert!(
                sheet(effect.id()).iter().all(|s| !s.is_empty()),
                "{effect:?}"
            );
        }
    }

    #[test]
    fn units_are_those_of_the_names() {
        let of = [
            "jitter_rms_s",
            "drive_offset_codes",
            "line1_frequency_hz",
            "relative",
        ];
        assert_eq!(of.map(unit), ["s", "LSB", "Hz", ""]);
    }
}
