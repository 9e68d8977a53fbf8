//! What quantisation leaves of the loops: dead band and limit cycle, measured in the closed loop
//! without noise and predicted by a reduced model.
//!
//! **Dead band.** A loop whose integrator drops the error's low bits stands still while |error| < LSB of the
//! integrator / ki. Here the integrators add the error as it is and the gain comes after them, so no error
//! is lost: the predicted dead band is 0, and a bounded integrator forces the *mean* error to 0.
//! What is left of it over a finite time is at most the integrator's travel over the number of rows.
//!
//! **Limit cycle.** The loop's output is an integer (`>>` is a floor), the equilibrium in general is not. So the
//! output hunts between its neighbours, and the resonator's envelope and the decimator smooth that
//! into a small wave of amplitude and phase. The reduced model has exactly these parts at the
//! decimated rate: envelope as a first-order lag of 2 Q1 / w1, the decimator's response in rows, rounding
//! to the phase's or the magnitude's LSB, and the loop's own block. It has no carrier, no ADC, no CORDIC;
//! what those add is bounded beside it.

use super::startup::silent;
use crate::circuit::amplitude_loop::AmplitudeLoop;
use crate::circuit::engine::ArithmeticKind;
use crate::circuit::phase_loop::PhaseLoop;
use crate::cosim::path::Path;
use crate::cosim::rest::{self, Rest, rows_per_s};
use crate::cosim::surroundings::World;
use crate::design::Design;
use crate::error::Result;
use crate::numeric::arithmetic::Block;
use crate::numeric::fixed::Fixed;
use crate::numeric::format::pow2;
use crate::plant::noise::Noise;
use crate::plant::profile::{self, Profile};
use crate::text::number;
use serde::Serialize;
use std::f64::consts::TAU;

type Integers = Fixed<i128, i128>;

/// Rows that are looked at, after as many time constants as a start takes.
const ROWS: usize = 8192;

/// A loop at one temperature.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Hunting {
    /// `phase_loop` or `amplitude_loop`.
    pub name: &'static str,
    /// Chamber, degC.
    pub chamber_degc: f64,
    /// Of the loop's output (tuning word or gain), steps.
    pub output_unit: &'static str,
    /// Greatest less least output, measured in the closed loop, LSB.
    pub output_pp_lsb: f64,
    /// The same by the reduced model.
    pub predicted_output_pp_lsb: f64,
    /// Greatest less least error (phase or magnitude), measured, LSB of the error.
    pub error_pp_lsb: f64,
    /// The same by the reduced model.
    pub predicted_error_pp_lsb: f64,
    /// What ADC and oscillator may add to the error, a bound, LSB peak to peak: the model has neither. One
    /// ADC step over the amplitude, and the address truncation's 2 pi / 2^a where the tuning word has
    /// bits below the address; the same for phase (rad) and relative amplitude.
    pub converters_pp_lsb: f64,
    /// Mean error, measured, LSB: the dead band's mark.
    pub error_mean_lsb: f64,
    /// Mean error over the rows for each step of the output that the integral part moves in them, LSB.
    pub error_mean_per_step_lsb: f64,
    /// Width of the dead band by theory, LSB of the error.
    pub predicted_dead_band_lsb: f64,
    /// The wave of the error in physical units, peak to peak: rad, or relative amplitude.
    pub error_pp: f64,
    /// The output is at an end of its range in all rows: the loop corrects no error.
    pub stands_at_limit: bool,
}

impl Hunting {
    /// What the error's wave has to keep to, LSB peak to peak: that of the reduced model with all that ADC and oscillator may add.
    pub fn most_error_pp_lsb(&self) -> f64 {
        self.predicted_error_pp_lsb + self.converters_pp_lsb
    }
}

