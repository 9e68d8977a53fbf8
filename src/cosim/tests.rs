use super::path::Path;
use super::readings;
use super::rest;
use super::surroundings::World;
use crate::circuit::engine::ArithmeticKind;
use crate::design::template::default_design;
use crate::design::{Design, LoopGain, PhaseLoop};
use crate::plant::Device;
use crate::plant::noise::Noise;
use crate::plant::profile::Profile;

fn silent() -> Design {
    crate::simulation::startup::silent(&default_design().expect("the default"))
}

fn tracking(mut design: Design) -> Design {
    let gain = |raw, shift| LoopGain { raw, shift };
    design.circuit.phase_loop = Some(PhaseLoop {
        setpoint_raw: -4_194_304,
        proportional: gain(9, 6),
        integral: gain(9, 11),
        integrator_bits: 48,
    });
    design
}

/// Without noise and quantisation the warm start is the steady state: nothing moves any more.
#[test]
fn a_warm_start_is_where_a_settled_loop_ends() {
    for design in [silent(), tracking(silent())] {
        for degc in [0.0, 50.0] {
            let moment = World::new(&design, Profile::constant(degc)).advance_to(0.0);
            let noise = Noise::new(0, 0);
            let mut warm = Path::new(&design, ArithmeticKind::Float);
            warm.warm_start(&design, moment.conditions, &noise)
                .expect("a rest");
            let first = warm.period(&noise).expect("a row");
            let mut cold = Path::new(&design, ArithmeticKind::Float);
            cold.start(moment.conditions);
            cold.gyroscope.stop();
            let mut last = first;
            for _ in 0..rest::settling_rows(&design).expect("stable") {
                last = cold.period(&noise).expect("a row");
            }
            assert!((first.phase_rad - last.phase_rad).abs() < 1e-6, "{degc}");
            assert!((first.freq_hz / last.freq_hz - 1.0).abs() < 1e-8, "{degc}");
            // The gain is held to the nearest of its words.
            assert!((first.gain / last.gain - 1.0).abs() < 2e-4, "{degc}");
            assert!((first.magnitude / last.magnitude - 1.0).abs() < 2e-4);
        }
    }
}

#[test]
fn tracking_follows_the_resonance_at_every_temperature() {
    let design = tracking(silent());
    let device = Device::new(&design.gyro);
    for degc in [-10.0, 0.0, 26.85, 70.0] {
        let profile = Profile::constant(degc);
        let reading = profile.even_readings(1).remove(0);
        let moment = World::new(&design, profile).advance_to(0.0);
        for kind in [ArithmeticKind::Fixed, ArithmeticKind::Float] {
            let mean = readings::mean(&design, kind, &reading, &moment, 512).expect("a reading");
            let expected = device.drive.natural_frequency_hz(degc);
            // The table's address is truncated: half a step of phase, pi / 4096, which the loop takes for
            // a detuning of f / (2 Q) times that.
            let truncation_hz = match kind {
                ArithmeticKind::Fixed => std::f64::consts::PI / 4096.0 * expected / 100.0,
                ArithmeticKind::Float => 0.0,
            };
            let off = (mean.freq_hz - expected).abs();
            assert!(off < 1e-5 + truncation_hz, "{degc}: {}", mean.freq_hz);
            assert!((mean.phase_rad.to_degrees() + 90.0).abs() < 1e-2);
        }
    }
}

/// A reading by the closed loop against the steady state of the equations (eq. 4 to 9), which
/// shares no code with the motion.
#[test]
fn float_readings_are_the_equations_steady_state() {
    let design = silent();
    let device = Device::new(&design.gyro);
    for degc in [0.0, 20.0, 45.0, 70.0] {
        let profile = Profile::constant(degc);
        let reading = profile.even_readings(1).remove(0);
        let moment = World::new(&design, profile).advance_to(0.0);
        let kind = ArithmeticKind::Float;
        let mean = readings::mean(&design, kind, &reading, &moment, 64).expect("a reading");
        assert!((mean.phase_rad - device.measured_phase_rad(degc)).abs() < 1e-9);
        // The table's amplitude is 32767/32768, and the gain a word of 16 bits.
        let expected = device.bias_dps(degc) * 32767.0 / 32768.0;
        assert!(
            (mean.rate_out_dps / expected - 1.0).abs() < 2e-4,
            "{degc}: {}",
            mean.rate_out_dps
        );
    }
}

#[test]
fn results_do_not_depend_on_threads() {
    let design = default_design().expect("the default");
    let (profile, all) = Profile::of_run(&design.thermal_run, 0.3);
    let some: Vec<_> = all.into_iter().step_by(17).collect();
    let moments = readings::moments(&design, &profile, &some);
    let take = |threads| {
        let options = readings::Options { rows: 32, threads };
        let taken = readings::take(&design, &some, &moments, options, &|_| ());
        format!("{:?}", taken.expect("readings"))
    };
    assert_eq!(take(1), take(2));
    assert_eq!(take(1), take(5));
}

#[test]
fn loops_that_cannot_settle_or_lock_are_refused() {
    let mut design = tracking(silent());
    if let Some(l) = &mut design.circuit.phase_loop {
        l.integral.raw = -9;
    }
    let e = rest::settling_rows(&design).expect_err("unstable");
    assert!(e.to_string().contains("circuit.phase_loop"), "{e}");
    let mut design = tracking(silent());
    if let Some(l) = &mut design.circuit.phase_loop {
        l.setpoint_raw = 4_194_304;
    }
    let moment = World::new(&design, Profile::constant(20.0)).advance_to(0.0);
    let mut path = Path::new(&design, ArithmeticKind::Fixed);
    let e = path.warm_start(&design, moment.conditions, &Noise::new(0, 0));
    assert!(e.expect_err("no lock").to_string().contains("setpoint"));
}
