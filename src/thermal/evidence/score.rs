//! The evidence of a set of terms: its likelihood with coefficients and strength of the noise integrated out.
//!
//! Whitened by the noise's Kalman filter, with nu = rows - rank(B) and p the rank of Z beyond B,
//!
//! L = ln Gamma((nu - p) / 2) - (nu - p) / 2 ln(RSS / 2) - 1/2 [ln|Z'V^-1Z| - ln|Z'Z|] - p / 2 ln(rows s0^2) - 1/2 ln|V| - 1/2 ln|B'V^-1B|,
//!
//! the Gram determinants of Z taken beyond B (O'Hagan & Forster 2004, ch. 11; Zellner 1986 for the prior along the
//! orthonormal columns). It is Laplace's approximation in the prior of c, which is wide against its posterior.

use super::columns::{Frame, Member};
use super::{NAMELESS, PRIOR_ODDS};
use crate::statistics::linear::{Basis, add_scaled, dot};
use crate::thermal::effects::{Bias, Candidate, Point};
use crate::thermal::search::weighted;

/// Passes in which the bias that some terms act on follows the terms (measured: three change it no further than its deviation).
const PASSES: usize = 3;

/// Share of a column's square, beyond all others, below which it is none: what is left is the rounding of the declared model.
const DEPENDENT: f64 = 1e-6;

/// A set, evaluated at one noise.
#[derive(Clone)]
pub struct Node {
    pub members: Vec<Member>,
    /// Index into the frame's noises.
    pub noise: usize,
    /// L at that noise.
    pub likelihood: f64,
    /// L with the prior odds of the noise and of the terms, and Occam factors: what sets are compared by.
    pub score: f64,
    /// The declared bias beside the terms.
    pub bias: Bias,
}

impl Node {
    /// Ids in order: two nodes with the same are one hypothesis.
    pub fn ids(&self) -> Vec<String> {
        let mut ids: Vec<String> = self.members.iter().map(|m| m.candidate.id()).collect();
        ids.sort();
        ids
    }

    /// Terms that are no part of the noise.
    pub fn causes(&self) -> usize {
        self.members.iter().filter(|m| !m.is_noise()).count()
    }
}

/// ln Gamma(x) for x >= 1/2 (Stirling's series with recurrence; absolute error below 1e-9).
pub fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 8.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let s = 1.0 / (x * x);
    let series = (1.0 / 12.0 - s * (1.0 / 360.0 - s * (1.0 / 1260.0 - s / 1680.0))) / x;
    shift + (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series
}

/// What a set leaves to further shapes, at one noise.
pub struct Stage {
    pub noise: usize,
    /// Whitened base and terms.
    pub white: Basis,
    /// The same as they are, for the prior along orthonormal columns.
    pub plain: Basis,
    /// The parts of both that belong to terms.
    white_terms: Basis,
    plain_terms: Basis,
    /// Whitened error less what both explain.
    pub rest: Vec<f64>,
    pub likelihood: f64,
    /// Rows less the rank of the base; rank of the terms.
    contrasts: f64,
    rank: f64,
    rss: f64,
    /// ln(rows s0^2).
    prior: f64,
    /// Rows that a clip holds: further shapes do not show there.
    held: Vec<bool>,
    /// Coefficients of the base and of each member's columns (those that have one).
    coefficients: Vec<f64>,
}

impl Stage {
    /// L from its parts: rank and rss of all terms, and both Gram determinants of Z beyond B.
    fn evidence(&self, more: f64, rss: f64, gram: f64) -> f64 {
        let (rank, rows) = (self.rank + more, self.contrasts);
        let free = rows - rank;
        let constant = self.rank_free();
        let l = |free: f64, rss: f64| {
            ln_gamma(0.5 * free) - 0.5 * free * (0.5 * rss.max(f64::MIN_POSITIVE)).ln()
        };
        self.likelihood + l(free, rss)
            - l(constant, self.rss)
            - 0.5 * gram
            - 0.5 * more * self.prior
    }

    fn rank_free(&self) -> f64 {
        self.contrasts - self.rank
    }

