//! Random fitted polynomials under random bounds: what is certified, what is run, what is written and read again.

use super::*;
use crate::approx::draws::Draws;
use crate::approx::form::stored::{Read, Stored};
use crate::compensation::certainty::certainty;
use crate::design::{ChannelInput, Fitted, Outside, reader};
use crate::job::fitted_design;
use crate::numeric::format::Rounding;
use crate::thermal::BaselineFit;

/// A fit of a die's temperature, in a word of 14 bits, by a polynomial of a random order.
fn random(seed: u64) -> Design {
    let mut design = reader::read(None).expect("the default");
    let draws = Draws::new(seed);
    let c = design.compensation.as_mut().expect("a compensation");
    let order = draws.whole(0, 1, 5) as usize;
    c.input = CompensationInput::Channel(ChannelInput {
        column: "die_degc".into(),
        format: Format::q(8, 6),
        offset_raw: draws.whole(6, -500, 500).into(),
        scale_bits: 13,
        rate_format: Format::q(12, 16),
    });
    c.rate_full_scale_dps = 1.0;
    c.coefficient_format = Format::q(12, draws.whole(1, 2, 8) as u32);
    c.accumulator.format = Format::q(15, c.coefficient_format.fraction_bits + 1);
    c.output.format = Format::q(13, draws.whole(2, 8, 14) as u32);
    let fitted: Vec<f64> = (0..=order as u64)
        .map(|k| 600.0 * (draws.uniform(10 + k) - 0.5))
        .collect();
    let lsb = c.coefficient_format.lsb();
    c.coefficients_raw = fitted.iter().map(|v| (v / lsb).round() as i128).collect();
    let low = draws.whole(7, -8192, 2000);
    c.clamp_raw = Some((low.into(), draws.whole(8, low + 1000, 8191).into()));
    c.fitted = Some(Fitted {
        coefficients_dps: fitted,
        std_max_dps: 0.0,
        heldout_rms_dps: 0.0,
        loop_rms_dps: None,
    });
    let auto = !seed.is_multiple_of(3);
    let targets = [Target::Host, Target::CortexM0, Target::CortexM4];
    design.bound = Some(BiasBound {
        bound_dps: c.output.format.lsb() * (1.3 + 300.0 * draws.uniform(9).powi(3)),
        auto,
        target: targets[(seed % 3) as usize],
    });
    design.compensation_is_own = false;
    design
}

/// Of a fit, only what the thermometer's half step needs: a flat one.
fn flat() -> BaselineFit {
    let record = "time_s,die_degc,rate_out_dps\n".to_owned()
        + &(0..60)
            .map(|k| format!("{k},{},{}\n", k, 1e-6 * f64::from(k % 7)))
            .collect::<String>();
    let record = crate::record::thermal::parse(
        record.as_bytes(),
        std::path::Path::new("record.csv"),
        &Default::default(),
    );
    let (record, _) = record.expect("a record");
    let options = reader::read(None).expect("the default").fit;
    crate::thermal::fit(&record, &Default::default(), &options).expect("a fit")
}

