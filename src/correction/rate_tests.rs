//! A scale that bends with an input: against its formula, its passes and words, refusals, its text.

use crate::correction::sample::{evaluate, record};
use crate::correction::{Correction, Formats, Input, Plan, Planned, Reading, Term};
use crate::design::reader::parse;
use crate::firmware::correction::Origin;
use crate::numeric::trace::ir::Op;
use crate::verify::correction::Firmware;

/// Full scale, deg/s.
const FULL_SCALE_DPS: f64 = 500.0;

/// r (s0 + s1 x + s2 x^2), x = (phase_rad - 1) / 0.5.
fn bent(input: Option<usize>, [s0, s1, s2]: [f64; 3]) -> Plan {
    Plan {
        period_s: 2.0,
        inputs: vec![Input {
            column: "phase_rad".into(),
            offset: 1.0,
            scale: 0.5,
        }],
        full_scale_dps: FULL_SCALE_DPS,
        terms: vec![Term::ScaleBy { input, s0, s1, s2 }],
    }
}

/// The true rates, deg/s, and x from end to end, with the readings that the error of `s` makes of them.
fn measured(s: [f64; 3]) -> (Vec<f64>, Vec<Reading>) {
    let share = |x: f64| s[0] + s[1] * x + s[2] * x * x;
    let most_dps = FULL_SCALE_DPS / (1.0 + share(-1.0).max(share(0.0)).max(share(1.0)).max(0.0));
    let one = |k: usize| {
        let x = -0.99 + 0.99 * (k % 21) as f64 / 10.0;
        let true_dps = most_dps * (k as f64 / 100.0 - 1.0);
        let reading = Reading {
            time_s: 2.0 * k as f64,
            time_since_power_on_s: None,
            inputs: vec![1.0 + 0.5 * x],
            rate_out_dps: true_dps * (1.0 + share(x)),
        };
        (true_dps, reading)
    };
    (0..=200).map(one).unzip()
}

fn farthest(got: &[f64], due: &[f64]) -> f64 {
    let distances = got.iter().zip(due).map(|(a, b)| (a - b).abs());
    distances.fold(0.0, f64::max)
}

#[test]
fn a_bent_scale_gives_back_the_true_rate() {
    for s in [
        [1e-3, -2e-3, 3e-3],
        [0.0, 0.0, -4e-2],
        // As it is at both ends, the error would be gone after one pass; between them it is not.
        [-0.26, 0.0, 0.26],
        [0.26, 0.1, -0.2],
    ] {
        let correction = Correction::auto(&bent(Some(0), s)).unwrap();
        let (true_dps, readings) = measured(s);
        // Firmware's constants are in the bound; the passes leave at most a sixteenth of the noise, 1e-3 deg/s, or
        // as much as the last of eight.
        let share = s[0].abs() + s[1].abs() + s[2].abs();
        let left = (1e-3f64 / 16.0).max(FULL_SCALE_DPS * (share / 1.9).powi(9));
        let most = correction.bound_dps() + left;
        for got in [correction.run(&readings), correction.run_float(&readings)] {
            let distance = farthest(&got, &true_dps);
            assert!(distance <= most, "{s:?}: {distance} > {most}");
        }
    }
}

#[test]
fn firmware_is_the_model_up_to_the_largest_coefficients() {
    for s in [[0.4, -0.3, 0.3], [0.0, 0.5, 0.5], [0.25, -0.25, 0.5]] {
        let plan = bent(Some(0), s);
        let correction = Correction::auto(&plan).unwrap();
        let readings = record(&plan, 2000, 5);
        let due = evaluate(&plan, correction.formats.passes(&plan), &readings);
        for got in [correction.run(&readings), correction.run_float(&readings)] {
            let distance = farthest(&got, &due);
            assert!(distance <= correction.bound_dps(), "{s:?}: {distance}");
        }
        let origin = Origin {
            prefix: "tested",
            sha256: "0",
            command: "test",
        };
        let firmware = Firmware::make(
            &correction,
            &origin,
            &[
                crate::emit::views::Language::C,
                crate::emit::views::Language::Rust,
            ],
        )
        .unwrap();
        for c in firmware.compare(&correction, &readings).unwrap() {
            assert_eq!(c.mismatches, 0, "{s:?}: {} {:?}", c.name, c.first);
        }
    }
}

