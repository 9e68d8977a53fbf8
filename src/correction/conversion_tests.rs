//! The conversion against real numbers over random designs, across the phase's ends, and its emitted code damaged.

use super::*;
use crate::correction::sample::unit;
use crate::correction::{Input, Plan, Term};
use crate::design::{LoopGain, PhaseLoop, reader};
use crate::emit::views::Language;
use crate::firmware::correction::Origin;
use crate::firmware::{conversion, files};
use crate::numeric::float::Float;
use crate::numeric::format::Format;
use crate::vectors::stimulus::Lcg;
use crate::verify::bundle::{Against, verify};
use crate::verify::target::Target;
use std::f64::consts::PI;

fn input(column: &str, offset: f64, scale: f64) -> Input {
    Input {
        column: column.to_owned(),
        offset,
        scale,
    }
}

fn plan(period_s: f64, inputs: Vec<Input>) -> Plan {
    let terms = (0..inputs.len()).map(|k| Term::Product {
        gain_dps: 30.0,
        factors: vec![(k, 1)],
    });
    Plan {
        period_s,
        full_scale_dps: 500.0,
        terms: terms.collect(),
        inputs,
    }
}

/// The default circuit with a phase loop.
fn design() -> Design {
    let mut design = reader::read(None).expect("the default design");
    let gain = LoopGain { raw: 1, shift: 6 };
    design.circuit.phase_loop = Some(PhaseLoop {
        setpoint_raw: 0,
        proportional: gain,
        integral: gain,
        integrator_bits: 48,
    });
    design
}

fn made(design: &Design, plan: &Plan) -> (Conversion, Correction) {
    let correction = Correction::auto(plan).expect("a correction");
    let conversion = Conversion::new(design, &correction).expect("a conversion");
    (conversion, correction)
}

/// A random design with a plan, in which every input of the chain's stands at a random place.
fn random(seed: u64) -> (Design, Plan) {
    let mut lcg = Lcg(seed ^ 0x00c0_47e5);
    (0..4).for_each(|_| _ = lcg.draw());
    let mut below = |n: u64| (lcg.draw() >> 33) % n;
    let mut design = design();
    let circuit = &mut design.circuit;
    circuit.cordic.angle_bits = 16 + below(17) as u32;
    circuit.nco.phase_bits = 24 + below(30) as u32;
    circuit.decimator.ratio = 16 << below(4);
    circuit.decimator.output.format = Format::q(2, 14 + below(12) as u32);
    circuit.sample_rate_hz = 2e4 + below(100_000) as f64;
    let rows = [1, 2, 3, 25, 100, 333][below(6) as usize];
    let mut sign = || if below(2) == 0 { 1.0 } else { -1.0 };
    let signs = [sign(), sign(), sign()];
    let mut inputs = vec![
        input("phase_rad", PI * unit(&mut lcg), signs[0] * 0.4),
        input("supply_v", 3.3, 0.2),
        input("freq_hz", 2e3 + 1e3 * unit(&mut lcg), signs[1] * 100.0),
        input("quad_dps", 50.0 * unit(&mut lcg), signs[2] * 200.0),
    ];
    // Any of them may be missing, but for one.
    for column in ["freq_hz", "quad_dps", "phase_rad"] {
        if unit(&mut lcg) < -0.5 && inputs.len() > 2 {
            inputs.retain(|i| i.column != column);
        }
    }
    let row_s = f64::from(design.circuit.decimator.ratio) / design.circuit.sample_rate_hz;
    (design, plan(row_s * f64::from(rows), inputs))
}

/// A row about the offsets, its words as real numbers of the columns' units.
struct Rows<'a> {
    conversion: &'a Conversion,
    plan: &'a Plan,
    lcg: Lcg,
    centre: Vec<f64>,
    /// Of each row's deviation, in scales.
    spread: f64,
}

