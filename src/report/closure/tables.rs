//! A closure in words and tables.

use super::view::View;
use crate::report::text::{fixed, grouped, minus, significant, trimmed};
use crate::statistics::blocks::Role;
use crate::statistics::stats;
use crate::thermal::close::Closed;
use crate::thermal::effects::Sheet;
use crate::verdict::{Closure, Errors, Fate, Step, Verdict};

/// A step as the page shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct TakenStep {
    /// Its id.
    pub effect: String,
    /// What happens, in a sentence.
    pub physics: String,
    /// The contribution to the output.
    pub equation: String,
    /// Columns that it needs.
    pub channels: String,
    /// Name, value with deviation, unit, plausible magnitudes.
    pub parameters: Vec<[String; 4]>,
    /// With this and all steps before it.
    pub heldout_rms: String,
    /// Family-wise.
    pub p_value: String,
    /// Of the record's halves.
    pub frequency: String,
    /// What does as well.
    pub rivals: Vec<String>,
    /// What tells them apart; empty without rivals.
    pub experiment: String,
}

/// A candidate as the page shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// Its id.
    pub effect: String,
    /// Class of its fate.
    pub class: &'static str,
    /// Its fate.
    pub fate: &'static str,
    /// Family-wise, before any step.
    pub p_value: String,
    /// Of log-likelihood.
    pub gain: String,
    /// Why.
    pub remark: String,
}

/// Noise floors from which on a held-out error is more than white noise.
const SLOW: f64 = 2.0;

/// A figure of error with three digits.
pub fn value(of: f64) -> String {
    significant(of, 3)
}

/// A probability.
pub fn probability(p: f64) -> String {
    if p <= 1e-300 {
        return "below 10⁻³⁰⁰".to_owned();
    }
    significant(p, 2)
}

/// Ids as words in a sentence: "a", "a and b", "a, b and c".
fn listed<S: AsRef<str>>(names: &[S], last: &str) -> String {
    match names {
        [] => String::new(),
        [one] => one.as_ref().to_owned(),
        [head @ .., tail] => {
            let head: Vec<&str> = head.iter().map(AsRef::as_ref).collect();
            format!("{} {last} {}", head.join(", "), tail.as_ref())
        }
    }
}

/// A step's name, with its rivals.
fn named(step: &Step) -> String {
    if step.indistinguishable_from.is_empty() {
        return step.effect.clone();
    }
    let rivals = listed(&step.indistinguishable_from, "or");
    format!("{} (or {rivals})", step.effect)
}

/// What the causes are found beside: a record is fitted by a polynomial, the carriers of a capture are declared.
pub fn base(c: &Closure) -> &'static str {
    match c.unit {
        "lsb" => "declared model",
        _ => "polynomial",
    }
}

/// The verdict with its figures, in a sentence.
pub fn headline(c: &Closure) -> String {
    let names: Vec<String> = c.steps.iter().map(named).collect();
    let (before, after) = (value(c.before.heldout_rms), value(c.after.heldout_rms));
    let change = if c.after.heldout_rms <= c.before.heldout_rms {
        "falls"
    } else {
        "rises"
    };
    let (unit, base) = (c.unit_text(), base(c));
    let change = if before == after {
        format!("the held-out error stays at {after} {unit} rms")
    } else {
        format!("the held-out error {change} from {before} to {after} {unit} rms")
    };
    match c.verdict {
        Verdict::Complete => format!(
            "Complete: the {base} leaves {before} {unit} rms on held-out rows, and nothing in it beyond noise."
        ),
        Verdict::Explained => format!("Explained by {}: {change}.", listed(&names, "and")),
        Verdict::PartlyExplained => format!(
            "Partly explained by {}: {change}, and structure is left.",
            listed(&names, "and")
        ),
        Verdict::Unexplained => format!(
            "Unexplained: the {base} leaves {before} {unit} rms on held-out rows, with structure that no named effect \
             accounts for."
        ),
    }
}

/// What follows from it.
pub fn finding(view: &View) -> String {
    let c = &view.closed.closure;
    let mut out = format!(
        "The noise floor is {} {} rms.",
        value(c.noise_floor_rms),
        c.unit_text()
    );
    if !c.residual_structure.left && c.after.heldout_rms > SLOW * c.noise_floor_rms {
        let rows = view.after.iter().zip(view.closed.split.judging());
        let held: Vec<f64> = rows.filter(|(_, h)| *h).map(|(r, _)| *r).collect();
        out += if stats::robust_std(&held) > 0.75 * SLOW * c.noise_floor_rms {
            " What the held-out error has beyond it is slow noise (1/f or a walk), which no model of the channels removes."
        } else {
            " What the held-out error has beyond it is due to a few readings that stand out."
        };
    }
    out + &next(c)
}

