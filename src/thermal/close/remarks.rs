//! What is said beside a closed record's figures.

use super::Told;
use crate::record::Warning;
use crate::text::number;
use crate::thermal::search::{LEVEL, Term};
use crate::thermal::{no_gain, rails};

impl Told<'_> {
    /// All of it but what firmware has to say; `sweep_loop` is said of heating and cooling.
    pub(super) fn warn(&self, sweep_loop: Option<Warning>, warnings: &mut Vec<Warning>) {
        warnings.extend(self.accidents().or_else(|| self.riddled()));
        warnings.extend(self.no_gain(sweep_loop.is_some()));
        warnings.extend(sweep_loop);
        warnings.extend(self.unrepeated_clip());
        if !self.found.within_rounding.is_empty() {
            let each = self.found.within_rounding.iter();
            let names: Vec<String> = each
                .map(|(id, rms)| format!("{id} ({rms})", rms = number(*rms, 3)))
                .collect();
            warnings.push(Warning::general(
                "within_adc_rounding",
                format!(
                    "the ADC's rounding makes {} deg/s rms of its own. These are below twice that (deg/s rms) and are not named: {}. Take \
                     an ADC with more bits, or more noise before it, to tell them",
                    number(self.search.channels.rounding_dps, 3),
                    names.join(", ")
                ),
            ));
        }
        for id in &self.found.once {
            warnings.push(Warning::general(
                "happens_once",
                format!(
                    "{id}: the record shows its step once, so that it may as well be a change at that moment (no effect \
                     of the catalogue); a second passage of that temperature separates the two"
                ),
            ));
        }
        if let Some((ppm, std_ppm)) = self.found.scale_ppm {
            warnings.push(Warning::on(
                "scale_factor_off",
                "rate_dps",
                format!(
                    "the scale factor is {:.6} times the nominal one ({ppm:.0} +- {std_ppm:.0} ppm), and as far as the record \
                     says everywhere the same: no effect of the catalogue. Give rate_out_dps at its own scale, divided by that",
                    1.0 + 1e-6 * ppm
                ),
            ));
        }
        if !self.found.undecided.is_empty() {
            warnings.push(Warning::general(
                "undecided",
                format!(
                    "{} explain the record equally well. It does not say which of them it is. Do the experiment that separates them \
                     (the table Evidence in report.html names it)",
                    self.found.undecided.join(", ")
                ),
            ));
        }
        let hidden: Vec<String> = self.goes_with_temperature();
        if !hidden.is_empty() {
            warnings.push(Warning::general(
                "goes_with_temperature",
                format!(
                    "the dependence on temperature may come from {} as well: this record cannot tell. The table Evidence in report.html \
                     names the experiment that can",
                    hidden.join(" or ")
                ),
            ));
        }
    }

    /// What is said where something is left, and as much varies as before. Noise alone is no drift.
    fn no_gain(&self, has_loop: bool) -> Option<Warning> {
        let left = self.after.residual(self.whole);
        let rows = self.whole.error_dps.iter().zip(&left).zip(&self.whole.u);
        let rows = rows.zip(&self.rows.accidents);
        let usual = rows.filter(|((rates, _), accident)| rates.0.is_finite() && !**accident);
        let readings = usual.map(|(((before, after), u), _)| [*u, *before, *after]);
        let is_left = self.found.left.is_some();
        is_left
            .then(|| no_gain::warning(&self.whole.thermometer, readings, has_loop, false))
            .flatten()
    }

    /// What is said of a clip that is named and that no equal readings show. An applied rate that moves takes the output beyond a level
    /// at any temperature, which no bend of the drift does: there the name says enough.
    fn unrepeated_clip(&self) -> Option<Warning> {
        let c = self.search.channels;
        let terms = self.found.terms.iter().enumerate();
        let mut clips = terms.filter(|(_, term)| term.candidate.is_last());
        let (k, clip) = clips.next().filter(|_| c.moving("rate_dps").is_none())?;
        let levels = self.unrepeated_levels_dps(k, clip);
        let levels: Vec<String> = levels.iter().map(|level| number(*level, 4)).collect();
        let each = match levels.len() {
            1 => "the level",
            _ => "each level",
        };
        (!levels.is_empty()).then(|| {
            let said = format!(
                "{} is found at {} deg/s, where readings do not repeat as those of a clipped converter or output word do. A real clip \
                 there lies before the noise, as in an amplifier; a bend or an extreme of the drift that the other causes do not follow \
                 looks the same. Look at the converter's codes, and compare {each} with the gyro's full scale",
                clip.id(),
                levels.join(" and "),
            );
            Warning::on("clip_without_repeated_readings", "rate_out_dps", said)
        })
    }

    /// Levels, deg/s, of a clip, the term of that number, on whose side no readings repeat, neither among the fitted rows nor among all.
    fn unrepeated_levels_dps(&self, number: usize, clip: &Term) -> Vec<f64> {
        let estimates = self.search.estimates(self.after);
        let Some(estimate) = estimates.get(number) else {
            return Vec::new();
        };
        let of_all = rails::of(self.whole, &vec![true; self.whole.len()]);
        let seen = [self.search.rails.as_ref(), of_all.as_ref()];
        let seen = || seen.into_iter().flatten();
        let reported = clip.candidate.report(self.search.channels, estimate);
        let level = |name: &str| reported.get(name).map(|(level, _)| *level);
        let upper = level("high_dps").filter(|_| seen().all(|rails| rails.upper_dps.is_none()));
        let lower = level("low_dps").filter(|_| seen().all(|rails| rails.lower_dps.is_none()));
        upper.into_iter().chain(lower).collect()
    }

    /// What is said of rows that no figure has in it.
    fn accidents(&self) -> Option<Warning> {
        let search = self.search;
        let residual = self.after.residual(self.whole);
        let accidents = self.rows.accidents.iter().enumerate();
        let rows: Vec<usize> = accidents.filter(|(_, a)| **a).map(|(row, _)| row).collect();
        let unfitted = rows.iter().filter(|row| !search.train[**row]).count();
        let farthest = rows
            .iter()
            .copied()
            .max_by(|a, b| residual[*a].abs().total_cmp(&residual[*b].abs()))?;
        Some(Warning::on(
            "outliers",
            "rate_out_dps",
            format!(
                "{} of {} rows ({}) stand out by more than six deviations, whatever the model, alone or a few in a \
                 row. They are taken for accidents and are not in the errors. Look at the farthest: at {} s it is off by {} \
                 deg/s",
                rows.len(),
                residual.len(),
                kept_from_fit(unfitted),
                search.channels.time_s[farthest],
                number(residual[farthest], 3)
            ),
        ))
    }

    /// What is said of rows that are far off and too many for accidents.
    fn riddled(&self) -> Option<Warning> {
        let search = self.search;
        let rows = search.riddled(self.after)?;
        let unfitted = rows.iter().filter(|row| !search.train[**row]).count();
        let first = rows.first().map(|row| search.channels.time_s[*row])?;
        let question = match search.channels.moving("rate_dps") {
            Some(_) => {
                "Do the output and the applied rate of a row belong to one time (a rate table that moves within rows, an output that comes \
                 late)?"
            }
            None => {
                "Was the gyro turned or shaken in them, or is their output faulty? Cut them, or record again at rest"
            }
        };
        Some(Warning::on(
            "many_outliers",
            "rate_out_dps",
            format!(
                "{} of {} rows ({}) are more than six deviations off the others, the first at {first} s: too many \
                 for accidents, so they are in the errors, and no candidate makes them. {question}",
                rows.len(),
                search.channels.len(),
                kept_from_fit(unfitted)
            ),
        ))
    }

    /// Names of other channels' effects that the declared bias has in it.
    fn goes_with_temperature(&self) -> Vec<String> {
        let search = self.search;
        let named = self.found.first.iter().filter(|j| j.candidate.named());
        let others = named.filter(|j| {
            let channels = j.candidate.channels_at(search.channels, &j.point);
            let first = channels.first();
            first.is_some_and(|c| *c != search.channels.thermometer && c != "time_s")
        });
        // As in `evidence`: what is beyond chance beside the declared model is not in it.
        let hidden = others.filter(|j| j.p_value > LEVEL && search.is_declared(j));
        let taken = |id: &String| self.found.terms.iter().any(|t| t.id() == *id);
        let ids = hidden.map(|j| j.candidate.id());
        ids.filter(|id| !taken(id)).collect()
    }
}

