//! The answer: which names the record supports, what could replace them, and what is left.

use super::beam::{Seen, around, scan, search};
use super::columns::{Frame, Member, noises};
use super::score::{Node, at_noise, node, stage};
use super::{MOST_TERMS, NAMED_ODDS, PRIOR_ODDS};
use crate::statistics::Unusable;
use crate::statistics::linear::Basis;
use crate::statistics::tail::chi_square_surprise;
use crate::thermal::channels::Channels;
use crate::thermal::search::judge::Judged;
use crate::thermal::search::reading::errors_of;
use crate::thermal::search::{Found, MOST_RIVALS, Model, Search, Term, declared};
use std::sync::OnceLock;

/// Lags of the innovations' autocorrelation that are tested together (convention: Ljung & Box 1978 use 10 to 20).
const LAGS: usize = 10;

/// Surprise (minus ln p) of that test from which on the innovations are not white (p of 1e-3, convention).
const NOT_WHITE: f64 = 6.9;

/// Times that rows which stand out are determined anew from the best set.
const PASSES: usize = 2;

/// What all sets of a search have in common, with the rows of a model's fit.
fn frame<'a>(search: &'a Search<'a>, seen: &Channels, model: &Model) -> Frame<'a> {
    let c = search.channels;
    let mut base = declared(c);
    let order = base.len();
    base.extend(errors_of(seen));
    let fit = model.fit.clone();
    let (noises, neighbours) = noises(&fit.problem.line);
    let mut out = Frame {
        channels: c,
        candidates: search.candidates(),
        base,
        declared: order,
        fit,
        noises,
        neighbours,
        declared_square: 1.0,
        shapes: Vec::new(),
        white: Vec::new(),
        whitened: Vec::new(),
        plain_base: Vec::new(),
        plain_error: Vec::new(),
        plain_basis: Basis::default(),
    };
    out.plain_base = out.base.iter().map(|c| out.reduced(c)).collect();
    out.plain_error = out.reduced(&c.error_dps);
    out.plain_basis = Basis::new(&out.plain_base);
    out.shapes = out.shapes_of();
    out.whitened = out.noises.iter().map(|_| OnceLock::new()).collect();
    out.white = out.noises.iter().map(|_| OnceLock::new()).collect();
    out.declared_square = declared_square(&out);
    out
}

/// Mean square that the declared model leaves of the fitted rows, (deg/s)^2.
fn declared_square(frame: &Frame) -> f64 {
    let c = frame.channels;
    let weights = &frame.fit.row_weights;
    let columns = &frame.base[..frame.declared];
    let beta = crate::thermal::search::weighted(columns, &c.error_dps, weights);
    let (mut sum, mut count) = (0.0, 0.0);
    for (row, w) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
        let fitted: f64 = columns.iter().zip(&beta).map(|(c, b)| c[row] * b).sum();
        sum += w * (c.error_dps[row] - fitted).powi(2);
        count += w;
    }
    (sum / count.max(1.0)).max(f64::MIN_POSITIVE)
}

/// The record as the fitted rows have it: whatever is made of errors must not see the others.
fn without_judges(search: &Search) -> Channels {
    let mut out = search.channels.clone();
    let rows = out.error_dps.iter_mut().zip(&search.train);
    rows.filter(|(_, train)| !**train)
        .for_each(|(e, _)| *e = f64::NAN);
    out
}

/// A member as the term of a model.
fn term(member: &Member, rails_p: Option<f64>) -> Term {
    let mut out = Term::new(member.candidate.clone(), member.point.clone());
    out.evident = member.evident;
    if member.evident {
        out.p_value = rails_p.unwrap_or(0.0);
    }
    out
}

/// The answer to a record.
///
/// # Errors
/// Too few rows.
pub fn answer(search_of: &Search) -> Result<Found, Unusable> {
    let seen = without_judges(search_of);
    let mut model = search_of.beginning()?;
    let evident: Vec<Member> = model
        .terms
        .iter()
        .map(|t| Member {
            candidate: t.candidate.clone(),
            point: t.point.clone(),
            occam: 0.0,
            evident: true,
            fixed: None,
        })
        .collect();
    let mut last: Option<(Frame, Node)> = None;
    for _ in 0..PASSES {
        let frame = frame(search_of, &seen, &model);
        let Some(start) = node(&frame, evident.clone(), &model.bias, 0) else {
            break;
        };
        let best = search(&frame, &start);
        let terms: Vec<Term> = best.members.iter().map(|m| term(m, None)).collect();
        let before = spikes(&frame.fit.row_weights);
        model = search_of.model(&terms)?;
        let same = spikes(&model.fit.row_weights) == before;
        last = Some((frame, best));
        if same {
            break;
        }
    }
    let Some((frame, best)) = last else {
        return Ok(Found::default());
    };
    let mut found = told(search_of, &frame, &best);
    if let Some(start) = node(&frame, evident, &best.bias, 0) {
        found.first = scan(&frame, &start, start.noise)
            .iter()
            .map(judged)
            .collect();
    }
    Ok(found)
}

