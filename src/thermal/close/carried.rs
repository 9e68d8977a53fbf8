//! What firmware carries of a closed record's model.

use super::{Told, rms_of};
use crate::correction::{Formats, Plan, Term};
use crate::design::Design;
use crate::record::{ThermalRecord, Warning};
use crate::statistics::stats;
use crate::text::number;
use crate::thermal::channels::Channels;
use crate::thermal::firmware;

/// An error that is so many times another one is more: that of firmware beside the model's, the declared one's, or a constant's
/// (convention).
pub const MORE: f64 = 1.02;

/// Firmware that leaves more than so many times what a constant leaves is worse than that, and not by chance: in white noise and in a
/// walk, with one to six sweeps of the temperature, a polynomial left more than 1.7 times as much in one of a thousand.
const WORSE: f64 = 2.0;

/// Codes of what `intake` takes out of a record's readings, and firmware does not.
const TAKEN_OUT: [&str; 3] = [
    "thermometer_quantised",
    "thermometer_repeats",
    "adc_not_dithered",
];

/// The full scale of the rate, deg/s, that a record's own rates ask for, as they come in and as they go out (of the rows that are
/// seen); and the gyro's, which a record at rest says nothing of.
fn full_scales_dps(seen: &Channels, design: &Design) -> (f64, Option<f64>) {
    let most = |values: &[f64]| {
        let (low, high) = stats::extremes(values).unwrap_or_default();
        low.abs().max(high.abs())
    };
    let out = most(&seen.output_dps());
    let applied = most(seen.column("rate_dps").unwrap_or(&[]));
    let own = 1.25 * out.max(applied).max(1e-3);
    let gyros = design.thermal_run.sense_full_scale_dps;
    (own, (applied == 0.0).then(|| own.max(gyros)))
}

