use super::super::bench::VERIFY_SEED;
use super::super::figures::added;
use super::super::measure::run;
use super::super::scenario::Extent;
use super::*;
use crate::circuit::engine::ArithmeticKind;
use crate::design::{reader, template};
use crate::numeric::splitmix::{GOLDEN, mix};

#[test]
fn standard_errors_on_either_side_are_the_normals() {
    for (intervals, expected) in [(1, 1.959_964), (6, 2.638_257), (30, 3.143_980)] {
        let z = Confidence::of(intervals).standard_errors;
        assert!((z - expected).abs() < 1e-4, "{intervals}: {z}");
    }
}

#[test]
fn the_mean_of_white_noise_is_as_certain_as_its_length_says() {
    let mut state = 5u64;
    let mut uniform = || {
        state = state.wrapping_add(GOLDEN);
        mix(state) as f64 / 2f64.powi(64) - 0.5
    };
    let (mut sum, count) = (0.0, 200);
    for _ in 0..count {
        let series: Vec<f64> = (0..384).map(|_| uniform()).collect();
        sum += square_error(&series);
    }
    // 1/12 over 384 rows; 200 estimates of 7 degrees of freedom are certain to 4 %.
    let ratio = sum / f64::from(count) / (1.0 / 12.0 / 384.0);
    assert!((0.88..1.12).contains(&ratio), "{ratio}");
}

/// Product of 14 bits: noise, bias and drift by roundings.
fn coarse() -> crate::design::Design {
    let text = template::DEFAULT.replacen(
        "product = { format = \"Q2.22\"",
        "product = { format = \"Q2.12\"",
        1,
    );
    reader::parse(&text, None).unwrap()
}

#[test]
fn standard_errors_are_the_scatter_that_other_noise_makes() {
    let design = coarse();
    let extent = Extent {
        temperatures: 8,
        rates: 3,
        rest_rows: 384,
        rate_rows: 96,
        detuned_rows: 384,
    };
    let count = 32;
    let mut all: Vec<(Figures, Errors)> = Vec::new();
    for seed in 0..count {
        let plan = Plan::new(&design, extent, VERIFY_SEED + seed).unwrap();
        let twin = run(&design, ArithmeticKind::Float, &plan).unwrap();
        let fixed = run(&design, ArithmeticKind::Fixed, &plan).unwrap();
        all.push((
            added(&plan, &fixed, &twin),
            Errors::new(&plan, &fixed, &twin),
        ));
    }
    let scatter = |of: &dyn Fn(&Figures) -> f64| {
        let values: Vec<f64> = all.iter().map(|(f, _)| of(f)).collect();
        let middle = mean(&values);
        let square: f64 = values.iter().map(|v| (v - middle).powi(2)).sum();
        ((square / (count - 1) as f64).sqrt(), middle)
    };
    let told = |of: &dyn Fn(&Errors) -> f64| {
        let sum: f64 = all.iter().map(|(_, e)| of(e).powi(2)).sum();
        (sum / count as f64).sqrt()
    };
    // 32 values: a scatter is certain to 12 %.
    let bias = told(&|e| e.bias_dps) / scatter(&|f| f.bias_dps).0;
    assert!((0.7..1.5).contains(&bias), "bias {bias}");
    let (noise, middle) = scatter(&|f| f.noise_dps_rthz.powi(2));
    let noise = told(&|e| e.noise_square) / (noise / middle);
    assert!((0.7..1.5).contains(&noise), "noise {noise}");
    // Of the largest of several the error of one is too large, never too small.
    let drift = told(&|e| e.drift_dps) / scatter(&|f| f.drift_dps).0;
    assert!((0.7..3.0).contains(&drift), "drift {drift}");
    let slope = told(&|e| e.scale_factor_ppm) / scatter(&|f| f.scale_factor_ppm).0;
    assert!((0.5..3.0).contains(&slope), "scale factor {slope}");
}

#[test]
fn bounds_are_around_their_figures_and_no_line_is_bounded_by_what_would_be_seen() {
    let figures = Figures {
        bias_dps: -2.0,
        noise_dps_rthz: 3.0,
        spur_floor_dps: 0.5,
        ..Figures::default()
    };
    let errors = Errors {
        bias_dps: 0.1,
        noise_square: 0.1,
        ..Errors::default()
    };
    let confidence = Confidence::of(6);
    let z = confidence.standard_errors;
    let b = Bounds::new(&figures, &errors, Some([1.0, 0.2]), &confidence);
    assert_eq!(b.bias_dps, [-2.0 - 0.1 * z, -2.0 + 0.1 * z]);
    assert_eq!(largest(b.bias_dps), 2.0 + 0.1 * z);
    assert_eq!(b.noise_dps_rthz[1], 3.0 * (1.0 + 0.1 * z).sqrt());
    assert_eq!(b.spur_dps, [0.0, 0.5]);
    assert_eq!(b.startup_error_dps, Some([1.0 - 0.2 * z, 1.0 + 0.2 * z]));
    assert_eq!(b.of(LimitName::RomBytes), None);
    // The start is an error of the bias, and of nothing else.
    assert_eq!(b.most(LimitName::Bias), Some(2.0 + 0.1 * z));
    assert_eq!(b.most(LimitName::Spur), Some(0.5));
    let b = Bounds::new(&figures, &errors, Some([-4.0, 0.2]), &confidence);
    assert_eq!(b.most(LimitName::Bias), Some(4.0 + 0.2 * z));
}
