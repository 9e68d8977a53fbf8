//! A correction in sentences: what the head of its emitted sources says.

use super::plan::{Input, Plan, Term, in_words};
use super::run::Correction;
use crate::text::{at_most, constant, number};

/// The plan and its words, a line each: how it is called, its inputs, its terms, its bound.
pub fn facts(correction: &Correction) -> Vec<String> {
    let (plan, formats) = (&correction.plan, &correction.formats);
    let mut facts = called(plan);
    facts.push(format!(
        "rate {} deg/s in and out, sum of the terms on 2^-{} deg/s, for a white noise of {} deg/s rms in a reading",
        formats.rate,
        formats.sum_fraction_bits,
        number(formats.noise_dps, 3)
    ));
    let inputs = plan.inputs.iter().zip(&formats.inputs);
    let names = plan.input_names();
    facts.extend(inputs.zip(&names).map(|((input, format), name)| {
        format!(
            "{name} = {}, {format}, rounded; {}",
            input.formula(),
            calibrated(input)
        )
    }));
    let mut said = Said {
        names: &names,
        curves: 0,
    };
    facts.extend(plan.terms.iter().map(|t| said.sentence(t)));
    facts.extend(outlasting(plan));
    let relay = match plan.terms.iter().any(|t| matches!(t, Term::Step { .. })) {
        true => " and no step switches at another reading",
        false => "",
    };
    facts.push(format!(
        "at most {} deg/s from these terms in real numbers (analysis), where no word saturates{relay}",
        at_most(correction.bound_dps(), 3)));
    facts.extend(correction.heldout_rms_dps.map(|rms| {
        format!(
            "held-out error {} deg/s rms: what this firmware leaves of readings of its record that its coefficients have not seen",
            number(rms, 3)
        )
    }));
    facts
}

/// The range of a column that its input holds, in the column's unit.
fn calibrated(input: &Input) -> String {
    let (middle, half) = (input.offset, input.scale.abs());
    let (low, high) = (constant(middle - half, 7), constant(middle + half, 7));
    let column = &input.column;
    format!("calibrated for {column} {low} .. {high}, beyond which it is held at the nearer end")
}

/// How it is called: which readings it takes, and what to do after a gap.
fn called(plan: &Plan) -> Vec<String> {
    let period = in_words(plan.period_s);
    let mut said = vec![format!(
        "correction of readings: one call a reading, every {period} s. It was found in a record with one row per {period} s: give it \
         one reading per {period} s, made as those rows were (averaged over the same time, or taken as it is)"
    )];
    // Without a memory the number of calls changes nothing.
    said.push(match plan.terms.iter().any(Term::remembers) {
        true => format!(
            "it has a memory, which counts calls. After a gap of k periods of {period} s call it k times with the new reading: each call \
             returns a rate, and the last one is the corrected rate of that reading; do not use those before it"
        ),
        false => "it has no memory: a missing or an extra call changes no other reading's correction".to_owned(),
    });
    said
}

/// Which members of the state are worth keeping over a power cycle, if any.
fn outlasting(plan: &Plan) -> Option<String> {
    let (mut lags, mut relays, mut members) = (0, 0, Vec::new());
    for term in &plan.terms {
        match term {
            Term::Step { once, .. } => {
                relays += 1;
                members.extend(once.then(|| format!("relay_{relays}")));
            }
            Term::Lag { kept, .. }
            | Term::LagOfCurve { kept, .. }
            | Term::CurveOfLag { kept, .. } => {
                lags += 1;
                members.extend(kept.then(|| format!("lag_{lags}, lag_input_{lags}")));
            }
            _ => {}
        }
    }
    members.extend(plan.keeps().then(|| "started".to_owned()));
    let members = (!members.is_empty()).then(|| members.join(", "))?;
    Some(format!(
        "worth keeping over a power cycle, of the state: {members}"
    ))
}

/// The inputs' names, and how many tables of curves there are so far.
struct Said<'a> {
    names: &'a [&'static str],
    curves: usize,
}

