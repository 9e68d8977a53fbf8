use super::*;
use crate::design::Design;
use crate::design::template::default_design;
use crate::plant::StiffnessLaw;
use crate::plant::resonator::Resonator;

const RATE_HZ: f64 = 56_000.0;

fn reference(tracking: bool) -> Reference {
    Reference {
        sample_rate_hz: RATE_HZ,
        full_scale_lsb: 32768.0,
        excitation_hz: 1750.0,
        tracking,
        held_amplitude: true,
        nominal_gain: 0.5,
    }
}

fn design() -> Design {
    default_design().expect("the default")
}

fn at(degc: f64) -> Conditions {
    Conditions {
        temperatures: Temperatures {
            chamber_degc: degc,
            structure_degc: degc,
            electronics_degc: degc,
            lagged_degc: degc,
            structure_k_per_s: 0.0,
        },
        rate_dps: 0.0,
        extra_bias_dps: 0.0,
        drive_q: 50.0,
        softening: 0.0,
    }
}

fn step_of(hz: f64) -> u64 {
    (hz / RATE_HZ * TURN) as u64
}

/// Mean of input times exp(-i theta) times 2i over whole periods: the phasor.
fn phasor(values: &[f64], first_phase: u64, step: u64) -> C {
    let mut phase = first_phase;
    let mut sum = C::default();
    for v in values {
        phase = phase.wrapping_add(step);
        let (sin, cos) = turn::sin_cos(phase);
        sum += C::new(v * sin, v * cos);
    }
    sum * 2.0 / values.len() as f64
}

/// Phasors of both ADCs after `periods` periods of 32 samples, over the 32 after them.
fn run(g: &mut Gyroscope, drive: Drive, periods: usize) -> [C; 2] {
    let mut drive = drive;
    let mut last = [C::default(); 2];
    for _ in 0..=periods {
        let (mut d, mut s) = (vec![0.0; 32], vec![0.0; 32]);
        g.block(drive, &mut d, &mut s);
        last = [&d, &s].map(|v| phasor(v, drive.phase, drive.step));
        drive.phase = drive.phase.wrapping_add(drive.step.wrapping_mul(32));
    }
    last
}

#[test]
fn from_rest_the_motion_comes_to_the_steady_state_of_eq_5_to_7() {
    let d = design();
    let drive_mode = Resonator {
        frequency_hz: 1750.0,
        q: 50.0,
        reference_k: 300.0,
        tempco_per_k: d.gyro.stiffness_tempco_per_k,
        law: StiffnessLaw::Linear,
    };
    for degc in [-10.0, 26.85, 70.0] {
        let mut g = Gyroscope::new(&d.gyro, &d.thermal_run, reference(false));
        g.set(at(degc));
        g.stop();
        let drive = Drive {
            phase: 77 << 40,
            step: step_of(1750.0),
            gain: 0.5,
        };
        // 1000 periods are 63 time constants of the drive.
        let [x, s] = run(&mut g, drive, 1000);
        let expected = drive_mode.response(degc, 1750.0);
        let measured = x.arg() - g.device.electronics_phase_rad(degc);
        assert!(
            (measured - expected.phase_rad).abs() < 1e-9,
            "{degc}: {measured}"
        );
        let amplitude = expected.amplitude / 50.0 * 16384.0;
        assert!((x.norm() / amplitude - 1.0).abs() < 1e-9, "{degc}");
        // A settled start gives the same at once.
        g.settle(drive);
        let [x2, s2] = run(&mut g, drive, 0);
        assert!((x2 - x).norm() < 1e-7 && (s2 - s).norm() < 1e-7);
    }
}

