//! The Kalman filter as the inverse square root of a covariance.
//!
//! For a noise n with covariance V = L D L' (L unit lower triangular) the filter's innovations are
//! L^-1 n and their variances D (Durbin & Koopman 2012, 4.3, 4.12). Divided by their standard deviation
//! they are uncorrelated, so least squares on whitened columns is generalised least squares on
//! the columns themselves, and ln det V is the sum of the logarithms of D. Gains do not depend on
//! data: they are made once ([`Whitener::new`], rows times states^2) and used for any number of
//! columns (rows times states each).

use super::filter::filter;
use super::noise::{Shape, State, Timeline};
use pulp::{Arch, Simd, WithSimd};

/// Gains of the filter for one timeline and one shape of the noise, the white variance being 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Whitener {
    /// The shape.
    pub shape: Shape,
    /// ln det V over the used rows.
    pub log_det: f64,
    /// Rows that are used.
    pub used: usize,
    /// One over the innovation's standard deviation, row by row; 0 for rows that are not used.
    pub inverse_std: Vec<f64>,
    /// Number of states, rounded up to a size that the filter is compiled for.
    pub(super) width: usize,
    /// For each row the `width` decays, then the `width` gains.
    pub(super) coefficients: Vec<f64>,
}

/// Calls a function of the compiled size that holds `$width` states.
macro_rules! sized {
    ($width:expr, $call:ident ( $($argument:expr),* )) => {
        match $width {
            0 => $call::<0>($($argument),*),
            1 => $call::<1>($($argument),*),
            2..=4 => $call::<4>($($argument),*),
            5..=6 => $call::<6>($($argument),*),
            7..=8 => $call::<8>($($argument),*),
            _ => $call::<12>($($argument),*),
        }
    };
}

impl Whitener {
    /// The gains for a timeline and a shape.
    pub fn new(line: &Timeline, shape: Shape) -> Self {
        Self::with_smooth(line, shape, 0.0)
    }

    /// The same with a smooth walk beside it ([`Timeline::smooth_states`]).
    pub fn with_smooth(line: &Timeline, shape: Shape, smooth: f64) -> Self {
        let (states, cross) = line.smooth_states(shape, smooth);
        let recursion = Recursion {
            line,
            shape,
            states: &states,
            cross,
        };
        Arch::new().dispatch(recursion)
    }

    /// One column, whitened; 0 in rows that are not used, whatever the column has there.
    pub fn apply(&self, column: &[f64]) -> Vec<f64> {
        self.apply_all(&[column]).pop().unwrap_or_default()
    }

    /// Several columns, each at least as long as the timeline, whitened.
    pub fn apply_all<C: AsRef<[f64]>>(&self, columns: &[C]) -> Vec<Vec<f64>> {
        let mut out: Vec<Vec<f64>> = columns
            .iter()
            .map(|_| vec![0.0; self.inverse_std.len()])
            .collect();
        sized!(self.width, filter(self, columns, &mut out));
        out
    }

    /// The inverse of [`Whitener::apply`]: white numbers of unit variance become noise of this
    /// covariance. Rows that are not used get the prediction from the used ones before them.
    pub fn colour(&self, white: &[f64]) -> Vec<f64> {
        let mut state = vec![0.0; self.width];
        let mut out = Vec::with_capacity(white.len());
        for ((w, inverse), row) in white
            .iter()
            .zip(&self.inverse_std)
            .zip(0..self.inverse_std.len())
        {
            let (decays, gains) = self.row(row);
            let mut predicted = 0.0;
            for (m, a) in state.iter_mut().zip(decays) {
                *m *= a;
                predicted += *m;
            }
            let innovation = if *inverse > 0.0 { w / inverse } else { 0.0 };
            for (m, g) in state.iter_mut().zip(gains) {
                *m += g * innovation;
            }
            out.push(predicted + innovation);
        }
        out
    }

    /// For a whitened column e = V^(-1/2) r: the pair (V^-1 r, diagonal of V^-1), row by row.
    ///
    /// u = (V^-1 r)_t / sqrt((V^-1)_tt) is the test of row t as an additive outlier, against all
    /// other rows before and after it; u / sqrt((V^-1)_tt) its size (de Jong 1988; Durbin & Koopman 2012,
    /// 4.5, 7.5: auxiliary residuals by the backward recursion).
    pub fn auxiliary(&self, whitened: &[f64]) -> Vec<(f64, f64)> {
        let k = self.width;
        let (mut r, mut n) = (vec![0.0; k], vec![0.0; k * k]);
        let mut out = vec![(0.0, 0.0); whitened.len()];
        let rows = whitened.iter().zip(&self.inverse_std).enumerate();
        for (row, (e, inverse)) in rows.rev() {
            // Here r and n stand for after this row's update: r+ = A' r, N+ = A' N A with the next
            // row's decays, which the last lines of the loop have already multiplied in.
            let (decays, gains) = self.row(row);
            let weight = inverse * inverse;
            let gr: f64 = gains.iter().zip(&r).map(|(g, r)| g * r).sum();
            let ng: Vec<f64> = (0..k)
                .map(|i| (0..k).map(|j| n[i * k + j] * gains[j]).sum())
                .collect();
            let gng: f64 = gains.iter().zip(&ng).map(|(g, v)| g * v).sum();
            if *inverse > 0.0 {
                out[row] = (e * inverse - gr, weight + gng);
            }
            // L = I - g 1': L' r = r - 1 (g' r); then 1 v / F, and the decays of this row.
            let shift = e * inverse - gr;
            for (r, a) in r.iter_mut().zip(decays) {
                *r = (*r + shift) * a;
            }
            for i in 0..k {
                for j in 0..k {
                    let entry = &mut n[i * k + j];
                    *entry = (*entry - ng[i] - ng[j] + gng + weight) * decays[i] * decays[j];
                }
            }
        }
        out
    }

