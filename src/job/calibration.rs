//! From a record to a compensation in its formats.

use super::bound::{self, Kept};
use super::coefficients::{self, Rounded};
use super::{formats, warning};
use crate::design::{Compensation, CompensationInput, Design, FitOptions, FitOrder, Outside};
use crate::error::{InputError, Result};
use crate::record::{ThermalRecord, Warning};
use crate::thermal;
use crate::thermal::BaselineFit;

/// A fit that has been put into a design.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// The fit.
    pub fit: BaselineFit,
    /// Formats that were chosen for the design, with the reason; empty if it had its own.
    pub chosen: Vec<String>,
    /// The coefficients in their formats.
    pub rounded: Rounded,
    /// How the design's bound is kept, if it has one.
    pub kept: Option<Kept>,
    /// Of the fit.
    pub warnings: Vec<Warning>,
}

/// Fits the bias polynomial to a record and puts it, rounded, into the design's compensation, whose
/// formats are chosen where the design leaves them open.
///
/// # Errors
/// A record that has not what the compensation reads; coefficients that no format holds.
pub fn calibrate(
    design: &mut Design,
    record: &ThermalRecord,
    simulated: bool,
) -> Result<Calibration> {
    let mut warnings = Vec::new();
    if simulated && gives_up_held_phase(design) {
        warnings.push(warning(
            "phase_is_held",
            "the phase loop holds the drive phase, so it is no thermometer: the compensation's input is \
             tuning_word instead"
                .to_owned(),
        ));
    }
    let mut mapping = if simulated {
        Default::default()
    } else {
        design.record.clone()
    };
    formats::choose_thermometer(design, record, &mut mapping)?;
    let options = FitOptions {
        order: match design.fit.order {
            FitOrder::ByRecord if simulated => FitOrder::Fixed(SIMULATED_ORDER),
            FitOrder::ByRecord => FitOrder::Auto,
            order => order,
        },
        ..design.fit.clone()
    };
    let mut fit = thermal::fit(record, &mapping, &options)?;
    if simulated && design.fit.order == FitOrder::ByRecord {
        fit.reason = by_record(&fit);
    }
    let mut chosen = formats::fill(design, &fit, record)?;
    let rounded = coefficients::round(design, &fit)?;
    let mut beyond = fit.warnings.iter_mut();
    if let Some(warning) = beyond.find(|w| w.code == "extrapolation") {
        warning.message += beyond_the_range(design.compensation.as_ref());
    }
    warnings.extend(fit.warnings.iter().cloned());
    // A fit of another order than the file's has other products.
    crate::design::limits::check(design).map_err(|excess| {
        let message = format!(
            "{} needs {} bits, more than 127: {}",
            excess.key, excess.bits, excess.sum
        );
        InputError::new(message).help(excess.remedy())
    })?;
    let kept = bound::keep(design, &fit)?.map(|(kept, said)| {
        chosen.extend(said);
        kept
    });
    if design
        .compensation
        .as_ref()
        .is_some_and(|c| c.form.is_some())
    {
        chosen = chosen.into_iter().map(of_reference).collect();
    }
    Ok(Calibration {
        fit,
        chosen,
        rounded,
        kept,
        warnings,
    })
}

/// What was chosen, where another form replaces the polynomial in firmware: its coefficients and accumulator are not the firmware's.
fn of_reference(chosen: String) -> String {
    let is_of_polynomial = ["coefficients ", "accumulator "]
        .iter()
        .any(|what| chosen.starts_with(what));
    match is_of_polynomial {
        true => {
            format!("for the reference polynomial, which a form replaces in firmware: {chosen}")
        }
        false => chosen,
    }
}

/// What the firmware does where nothing was measured, and what to do about it.
fn beyond_the_range(compensation: Option<&Compensation>) -> &'static str {
    let limited = compensation.filter(|c| c.clamp_raw.is_some());
    match limited.map(|c| c.outside) {
        Some(Outside::Clamp | Outside::Flag) => {
            ". The firmware holds the bias of the nearer end there. If the gyro is to work there, record there"
        }
        Some(Outside::HoldSlope) => {
            ". The firmware goes on with the slope of the nearer end there (`compensation.outside`). If the gyro is to work \
             there, record there"
        }
        None => {
            ". The firmware evaluates it there. Record there, or keep the gyro within the range"
        }
    }
}

