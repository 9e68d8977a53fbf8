//! How the columns of a model enter it, clips last.

use crate::thermal::channels::Channels;
use crate::thermal::effects::Bias;

/// How a column enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// With a coefficient of its own.
    Free,
    /// As it is.
    Whole,
    /// As it is, after all others: where it is not 0, it alone says what the output is.
    Last,
}

/// Puts clips after all other columns: in rows that are clipped these vanish, and the clip's own
/// column is the whole error, limit less applied rate, instead of its distance from a total that
/// depends on the very coefficients that are sought; not so rows that are `spared` what the clip would add, deg/s.
/// 1 for each clipped row.
pub(super) fn clip(
    c: &Channels,
    bias: &Bias,
    (columns, kinds): (&mut [Vec<f64>], &[Kind]),
    spared: impl Fn(usize, f64) -> bool,
) -> Vec<f64> {
    let mut clipped = vec![0.0; c.len()];
    for k in 0..columns.len() {
        if kinds[k] != Kind::Last {
            continue;
        }
        for i in 0..c.len() {
            if columns[k][i] == 0.0 {
                continue;
            }
            if spared(i, columns[k][i]) {
                columns[k][i] = 0.0;
                continue;
            }
            let others = bias.others_dps.get(i).copied().unwrap_or(0.0);
            let whole = columns[k][i] + bias.at(c.u[i]) + others;
            for column in columns.iter_mut() {
                column[i] = 0.0;
            }
            columns[k][i] = whole;
            clipped[i] = 1.0;
        }
    }
    clipped
}
