//! `gyrogen equiv`: both arithmetics at once, bounds, overflow and its repair, on random designs.
//!
//! Environment: `GYROGEN_EQUIV_DESIGNS` (how many), `GYROGEN_SEED` (the first seed).

use crate::oracle::generate::{self, Aim};
use crate::oracle::harness::setting;
use crate::oracle::toml_text::Printer;
use crate::rng::Rng;
use gyrogen::circuit::engine::{self, ArithmeticKind, Rows};
use gyrogen::cosim::stream::stimulus;
use gyrogen::design::{Design, reader};
use gyrogen::equivalence::predicted::predict;
use gyrogen::nodes::repair::{one_bit_less, repairs, smallest_repair};
use gyrogen::nodes::run::{run, run_with_rows};
use gyrogen::numeric::format::{Format, Overflow, Rounding};

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
    gyrogen::vectors::stimulus::segments(design, samples, samples / 9 + 1, seed)
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
        let expected = engine_rows(&design, ArithmeticKind::Fixed, &drive, &sense).raw();
        assert_eq!(
            Some(&raw),
            expected.as_ref(),
            "seed {seed}: raw words\n{text}"
        );
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
    let (mut repaired, mut shorter) = (0, 0);
    for seed in first..first + 3 * DESIGNS {
        let (text, design) = random_design(seed);
        let (drive, sense) = codes(&design, seed);
        let seen = run(&design, &drive, &sense);
        if seen.first_overflow.is_none() {
            continue;
        }
        let (changes, clean) = repairs(&design, &seen, (&drive, &sense));
        assert!(!clean || !changes.is_empty(), "seed {seed}");
        // What cannot be repaired needs a word of more than 64 or 127 bits.
        repaired += u64::from(clean);
        // The only repair: what it leaves is clean, and one bit less is not.
        let [only] = changes.as_slice() else {
            continue;
        };
        let (mut now, mut at) = smallest_repair(&design, &seen).expect("the same again");
        while now.to != only.to {
            (now, at) = one_bit_less(&now, &at).expect("on the way to the repair");
        }
        if let Some((_, less)) = one_bit_less(&now, &at) {
            let next = run(&less, &drive, &sense).first_overflow;
            assert!(
                next.is_some(),
                "seed {seed}: one bit less than {only:?} is enough\n{text}"
            );
            shorter += 1;
        }
    }
    println!("{repaired} repaired, {shorter} with one bit less");
    assert!(repaired > 20 && shorter > 10, "{repaired} {shorter}");
}

/// The default design with other word lengths, oscillator and decimator.
fn sensible_design(seed: u64) -> Design {
    let mut rng = Rng::new(seed);
    let mut design = reader::read(None).expect("the default");
    let c = &mut design.circuit;
    c.adc.format = Format::q(1, rng.range(9, 19) as u32);
    c.nco.table_address_bits = rng.range(6, 14) as u32;
    c.nco.address_rounding = rng.pick(&[Rounding::Floor, Rounding::HalfUp]);
    c.nco.table = Format::q(1, rng.range(9, 22) as u32);
    c.nco.tuning_word = match rng.range(0, 3) {
        0 => 1 << rng.range(25, 29),
        1 => (1 << 27) + rng.range(1, 1000),
        _ => ((1i64 << 32) as f64 / (5.0 + 60.0 * rng.unit())) as i64,
    };
    let exact = (c.adc.format.fraction_bits + c.nco.table.fraction_bits) as i64;
    let product = exact - rng.range(-1, 12);
    c.demodulator.product.format = Format::q(2, product as u32);
    c.demodulator.product.rounding = rng.pick(&Rounding::ALL);
    c.decimator.stages = rng.range(1, 4) as u32;
    c.decimator.ratio = rng.range(8, 90) as u32;
    c.decimator.differential_delay = rng.range(1, 2) as u32;
    let output = (product + rng.range(-8, 5)).clamp(8, 30);
    c.decimator.output.format = Format::q(2, output as u32);
    c.decimator.output.rounding = rng.pick(&Rounding::ALL);
    c.cordic.iterations = rng.range(8, 24) as u32;
    c.cordic.guard_bits = rng.range(0, 8) as u32;
    c.cordic.width = 2 + output as u32 + c.cordic.guard_bits + 2;
    c.cordic.angle_bits = rng.range(12, 32) as u32;
    // The oscillator stays at the gyro's resonance, the amplitude where it was.
    let turns = c.nco.tuning_word as f64 / f64::powi(2.0, c.nco.phase_bits as i32);
    c.sample_rate_hz = 1750.0 / turns;
    if let Some(l) = &mut c.amplitude_loop {
        l.setpoint_raw = 1 << (output - 2);
    }
    if let Some(comp) = &mut design.compensation {
        comp.accumulator.format = Format::q(14, rng.range(20, 30) as u32);
        comp.accumulator.rounding = rng.pick(&Rounding::ALL);
        comp.output.format = Format::q(13, rng.range(2, 16) as u32);
        comp.output.rounding = rng.pick(&Rounding::ALL);
    }
    design
}

