//! The float twin against closed formulas, fixed point against real numbers, refusals.

use super::sample::{bends, evaluate, normal, plan, record};
use super::*;
use crate::vectors::stimulus::Lcg;

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for v in values {
        sum += v * v;
        count += 1;
    }
    (sum / f64::from(count)).sqrt()
}

fn one(terms: Vec<Term>) -> Plan {
    Plan {
        period_s: 2.0,
        inputs: vec![Input {
            column: "phase_rad".into(),
            offset: 1.0,
            scale: 0.5,
        }],
        full_scale_dps: 500.0,
        terms,
    }
}

/// Readings every 2 s of x = f(t), rate r.
fn readings_of(rows: usize, rate_dps: f64, f: impl Fn(f64) -> f64) -> Vec<Reading> {
    let at = |n: usize| Reading {
        time_s: 2.0 * n as f64,
        time_since_power_on_s: None,
        inputs: vec![1.0 + 0.5 * f(2.0 * n as f64)],
        rate_out_dps: rate_dps,
    };
    (0..rows).map(at).collect()
}

fn assert_close(got: &[f64], expected: impl Fn(usize) -> f64, tolerance: f64) {
    for (n, v) in got.iter().enumerate() {
        let due = expected(n);
        assert!((v - due).abs() <= tolerance, "reading {n}: {v}, not {due}");
    }
}

#[test]
fn the_float_twin_follows_closed_formulas() {
    let ramp = |t: f64| -0.5 + t / 1000.0;
    let t = |n: usize| 2.0 * n as f64;
    let lag = one(vec![Term::Lag {
        gain_dps: 3.0,
        input: 0,
        tau_s: 60.0,
        kept: false,
    }]);
    let c = Correction::auto(&lag).unwrap();
    let got = c.run_float(&readings_of(400, 10.0, ramp));
    // A lag is behind a ramp of slope s by s tau (1 - exp(-t / tau)).
    let behind = |n: usize| 10.0 - 3.0 * 0.06 * (1.0 - (-t(n) / 60.0).exp());
    assert_close(&got, behind, c.bound_dps());
    assert!(c.bound_dps() < 2e-4, "{}", c.bound_dps());

    let decay = one(vec![Term::Decay {
        gain_dps: 1.5,
        tau_s: 100.0,
    }]);
    let c = Correction::auto(&decay).unwrap();
    let got = c.run_float(&readings_of(400, 0.0, ramp));
    assert_close(&got, |n| -1.5 * (-t(n) / 100.0).exp(), 1e-5);

    let slope = one(vec![Term::Slope {
        gain_dps_s: 40.0,
        input: 0,
        rows: 5,
    }]);
    let got = Correction::auto(&slope).unwrap();
    let got = got.run_float(&readings_of(50, 1.0, ramp));
    assert_close(&got, |n| 1.0 - 40e-3 * (n as f64 / 5.0).min(1.0), 1e-6);

    let bump = one(vec![Term::Curve {
        input: 0,
        values_dps: vec![0.0, 1.0, 0.0],
    }]);
    let got = Correction::auto(&bump).unwrap();
    let got = got.run_float(&readings_of(500, 0.0, |t| -0.5 + t / 700.0));
    let at = |n: usize| -(1.0 - (-0.5 + t(n) / 700.0f64).abs()).max(0.0);
    assert_close(&got, at, 2e-5);

    let laws = one(vec![
        Term::ScaleBy {
            input: Some(0),
            s0: 1e-3,
            s1: -2e-3,
            s2: 0.0,
        },
        Term::Cubic {
            ppm: 100.0,
            rate_max_dps: 300.0,
        },
        Term::Even {
            ppm: -50.0,
            rate_max_dps: 300.0,
            absolute: true,
        },
        // On the bias, so before the laws although it is last.
        Term::Product {
            gain_dps: 20.0,
            factors: vec![(0, 2)],
        },
    ]);
    let got = Correction::auto(&laws).unwrap();
    let got = got.run_float(&readings_of(300, -280.0, ramp));
    let at = |n: usize| {
        let x = ramp(t(n));
        let measured = -280.0 - 20.0 * x * x;
        // The true rate: with its errors on it, it is what was measured.
        let mut r: f64 = measured;
        for _ in 0..40 {
            let bent = 1e-4 * r * (r / 300.0).powi(2) - 50e-6 * r.abs();
            r = measured - r * (1e-3 - 2e-3 * x) - bent;
        }
        r
    };
    // The passes leave at most a sixteenth of the noise, 1e-3 deg/s, at full scale.
    assert_close(&got, at, 2e-5 + 1e-3 / 16.0);
}