impl Rows<'_> {
    fn begin(&mut self) {
        let reach = [0.2, 0.9, 1.3][(self.lcg.draw() >> 33) as usize % 3];
        self.centre = (0..4).map(|_| reach * unit(&mut self.lcg)).collect();
    }

    /// The raw words, and the values, those of the phase beyond half a turn where the row is.
    fn draw(&mut self) -> (Vec<i128>, Vec<f64>) {
        let channels = self.conversion.channels.iter().zip(&self.centre);
        let one = |(channel, centre): (&Channel, &f64)| {
            let (offset, scale) = match channel.input.map(|k| &self.plan.inputs[k]) {
                Some(input) => (input.offset, input.scale),
                None => (0.0, 450.0),
            };
            let x = centre + self.spread * unit(&mut self.lcg);
            let lsb = channel.column.lsb;
            let raw = ((offset + scale * x) / lsb).round() as i128;
            let range = channel.column.range;
            match channel.column.turn {
                None => {
                    let held = raw.clamp(range.low, range.high);
                    (held, held as f64 * lsb)
                }
                Some(turn) => {
                    let size = 1i128 << turn.bits;
                    (
                        (raw - range.low).rem_euclid(size) + range.low,
                        raw as f64 * lsb,
                    )
                }
            }
        };
        channels.map(one).unzip()
    }
}

/// Distances of all words of a design's readings from the exact mean, in shares of their bounds.
fn distances(seed: u64, spread: f64) -> (f64, usize) {
    let (design, plan) = random(seed);
    let (conversion, correction) = made(&design, &plan);
    let mut rows = Rows {
        conversion: &conversion,
        plan: &plan,
        lcg: Lcg(seed),
        centre: Vec::new(),
        spread,
    };
    let (mut fixed, mut float) = (conversion.stepper(), conversion.state::<Float>());
    let (mut worst, mut held) = (0.0f64, 0);
    for reading in 0..6 {
        rows.begin();
        // The third one begins anew after some rows of its own.
        let broken = if reading == 3 { conversion.rows / 2 } else { 0 };
        let mut sums = vec![0.0; conversion.channels.len()];
        for n in 0..broken + conversion.rows {
            let (raw, values) = rows.draw();
            let restart = i128::from(broken > 0 && n == broken);
            if n == broken {
                sums.fill(0.0);
            }
            sums.iter_mut().zip(&values).for_each(|(s, v)| *s += v);
            let mut words = Vec::new();
            fixed.call(&[&[restart][..], &raw].concat(), &mut words);
            let as_real: Vec<f64> = raw.iter().map(|w| *w as f64).collect();
            let real = conversion.run(&Float, &mut float, restart as f64, &as_real);
            let is_last = n + 1 == broken + conversion.rows;
            assert_eq!(words[0], i128::from(is_last), "design {seed}, row {n}");
            assert_eq!(real[0] as i128, words[0]);
            if !is_last {
                continue;
            }
            for (k, channel) in conversion.channels.iter().enumerate() {
                let mean = sums[k] / f64::from(conversion.rows);
                let (exact, format) = match channel.input {
                    Some(i) => {
                        let input = &plan.inputs[i];
                        let x = (mean - input.offset) / input.scale;
                        (x, correction.formats.inputs[i])
                    }
                    None => (mean, correction.formats.rate),
                };
                let exact = exact / format.lsb();
                let (low, high) = (format.min_raw() as f64, format.max_raw() as f64);
                let inside = (low..=high).contains(&exact);
                held += usize::from(!inside);
                let off = (words[k + 1] as f64 - exact.clamp(low, high)).abs();
                let of_float = (real[k + 1] / format.lsb() - exact).abs();
                worst = worst.max(off / channel.error_lsb);
                let what = format!("design {seed}, reading {reading}: {}", channel.meaning);
                assert!(off <= channel.error_lsb, "{what}: {off} LSB");
                assert!(
                    !inside || of_float <= channel.error_lsb,
                    "{what}: {of_float} LSB"
                );
            }
        }
    }
    (worst, held)
}

#[test]
fn words_are_the_exact_means_to_within_the_stated_error_on_random_designs() {
    let (mut worst, mut held) = (0.0f64, 0);
    for seed in 0..300 {
        let (share, beyond) = distances(seed, 0.3);
        worst = worst.max(share);
        held += beyond;
    }
    // Half an LSB of it is the last rounding's.
    assert!(worst > 0.85, "an idle bound: {worst}");
    assert!(held > 200, "{held} words beyond their format");
}

