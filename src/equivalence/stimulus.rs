//! The codes of an equivalence run.

use crate::design::Design;
use crate::plant::thermal_run::FIRST_SAMPLE;
use crate::plant::{Sampling, ThermalPlant};

/// Drive and sense codes of `samples` ADC samples: the design's gyro through its thermal run, from
/// dwell to dwell and back, the samples shared out among them. The excitation runs on without a break.
pub fn operating(design: &Design, samples: usize) -> (Vec<i32>, Vec<i32>) {
    let circuit = &design.circuit;
    let sampling = Sampling {
        sample_rate_hz: circuit.sample_rate_hz,
        adc_bits: circuit.adc.format.bits(),
        tuning_word: circuit.nco.tuning_word,
        phase_bits: circuit.nco.phase_bits,
    };
    let mut run = design.thermal_run.clone();
    run.readings_per_dwell = 1;
    let plant = ThermalPlant::new(&design.gyro, &run, sampling);
    let readings = plant.readings(1.0);
    let each = samples.div_ceil(readings.len().max(1)).max(1);
    let (mut drive, mut sense) = (Vec::with_capacity(samples), Vec::with_capacity(samples));
    for reading in &readings {
        let count = each.min(samples - drive.len());
        let first = FIRST_SAMPLE + drive.len() as u64;
        let (d, s) = plant.codes_from(reading, first, count);
        drive.extend(d);
        sense.extend(s);
    }
    (drive, sense)
}
