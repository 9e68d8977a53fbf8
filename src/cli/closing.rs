//! What `gyrogen close` prints: the causes with their parameters, the verdict, the errors, the comparison.

use crate::selftest::controls::Controls;
use crate::statistics::blocks::Role;
use crate::text::number;
use crate::thermal::close::Closed;
use crate::thermal::effects::covariate::of_another_axis;
use crate::thermal::firmware::emitted::Emitted;
use crate::verdict::{Closure, Verdict};
use std::collections::BTreeSet;
use std::path::Path;

/// What the terminal says of a record's closing that is not in `closure.json`.
pub(super) struct Said {
    /// What each cause adds to the rate output.
    equations: Vec<String>,
    /// Part of the rows that judge, and part that choose.
    roles: [f64; 2],
}

impl Said {
    /// Of a closing.
    pub(super) fn of(closed: &Closed) -> Self {
        let terms = closed.after.terms.iter();
        let roles = &closed.split.roles;
        let share = |role: Role| {
            roles.iter().filter(|r| **r == role).count() as f64 / roles.len().max(1) as f64
        };
        Said {
            equations: terms
                .map(|t| t.candidate.equation(&closed.channels, &t.point))
                .collect(),
            roles: [Role::Judge, Role::Choose].map(share),
        }
    }
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
        causes(c, said);
    }
    say!("{}", sentence(c));
    say!(
        "held-out rms {:.5} -> {:.5} {}, noise floor {:.5}",
        c.before.heldout_rms,
        c.after.heldout_rms,
        c.unit_text(),
        c.noise_floor_rms
    );
    if let Some(rms) = c.firmware.heldout_rms {
        say!(
            "firmware's model, bit for bit{}: held-out rms {rms:.5} {}",
            if compared.is_some() {
                ""
            } else {
                " (--verify compiles and compares)"
            },
            c.unit_text()
        );
    } else if c.unit == "deg/s" {
        say!("firmware cannot carry this: the warnings say why");
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

/// The causes: a table, what its signs and names say, and what each cause adds to the output.
fn causes(c: &Closure, said: Option<&Said>) {
    super::terminal::show(&table(c));
    let deviations = c.steps.iter().flat_map(|s| s.parameter_std.values());
    if deviations.into_iter().any(|std| *std > 0.0) {
        say!("+-: one standard deviation");
    }
    covariates(c);
    let Some(said) = said else {
        return;
    };
    say!(
        "what a cause adds to rate_out_dps{}:",
        match c.firmware.compensable {
            true => ", and firmware subtracts",
            false => "",
        }
    );
    for (step, equation) in c.steps.iter().zip(&said.equations) {
        say!("  {}: {equation}", step.effect);
    }
}

/// A row for each cause.
fn table(c: &Closure) -> comfy_table::Table {
    // A cause that another effect explains as well is told with its rivals; mostly there are none.
    let rivals = c.steps.iter().any(|s| !s.indistinguishable_from.is_empty());
    let mut headers = vec!["cause", "parameters", "held-out rms", "p"];
    headers.extend(rivals.then_some("explained as well by"));
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

/// What the rows served for, and why `run` has other held-out figures: a line each.
fn held_out(said: Option<&Said>) -> String {
    let Some(Said { roles, .. }) = said else {
        return "held out: a part of the capture that no fit used".to_owned();
    };
    let [judge, choose] = roles.map(|share| (100.0 * share).round());
    let fit = 100.0 - judge - choose;
    let which = match roles[0] > 0.0 {
        true => format!(
            "rows: {fit} % for fitting, {choose} % for the choice of causes, {judge} % held out for the error."
        ),
        false => format!(
            "rows: {fit} % for fitting, {choose} % for the choice of causes. The held-out error is of these {choose} % too, as the \
             record is too short to keep others for it alone."
        ),
    };
    format!(
        "{which}\nThe held-out rms of `run` is not comparable: there each block of rows is predicted from all others."
    )
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

/// The verdict in a sentence.
fn sentence(c: &Closure) -> String {
    let names: Vec<&str> = c.steps.iter().map(|s| s.effect.as_str()).collect();
    let channel = c.residual_structure.strongest_channel.as_deref();
    let channel = channel.map_or(String::new(), |c| format!(", most of it in {c}"));
    match c.verdict {
        Verdict::Complete => "complete: nothing beyond noise is left".to_owned(),
        Verdict::Explained => format!("explained by {}", names.join(", ")),
        Verdict::PartlyExplained => {
            format!(
                "partly explained by {}; structure is left{channel}",
                names.join(", ")
            )
        }
        Verdict::Unexplained => {
            format!("unexplained: something is left that none of the known effects makes{channel}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Said, held_out, with_deviation};

    #[test]
    fn held_out_rows_are_told_apart_from_those_of_run() {
        let said = |judge, choose| {
            let said = Said {
                equations: Vec::new(),
                roles: [judge, choose],
            };
            held_out(Some(&said))
        };
        let both = said(0.06, 0.2);
        assert!(
            both.starts_with(
                "rows: 74 % for fitting, 20 % for the choice of causes, 6 % held out for the error.\n"
            ),
            "{both}"
        );
        let one = said(0.0, 0.2);
        assert!(
            one.starts_with("rows: 80 % for fitting, 20 % for the choice of causes. The held-out"),
            "{one}"
        );
        for text in [both, one] {
            assert_eq!(text.lines().count(), 2, "{text}");
        }
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
