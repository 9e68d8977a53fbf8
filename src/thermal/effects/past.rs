//! Effects of heat's history in firmware, which has no readings to come: lags and differences that come nearest.

use crate::correction::Term;
use crate::statistics::linear::{Basis, add_scaled, dot};
use crate::thermal::channels::Channels;
use crate::thermal::firmware::{Trial, Words};

/// Time constants, in periods of the firmware, of a second lag beside a lag.
const SHORTER: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

/// A term of the firmware, of a share of the gain, a time constant, s, and whether its state outlives a restart.
pub(super) type LagTerm<'a> = dyn Fn(f64, f64, bool) -> Term + 'a;

/// The lags, all of one of the given kinds, that come nearest to the wanted part of the output, deg/s.
///
/// The difference of a noisy reading and its lag has the reading's noise; less the one to a short lag it has that of a
/// smoothed reading. The short lag also delays every step of the temperature, so it is taken only where the one lag
/// leaves more than the record's noise hides. And where the power was off for less than the lag, the gyro has kept its own state.
pub(super) fn past_lags(
    c: &Channels,
    f: &Words,
    trial: &Trial,
    tau_s: f64,
    wanted: &[f64],
    kinds: &[&LagTerm<'_>],
) -> Option<Vec<Term>> {
    let most_dps = wanted.iter().fold(1e-3, |m: f64, v| m.max(4.0 * v.abs()));
    let kept = [false, true]
        .into_iter()
        .take(1 + usize::from(c.restarts()));
    let each = kinds
        .iter()
        .flat_map(|term| kept.clone().map(move |kept| (term, kept)));
    let taken = |term: &&LagTerm<'_>, tau_s: f64, kept: bool| {
        trial.taken_off(&[term(1.0, tau_s, kept)], most_dps)
    };
    let mut best: Option<(f64, Vec<Term>)> = None;
    let mut single = Vec::new();
    for (term, kept) in each {
        let long = taken(term, tau_s, kept)?;
        let mut left = wanted.to_vec();
        add_scaled(&mut left, -1.0, &long);
        let off = dot(&left, &left);
        if best.as_ref().is_none_or(|b| off < b.0) {
            best = Some((off, vec![term(1.0, tau_s, kept)]));
        }
        single.push((term, kept, long));
    }
    if best.as_ref().is_some_and(|b| f.is_near(b.0, c.len())) {
        return best.map(|b| b.1);
    }
    for (term, kept, long) in single {
        let shorter = SHORTER.iter().map(|periods| periods * f.period_s);
        for short_s in shorter.take_while(|short_s| *short_s < 0.5 * tau_s) {
            let basis = Basis::new(&[long.clone(), taken(term, short_s, kept)?]);
            let mut left = wanted.to_vec();
            let z = basis.project_off(&mut left);
            let off = dot(&left, &left);
            let better = |b: &(f64, Vec<Term>)| off < (1.0 - WORTH_A_TERM) * b.0;
            if let [of_long, of_short] = basis.solve(&z)[..]
                && best.as_ref().is_none_or(better)
            {
                let pair = [(of_long, tau_s), (of_short, short_s)];
                let pair = pair.map(|(share, tau_s)| term(share, tau_s, kept));
                best = Some((off, pair.to_vec()));
            }
        }
    }
    best.map(|b| b.1)
}

/// Rows that a difference of the firmware looks back.
const PAST: [u32; 9] = [1, 2, 3, 4, 5, 7, 9, 12, 16];

/// Share of the square that a further term of firmware has to take off for its words.
const WORTH_A_TERM: f64 = 0.05;

