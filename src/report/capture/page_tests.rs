//! The page of captures that are made up.

use super::*;
use crate::capture::closed;
use crate::capture::input::Capture;
use crate::design::reader;
use crate::record::capture_meta::CaptureMeta;
use crate::thermal::synthetic::Random;
use std::f64::consts::TAU;

const ROWS: usize = 12_000;

/// 12 bits at 200 kHz, 0.8 LSB of noise, both channels with `fault` before the converter, and a rule after it.
fn made(fault: impl Fn(usize, f64, f64) -> f64, after: impl Fn(i32) -> i32) -> Closed {
    let ftw = 224_633_197u32;
    let mut random = Random::new(3);
    let mut codes = [Vec::new(), Vec::new()];
    for row in 0..ROWS {
        let turns = f64::from(ftw.wrapping_mul(row as u32)) / 4_294_967_296.0;
        let sense = 300.0 * (TAU * turns + 0.1).sin() + 150.0 * (TAU * turns + 0.1).cos();
        for (codes, x) in codes.iter_mut().zip([-1500.0 * (TAU * turns).cos(), sense]) {
            let x = fault(row, x, random.normal()) + 0.8 * random.normal();
            codes.push(after((x + 0.5).floor() as i32));
        }
    }
    let meta = CaptureMeta {
        fs_hz: Some(200e3),
        ftw: Some(ftw),
        adc_bits: Some(12),
        drive_amplitude_codes: Some(1500.0),
        ..CaptureMeta::default()
    };
    let capture = Capture::new(codes, meta, 12).unwrap();
    let design = reader::parse("", None).unwrap();
    closed(capture, Vec::new(), &design, "gyrogen close <x>").unwrap()
}

/// Every tag is closed in order, but for those of HTML that have no end.
fn assert_well_formed(page: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page;
    while let Some((_, tail)) = rest.split_once('<') {
        let (tag, after) = tail.split_once('>').expect("a tag has an end");
        assert!(!tag.contains('<'), "{tag}");
        rest = after;
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.starts_with('!') && !tag.ends_with('/') {
            let name = tag.split_whitespace().next().unwrap_or("");
            if name != "meta" {
                open.push(name);
            }
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

fn assert_sound(page: &str, closed: &Closed) {
    assert_well_formed(page);
    let bare = page.replace("http://www.w3.org/2000/svg", "");
    for absent in [
        "<script", "http://", "https://", "<up>", "<x>", "NaN", "inf ",
    ] {
        assert!(!bare.contains(absent), "{absent}");
    }
    for (k, step) in closed.closure.steps.iter().enumerate() {
        assert!(page.contains(&format!("{}. {}", k + 1, step.effect)));
        for name in step.parameters.keys() {
            assert!(page.contains(name), "{name}");
        }
    }
    assert_eq!(closed.closure.evidence.len(), 11);
    for candidate in &closed.closure.evidence {
        let row = format!("class=\"code\">{}</th>", candidate.effect);
        assert!(page.contains(&row), "{}", candidate.effect);
    }
}

fn steps(closed: &Closed) -> Vec<&str> {
    let steps = closed.closure.steps.iter();
    steps.map(|s| s.effect.as_str()).collect()
}

#[test]
fn the_page_shows_a_bend_and_a_pickup_and_is_the_same_twice() {
    let make = || {
        made(
            |row, x, _| {
                let u = x / 2048.0;
                let mains = 0.5 * (TAU * 50.0 * row as f64 / 200e3 + 0.4).sin();
                x + 2.0 * (0.6 * u * u - 0.8 * u.powi(3)) + mains
            },
            |code| code,
        )
    };
    let closed = make();
    assert!(
        steps(&closed).contains(&"mains_pickup"),
        "{:?}",
        steps(&closed)
    );
    let page = html(&closed, "made<up>.csv").unwrap();
    assert_sound(&page, &closed);
    for what in [
        "fitted bend",
        "pickup found",
        "held-out rows",
        "Histogram of the codes",
    ] {
        assert!(page.contains(what), "{what}");
    }
    assert!(!page.contains("Noise against slope") && !page.contains("missing codes</li>"));
    // Codes, fit and page anew.
    assert_eq!(page, html(&make(), "made<up>.csv").unwrap());
    // The curve is the planted bend, within its band, at the ends of the drive.
    let bend = closed.findings.bends[0].as_ref().expect("drive bends");
    for [code, value, std] in bend.iter().filter(|p| p[0].abs() < 1500.0) {
        let u = code / 2048.0;
        let planted = 2.0 * (0.6 * u * u - 0.8 * u.powi(3));
        assert!(
            (value - planted).abs() < 5.0 * std + 1e-9,
            "{code}: {value} {planted} {std}"
        );
        assert!(*std < 0.2);
    }
}

#[test]
fn jitter_and_missing_codes_have_their_marks() {
    let step = TAU * 224_633_197.0 / 4_294_967_296.0;
    let jitter = made(
        |_, x, z| x + 0.006 * step * z * (1500.0f64.powi(2) - x * x).max(0.0).sqrt(),
        |code| code,
    );
    assert_eq!(steps(&jitter), ["aperture_jitter"]);
    let page = html(&jitter, "j.csv").unwrap();
    assert_sound(&page, &jitter);
    assert!(page.contains("Noise against slope") && page.contains("stays at"));
    let gone = |code: i32| code - i32::from(code.rem_euclid(23) == 5);
    let missing = made(|_, x, _| x, gone);
    assert_eq!(steps(&missing), ["adc_missing_codes"]);
    let page = html(&missing, "m.csv").unwrap();
    assert_sound(&page, &missing);
    assert!(page.contains("missing codes</li>"));
}

#[test]
fn the_histogram_expects_what_is_counted() {
    let clean = made(|_, x, _| x, |code| code);
    let view = View::new(&clean);
    for left in &view.after {
        let h = &left.histogram;
        assert_eq!(h.counted.iter().sum::<f64>(), ROWS as f64);
        let mut chi = 0.0;
        let mut bars = 0.0;
        for (counted, expected) in h.counted.iter().zip(&h.expected) {
            if *expected > 5.0 {
                chi += (counted - expected).powi(2) / expected;
                bars += 1.0;
            }
        }
        // The tone visits its phases evenly, so counts vary less than a Poisson count; never much more.
        assert!(bars > 50.0 && chi < 1.5 * bars, "{chi} of {bars}");
    }
    assert_sound(&html(&clean, "c.csv").unwrap(), &clean);
}

#[test]
fn the_pages_residuals_have_the_rms_of_the_table() {
    let closed = made(|_, x, _| x + 3.0, |code| code);
    let view = View::new(&closed);
    let (mut rows, mut squares) = (0.0, 0.0);
    for cell in view.before.iter().flat_map(|l| &l.by_code) {
        rows += cell.rows;
        squares += cell.squares;
    }
    let (train, held) = (
        closed.closure.before.train_rms,
        closed.closure.before.heldout_rms,
    );
    let rms = (squares / rows).sqrt();
    assert!(
        rms > 2.0 && rms >= train.min(held) && rms <= train.max(held),
        "{train} {rms} {held}"
    );
}