/// What the words of a table of loops mean, and what is compared with what: a definition each.
pub fn definitions(found: &[Hunting]) -> Vec<String> {
    let mut means: Vec<String> = Vec::new();
    for h in found.iter().filter(|h| !h.stands_at_limit) {
        let mean = format!(
            "a change by one {} is a mean error of {} LSB ({})",
            h.output_unit,
            number(h.error_mean_per_step_lsb, 3),
            h.name
        );
        if !means.contains(&mean) {
            means.push(mean);
        }
    }
    let mut said = vec![
        "degC: the first, the middle and the last temperature on the way up of [thermal_run]. The loops run without noise.".to_owned(),
        format!("pp (peak to peak): the largest less the smallest value in {ROWS} rows."),
        "output: of the loop, in the unit beside its name.".to_owned(),
        "error: the difference of the magnitude or the phase from its setpoint, in LSB of that word.".to_owned(),
        "circuit: the bit-accurate loop with ADC and NCO.".to_owned(),
        "model: the same loop without ADC and NCO.".to_owned(),
        "limit: the model's error plus the most that ADC and NCO can add. The circuit's error must stay below it.".to_owned(),
    ];
    if !means.is_empty() {
        said.push(format!(
            "mean error: change of the integrator / number of rows. In {ROWS} rows {}. It goes to 0 in a longer run.",
            means.join(", ")
        ));
        said.push(
            "dead band: none by theory. The loops correct every error, however small.".to_owned(),
        );
    }
    let stand = found.iter().filter(|h| h.stands_at_limit);
    let stand: Vec<String> = stand
        .map(|h| format!("{} at {} degC", h.name, h.chamber_degc))
        .collect();
    if !stand.is_empty() {
        said.push(format!(
            "The output stands at its limit in all rows ({}). There the loop corrects no error, and the mean error does not go to 0.",
            stand.join(", ")
        ));
    }
    said
}

/// Both loops at the run's start, middle and top.
///
/// # Errors
/// A circuit that stops on an overflow, a loop that does not settle.
pub fn hunting(design: &Design) -> Result<Vec<Hunting>> {
    let design = silent(design);
    let circuit = &design.circuit;
    if circuit.phase_loop.is_none() && circuit.amplitude_loop.is_none() {
        return Ok(Vec::new());
    }
    let dwells = profile::dwells(&design.thermal_run);
    let up = dwells.iter().filter(|d| d.1).count();
    let places = [0, up / 2, up.saturating_sub(1)];
    let mut found = Vec::new();
    for place in places {
        let Some((degc, _)) = dwells.get(place) else {
            continue;
        };
        found.extend(at(&design, *degc)?);
    }
    Ok(found)
}

fn at(design: &Design, degc: f64) -> Result<Vec<Hunting>> {
    let circuit = &design.circuit;
    let moment = World::new(design, Profile::constant(degc)).advance_to(0.0);
    let mut path = Path::new(design, ArithmeticKind::Fixed);
    let noise = Noise::new(0, 0);
    let rest = path.warm_start(design, moment.conditions, &noise)?;
    for _ in 0..rest::settling_rows(design)? {
        path.period(&noise)?;
    }
    let mut rows = Vec::with_capacity(ROWS);
    for _ in 0..ROWS {
        rows.push(path.period(&noise)?);
    }
    // One LSB of the drive ADC over the amplitude.
    let amplitude = rows.last().map_or(0.0, |r| r.magnitude)
        * crate::circuit::scale::amplitude_lsb_per_magnitude(design);
    let converters = 1.0 / amplitude.max(1.0) + address_truncation_rad(design);
    let mut found = Vec::new();
    if let Some(l) = &circuit.phase_loop {
        let turn = pow2(circuit.cordic.angle_bits as i32);
        let step_hz = circuit.sample_rate_hz * pow2(-(circuit.nco.phase_bits as i32));
        let block = PhaseLoop::new(l, circuit.cordic.angle_bits);
        let predicted = reduced_phase_loop(design, &block, &rest);
        let outputs: Vec<f64> = rows.iter().map(|r| r.freq_hz / step_hz).collect();
        let errors: Vec<f64> = rows
            .iter()
            .map(|r| r.phase_rad / TAU * turn - l.setpoint_raw as f64)
            .collect();
        found.push(Hunting {
            name: "phase_loop",
            chamber_degc: degc,
            output_unit: "tuning word step",
            error_mean_per_step_lsb: pow2(l.integral.shift as i32)
                / (l.integral.raw as f64 * ROWS as f64),
            converters_pp_lsb: turn / TAU * converters,
            error_pp: peak_to_peak(&errors) / turn * TAU,
            ..compare(&outputs, &errors, &predicted)
        });
    }
    if let Some(l) = &circuit.amplitude_loop {
        let output = circuit.decimator.output.format;
        let block = AmplitudeLoop::new(l, output.fraction_bits);
        let predicted = reduced_amplitude_loop(design, &block, &rest);
        let gain = pow2(l.gain_bits as i32 - 1);
        let outputs: Vec<f64> = rows.iter().map(|r| r.gain * gain).collect();
        let errors: Vec<f64> = rows
            .iter()
            .map(|r| l.setpoint_raw as f64 - r.magnitude / output.lsb())
            .collect();
        found.push(Hunting {
            name: "amplitude_loop",
            chamber_degc: degc,
            output_unit: "gain LSB",
            error_mean_per_step_lsb: pow2(l.integrator_shift as i32) / ROWS as f64,
            converters_pp_lsb: l.setpoint_raw as f64 * converters,
            error_pp: peak_to_peak(&errors) / l.setpoint_raw as f64,
            stands_at_limit: [0.0, l.gain_limit() as f64]
                .iter()
                .any(|end| outputs.iter().all(|o| o == end)),
            ..compare(&outputs, &errors, &predicted)
        });
    }
    Ok(found)
}