/// Where to look next: the channel of what is left, and the experiments that tell steps from their rivals. Each
/// sentence begins with a space.
pub fn next(c: &Closure) -> String {
    let mut out = String::new();
    if let Some(channel) = &c.residual_structure.strongest_channel {
        out += &format!(" What is left shows most in {channel}.");
        if let Some(thermometer) = c.loops_in() {
            out += &match channel == "time_s" {
                true => format!(
                    " As heating and cooling differ, it may hang on the past of {thermometer} rather than on time."
                ),
                false => format!(
                    " As heating and cooling differ, it depends on the direction of {thermometer}'s change."
                ),
            };
        }
    }
    for step in &c.steps {
        if let Some(experiment) = &step.separating_experiment {
            out += &format!(" To tell {} from its rivals: {experiment}.", step.effect);
        }
    }
    out
}

/// The table of errors.
pub fn errors(c: &Closure) -> Vec<[String; 5]> {
    let share = |rms: f64| {
        let ratio = rms / c.noise_floor_rms;
        if ratio.is_finite() {
            significant(ratio, 3)
        } else {
            "–".to_owned()
        }
    };
    let row = |name: &str, e: &Errors| {
        [
            name.to_owned(),
            value(e.train_rms),
            value(e.heldout_rms),
            value(e.heldout_max_abs),
            share(e.heldout_rms),
        ]
    };
    let mut out = vec![row(&format!("{} alone", base(c)), &c.before)];
    if !c.steps.is_empty() {
        out.push(row("with the causes", &c.after));
    }
    if let Some(rms) = c.firmware.heldout_rms {
        out.push([
            "the firmware, bit-accurate".to_owned(),
            "–".to_owned(),
            value(rms),
            c.firmware.heldout_max_abs.map_or("–".to_owned(), value),
            share(rms),
        ]);
    }
    out
}

/// Whether firmware could do it.
pub fn firmware(c: &Closure) -> String {
    let compensable = if c.firmware.compensable {
        "Firmware sees all that the polynomial and the causes need."
    } else {
        "No firmware was written: the warnings say why."
    };
    compensable.to_owned()
}

/// The unit that a parameter's name carries.
fn unit(name: &str) -> &'static str {
    const SUFFIXES: [(&str, &str); 17] = [
        ("_dps_per_efold", "deg/s a factor e"),
        ("_dps_per_g2", "deg/s/g²"),
        ("_dps_per_g", "deg/s/g"),
        ("_dps_per_h", "deg/s/h"),
        ("_dps_per_k", "deg/s/K"),
        ("_dps_per_v", "deg/s/V"),
        ("_dps_s_per_k", "deg/s per K/s"),
        ("_rad_per_k", "rad/K"),
        ("_ppm_per_k", "ppm/K"),
        ("_dps", "deg/s"),
        ("_ppm", "ppm"),
        ("_rad", "rad"),
        ("_degc", "degC"),
        ("_hz", "Hz"),
        ("_k", "K"),
        ("_s", "s"),
        ("_lsb", "LSB"),
    ];
    SUFFIXES
        .iter()
        .find(|(suffix, _)| name.ends_with(suffix))
        .map_or("", |(_, unit)| unit)
}

/// A value with as many decimals as its deviation has in two digits.
pub fn with_deviation(value: f64, std: f64) -> String {
    if std.is_nan() || std <= 0.0 || !value.is_finite() {
        return trimmed(&significant(value, 4));
    }
    let decimals = 1 - std.log10().floor() as i32;
    if (0..=7).contains(&decimals) && value.abs() < 1e6 {
        let decimals = decimals as usize;
        return format!("{} ± {}", fixed(value, decimals), fixed(std, decimals));
    }
    format!("{} ± {}", significant(value, 4), significant(std, 2))
}

/// Magnitudes that such a gyro has, for a parameter of the sheet.
fn plausible(sheet: &Sheet, name: &str) -> String {
    let of = sheet.parameters.iter().find(|p| p.name == name);
    of.map_or(String::new(), |p| {
        let (low, high) = p.plausible;
        format!("{} to {}", round(low), round(high))
    })
}

