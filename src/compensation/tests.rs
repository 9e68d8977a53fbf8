//! The bounds against the bias itself, on random polynomials in random formats.

use super::certainty::{OfRun, bounds, certainty, mend, sentences, sentences_with};
use super::{Evaluation, coefficients};
use crate::approx::draws::Draws;
use crate::design::{Design, Fitted, Outside, reader};
use crate::numeric::format::{Format, Rounding};

/// A compensation of a random order in formats between 10 and 34 bits, calibrated on a random part of 2^16 words.
fn random(seed: u64) -> Design {
    let mut design = reader::read(None).expect("the default");
    let draws = Draws::new(seed);
    design.circuit.cordic.angle_bits = 16;
    let c = design.compensation.as_mut().expect("a compensation");
    let order = draws.whole(0, 1, 4) as usize;
    let fraction_bits = draws.whole(1, 2, 20) as u32;
    c.coefficient_format = Format::q(12, fraction_bits);
    c.accumulator.format = Format::q(15, fraction_bits + draws.whole(2, 0, 8) as u32);
    c.accumulator.rounding = Rounding::ALL[draws.whole(3, 0, 5) as usize];
    c.output.format = Format::q(15, draws.whole(4, 2, 16) as u32);
    c.output.rounding = Rounding::ALL[draws.whole(5, 0, 5) as usize];
    let fitted: Vec<f64> = (0..=order as u64)
        .map(|k| 800.0 * (draws.uniform(10 + k) - 0.5))
        .collect();
    let lsb = c.coefficient_format.lsb();
    c.coefficients_raw = fitted.iter().map(|v| (v / lsb).round() as i128).collect();
    let low = draws.whole(6, -32768, 20000);
    c.clamp_raw = Some((low.into(), draws.whole(7, low + 100, 32767).into()));
    c.fitted = Some(Fitted {
        coefficients_dps: fitted,
        std_max_dps: 0.0,
        heldout_rms_dps: 0.0,
        loop_rms_dps: None,
    });
    design
}

fn evaluate(fitted: &[f64], p: f64) -> f64 {
    fitted.iter().rev().fold(0.0, |t, c| t * p + c)
}

#[test]
fn no_word_is_beyond_the_proved_bound_and_the_bound_is_near() {
    let mut ratios = Vec::new();
    for seed in 0..60 {
        let design = random(seed);
        let c = design.compensation.as_ref().unwrap();
        let found = certainty(&design).unwrap().unwrap();
        assert!(
            found.exhaustive && !found.saturates,
            "seed {seed}: {found:?}"
        );
        // By a loop of its own over the words.
        let (low, high) = c.clamp_raw.unwrap();
        let evaluation = Evaluation::new(&design.circuit, c);
        let fitted = &c.fitted.as_ref().unwrap().coefficients_dps;
        let errors = (low..=high).map(|word| {
            let wanted = evaluate(fitted, word as f64 / 32768.0);
            (evaluation.bias_dps(word) - wanted).abs()
        });
        let largest = errors.fold(0.0, f64::max);
        assert_eq!(found.inputs_checked, (high - low + 1) as u64);
        let apart = (found.exhaustive_max_dps - largest).abs();
        assert!(apart < 1e-10, "seed {seed}: {apart:e}");
        assert!(largest <= found.bounds.certified_max_dps, "seed {seed}");
        ratios.push(found.bounds.certified_max_dps / largest);
    }
    ratios.sort_by(f64::total_cmp);
    println!("certified over observed: {ratios:?}");
    assert!(ratios[30] < 1.3, "median {}", ratios[30]);
}

#[test]
fn a_coefficient_off_by_more_than_the_bound_allows_is_seen() {
    let mut design = random(3);
    let before = certainty(&design).unwrap().unwrap();
    let c = design.compensation.as_mut().unwrap();
    let lsb = c.coefficient_format.lsb();
    let step = (4.0 * before.bounds.certified_max_dps / lsb).ceil() as i128;
    c.coefficients_raw[0] += step;
    let after = certainty(&design).unwrap().unwrap();
    assert!(after.exhaustive_max_dps > 2.0 * before.bounds.certified_max_dps);
    assert!(after.bounds.coefficients_dps > 2.0 * before.bounds.certified_max_dps);
}

#[test]
fn the_search_never_does_worse_than_rounding() {
    let mut better = 0;
    for seed in 0..25 {
        let mut design = random(seed);
        let before = certainty(&design).unwrap().unwrap();
        let c = design.compensation.clone().unwrap();
        let fitted = c.fitted.clone().unwrap().coefficients_dps;
        let raw = coefficients::best(&design.circuit, &c, &fitted, &c.coefficients_raw).unwrap();
        better += u32::from(raw != c.coefficients_raw);
        design.compensation.as_mut().unwrap().coefficients_raw = raw;
        let after = certainty(&design).unwrap().unwrap();
        // A twentieth: of more than 4096 words the search sees a part.
        assert!(
            after.exhaustive_max_dps <= 1.05 * before.exhaustive_max_dps,
            "seed {seed}: {} {}",
            after.exhaustive_max_dps,
            before.exhaustive_max_dps
        );
    }
    assert!(better > 5, "{better}");
}