/// A term as it is alone beside the declared model.
fn judged(seen: &Seen) -> Judged {
    let net = seen.gain + PRIOR_ODDS.ln();
    Judged {
        candidate: seen.member.candidate.clone(),
        point: seen.member.point.clone(),
        gain: seen.gain - seen.member.occam,
        net,
        odds_against: 0.0,
        p_value: improbable(net),
    }
}

/// Posterior probability that a term is not there, from the logarithm of its odds.
fn improbable(log_odds: f64) -> f64 {
    1.0 / (1.0 + log_odds.min(600.0).exp())
}

/// Which rows have lost their weight.
fn spikes(weights: &[f64]) -> Vec<bool> {
    weights.iter().map(|w| *w < 0.5).collect()
}

/// Names with their odds and rivals, and what is left.
fn told(search: &Search, frame: &Frame, best: &Node) -> Found {
    let mut found = Found::default();
    let close = NAMED_ODDS.ln();
    let rails_p = search.rails.as_ref().map(|r| r.p_value);
    for (k, member) in best.members.iter().enumerate() {
        let id = member.candidate.id();
        let mut told = term(member, rails_p);
        if member.evident {
            found.terms.push(told);
            continue;
        }
        if !member.candidate.named() {
            // A line without a name is noise.
            if !member.is_line() {
                found.strangers.push(told);
            }
            continue;
        }
        let others = around(frame, best, k);
        let kept: Vec<String> = best.ids();
        let replaced = |n: &Node| {
            n.members
                .iter()
                .find(|m| !kept.contains(&m.candidate.id()))
                .cloned()
        };
        // The best set without the effect and without a name in its place. A smooth function, a product or the past of the effect's own
        // channel has the effect's law in it, and is no set without it.
        let own = member.candidate.channels_at(frame.channels, &member.point);
        let is_apart = |m: &Member| {
            let channels = m.candidate.channels_at(frame.channels, &m.point);
            !m.candidate.named() && !channels.iter().any(|c| own.contains(c))
        };
        let nameless = others
            .iter()
            .filter(|n| replaced(n).is_none_or(|m| is_apart(&m)));
        let without = nameless.map(|n| n.score).fold(f64::NEG_INFINITY, f64::max);
        let odds = best.score - without;
        let rivals = others.iter().filter(|n| n.score > best.score - close);
        let rivals = rivals.filter_map(replaced).filter(|m| m.candidate.named());
        let rivals: Vec<String> = rivals.map(|m| m.candidate.id()).collect();
        told.p_value = improbable(odds);
        told.gain = odds;
        if odds < close || rivals.len() > MOST_RIVALS {
            found.left = found.left.or_else(|| search.channel(&told));
            if rivals.len() > MOST_RIVALS {
                found.undecided.push(id);
                found.undecided.extend(rivals);
            }
            continue;
        }
        told.rivals = rivals;
        found.terms.push(told);
    }
    found.terms.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found.terms.truncate(MOST_TERMS);
    if let Some(stranger) = found.strangers.first() {
        found.left = search.channel(stranger);
    }
    if found.left.is_none() && is_left(frame, best) {
        found.left = Some("time_s".to_owned());
    }
    for candidate in frame.candidates {
        if let Err(why) = candidate.channels(frame.channels) {
            found.missing.push((candidate.clone(), why));
        }
    }
    found
}

/// Whether the noise needs more than white and 1/f by the odds of a name, or the innovations are not white.
fn is_left(frame: &Frame, best: &Node) -> bool {
    let l = |walks: bool| {
        let shapes = frame.noises.iter().enumerate();
        let these = shapes.filter(|(_, s)| (s.walk > 0.0) == walks);
        these
            .filter_map(|(k, _)| at_noise(frame, &best.members, &best.bias, k))
            .map(|l| l.0)
            .fold(f64::NEG_INFINITY, f64::max)
    };
    if l(true) > l(false) + NAMED_ODDS.ln() {
        return true;
    }
    let Some(stage) = stage(frame, &best.members, &best.bias, best.noise) else {
        return false;
    };
    let rows: Vec<f64> = stage
        .rest
        .iter()
        .zip(&frame.whitened(best.noise).whitener.inverse_std)
        .filter(|(_, inverse)| **inverse > 0.0)
        .map(|(r, _)| *r)
        .collect();
    let n = rows.len() as f64;
    let square: f64 = rows.iter().map(|r| r * r).sum();
    let q: f64 = (1..=LAGS.min(rows.len() / 4))
        .map(|lag| {
            let r: f64 = rows
                .iter()
                .zip(&rows[lag..])
                .map(|(a, b)| a * b)
                .sum::<f64>()
                / square;
            n * (n + 2.0) * r * r / (n - lag as f64)
        })
        .sum();
    chi_square_surprise(LAGS, q) > NOT_WHITE
}