/// How far the address truncation may turn the carrier, rad, peak to peak; 0 for a tuning word that
/// meets the table's entries only.
fn address_truncation_rad(design: &Design) -> f64 {
    let nco = &design.circuit.nco;
    let below = (1i128 << (nco.phase_bits - nco.table_address_bits)) - 1;
    let coherent = i128::from(nco.tuning_word) & below == 0;
    if coherent && design.circuit.phase_loop.is_none() {
        0.0
    } else {
        TAU * pow2(-(nco.table_address_bits as i32))
    }
}

/// Outputs and errors, row by row.
type Series = (Vec<f64>, Vec<f64>);

fn compare(outputs: &[f64], errors: &[f64], (by_model, errors_by_model): &Series) -> Hunting {
    Hunting {
        name: "",
        chamber_degc: 0.0,
        output_unit: "",
        output_pp_lsb: peak_to_peak(outputs),
        predicted_output_pp_lsb: peak_to_peak(by_model),
        error_pp_lsb: peak_to_peak(errors),
        predicted_error_pp_lsb: peak_to_peak(errors_by_model),
        converters_pp_lsb: 0.0,
        error_mean_per_step_lsb: 0.0,
        error_mean_lsb: errors.iter().sum::<f64>() / errors.len().max(1) as f64,
        predicted_dead_band_lsb: 0.0,
        error_pp: 0.0,
        stands_at_limit: false,
    }
}

fn peak_to_peak(values: &[f64]) -> f64 {
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    high - values.iter().copied().fold(f64::INFINITY, f64::min)
}

/// A first-order lag followed by the decimator, at the decimated rate.
struct Envelope {
    decay: f64,
    level: f64,
    weights: Vec<f64>,
    /// Newest first.
    recent: Vec<f64>,
}

impl Envelope {
    fn new(design: &Design, level: f64) -> Self {
        let weights = row_weights(design);
        Envelope {
            decay: (-1.0 / (rest::envelope_s(design) * rows_per_s(design))).exp(),
            level,
            recent: vec![level; weights.len()],
            weights,
        }
    }

    /// A row in which the lag goes toward `target`.
    fn row(&mut self, target: f64) -> f64 {
        self.level = target + (self.level - target) * self.decay;
        self.recent.rotate_right(1);
        if let Some(newest) = self.recent.first_mut() {
            *newest = self.level;
        }
        let terms = self.recent.iter().zip(&self.weights);
        terms.map(|(level, weight)| level * weight).sum()
    }
}

/// The decimator's response to something that is constant within rows: the sums of its N-fold
/// convolved boxes of R M samples over rows, newest first; they add up to 1.
fn row_weights(design: &Design) -> Vec<f64> {
    let d = &design.circuit.decimator;
    let (span, ratio) = ((d.ratio * d.differential_delay) as usize, d.ratio as usize);
    let mut response = vec![1.0];
    for _ in 0..d.stages {
        let mut next = vec![0.0; response.len() + span - 1];
        for (k, r) in response.iter().enumerate() {
            for n in next.iter_mut().skip(k).take(span) {
                *n += r / span as f64;
            }
        }
        response = next;
    }
    response.chunks(ratio).map(|c| c.iter().sum()).collect()
}

fn reduced_amplitude_loop(design: &Design, block: &AmplitudeLoop, rest: &Rest) -> Series {
    let ar = Integers::new();
    let Some(l) = &design.circuit.amplitude_loop else {
        return (Vec::new(), Vec::new());
    };
    let setpoint = l.setpoint_raw as f64;
    let lsb = pow2(l.gain_bits as i32 - 1);
    let per_lsb = setpoint / (rest.gain * lsb);
    let mut state = block.holding(&ar, rest.gain);
    let mut envelope = Envelope::new(design, setpoint);
    let mut gain = (rest.gain * lsb).round();
    let count = ROWS * 2;
    let (mut outputs, mut errors) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let magnitude = envelope.row(gain * per_lsb).round();
        outputs.push(gain);
        errors.push(setpoint - magnitude);
        let [next] = block.step(&ar, &mut state, [magnitude as i128]);
        gain = next as f64;
    }
    (outputs.split_off(ROWS), errors.split_off(ROWS))
}

