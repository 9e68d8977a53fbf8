//! Every ADC sample of a stretch of the design's own run, float and fixed side by side.

use super::{Progress, Run};
use crate::circuit::engine::ArithmeticKind;
use crate::cosim::path::Path;
use crate::cosim::readings::{Averager, Mean, Taken};
use crate::cosim::rest::rows_per_s;
use crate::cosim::surroundings::{Moment, World};
use crate::design::Design;
use crate::error::{InputError, Result};
use crate::parallel::both;
use crate::plant::noise::{Noise, Shared, Walk};
use crate::plant::profile::{Profile, Reading};
use crate::text::number;
use std::sync::atomic::{AtomicU64, Ordering};

/// Temperatures and what surrounds the gyro are brought up to date so often, Hz. In between they
/// stand still: at 1 K/min the structure moves by 0.3 mK, the bias by a thousandth of a deg/s.
const UPDATES_HZ: f64 = 50.0;

/// The stream of noise; those of readings are numbered from 0, slow noise has the last two.
const STREAM: u64 = u64::MAX - 2;

/// The longest run, s.
const LONGEST_S: f64 = 1e6;

/// Simulates `seconds` seconds. The record has a row a second, ten rows at least; the first is
/// warm-started, and all that follows is one unbroken motion.
///
/// # Errors
/// A duration that is no time, or too short for ten rows; a circuit that stops on an overflow.
pub fn run(design: &Design, seconds: f64, threads: usize, progress: Progress) -> Result<Run> {
    let least_s = 10.0 / rows_per_s(design);
    if !(seconds >= least_s && seconds <= LONGEST_S) {
        return Err(InputError::new(format!(
            "`--duration` is {seconds} s; it has to be {} (ten decimated samples) to {LONGEST_S} s",
            number(least_s, 3)
        ))
        .help("give it in seconds, such as `--duration 30`")
        .into());
    }
    let records = (seconds.floor() as u64).max(10);
    let rows_per_record = (seconds * rows_per_s(design) / records as f64).floor() as u64;
    let done = AtomicU64::new(0);
    let total = 2 * records;
    let said = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress("seconds of both paths", done, total);
    };
    let noise = Shared::new(Noise::new(design.thermal_run.seed, STREAM));
    let course = |kind| Course::new(design, kind, rows_per_record, noise.walk());
    let (fixed, float) = if threads > 1 {
        let whole = |kind| {
            let mut course = course(kind)?;
            let record = |_| course.record().inspect(|_| said());
            (0..records).map(record).collect::<Result<Vec<_>>>()
        };
        let (fixed, float) = both(
            || whole(ArithmeticKind::Fixed),
            || whole(ArithmeticKind::Float),
        );
        (fixed?, float?)
    } else {
        // In turn, so that both see the noise while it is kept.
        let mut courses = (
            course(ArithmeticKind::Fixed)?,
            course(ArithmeticKind::Float)?,
        );
        let mut means = (Vec::new(), Vec::new());
        for _ in 0..records {
            means.0.push(courses.0.record().inspect(|_| said())?);
            means.1.push(courses.1.record().inspect(|_| said())?);
        }
        means
    };
    let taken = fixed.into_iter().zip(float).enumerate();
    let taken = taken
        .map(|(k, ((moment, fixed), (_, float)))| Taken {
            reading: Reading {
                index: k as u64,
                time_s: moment.time_s,
                heating: moment.temperatures.structure_k_per_s >= 0.0,
            },
            moment,
            fixed,
            float,
        })
        .collect();
    Ok(Run {
        taken,
        has: [false; 3],
        profile: None,
        continuous: true,
    })
}

/// One path on its way.
struct Course<'a> {
    design: &'a Design,
    world: World,
    path: Path,
    noise: Walk<'a>,
    /// What acts now.
    moment: Moment,
    /// Decimated samples so far.
    row: u64,
    /// Decimated samples of a record.
    rows_per_record: u64,
}

impl<'a> Course<'a> {
    /// Warm-started at the run's beginning.
    fn new(
        design: &'a Design,
        kind: ArithmeticKind,
        rows_per_record: u64,
        noise: Walk<'a>,
    ) -> Result<Self> {
        let (profile, _) = Profile::of_run(&design.thermal_run, 0.0);
        let mut world = World::new(design, profile);
        let mut path = Path::new(design, kind);
        let moment = world.advance_to(0.0);
        path.warm_start(design, moment.conditions, &noise)?;
        Ok(Course {
            design,
            world,
            path,
            noise,
            moment,
            row: 0,
            rows_per_record,
        })
    }

    /// The mean of the next record, with the moment in the middle of it.
    fn record(&mut self) -> Result<(Moment, Mean)> {
        let rate = rows_per_s(self.design);
        let every = (rate / UPDATES_HZ).ceil() as u64;
        let mut averager = Averager::new(self.design);
        let mut middle = self.moment;
        for k in 0..self.rows_per_record {
            let row = self.row;
            if row.is_multiple_of(every) {
                // What it is in the middle of the time that it stands for.
                self.moment = self.world.advance_to((row + every / 2) as f64 / rate);
                self.path.gyroscope.set(self.moment.conditions);
            }
            if k == self.rows_per_record / 2 {
                middle = Moment {
                    time_s: row as f64 / rate,
                    ..self.moment
                };
            }
            let real = self.path.period(&self.noise)?;
            averager.add(&real, self.path.relative_gain(&real));
            self.row += 1;
        }
        Ok((middle, averager.mean()))
    }
}
