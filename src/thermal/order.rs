//! The polynomial's order: as asked for, or the smallest whose held-out error is within one standard error of the least.

use crate::design::FitOrder;
use crate::statistics::folds;
use crate::statistics::folds::{HeldOut, Sample};
use crate::statistics::stats;
use std::ops::Range;

/// The highest order that is tried by itself. On measured records more than a cubic already
/// predicts worse than it fits.
pub const HIGHEST_AUTO: usize = 5;

/// One order that was tried.
#[derive(Debug, Clone, PartialEq)]
pub struct OrderTrial {
    /// The order.
    pub order: usize,
    /// Residual of the fit to all rows, deg/s, unweighted.
    pub in_sample_rms_dps: f64,
    /// See [`HeldOut::rms_dps`].
    pub heldout_rms_dps: f64,
    /// The same without spikes: what orders are compared by.
    pub heldout_clean_rms_dps: f64,
    /// The standard error, over the blocks, of the mean square held-out error, as the largest
    /// root mean square that is still within it, deg/s.
    pub heldout_plus_one_se_dps: f64,
}

impl OrderTrial {
    /// Whether the held-out rms of all rows and that without outliers are different figures in print (four places).
    pub fn outliers_change_heldout(&self) -> bool {
        format!("{:.4}", self.heldout_rms_dps) != format!("{:.4}", self.heldout_clean_rms_dps)
    }
}

/// Which rows the figures of a reason are of, where outliers change them: the held-out rms that is printed beside it has all rows.
const WITHOUT_OUTLIERS: &str = ". Orders are compared without the rows that stand out";

/// The order, what was tried, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The order.
    pub order: usize,
    /// All that were tried, by order.
    pub trials: Vec<OrderTrial>,
    /// Held-out errors of the chosen one.
    pub heldout: HeldOut,
    /// Why, in a sentence.
    pub reason: String,
}

/// Chooses the order.
///
/// With `auto`: the smallest order whose mean square held-out error lies within one standard
/// error (over the blocks) of the least. `most` is the highest order that the record determines.
/// With a given order the others are tried too, for the table, up to [`HIGHEST_AUTO`].
pub fn choose(sample: &Sample, wanted: FitOrder, most: usize, blocks: &[Range<usize>]) -> Choice {
    let highest = match wanted {
        FitOrder::Auto | FitOrder::ByRecord => most.min(HIGHEST_AUTO),
        FitOrder::Fixed(order) => (order as usize).max(HIGHEST_AUTO).min(most),
    };
    let whole = sample.problem(highest, |_| true);
    let results: Vec<(OrderTrial, HeldOut)> = folds::cross_validate(sample, highest, blocks)
        .into_iter()
        .enumerate()
        .map(|(order, heldout)| {
            let trial = OrderTrial {
                order,
                in_sample_rms_dps: stats::rms(&sample.residuals(&whole.coefficients(order))),
                heldout_rms_dps: heldout.rms_dps,
                heldout_clean_rms_dps: heldout.clean_rms_dps,
                heldout_plus_one_se_dps: (mean(&heldout.block_mean_square)
                    + standard_error(&heldout.block_mean_square))
                .sqrt(),
            };
            (trial, heldout)
        })
        .collect();
    let best = results
        .iter()
        .map(|(t, _)| t)
        .fold(None::<&OrderTrial>, |best, t| match best {
            Some(b) if b.heldout_clean_rms_dps <= t.heldout_clean_rms_dps => Some(b),
            _ => Some(t),
        });
    let (best_order, best_rms, limit) = best.map_or((0, 0.0, 0.0), |b| {
        (b.order, b.heldout_clean_rms_dps, b.heldout_plus_one_se_dps)
    });
    let smallest = results
        .iter()
        .position(|(t, _)| t.heldout_clean_rms_dps <= limit)
        .unwrap_or(best_order);
    let (order, mut reason) = match wanted {
        FitOrder::Fixed(order) if order as usize <= most => {
            (order as usize, format!("order {order} as given"))
        }
        FitOrder::Fixed(order) => (
            most,
            format!("order {order} was asked for, but the record determines order {most} at most"),
        ),
        FitOrder::Auto | FitOrder::ByRecord if smallest == best_order => (
            best_order,
            format!("order {best_order} has the smallest held-out rms, {best_rms:.4} deg/s"),
        ),
        FitOrder::Auto | FitOrder::ByRecord => (smallest, {
            let own = results.get(smallest);
            let own = own.map_or(best_rms, |r| r.0.heldout_clean_rms_dps);
            format!(
                "order {smallest}, held-out rms {own:.4} deg/s{}",
                why_smallest(smallest, (best_order, best_rms), limit)
            )
        }),
    };
    let chosen = results.get(order).or(results.last());
    if matches!(wanted, FitOrder::Fixed(_))
        && let Some((t, _)) = chosen
        && (t.heldout_clean_rms_dps > limit || order > best_order)
        && order != smallest
    {
        let by_rule = results
            .get(smallest)
            .map_or(best_rms, |r| r.0.heldout_clean_rms_dps);
        let given = t.heldout_clean_rms_dps;
        let why = match smallest == best_order {
            true => String::new(),
            false => why_smallest(smallest, (best_order, best_rms), limit),
        };
        reason.push_str(&format!(
            ": held-out rms {given:.4} deg/s. By held-out error it would be order {smallest}, held-out rms {by_rule:.4} deg/s{why}"
        ));
    }
    if reason.contains("held-out rms") && chosen.is_some_and(|(t, _)| t.outliers_change_heldout()) {
        reason.push_str(WITHOUT_OUTLIERS);
    }
    let heldout = chosen.map_or_else(HeldOut::nothing, |(_, h)| h.clone());
    Choice {
        order,
        trials: results.into_iter().map(|(t, _)| t).collect(),
        heldout,
        reason,
    }
}