#[test]
fn a_kept_lag_goes_on_after_a_restart_and_another_begins_anew() {
    let correction = |kept: bool| {
        let lag = Term::Lag {
            gain_dps: 3.0,
            input: 0,
            tau_s: 60.0,
            kept,
        };
        Correction::auto(&one(vec![lag])).unwrap()
    };
    // A ramp, then the same input after a restart.
    let mut readings = readings_of(200, 0.0, |t| -0.5 + t / 1000.0);
    let last = readings[199].inputs.clone();
    let mut again = readings_of(30, 0.0, |_| 0.0);
    for reading in &mut again {
        reading.inputs.clone_from(&last);
    }
    readings.append(&mut again);
    for (kept, share) in [(true, 1.0), (false, 0.0)] {
        let c = correction(kept);
        for got in [c.run(&readings), c.run_float(&readings)] {
            // As far behind as after 398 s of a ramp, by exp(-t / tau) of it afterwards.
            let behind = 3.0 * 0.06 * (1.0 - (-398.0f64 / 60.0).exp());
            let due = |n: usize| -share * behind * (-2.0 * (n + 1) as f64 / 60.0).exp();
            assert_close(&got[200..], due, c.bound_dps());
        }
    }
}

#[test]
fn a_relay_remembers_and_a_latch_outlives_a_restart() {
    let step = |gap: f64, once: bool| {
        let term = Term::Step {
            gain_dps: 1.0,
            input: 0,
            centre: 0.0,
            gap,
            once,
        };
        Correction::auto(&one(vec![term])).unwrap()
    };
    // Up to 0.5 and back, at power-on from -0.5; then again after a restart at 0.1.
    let mut readings = readings_of(200, 0.0, |t| 0.5 - (t - 200.0).abs() / 200.0);
    let mut again = readings_of(3, 0.0, |_| 0.1);
    again[0].time_s = 0.0;
    readings.append(&mut again);
    for (gap, once, first_on, first_off, at_last) in [
        (0.0, false, 50, Some(151), -1.0),
        (0.5, false, 75, Some(176), -1.0),
        (0.5, true, 75, None, -1.0),
        (2.0, false, usize::MAX, None, -1.0),
        (2.0, true, usize::MAX, None, 0.0),
    ] {
        let c = step(gap, once);
        for got in [c.run(&readings), c.run_float(&readings)] {
            for (n, v) in got[..200].iter().enumerate() {
                let on = n >= first_on && first_off.is_none_or(|off| n < off);
                assert_eq!(*v, if on { -1.0 } else { 0.0 }, "{gap} {once} {n}");
            }
            // Not latched: on at power-on above the centre.
            assert_eq!(got[202], at_last, "{gap} {once}");
        }
    }
}

#[test]
fn fixed_and_float_stay_within_the_bound_of_the_plan() {
    let (mut worst, mut bent) = (0.0f64, 0);
    for seed in 0..60 {
        let inputs = seed as usize % 6;
        let plan = plan(seed, inputs, false);
        bent += usize::from(bends(&plan));
        let correction = Correction::auto(&plan).unwrap();
        let readings = record(&plan, 600, seed);
        let due = evaluate(&plan, correction.formats.passes(&plan), &readings);
        let bound = correction.bound_dps();
        for (n, ((fixed, float), due)) in correction
            .run(&readings)
            .iter()
            .zip(correction.run_float(&readings))
            .zip(&due)
            .enumerate()
        {
            let distance = (fixed - due).abs();
            worst = worst.max(distance / bound);
            assert!(
                distance <= bound,
                "plan {seed}, reading {n}: {distance} > {bound}"
            );
            assert!(
                (float - due).abs() <= bound,
                "plan {seed}, reading {n}: float"
            );
        }
        // Far below the noise that the words were chosen for (1e-3 deg/s): 1.005 of its rms at most.
        let errors = correction.run(&readings);
        let rms = rms(errors.iter().zip(&due).map(|(a, b)| a - b));
        assert!(rms < 1e-4, "plan {seed}: rms {rms}");
    }
    // The bound is a worst case, yet no idle one.
    assert!(worst > 0.2, "{worst}");
    assert!(bent > 10, "{bent} plans with an s2");
}

