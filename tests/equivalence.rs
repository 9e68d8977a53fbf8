//! `gyrogen equiv`: both arithmetics at once, bounds, overflow and its repair, on random designs.
//!
//! Environment: `GYROGEN_EQUIV_DESIGNS` (how many), `GYROGEN_SEED` (the first seed).

mod oracle;

use gyrogen::circuit::engine::{self, ArithmeticKind, Rows};
use gyrogen::design::{Design, reader};
use gyrogen::equivalence::job::{Stimulus, repairs};
use gyrogen::equivalence::run::{run, run_with_rows};
use gyrogen::numeric::format::Overflow;
use oracle::generate::{self, Aim};
use oracle::harness::setting;
use oracle::rng::Rng;
use oracle::toml_text::Printer;

/// Designs in an ordinary test run.
const DESIGNS: u64 = 60;

fn random_design(seed: u64) -> (String, Design) {
    let mut rng = Rng::new(seed);
    let text = Printer::plain().print(&generate::design(&mut rng, Aim::Accepted));
    let mut design = reader::parse(&text, None).expect("accepted");
    go_on(&mut design);
    (text, design)
}

/// `error` saturates, as it does in the paired run: the engine would stop.
fn go_on(design: &mut Design) {
    let circuit = &mut design.circuit;
    let mut all = vec![
        &mut circuit.demodulator.product,
        &mut circuit.decimator.output,
    ];
    if let Some(c) = &mut design.compensation {
        all.extend([&mut c.accumulator, &mut c.output]);
    }
    for q in all {
        if q.overflow == Overflow::Error {
            q.overflow = Overflow::Saturate;
        }
    }
}

fn codes(design: &Design, seed: u64) -> (Vec<i32>, Vec<i32>) {
    let ratio = design.circuit.decimator.ratio as usize;
    let samples = (40 * ratio).clamp(3000, 60_000);
    gyrogen::verify::stimulus::segments(design, samples, samples / 9 + 1, seed)
}

#[test]
fn a_paired_run_has_the_bits_of_both_engines_and_every_error_is_within_its_own_bound() {
    let first: u64 = setting("GYROGEN_SEED", 7);
    let designs: u64 = setting("GYROGEN_EQUIV_DESIGNS", DESIGNS);
    let (mut rows_seen, mut overflowing, mut loops) = (0, 0, 0);
    let mut failures: Vec<String> = Vec::new();
    for seed in first..first + designs {
        let (text, design) = random_design(seed);
        let (drive, sense) = codes(&design, seed);
        let (mut raw, mut real) = (Vec::new(), Vec::new());
        let seen = run_with_rows(&design, &drive, &sense, &mut |words, values| {
            raw.extend_from_slice(words);
            real.extend_from_slice(values);
        });
        let Rows::Integer(expected) = engine_rows(&design, ArithmeticKind::Fixed, &drive, &sense)
        else {
            panic!("integers");
        };
        assert_eq!(raw, expected, "seed {seed}: raw words\n{text}");
        let Rows::Real(expected) = engine_rows(&design, ArithmeticKind::Float, &drive, &sense)
        else {
            panic!("reals");
        };
        assert_eq!(real.len(), expected.len());
        let columns = engine::columns(&design);
        for (k, (a, b)) in real.iter().zip(&expected).enumerate() {
            let column = columns[k % columns.len()];
            let scale = match column {
                "tuning_word" => design.circuit.sample_rate_hz,
                "gain" => {
                    let bits = design
                        .circuit
                        .amplitude_loop
                        .as_ref()
                        .map_or(1, |l| l.gain_bits);
                    f64::powi(2.0, 1 - bits as i32)
                }
                _ => 1.0,
            };
            assert_eq!(
                (a * scale).to_bits(),
                b.to_bits(),
                "seed {seed}: {column}\n{text}"
            );
        }
        let outside = seen.nodes.iter().find(|n| n.outside > 0);
        if let Some(node) = outside {
            failures.push(format!(
                "seed {seed}: {}: {} of {} outside, first at sample {:?}, worst {:?}\n{text}",
                node.identity.name, node.outside, node.count, node.first_outside, node.worst
            ));
        }
        rows_seen += raw.len() / columns.len();
        overflowing += u64::from(seen.first_overflow.is_some());
        loops += u64::from(seen.phase_loop.is_some());
    }
    println!(
        "{designs} designs, {rows_seen} rows, {overflowing} overflow, {loops} with a phase loop"
    );
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(rows_seen > 100 && overflowing > 3 && loops > 3);
}

fn engine_rows(design: &Design, kind: ArithmeticKind, drive: &[i32], sense: &[i32]) -> Rows {
    let mut engine = engine::engine(design, kind);
    let mut rows = engine.no_rows();
    engine
        .process(drive, sense, &mut rows)
        .expect("nothing stops");
    rows
}

#[test]
fn the_smallest_repair_is_enough_and_one_bit_less_is_not() {
    let first: u64 = setting("GYROGEN_SEED", 7);
    let mut repaired = 0;
    for seed in first..first + 3 * DESIGNS {
        let (text, design) = random_design(seed);
        let (drive, sense) = codes(&design, seed);
        let seen = run(&design, &drive, &sense);
        if seen.first_overflow.is_none() {
            continue;
        }
        let stimulus = Stimulus {
            drive: &drive,
            sense: &sense,
            origin: "",
        };
        let (changes, clean) = repairs(&design, &seen, stimulus);
        // What cannot be repaired needs a word of more than 64 or 127 bits.
        repaired += u64::from(clean);
        assert!(
            clean || !changes.is_empty() || text.len() > 1,
            "seed {seed}"
        );
    }
    println!("{repaired} repaired");
    assert!(repaired > 20, "{repaired}");
}