fn parameters(design: &Design) -> String {
    let c = &design.circuit;
    format!(
        "word {} adc {} table {} a {} product {} N {} R {} M {} output {} iterations {} guard {}",
        c.nco.tuning_word,
        c.adc.format,
        c.nco.table,
        c.nco.table_address_bits,
        c.demodulator.product,
        c.decimator.stages,
        c.decimator.ratio,
        c.decimator.differential_delay,
        c.decimator.output,
        c.cordic.iterations,
        c.cordic.guard_bits
    )
}

/// Predicted and observed rms within 10 % on every node that no flag excuses.
#[test]
fn the_predicted_rms_is_the_observed_one_where_its_conditions_hold() {
    let first: u64 = setting("GYROGEN_SEED", 7);
    let designs: u64 = setting("GYROGEN_EQUIV_DESIGNS", 24);
    let mut failures = Vec::new();
    let (mut predicted, mut unflagged, mut all, mut locals) = (0, 0, 0, 0);
    for seed in first..first + designs {
        let design = sensible_design(seed);
        let (drive, sense) = stimulus(&design, 400_000).expect("a run");
        let seen = run(&design, &drive, &sense);
        let predictions = predict(&design, &seen);
        for (node, p) in seen.nodes.iter().zip(&predictions) {
            all += 1;
            let name = &node.identity.name;
            assert_eq!(node.outside, 0, "seed {seed}: {name} {:?}", node.worst);
            if let Some(rms) = p.rms {
                predicted += 1;
                let observed = node.rms_error();
                let off = (rms / observed - 1.0).abs();
                // Both exact, but for the float's own rounding.
                let nothing = observed.max(rms) < 1e-13 * node.mean_square_value().sqrt();
                // With a flag the figure is a model's whose conditions do not hold.
                let allowed = if p.flags.is_empty() { 0.1 } else { 2.0 };
                unflagged += u32::from(p.flags.is_empty());
                if !nothing && (off.is_nan() || off > allowed) {
                    failures.push(format!(
                        "seed {seed}: {name}: predicted {rms:.4e}, observed {observed:.4e} ({:.2}) flags {:?} {}",
                        rms / observed, p.flags, parameters(&design)
                    ));
                }
            }
            if let (Some(rms), Some(observed)) = (p.local_rms_lsb, node.local_rms_lsb()) {
                locals += 1;
                if (rms / observed - 1.0).abs() > 0.1 || observed.is_nan() {
                    failures.push(format!(
                        "seed {seed}: {name}: local predicted {rms:.4}, observed {observed:.4}"
                    ));
                }
            }
        }
    }
    println!(
        "{predicted} of {all} nodes predicted, {unflagged} without a flag, {locals} roundings"
    );
    assert!(
        failures.is_empty(),
        "{} of {predicted}\n{}",
        failures.len(),
        failures.join("\n")
    );
    // Half of the designs have few or clustered phases.
    assert!(predicted > all / 4 && unflagged > all / 5);
}
