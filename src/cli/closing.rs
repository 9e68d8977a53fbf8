//! What `gyrogen close` prints: the causes with their parameters, the verdict, the errors, the comparison.

mod figures;

use crate::selftest::controls::Controls;
use crate::statistics::blocks::Role;
use crate::statistics::stats;
use crate::text::number;
use crate::thermal::close::Closed;
use crate::thermal::effects::covariate::of_another_axis;
use crate::thermal::firmware::emitted::Emitted;
use crate::thermal::search::declared;
use crate::verdict::{Closure, Verdict};
use figures::{errors, held_out, no_gain, of_capture, small_and_left};
use std::collections::BTreeSet;
use std::path::Path;

/// What the terminal says of a record's closing that is not in `closure.json`.
pub(super) struct Said {
    /// The fitted polynomial in the thermometer, as an equation.
    polynomial: String,
    /// What each cause adds to the rate output.
    equations: Vec<String>,
    /// The column that tells the temperature.
    thermometer: String,
    /// Whether the record has a column besides this one, time and output.
    has_others: bool,
    /// What the readings are before anything is subtracted, and the rms of the rows that judge, deg/s.
    as_read: (&'static str, f64),
    /// What a constant leaves of them, deg/s rms.
    constant_rms_dps: f64,
    /// How many these are.
    judging: usize,
    /// Part of the rows that judge, and part that choose.
    roles: [f64; 2],
}

impl Said {
    /// Of a closing.
    pub(super) fn of(closed: &Closed) -> Self {
        let c = &closed.channels;
        let terms = closed.after.terms.iter();
        let roles = &closed.split.roles;
        let share = |role: Role| {
            roles.iter().filter(|r| **r == role).count() as f64 / roles.len().max(1) as f64
        };
        let judging = closed.split.judging();
        let rows = c.error_dps.iter().zip(&judging).zip(&closed.accidents);
        let rows =
            rows.filter(|((e, judging), accident)| **judging && !**accident && e.is_finite());
        let as_read: Vec<f64> = rows.map(|((error, _), _)| *error).collect();
        let powers: Vec<f64> = closed
            .after
            .beta
            .iter()
            .copied()
            .take(declared(c).len())
            .collect();
        Said {
            polynomial: polynomial(&powers, &c.thermometer, [c.centre, c.half]),
            equations: terms.map(|t| t.candidate.equation(c, &t.point)).collect(),
            thermometer: c.thermometer.clone(),
            has_others: c.columns.keys().any(|name| name != "time_s"),
            as_read: match c.column("rate_dps") {
                Some(_) => ("as read less rate_dps", stats::rms(&as_read)),
                None => ("as read", stats::rms(&as_read)),
            },
            constant_rms_dps: closed.constant_rms_dps,
            judging: as_read.len(),
            roles: [Role::Judge, Role::Choose].map(share),
        }
    }

    /// How far a held-out rms is off by chance, as a share: the standard deviation of the rms of so many independent values of a normal
    /// law.
    fn chance(&self) -> f64 {
        1.0 / (2.0 * self.judging.max(1) as f64).sqrt()
    }