/// Why `order` is taken although another, `best`, has the smallest held-out rms, deg/s: its own is within `limit`, deg/s.
fn why_smallest(order: usize, best: (usize, f64), limit: f64) -> String {
    let (best_order, best_rms) = best;
    format!(
        ". Order {best_order} has the smallest held-out rms, {best_rms:.4} deg/s. Order {order} is the smallest order that exceeds \
         it by at most one standard error (up to {limit:.4} deg/s)"
    )
}

fn mean(v: &[f64]) -> f64 {
    v.iter().sum::<f64>() / v.len().max(1) as f64
}

/// Of the mean of `v`.
fn standard_error(v: &[f64]) -> f64 {
    if v.len() < 2 {
        return 0.0;
    }
    let m = mean(v);
    let variance = v.iter().map(|x| (x - m).powi(2)).sum::<f64>() / (v.len() - 1) as f64;
    (variance / v.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::RecordMapping;
    use crate::thermal::fit;
    use crate::thermal::synthetic::{Random, options, record, triangle};

    /// Which order is the smallest, and which has the smallest error, cannot be mistaken for each other.
    #[test]
    fn the_order_and_the_error_are_told_apart() {
        assert_eq!(
            why_smallest(3, (5, 1.7723), 2.05),
            ". Order 5 has the smallest held-out rms, 1.7723 deg/s. Order 3 is the smallest order that exceeds it by at most one \
             standard error (up to 2.0500 deg/s)"
        );
    }

    /// A spike makes the figure of all rows another one than that by which orders are compared, and the reason says so; without one
    /// there is nothing to say.
    #[test]
    fn the_reason_says_that_outliers_are_not_in_its_figures() {
        let reason = |spike_dps: f64| {
            let degc = triangle(120);
            let mut random = Random::new(3);
            let mut rates: Vec<f64> = degc
                .iter()
                .map(|t| 0.02 * t + 0.01 * random.normal().clamp(-1.5, 1.5))
                .collect();
            rates[50] += spike_dps;
            let record = record("die_degc", &degc, &rates);
            let fit =
                fit(&record, &RecordMapping::default(), &options(FitOrder::Auto)).expect("a fit");
            let changed = fit.orders_tried[fit.order].outliers_change_heldout();
            (fit.reason, changed)
        };
        let (with, changed) = reason(2.0);
        assert!(with.ends_with(WITHOUT_OUTLIERS) && changed, "{with}");
        let (without, changed) = reason(0.0);
        assert!(!without.contains("stand out") && !changed, "{without}");
    }
}