    /// L with the columns of a further shape (over all rows).
    pub fn with(&self, frame: &Frame, columns: &[Vec<f64>], is_sized: bool) -> Option<f64> {
        let mut shown: Vec<Vec<f64>> = columns.iter().map(|c| frame.reduced(c)).collect();
        for column in &mut shown {
            let rows = column.iter_mut().zip(&self.held);
            rows.filter(|(_, held)| **held).for_each(|(v, _)| *v = 0.0);
        }
        let mut white = frame.whitened(self.noise).whitener.apply_all(&shown);
        let squares: Vec<f64> = shown.iter().map(|c| dot(c, c)).collect();
        shown
            .iter_mut()
            .for_each(|p| drop(self.plain.project_off(p)));
        white
            .iter_mut()
            .for_each(|w| drop(self.white.project_off(w)));
        self.beyond(&squares, shown, white, is_sized)
    }

    /// The same for columns that are beyond the base already, plain and whitened, with their squares before.
    pub fn with_known(
        &self,
        columns: &[Vec<f64>],
        beyond: &[Vec<f64>],
        white: &[Vec<f64>],
        is_sized: bool,
    ) -> Option<f64> {
        let squares: Vec<f64> = columns.iter().map(|c| dot(c, c)).collect();
        let off = |terms: &Basis, columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let mut out = columns.to_vec();
            if terms.rank() > 0 {
                out.iter_mut().for_each(|c| drop(terms.project_off(c)));
            }
            out
        };
        let (plain, white) = (
            off(&self.plain_terms, beyond),
            off(&self.white_terms, white),
        );
        self.beyond(&squares, plain, white, is_sized)
    }

    /// Whether a clip holds rows, so that shapes are not what they are elsewhere.
    pub fn holds(&self) -> bool {
        self.held.contains(&true)
    }

    /// L with columns beyond all that is in, plain and whitened.
    fn beyond(
        &self,
        squares: &[f64],
        shown: Vec<Vec<f64>>,
        white: Vec<Vec<f64>>,
        is_sized: bool,
    ) -> Option<f64> {
        if is_sized {
            let mut rest = self.rest.clone();
            for w in &white {
                add_scaled(&mut rest, -1.0, w);
            }
            return Some(self.evidence(0.0, dot(&rest, &rest), 0.0));
        }
        let (mut own, mut plain) = (Basis::default(), Basis::default());
        let mut gained = 0.0;
        let mut more = 0.0;
        for ((w, p), square) in white.iter().zip(&shown).zip(squares) {
            if dot(p, p) <= DEPENDENT * square {
                continue;
            }
            if plain.push(p) && own.push(w) {
                let q = own.q.last()?;
                gained += dot(q, &self.rest).powi(2);
                more += 1.0;
            }
        }
        if more == 0.0 || self.rank_free() - more < 4.0 {
            return None;
        }
        let gram = own.log_det_gram() - plain.log_det_gram();
        Some(self.evidence(more, self.rss - gained, gram))
    }
}

/// The columns of a set's terms as the fit sees them, free ones in order; what is left of the error of what is taken off as it
/// is; and the rows that a clip holds.
pub struct Parts {
    pub free: Vec<Vec<f64>>,
    pub error: Vec<f64>,
    pub held: Vec<bool>,
}

/// Whether a row of the record, or a block of rows, is mostly held by a clip.
fn reduced_held(frame: &Frame, held: &[f64]) -> Vec<bool> {
    frame.fit.reduce(held).iter().map(|h| *h > 0.5).collect()
}

/// [`Parts`] of a set beside a bias.
pub fn parts(frame: &Frame, members: &[Member], bias: &Bias) -> Parts {
    let c = frame.channels;
    let mut error = frame.plain_error.clone();
    let (mut free, mut held) = (Vec::new(), Vec::new());
    for m in members {
        if m.candidate.is_last() {
            // A clipped row says where the clip is, and nothing of what would have been there.
            let columns = frame.of(m.candidate.as_ref(), bias, &m.point);
            let mut by = vec![0.0; c.len()];
            columns
                .iter()
                .for_each(|column| add_scaled(&mut by, 1.0, column));
            let clipped: Vec<f64> = by.iter().map(|b| f64::from(u8::from(*b != 0.0))).collect();
            let whole = |row: usize| {
                let others = bias.others_dps.get(row).copied().unwrap_or(0.0);
                clipped[row] * (by[row] + bias.at(c.u[row]) + others)
            };
            let whole: Vec<f64> = (0..c.len()).map(whole).collect();
            add_scaled(&mut error, -1.0, &frame.reduced(&whole));
            held = reduced_held(frame, &clipped);
            continue;
        }
        let columns = match &m.fixed {
            Some(fixed) => fixed.as_ref().clone(),
            None => {
                let columns = frame.of(m.candidate.as_ref(), bias, &m.point);
                columns.iter().map(|c| frame.reduced(c)).collect()
            }
        };
        if m.candidate.is_sized(&m.point) {
            columns
                .iter()
                .for_each(|column| add_scaled(&mut error, -1.0, column));
        } else {
            free.extend(columns);
        }
    }
    Parts { free, error, held }
}