#[test]
fn the_stated_error_is_little_more_than_the_last_rounding() {
    for seed in 0..300 {
        let (design, plan) = random(seed);
        for error in made(&design, &plan).0.error_lsb() {
            assert!((0.5..0.61).contains(&error), "design {seed}: {error}");
        }
    }
}

/// Readings of two rows with phases in shares of half a turn: what comes out of x = phase / scale, in half turns.
fn of_phases(offset: f64, scale: f64, readings: &[[f64; 2]]) -> Vec<f64> {
    let mut design = design();
    design.circuit.cordic.angle_bits = 24;
    let row_s = f64::from(design.circuit.decimator.ratio) / design.circuit.sample_rate_hz;
    let plan = plan(
        2.0 * row_s,
        vec![input("phase_rad", offset * PI, scale * PI)],
    );
    let (conversion, correction) = made(&design, &plan);
    let mut stepper = conversion.stepper();
    let half = pow2(23);
    let mut means = Vec::new();
    for phases in readings {
        let mut words = Vec::new();
        for phase in phases {
            words.clear();
            let raw = ((phase * half).round() as i128).clamp(-(1 << 23), (1 << 23) - 1);
            stepper.call(&[0, raw, 0], &mut words);
        }
        means.push(words[1] as f64 * correction.formats.inputs[0].lsb());
    }
    means
}

#[test]
fn a_phase_that_crosses_half_a_turn_has_the_mean_that_it_would_have_elsewhere() {
    let near = |got: &[f64], due: &[f64]| {
        let close = got.iter().zip(due).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(close && got.len() == due.len(), "{got:?}, due {due:?}");
    };
    // About an offset near the end of the words: 0.99 and -0.99 half turns have the mean 1, not 0.
    let x = of_phases(
        0.98,
        0.1,
        &[[0.99, -0.99], [-0.99, 0.99], [0.95, 0.97], [-1.0, -0.98]],
    );
    near(&x, &[0.2, 0.2, -0.2, 0.3]);
    // On the far side of the circle what comes out is held at the end that the first row is nearer to, never in
    // the middle.
    let x = of_phases(0.0, 0.5, &[[0.99, -0.99], [-0.99, 0.99]]);
    near(&x, &[1.0, -1.0]);
    // An offset stated a turn away is the same.
    near(&of_phases(2.25, 0.5, &[[0.5, 0.5]]), &[0.5]);
    // The whole circle.
    near(
        &of_phases(0.0, 1.0, &[[0.5, 0.25], [-0.5, -1.0]]),
        &[0.375, -0.75],
    );
}

fn refusal(design: &Design, plan: &Plan) -> String {
    let correction = Correction::auto(plan).expect("a correction");
    let refused = Conversion::new(design, &correction).expect_err("refused");
    assert!(
        matches!(refused, crate::error::Error::Input(_)),
        "{refused}"
    );
    refused.to_string()
}

#[test]
fn what_cannot_be_converted_is_refused_with_the_rule() {
    let phase = || vec![input("phase_rad", 0.0, 0.4)];
    let good = design();
    let row_s = f64::from(good.circuit.decimator.ratio) / good.circuit.sample_rate_hz;
    let mut without = good.clone();
    without.compensation = None;
    assert!(refusal(&without, &plan(1.0, phase())).contains("[compensation]"));
    for (plan, rule) in [
        (
            plan(1.0, vec![input("supply_v", 3.3, 0.2)]),
            "none of its inputs",
        ),
        (plan(0.9 * row_s, phase()), "shorter than one row"),
        (plan(2.4 * row_s, phase()), "2.400 rows"),
        (plan(3e7 * row_s, phase()), "at most 16777216"),
        (
            plan(1.0, [phase(), phase()].concat()),
            "two inputs are `phase_rad`",
        ),
        (plan(1.0, vec![input("phase_rad", 0.0, 1e-7)]), "one LSB"),
    ] {
        let said = refusal(&good, &plan);
        assert!(said.contains(rule), "{said}");
    }
    // Without a phase loop there is no frequency to read.
    let mut fixed = good.clone();
    fixed.circuit.phase_loop = None;
    let frequency = plan(1.0, vec![input("freq_hz", 1750.0, 1.0)]);
    assert!(refusal(&fixed, &frequency).contains("none of its inputs"));
    assert!(Conversion::new(&good, &Correction::auto(&frequency).expect("one")).is_ok());
    let mut long = good.clone();
    long.circuit.nco.phase_bits = 63;
    assert!(refusal(&long, &frequency).contains("63 bits"));
}