#[test]
fn what_is_kept_is_certified_and_no_word_is_beyond_it() {
    let fit = flat();
    let (mut raised, mut forms) = (0, std::collections::BTreeSet::new());
    for seed in 0..30 {
        let mut design = random(seed);
        let asked = design.bound.unwrap();
        let (kept, said) = keep(&mut design, &fit)
            .unwrap_or_else(|e| panic!("seed {seed}: {e}"))
            .unwrap();
        raised += usize::from(!said.is_empty());
        let c = design.compensation.as_ref().unwrap();
        forms.insert(c.form.as_ref().map_or("horner", kind));
        let half_lsb = 0.5 * c.output.format.lsb();
        let found = certainty(&design).unwrap().unwrap();
        assert!(
            found.exhaustive && !found.saturates,
            "seed {seed}: {found:?}"
        );
        assert!(found.exhaustive_max_dps <= found.bounds.certified_max_dps);
        assert!(found.bounds.certified_max_dps <= asked.bound_dps - half_lsb);
        assert!(kept.covered_dps <= asked.bound_dps, "seed {seed}: {kept:?}");
        let chosen: Vec<&Line> = kept.alternatives.iter().filter(|l| l.chosen).collect();
        assert_eq!(chosen.len(), 1);
        let apart = chosen[0].certified_max_dps / found.bounds.certified_max_dps - 1.0;
        assert!(apart.abs() < 1e-9, "seed {seed}: {apart:e}");
        // By a loop of its own over the words, against the fitted polynomial.
        let evaluation = Evaluation::new(&design.circuit, c);
        let wanted = &c.fitted.as_ref().unwrap().coefficients_dps;
        let (low, high) = c.clamp_raw.unwrap();
        let largest = (low..=high)
            .map(|word| {
                let p = evaluation.variable(word);
                let value = wanted.iter().rev().fold(0.0, |t, a| t * p + a);
                (evaluation.bias_dps(word) - value).abs()
            })
            .fold(0.0, f64::max);
        assert!((largest - found.exhaustive_max_dps).abs() < 1e-9);
        // Each alternative keeps to it too.
        for line in &kept.alternatives {
            let covered = line.certified_max_dps + kept.rate_rounding_dps;
            assert!(covered <= asked.bound_dps, "seed {seed}: {line:?}");
        }
        // The design file that is written is the same design.
        let text = fitted_design::text(&design);
        let back = reader::parse(&text, None).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        assert_eq!(back.compensation, design.compensation, "seed {seed}");
        assert_eq!(back.bound, design.bound);
    }
    println!("{raised} of 30 raised; {forms:?}");
    assert!(raised > 5, "{raised}");
    assert!(forms.len() > 2, "{forms:?}");
}

fn kind(form: &Stored) -> &'static str {
    match form {
        Stored::Polynomial { .. } => "polynomial",
        Stored::Tables { read, .. } => match read {
            Read::Table(_) => "table",
            Read::Bipartite(_) => "bipartite",
            Read::Piecewise => "piecewise",
        },
    }
}

/// Every kind of form is the same function after it was written and read: word by word.
#[test]
fn every_alternative_survives_its_text() {
    let mut seen = std::collections::BTreeSet::new();
    for seed in 0..12 {
        let design = random(seed);
        let c = design.compensation.as_ref().unwrap();
        let bound = 40.0 * c.output.format.lsb();
        let ways = alternatives::forms(&design, c, bound, Target::Host).unwrap();
        assert!(!ways.is_empty(), "seed {seed}");
        for way in ways {
            let stored = way.form.unwrap();
            seen.insert(kind(&stored));
            let mut with = design.clone();
            with.compensation.as_mut().unwrap().form = Some(stored.clone());
            let back = reader::parse(&fitted_design::text(&with), None).unwrap();
            let (a, b) = (with.compensation.unwrap(), back.compensation.unwrap());
            assert_eq!(a, b);
            let of = |c| Evaluation::new(&design.circuit, c);
            let (first, last) = of(&a).words();
            let at = a.codes(&design.circuit);
            let settled = stored.settle(at, a.output.format).unwrap();
            let offset = a.variable_scale(&design.circuit).0;
            for word in (first..=last).step_by(37) {
                let value = of(&b).bias_dps(word);
                assert_eq!(value, of(&a).bias_dps(word));
                let raw = settled.run(word - offset);
                assert_eq!(value, raw as f64 * a.output.format.lsb());
            }
        }
    }
    assert_eq!(seen.len(), 4, "{seen:?}");
}