    /// One row more like the last.
    fn repeat_last(&mut self) {
        let from = self.coefficients.len() - 2 * self.width;
        self.coefficients.extend_from_within(from..);
        if let Some(inverse) = self.inverse_std.last().copied() {
            self.inverse_std.push(inverse);
            self.log_det -= 2.0 * inverse.ln();
            self.used += 1;
        }
    }

    /// Decays and gains of a row.
    fn row(&self, row: usize) -> (&[f64], &[f64]) {
        let start = 2 * self.width * row;
        let both = self.coefficients.get(start..start + 2 * self.width);
        both.map_or((&[], &[]), |both| both.split_at(self.width))
    }
}

/// Change of the gains from a row to the next below which they are the steady ones; how far steps of one clock differ by its rounding.
const STEADY: f64 = 1e-14;
const SAME: f64 = 1e-9;

/// What the recursion had in its last row, and whether it stands still: where rows come at even distances the covariance does
/// not change any more after a while (Durbin & Koopman 2012, 4.3.4).
struct Settled<const N: usize> {
    step: f64,
    factor: f64,
    f: f64,
    gain: [f64; N],
    is_steady: bool,
}

impl<const N: usize> Default for Settled<N> {
    fn default() -> Self {
        Settled {
            step: f64::NAN,
            factor: f64::NAN,
            f: f64::NAN,
            gain: [f64::NAN; N],
            is_steady: false,
        }
    }
}

impl<const N: usize> Settled<N> {
    /// Whether the row after the last, a step after it, has the same gains.
    fn holds(&self, step: f64, factor: f64) -> bool {
        self.is_steady && (step - self.step).abs() <= SAME * step && factor == self.factor
    }

    fn next(&mut self, step: f64, factor: f64, f: f64, gain: &[f64; N]) {
        let pairs = gain.iter().zip(&self.gain);
        let still = pairs.fold((f - self.f).abs() <= STEADY * f, |still, (new, old)| {
            still && (new - old).abs() <= STEADY
        });
        let same = (step - self.step).abs() <= SAME * step && factor == self.factor;
        *self = Settled {
            step,
            factor,
            f,
            gain: *gain,
            is_steady: still && same,
        };
    }
}

/// The recursion below for the processor's registers; every number comes from the same operations in the same order.
struct Recursion<'a> {
    line: &'a Timeline,
    shape: Shape,
    states: &'a [State],
    /// Stationary covariance of the last two relaxations.
    cross: f64,
}

impl WithSimd for Recursion<'_> {
    type Output = Whitener;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Whitener {
        let (states, cross) = (self.states, self.cross);
        sized!(states.len(), gains(self.line, self.shape, states, cross))
    }
}

/// The covariance recursion (Durbin & Koopman 2012, 4.3) for states that are observed as their
/// sum.
#[inline(always)]
fn gains<const N: usize>(line: &Timeline, shape: Shape, states: &[State], cross: f64) -> Whitener {
    let mut out = Whitener {
        shape,
        log_det: 0.0,
        used: 0,
        inverse_std: Vec::with_capacity(line.len()),
        width: N,
        coefficients: Vec::with_capacity(2 * N * line.len()),
    };
    let (mut p, mut variance, mut walk) = ([[0.0f64; N]; N], [0.0f64; N], [0.0f64; N]);
    for (i, state) in states.iter().enumerate().take(N) {
        if state.tau.is_finite() {
            variance[i] = state.variance;
            p[i][i] = state.variance;
        } else {
            walk[i] = state.variance;
        }
    }
    let relaxations = states.iter().filter(|s| s.tau.is_finite()).count();
    // Places of the two that are correlated; (0, 0) for none.
    let pair = match cross != 0.0 && relaxations > 1 && relaxations <= N {
        true => [relaxations - 2, relaxations - 1],
        false => [0, 0],
    };
    if pair[0] < pair[1] {
        let [i, j] = pair;
        (p[i][j], p[j][i]) = (cross, cross);
    }
    let floor = line.floor(shape);
    let mut last = Settled::default();
    for (row, (step, factor)) in line.steps.iter().zip(&line.white_factor).enumerate() {
        if last.holds(*step, *factor) {
            out.repeat_last();
            continue;
        }
        let mut a = [1.0f64; N];
        let decays = line.decays(row);
        // All, or the last ones.
        for (a, decay) in a.iter_mut().zip(&decays[decays.len() - relaxations..]) {
            *a = *decay;
        }
        let mut z = [0.0f64; N];
        for i in 0..N {
            for j in 0..N {
                p[i][j] *= a[i] * a[j];
            }
            p[i][i] += variance[i] * (1.0 - a[i] * a[i]) + walk[i] * step;
        }
        if pair[0] < pair[1] {
            let [i, j] = pair;
            let gained = cross * (1.0 - a[i] * a[j]);
            p[i][j] += gained;
            p[j][i] += gained;
        }
        for i in 0..N {
            z[i] = p[i].iter().sum();
        }
        let f = z.iter().sum::<f64>() + factor + floor;
        out.coefficients.extend_from_slice(&a);
        if f.is_finite() && f > 0.0 {
            let gain = z.map(|z| z / f);
            for i in 0..N {
                for j in 0..N {
                    p[i][j] -= z[i] * gain[j];
                }
            }
            out.coefficients.extend_from_slice(&gain);
            out.inverse_std.push(1.0 / f.sqrt());
            out.log_det += f.ln();
            out.used += 1;
            last.next(*step, *factor, f, &gain);
        } else {
            out.coefficients.extend_from_slice(&[0.0; N]);
            out.inverse_std.push(0.0);
            last = Settled::default();
        }
    }
    out
}
