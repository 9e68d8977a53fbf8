//! What is said of designs whose error after a start from power-on may be too large.

use crate::text::{at_most, number};

/// A start from power-on after which the error may be too large.
#[derive(Debug, Clone, Copy)]
pub(super) struct Late {
    /// The largest error that the interval does not exclude, deg/s.
    pub(super) start_dps: f64,
    /// The limit of the bias, deg/s.
    pub(super) limit_dps: f64,
}

/// That `what` has such starts, what is allowed, and what to do; `None` without any.
pub(super) fn late_starts(what: &str, late: &[Late]) -> Option<String> {
    let starts = || late.iter().map(|l| l.start_dps);
    let limit = number(late.first()?.limit_dps, 3);
    let most = at_most(starts().fold(0.0, f64::max), 3);
    let least = number(starts().fold(f64::INFINITY, f64::min), 3);
    let range = match late {
        [_] => most.clone(),
        _ => format!("{least} to {most}"),
    };
    Some(format!(
        "{what}: the error after power-on may be as large as {range} deg/s. The limit of the bias, {limit} deg/s, is also the limit of this \
         error. For a point with a merit above 1 the limit is multiplied by the merit. This note matters only where no design is chosen for a \
         target. Then a wider limit of the bias helps, in `--for` or `[requirements]`: all errors that this note names are, as measured \
         here, within `bias_dps<={most}`"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_starts_are_told_with_the_limit_that_allows_all_of_them() {
        let late = |start_dps| Late {
            start_dps,
            limit_dps: 1e-4,
        };
        assert_eq!(late_starts("none", &[]), None);
        let said = late_starts("2 points dropped", &[late(2.341e-4), late(1.4501e-3)]).unwrap();
        for part in [
            "as large as 0.000234 to 0.00146 deg/s. The limit of the bias, 0.000100 deg/s, is also the limit of this error. ",
            "only where no design is chosen for a target. ",
            "`bias_dps<=0.00146`",
        ] {
            assert!(said.contains(part), "{said}");
        }
        let own = late_starts("the given design", &[late(2e-3)]).unwrap();
        assert!(own.starts_with("the given design: the error"), "{own}");
        assert!(own.contains("as large as 0.00200 deg/s. "), "{own}");
    }
}
