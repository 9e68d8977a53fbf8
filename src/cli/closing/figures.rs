//! What `gyrogen close` prints of errors: each with its rows, and what it says beside the others.

use super::Said;
use crate::capture::around::LEAST_VARIANCE;
use crate::thermal::close::MORE;
use crate::verdict::Closure;

/// The errors from the readings on, a step at a time.
pub(super) fn errors(c: &Closure, said: Option<&Said>) -> String {
    let (before, after, floor) = (c.before.heldout_rms, c.after.heldout_rms, c.noise_floor_rms);
    let unit = c.unit_text();
    let Some(said) = said else {
        let causes = match c.steps.is_empty() {
            true => String::new(),
            false => format!(", {after:.5} after the causes too"),
        };
        return format!(
            "held-out rms of code less model, in {unit} of the ADC's codes, both channels together: {before:.5} after the declared \
             tones{causes}\nnoise floor: {floor:.5} {unit} rms, white noise from the residual's spectrum; no less than {:.5} is taken, \
             nearly the rounding error of an ideal ADC. Where the rounding repeats with the tone, the rms can be below it",
            LEAST_VARIANCE.sqrt()
        );
    };
    let causes = match c.steps.is_empty() {
        true => String::new(),
        false => format!("{after:.5} after the causes too; "),
    };
    let (as_read, rms) = said.as_read;
    format!(
        "held-out rms, {unit}: {rms:.5} {as_read}; {before:.5} after the polynomial; {causes}noise floor {floor:.5}"
    )
}

/// What is said of firmware for a capture: there is none, whatever a correction would leave.
pub(super) fn of_capture(c: &Closure) -> String {
    let none = "no firmware is written for a capture";
    match c.firmware.heldout_rms.filter(|_| !c.steps.is_empty()) {
        Some(rms) => format!(
            "{none}; a correction of its codes in integers would leave a held-out rms of {rms:.5} {} (computed)",
            c.unit_text()
        ),
        None => none.to_owned(),
    }
}

/// What is said where something is left although the held-out rows show no more than noise, by chance one standard deviation more:
/// the one is found in the order of the fitted rows, the other is a size.
pub(super) fn small_and_left(c: &Closure, said: &Said) -> Option<String> {
    let by_chance = 1.0 + said.chance();
    let is_small = c.after.heldout_rms <= by_chance * c.noise_floor_rms;
    (c.residual_structure.left && is_small).then(|| {
        "the held-out rms alone shows no more than noise. What is left is seen in the order of the fitted rows: in time, or over the \
         readings of a column, their residuals do not follow each other as noise does"
            .to_owned()
    })
}

/// What is said of firmware that leaves as much of the held-out rows as a constant does, or as the polynomial without the causes;
/// nothing where the warning `no_gain` says it.
pub(super) fn no_gain(c: &Closure, said: &Said) -> Option<String> {
    let firmware = c.firmware.heldout_rms?;
    let gains = |other: f64| other > MORE * firmware;
    // Less than that is no gain, and the figures are not to contradict the sentence.
    let what = |other: f64| match other > firmware {
        true => "hardly anything",
        false => "nothing",
    };
    let (constant, polynomial) = (said.constant_rms_dps, c.before.heldout_rms);
    if c.warnings.iter().any(|w| w.code == "no_gain") {
        None
    } else if !gains(constant) {
        Some(format!(
            "the firmware gains {} over a constant here, which leaves {constant:.5} deg/s rms of the same rows",
            what(constant)
        ))
    } else if !c.steps.is_empty() && !gains(polynomial) {
        Some(format!(
            "the causes gain {} in firmware here: the polynomial alone leaves {polynomial:.5} deg/s rms of the same rows",
            what(polynomial)
        ))
    } else {
        None
    }
}

/// What the rows served for, what the noise floor is, and why `run` has other figures: a line each.
pub(super) fn held_out(said: Option<&Said>) -> String {
    let Some(said) = said else {
        return "held out: a part of the capture that no fit used".to_owned();
    };
    let Said { roles, judging, .. } = said;
    let [judge, choose] = roles.map(|share| (100.0 * share).round());
    let fit = 100.0 - judge - choose;
    let which = match roles[0] > 0.0 {
        true => format!(
            "rows: {fit} % for fitting, {choose} % for the choice of causes, {judge} % held out for the error."
        ),
        false => format!(
            "rows: {fit} % for fitting, {choose} % for the choice of causes. The held-out error is of these {choose} % too, as the \
             record is too short to keep others for it alone."
        ),
    };
    let chance = (100.0 * said.chance()).round();
    format!(
        "{which}\nnoise floor: white noise, from differences of neighbouring residuals. The held-out rms has slow noise in it as \
         well, and being of {judging} rows it is off by {chance} % by chance alone (one standard deviation).\n`run` has other figures: its \
         held-out rms is of blocks that are each predicted from all other rows, and its noise floor is of the residuals of a \
         polynomial."
    )
}