impl Told<'_> {
    /// The correction and its errors; none where firmware cannot carry it.
    pub(super) fn firmware(
        &self,
        record: &ThermalRecord,
        design: &Design,
        warnings: &mut Vec<Warning>,
    ) -> Option<firmware::Judged> {
        let c = self.search.channels;
        let estimates = self.search.estimates(self.after);
        let noise = self.after.fit.noise.white_rms_dps;
        let (own, gyros) = full_scales_dps(c, design);
        let planned = |full_scale_dps| firmware::plan(c, self.after, &estimates, full_scale_dps);
        let fits = |plan: &Plan| Formats::choose(plan, noise).is_ok();
        let wide = gyros.and_then(planned).filter(fits);
        let Some(plan) = wide.or_else(|| planned(own)) else {
            let obstacles = firmware::obstacles(c, self.after, &estimates);
            warnings.extend(
                obstacles
                    .into_iter()
                    .map(|why| Warning::general("not_compensable", why)),
            );
            return None;
        };
        let judged = |plan: &Plan| firmware::judged(plan, record, c, noise);
        if plan.keeps() {
            let said = "a lag goes on while the power is off: firmware keeps its state and makes up for the periods \
                        without power (the manual's \"The correction of averaged readings\"), as it did for the figures \
                        here";
            warnings.push(Warning::general("firmware_needs_clock", said));
        }
        let carried = match judged(&plan) {
            Ok(carried) => carried,
            Err(e) => {
                warnings.push(Warning::general("no_firmware", e.placeless()));
                return None;
            }
        };
        // Coefficients that cancel may be a model's; in words they are worse than no step at all.
        let declared = firmware::plan(c, self.before, &[], plan.full_scale_dps);
        let declared = declared.and_then(|plan| judged(&plan).ok());
        let chosen = carried.errors(&self.rows.choosing);
        let without = declared.and_then(|d| d.errors(&self.rows.choosing).heldout_rms);
        if let (Some(with), Some(without)) = (chosen.heldout_rms, without)
            && !self.after.terms.is_empty()
            && with > MORE * without
        {
            let said = format!(
                "the steps' coefficients cancel each other, and rounded to firmware's words they do so no more: they leave {with} \
                 deg/s rms of the rows that models are chosen by, the polynomial alone {without}. No firmware is written. Do the \
                 experiment that separates the steps (the table Evidence in report.html names it)",
                with = number(with, 3),
                without = number(without, 3)
            );
            warnings.push(Warning::general("no_firmware", said));
            return None;
        }
        if !self.after.terms.is_empty() {
            let [none, model] = [self.before, self.after].map(|m| self.choosing_rms(m));
            if let Err(told) = chosen.unless_useless(none, model, "deg/s") {
                warnings.push(Warning::general("firmware_useless", told));
                return None;
            }
        }
        if let Some(told) = chosen.heldout_rms.and_then(|rms| self.unlike_readings(rms)) {
            warnings.push(told);
            return None;
        }
        let behind = self.behind(&carried, warnings);
        warnings.extend(behind);
        Some(carried)
    }

    /// What a constant leaves of some rows, deg/s rms. The constant is the median of the fitted rows: their mean may be as far off as the
    /// polynomial.
    pub(super) fn constant_rms_dps(&self, rows: &[bool]) -> f64 {
        let read = &self.whole.error_dps;
        let fitted = read.iter().zip(&self.rows.fitted);
        let fitted: Vec<f64> = fitted.filter(|(_, row)| **row).map(|(e, _)| *e).collect();
        let middle = stats::median(&fitted);
        let about: Vec<f64> = read.iter().map(|e| e - middle).collect();
        rms_of(&about, rows)
    }

    /// What is said where firmware makes the rows that choose, of which it leaves `firmware_dps` rms, worse than a constant does.
    fn unlike_readings(&self, firmware_dps: f64) -> Option<Warning> {
        let read_dps = self.constant_rms_dps(&self.rows.choosing);
        // Readings that are all the same have no error of their own, and firmware has its rounding.
        let noise_dps = self.after.fit.noise.white_rms_dps;
        (firmware_dps > WORSE * read_dps.hypot(noise_dps)).then(|| {
            let said = format!(
                "no firmware is written: of the rows that models are chosen by it would leave {} deg/s rms, and a constant leaves {}. \
                 What is in the fitted rows is not in these. Look for fitted rows in which the gyro was turned, and cut them",
                number(firmware_dps, 3),
                number(read_dps, 3)
            );
            Warning::general("firmware_useless", said)
        })
    }

    /// What is said where firmware leaves more than the model does.
    fn behind(&self, carried: &firmware::Judged, said: &[Warning]) -> Option<Warning> {
        let model = self.errors(self.after).heldout_rms;
        let firmware = carried.errors(&self.rows.judging).heldout_rms?;
        let terms = &carried.correction.plan.terms;
        let mut reasons = Vec::new();
        if terms.iter().any(Term::remembers) {
            reasons.push("it has no readings to come, so that a change of the temperature's slope shows late");
        }
        if terms.iter().any(Term::is_on_rate) {
            reasons.push(
                "it finds the rate from its own noisy output, where the model has the applied one",
            );
        }
        if said.iter().any(|w| TAKEN_OUT.contains(&w.code)) {
            reasons.push("it has the readings as they are, and what was taken out of them for the model is in its error");
        }
        let without_rounding = carried.unrounded_rms_dps(&self.rows.judging) / model;
        // The greater part of what firmware leaves more.
        let by_words = firmware / model - without_rounding > (without_rounding - 1.0).abs();
        if by_words {
            reasons.push("its words are too short for this correction");
        } else if reasons.is_empty() {
            reasons.push("it has each reading with its noise or its rounding, where the model has the course without them");
        }
        (firmware > MORE * model).then(|| {
            let said = format!(
                "firmware leaves {:.3} times what the model leaves of held-out rows, {without_rounding:.3} times without \
                 rounding: {}",
                firmware / model,
                reasons.join("; ")
            );
            Warning::general("firmware_behind", said)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::MORE;
    use crate::design::reader;
    use crate::thermal::close::close;
    use crate::thermal::search::Effort;
    use crate::thermal::synthetic::{Random, record, triangle};

    /// The full scale of the correction of a record with rates up to `most_dps` in noise of `noise_dps`, and how many times the
    /// model's held-out error its firmware leaves. The scale factor bends by `bend_ppm` a kelvin squared.
    fn carried(most_dps: f64, noise_dps: f64, bend_ppm: f64) -> (f64, f64) {
        let mut random = Random::new(5);
        let degc = triangle(240);
        let rate: Vec<f64> = (0..240)
            .map(|k| most_dps * f64::from(k % 5 - 2) / 2.0)
            .collect();
        let pairs = degc.iter().zip(&rate);
        let output: Vec<f64> = pairs
            .map(|(t, rate)| {
                let scale = 1.0 + 1e-6 * bend_ppm * (t - 30.0).powi(2);
                0.5 - 0.02 * t + rate * scale + noise_dps * random.normal()
            })
            .collect();
        let mut record = record("die_degc", &degc, &output);
        record.columns.insert("rate_dps".to_owned(), rate);
        let design = reader::parse("", None).unwrap();
        let closed = close(&record, Vec::new(), &design, "test", Effort::default()).unwrap();
        let full_scale_dps = closed.correction.unwrap().plan.full_scale_dps;
        let errors = closed.closure;
        assert_eq!(errors.steps.len(), usize::from(bend_ppm != 0.0));
        let times = errors.firmware.heldout_rms.unwrap() / errors.after.heldout_rms;
        (full_scale_dps, times)
    }

    #[test]
    fn firmware_of_a_record_at_rest_holds_the_gyros_rates() {
        let (full_scale_dps, times) = carried(0.0, 0.01, 0.0);
        assert!(
            full_scale_dps >= 1024.0 && times < MORE,
            "{full_scale_dps} {times}"
        );
        // Rates that were applied are those that the correction is for.
        let (full_scale_dps, times) = carried(40.0, 0.01, 0.0);
        assert!((50.0..55.0).contains(&full_scale_dps) && times < MORE);
        // So little noise that the gyro's range does not fit into a word beside it.
        let (full_scale_dps, times) = carried(0.0, 1e-6, 0.0);
        assert!(
            full_scale_dps < 2.0 && times < MORE,
            "{full_scale_dps} {times}"
        );
    }

    #[test]
    fn firmware_carries_a_scale_factor_that_bends() {
        for bend_ppm in [4.0, -2.0] {
            let (_, times) = carried(200.0, 0.01, bend_ppm);
            assert!(times < MORE, "{bend_ppm}: {times}");
        }
    }
}
