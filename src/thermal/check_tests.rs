//! Warnings fire where they should, and only there.

use super::baseline::fit;
use super::synthetic::{Random, few, options, record, triangle};
use crate::design::{FitOrder, RecordMapping};
use crate::error::Error;

/// The warnings' codes for a quadratic fit.
fn codes(t: &[f64], e: &[f64], order: FitOrder) -> Vec<&'static str> {
    let f = fit(
        &record("die_degc", t, e),
        &RecordMapping::default(),
        &options(order),
    )
    .unwrap();
    f.warnings.iter().map(|w| w.code).collect()
}

/// A smooth bias over 0..70 degC, deg/s.
fn bias(t: f64) -> f64 {
    0.02 * t - 0.0003 * t * t
}

fn with_noise(t: &[f64], std: f64, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed);
    t.iter().map(|t| bias(*t) + std * random.normal()).collect()
}

const NONE: [&str; 0] = [];
const TWO: FitOrder = FitOrder::Fixed(2);

#[test]
fn a_good_record_has_no_warning() {
    for seed in 0..25 {
        let t = triangle(400);
        let e = with_noise(&t, 0.02, seed);
        assert_eq!(codes(&t, &e, TWO), NONE, "seed {seed}");
        assert_eq!(codes(&t, &e, FitOrder::Auto), NONE, "seed {seed}");
    }
    // Set points with dwells, up and down: 15 temperatures, 20 rows each.
    let steps: Vec<f64> = (0..29)
        .flat_map(|k: i32| std::iter::repeat_n(5.0 * f64::from(14 - (k - 14).abs()), 20))
        .collect();
    for seed in 0..20 {
        let mut random = Random::new(100 + seed);
        let t: Vec<f64> = steps.iter().map(|t| t + 0.02 * random.normal()).collect();
        assert!(
            codes(&t, &with_noise(&t, 0.02, seed), TWO).is_empty(),
            "seed {seed}"
        );
    }
}

#[test]
fn coloured_noise_makes_no_loop() {
    // With 0.9 the 401 rows are worth about 20: the memory itself is then ill known.
    for (rho, most) in [(0.0, 1), (0.7, 3), (0.9, 15)] {
        let mut loops = 0;
        for seed in 0..100 {
            let mut random = Random::new(seed);
            let t = triangle(401);
            let noise = random.coloured(401, rho);
            let rows = t.iter().zip(noise);
            let e: Vec<f64> = rows.map(|(t, v)| bias(*t) + 0.02 * v).collect();
            let f = fit(
                &record("die_degc", &t, &e),
                &RecordMapping::default(),
                &few(TWO),
            );
            loops += usize::from(f.unwrap().sweep_loop.unwrap().significant);
        }
        println!("rho {rho}: {loops} of 100 records show a loop");
        assert!(loops <= most, "rho {rho}: {loops} of 100");
    }
}

/// A lag of 400 s: its first cycle starts at rest and differs from the next, which leaves residuals that wander slowly. The
/// loop is ten times what they make by chance over any number of cycles.
#[test]
fn a_thermal_lag_is_a_loop_over_one_cycle_two_and_three() {
    for cycles in 1..=3u32 {
        let (mut lagging, mut random) = (-20.0, Random::new(1));
        let (mut t, mut e) = (Vec::new(), Vec::new());
        for k in 0..400 * cycles {
            let degc = 20.0 - 40.0 * (std::f64::consts::TAU * f64::from(k) / 400.0).cos();
            lagging += (degc - lagging) / 40.0;
            t.push(degc);
            e.push(0.03 * degc + 0.02 * (lagging - degc) + 0.005 * random.normal());
        }
        let f = fit(
            &record("die_degc", &t, &e),
            &RecordMapping::default(),
            &few(FitOrder::Fixed(1)),
        );
        let l = f.unwrap().sweep_loop.unwrap();
        assert!(l.significant && l.rms_dps > 8.0 * l.noise_dps, "{l:?}");
    }
}