#[test]
fn firmware_adds_nothing_visible_to_the_noise() {
    // A quadratic bias, a lag and a decay, at rest, with 1e-3 deg/s of noise.
    let plan = one(vec![
        Term::Product {
            gain_dps: 109.6,
            factors: vec![],
        },
        Term::Product {
            gain_dps: 76.0,
            factors: vec![(0, 1)],
        },
        Term::Product {
            gain_dps: 13.0,
            factors: vec![(0, 2)],
        },
        Term::Lag {
            gain_dps: 8.0,
            input: 0,
            tau_s: 600.0,
            kept: false,
        },
        Term::Decay {
            gain_dps: 0.7,
            tau_s: 900.0,
        },
    ]);
    let mut readings = readings_of(4000, 0.0, |t| 0.95 * (t / 900.0).sin());
    let bias = evaluate(&plan, 1, &readings);
    let mut lcg = Lcg(7);
    let noise: Vec<f64> = bias.iter().map(|_| 1e-3 * normal(&mut lcg)).collect();
    for ((reading, bias), noise) in readings.iter_mut().zip(&bias).zip(&noise) {
        reading.rate_out_dps = noise - bias;
    }
    let correction = Correction::auto(&plan).unwrap();
    let fixed = rms(correction.run(&readings).into_iter());
    let ratio = fixed / rms(noise.into_iter());
    assert!(ratio < 1.005, "{ratio}");
}

#[test]
fn errors_on_the_rate_are_functions_of_the_true_rate() {
    // Nine percent of the rate, more to one side: what one pass leaves is far above the noise.
    let law = |term| {
        let mut plan = one(vec![term]);
        plan.full_scale_dps = 30.0;
        plan
    };
    let even = |absolute| Term::Even {
        ppm: 9e4,
        rate_max_dps: 25.0,
        absolute,
    };
    let cubic = Term::Cubic {
        ppm: -6e4,
        rate_max_dps: 25.0,
    };
    let plans = [law(even(false)), law(even(true)), law(cubic)];
    let errors: [fn(f64) -> f64; 3] = [
        |r| 0.09 * r * r / 25.0,
        |r| 0.09 * r.abs(),
        |r| -0.06 * r * (r / 25.0).powi(2),
    ];
    for (plan, error) in plans.iter().zip(errors) {
        let formats = Formats::choose(plan, 0.01).unwrap();
        assert!(formats.passes(plan) > 1);
        let correction = Correction::new(plan, &formats).unwrap();
        for k in -20..=20 {
            let true_dps = 1.25 * f64::from(k);
            let readings = readings_of(2, true_dps + error(true_dps), |_| 0.0);
            let got = correction.run(&readings)[1];
            assert!((got - true_dps).abs() < 2.5e-3, "{plan:?} {true_dps} {got}");
        }
    }
}

#[test]
fn a_tenth_of_the_rate_is_taken_off_where_the_full_scale_is_far_above_it() {
    // At twice the rate of the record the error's slope is 1.2, at the true rates of such readings 0.7.
    let error = |r: f64| 0.1 * r * (r / 100.0_f64).powi(2);
    let mut plan = one(vec![Term::Cubic {
        ppm: 1e5,
        rate_max_dps: 100.0,
    }]);
    plan.full_scale_dps = 200.0;
    let formats = Formats::choose(&plan, 0.1).unwrap();
    assert_eq!(formats.passes(&plan), 8);
    let correction = Correction::new(&plan, &formats).unwrap();
    for k in -10..=10 {
        let true_dps = 10.0 * f64::from(k);
        let readings = readings_of(2, true_dps + error(true_dps), |_| 0.0);
        let got = correction.run(&readings)[1];
        assert!((got - true_dps).abs() < 0.01, "{true_dps}: {got}");
    }
    // Beyond the full scale, where substitution alone would lead away, it stays below the reading.
    let beyond = correction.run(&readings_of(2, 240.0, |_| 0.0))[1];
    assert!((120.0..240.0).contains(&beyond), "{beyond}");
    // An error that turns the output back is taken off once, at best.
    plan.terms = vec![Term::Cubic {
        ppm: -1e5,
        rate_max_dps: 100.0,
    }];
    plan.full_scale_dps = 1000.0;
    assert!(formats.passes(&plan) >= 1);
}

#[test]
fn a_wrong_constant_leaves_the_bound() {
    let readings = |plan: &Plan| record(plan, 400, 3);
    let good = one(vec![
        Term::Lag {
            gain_dps: 1.0,
            input: 0,
            tau_s: 300.0,
            kept: false,
        },
        Term::Product {
            gain_dps: 5.0,
            factors: vec![(0, 1)],
        },
    ]);
    let correction = Correction::auto(&good).unwrap();
    for k in 0..2 {
        let mut bad = good.clone();
        match &mut bad.terms[k] {
            Term::Lag { tau_s, .. } => *tau_s *= 1.01,
            Term::Product { gain_dps, .. } => *gain_dps += 1e-3,
            _ => unreachable!(),
        }
        let due = evaluate(&bad, 1, &readings(&bad));
        let got = correction.run(&readings(&good));
        let farthest = got.iter().zip(&due).map(|(a, b)| (a - b).abs());
        let farthest = farthest.fold(0.0, f64::max);
        assert!(farthest > correction.bound_dps(), "term {k}: {farthest}");
    }
}