/// The order of a simulated run where the design leaves it to the record (convention: that of the paper).
const SIMULATED_ORDER: u32 = 2;

/// Why a simulated run's fit has its order, and the one that the same record gets where it is measured.
fn by_record(fit: &BaselineFit) -> String {
    let given = format!("order {SIMULATED_ORDER} as given");
    match fit.reason.strip_prefix(&given) {
        Some(rest) if !rest.is_empty() => format!(
            "order {SIMULATED_ORDER} is prescribed for the simulated run (Chen et al. 2004){rest}. `run --record` of this run's record \
             chooses by held-out error (fit.order = \"by_record\")"
        ),
        _ => fit.reason.clone(),
    }
}

/// A compensation by the phase is of no use where a phase loop holds it: its formats are chosen anew.
fn gives_up_held_phase(design: &mut Design) -> bool {
    let by_phase = |c: &Compensation| c.input == CompensationInput::Phase;
    let held =
        design.circuit.phase_loop.is_some() && design.compensation.as_ref().is_some_and(by_phase);
    if held {
        design.compensation_is_own = false;
    }
    held
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::target::Target;
    use crate::design::{BiasBound, reader};
    use crate::thermal::synthetic::{Random, record, triangle};

    /// What firmware does not have is not said to be chosen for it.
    #[test]
    fn words_of_a_polynomial_that_a_form_replaces_are_those_of_the_reference() {
        let degc = triangle(200);
        let mut random = Random::new(8);
        let rates = degc.iter().map(|t| 0.02 * t + 0.01 * random.normal());
        let record = record("die_degc", &degc, &rates.collect::<Vec<_>>());
        let chosen = |auto| {
            let mut design = reader::read(None).expect("the default");
            design.bound = Some(BiasBound {
                bound_dps: 0.05,
                auto,
                target: Target::CortexM4,
            });
            let made = calibrate(&mut design, &record, false).expect("a calibration");
            let form = design.compensation.expect("a compensation").form;
            (made.chosen, form.is_some())
        };
        let words =
            |lines: &[String], start: &str| lines.iter().any(|line| line.starts_with(start));
        let (replaced, by_form) = chosen(true);
        assert!(by_form && !words(&replaced, "coefficients ") && !words(&replaced, "accumulator "));
        assert!(words(
            &replaced,
            "for the reference polynomial, which a form replaces"
        ));
        assert!(words(&replaced, "output "), "{replaced:?}");
        let (own, by_form) = chosen(false);
        assert!(!by_form && words(&own, "coefficients "), "{own:?}");
    }

    /// Twelve rows cannot carry order 5: the warning says what the firmware does beyond them, which the design decides.
    #[test]
    fn beyond_the_range_the_warning_says_what_the_firmware_does() {
        let degc = triangle(12);
        let mut random = Random::new(6);
        let rates = degc
            .iter()
            .map(|t| 0.02 * t - 0.0003 * t * t + 0.3 * random.normal());
        let record = record("die_degc", &degc, &rates.collect::<Vec<_>>());
        let mut design = reader::read(None).expect("the default");
        design.fit.order = FitOrder::Fixed(5);
        let calibration = calibrate(&mut design, &record, false).expect("a calibration");
        let mut warnings = calibration.warnings.iter();
        let warning = warnings.find(|w| w.code == "extrapolation");
        let message = &warning.expect("a warning").message;
        assert!(
            message.starts_with("nothing was measured beyond 0 .. 63.636 degC, "),
            "{message}"
        );
        assert!(
            message.contains("holds the bias of the nearer end there"),
            "{message}"
        );
        let mut c = design.compensation.expect("a compensation");
        c.outside = Outside::HoldSlope;
        assert!(beyond_the_range(Some(&c)).contains("goes on with the slope"));
        c.clamp_raw = None;
        assert!(beyond_the_range(Some(&c)).contains("evaluates it there"));
    }
}
