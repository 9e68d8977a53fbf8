//! The controls of a closing in words.

use super::tables::probability;
use crate::report::text::significant;
use crate::selftest::controls::{Controls, FakeSeen, Planted};
use crate::selftest::outcome::Minimum;

/// What the page's section shows.
#[derive(Debug)]
pub struct Shown {
    /// Class, and what the fakes say.
    pub(super) negative: [String; 2],
    /// Column, spectrum of, p before any step, p beside the steps, what became of it.
    pub(super) fakes: Vec<[String; 5]>,
    /// What the planted effects say.
    pub(super) positive: String,
    /// Effect, found from, planted, the same in the own unit, named, other names.
    pub(super) planted: Vec<[String; 6]>,
}

impl Shown {
    /// Of the controls.
    pub fn of(c: &Controls) -> Self {
        let class = if c.holds { "good" } else { "bad" };
        Shown {
            negative: [class.to_owned(), negative(c)],
            fakes: c.negative.fakes.iter().map(fake).collect(),
            positive: positive(c),
            planted: c.positive.iter().map(planted).collect(),
        }
    }
}

/// What the fakes say, in a sentence or two.
pub fn negative(c: &Controls) -> String {
    let n = &c.negative;
    let (named, count) = (n.named, n.fakes.len());
    let listed = match n.listed {
        0 => String::new(),
        listed => format!(
            ", {listed} listed as indistinguishable (so regular is this record that its spectrum alone nearly makes \
             the effect)"
        ),
    };
    let p = |p: Option<f64>| p.map_or("–".to_owned(), probability);
    let least = p(n.least_p_value);
    let steps: Vec<String> = n
        .steps
        .iter()
        .map(|(effect, p)| format!("{effect} {}", probability(*p)))
        .collect();
    let beside = if steps.is_empty() {
        format!("; least p among them {least}")
    } else {
        format!(
            "; least p among them {} beside the causes, {least} before any; of the causes {}",
            p(n.least_p_value_beside_steps),
            steps.join(", ")
        )
    };
    let own: Vec<&String> = n.steps.iter().map(|s| &s.0).collect();
    let with: Vec<&String> = n.steps_with_fakes.iter().collect();
    let changed = if own == with {
        String::new()
    } else if with.is_empty() {
        ". With them in, no cause is found".to_owned()
    } else {
        format!(
            ". With them in, the causes are {}",
            n.steps_with_fakes.join(", ")
        )
    };
    format!("{named} of {count} columns without meaning named{listed}{beside}{changed}.")
}

/// What the planted effects say, in a sentence or two.
pub fn positive(c: &Controls) -> String {
    if c.positive.is_empty() {
        return "No effect of the catalogue that was judged here goes without a name.".to_owned();
    }
    let tried: Vec<&Planted> = c.positive.iter().filter(|p| p.records > 0).collect();
    let (records, found): (usize, usize) = tried.iter().fold((0, 0), |(r, f), p| {
        (r + p.records, f + p.named + p.only_listed)
    });
    let missed: Vec<&str> = c
        .positive
        .iter()
        .filter(|p| 2 * (p.named + p.only_listed) <= p.records)
        .map(|p| p.effect.as_str())
        .collect();
    let silence = if missed.is_empty() {
        "that these got no name means that they are smaller than what was planted".to_owned()
    } else {
        format!("that {} got no name means nothing here", missed.join(", "))
    };
    format!("{found} of {records} planted effects found; {silence}.")
}

/// A fake's row.
pub fn fake(f: &FakeSeen) -> [String; 5] {
    let p = |p: Option<f64>| p.map_or("–".to_owned(), probability);
    let fate = match (f.is_named, f.is_listed) {
        (true, _) => "named",
        (_, true) => "listed as indistinguishable",
        _ => "not named",
    };
    [
        f.name.clone(),
        f.like.clone(),
        p(f.p_value),
        p(f.p_value_beside_steps),
        fate.to_owned(),
    ]
}

/// A planted effect's row.
pub fn planted(p: &Planted) -> [String; 6] {
    let none = || "–".to_owned();
    let least = |m: &Minimum| {
        let relation = match m.relation {
            "below" => "< ",
            "above" => "> ",
            _ => "",
        };
        format!("{relation}{}", significant(m.times_noise, 2))
    };
    let own = p.in_own_unit.map_or_else(none, |size| {
        format!("{} {}", significant(size, 2), p.own_unit)
    });
    let found = match (p.records, p.only_listed) {
        (0, _) => p.remark.clone(),
        (records, 0) => format!("{} of {records}", p.named),
        (records, listed) => format!("{} of {records}, listed in {listed}", p.named),
    };
    let wrong = p.wrong_names.iter().map(|(name, count)| match count {
        1 => name.clone(),
        count => format!("{name} ({count})"),
    });
    let wrong: Vec<String> = wrong.collect();
    [
        p.effect.clone(),
        p.detectable.as_ref().map_or_else(none, least),
        p.times_noise.map_or_else(none, |t| significant(t, 2)),
        own,
        found,
        match wrong.is_empty() {
            true => none(),
            false => wrong.join(", "),
        },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selftest::controls::Negative;

    fn controls(named: bool) -> Controls {
        let fake = FakeSeen {
            name: "fake_1".to_owned(),
            like: "a<b".to_owned(),
            is_named: named,
            is_listed: false,
            p_value: Some(0.2),
            p_value_beside_steps: None,
        };
        let steps_with_fakes = if named {
            vec!["covariate:fake_1".to_owned()]
        } else {
            vec!["thermal_lag".to_owned()]
        };
        Controls {
            holds: !named,
            negative: Negative {
                steps: vec![("thermal_lag".to_owned(), 1e-5)],
                steps_with_fakes,
                named: usize::from(named),
                listed: 0,
                least_p_value: Some(0.2),
                least_p_value_beside_steps: None,
                fakes: vec![fake],
            },
            positive: vec![Planted {
                effect: "ageing_drift".to_owned(),
                p_value: 0.5,
                detectable: None,
                times_noise: Some(2.0),
                in_own_unit: Some(0.01),
                own_unit: "dps".to_owned(),
                records: 3,
                named: if named { 0 } else { 2 },
                only_listed: 1,
                wrong_names: vec![("thermal_lag".to_owned(), 2)],
                remark: String::new(),
            }],
        }
    }

    #[test]
    fn a_fake_with_a_name_is_a_failure_and_silence_is_put_into_words() {
        let good = controls(false);
        assert_eq!(good.failure(), None);
        assert!(negative(&good).starts_with("0 of 1 columns") && !negative(&good).contains("With"));
        assert!(positive(&good).starts_with("3 of 3 planted effects found; that these"));
        let bad = controls(true);
        let failure = bad.failure().expect("a failure");
        assert!(
            failure.contains("covariate:fake_1 (spectrum of: a<b)"),
            "{failure}"
        );
        assert!(negative(&bad).contains("With them in, the causes are covariate:fake_1"));
        assert!(positive(&bad).contains("that ageing_drift got no name means nothing here"));
        assert_eq!(planted(&bad.positive[0])[4], "0 of 3, listed in 1");
        assert_eq!(planted(&bad.positive[0])[5], "thermal_lag (2)");
    }
}
