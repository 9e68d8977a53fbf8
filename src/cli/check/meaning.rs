//! What is said beside the tables of a check: whose the coefficients are, what the entries mean, what did not happen.

use crate::check::outcome::{Check, NodeCheck, Overflows};
use crate::design::Design;

/// Whose the coefficients are where the design does not state them; `named`: a design file was given.
pub(super) fn foreign(design: &Design, named: bool) -> Option<String> {
    if !named {
        return Some(
            "no design file was given: this is the check of the embedded default, with the coefficients published for its simulated gyro"
                .to_owned(),
        );
    }
    let said = crate::cli::emit::unfitted(design).filter(|_| !design.compensation_is_own)?;
    Some(format!("{said} to check"))
}

/// What the entries of the column of overflows say, of those that it has.
pub(super) fn entries(nodes: &[NodeCheck]) -> Vec<&'static str> {
    let has = |is: fn(&NodeCheck) -> bool| nodes.iter().any(is);
    let certain = |n: &NodeCheck| n.overflow == Overflows::Certain && n.follows_from.is_none();
    let all = [
        (
            has(|n| n.overflow == Overflows::Possible),
            "possible: the word is not proved to hold every value; no overflow was seen. In brackets: what the word does then.",
        ),
        (
            has(certain),
            "CERTAIN: samples of the design's own gyro overflowed the word, or every value does. In brackets: what the word does then.",
        ),
        (
            has(|n| n.follows_from.is_some()),
            "follows from: samples overflowed the word, and only because the word named there overflowed before it.",
        ),
    ];
    let told = all.into_iter().filter(|(is, _)| *is);
    told.map(|(_, meaning)| meaning).collect()
}

/// That the overflows which are possible did not happen; those that did are told first of all.
pub(super) fn unseen(check: &Check) -> String {
    let n = check.samples;
    match check.nodes.iter().any(|n| n.witness.is_some()) {
        true => format!(
            "None of the overflows that are only possible happened in the {n} samples of the design's own gyro. Those at the head of this \
             output did happen, and the check fails for them."
        ),
        false => format!(
            "None of these overflows happened in the {n} samples of the design's own gyro. The check fails only where one did, or where \
             it is certain."
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::checked;
    use super::*;
    use crate::design::{reader, template};

    #[test]
    fn overflows_that_happened_are_told_apart_from_those_that_did_not() {
        let clean = checked(&[]);
        assert!(unseen(&clean).starts_with("None of these overflows happened in the 20000 "));
        let [possible] = entries(&clean.nodes)[..] else {
            panic!("{:?}", entries(&clean.nodes));
        };
        assert!(possible.starts_with("possible: "), "{possible}");
        let narrow = checked(&[("format = \"Q12.12\"", "format = \"Q7.12\"")]);
        let said = unseen(&narrow);
        assert!(
            said.starts_with("None of the overflows that are only possible happened "),
            "{said}"
        );
        assert!(
            entries(&narrow.nodes)
                .iter()
                .any(|m| m.starts_with("CERTAIN: "))
        );
        let reason = &narrow.reasons[0];
        assert!(
            reason.contains(" from Q7.12 to Q9.12 (for the samples that were run; ")
                && reason.contains(" for all inputs it takes at least Q1"),
            "{reason}"
        );
    }

    #[test]
    fn a_check_without_a_file_is_said_to_be_of_the_default() {
        let of = |text: &str, named| foreign(&reader::parse(text, None).unwrap(), named);
        assert!(
            of("", false)
                .unwrap()
                .contains("the embedded default, with")
        );
        let cut = of("", true).unwrap();
        assert!(cut.ends_with("writes a design.toml to check"), "{cut}");
        let own = template::DEFAULT.replace("[114923930, ", "[114923931, ");
        assert_eq!(of(&own, true), None);
    }
}