const ORIGIN: Origin = Origin {
    prefix: "tested",
    sha256: "0",
    command: "test",
};

/// Compared words that differ, and whether the self-test passes.
fn verified(folder: &std::path::Path) -> (u64, bool) {
    let emit = |_: &std::path::Path, _: &_| Ok(Vec::new());
    let found = verify(folder, Target::Host, &Against::default(), &emit, "test").expect("built");
    (found.vectors.mismatches, found.selftest == Some(true))
}

#[test]
fn emitted_code_is_the_model_and_every_damage_to_it_shows() {
    // Three inputs, readings of 25 rows; then a reading that the vectors in order do not reach the end of.
    for (rows, damaged) in [(25.0, true), (17_500.0, false)] {
        let design = design();
        let row_s = f64::from(design.circuit.decimator.ratio) / design.circuit.sample_rate_hz;
        let inputs = vec![
            input("phase_rad", -1.8, 0.4),
            input("freq_hz", 1750.3, -10.0),
            input("supply_v", 3.3, 0.2),
            input("quad_dps", 3.7, 40.0),
        ];
        let (conversion, _) = made(&design, &plan(rows * row_s, inputs));
        for language in [Language::C, Language::Rust] {
            let emitted = conversion::emit(&conversion, &ORIGIN, language).expect("emitted");
            let folder = tempfile::tempdir().expect("a folder");
            files::write(&emitted, folder.path()).expect("written");
            assert_eq!(verified(folder.path()), (0, true), "{language:?} {rows}");
            if language == Language::Rust || !damaged {
                continue;
            }
            let source = emitted.iter().find(|f| f.path == "tested.c").expect("C");
            let all = damages(&source.text);
            assert!(all.len() > 20, "{}: {}", all.len(), source.text);
            // A compiler runs for each: every other one.
            for (line, text) in all.into_iter().step_by(2) {
                std::fs::write(folder.path().join("tested.c"), text).expect("written");
                let (differing, _) = verified(folder.path());
                assert!(differing > 0, "passes: {line}");
            }
        }
    }
}

/// The source without one of its stores or rounding constants, or with one more in one of its other constants.
/// Not those that change nothing: the limit of `restart`, of which only the sign is read, and the limits of the
/// rounded sums, beyond which the result saturates.
fn damages(text: &str) -> Vec<(String, String)> {
    let lines: Vec<&str> = text.lines().collect();
    let mut all = Vec::new();
    for (k, line) in lines.iter().enumerate() {
        let with = |other: String| {
            let mut lines: Vec<String> = lines.iter().map(|l| (*l).to_owned()).collect();
            lines[k] = other;
            ((*line).to_owned(), lines.join("\n"))
        };
        let is = |name: &str| line.contains(&format!(" {name}"));
        if let (true, Some((_, value))) =
            (line.trim_start().starts_with("s->"), line.split_once(" = "))
        {
            let value = value.trim_end_matches(';');
            all.push(with(format!("    (void)({value});")));
        }
        if is("restart_in_range = ") || is("limited") && line.contains("clamp") {
            continue;
        }
        for (start, _) in line.match_indices("_C(") {
            let rest = &line[start + 3..];
            let digits = &rest[..rest.find(')').unwrap_or(0)];
            if let (Ok(value), true) = (digits.parse::<i64>(), line.contains(" = ")) {
                let other = if is("biased") { 0 } else { value + 1 };
                let (before, after) = (&line[..start + 3], &rest[digits.len()..]);
                all.push(with(format!("{before}{other}{after}")));
            }
        }
    }
    all
}
