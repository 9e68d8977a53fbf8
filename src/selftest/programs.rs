//! The experiments of the simulated records: one chamber program for all, and beside it what each effect
//! needs to be seen. The gyro is the design's ([`crate::plant`]), without any of its effects.

use super::scene::Scene;
use crate::design::{Design, Effects};
use crate::plant::effects::Instant;
use crate::plant::profile::NOMINAL_SUPPLY_V;
use crate::plant::slow_noise::{dps_of_dph, dps_rts_of_dph_rth};
use crate::plant::{Device, Thermal};
use crate::statistics::noise::NoiseModel;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// What is done beside the temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Program {
    /// Nothing.
    Thermal,
    /// The gyro is switched off and on.
    Restarts,
    /// A rate table, both ways, at all temperatures.
    Table,
    /// A rate table that creeps through zero.
    Creep,
    /// A rate table around the largest rate, at one temperature.
    Limit,
    /// The set point of the drive amplitude is stepped.
    Drive,
    /// Gas is let in and out of the cell, so that Q changes at any temperature.
    Gas,
    /// The quadrature electrodes are stepped.
    Quadrature,
    /// The supply is stepped.
    Supply,
    /// A tumble and a shaker.
    Tumble,
    /// The humidity of the room, which nobody controls, is recorded.
    Room,
}

impl Program {
    /// All of them.
    pub const ALL: [Program; 11] = [
        Program::Thermal,
        Program::Restarts,
        Program::Table,
        Program::Creep,
        Program::Limit,
        Program::Drive,
        Program::Gas,
        Program::Quadrature,
        Program::Supply,
        Program::Tumble,
        Program::Room,
    ];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Program::Thermal => "thermal cycles",
            Program::Restarts => "thermal cycles, power cycles",
            Program::Table => "thermal cycles on a rate table",
            Program::Creep => "thermal cycles, slow rates through zero",
            Program::Limit => "one temperature, rates around the largest",
            Program::Drive => "thermal cycles, drive amplitude stepped",
            Program::Gas => "thermal cycles, cell pressure varied",
            Program::Quadrature => "thermal cycles, quadrature stepped",
            Program::Supply => "thermal cycles, supply stepped",
            Program::Tumble => "thermal cycles, tumble and shaker",
            Program::Room => "thermal cycles, humidity recorded",
        }
    }
}

/// Legs of the chamber: the share of the span that is gone to, and how many times faster than the design's
/// ramp; a dwell after each.
const LEGS: [(f64, f64); 6] = [
    (1.0, 1.0),
    (0.35, 2.0),
    (0.8, 1.5),
    (0.0, 1.0),
    (0.6, 2.0),
    (0.2, 1.0),
];

/// Shortest dwell, s.
const DWELL_S: f64 = 600.0;

/// Thermal steps in a row.
const STEPS: usize = 8;

/// Largest slow rate, in noises of a row.
const CREEP: f64 = 150.0;

/// Share of the chamber's span at "one temperature": no chamber is better.
const STILL: f64 = 0.002;

/// Corners of the chamber's temperature: (s, degC).
fn chamber(design: &Design, program: Program) -> Vec<(f64, f64)> {
    let run = &design.thermal_run;
    let span = (run.stop_degc - run.start_degc)
        * if program == Program::Limit {
            STILL
        } else {
            1.0
        };
    let dwell_s = run.dwell_s.max(DWELL_S);
    let mut out = vec![(0.0, run.start_degc), (dwell_s, run.start_degc)];
    let (mut time_s, mut degc) = (dwell_s, run.start_degc);
    for (share, speed) in LEGS {
        let to = run.start_degc + share * span;
        time_s += (to - degc).abs() / (speed * run.ramp_k_per_min / 60.0);
        degc = to;
        out.push((time_s, degc));
        time_s += dwell_s;
        out.push((time_s, degc));
    }
    out
}

/// The value of a line through corners.
fn along(corners: &[(f64, f64)], x: f64) -> f64 {
    let after = corners.partition_point(|c| c.0 <= x);
    match (
        after.checked_sub(1).and_then(|k| corners.get(k)),
        corners.get(after),
    ) {
        (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0),
        (Some(last), None) => last.1,
        (None, first) => first.map_or(0.0, |f| f.1),
    }
}

/// `levels` in turn, each for `hold` rows.
fn held(levels: &[f64], hold: usize, row: usize) -> f64 {
    let at = (row / hold.max(1)) % levels.len().max(1);
    levels.get(at).copied().unwrap_or(0.0)
}

/// Between -1 and 1, never twice the same.
fn wander(share: f64) -> f64 {
    let wave = |periods: f64, phase: f64| (TAU * (periods * share + phase)).sin();
    (0.5 * wave(1.37, 0.1) + 0.35 * wave(3.11, 0.4) + 0.25 * wave(6.73, 0.8)).clamp(-1.0, 1.0)
}