/// What so many rows are that no fit has seen.
fn kept_from_fit(rows: usize) -> String {
    format!("{rows} of them kept from the fit, for the choice of causes or the error")
}

#[cfg(test)]
mod tests {
    use crate::design::reader;
    use crate::record::ThermalRecord;
    use crate::thermal::close::close;
    use crate::thermal::search::Effort;
    use crate::thermal::synthetic::{Random, record, triangle};
    use crate::verdict::{Closure, Verdict};
    use std::ops::Range;

    fn closed(degc: &[f64], output: &[f64]) -> Closure {
        closure(&record("die_degc", degc, output))
    }

    fn closure(record: &ThermalRecord) -> Closure {
        let design = reader::parse("", None).unwrap();
        let closed = close(record, Vec::new(), &design, "test", Effort::default());
        closed.unwrap().closure
    }

    /// A gyro over two cycles of temperature that was turned at 50 deg/s in some of its 600 rows.
    fn turned(rows: Range<usize>) -> Closure {
        let mut random = Random::new(3);
        let phase = |k: u32| f64::from(k) / 300.0 * std::f64::consts::TAU;
        let degc: Vec<f64> = (0..600).map(|k| 25.0 + 20.0 * phase(k).sin()).collect();
        let output: Vec<f64> = (0..)
            .zip(&degc)
            .map(|(k, t)| {
                let turned = f64::from(u8::from(rows.contains(&k)));
                0.1 + 0.01 * t + 50.0 * turned + 0.01 * random.normal()
            })
            .collect();
        closed(&degc, &output)
    }

