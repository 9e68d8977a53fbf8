//! Tests of the plot writer.

use super::super::axis::{Axis, Interval, ticks};
use super::*;
use proptest::prelude::*;

fn axis(low: f64, high: f64) -> Axis {
    Axis {
        interval: Interval { low, high },
        quantity: "rate".to_owned(),
        unit: "deg/s".to_owned(),
    }
}

fn plot(points: &[(f64, f64)]) -> String {
    let x = Interval::of(points.iter().map(|p| p.0)).padded(0.04);
    let y = Interval::of(points.iter().map(|p| p.1)).padded(0.04);
    let mut svg = Svg::new(900.0);
    svg.legend([("fixed", Swatch::Marker(Shape::Circle), "fixed".to_owned())]);
    let mut frame = svg.frame(200.0, 70.0, axis(x.low, x.high), axis(y.low, y.high));
    frame.line("float", points);
    for shape in [
        Shape::Circle,
        Shape::Up,
        Shape::Down,
        Shape::Plus,
        Shape::Cross,
    ] {
        frame.markers("fixed", shape, 4.0, points);
    }
    svg.add(&frame);
    svg.figure("a plot", "").html()
}

#[test]
fn ticks_are_round_and_labelled_alike() {
    let t = ticks(
        Interval {
            low: -2.16,
            high: -1.48,
        },
        8,
    );
    assert_eq!(
        t.labels,
        ["−2.1", "−2.0", "−1.9", "−1.8", "−1.7", "−1.6", "−1.5"]
    );
    assert_eq!(t.values[5], -1.6);
    let t = ticks(
        Interval {
            low: -0.3,
            high: 0.3,
        },
        6,
    );
    assert_eq!(
        t.labels,
        ["−0.3", "−0.2", "−0.1", "0.0", "0.1", "0.2", "0.3"]
    );
    let t = ticks(
        Interval {
            low: 0.0,
            high: 163.0,
        },
        5,
    );
    assert_eq!(t.labels, ["0", "50", "100", "150"]);
}

#[test]
fn very_small_and_very_large_values_get_an_exponent() {
    let t = ticks(
        Interval {
            low: 0.0,
            high: 3e-5,
        },
        4,
    );
    assert_eq!((t.labels[1].as_str(), t.exponent), ("10", -6));
    let t = ticks(
        Interval {
            low: 0.0,
            high: 2e7,
        },
        4,
    );
    assert_eq!((t.labels[1].as_str(), t.exponent), ("5", 6));
    assert_eq!(axis(0.0, 3e-5).labelled(-6), "rate, 10⁻⁶ deg/s");
}

#[test]
fn an_interval_is_never_empty() {
    let nothing: [f64; 0] = [];
    assert_eq!(
        Interval::of(nothing),
        Interval {
            low: 0.0,
            high: 1.0
        }
    );
    assert_eq!(
        Interval::of([f64::NAN, f64::INFINITY]),
        Interval {
            low: 0.0,
            high: 1.0
        }
    );
    assert_eq!(
        Interval::of([0.0, 0.0]),
        Interval {
            low: -1.0,
            high: 1.0
        }
    );
    let one = Interval::of([-5.0, f64::NAN]);
    assert!(one.low < -5.0 && one.high > -5.0);
}

#[test]
fn constant_missing_and_hostile_data_give_a_plot() {
    let nan = f64::NAN;
    let all: [&[(f64, f64)]; 6] = [
        &[],
        &[(1.0, 1.0); 3],
        &[(nan, 1.0), (1.0, nan), (nan, nan)],
        &[
            (0.0, f64::INFINITY),
            (1.0, 1.0),
            (2.0, f64::NEG_INFINITY),
            (3.0, 2.0),
        ],
        &[(1e300, -1e300), (1e-300, 1e-300)],
        &[(0.0, 0.0), (-8.4e-309, 1e-40)],
    ];
    for points in all {
        let text = plot(points);
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
        assert!(text.contains("<svg xmlns") && text.ends_with("</svg>"));
    }
}

#[test]
fn a_line_breaks_at_a_missing_value() {
    let text = plot(&[
        (0.0, 0.0),
        (1.0, 1.0),
        (2.0, f64::NAN),
        (3.0, 0.0),
        (4.0, 1.0),
    ]);
    let line = text
        .lines()
        .find(|l| l.contains("class=\"float\""))
        .unwrap();
    assert_eq!(line.matches('M').count(), 2);
    assert_eq!(line.matches('L').count(), 2);
}

#[test]
fn a_level_is_drawn_inside_the_frame_alone() {
    let levels = |y: f64| {
        let mut svg = Svg::new(900.0);
        let mut frame = svg.frame(200.0, 70.0, axis(0.0, 1.0), axis(-2.0, -1.0));
        frame.level("bound", y);
        svg.add(&frame);
        let page = svg.figure("a plot", "").html();
        page.contains("class=\"bound\"")
    };
    assert_eq!(
        [-1.5, -1.0, 0.0, -2.5].map(levels),
        [true, true, false, false]
    );
}

#[test]
fn text_is_escaped() {
    let mut svg = Svg::new(300.0);
    svg.legend([("fixed", Swatch::Line, "<script>".to_owned())]);
    let mut y = axis(0.0, 1.0);
    y.quantity = "<b>\"".to_owned();
    let frame = svg.frame(100.0, 60.0, y.clone(), y);
    svg.add(&frame);
    let text = svg.figure("\"><script>", "").html();
    assert!(!text.contains("<script>") && !text.contains("<b>"));
    assert!(text.contains("aria-label=\"&quot;&gt;&lt;script&gt;\""));
}

proptest! {
    #[test]
    fn ticks_lie_inside_and_are_few(a in -1e9f64..1e9, width in 1e-6f64..1e9, most in 2usize..12) {
        let interval = Interval::of([a, a + width]);
        let t = ticks(interval, most);
        let slack = 1e-5 * (interval.high - interval.low);
        prop_assert!(t.values.len() <= most + 1);
        prop_assert_eq!(t.values.len(), t.labels.len());
        for v in &t.values {
            prop_assert!(*v >= interval.low - slack && *v <= interval.high + slack);
        }
        let mut labels = t.labels.clone();
        labels.dedup();
        prop_assert_eq!(labels.len(), t.labels.len());
    }

    #[test]
    fn the_same_plot_gives_the_same_bytes(points in prop::collection::vec((any::<f64>(), any::<f64>()), 0..20)) {
        let text = plot(&points);
        prop_assert!(!text.contains("NaN") && !text.contains("inf"));
        prop_assert_eq!(text, plot(&points));
    }
}