/// An entry that is off by more than the bound allows is seen; one LSB is `verify`'s affair (`tests/all/bias_bound.rs`).
#[test]
fn damage_of_a_stored_form_shows() {
    let fit = flat();
    let mut damaged = 0;
    for seed in 0..20 {
        let mut design = random(seed);
        keep(&mut design, &fit).unwrap();
        let before = certainty(&design).unwrap().unwrap();
        let c = design.compensation.as_mut().unwrap();
        let Some(Stored::Tables { entries, .. }) = &mut c.form else {
            continue;
        };
        let step = (8.0 * before.bounds.certified_max_dps / c.output.format.lsb()).ceil() as i64;
        let middle = entries[0].len() / 2;
        entries[0][middle] += step * 64;
        damaged += 1;
        let after = certainty(&design).unwrap().unwrap();
        assert!(
            after.exhaustive_max_dps > design.bound.unwrap().bound_dps,
            "seed {seed}"
        );
    }
    assert!(damaged > 3, "{damaged}");
}

#[test]
fn what_cannot_be_kept_is_refused_with_what_would_do() {
    let fit = flat();
    let refusal = |change: &dyn Fn(&mut Design)| {
        let mut design = random(3);
        design.bound = Some(BiasBound {
            bound_dps: 0.01,
            auto: false,
            target: Target::Host,
        });
        let c = design.compensation.as_mut().unwrap();
        c.output.format = Format::q(13, 10);
        change(&mut design);
        match keep(&mut design, &fit) {
            Ok(kept) => panic!("kept: {kept:?}"),
            Err(e) => e.to_string(),
        }
    };
    let own = refusal(&|d| d.compensation_is_own = true);
    assert!(
        own.contains("these would do: `coefficient_format = \"Q12."),
        "{own}"
    );
    let output = refusal(&|d| {
        d.compensation.as_mut().unwrap().output.format = Format::q(13, 6);
        d.compensation_is_own = true;
    });
    assert!(
        output.contains("rounding bias and rate to Q13.6"),
        "{output}"
    );
    assert!(output.contains("at least 7 fraction bits"), "{output}");
    // Formats that were chosen are nothing to change in a file.
    let chosen = refusal(&|d| {
        d.compensation.as_mut().unwrap().output.format = Format::q(13, 6);
        d.compensation_is_own = false;
    });
    assert!(
        chosen.contains("write `bound_dps = 0.032` or more"),
        "{chosen}"
    );
    let rounding = refusal(&|d| {
        d.bound.as_mut().unwrap().auto = true;
        d.compensation.as_mut().unwrap().output.rounding = Rounding::HalfEven;
    });
    assert!(
        rounding.contains("round half up and saturate"),
        "{rounding}"
    );
    let slope = refusal(&|d| {
        d.bound.as_mut().unwrap().auto = true;
        d.compensation.as_mut().unwrap().outside = Outside::HoldSlope;
    });
    assert!(slope.contains("no slope to hold"), "{slope}");
    let coarse = refusal(&|d| {
        // Steep: half a degree is half a deg/s.
        d.bound.as_mut().unwrap().bound_dps = 1e-9;
    });
    assert!(coarse.contains("cannot be kept"), "{coarse}");
    // What was proposed does.
    let needed = own.split("\"Q12.").nth(1).and_then(|t| t.split('"').next());
    let fine: u32 = needed.unwrap().parse().unwrap();
    let accumulator = own
        .split("with \"Q15.")
        .nth(1)
        .and_then(|t| t.split('"').next());
    let wide: u32 = accumulator.unwrap().parse().unwrap();
    let mut design = random(3);
    let c = design.compensation.as_mut().unwrap();
    let lsb = Format::q(12, fine).lsb();
    c.output.format = Format::q(13, 10);
    c.coefficient_format = Format::q(12, fine);
    c.accumulator.format = Format::q(15, wide);
    let exact = c.fitted.clone().unwrap().coefficients_dps;
    c.coefficients_raw = exact.iter().map(|v| (v / lsb).round() as i128).collect();
    design.compensation_is_own = true;
    design.bound.as_mut().unwrap().bound_dps = 0.01;
    design.bound.as_mut().unwrap().auto = false;
    keep(&mut design, &fit).unwrap();
}