/// A random walk over two cycles is no loop. Where it looks like one, the warning says what there is too little of.
#[test]
fn slow_noise_that_looks_like_a_loop_is_told_as_undecided() {
    let (mut told, mut loops) = (Vec::new(), 0);
    for seed in 0..200 {
        let (mut random, mut walk) = (Random::new(seed), 0.0);
        let t: Vec<f64> = [triangle(201), triangle(201)].concat();
        let e: Vec<f64> = t
            .iter()
            .map(|t| {
                walk += 0.01 * random.normal();
                bias(*t) + walk + 0.005 * random.normal()
            })
            .collect();
        let record = record("die_degc", &t, &e);
        let f = fit(&record, &RecordMapping::default(), &few(TWO)).unwrap();
        loops += usize::from(f.sweep_loop.unwrap().significant);
        let of_loop = f
            .warnings
            .into_iter()
            .filter(|w| w.code == "loop_or_slow_noise");
        told.extend(of_loop.map(|w| w.message));
    }
    assert!(loops <= 4 && !told.is_empty(), "{loops}, {}", told.len());
    for said in told {
        assert!(
            said.contains("the 402 rows are worth ") && said.contains("record more cycles"),
            "{said}"
        );
    }
}

#[test]
fn each_shortcoming_has_its_warning() {
    let t = triangle(400);
    // A lag of two degrees: a loop of 0.04 deg/s under a noise of 0.02.
    let up_down = |k: usize| if k < 200 { 1.0 } else { -1.0 };
    let lagging: Vec<f64> = with_noise(&t, 0.02, 1)
        .iter()
        .enumerate()
        .map(|(k, e)| e + 0.02 * up_down(k))
        .collect();
    assert_eq!(codes(&t, &lagging, TWO), ["heating_cooling_loop"]);
    let f = fit(
        &record("die_degc", &t, &lagging),
        &RecordMapping::default(),
        &options(TWO),
    )
    .unwrap();
    let l = f.sweep_loop.unwrap();
    assert!(
        (l.rms_dps - 0.04).abs() < 0.01 && l.noise_dps < 0.015,
        "{l:?}"
    );

    let heating: Vec<f64> = (0..300).map(|k| 0.2 * f64::from(k)).collect();
    assert_eq!(
        codes(&heating, &with_noise(&heating, 0.02, 2), TWO),
        ["one_direction"]
    );
    let cooling: Vec<f64> = heating.iter().rev().copied().collect();
    assert_eq!(
        codes(&cooling, &with_noise(&cooling, 0.02, 2), TWO),
        ["one_direction"]
    );

    let mut random = Random::new(3);
    let still: Vec<f64> = (0..300).map(|_| 25.0 + 0.1 * random.normal()).collect();
    assert_eq!(
        codes(&still, &with_noise(&still, 0.02, 3), TWO),
        ["thermometer_range_small"]
    );
    let noisy: Vec<f64> = (0..300).map(|_| 25.0 + 5.0 * random.normal()).collect();
    assert!(codes(&noisy, &with_noise(&noisy, 0.02, 3), TWO).contains(&"thermometer_range_small"));
    assert_eq!(
        codes(&[25.0; 300], &with_noise(&[25.0; 300], 0.02, 3), TWO),
        ["order_lowered", "thermometer_constant"]
    );

    let whole: Vec<f64> = t.iter().map(|t| t.round()).collect();
    let fine = with_noise(&t, 0.005, 4);
    assert_eq!(codes(&whole, &fine, TWO), ["thermometer_resolution_coarse"]);
    let tenths: Vec<f64> = t.iter().map(|t| (t * 10.0).round() / 10.0).collect();
    assert!(codes(&tenths, &fine, TWO).is_empty());

    let hole: Vec<f64> = t
        .iter()
        .copied()
        .filter(|t| !(15.0..45.0).contains(t))
        .collect();
    assert!(codes(&hole, &with_noise(&hole, 0.02, 5), TWO).contains(&"coverage_gap"));

    // Twelve rows cannot carry order 5, nor tell what lies beyond them.
    let few = triangle(12);
    let found = codes(&few, &with_noise(&few, 0.3, 6), FitOrder::Fixed(5));
    assert!(
        found.contains(&"few_points") && found.contains(&"extrapolation"),
        "{found:?}"
    );
    // A constant moves nowhere.
    let found = codes(&few, &with_noise(&few, 30.0, 6), FitOrder::Fixed(0));
    assert!(!found.contains(&"extrapolation"), "{found:?}");
}