/// The design's noise of a reading that is a mean of `samples_per_reading`.
///
/// White noise of a one-sided density S has the variance S^2 / (2 tau) in a mean over tau; white noise of
/// rms s at an ADC's input, demodulated, the density 2 s / sqrt(fs).
fn noise(design: &Design) -> (NoiseModel, f64) {
    let (run, circuit) = (&design.thermal_run, &design.circuit);
    let fs = circuit.sample_rate_hz;
    let mean_s = f64::from(run.samples_per_reading) * f64::from(circuit.decimator.ratio) / fs;
    let full_scale_lsb = 2f64.powi(circuit.adc.format.bits() as i32 - 1);
    let adc_lsb_rthz = 2.0 * run.adc_noise_lsb / fs.sqrt();
    let adc_dps_rthz = adc_lsb_rthz * run.sense_full_scale_dps / full_scale_lsb;
    let of_mean = |density: f64| density / (2.0 * mean_s).sqrt();
    let model = NoiseModel {
        white_rms_dps: of_mean(run.rate_noise_dps_rthz.hypot(adc_dps_rthz)),
        // B^2 = pi h.
        flicker_dps: dps_of_dph(run.flicker_dph) / PI.sqrt(),
        walk_dps_rts: dps_rts_of_dph_rth(run.rate_random_walk_dph_rth),
    };
    let phase_rad = of_mean(adc_lsb_rthz / (run.drive_amplitude * full_scale_lsb));
    (model, phase_rad)
}

/// The scene of a program, `rows` rows long.
pub fn scene(design: &Design, program: Program, rows: usize) -> Scene {
    let corners = chamber(design, program);
    let end_s = corners.last().map_or(1.0, |c| c.0);
    let row_s = end_s / rows.saturating_sub(1).max(1) as f64;
    let (noise, phase_rms) = noise(design);
    let mut device = Device::new(&design.gyro);
    device.effects = Effects::default();
    let tracking = design.circuit.phase_loop.is_some();
    let thermometer = if tracking { "freq_hz" } else { "phase_rad" };
    let mut names = vec![thermometer, "chamber_degc", "die_degc"];
    names.extend(columns(program));
    let mut columns: BTreeMap<String, Vec<f64>> = names
        .iter()
        .map(|name| ((*name).to_owned(), Vec::with_capacity(rows)))
        .collect();
    let mut scene = Scene {
        name: program.name(),
        time_s: (0..rows).map(|k| row_s * k as f64).collect(),
        instants: Vec::with_capacity(rows),
        agc: Vec::with_capacity(rows),
        gas: Vec::with_capacity(rows),
        drive: (!tracking).then_some((device.drive, device.excitation_hz)),
        declared_dps: Vec::with_capacity(rows),
        columns: BTreeMap::new(),
        thermometer: thermometer.to_owned(),
        // A phase's noise as that of the frequency that turns it as far.
        reading_rms: if tracking {
            phase_rms * device.drive.frequency_hz / (2.0 * device.drive.q)
        } else {
            phase_rms
        },
        noise,
    };
    let mut thermal = Thermal::in_equilibrium(&design.gyro.thermal, 60.0, along(&corners, 0.0));
    for (row, time_s) in scene.time_s.iter().enumerate() {
        if row > 0 {
            for step in 1..=STEPS {
                let back_s = row_s * (STEPS - step) as f64 / STEPS as f64;
                thermal.advance(row_s / STEPS as f64, along(&corners, time_s - back_s));
            }
        }
        let share = row as f64 / rows.saturating_sub(1).max(1) as f64;
        let t = thermal.now();
        let outside = Outside::new(
            design,
            program,
            row,
            share,
            *time_s,
            scene.noise.white_rms_dps,
        );
        let phase_rad = device.structural_phase_rad(t.structure_degc)
            + device.electronics_phase_rad(t.electronics_degc);
        let frequency_hz = device.drive.natural_frequency_hz(t.structure_degc);
        let declared_rad = if tracking {
            let relative = frequency_hz / device.drive.frequency_hz - 1.0;
            2.0 * device.drive.q * relative - FRAC_PI_2
        } else {
            phase_rad
        };
        let moved = device
            .drive
            .response(t.structure_degc, device.excitation_hz)
            .amplitude;
        let agc = outside.amplitude
            * if tracking {
                1.0
            } else {
                device.drive.q / moved
            };
        let values = [
            ("phase_rad", phase_rad),
            ("freq_hz", frequency_hz),
            ("chamber_degc", t.chamber_degc),
            ("die_degc", t.electronics_degc),
            ("agc", agc),
            ("time_since_power_on_s", outside.power_on_s),
            ("rate_dps", outside.rate_dps),
            ("quad_dps", outside.quadrature_dps),
            ("supply_v", outside.supply_v),
            ("accel_g", outside.accel_g),
            ("humidity_pct", 45.0 + 20.0 * wander(share)),
        ];
        for (name, value) in values {
            if let Some(column) = columns.get_mut(name) {
                column.push(value);
            }
        }
        scene.agc.push(agc);
        scene.gas.push(if program == Program::Gas {
            wander(share)
        } else {
            0.0
        });
        scene
            .declared_dps
            .push(device.bias_at_phase_dps(declared_rad));
        scene.instants.push(Instant {
            time_s: *time_s,
            power_on_s: outside.power_on_s,
            structure_degc: t.structure_degc,
            electronics_degc: t.electronics_degc,
            structure_k_per_s: t.structure_k_per_s,
            lagged_degc: t.structure_degc,
            phase_rad: declared_rad,
            inverse_q: 0.0,
            quadrature_dps: outside.quadrature_dps,
            rate_dps: outside.rate_dps,
            supply_v: outside.supply_v,
            accel_g: outside.accel_g,
        });
    }
    scene.columns = columns;
    scene
}

