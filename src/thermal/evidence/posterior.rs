//! The answer: which names the record supports, what could replace them, and what is left.

use super::beam::{Seen, around, scan, search};
use super::columns::{Frame, Member, noises, odds, white};
use super::score::{Node, Parts, at_noise, node, odds as odds_of, parts, stage};
use super::{MOST_TERMS, NAMED_ODDS};
use crate::statistics::Unusable;
use crate::statistics::linear::{Basis, add_scaled, dot};
use crate::statistics::tail::chi_square_surprise;
use crate::thermal::channels::Channels;
use crate::thermal::search::judge::Judged;
use crate::thermal::search::reading::errors_of;
use crate::thermal::search::{Found, MOST_RIVALS, Model, Search, Term, declared, weighted};
use std::sync::OnceLock;

/// Lags of the innovations' autocorrelation that are tested together (convention: Ljung & Box 1978 use 10 to 20).
const LAGS: usize = 10;

/// Surprise (minus ln p) of that test from which on the innovations are not white (p of 1e-3, convention).
const NOT_WHITE: f64 = 6.9;

/// Share of an effect's square that a nonparametric term may leave where it has the effect's law in it (convention: devices follow
/// the catalogue to some per cent, which is less than a hundredth of the square).
const WITHIN: f64 = 0.01;

/// Stretches of the fitted rows that are left out to see whether a term predicts, and folds that they are dealt to in turn (convention:
/// five-fold cross-validation; four stretches a fold, so that an event's neighbours stay in).
const STRETCHES: usize = 20;
const FOLDS: usize = 5;

/// Times that rows which stand out are determined anew from the best set.
const PASSES: usize = 2;

/// What all sets of a search have in common, with the rows of a model's fit.
fn frame<'a>(search: &'a Search<'a>, seen: &'a Channels, model: &Model) -> Frame<'a> {
    let c = seen;
    let mut base = declared(c);
    let order = base.len();
    base.extend(errors_of(c));
    let fit = model.fit.clone();
    let (noises, neighbours) = noises(&fit.problem.line);
    let mut out = Frame {
        channels: c,
        candidates: search.candidates(),
        base,
        declared: order,
        fit,
        plain_noise: white(&noises),
        noise_odds: odds(&noises),
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
    let beta = weighted(columns, &c.error_dps, weights);
    let (mut sum, mut count) = (0.0, 0.0);
    for (row, w) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
        let fitted: f64 = columns.iter().zip(&beta).map(|(c, b)| c[row] * b).sum();
        sum += w * (c.error_dps[row] - fitted).powi(2);
        count += w;
    }
    (sum / count.max(1.0)).max(f64::MIN_POSITIVE)
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
    let seen = search_of.channels.seen(&search_of.train);
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
        let Some(start) = node(&frame, evident.clone(), &model.bias, frame.plain_noise) else {
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
    if let Some(start) = node(&frame, evident, &best.bias, frame.plain_noise) {
        found.first = scan(&frame, &start, start.noise)
            .iter()
            .map(judged)
            .collect();
    }
    Ok(found)
}

/// A term as it is alone beside the declared model.
fn judged(seen: &Seen) -> Judged {
    let net = seen.gain;
    let columns = seen.member.fixed.as_ref().map_or(1, |f| f.len());
    Judged {
        candidate: seen.member.candidate.clone(),
        point: seen.member.point.clone(),
        gain: seen.gain - seen.member.occam - odds_of(seen.member.candidate.as_ref(), columns),
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
    let walks = needs_walk(frame, best);
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
        let replaced = |n: &Node| {
            let same = n.members.len() == best.members.len();
            n.members.last().filter(|_| same).cloned()
        };
        // The best set without the effect, and those with a nonparametric term in its place; one that has the effect's law in it is no set
        // without it.
        let apart = |m: &Member| !m.candidate.named() && !has_in_it(frame, best, k, m);
        let greatest = |keep: &dyn Fn(Option<Member>) -> bool| {
            let these = others.iter().filter(|n| keep(replaced(n)));
            these.map(|n| n.score).fold(f64::NEG_INFINITY, f64::max)
        };
        let odds = best.score - greatest(&|m| m.is_none());
        let beyond_nameless = best.score - greatest(&|m| m.is_some_and(|m| apart(&m)));
        let rivals = others.iter().filter(|n| n.score > best.score - close);
        let rivals = rivals.filter_map(replaced).filter(|m| m.candidate.named());
        let rivals: Vec<String> = rivals.map(|m| m.candidate.id()).collect();
        told.p_value = improbable(odds);
        told.gain = odds;
        let vetoed = walks && !predicts(frame, best, k);
        if odds < close || vetoed || rivals.len() > MOST_RIVALS {
            found.left = found.left.or_else(|| search.channel(&told));
            if rivals.len() > MOST_RIVALS {
                found.undecided.push(id);
                found.undecided.extend(rivals);
            }
            continue;
        }
        if beyond_nameless < close {
            found.left = found.left.or_else(|| search.channel(&told));
        }
        told.rivals = rivals;
        found.terms.push(told);
    }
    found.terms.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found.terms.truncate(MOST_TERMS);
    if let Some(stranger) = found.strangers.first() {
        found.left = search.channel(stranger);
    }
    if found.left.is_none() && (walks || is_coloured(frame, best)) {
        found.left = Some("time_s".to_owned());
    }
    for candidate in frame.candidates {
        if let Err(why) = candidate.channels(frame.channels) {
            found.missing.push((candidate.clone(), why));
        }
    }
    found
}