#[test]
fn the_bound_holds_and_is_no_idle_one_where_the_square_makes_most_of_it() {
    let plan = bent(Some(0), [0.0, 0.0, 0.1]);
    // So fine a rate that an LSB of the input, through twice the square's coefficient, is far above it.
    let correction = Correction::new(&plan, &Formats::choose(&plan, 1e-5).unwrap()).unwrap();
    let readings = record(&plan, 2000, 11);
    let due = evaluate(&plan, correction.formats.passes(&plan), &readings);
    let share = farthest(&correction.run(&readings), &due) / correction.bound_dps();
    assert!((0.15..=1.0).contains(&share), "{share}");
}

/// Multiplications of a step.
fn multiplications(plan: &Plan) -> usize {
    let program = Correction::auto(plan).unwrap().trace();
    let nodes = program.functions.iter().flat_map(|f| &f.nodes);
    nodes.filter(|n| matches!(n.op, Op::Mul(..))).count()
}

#[test]
fn the_square_costs_one_multiplication_and_nothing_where_there_is_none() {
    let [linear, square] = [0.0, 1e-5].map(|s2| bent(Some(0), [1e-5, 1e-5, s2]));
    let formats = [&linear, &square].map(|p| Formats::auto(p).unwrap());
    let passes = [formats[0].passes(&linear), formats[1].passes(&square)];
    assert_eq!(passes, [1, 1]);
    assert_eq!(multiplications(&square), multiplications(&linear) + 1);
    let none = Correction::auto(&bent(Some(0), [1e-5, 1e-5, 1e-12])).unwrap();
    assert_eq!(multiplications(&none.plan), multiplications(&linear));
}

#[test]
fn words_are_as_fine_as_the_largest_slope_in_the_input() {
    let words = |s| Formats::auto(&bent(Some(0), s)).unwrap();
    assert_eq!(words([0.0, 0.0, 0.01]), words([0.0, 0.02, 0.0]));
    assert_eq!(words([0.0, -0.01, 0.02]), words([0.0, 0.05, 0.0]));
    assert_ne!(words([0.0, 0.0, 0.01]), words([0.0, 0.01, 0.0]));
}

#[test]
fn a_square_needs_an_input_and_has_a_range() {
    let (_, readings) = measured([0.0; 3]);
    let of = |s| Correction::auto(&bent(None, s)).unwrap().run(&readings);
    assert_eq!(of([1e-3, 2e-3, 3e-3]), of([1e-3, 0.0, 0.0]));
    for (s, rule) in [
        ([0.0, 0.0, 0.6], "s2 is 0.6"),
        ([0.0, 0.0, f64::NAN], "s2 is NaN"),
        ([0.5, -0.25, 0.375], "|s0| + |s1| + |s2| is 1.125"),
    ] {
        let e = Correction::auto(&bent(Some(0), s)).unwrap_err().to_string();
        assert!(e.contains(rule), "{e}");
    }
    for s in [[0.5, -0.5, 0.0], [0.5, 0.0, -0.5]] {
        assert!(bent(Some(0), s).check().is_ok(), "{s:?}");
    }
}

#[test]
fn a_design_reads_the_square_back_and_does_without() {
    for (s2, written) in [(0.0, false), (-0.25, true)] {
        let planned = Planned {
            plan: bent(Some(0), [1e-3, 0.5, s2]),
            noise_dps: 2e-3,
            heldout_rms_dps: None,
        };
        let text = planned.to_toml();
        assert_eq!(text.contains("s2"), written, "{text}");
        let read = |text: &str| parse(text, None).unwrap().correction;
        assert_eq!(read(&text), Some(planned.clone()));
        if !written {
            let zero = text.replace("s1 = 0.5", "s1 = 0.5, s2 = 0");
            assert_eq!(read(&zero), Some(planned));
        }
    }
}
