//! `cargo bench --bench closed_loop -- PERIODS ROUNDS`: the gyro of the default design in closed loop with its
//! bit-accurate circuit, noise and all, against hand-written C of the same by the compilers that are here, in
//! the same run.
//!
//! All take turns, and the fastest run of each counts. All have to give the same checksum of every row's words.
//! Nothing is asserted of times.

use gyrogen::circuit::engine::ArithmeticKind;
use gyrogen::cosim::{Path, RealRow};
use gyrogen::design::{Design, template};
use gyrogen::plant::Temperatures;
use gyrogen::plant::gyroscope::Conditions;
use gyrogen::plant::noise::{Noise, Pairs, Shared, Walk};
use std::path::PathBuf;
use std::time::Instant;

mod common;
use common::{Contestant, RUNS};

/// The conditions that `opponents/closed_loop.c` has as constants.
const DEGC: f64 = 25.0;
const RATE_DPS: f64 = 10.0;

enum Run {
    Here,
    Program(PathBuf, &'static str),
}

fn main() {
    let [periods, rounds] = common::numbers([1 << 17, 10]);
    let design = template::default_design().expect("the embedded default");
    let folder = tempfile::tempdir().expect("a folder for the programs");
    let mut contestants = vec![Contestant::new("gyrogen".into(), false, Run::Here)];
    // What the compilers need to put a square root into SIMD lanes.
    for built in common::built(folder.path(), "closed_loop.c", &["-fno-math-errno"]) {
        for way in ["serial", "block"] {
            let run = Run::Program(built.program.clone(), way);
            contestants.push(Contestant::new(
                format!("C {way}, {}", built.name),
                true,
                run,
            ));
        }
    }
    common::take_turns(&mut contestants, rounds, |run| match run {
        Run::Here => here(&design, periods),
        Run::Program(path, way) => {
            let arguments = [*way, &periods.to_string(), &RUNS.to_string()];
            common::program(path, &arguments.map(String::from))
        }
    });
    let samples = periods * design.circuit.decimator.ratio as usize;
    common::report("closed loop with the plant", samples, &contestants);
}

fn here(design: &Design, periods: usize) -> (f64, u64) {
    let conditions = Conditions {
        temperatures: Temperatures {
            chamber_degc: DEGC,
            structure_degc: DEGC,
            electronics_degc: DEGC,
            lagged_degc: DEGC,
            structure_k_per_s: 0.0,
        },
        rate_dps: RATE_DPS,
        extra_bias_dps: 0.0,
        drive_q: design.gyro.drive_q,
        softening: 0.0,
    };
    let mut rows: Vec<RealRow> = Vec::new();
    let mut seconds = f64::INFINITY;
    for _ in 0..RUNS {
        rows.clear();
        let noise = Shared::new(Noise::new(design.thermal_run.seed, 0));
        let walk = noise.walk();
        touch(&walk);
        let mut path = Path::new(design, ArithmeticKind::Fixed);
        path.start(conditions);
        let start = Instant::now();
        for _ in 0..periods {
            rows.push(path.period(&walk).expect("no cast stops"));
        }
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    (seconds, checksum(design, &rows))
}

/// Has the memory of a stream's chunks written to, as the opponents have theirs; nothing of it is used again.
fn touch(walk: &Walk) {
    const FAR: u64 = 1 << 40;
    const PAIRS: usize = 1 << 19;
    let mut pairs = [vec![0f32; PAIRS], vec![0f32; PAIRS]];
    walk.fill(FAR, pairs.each_mut().map(|p| &mut p[..]));
}

/// Of the words that the rows were made of. The gain is that which a row gives; a row states that under which
/// its samples were taken, so the last row has none.
fn checksum(design: &Design, rows: &[RealRow]) -> u64 {
    let circuit = &design.circuit;
    let channel_lsb = circuit.decimator.output.format.lsb();
    let phase_lsb = std::f64::consts::TAU / 2f64.powi(circuit.cordic.angle_bits as i32);
    let output = design.compensation.as_ref().map(|c| c.output.format.lsb());
    let rate_lsb = output.unwrap_or(1.0);
    let gain_bits = circuit.amplitude_loop.as_ref().map_or(1, |l| l.gain_bits);
    let gain_lsb = 2f64.powi(1 - gain_bits as i32);
    let mut checksum = common::NO_WORDS;
    for pair in rows.windows(2) {
        let [row, next] = pair else { continue };
        let channels = row.channels.map(|c| c / channel_lsb);
        let others = [
            row.phase_rad / phase_lsb,
            row.magnitude / channel_lsb,
            row.rate_dps / rate_lsb,
            next.gain / gain_lsb,
        ];
        for value in channels.into_iter().chain(others) {
            checksum = common::with_word(checksum, value.round() as i64 as u32);
        }
    }
    checksum
}