impl Said<'_> {
    fn name(&self, input: usize) -> &'static str {
        self.names.get(input).copied().unwrap_or_default()
    }

    /// A term.
    fn sentence(&mut self, term: &Term) -> String {
        match term {
            Term::ScaleBy { .. } | Term::Cubic { .. } | Term::Even { .. } => {
                format!("error on the rate r: {}", self.on_rate(term))
            }
            _ => format!("subtracted: {}", self.on_bias(term)),
        }
    }

    /// What a term on the bias subtracts, deg/s.
    fn on_bias(&mut self, term: &Term) -> String {
        match term {
            Term::Product { gain_dps, factors } => {
                let powers = factors.iter().map(|(input, power)| match power {
                    1 => format!(" * {}", self.name(*input)),
                    _ => format!(" * {}^{power}", self.name(*input)),
                });
                format!(
                    "{gain_dps} deg/s{}",
                    powers.collect::<String>(),
                    gain_dps = in_words(*gain_dps)
                )
            }
            Term::Lag {
                gain_dps,
                input,
                tau_s,
                kept,
            } => {
                let x = self.name(*input);
                format!(
                    "{gain_dps} deg/s * ({x} - y), y = {x} after {}",
                    lag(*tau_s, *kept),
                    gain_dps = in_words(*gain_dps)
                )
            }
            Term::LagOfCurve {
                gain_dps,
                input,
                values,
                tau_s,
                kept,
            } => format!(
                "{gain_dps} deg/s * (c - y), c = {}, y = c after {}",
                self.curve(*input, values),
                lag(*tau_s, *kept),
                gain_dps = in_words(*gain_dps)
            ),
            Term::CurveOfLag {
                gain_dps,
                input,
                values,
                tau_s,
                kept,
            } => {
                let x = self.name(*input);
                format!(
                    "{gain_dps} deg/s * (c({x}) - c(y)), c = {}, y = {x} after {}",
                    self.curve(*input, values),
                    lag(*tau_s, *kept),
                    gain_dps = in_words(*gain_dps)
                )
            }
            Term::Slope {
                gain_dps_s,
                input,
                rows,
            } => format!(
                "{gain_dps_s} deg/s per 1/s * slope of {} over the last {rows} readings",
                self.name(*input),
                gain_dps_s = in_words(*gain_dps_s)
            ),
            Term::Decay { gain_dps, tau_s } => {
                format!(
                    "{gain_dps} deg/s * exp(-t / {tau_s} s), t since power-on",
                    gain_dps = in_words(*gain_dps),
                    tau_s = in_words(*tau_s)
                )
            }
            Term::Curve { input, values_dps } => {
                format!("{}, deg/s", self.curve(*input, values_dps))
            }
            Term::Step { .. } => self.step(term),
            // On the rate, not on the bias.
            Term::ScaleBy { .. } | Term::Cubic { .. } | Term::Even { .. } => self.on_rate(term),
        }
    }

    fn step(&self, term: &Term) -> String {
        let Term::Step {
            gain_dps,
            input,
            centre,
            gap,
            once,
        } = term
        else {
            return String::new();
        };
        let (x, on, off) = (self.name(*input), centre + gap / 2.0, centre - gap / 2.0);
        match once {
            true => format!(
                "{gain_dps} deg/s from the first {x} >= {on} on, never off again",
                gain_dps = in_words(*gain_dps),
                on = in_words(on)
            ),
            false => format!(
                "{gain_dps} deg/s while on: on from {x} >= {on}, off below {off}; at power-on, on from {centre}",
                gain_dps = in_words(*gain_dps),
                on = in_words(on),
                off = in_words(off),
                centre = in_words(*centre)
            ),
        }
    }

    /// The next curve: its table holds the knots.
    fn curve(&mut self, input: usize, values: &[f64]) -> String {
        self.curves += 1;
        format!(
            "the line through the {} knots of table curve_{} over {}",
            values.len(),
            self.curves,
            self.name(input)
        )
    }

    /// The error that a term has on the rate r, deg/s.
    fn on_rate(&self, term: &Term) -> String {
        match term {
            Term::ScaleBy { input, s0, s1, s2 } => match input.map(|k| self.name(k)) {
                Some(x) if *s2 == 0.0 => {
                    format!("r * ({s0}{s1} * {x})", s0 = in_words(*s0), s1 = added(*s1))
                }
                Some(x) => format!(
                    "r * ({s0}{s1} * {x}{s2} * {x}^2)",
                    s0 = in_words(*s0),
                    s1 = added(*s1),
                    s2 = added(*s2)
                ),
                None => format!("r * {s0}", s0 = in_words(*s0)),
            },
            Term::Cubic { ppm, rate_max_dps } => {
                format!(
                    "{ppm} ppm * r * (r / {rate_max_dps} deg/s)^2",
                    ppm = in_words(*ppm),
                    rate_max_dps = in_words(*rate_max_dps)
                )
            }
            Term::Even { ppm, absolute, .. } if *absolute => {
                format!("{ppm} ppm * abs(r)", ppm = in_words(*ppm))
            }
            Term::Even {
                ppm, rate_max_dps, ..
            } => format!(
                "{ppm} ppm * r^2 / {rate_max_dps} deg/s",
                ppm = in_words(*ppm),
                rate_max_dps = in_words(*rate_max_dps)
            ),
            _ => String::new(),
        }
    }
}

