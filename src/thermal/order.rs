//! The polynomial's order: as asked for, or the lowest whose held-out error is within one standard error of the least.

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
            format!("order {best_order} has the least held-out error, {best_rms:.4} deg/s rms"),
        ),
        FitOrder::Auto | FitOrder::ByRecord => (
            smallest,
            format!(
                "order {smallest}, the lowest whose held-out error is at most {limit:.4} deg/s rms: that is one standard error \
                 above the least, {best_rms:.4} by order {best_order}"
            ),
        ),
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
            false => format!(
                ". Order {best_order} has the least, {best_rms:.4} deg/s; order {smallest} is the lowest within one standard \
                 error of it"
            ),
        };
        reason.push_str(&format!(
            ": held-out rms {given:.4} deg/s. Chosen by held-out error it would be order {smallest}: {by_rule:.4} deg/s{why}"
        ));
    }
    let heldout = chosen.map_or_else(HeldOut::nothing, |(_, h)| h.clone());
    Choice {
        order,
        trials: results.into_iter().map(|(t, _)| t).collect(),
        heldout,
        reason,
    }
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