/// x, u, y, v by Runge-Kutta with many steps in a sample, from the equations of the module's head.
fn by_runge_kutta(g: &Gyroscope, drive: Drive, mut z: [f64; 4], samples: usize) -> [f64; 4] {
    let m = &g.modes;
    let w0 = TAU * 1750.0;
    let w = drive.step as f64 / TURN * TAU * RATE_HZ;
    let theta0 = drive.phase as f64 / TURN * TAU;
    let rate = g.steady.rate_dps;
    let slope = |t: f64, [x, u, y, v]: [f64; 4]| {
        let force = g.force * drive.gain * (theta0 + w * t).sin() / w0;
        let sense = g.coupling * (rate * u - g.quadrature_dps * x) / w0;
        [
            w0 * u,
            -m.w[0] * m.w[0] / w0 * x - m.width[0] * u + force,
            w0 * v,
            -m.w[1] * m.w[1] / w0 * y - m.width[1] * v + sense,
        ]
    };
    let fine = 200;
    let h = 1.0 / RATE_HZ / f64::from(fine);
    let plus = |a: [f64; 4], b: [f64; 4], k: f64| std::array::from_fn(|i| a[i] + b[i] * k);
    for n in 0..samples * fine as usize {
        let t = n as f64 * h;
        let k1 = slope(t, z);
        let k2 = slope(t + h / 2.0, plus(z, k1, h / 2.0));
        let k3 = slope(t + h / 2.0, plus(z, k2, h / 2.0));
        let k4 = slope(t + h, plus(z, k3, h));
        for i in 0..4 {
            z[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
    z
}

#[test]
fn the_discretisation_is_exact_through_changes_of_everything() {
    let d = design();
    let mut g = Gyroscope::new(&d.gyro, &d.thermal_run, reference(true));
    g.set(at(10.0));
    let mut drive = Drive {
        phase: 1 << 62,
        step: step_of(1751.3),
        gain: 0.4,
    };
    g.settle(drive);
    // Change temperature, rate, frequency and gain at once.
    let mut conditions = at(40.0);
    conditions.rate_dps = 250.0;
    let motion = |g: &Gyroscope| {
        let (sin, cos) = turn::sin_cos(g.drive.phase);
        let z: [f64; 4] = std::array::from_fn(|k| {
            g.deviation[k] + g.steady.state[k].re * sin + g.steady.state[k].im * cos
        });
        z
    };
    let before = motion(&g);
    g.set(conditions);
    drive.step = step_of(1745.0);
    drive.gain = 0.7;
    g.move_to(drive);
    let start = motion(&g);
    for k in 0..4 {
        assert!(
            (start[k] - before[k]).abs() < 1e-9 * before[0].hypot(before[1]),
            "{k}"
        );
    }
    let samples = 100;
    let expected = by_runge_kutta(&g, drive, start, samples);
    let (mut a, mut b) = (vec![0.0; samples], vec![0.0; samples]);
    g.block(drive, &mut a, &mut b);
    let got = motion(&g);
    for k in 0..4 {
        let size = expected[k & !1].hypot(expected[k | 1]);
        assert!(
            (got[k] - expected[k]).abs() < 1e-7 * size,
            "{k}: {got:?} {expected:?}"
        );
    }
}

#[test]
fn a_fixed_frequency_circuit_reads_eq_9_and_a_rate_in_full() {
    let d = design();
    let mut g = Gyroscope::new(&d.gyro, &d.thermal_run, reference(false));
    for degc in [0.0, 26.85, 35.0, 70.0] {
        let mut conditions = at(degc);
        g.set(conditions);
        let mut drive = Drive {
            phase: 0,
            step: step_of(1750.0),
            gain: 0.5,
        };
        drive.gain = g.gain_for(16384.0, 1750.0);
        g.settle(drive);
        let [x, s] = run(&mut g, drive, 0);
        assert!((x.norm() - 16384.0).abs() < 1e-6);
        let bias = s.re / 32.0;
        assert!(
            (bias - g.device.declared_bias_dps(degc)).abs() < 1e-8,
            "{degc}: {bias}"
        );
        conditions.rate_dps = 100.0;
        conditions.extra_bias_dps = 3.0;
        g.set(conditions);
        g.settle(drive);
        let [_, s] = run(&mut g, drive, 0);
        let expected = bias + 100.0 * g.scale_factor() + 3.0;
        assert!((s.re / 32.0 - expected).abs() < 1e-8);
        if degc == 26.85 {
            assert!((g.scale_factor() - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn the_scale_factor_moves_by_the_published_4_3_percent() {
    let d = design();
    let mut g = Gyroscope::new(&d.gyro, &d.thermal_run, reference(false));
    let mut factors = Vec::new();
    for k in 0..=70 {
        g.set(at(f64::from(k)));
        let drive = Drive {
            phase: 0,
            step: step_of(1750.0),
            gain: g.gain_for(16384.0, 1750.0),
        };
        g.settle(drive);
        factors.push(g.scale_factor());
    }
    let high = factors.iter().copied().fold(0.0, f64::max);
    let low = factors.iter().copied().fold(2.0, f64::min);
    let percent = 100.0 * (high - low) / (high + low);
    assert!((percent - 4.3).abs() < 0.05, "{percent}");
}

#[test]
fn a_phase_loop_comes_to_rest_where_the_motion_has_its_setpoint() {
    let d = design();
    let mut g = Gyroscope::new(&d.gyro, &d.thermal_run, reference(true));
    for degc in [0.0, 26.85, 70.0] {
        g.set(at(degc));
        let resonance = g.device.drive.natural_frequency_hz(degc);
        let hz = g.locked_hz(-TAU / 4.0, 0.5).expect("a resonance");
        assert!((hz / resonance - 1.0).abs() < 1e-12, "{hz} {resonance}");
        for setpoint in [-0.3, -2.5] {
            let hz = g.locked_hz(setpoint, 0.5).expect("a frequency");
            let phase = g.device.drive.response(degc, hz).phase_rad;
            assert!((phase - setpoint).abs() < 1e-12, "{phase}");
        }
        assert_eq!(g.locked_hz(0.5, 0.5), None);
    }
}