fn reduced_phase_loop(design: &Design, block: &PhaseLoop, rest: &Rest) -> Series {
    let ar = Integers::new();
    let setpoint = block.setpoint(&ar);
    let per_step = rest::phase_lsb_per_step(design);
    let wanted = rest.held.correction_steps;
    let mut state = block.holding(&ar, wanted);
    // Relative to the setpoint: more frequency, more lag.
    let mut envelope = Envelope::new(design, 0.0);
    let mut steps = wanted.round();
    let (mut outputs, mut errors) = (Vec::new(), Vec::new());
    for _ in 0..ROWS * 2 {
        let error = envelope.row(-(steps - wanted) * per_step).round();
        outputs.push(steps);
        errors.push(error);
        let [next] = block.step(&ar, &mut state, [setpoint + error as i128]);
        steps = next as f64;
    }
    (outputs.split_off(ROWS), errors.split_off(ROWS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::template::default_design;

    #[test]
    fn the_decimator_in_rows_is_a_cubic_spline_for_three_stages() {
        let design = default_design().expect("the default");
        let weights = row_weights(&design);
        let sum: f64 = weights.iter().sum();
        assert!((sum - 1.0).abs() < 1e-12);
        // Three boxes of 32: 1/6, 2/3, 1/6 in the limit of long rows.
        for (w, limit) in weights.iter().zip([1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0]) {
            assert!((w - limit).abs() < 0.02, "{weights:?}");
        }
    }

    #[test]
    fn the_loops_hunt_within_what_is_predicted_and_lose_no_error() {
        let fixed = default_design().expect("the default");
        let tracking = tracking_design();
        for (design, count) in [(fixed, 3), (tracking, 6)] {
            let found = hunting(&design).expect("a run");
            assert_eq!(found.len(), count);
            for h in found {
                assert!(h.error_pp_lsb <= h.most_error_pp_lsb(), "{h:?}");
                // The integral part moves no more than the output, but for a rounding.
                let most = h.error_mean_per_step_lsb * (h.output_pp_lsb + 1.0);
                assert!(h.error_mean_lsb.abs() <= most && most < 4.0, "{h:?}");
            }
        }
    }

    #[test]
    fn a_loop_that_stands_at_its_limit_is_not_said_to_correct_its_error() {
        let mut design = default_design().expect("the default");
        let working = definitions(&hunting(&design).expect("a run"));
        // A definition is a line of its own, begun by the word that it explains.
        for word in [
            "pp ",
            "output",
            "error",
            "circuit",
            "model",
            "limit",
            "mean error",
        ] {
            let of_word = working.iter().filter(|l| l.starts_with(word));
            assert_eq!(of_word.count(), 1, "{word}: {working:?}");
        }
        let working = working.join(" ");
        assert!(
            working.contains(
                "In 8192 rows a change by one gain LSB is a mean error of 0.500 LSB (amplitude_loop). It goes to 0 in a longer run."
            ) && working.contains("dead band: none")
                && !working.contains("limit in all rows"),
            "{working}"
        );
        if let Some(l) = &mut design.circuit.amplitude_loop {
            l.setpoint_raw = 100_000_000;
        }
        let found = hunting(&design).expect("a run");
        assert!(found.iter().all(|h| h.stands_at_limit), "{found:?}");
        let said = definitions(&found).join(" ");
        assert!(
            said.contains("(amplitude_loop at 0 degC, ") && !said.contains("dead band"),
            "{said}"
        );
    }

    /// The default with its phase loop switched on.
    fn tracking_design() -> Design {
        let mut design = default_design().expect("the default");
        let gain = |raw, shift| crate::design::LoopGain { raw, shift };
        design.circuit.phase_loop = Some(crate::design::PhaseLoop {
            setpoint_raw: -4_194_304,
            proportional: gain(9, 6),
            integral: gain(9, 11),
            integrator_bits: 48,
        });
        design
    }

    #[test]
    fn a_floor_in_the_loop_makes_the_gain_hunt() {
        // With the noise-free equilibrium between two gain words the output cannot stand still.
        let design = default_design().expect("the default");
        let found = hunting(&design).expect("a run");
        assert!(found.iter().all(|h| h.output_pp_lsb >= 1.0), "{found:?}");
    }
}