/// A set at one noise; None with too few rows.
pub fn stage(frame: &Frame, members: &[Member], bias: &Bias, noise: usize) -> Option<Stage> {
    let known = frame.whitened(noise);
    let whitener = &known.whitener;
    let Parts {
        mut free,
        error,
        held,
    } = parts(frame, members, bias);
    let (mut white, mut plain) = (known.base.clone(), frame.plain_basis.clone());
    if held.contains(&true) {
        let shown = |columns: &mut Vec<Vec<f64>>| {
            for column in columns {
                let rows = column.iter_mut().zip(&held);
                rows.filter(|(_, held)| **held).for_each(|(v, _)| *v = 0.0);
            }
        };
        let mut base = frame.plain_base.clone();
        shown(&mut base);
        shown(&mut free);
        (white, plain) = (Basis::new(&whitener.apply_all(&base)), Basis::new(&base));
    }
    let is_plain = members
        .iter()
        .all(|m| m.candidate.is_last() || !m.candidate.is_sized(&m.point));
    let mut rest = match is_plain && held.is_empty() {
        true => known.error.clone(),
        false => whitener.apply(&error),
    };
    let whitened = whitener.apply_all(&free);
    let (of_base, plain_of_base) = (white.log_det_gram(), plain.log_det_gram());
    let (base_rank, plain_base_rank) = (white.rank(), plain.rank());
    for (w, p) in whitened.iter().zip(&free) {
        let mut beyond = p.clone();
        plain.project_off(&mut beyond);
        if dot(&beyond, &beyond) <= DEPENDENT * dot(p, p) {
            // Counted as given, so that coefficients keep their places.
            white.push(&vec![0.0; w.len()]);
            continue;
        }
        plain.push(p);
        white.push(w);
    }
    let z = white.project_off(&mut rest);
    let rank = (white.rank() - base_rank) as f64;
    let contrasts = whitener.used as f64 - base_rank as f64;
    let free = contrasts - rank;
    if free < 4.0 {
        return None;
    }
    let rss = dot(&rest, &rest).max(f64::MIN_POSITIVE);
    let prior = (whitener.used as f64 * frame.declared_square).ln();
    let gram = (white.log_det_gram() - of_base) - (plain.log_det_gram() - plain_of_base);
    let likelihood = ln_gamma(0.5 * free)
        - 0.5 * free * (0.5 * rss).ln()
        - 0.5 * (gram + rank * prior + whitener.log_det + of_base);
    let coefficients = white.solve(&z);
    let terms = |all: &Basis, from: usize| Basis {
        q: all.q[from..].to_vec(),
        ..Basis::default()
    };
    let (white_terms, plain_terms) = (terms(&white, base_rank), terms(&plain, plain_base_rank));
    Some(Stage {
        noise,
        white_terms,
        plain_terms,
        white,
        plain,
        rest,
        likelihood,
        contrasts,
        rank,
        rss,
        prior,
        held,
        coefficients,
    })
}

/// Whether physics admits the coefficients of every term.
fn admitted(frame: &Frame, members: &[Member], stage: &Stage) -> bool {
    let mut given = stage.coefficients[frame.base.len()..].iter();
    members.iter().all(|m| {
        if m.candidate.is_last() || m.candidate.is_sized(&m.point) {
            return true;
        }
        let count = match &m.fixed {
            Some(fixed) => fixed.len(),
            None => frame
                .of(m.candidate.as_ref(), &Bias::default(), &m.point)
                .len(),
        };
        let beta: Vec<f64> = given.by_ref().take(count).copied().collect();
        m.candidate.admits(frame.channels, &m.point, &beta)
    })
}

