//! The closure of captures against a bank of captures whose cause only the bank knows.
//!
//! `GYROGEN_BLIND_CAPTURES=N` takes N seeds of each kind instead of the committed number, and
//! `GYROGEN_SEED=S` other seeds: those of the S-th set (0 is the committed one).

use crate::blind_capture::bench::{Bench, Dice};
use crate::blind_capture::faults::{Fault, Faults};
use crate::blind_capture::score::{Answer, Confusion, Mark, mark};
use gyrogen::capture;
use gyrogen::capture::input::Capture;
use gyrogen::capture::report::Findings;
use gyrogen::record::capture_meta::CaptureMeta;

fn seeds(first: u64, committed: u64) -> std::ops::Range<u64> {
    let asked = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<u64>().ok());
    let first = first + 1_000_000 * asked("GYROGEN_SEED").unwrap_or(0);
    first..first + asked("GYROGEN_BLIND_CAPTURES").unwrap_or(committed)
}

fn analysed(bench: &Bench, faults: &Faults) -> Findings {
    let meta = CaptureMeta {
        fs_hz: Some(bench.fs_hz),
        ftw: Some(bench.ftw),
        adc_bits: Some(bench.bits),
        drive_amplitude_codes: Some(bench.amplitude),
        sense_codes_per_dps: Some(bench.codes_per_dps),
        sense_phase_rad: Some(bench.sense_phase),
        rate_dps: bench
            .rate_known
            .then_some(bench.in_phase / bench.codes_per_dps),
    };
    let capture = Capture::new(bench.codes(faults).codes, meta, 16).unwrap();
    let (capture, said) = capture::examine::examined(capture).unwrap();
    // No effect makes wrong codes or a break of the sample clock.
    assert!(said.is_empty(), "{} {faults:?}: {said:?}", bench.seed);
    capture::analyse(&capture).unwrap()
}

fn answer(found: &Findings) -> Answer {
    for step in &found.steps {
        let told = step.parameters.keys().eq(step.parameter_std.keys());
        let finite = step
            .parameter_std
            .values()
            .all(|std| std.is_finite() && *std >= 0.0);
        assert!(told && finite, "{step:?}");
    }
    let steps = found.steps.iter();
    Answer {
        steps: steps
            .map(|s| (s.effect.clone(), s.indistinguishable_from.clone()))
            .collect(),
    }
}

/// The marks of many captures, two at a time.
fn run(cases: Vec<(u64, Bench, Faults)>) -> (Vec<Mark>, Confusion) {
    let next = std::sync::atomic::AtomicUsize::new(0);
    let done = std::sync::Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
                    let Some((seed, bench, faults)) = cases.get(k) else {
                        break;
                    };
                    let answer = answer(&analysed(bench, faults));
                    done.lock().unwrap().push((*seed, faults.clone(), answer));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap();
    done.sort_by_key(|d| d.0);
    let mut confusion = Confusion::default();
    let marks = done.iter().map(|(seed, faults, answer)| {
        let truth: Vec<&str> = faults.0.iter().map(Fault::id).collect();
        let mark = mark(answer, &truth);
        if !mark.first || !mark.all || mark.extra > 0 {
            println!(
                "seed {seed}: {:?} was answered by {:?}",
                faults.0, answer.steps
            );
        }
        confusion.add(&truth.join("+"), answer);
        mark
    });
    let marks = marks.collect();
    println!("{}", confusion.table());
    (marks, confusion)
}

fn share(marks: &[Mark], of: impl Fn(&Mark) -> bool) -> f64 {
    marks.iter().filter(|m| of(m)).count() as f64 / marks.len().max(1) as f64
}

/// A capture of the bank.
type Case = (u64, Bench, Faults);

fn single(seed: u64) -> Option<Case> {
    let mut bench = Bench::draw(seed);
    let mut dice = Dice::new(seed.wrapping_mul(77) + 5);
    let kind = (seed % 11) as usize;
    bench.rate_known |= kind == 7;
    bench.noise_after &= kind != 3;
    let top = 3.0 * (2.0 * bench.rows as f64).sqrt();
    let z = dice.spread(10.0, top.max(20.0));
    let fault = Fault::draw(&bench, kind, z, &mut dice)?;
    Some((seed, bench, Faults::of(vec![fault])))
}

