//! Which coefficients are taken: the best ones by themselves, or the best ones in their datapath.
//!
//! Where rounding is a small part of the error, the coefficients decide, and the datapath's rounding is mere
//! chance: then the best coefficients under ideal evaluation are taken, whose error is proved and holds in any
//! datapath. Where rounding is a large part, the whole evaluation decides.

/// Rounding up to this part of the whole error is negligible.
pub const NEGLIGIBLE: f64 = 0.01;
/// Rounding up to this part of the whole error is small.
pub const SMALL: f64 = 0.1;
/// Why coefficients were taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Rounding is a negligible part of the error: the best under ideal evaluation.
    RoundingNegligible,
    /// Rounding is a small part, and the best under ideal evaluation are ahead of what rounding and the
    /// lattice heuristic give in the same datapath, or nothing is ahead of them.
    RoundingSmall,
    /// The least error of the whole evaluation.
    LeastTotal,
}

/// Errors of one choice: under ideal evaluation over the real domain, and of the whole evaluation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// Under ideal evaluation.
    pub ideal: f64,
    /// Of the whole evaluation; infinite if the datapath cannot take them.
    pub total: f64,
}

/// Which is taken: the best under ideal evaluation (`None`) or one of `near`, those with nearly the least whole
/// error. `rounding` is what evaluation and output may round, `baselines` the choices to be ahead of.
pub fn select(
    ideal: Errors,
    rounding: f64,
    baselines: &[Errors],
    near: &[Errors],
) -> (Option<usize>, Reason) {
    let least = near.iter().map(|e| e.total).fold(ideal.total, f64::min);
    let to_beat = baselines
        .iter()
        .map(|e| e.total)
        .fold(f64::INFINITY, f64::min);
    if ideal.total.is_finite() && rounding <= NEGLIGIBLE * ideal.total {
        return (None, Reason::RoundingNegligible);
    }
    let ahead = ideal.total < to_beat || ideal.total <= least;
    if ideal.total.is_finite() && rounding <= SMALL * ideal.total && ahead {
        return (None, Reason::RoundingSmall);
    }
    // Nearly as good is not good enough: another choice of coefficients may be between the two.
    let good = |e: &Errors| e.total <= least;
    let best = (0..near.len())
        .filter(|k| near.get(*k).is_some_and(good))
        .min_by(|a, b| {
            let (a, b) = (near[*a], near[*b]);
            a.ideal
                .total_cmp(&b.ideal)
                .then(a.total.total_cmp(&b.total))
        });
    let own = good(&ideal) && best.is_none_or(|k| ideal.ideal <= near[k].ideal);
    (best.filter(|_| !own), Reason::LeastTotal)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn e(ideal: f64, total: f64) -> Errors {
        Errors { ideal, total }
    }

    #[test]
    fn where_rounding_is_negligible_the_best_coefficients_are_taken() {
        let near = [e(1.3, 1.0)];
        let taken = select(e(1.0, 1.01), 0.01, &[e(1.1, 1.0)], &near);
        assert_eq!(taken, (None, Reason::RoundingNegligible));
    }

    #[test]
    fn where_rounding_is_small_they_must_be_ahead_of_the_baselines() {
        let near = [e(1.3, 1.0)];
        let ahead = select(e(1.0, 1.05), 0.1, &[e(1.1, 1.06)], &near);
        assert_eq!(ahead, (None, Reason::RoundingSmall));
        let behind = select(e(1.0, 1.05), 0.1, &[e(1.1, 1.05)], &near);
        assert_eq!(behind, (Some(0), Reason::LeastTotal));
        // Behind nothing: a tie with the least.
        let tie = select(e(1.0, 1.0), 0.1, &[e(1.0, 1.0)], &near);
        assert_eq!(tie, (None, Reason::RoundingSmall));
    }

    #[test]
    fn else_the_least_total_error_and_among_equals_the_least_ideal_one() {
        let near = [e(1.3, 2.0), e(1.2, 2.0), e(1.1, 2.009)];
        let taken = select(e(1.0, 2.2), 1.0, &[e(1.1, 2.1)], &near);
        assert_eq!(taken, (Some(1), Reason::LeastTotal));
        // The best coefficients themselves have the least.
        let taken = select(e(1.0, 2.0), 1.0, &[e(1.2, 2.1)], &near);
        assert_eq!(taken, (None, Reason::LeastTotal));
        // They are only near it.
        let taken = select(e(1.0, 2.005), 1.0, &[e(1.2, 2.1)], &near);
        assert_eq!(taken, (Some(1), Reason::LeastTotal));
        // Coefficients that the datapath cannot take are not taken.
        let taken = select(e(1.0, f64::INFINITY), 0.001, &[], &near);
        assert_eq!(taken, (Some(1), Reason::LeastTotal));
    }
}