    /// Whether an equation has the temperature in it.
    fn has_temperature(&self) -> bool {
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let mut words = self.equations.iter().flat_map(|e| e.split(|c| !is_word(c)));
        words.any(|word| word == "T")
    }
}

/// A polynomial in the scaled reading of a thermometer, deg/s.
fn polynomial(coefficients: &[f64], thermometer: &str, [centre, half]: [f64; 2]) -> String {
    let [constant, powers @ ..] = coefficients else {
        return String::new();
    };
    let signed = |value: f64| match value < 0.0 {
        true => format!("- {}", number(-value, 5)),
        false => format!("+ {}", number(value, 5)),
    };
    let mut out = number(*constant, 5);
    for (k, c) in powers.iter().enumerate() {
        out += &format!(" {} u", signed(*c));
        if k > 0 {
            out += &format!("^{}", k + 1);
        }
    }
    out += " deg/s";
    if !powers.is_empty() {
        out += &format!(
            "; u = ({thermometer} {}) / {}",
            signed(-centre),
            number(half, 5)
        );
    }
    out
}

/// Prints a closure; `out` is where its files are.
pub(super) fn print(
    c: &Closure,
    said: Option<&Said>,
    compared: Option<&Emitted>,
    controls: Option<&Controls>,
    out: &Path,
) {
    if !c.steps.is_empty() {
        causes(c);
    }
    if let Some(said) = said {
        contributions(c, said);
    }
    say!("{}", sentence(c, said.is_none_or(|said| said.has_others)));
    say!("{}", errors(c, said));
    if let Some(told) = said.and_then(|said| small_and_left(c, said)) {
        say!("{told}");
    }
    if c.unit != "deg/s" {
        say!("{}", of_capture(c));
    } else if let Some(rms) = c.firmware.heldout_rms {
        say!(
            "firmware's model, bit for bit{}: held-out rms {rms:.5} {}",
            match compared {
                None => " (--verify compiles and compares)",
                Some(_) => "",
            },
            c.unit_text()
        );
        if let Some(told) = said.and_then(|said| no_gain(c, said)) {
            say!("{told}");
        }
    } else {
        say!("no firmware was written: the warnings say why");
    }
    say!("{}", held_out(said));
    if let Some(compared) = compared {
        super::terminal::show(&super::comparison_table(&compared.functions));
        say!("emitted C and Rust: {}", compared.sentence());
    }
    if let Some(controls) = controls {
        super::controls::print(controls);
    }
    let mut next = vec!["report.html"];
    if c.firmware.compensable && c.unit == "deg/s" {
        next.extend(["design.toml", "firmware/c", "firmware/rust"]);
    }
    super::common::wrote(out, &next);
}

/// The causes: a table, and what its signs and names say.
fn causes(c: &Closure) {
    super::terminal::show(&table(c));
    let deviations = c.steps.iter().flat_map(|s| s.parameter_std.values());
    if deviations.into_iter().any(|std| *std > 0.0) {
        say!("+-: one standard deviation");
    }
    say!("p: the probability that noise alone lets the best of all effects do as well");
    if has_rivals(c) {
        let tells_apart = c.steps.iter().any(|s| s.separating_experiment.is_some());
        say!(
            "cannot be told from: one of these effects in place of the cause fits the measurement about as well, so that the cause may \
             be any one of them{}",
            match tells_apart {
                true => ". report.html names the experiment that tells them apart",
                false => "",
            }
        );
    }
    covariates(c);
}

/// What the polynomial and each cause add to the output.
fn contributions(c: &Closure, said: &Said) {
    say!(
        "what is in rate_out_dps{}:",
        match c.firmware.compensable {
            true => ", and firmware subtracts",
            false => "",
        }
    );
    say!("  polynomial: {}", said.polynomial);
    for (step, equation) in c.steps.iter().zip(&said.equations) {
        say!("  {}: {equation}", step.effect);
    }
    if said.has_temperature() {
        say!("T: the temperature, degC, that {} tells", said.thermometer);
    }
}

/// Whether a cause has a rival that the record cannot tell it from.
fn has_rivals(c: &Closure) -> bool {
    c.steps.iter().any(|s| !s.indistinguishable_from.is_empty())
}

/// A row for each cause.
fn table(c: &Closure) -> comfy_table::Table {
    // A cause that another effect explains as well is told with its rivals; mostly there are none.
    let rivals = has_rivals(c);
    let mut headers = vec!["cause", "parameters", "held-out rms", "p"];
    // In two lines: beside long parameters the table keeps to 100 columns.
    headers.extend(rivals.then_some("cannot be\ntold from"));
    let mut table = super::terminal::table(&headers);
    for s in &c.steps {
        let parameters = s.parameters.iter().map(|(name, v)| {
            let std = s.parameter_std.get(name).copied().unwrap_or(0.0);
            format!("{name} = {}", with_deviation(*v, std))
        });
        let mut row = vec![
            s.effect.clone(),
            parameters.collect::<Vec<_>>().join("\n"),
            format!("{:.5}", s.heldout_rms),
            match s.p_value < NO_CHANCE {
                true => "< 1e-12".to_owned(),
                false => number(s.p_value, 2),
            },
        ];
        row.extend(rivals.then(|| s.indistinguishable_from.join("\n")));
        table.add_row(row);
    }
    table
}

/// What the name of an effect says that is a column of the record, where one is among the causes and their rivals.
fn covariates(c: &Closure) {
    let named = c
        .steps
        .iter()
        .flat_map(|s| std::iter::once(&s.effect).chain(&s.indistinguishable_from));
    let columns: BTreeSet<&str> = named
        .filter_map(|id| id.strip_prefix("covariate:"))
        .collect();
    for column in columns {
        let meaning =
            of_another_axis(column).map_or(String::new(), |meaning| format!(": {meaning}"));
        say!(
            "covariate:{column}: the output follows the record's column {column} by a smooth curve. No mechanism is known{meaning}. The \
             evidence is under this name in closure.json and report.html."
        );
    }
}

/// Below it a chance's digits say nothing: the noise's law is not known so far out.
const NO_CHANCE: f64 = 1e-12;

/// A number with as many places as its standard deviation has at two digits.
fn with_deviation(value: f64, std: f64) -> String {
    if !(std > 0.0 && std.is_finite()) {
        return format!("{value:.4}");
    }
    let places = (1.0 - std.log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.places$} +- {std:.places$}")
}

/// The verdict in a sentence; `has_others` is whether the measurement has a column beside the output that is neither its thermometer
/// nor time.
fn sentence(c: &Closure, has_others: bool) -> String {
    let names: Vec<&str> = c.steps.iter().map(|s| s.effect.as_str()).collect();
    let channel = c.residual_structure.strongest_channel.as_deref();
    let channel = match (c.loops_in(), channel) {
        (_, None) => String::new(),
        // Of one column nothing is the most.
        (None, Some("time_s")) => "; it depends most on time_s".to_owned(),
        (None, Some(_)) if !has_others => String::new(),
        (None, Some(channel)) => format!("; it depends most on {channel}"),
        (Some(thermometer), Some("time_s")) => {
            format!("; it depends on the direction of {thermometer}'s change, or on time_s")
        }
        (Some(thermometer), Some(channel)) if channel != thermometer => format!(
            "; it depends most on {channel}, and on the direction of {thermometer}'s change"
        ),
        (Some(thermometer), Some(_)) => {
            format!("; it depends on the direction of {thermometer}'s change")
        }
    };
    // A formula in the columns of a row has no past.
    let formula = match c.loops_in() {
        Some(_) => "",
        None => "; a cause that you suspect is tried as a formula in [[effects]] of the design",
    };
    match c.verdict {
        Verdict::Complete => "complete: nothing beyond noise is left".to_owned(),
        Verdict::Explained => format!("explained by {}", names.join(", ")),
        Verdict::PartlyExplained => {
            format!(
                "partly explained by {}; an error is left that is more than noise{channel}",
                names.join(", ")
            )
        }
        Verdict::Unexplained => {
            let what = format!("unexplained: an error is left that no known effect makes{channel}");
            let only = match c.firmware.compensable {
                true => " The firmware subtracts the polynomial alone.",
                false => "",
            };
            match c.unit {
                "deg/s" => format!("{what}.{only} report.html says what to measure next{formula}"),
                _ => what,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Said, polynomial, sentence, table, with_deviation};
    use crate::record::Warning;
    use crate::verdict::{Closure, Errors, FirmwareErrors, SCHEMA, Step, Structure, Verdict};
    use std::collections::BTreeMap;

    pub(super) fn of_roles(roles: [f64; 2], judging: usize) -> Said {
        Said {
            polynomial: String::new(),
            equations: Vec::new(),
            thermometer: "die_degc".to_owned(),
            has_others: false,
            as_read: ("as read", 1.55),
            constant_rms_dps: 1.5,
            judging,
            roles,
        }
    }

    pub(super) fn closure(unit: &'static str, steps: usize) -> Closure {
        let errors = |heldout_rms| Errors {
            heldout_rms,
            ..Errors::default()
        };
        let step = Step {
            effect: "thermal_lag".to_owned(),
            channels: Vec::new(),
            parameters: BTreeMap::new(),
            parameter_std: BTreeMap::new(),
            heldout_rms: 0.02,
            p_value: 1e-9,
            selection_frequency: 1.0,
            indistinguishable_from: Vec::new(),
            separating_experiment: None,
        };
        Closure {
            schema: SCHEMA,
            version: "0",
            design_sha256: String::new(),
            command: String::new(),
            verdict: Verdict::of(steps, true),
            unit,
            noise_floor_rms: 0.01,
            before: errors(0.5),
            steps: vec![step; steps],
            after: errors(if steps > 0 { 0.02 } else { 0.5 }),
            firmware: FirmwareErrors {
                compensable: true,
                ..FirmwareErrors::default()
            },
            residual_structure: Structure {
                left: true,
                strongest_channel: Some("die_degc".to_owned()),
            },
            evidence: Vec::new(),
            warnings: Vec::new(),
        }
    }

    #[test]
    fn what_is_unexplained_says_what_firmware_does_and_what_helps() {
        let said = sentence(&closure("deg/s", 0), true);
        for part in [
            "no known effect makes; it depends most on die_degc.",
            "subtracts the polynomial alone",
            "[[effects]]",
        ] {
            assert!(said.contains(part), "{said}");
        }
        assert!(!sentence(&closure("lsb", 0), true).contains("polynomial"));
        // One column is not more than others.
        let alone = sentence(&closure("deg/s", 0), false);
        assert!(alone.contains("no known effect makes. "), "{alone}");
    }

    #[test]
    fn where_heating_and_cooling_differ_the_direction_is_named_and_no_formula() {
        let mut both = closure("deg/s", 0);
        let found = Warning::on("heating_cooling_loop", "die_degc", String::new());
        both.warnings.push(found);
        let direction = "depends on the direction of die_degc's change";
        for (channel, tail) in [("die_degc", "."), ("time_s", ", or on time_s.")] {
            both.residual_structure.strongest_channel = Some(channel.to_owned());
            let said = sentence(&both, false);
            assert!(said.contains(&format!("; it {direction}{tail}")), "{said}");
            assert!(
                !said.contains("[[effects]]") && !said.contains("depends most"),
                "{said}"
            );
        }
        both.residual_structure.strongest_channel = Some("supply_v".to_owned());
        let said = sentence(&both, true);
        assert!(
            said.contains("most on supply_v, and on the direction of die_degc's change"),
            "{said}"
        );
        both.warnings.clear();
        assert!(!sentence(&both, true).contains("direction"));
    }

    #[test]
    fn rivals_stand_under_what_they_are() {
        let mut c = closure("deg/s", 1);
        assert!(!table(&c).to_string().contains("told from"));
        c.steps[0].indistinguishable_from = vec!["ageing_drift".to_owned()];
        let told = table(&c).to_string();
        assert!(
            told.contains("cannot be") && told.contains("told from"),
            "{told}"
        );
    }

    #[test]
    fn the_polynomial_is_an_equation_in_the_thermometer() {
        assert_eq!(
            polynomial(&[120.25, -80.02, 13.507], "phase_rad", [-1.8187, 0.3141]),
            "120.25 - 80.020 u + 13.507 u^2 deg/s; u = (phase_rad + 1.8187) / 0.31410"
        );
        assert_eq!(polynomial(&[0.5], "die_degc", [25.0, 1.0]), "0.50000 deg/s");
    }

    #[test]
    fn the_temperature_of_an_equation_is_told_from_other_words() {
        let has = |equation: &str| {
            let said = Said {
                equations: vec![equation.to_owned()],
                ..of_roles([0.0, 0.2], 10)
            };
            said.has_temperature()
        };
        assert!(has("gain (T - T_l)") && has("x = (T - center) / half width"));
        assert!(!has("a Tilt of T_l") && !has("f(supply_v)"));
    }

    #[test]
    fn a_number_has_the_places_that_its_deviation_has() {
        assert_eq!(with_deviation(-0.486_91, 0.004_26), "-0.4869 +- 0.0043");
        assert_eq!(with_deviation(11_062.14, 222.5), "11062 +- 222");
        assert_eq!(
            with_deviation(0.001_942_3, 1.3e-6),
            "0.0019423 +- 0.0000013"
        );
        assert_eq!(with_deviation(2.5, 0.0), "2.5000");
    }
}
