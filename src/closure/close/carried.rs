//! What firmware carries of a closed record's model.

use super::Told;
use crate::closure::firmware;
use crate::correction::Term;
use crate::record::{ThermalRecord, Warning, stats};

/// A held-out error that is so many times another one is more: that of firmware beside the model's, or the declared one's.
const MORE: f64 = 1.02;

impl Told<'_> {
    /// The correction and its errors; none where firmware cannot carry it.
    pub(super) fn firmware(
        &self,
        record: &ThermalRecord,
        warnings: &mut Vec<Warning>,
    ) -> Option<firmware::Judged> {
        let c = self.search.channels;
        // Rates as they come in, and as they go out.
        let most = |name: &str| {
            let (low, high) =
                stats::extremes(record.column(name).unwrap_or(&[])).unwrap_or_default();
            low.abs().max(high.abs())
        };
        let widest = 1.25 * most("rate_out_dps").max(most("rate_dps")).max(1e-3);
        let estimates = self.search.estimates(self.after);
        let Some(plan) = firmware::plan(c, self.after, &estimates, widest) else {
            let obstacles = firmware::obstacles(c, self.after, &estimates);
            warnings.extend(
                obstacles
                    .into_iter()
                    .map(|why| Warning::general("not_compensable", why)),
            );
            return None;
        };
        let noise = self.after.fit.noise.white_rms_dps;
        let judged = |plan: &crate::correction::Plan| {
            firmware::judged(plan, record, c, &self.judged.heldout, noise)
        };
        if plan.keeps() {
            let said = "a lag goes on while the power is off: firmware keeps its state and makes up for the periods \
                        without power (the manual's \"The correction of averaged readings\"), as it did for the figures \
                        here";
            warnings.push(Warning::general("firmware_needs_clock", said));
        }
        let carried = match judged(&plan) {
            Ok(carried) => carried,
            Err(e) => {
                warnings.push(Warning::general("no_firmware", e.to_string()));
                return None;
            }
        };
        // Coefficients that cancel may be a model's; in words they are worse than no step at all.
        let declared = firmware::plan(c, self.before, &[], widest);
        let declared = declared.and_then(|plan| judged(&plan).ok()?.errors.heldout_rms);
        if let (Some(with), Some(without)) = (carried.errors.heldout_rms, declared)
            && !self.after.terms.is_empty()
            && with > MORE * without
        {
            let said = format!(
                "the steps' coefficients cancel each other: in firmware's words they leave {with:.3e} deg/s of \
                 held-out rows, the declared model alone {without:.3e}; do the separating experiment"
            );
            warnings.push(Warning::general("no_firmware", said));
            return None;
        }
        warnings.extend(self.behind(&carried));
        Some(carried)
    }

    /// What is said where firmware leaves more than the model does.
    fn behind(&self, carried: &firmware::Judged) -> Option<Warning> {
        let model = self.errors(self.after).heldout_rms;
        let firmware = carried.errors.heldout_rms?;
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
        let without_rounding = carried.unrounded_rms_dps / model;
        if reasons.is_empty() || without_rounding < MORE {
            reasons.push("its words are too short for this correction");
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