#[test]
fn a_record_without_a_thermometer_is_refused() {
    let mapping = RecordMapping::default();
    let e = [0.1; 20];
    let text = |e: Error| e.to_string();
    let r = record("humidity_pct", &[1.0; 20], &e);
    let refused = text(fit(&r, &mapping, &options(TWO)).unwrap_err());
    assert!(refused.contains("no thermometer"), "{refused}");
    assert!(
        refused.contains("humidity_pct") && refused.contains("[record.columns]"),
        "{refused}"
    );
    let mut named = mapping.clone();
    named.thermometer = Some("phase_rad".into());
    let refused = text(fit(&r, &named, &options(TWO)).unwrap_err());
    assert!(refused.contains("names as thermometer"), "{refused}");
    // Where the design is a file, the key is shown in it, with what the record has.
    let design = "[record]\nthermometer = \"phase_rad\"\n";
    let design = crate::design::reader::parse(design, Some(std::path::Path::new("d.toml")));
    let dies = record("die_degc", &[1.0; 20], &e);
    let refused = text(fit(&dies, &design.unwrap().record, &options(TWO)).unwrap_err());
    assert!(
        refused.starts_with("d.toml:2:15: error: the record") && refused.contains("`die_degc`"),
        "{refused}"
    );
    named.thermometer = Some("humidity_pct".into());
    let f = fit(&r, &named, &options(TWO)).unwrap();
    assert_eq!((f.unit, f.order), ("%", 0));
    let mut t = [f64::NAN; 20];
    t[..9].fill(20.0);
    let r = record("die_degc", &t, &e);
    let refused = text(fit(&r, &mapping, &options(TWO)).unwrap_err());
    assert!(refused.contains("only 9 rows"), "{refused}");
    // The first of the contract's thermometers wins, unless another is named.
    let mut r = record("chamber_degc", &triangle(20), &e);
    r.columns.insert("phase_rad".into(), triangle(20));
    assert_eq!(
        fit(&r, &mapping, &options(TWO)).unwrap().thermometer,
        "phase_rad"
    );
    named.thermometer = Some("chamber_degc".into());
    assert_eq!(
        fit(&r, &named, &options(TWO)).unwrap().thermometer,
        "chamber_degc"
    );
}

#[test]
fn short_and_odd_records_never_panic() {
    let mut random = Random::new(21);
    for n in [10, 11, 13, 59, 60, 61] {
        for order in [0, 1, 2, 5, 8] {
            for kind in 0..4 {
                let t: Vec<f64> = (0..n)
                    .map(|k| match kind {
                        0 => k as f64,
                        1 => f64::from(u8::from(k % 2 == 0)),
                        2 => 1e300 * random.normal(),
                        _ => 1e-300 * k as f64,
                    })
                    .collect();
                let e: Vec<f64> = (0..n).map(|_| random.normal() * 1e3).collect();
                for order in [FitOrder::Fixed(order), FitOrder::Auto] {
                    let r = record("die_degc", &t, &e);
                    let f = fit(&r, &RecordMapping::default(), &options(order)).unwrap();
                    assert_eq!(f.coefficients_scaled.len(), f.order + 1);
                    assert_eq!(f.covariance.nrows(), f.order + 1);
                    assert!(f.coefficients_scaled.iter().all(|c| c.is_finite()));
                }
            }
        }
    }
}