/// A bound of the catalogue, without digits that mean nothing.
fn round(bound: f64) -> String {
    if bound.abs() >= 1e4 {
        return minus(&format!(
            "{}{}",
            if bound < 0.0 { "-" } else { "" },
            grouped(bound.abs() as u64)
        ));
    }
    if bound != 0.0 && bound.abs() < 1e-3 {
        return significant(bound, 1);
    }
    minus(&format!("{bound}"))
}

/// The steps in their order.
pub fn steps(closed: &Closed) -> Vec<TakenStep> {
    let pairs = closed.closure.steps.iter().zip(&closed.after.terms);
    pairs
        .map(|(step, term)| {
            let sheet = term.candidate.sheet();
            let parameter = |(name, value): (&String, &f64)| {
                let std = step.parameter_std.get(name).copied().unwrap_or(0.0);
                [
                    name.clone(),
                    with_deviation(*value, std),
                    term.candidate
                        .unit(name)
                        .unwrap_or_else(|| unit(name).to_owned()),
                    plausible(sheet, name),
                ]
            };
            TakenStep {
                effect: step.effect.clone(),
                physics: term.candidate.physics(),
                equation: term.candidate.equation(&closed.channels, &term.point),
                channels: step.channels.join(", "),
                parameters: step.parameters.iter().map(parameter).collect(),
                heldout_rms: value(step.heldout_rms),
                p_value: probability(step.p_value),
                frequency: format!("{}\u{202f}%", fixed(100.0 * step.selection_frequency, 0)),
                rivals: step.indistinguishable_from.clone(),
                experiment: step.separating_experiment.clone().unwrap_or_default(),
            }
        })
        .collect()
}

/// All candidates: taken, confounded, rejected, not excited, without channel.
pub fn evidence(c: &Closure) -> Vec<Told> {
    let rank = |fate: Fate| match fate {
        Fate::Taken => (0, "good", "taken"),
        Fate::Confounded => (1, "note", "confounded"),
        Fate::Rejected => (2, "", "rejected"),
        Fate::NotExcited => (3, "soft", "not excited"),
        Fate::NoChannel => (4, "soft", "no channel"),
    };
    let mut sorted: Vec<_> = c.evidence.iter().collect();
    // Stable: within a fate the order is the search's own, the best first.
    sorted.sort_by_key(|e| rank(e.fate).0);
    sorted
        .into_iter()
        .map(|e| {
            let (_, class, fate) = rank(e.fate);
            Told {
                effect: e.effect.clone(),
                class,
                fate,
                p_value: e.p_value.map_or("–".to_owned(), probability),
                gain: e.gain.map_or("–".to_owned(), |g| fixed(g, 1)),
                // The JSON has steps, a reader causes.
                remark: match e.remark.strip_prefix("a step") {
                    Some(rest) if e.fate == Fate::Taken => format!("a cause{rest}"),
                    _ => e.remark.clone(),
                },
            }
        })
        .collect()
}

/// Where it comes from.
pub fn provenance(closed: &Closed) -> Vec<[String; 2]> {
    let c = &closed.closure;
    let count = |role| closed.split.roles.iter().filter(|r| **r == role).count();
    let [fit, choose, judge] =
        [Role::Fit, Role::Choose, Role::Judge].map(|role| grouped(count(role) as u64));
    let held_out = match closed.split.roles.contains(&Role::Judge) {
        true => {
            format!(
                "{fit} for the fit, {choose} for the choice of causes, {judge} held out for the error"
            )
        }
        false => format!(
            "{fit} for the fit, {choose} held out for the choice of causes and for the error: too few to keep these apart"
        ),
    };
    let noise = &closed.after.fit.noise;
    let strengths = format!(
        "white {} deg/s a row, 1/f {} deg/s, walk {} deg/s/√s",
        significant(noise.white_rms_dps, 3),
        significant(noise.flicker_dps, 3),
        significant(noise.walk_dps_rts, 3)
    );
    [
        ("command", c.command.clone()),
        ("version", c.version.to_owned()),
        ("SHA-256 of the design as read", c.design_sha256.clone()),
        (
            "rows",
            format!("{} rows: {held_out}", grouped(closed.channels.len() as u64)),
        ),
        ("thermometer", closed.channels.thermometer.clone()),
        ("noise beside the causes", strengths),
    ]
    .map(|(name, value)| [name.to_owned(), value])
    .to_vec()
}