/// The slopes that firmware can take and that together come nearest to the wanted part of the output, deg/s.
///
/// Firmware has no readings to come, only differences to past ones: short ones are noisy, long ones late. Shares of
/// several that sum to one follow a steady rise exactly, and extrapolate (twice the difference over k readings
/// less that over 2 k is late in second order only) or average; least squares over the record chooses. What
/// each makes of the record is the block's own doing.
pub(super) fn past_slopes(
    c: &Channels,
    f: &Words,
    (input, trial): (usize, &Trial),
    gain_dps_s: f64,
    wanted: &[f64],
) -> Option<Vec<Term>> {
    let term = |share: f64, rows: u32| Term::Slope {
        gain_dps_s: share * gain_dps_s,
        input,
        rows,
    };
    let finer = (c.period_s() / f.period_s).round().max(1.0) as u32;
    // Until `MOST_SLOPE_ROWS`.
    let each = PAST.iter().map_while(|rows| {
        let rows = rows * finer;
        // As much as a jump of the thermometer over its range would make.
        let most_dps = 6.0 * gain_dps_s.abs() / (f64::from(rows) * f.period_s);
        let values = trial.taken_off(&[term(1.0, rows)], most_dps.max(1e-3))?;
        Some((rows, values))
    });
    let each: Vec<(u32, Vec<f64>)> = each.collect();
    let mut best: Option<(f64, Vec<(f64, u32)>)> = None;
    for count in 1..=3 {
        for chosen in subsets(each.len(), count) {
            let chosen: Vec<&(u32, Vec<f64>)> = chosen.iter().map(|k| &each[*k]).collect();
            let Some((off, shares)) = mixed(&chosen, wanted) else {
                continue;
            };
            let better = |b: &(f64, Vec<_>)| {
                let more = if b.1.len() < count { WORTH_A_TERM } else { 0.0 };
                off < (1.0 - more) * b.0
            };
            if best.as_ref().is_none_or(better) {
                let rows = chosen.iter().map(|c| c.0);
                best = Some((off, shares.into_iter().zip(rows).collect()));
            }
        }
    }
    let (_, parts) = best?;
    Some(parts.iter().map(|(share, k)| term(*share, *k)).collect())
}

/// All choices of `count` of the first numbers, each ascending.
fn subsets(of: usize, count: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    for _ in 0..count {
        let longer = |begun: &Vec<usize>| -> Vec<Vec<usize>> {
            let next = begun.last().map_or(0, |last| last + 1);
            (next..of)
                .map(|k| [begun.as_slice(), &[k]].concat())
                .collect()
        };
        all = all.iter().flat_map(longer).collect();
    }
    all
}

/// The shares, one in sum, with which columns come nearest to the wanted one, and the square that is left.
fn mixed(columns: &[&(u32, Vec<f64>)], wanted: &[f64]) -> Option<(f64, Vec<f64>)> {
    let (first, others) = columns.split_first()?;
    let against = |column: &[f64]| -> Vec<f64> {
        let pairs = column.iter().zip(&first.1);
        pairs.map(|(v, f)| v - f).collect()
    };
    let basis = Basis::new(&others.iter().map(|o| against(&o.1)).collect::<Vec<_>>());
    let mut left = against(wanted);
    let z = basis.project_off(&mut left);
    let mut shares = basis.solve(&z);
    shares.insert(0, 1.0 - shares.iter().sum::<f64>());
    (shares.len() == columns.len()).then(|| (dot(&left, &left), shares))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::effects::map;

    #[test]
    fn slopes_are_mixed_to_follow_what_rises_faster_and_faster() {
        // Of t^2, over one and over two periods, against 2 t.
        let t: Vec<f64> = (0..20).map(f64::from).collect();
        let over = |k: f64| map(&t, |t| 2.0 * t - k);
        let (one, two, three) = ((1, over(1.0)), (2, over(2.0)), (3, over(3.0)));
        let (off, shares) = mixed(&[&one, &two], &over(0.0)).unwrap();
        assert!(
            off < 1e-18 && (shares[0] - 2.0).abs() < 1e-9,
            "{off} {shares:?}"
        );
        let (_, shares) = mixed(&[&one, &three], &over(2.0)).unwrap();
        assert!((shares[0] - 0.5).abs() < 1e-9 && (shares[1] - 0.5).abs() < 1e-9);
        // One alone has no choice: a steady rise is followed exactly.
        assert_eq!(mixed(&[&two], &over(0.0)).unwrap(), (80.0, vec![1.0]));
        assert_eq!(subsets(9, 3).len(), 84);
        assert_eq!(subsets(3, 2), [[0, 1], [0, 2], [1, 2]]);
    }
}