#[cfg(test)]
mod tests {
    use super::super::tests::{closure, of_roles};
    use super::*;
    use crate::record::Warning;

    #[test]
    fn errors_begin_with_the_readings_and_name_each_step() {
        let said = of_roles([0.07, 0.2], 42);
        assert_eq!(
            errors(&closure("deg/s", 1), Some(&said)),
            "held-out rms, deg/s: 1.55000 as read; 0.50000 after the polynomial; 0.02000 after the causes too; noise floor 0.01000"
        );
        assert_eq!(
            errors(&closure("deg/s", 0), Some(&said)),
            "held-out rms, deg/s: 1.55000 as read; 0.50000 after the polynomial; noise floor 0.01000"
        );
        assert_eq!(
            errors(&closure("lsb", 1), None),
            "held-out rms of code less model, in LSB of the ADC's codes, both channels together: 0.50000 after the declared tones, \
             0.02000 after the causes too\nnoise floor: 0.01000 LSB rms, white noise from the residual's spectrum; no less than \
             0.26458 is taken, nearly the rounding error of an ideal ADC. Where the rounding repeats with the tone, the rms can be \
             below it"
        );
        assert!(!errors(&closure("lsb", 0), None).contains("causes"));
    }

    #[test]
    fn of_a_capture_it_is_said_that_no_firmware_is_written() {
        let of = |steps| {
            let mut c = closure("lsb", steps);
            c.firmware.heldout_rms = Some(0.3);
            of_capture(&c)
        };
        assert_eq!(of(0), "no firmware is written for a capture");
        assert!(of(1).ends_with("would leave a held-out rms of 0.30000 LSB (computed)"));
    }

    #[test]
    fn an_error_below_the_noise_floor_says_by_what_it_is_left() {
        let said = of_roles([0.07, 0.2], 50);
        let mut small = closure("deg/s", 1);
        assert_eq!(small_and_left(&small, &said), None);
        // Within what chance makes of 50 rows: ten percent.
        small.after.heldout_rms = 1.09 * small.noise_floor_rms;
        let told = small_and_left(&small, &said).unwrap();
        assert!(told.contains("in the order of the fitted rows"), "{told}");
        small.residual_structure.left = false;
        assert_eq!(small_and_left(&small, &said), None);
    }

    #[test]
    fn firmware_that_gains_nothing_says_what_does_as_well_once() {
        let said = of_roles([0.07, 0.2], 50);
        let of = |steps, firmware_dps| {
            let mut c = closure("deg/s", steps);
            c.firmware.heldout_rms = Some(firmware_dps);
            c
        };
        assert_eq!(no_gain(&of(1, 0.02), &said), None);
        // The constant leaves 1.5, the polynomial 0.5.
        let mut none = of(0, 1.51);
        let told = no_gain(&none, &said).unwrap();
        assert!(
            told.contains("nothing over a constant here, which leaves 1.50000"),
            "{told}"
        );
        let hardly = no_gain(&of(0, 1.49), &said).unwrap();
        assert!(
            hardly.contains("hardly anything over a constant"),
            "{hardly}"
        );
        none.warnings
            .push(Warning::general("no_gain", String::new()));
        assert_eq!(no_gain(&none, &said), None);
        let told = no_gain(&of(1, 0.495), &said).unwrap();
        assert!(
            told.contains("the polynomial alone leaves 0.50000"),
            "{told}"
        );
        assert_eq!(no_gain(&of(0, 0.495), &said), None);
        assert_eq!(no_gain(&closure("deg/s", 0), &said), None);
    }

    #[test]
    fn held_out_rows_are_told_apart_from_those_of_run() {
        let said = |judge, choose| held_out(Some(&of_roles([judge, choose], 50)));
        let both = said(0.06, 0.2);
        assert!(
            both.starts_with(
                "rows: 74 % for fitting, 20 % for the choice of causes, 6 % held out for the error.\n"
            ),
            "{both}"
        );
        let one = said(0.0, 0.2);
        assert!(
            one.starts_with("rows: 80 % for fitting, 20 % for the choice of causes. The held-out"),
            "{one}"
        );
        for text in [both, one] {
            assert_eq!(text.lines().count(), 3, "{text}");
            assert!(
                text.contains("of 50 rows it is off by 10 % by chance"),
                "{text}"
            );
        }
    }
}
