//! Projections: what of a contribution the declared model cannot take up.

/// Mean of the values; 0 for none.
pub fn mean(v: &[f64]) -> f64 {
    if v.is_empty() {
        return 0.0;
    }
    v.iter().sum::<f64>() / v.len() as f64
}

/// Root mean square; 0 for none.
pub fn rms(v: &[f64]) -> f64 {
    mean(&v.iter().map(|x| x * x).collect::<Vec<_>>()).sqrt()
}

/// Root mean square about the mean.
pub fn deviation(v: &[f64]) -> f64 {
    let m = mean(v);
    rms(&v.iter().map(|x| x - m).collect::<Vec<_>>())
}

/// Smallest and largest value.
pub fn range(v: &[f64]) -> (f64, f64) {
    v.iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
            (a.min(*x), b.max(*x))
        })
}

/// Sum of the products.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Element by element.
pub fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x + y).collect()
}

/// `k * v`.
pub fn scaled(v: &[f64], k: f64) -> Vec<f64> {
    v.iter().map(|x| k * x).collect()
}

/// An orthonormal set that grows by Gram-Schmidt, each vector cleaned twice.
#[derive(Clone, Default)]
pub struct Span {
    vectors: Vec<Vec<f64>>,
}

impl Span {
    /// The span of the columns; what depends on earlier ones is left out.
    pub fn of(columns: &[Vec<f64>]) -> Self {
        let mut span = Self::default();
        columns.iter().for_each(|c| span.add(c));
        span
    }

    /// {1, p, p^2}: the declared bias model for the thermometer reading `p`.
    pub fn declared(p: &[f64]) -> Self {
        let u = centred(p);
        let square: Vec<f64> = u.iter().map(|x| x * x).collect();
        Self::of(&[vec![1.0; p.len()], u, square])
    }

    /// One column more.
    pub fn add(&mut self, column: &[f64]) {
        let before = rms(column);
        let clean = self.residual(&self.residual(column));
        let after = rms(&clean);
        if after > 1e-9 * before && before > 0.0 {
            let norm = dot(&clean, &clean).sqrt();
            self.vectors.push(scaled(&clean, 1.0 / norm));
        }
    }

    /// `y` without its part in the span.
    pub fn residual(&self, y: &[f64]) -> Vec<f64> {
        let mut left = y.to_vec();
        for v in &self.vectors {
            let k = dot(&left, v);
            left.iter_mut().zip(v).for_each(|(l, x)| *l -= k * x);
        }
        left
    }
}

/// Centred and divided by half the range, so that powers stay of order one.
pub fn centred(p: &[f64]) -> Vec<f64> {
    let (low, high) = range(p);
    let half = (0.5 * (high - low)).max(1e-300);
    p.iter().map(|x| (x - 0.5 * (low + high)) / half).collect()
}

/// How much of `target` the `columns` explain beyond `base`: the multiple correlation, 0..1.
pub fn correlation(base: &Span, columns: &[Vec<f64>], target: &[f64]) -> f64 {
    let y = base.residual(target);
    // What rounding leaves of a column that lies in the base is no column.
    let clean: Vec<Vec<f64>> = columns
        .iter()
        .filter_map(|c| {
            let r = base.residual(&base.residual(c));
            (rms(&r) > 1e-7 * rms(c)).then_some(r)
        })
        .collect();
    let left = Span::of(&clean).residual(&y);
    let (all, rest) = (rms(&y), rms(&left));
    if all == 0.0 {
        return 0.0;
    }
    (1.0 - (rest / all).powi(2)).max(0.0).sqrt()
}

/// Least squares with columns brought to equal norm, by singular values; one coefficient a column.
pub fn least_squares(columns: &[Vec<f64>], y: &[f64]) -> Vec<f64> {
    let norms: Vec<f64> = columns.iter().map(|c| rms(c).max(1e-300)).collect();
    let a = nalgebra::DMatrix::from_fn(y.len(), columns.len(), |i, j| columns[j][i] / norms[j]);
    let b = nalgebra::DVector::from_column_slice(y);
    let solved = a.svd(true, true).solve(&b, 1e-11).expect("both factors");
    solved.iter().zip(&norms).map(|(k, n)| k / n).collect()
}
