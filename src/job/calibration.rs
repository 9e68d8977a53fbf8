//! From a record to a compensation in its formats.

use super::bound::{self, Kept};
use super::coefficients::{self, Rounded};
use super::{formats, warning};
use crate::design::{Compensation, CompensationInput, Design, FitOptions, FitOrder};
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
    warnings.extend(fit.warnings.iter().cloned());
    let mut chosen = formats::fill(design, &fit, record)?;
    let rounded = coefficients::round(design, &fit)?;
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
    Ok(Calibration {
        fit,
        chosen,
        rounded,
        kept,
        warnings,
    })
}

/// The order of a simulated run where the design leaves it to the record (convention: that of the paper).
const SIMULATED_ORDER: u32 = 2;

/// Why a simulated run's fit has its order, and the one that the same record gets where it is measured.
fn by_record(fit: &BaselineFit) -> String {
    let given = format!("order {SIMULATED_ORDER} as given");
    match fit.reason.strip_prefix(&given) {
        Some(rest) if !rest.is_empty() => format!(
            "order {SIMULATED_ORDER}, as in Chen et al. (2004), for the simulated run{rest}, and `run --record` of this run's record takes \
             that (fit.order = \"by_record\")"
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