fn lag(tau_s: f64, kept: bool) -> String {
    let kept = if kept {
        ", which a restart does not reset"
    } else {
        ""
    };
    format!(
        "a first-order lag of {tau_s} s{kept}",
        tau_s = in_words(tau_s)
    )
}

/// A constant in a sum, with its sign.
fn added(value: f64) -> String {
    let sign = if value < 0.0 { '-' } else { '+' };
    format!(" {sign} {}", in_words(value.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correction::sample::plan;

    /// The head of a random correction is in words: no braces, brackets or `Some` of a data structure, every
    /// input by its name in the sources, and as many curves as there are tables.
    #[test]
    fn the_head_is_in_words_whatever_the_terms() {
        let mut kinds = std::collections::BTreeSet::new();
        for seed in 0..60u64 {
            let plan = plan(3000 + seed, 1 + seed as usize % 8, true);
            kinds.extend(plan.terms.iter().map(Term::kind));
            let correction = Correction::auto(&plan).unwrap();
            let facts = facts(&correction);
            for line in &facts {
                for debris in [
                    "{", "}", "[", "Some", "None", "_dps:", "- (-", "false", "true",
                ] {
                    assert!(!line.contains(debris), "{debris} in: {line}");
                }
            }
            let head = facts.join("\n");
            for name in plan.input_names() {
                assert!(head.contains(name), "{name} missing in: {head}");
            }
            let outlast = |t: &Term| t.is_kept() || matches!(t, Term::Step { once: true, .. });
            let remembers = plan.terms.iter().any(Term::remembers);
            assert_eq!(head.contains("After a gap of k"), remembers, "{head}");
            assert_eq!(head.contains("it has no memory"), !remembers, "{head}");
            let told = head.contains("worth keeping over a power cycle");
            assert_eq!(told, plan.terms.iter().any(outlast), "{head}");
            let tables = correction.trace().tables.len();
            let told = |n: usize| head.contains(&format!("table curve_{n} "));
            assert!((1..=tables).all(told) && !told(tables + 1), "{head}");
        }
        assert_eq!(kinds.len(), 11, "{kinds:?}");
    }

    #[test]
    fn an_input_says_its_range_in_its_own_unit() {
        let input = |scale| Input {
            column: "die_degc".to_owned(),
            offset: 27.505,
            scale,
        };
        let said =
            "calibrated for die_degc -15.03 .. 70.04, beyond which it is held at the nearer end";
        assert_eq!(calibrated(&input(42.535)), said);
        assert_eq!(calibrated(&input(-42.535)), said);
    }

    #[test]
    fn every_term_reads_as_its_equation() {
        let mut of_terms = Said {
            names: &["die_temperature", "supply_voltage", "drive_gain"],
            curves: 0,
        };
        let mut said = |term| of_terms.sentence(&term);
        let product = |gain_dps, factors| Term::Product { gain_dps, factors };
        assert_eq!(said(product(1.5, vec![])), "subtracted: 1.5 deg/s");
        assert_eq!(
            said(product(-2.0, vec![(0, 1), (2, 3)])),
            "subtracted: -2 deg/s * die_temperature * drive_gain^3"
        );
        let values_dps = vec![0.0, 1.0, 0.5];
        assert_eq!(
            said(Term::Curve {
                input: 1,
                values_dps
            }),
            "subtracted: the line through the 3 knots of table curve_1 over supply_voltage, deg/s"
        );
        let step = |once| Term::Step {
            gain_dps: 0.25,
            input: 0,
            centre: 0.5,
            gap: 0.5,
            once,
        };
        assert_eq!(
            said(step(false)),
            "subtracted: 0.25 deg/s while on: on from die_temperature >= 0.75, off below 0.25; at power-on, on from 0.5"
        );
        let scale = |input, s2| Term::ScaleBy {
            input,
            s0: 1e-3,
            s1: 0.5,
            s2,
        };
        assert_eq!(said(scale(None, 0.0)), "error on the rate r: r * 0.001");
        assert_eq!(
            said(scale(Some(0), 0.0)),
            "error on the rate r: r * (0.001 + 0.5 * die_temperature)"
        );
        assert_eq!(
            said(scale(Some(0), -0.25)),
            "error on the rate r: r * (0.001 + 0.5 * die_temperature - 0.25 * die_temperature^2)"
        );
    }
}