/// The bias beside a set's terms, by ordinary least squares of what they leave, and what they add.
fn settled(frame: &Frame, members: &[Member], bias: &Bias, stage: &Stage) -> Bias {
    let c = frame.channels;
    let mut rest = c.error_dps.clone();
    let mut others = vec![0.0; c.len()];
    let mut weights = frame.fit.row_weights.clone();
    let mut given = stage.coefficients[frame.base.len()..].iter();
    for m in members {
        let columns = frame.of(m.candidate.as_ref(), bias, &m.point);
        let is_sized = m.candidate.is_sized(&m.point);
        for column in &columns {
            if m.candidate.is_last() {
                let rows = weights.iter_mut().zip(column);
                rows.filter(|(_, by)| **by != 0.0)
                    .for_each(|(w, _)| *w = 0.0);
                continue;
            }
            let b = if is_sized {
                1.0
            } else {
                given.next().copied().unwrap_or(0.0)
            };
            add_scaled(&mut rest, -b, column);
            add_scaled(&mut others, b, column);
        }
    }
    Bias {
        coefficients_dps: weighted(&frame.base[..frame.declared], &rest, &weights),
        others_dps: others,
    }
}

/// L of a set at one noise, and the bias beside it; None where physics excludes the coefficients.
pub fn at_noise(
    frame: &Frame,
    members: &[Member],
    bias: &Bias,
    noise: usize,
) -> Option<(f64, Bias)> {
    let acts = members.iter().any(|m| m.candidate.acts_on_bias());
    let mut bias = bias.clone();
    for pass in 1.. {
        let stage = stage(frame, members, &bias, noise)?;
        if !admitted(frame, members, &stage) {
            return None;
        }
        if !acts || pass == PASSES {
            return Some((stage.likelihood, bias));
        }
        bias = settled(frame, members, &bias, &stage);
    }
    None
}

/// Logarithm of the prior odds of a term of so many columns. A smooth function is as many laws as it has columns: two effects of one channel are
/// no less likely than the function that has both in it.
pub fn odds(candidate: &dyn Candidate, columns: usize) -> f64 {
    if candidate.named() {
        return PRIOR_ODDS.ln();
    }
    let laws = if candidate.repeats() {
        1
    } else {
        columns.max(1)
    };
    NAMELESS.ln() + laws as f64 * PRIOR_ODDS.ln()
}

/// The price of a set: prior odds and Occam factors of its terms.
pub fn price(members: &[Member]) -> f64 {
    let columns = |m: &Member| m.fixed.as_ref().map_or(1, |f| f.len());
    let paid = members.iter().filter(|m| !m.evident);
    paid.map(|m| odds(m.candidate.as_ref(), columns(m)) + m.occam)
        .sum()
}

/// A set at its most likely noise: downhill on the grid from a noise and from white.
pub fn node(frame: &Frame, members: Vec<Member>, bias: &Bias, start: usize) -> Option<Node> {
    let mut known = std::collections::BTreeMap::new();
    let mut at = |k: usize| -> Option<f64> {
        *known
            .entry(k)
            .or_insert_with(|| Some(at_noise(frame, &members, bias, k)?.0 + frame.noise_odds[k]))
    };
    let mut best: Option<(f64, usize)> = None;
    for start in [start, frame.plain_noise] {
        let Some(mut l) = at(start) else { continue };
        let mut here = start;
        loop {
            let near = frame.neighbours[here].iter();
            let next = near
                .filter_map(|k| at(*k).map(|l| (l, *k)))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            match next {
                Some((better, k)) if better > l => (l, here) = (better, k),
                _ => break,
            }
        }
        if best.is_none_or(|b| l > b.0) {
            best = Some((l, here));
        }
    }
    let (_, noise) = best?;
    let (likelihood, bias) = at_noise(frame, &members, bias, noise)?;
    let stage = stage(frame, &members, &bias, noise)?;
    let bias = settled(frame, &members, &bias, &stage);
    Some(Node {
        score: likelihood + frame.noise_odds[noise] + price(&members),
        likelihood,
        noise,
        bias,
        members,
    })
}

/// Prior weight of a point among those of its candidate, as a logarithm: what its data sheet says against it.
pub fn against(frame: &Frame, candidate: &dyn Candidate, point: &Point) -> f64 {
    candidate.surcharge(frame.channels, point) + candidate.odds_against(frame.channels, point)
}