/// The columns that a program adds to the thermometers.
fn columns(program: Program) -> &'static [&'static str] {
    match program {
        Program::Thermal => &[],
        Program::Restarts => &["time_since_power_on_s"],
        Program::Table | Program::Creep | Program::Limit => &["rate_dps"],
        Program::Drive | Program::Gas => &["agc"],
        Program::Quadrature => &["quad_dps"],
        Program::Supply => &["supply_v"],
        Program::Tumble => &["accel_g"],
        Program::Room => &["humidity_pct"],
    }
}

/// What a program does to the gyro from outside in one row.
struct Outside {
    power_on_s: f64,
    rate_dps: f64,
    quadrature_dps: f64,
    supply_v: f64,
    accel_g: f64,
    /// Set point of the drive amplitude, relative.
    amplitude: f64,
}

impl Outside {
    fn new(
        design: &Design,
        program: Program,
        row: usize,
        share: f64,
        time_s: f64,
        noise_dps: f64,
    ) -> Self {
        let run = &design.thermal_run;
        let end_s = if share > 0.0 { time_s / share } else { 0.0 };
        let on = |p: Program| program == p;
        let restart = [0.0, 0.31, 0.55, 0.79].into_iter().rfind(|r| *r <= share);
        let table = [0.0, 1.0, -1.0, 0.5, -0.5, 0.25, -0.25, 0.75, -0.75];
        let triangle = 4.0 * ((7.3 * share).fract() - 0.5).abs() - 1.0;
        let rate_dps = match program {
            Program::Table => run.scale_rate_dps * held(&table, 3, row),
            Program::Creep => CREEP * noise_dps * triangle,
            Program::Limit if row.is_multiple_of(5) => {
                run.scale_rate_dps * held(&[0.0, 0.5, -0.5, -0.9], 5, row)
            }
            Program::Limit => run.scale_rate_dps + 0.5 * CREEP * noise_dps * (triangle - 1.0),
            _ => 0.0,
        };
        let quadrature = if run.quadrature_dps == 0.0 {
            100.0
        } else {
            run.quadrature_dps
        };
        let stepped = |p: Program, by: f64, hold: usize| {
            let levels = [0.0, 1.0, -0.6, 0.4, -1.0, 0.7, -0.2];
            if on(p) {
                by * held(&levels, hold, row)
            } else {
                0.0
            }
        };
        Outside {
            power_on_s: match restart {
                Some(r) if on(Program::Restarts) => time_s - r * end_s,
                _ => time_s,
            },
            rate_dps,
            quadrature_dps: quadrature * (1.0 + stepped(Program::Quadrature, 0.5, 5)),
            supply_v: NOMINAL_SUPPLY_V * (1.0 + stepped(Program::Supply, 0.05, 5)),
            accel_g: match program {
                Program::Tumble => held(&[1.0, 0.0, -1.0, 0.5, -0.5, 2.0, -2.0], 4, row),
                _ => 0.0,
            },
            amplitude: 1.0 + stepped(Program::Drive, 0.1, 5),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::Plant;
    use super::*;
    use crate::design::template::default_design;

    #[test]
    fn without_effects_the_declared_model_leaves_nothing() {
        let mut text = default_design().unwrap().source.text;
        for key in [
            "[circuit.phase_loop]",
            "setpoint_raw = -",
            "proportional",
            "integral",
            "integrator_bits",
        ] {
            text = text.replace(&format!("\n#{key}"), &format!("\n{key}"));
        }
        let tracking = crate::design::reader::parse(&text, None).unwrap();
        assert!(tracking.circuit.phase_loop.is_some());
        for design in [default_design().unwrap(), tracking] {
            for program in Program::ALL {
                let scene = scene(&design, program, 120);
                let left = super::super::planted::beyond(&scene, &scene.take(&Plant::default()));
                assert!(left < 1e-9, "{program:?}: {left}");
            }
        }
    }

    #[test]
    fn the_noise_is_that_of_a_mean() {
        let (noise, phase_rms) = noise(&default_design().unwrap());
        // 0.0073 deg/s/sqrt(Hz) over 512 * 32 / 56000 s; the ADC adds a thousandth.
        assert!((noise.white_rms_dps - 0.009_55).abs() < 1e-4, "{noise:?}");
        assert!((phase_rms - 6.7e-7).abs() < 1e-7, "{phase_rms}");
        assert!((noise.bias_instability_dps() - 30.0 / 3600.0).abs() < 1e-12);
    }
}