#[test]
fn what_is_not_measured_is_held() {
    let plan = one(vec![Term::Product {
        gain_dps: 1.0,
        factors: vec![(0, 1)],
    }]);
    let mut readings = readings_of(4, 0.0, |t| t / 8.0);
    readings[2].inputs[0] = f64::NAN;
    readings[3].rate_out_dps = f64::NAN;
    let got = Correction::auto(&plan).unwrap().run(&readings);
    assert_eq!((got[1], got[2]), (-0.25, -0.25));
    assert!(got[3].is_nan());
}

#[test]
fn plans_that_cannot_become_firmware_are_refused_with_the_rule() {
    let refused = |plan: &Plan| Correction::auto(plan).unwrap_err().to_string();
    let curve = |n: usize| Term::Curve {
        input: 0,
        values_dps: vec![0.0; n],
    };
    let lag = |tau_s: f64| Term::Lag {
        gain_dps: 1.0,
        input: 0,
        tau_s,
        kept: false,
    };
    let power = |p: u32| Term::Product {
        gain_dps: 1.0,
        factors: vec![(0, p)],
    };
    let elsewhere = Term::Product {
        gain_dps: 1.0,
        factors: vec![(1, 1)],
    };
    for (terms, rule) in [
        (vec![curve(1)], "knots"),
        (vec![curve(3); 9], "more than 8"),
        (vec![lag(1e9)], "tau_s"),
        (vec![lag(f64::NAN)], "tau_s"),
        (vec![power(0)], "power"),
        (vec![elsewhere], "input 1 of 1"),
    ] {
        let e = refused(&one(terms));
        assert!(e.contains(rule), "{e}");
    }
    let mut plan = one(vec![]);
    plan.inputs[0].scale = 0.0;
    assert!(refused(&plan).contains("scale of phase_rad"));
    plan.inputs[0].scale = 1.0;
    plan.inputs[0].column = "rate_out_dps".into();
    assert!(refused(&plan).contains("what is corrected"));
    plan.inputs.clear();
    assert!(Correction::auto(&plan).is_ok());
    let e = Formats::choose(&plan, 1e-9).unwrap_err().to_string();
    assert!(e.contains("32 bits"), "{e}");
}

#[test]
fn a_plan_reads_back_from_a_design_file_and_mistakes_are_shown_in_their_place() {
    use crate::design::reader::parse;
    for seed in 0..12 {
        let planned = Planned {
            plan: plan(300 + seed, seed as usize % 9, true),
            noise_dps: 2e-3,
            heldout_rms_dps: (seed % 2 == 0).then_some(3.25e-3),
        };
        let design = parse(&planned.to_toml(), None).unwrap();
        assert_eq!(design.correction, Some(planned.clone()));
        // The bundle says it where it is known.
        let facts = super::sentences::facts(&planned.compile().unwrap()).join("\n");
        let told = facts.contains("held-out error 0.00325 deg/s rms: ");
        assert_eq!(told, planned.heldout_rms_dps.is_some(), "{facts}");
    }
    assert_eq!(parse("", None).unwrap().correction, None);

    let text = |terms: &str| {
        format!(
            "[correction]\nperiod_s = 1.0\nfull_scale_dps = 500.0\n\
             inputs = [{{ column = \"agc\", offset = 1, scale = 0.1 }}]\nterms = [\n{terms}\n]\n"
        )
    };
    let good =
        text("{ kind = \"step\", gain_dps = 1, input = 0, centre = 0, gap = 0, once = \"no\" }");
    let design = parse(&good, None).unwrap();
    assert_eq!(design.correction.map(|c| c.noise_dps), Some(1e-3));
    for (terms, line, rule) in [
        ("{ kind = \"lags\" }", 6, "did you mean `lag`"),
        (
            "{ kind = \"decay\", gain_dps = 1 }",
            6,
            "lacks the required key `tau_s`",
        ),
        (
            "{ kind = \"decay\", gain = 1, tau_s = 9 }",
            6,
            "did you mean `gain_dps`",
        ),
        (
            "{ kind = \"product\", gain_dps = 1, factors = [[0]] }",
            6,
            "no pair",
        ),
        (
            "{ kind = \"lag\", gain_dps = 1, input = 1, tau_s = 9 }",
            1,
            "input 1 of 1",
        ),
    ] {
        let read = parse(&text(terms), None).and_then(|d| super::refuse_unbuildable(&d));
        let e = read.unwrap_err().to_string();
        assert!(
            e.contains(rule) && e.starts_with(&format!("{line}:")),
            "{e}"
        );
    }
}
