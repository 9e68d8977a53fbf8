//! Switching on: from no motion, with the loops as the design starts them, at the run's first
//! temperature, without noise.

use crate::circuit::engine::ArithmeticKind;
use crate::cosim::path::{Path, RealRow};
use crate::cosim::rest::{self, rows_per_s};
use crate::cosim::surroundings::World;
use crate::design::{Design, ThermalRun};
use crate::error::Result;
use crate::plant::noise::Noise;
use crate::plant::profile::Profile;
use serde::Serialize;

/// The rows of the bit-accurate circuit after power-on, and when it was settled.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Startup {
    /// Chamber, degC.
    pub chamber_degc: f64,
    /// Until the drive's magnitude stays within 1 % of where it ends, s; `None`: not within the time that was simulated.
    pub amplitude_s: Option<f64>,
    /// Until the drive's phase stays within 0.1 deg of where it ends, s.
    pub phase_s: Option<f64>,
    /// Until the frequency stays within 10 ppm of the resonance, s; `None` without a phase loop as well.
    pub lock_s: Option<f64>,
    /// The slowest time constant of the linearised loops, s.
    pub predicted_time_constant_s: f64,
    /// Every row.
    #[serde(skip)]
    pub rows: Vec<RealRow>,
    /// Rows per second.
    pub rows_per_s: f64,
    /// The codes, drive and sense.
    #[serde(skip)]
    pub codes: (Vec<i32>, Vec<i32>),
}

/// A design without any noise.
pub fn silent(design: &Design) -> Design {
    Design {
        thermal_run: ThermalRun {
            adc_noise_lsb: 0.0,
            rate_noise_dps_rthz: 0.0,
            flicker_dph: 0.0,
            rate_random_walk_dph_rth: 0.0,
            ..design.thermal_run.clone()
        },
        ..design.clone()
    }
}

/// Switches the gyro on and follows it for twenty of the slowest time constants.
///
/// # Errors
/// A circuit that stops on an overflow, a loop that never settles.
pub fn startup(design: &Design) -> Result<Startup> {
    let design = silent(design);
    let count = rest::settling_rows(&design)?;
    let (profile, _) = Profile::of_run(&design.thermal_run, 0.0);
    let moment = World::new(&design, profile).advance_to(0.0);
    let mut path = Path::new(&design, ArithmeticKind::Fixed);
    path.start(moment.conditions);
    path.gyroscope.stop();
    let resonance_hz = rest::rest(&design, &path.gyroscope)?.hz;
    let noise = Noise::new(0, 0);
    let mut rows = Vec::with_capacity(count);
    let mut codes = (Vec::new(), Vec::new());
    for _ in 0..count {
        rows.push(path.period(&noise)?);
        let [d, s] = path.codes();
        codes.0.extend_from_slice(d);
        codes.1.extend_from_slice(s);
    }
    let rate = rows_per_s(&design);
    let end = rows.last().copied();
    let settled = |near: &dyn Fn(&RealRow, &RealRow) -> bool| {
        let end = end.as_ref()?;
        let last_far = rows.iter().rposition(|row| !near(row, end));
        let first = last_far.map_or(0, |k| k + 1);
        // Of the last tenth of the time nobody can say that it stays.
        (first < rows.len() * 9 / 10).then(|| first as f64 / rate)
    };
    let slowest = [rest::phase_loop(&design), rest::amplitude_loop(&design)]
        .into_iter()
        .flatten()
        .map(|l| l.slowest_s())
        .fold(rest::envelope_s(&design), f64::max);
    Ok(Startup {
        chamber_degc: moment.temperatures.chamber_degc,
        amplitude_s: settled(&|row, end| (row.magnitude / end.magnitude - 1.0).abs() < 0.01),
        phase_s: settled(&|row, end| (row.phase_rad - end.phase_rad).abs() < 0.1f64.to_radians()),
        lock_s: if design.circuit.phase_loop.is_some() {
            settled(&|row, _| (row.freq_hz / resonance_hz - 1.0).abs() < 1e-5)
        } else {
            None
        },
        predicted_time_constant_s: slowest,
        rows,
        rows_per_s: rate,
        codes,
    })
}