    fn message<'a>(closure: &'a Closure, code: &str) -> Option<&'a str> {
        let mut said = closure.warnings.iter();
        said.find(|w| w.code == code).map(|w| w.message.as_str())
    }

    #[test]
    fn a_gyro_that_was_turned_is_told_as_run_tells_it() {
        for (rows, is_told) in [(300..359, true), (0..0, false)] {
            let closure = turned(rows);
            assert_eq!(
                message(&closure, "no_gain").is_some(),
                is_told,
                "{:?}",
                closure.warnings
            );
        }
    }

    /// The turn lies within rows that are fitted: the polynomial goes through it, and is far off where the gyro was at rest.
    #[test]
    fn no_firmware_is_written_that_is_worse_than_a_constant() {
        let closure = turned(321..399);
        assert!(!closure.firmware.compensable);
        let told = message(&closure, "firmware_useless").unwrap();
        assert!(told.contains("and a constant leaves 0."), "{told}");
        let at_rest = turned(0..0);
        assert!(at_rest.firmware.compensable && message(&at_rest, "firmware_useless").is_none());
    }

    /// A gyro whose output is clipped at a level; `rate_dps` is applied in turn, both ways, and `late_dps` is noise that comes after the
    /// clip.
    fn clipped(level_dps: f64, rate_dps: f64, late_dps: f64) -> Closure {
        let mut random = Random::new(6);
        let degc = triangle(360);
        let rate: Vec<f64> = (0..360)
            .map(|k| rate_dps * f64::from(k % 5 - 2) / 2.0)
            .collect();
        let output: Vec<f64> = degc
            .iter()
            .zip(&rate)
            .map(|(t, rate)| {
                let [early, late] = [0.01 - late_dps, late_dps].map(|std| std * random.normal());
                (0.5 + 0.05 * t + rate + early).min(level_dps) + late
            })
            .collect();
        let mut record = record("die_degc", &degc, &output);
        record.columns.insert("rate_dps".to_owned(), rate);
        closure(&record)
    }

    #[test]
    fn a_clip_at_rest_without_equal_readings_is_told_with_what_looks_the_same() {
        let code = "clip_without_repeated_readings";
        let is_named = |c: &Closure| c.steps.iter().any(|s| s.effect == "output_saturation");
        let before = clipped(3.0, 0.0, 0.01);
        assert!(is_named(&before), "{:?}", before.steps);
        let told = message(&before, code).unwrap();
        for part in [
            "output_saturation is found at 3.00",
            "lies before the noise",
            "compare the level with the gyro's full scale",
        ] {
            assert!(told.contains(part), "{told}");
        }
        // Readings that repeat show a clip of the converter; a rate that passes the level shows one at any temperature.
        for shown in [clipped(3.0, 0.0, 0.0), clipped(30.0, 40.0, 0.01)] {
            assert!(is_named(&shown), "{:?}", shown.steps);
            assert_eq!(message(&shown, code), None);
        }
    }

    /// One row in six is off by fifty times the noise: too many for accidents.
    #[test]
    fn many_outliers_ask_of_a_rate_table_where_there_is_one() {
        let asked = |rate_dps: f64| {
            let mut random = Random::new(7);
            let degc = triangle(360);
            let rate: Vec<f64> = (0..360)
                .map(|k| rate_dps * f64::from(k % 5 - 2) / 2.0)
                .collect();
            let pairs = degc.iter().zip(&rate);
            let output: Vec<f64> = pairs
                .map(|(t, rate)| {
                    let off = match random.uniform() {
                        u if u < 1.0 / 12.0 => -0.5,
                        u if u < 1.0 / 6.0 => 0.5,
                        _ => 0.0,
                    };
                    0.3 + 0.01 * t + rate + off + 0.01 * random.normal()
                })
                .collect();
            let mut record = record("die_degc", &degc, &output);
            record.columns.insert("rate_dps".to_owned(), rate);
            let closure = closure(&record);
            message(&closure, "many_outliers").unwrap().to_owned()
        };
        let (at_rest, turned) = (asked(0.0), asked(40.0));
        assert!(
            at_rest
                .contains(" of them kept from the fit, for the choice of causes or the error) are"),
            "{at_rest}"
        );
        assert!(
            at_rest.contains("record again at rest") && !at_rest.contains("rate table"),
            "{at_rest}"
        );
        assert!(turned.contains("a rate table that moves"), "{turned}");
    }

    #[test]
    fn what_firmware_does_not_know_is_told_with_what_to_do() {
        let mut random = Random::new(5);
        let degc = triangle(300);
        let output: Vec<f64> = (0..)
            .zip(&degc)
            .map(|(k, t)| {
                let pickup = (f64::from(k) * std::f64::consts::TAU / 17.3).sin();
                0.5 - 0.02 * t + 0.1 * pickup + 0.01 * random.normal()
            })
            .collect();
        let with = closed(&degc, &output);
        let told = message(&with, "not_compensable").unwrap();
        for part in [
            "periodic_pickup depends on absolute time",
            "the polynomial alone use `gyrogen run`",
        ] {
            assert!(told.contains(part), "{told}");
        }
        // `run` refuses a record without a thermometer.
        let still: Vec<f64> = output
            .iter()
            .zip(&degc)
            .map(|(o, t)| o + 0.02 * t)
            .collect();
        let mut bare = record("die_degc", &degc, &still);
        bare.columns.remove("die_degc");
        let without = closure(&bare);
        let told = message(&without, "not_compensable").unwrap();
        assert!(!told.contains("gyrogen run"), "{told}");
    }

    /// A play of 8 K between the die and what the bias follows: no effect of the catalogue.
    #[test]
    fn a_backlash_that_no_effect_makes_is_told_of_heating_and_cooling() {
        let mut random = Random::new(4);
        let phase = |k: u32| f64::from(k) / 200.0 * std::f64::consts::TAU;
        let degc: Vec<f64> = (0..600).map(|k| 25.0 + 20.0 * phase(k).sin()).collect();
        let mut behind = 25.0;
        let output: Vec<f64> = degc
            .iter()
            .map(|t| {
                behind = f64::clamp(behind, t - 4.0, t + 4.0);
                0.1 + 0.02 * t + 0.05 * (behind - t) + 0.005 * random.normal()
            })
            .collect();
        let closure = closed(&degc, &output);
        assert_eq!(closure.verdict, Verdict::Unexplained);
        let loops = closure.warnings.iter();
        let loops: Vec<_> = loops.filter(|w| w.code == "heating_cooling_loop").collect();
        let [told] = loops.as_slice() else {
            panic!("{:?}", closure.warnings);
        };
        // What it sends a user of `run` to is this command.
        assert!(!told.message.contains("gyrogen close"), "{}", told.message);
    }
}