/// Whether a further term spans what member `k` of a set adds, up to [`WITHIN`]: beside base and the other members.
fn has_in_it(frame: &Frame, set: &Node, k: usize, other: &Member) -> bool {
    let columns = |m: &Member| -> Vec<Vec<f64>> {
        let all = frame.of(m.candidate.as_ref(), &set.bias, &m.point);
        all.iter().map(|c| frame.reduced(c)).collect()
    };
    let mut beside = frame.plain_basis.clone();
    for (j, m) in set.members.iter().enumerate() {
        if j != k && !m.candidate.is_last() {
            for c in &columns(m) {
                beside.push(c);
            }
        }
    }
    let mut with = beside.clone();
    for c in &columns(other) {
        with.push(c);
    }
    let square = |basis: &Basis, column: &[f64]| {
        let mut off = column.to_vec();
        basis.project_off(&mut off);
        dot(&off, &off)
    };
    columns(&set.members[k])
        .iter()
        .all(|c| square(&with, c) <= WITHIN * square(&beside, c))
}

/// Whether member `k` of a set lowers the error of rows that its coefficients are not fitted to: stretches of the fitted rows are left
/// out in turn ([`FOLDS`], [`STRETCHES`]), by ordinary least squares, for the noise may be what nobody recorded, and is no noise then.
fn predicts(frame: &Frame, set: &Node, k: usize) -> bool {
    let rows: Vec<usize> = (0..frame.line().len())
        .filter(|row| frame.line().white_factor[*row].is_finite())
        .collect();
    let error = |without: Option<usize>| -> f64 {
        let mut members = set.members.clone();
        if let Some(k) = without {
            members.remove(k);
        }
        let Parts { free, error, .. } = parts(frame, &members, &set.bias);
        let columns: Vec<&Vec<f64>> = frame.plain_base.iter().chain(&free).collect();
        let fold = |place: usize| place * STRETCHES / rows.len() % FOLDS;
        let off = |out: usize| -> f64 {
            let kept = |place: &usize| f64::from(u8::from(fold(*place) != out));
            let fitted: Vec<f64> = (0..rows.len()).map(|p| kept(&p)).collect();
            let of = |c: &[f64]| -> Vec<f64> { rows.iter().map(|r| c[*r]).collect() };
            let columns: Vec<Vec<f64>> = columns.iter().map(|c| of(c)).collect();
            let mut rest = of(&error);
            let beta = weighted(&columns, &rest, &fitted);
            for (b, c) in beta.iter().zip(&columns) {
                add_scaled(&mut rest, -b, c);
            }
            let left = rest.iter().zip(&fitted).filter(|(_, f)| **f == 0.0);
            left.map(|(r, _)| r * r).sum()
        };
        (0..FOLDS).map(off).sum()
    };
    error(None) < error(Some(k))
}

/// Whether the noise needs more than white and 1/f by the odds of a name.
fn needs_walk(frame: &Frame, best: &Node) -> bool {
    let l = |walks: bool| {
        let shapes = frame.noises.iter().enumerate();
        let these = shapes.filter(|(_, n)| n.walks() == walks);
        these
            .filter_map(|(k, _)| {
                let l = at_noise(frame, &best.members, &best.bias, k)?.0;
                Some(l + frame.noise_odds[k])
            })
            .fold(f64::NEG_INFINITY, f64::max)
    };
    l(true) > l(false) + NAMED_ODDS.ln()
}

/// Whether the innovations are not white.
fn is_coloured(frame: &Frame, best: &Node) -> bool {
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