#[test]
fn beyond_the_range_the_slope_is_held_and_the_worst_is_stated() {
    for seed in 0..40 {
        let mut design = random(seed);
        let found = bounds(&design).unwrap().unwrap();
        let told = sentences(&design, &found).join(" ");
        let clamped = found.outside.unwrap();
        assert_eq!(clamped.contract, "clamp");
        // A figure of every input says so: another, of a tenth of the range beyond it, is told elsewhere.
        let farthest = "over all inputs that its word can hold (-3.1416 .. 3.1415 rad)";
        assert!(told.contains(farthest), "{told}");
        let c = design.compensation.as_mut().unwrap();
        c.outside = Outside::Flag;
        let found = bounds(&design).unwrap().unwrap();
        // The bias is that of `clamp`; what is promised is said.
        let flagged = found.outside.clone().unwrap();
        assert_eq!(
            (flagged.contract, flagged.worst_dps),
            ("flag", clamped.worst_dps)
        );
        let said = sentences(&design, &found).join("\n");
        assert!(said.contains("in_range is 1 for the inputs"), "{said}");
        let c = design.compensation.as_mut().unwrap();
        c.outside = Outside::HoldSlope;
        c.coefficient_format.integer_bits += 6;
        c.accumulator.format.integer_bits += 6;
        c.output.format.integer_bits += 6;
        let c = design.compensation.as_ref().unwrap();
        let held = bounds(&design).unwrap().unwrap().outside.unwrap();
        let evaluation = Evaluation::new(&design.circuit, c);
        let fitted = &c.fitted.as_ref().unwrap().coefficients_dps;
        let derivative: Vec<f64> = (1..fitted.len()).map(|k| k as f64 * fitted[k]).collect();
        let (low, high) = c.clamp_raw.unwrap();
        let mut worst = [0.0f64; 2];
        for word in -32768..=32767i128 {
            let end = word.clamp(low, high);
            if end == word {
                continue;
            }
            let [p, p_end] = [word, end].map(|w| w as f64 / 32768.0);
            let tangent = evaluate(fitted, p_end) + evaluate(&derivative, p_end) * (p - p_end);
            let emitted = evaluation.bias_dps(word);
            // Coefficients and slope rounded: a few LSB of the coefficients' format, and of the output's.
            let few = 12.0 * c.coefficient_format.lsb() + 8.0 * c.accumulator.format.lsb();
            let allowed = few + 2.0 * c.output.format.lsb();
            assert!(
                (emitted - tangent).abs() <= allowed,
                "seed {seed}, word {word}: {emitted} {tangent}"
            );
            let wanted = evaluate(fitted, p);
            worst[0] = worst[0].max((evaluate(fitted, p_end) - wanted).abs());
            worst[1] = worst[1].max((emitted - wanted).abs());
        }
        let slack = 16.0 * c.coefficient_format.lsb() + 4.0 * c.output.format.lsb();
        assert!((clamped.worst_dps - worst[0]).abs() <= slack, "seed {seed}");
        assert!(
            held.worst_dps >= worst[1],
            "seed {seed}: {} {}",
            held.worst_dps,
            worst[1]
        );
        assert!(
            held.worst_dps <= worst[1] + slack,
            "seed {seed}: {} {}",
            held.worst_dps,
            worst[1]
        );
    }
}

#[test]
fn a_loop_of_heating_and_cooling_is_told() {
    let mut design = random(3);
    let found = bounds(&design).unwrap().unwrap();
    assert!(!sentences(&design, &found).join(" ").contains("cooling"));
    let fitted = design.compensation.as_mut().and_then(|c| c.fitted.as_mut());
    fitted.unwrap().loop_rms_dps = Some(0.125);
    let of_run = OfRun {
        least_certain: Some("85 degC"),
        saturates: false,
    };
    let at = sentences_with(&design, &found, Some(of_run)).join(" ");
    assert!(
        at.contains("least certain (at 85 degC), its standard deviation is"),
        "{at}"
    );
    // The run says it beside the drift.
    assert!(!at.contains("Heating and cooling"), "{at}");
    assert!(at.contains("proved"), "{at}");
    let saturates = OfRun {
        saturates: true,
        ..of_run
    };
    let none = sentences_with(&design, &found, Some(saturates)).join(" ");
    assert!(
        none.contains("keeps to no bound") && !none.contains("proved"),
        "{none}"
    );
    let said = sentences(&design, &found).join(" ");
    assert!(
        said.contains("Heating and cooling differ by 0.125 deg/s rms"),
        "{said}"
    );
}

#[test]
fn the_smallest_format_that_holds_the_bias_is_found_by_trial() {
    let mut text = crate::design::template::DEFAULT.to_owned();
    for (from, to) in [
        (
            "output = { format = \"Q12.12\"",
            "output = { format = \"Q7.12\"",
        ),
        ("#clamp_raw = [", "clamp_raw = ["),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    let design = crate::design::reader::parse(&text, None).unwrap();
    let found = certainty(&design).unwrap().unwrap();
    assert!(found.saturates);
    let mend = mend(&design, &found).unwrap().unwrap();
    // 241 deg/s at the far end.
    assert_eq!(mend.change(), "compensation.output from Q7.12 to Q9.12");
}
