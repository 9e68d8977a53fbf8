//! A candidate's best shape beside a model.

use super::acting::Settling;
use super::judge::{PRICE, WHITE, price};
use super::refine::{self, Bench};
use super::unclipped::Unclipped;
use super::{Model, Search};
use crate::statistics::linear::add_scaled;
use crate::statistics::noise::Shape;
use crate::thermal::effects::{Bias, Candidate, Point, map};

/// Sizes from which a shape that moves the bias is climbed where one without a size is the best of those tried.
const SIZES: usize = 2;

/// A candidate's best shape.
pub(super) struct Top {
    /// The shape.
    pub point: Point,
    /// The declared bias beside it, where it moves that.
    pub bias: Option<Bias>,
    /// Gain in log-likelihood of a shape that has its size in it.
    pub whole: Option<f64>,
}

impl Search<'_> {
    /// The best shape of a candidate, of its `points` one of which is best at the noise `shape`; roughly, where it is not
    /// `near` the leader.
    pub(super) fn top(
        &self,
        model: &Model,
        candidate: &dyn Candidate,
        (points, point): (&[Point], &Point),
        shape: Shape,
        near: bool,
    ) -> Top {
        let c = self.channels;
        let fit = &model.fit;
        let acting = candidate.acts_on_bias() && !candidate.is_last();
        let mut top = Top {
            point: point.clone(),
            bias: None,
            whole: None,
        };
        if !(near || acting || candidate.is_whole()) {
            return top;
        }
        // At one noise; the null hypothesis may choose the one that suits it best.
        let mut benches = vec![(shape, Bench::new(model, shape))];
        // A residual with sharp ends looks like a walk without white noise, to which a threshold that is off by a row, or
        // a form that is not quite the one, is no better than none: it is found where the noise is white.
        // A clip of the bias was not near with a bias that it bends.
        let unclipped = (candidate.is_last() && self.moves_by_bias(model))
            .then(|| self.unclipped_beside(model));
        let sharp = acting || candidate.is_whole() || candidate.is_local();
        if near && sharp || unclipped.is_some() {
            benches.push((WHITE, Bench::new(model, WHITE)));
        }
        let best = |point: &Point, bias: &Option<Bias>| {
            let bias = bias.as_ref().unwrap_or(&model.bias);
            let at = |(shape, bench): &(Shape, Bench<'_>)| {
                let there = refine::gain(bench, candidate, c, bias, point);
                there + fit.problem.evaluate(*shape).loglik - fit.at.loglik
            };
            benches
                .iter()
                .map(at)
                .fold(f64::NEG_INFINITY, |m, v| m.max(v))
        };
        let mut reached = f64::NEG_INFINITY;
        for (k, (_, bench)) in benches.iter().enumerate() {
            let found = match (acting, k) {
                (true, _) => self.admitted(model, candidate, points, bench),
                // Where physics gives the coefficient, the best shape is not that of a free one.
                (false, 0) if !candidate.is_whole() => {
                    let top = refine::refined(bench, candidate, c, &model.bias, point, 0.5);
                    Some((top, None))
                }
                _ => self.sharpened(model, candidate, points, (bench, unclipped.as_ref())),
            };
            let Some((point, bias)) = found else { continue };
            let net = best(&point, &bias) - price(candidate, c, &point);
            if net > reached {
                (reached, top.point, top.bias) = (net, point, bias);
            }
        }
        top.whole = candidate
            .is_sized(&top.point)
            .then(|| best(&top.point, &top.bias));
        top
    }

    /// The best point of a shape with thresholds on a bench, and the bias there of the rows that a clip does not hold.
    fn sharpened(
        &self,
        model: &Model,
        candidate: &dyn Candidate,
        points: &[Point],
        (bench, unclipped): (&Bench<'_>, Option<&Unclipped<'_>>),
    ) -> Option<(Point, Option<Bias>)> {
        let c = self.channels;
        let free = |p: &Point| unclipped.and_then(|u| u.bias(candidate, p));
        let gain = |p: &Point| {
            let free = free(p);
            refine::gain(bench, candidate, c, free.as_ref().unwrap_or(&model.bias), p)
        };
        let each = points.iter().map(|p| {
            let free = free(p);
            let columns = candidate.columns(c, free.as_ref().unwrap_or(&model.bias), p);
            (columns, candidate.is_sized(p))
        });
        let gains = refine::gains(bench, each);
        let each = points.iter().zip(gains);
        let each = each.map(|(p, gain)| (gain - price(candidate, c, p), p));
        let (_, start) = each.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let steps = map(&candidate.spacing(c, start), |s| 0.5 * s);
        let top = refine::climbed(start, steps, gain);
        let bias = free(&top);
        Some((top, bias))
    }

    /// The best of `points` whose coefficients physics admits, each with the declared bias that is there beside it: a
    /// strong effect that acts on the bias bends what the declared model finds without it, and would be judged by
    /// a bias that it made itself.
    fn admitted(
        &self,
        model: &Model,
        candidate: &dyn Candidate,
        points: &[Point],
        bench: &Bench<'_>,
    ) -> Option<(Point, Option<Bias>)> {
        let c = self.channels;
        let settling = self.settling_beside(model);
        let start = &model.bias.coefficients_dps;
        // The columns of a shape with the bias beside it, and what the shape costs, if it is admitted.
        let beside = |point: &Point| {
            let settled = settling.beside(candidate, point, start);
            let paid = PRICE * settled.own.len() as f64 + price(candidate, c, point);
            let admitted = candidate.admits(self.channels, point, &settled.own);
            let columns = (settled.columns, candidate.is_sized(point));
            admitted.then_some((columns, paid))
        };
        let net = |point: &Point| {
            let (columns, paid) = beside(point)?;
            let gains = refine::gains(bench, [columns]);
            gains.first().map(|gain| gain - paid)
        };
        let (mut admitted, mut shapes) = (Vec::new(), Vec::new());
        for point in points {
            if let Some((columns, paid)) = beside(point) {
                admitted.push((point, paid));
                shapes.push(columns);
            }
        }
        let gains = refine::gains(bench, shapes);
        let nets = gains.into_iter().zip(&admitted);
        let mut places: Vec<(f64, &Point)> = nets
            .map(|(gain, (point, paid))| (gain - paid, *point))
            .collect();
        places.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (_, first) = *places.first()?;
        let mut starts = vec![first];
        if !candidate.is_sized(first) {
            // The bias follows closely: between two sizes the top may be far above both, and above what has no size.
            let sized = places.iter().map(|p| p.1);
            starts.extend(sized.filter(|p| candidate.is_sized(p)).take(SIZES));
        }
        let reached = |p: &Point| net(p).unwrap_or(f64::NEG_INFINITY);
        let tops = starts.into_iter().map(|start| {
            let steps = map(&candidate.spacing(c, start), |s| 0.5 * s);
            let top = refine::climbed(start, steps, reached);
            (reached(&top), top)
        });
        let (_, top) = tops.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let bias = Bias {
            coefficients_dps: settling.beside(candidate, &top, start).bias,
            ..model.bias.clone()
        };
        Some((top, Some(bias)))
    }

    /// For the declared bias with a candidate in, beside what a model has. Ordinary least squares, for the shape alone.
    pub(super) fn settling_beside(&self, model: &Model) -> Settling<'_> {
        let mut rest = self.channels.error_dps.clone();
        let order = model.bias.coefficients_dps.len();
        for (column, b) in model.columns.iter().zip(&model.beta).skip(order) {
            add_scaled(&mut rest, -b, column);
        }
        Settling::new(self.channels, (&rest, &model.free_weights()), &[], &[])
    }
}