fn clean(seed: u64) -> Option<Case> {
    let mut bench = Bench::draw(seed);
    let mut dice = Dice::new(seed);
    if seed.is_multiple_of(4) {
        bench.wander = dice.spread(1e-5, 1e-3);
    }
    Some((seed, bench, Faults::none()))
}

fn pair(seed: u64) -> Option<Case> {
    let bench = Bench::draw(seed);
    let mut dice = Dice::new(seed.wrapping_mul(31) + 3);
    let (a, b) = (dice.below(11), dice.below(11));
    let top = (1.5 * (2.0 * bench.rows as f64).sqrt()).max(40.0);
    let sizes = [dice.spread(20.0, top), dice.spread(20.0, top)];
    let first = Fault::draw(&bench, a, sizes[0], &mut dice)?;
    let second = Fault::draw(&bench, b, sizes[1], &mut dice)?;
    (first.id() != second.id()).then(|| (seed, bench, Faults::of(vec![first, second])))
}

/// Captures of other seeds that were once answered wrongly, each for a reason of its own.
#[test]
fn what_was_mended_stays() {
    let cases = [
        // A coarse phase truncation, whose blocks differ, was told as lost samples.
        single(5_001_028),
        // A slow line beside a tone of few phases was looked for in a quarter of the rows.
        single(5_001_115),
        // A truncated oscillator turned the sense tone to where another carrier was nearer.
        single(5_001_116),
        single(5_001_237),
        // Common jitter passed for the drive's noise in the sense codes.
        single(23_001_038),
        // The peaks that jitter bends passed for limits.
        single(23_001_016),
        single(24_001_015),
        // Lines of the quantiser's own, which a wander leaves, passed for pickup.
        clean(6_005_008),
        // A wander moved the rows of few phases together, and the codes that they left passed for missing.
        clean(77_005_008),
        clean(77_005_056),
        // A level less than a code inside of the drive's crest, beside one that cuts the sense channel deep.
        single(78_001_015),
        // An offset and the mains cancelled in the held-out rows.
        pair(5_009_076),
    ];
    let (marks, _) = run(cases.into_iter().flatten().collect());
    assert_eq!(marks.len(), 12);
    let right = |m: &Mark| m.all && m.extra == 0;
    assert!(marks.iter().all(right), "{marks:?}");
}

#[test]
fn single_effects_are_named() {
    let cases = seeds(1000, 44).filter_map(single);
    let (marks, _) = run(cases.collect());
    assert!(marks.len() > 26, "{}", marks.len());
    let first = share(&marks, |m| m.first);
    let extra = share(&marks, |m| m.extra > 0);
    println!(
        "{} singles: first {first:.3}, with more {extra:.3}",
        marks.len()
    );
    // What stands today (34 of 35, none with more), so that it does not fall unseen. Other seeds that were looked at
    // once (set 311, 111 captures): first 0.982, with more 0.009.
    assert!(first >= 0.93 && extra <= 0.03, "{first} {extra}");
}

#[test]
fn clean_captures_name_nothing() {
    let cases = seeds(5000, 40).filter_map(clean);
    let (marks, _) = run(cases.collect());
    let wrong = marks.iter().filter(|m| m.extra > 0).count();
    println!("{} clean: {wrong} named something", marks.len());
    // One in a hundred is the promise: more than four times that in a few is a failure.
    assert!(wrong <= 1 + marks.len() / 50, "{wrong} of {}", marks.len());
}

#[test]
fn pairs_are_named_in_full() {
    let cases = seeds(9000, 27).filter_map(pair);
    let (marks, _) = run(cases.collect());
    let first = share(&marks, |m| m.first);
    let all = share(&marks, |m| m.all);
    println!("{} pairs: first {first:.3}, both {all:.3}", marks.len());
    // What stands today (14 of 14), so that it does not fall unseen.
    assert!(first >= 0.85 && all >= 0.85, "{first} {all}");
}
