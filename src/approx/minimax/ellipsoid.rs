//! A small ellipsoid around all polynomials whose error is at most E.
//!
//! With weights w_j >= 0 of sum 1 at points x_j, |e(x_j)| <= E for all j gives sum of w_j e_j^2 <= E^2. That is
//! an ellipsoid around the weighted least-squares polynomial with squared radius E^2 - R^2 (R^2 its own
//! weighted residual) in the metric M = sum of w_j phi_j phi_j^T, so its volume goes with
//! (E^2 - R^2)^(n/2) / sqrt(det M). Where E is far above the minimax error the best w is the D-optimal
//! design of the basis; where E is close to it, w gathers on the alternation and R comes close to E.
//! Setting the derivative of log volume to 0 gives, for every point that carries weight,
//! phi_j^T M^-1 phi_j + n e_j^2 / (E^2 - R^2) = n E^2 / (E^2 - R^2), and the multiplicative iteration below,
//! in the manner of D. M. Titterington (1976) and S. D. Silvey, D. H. Titterington, B. Torsney (1978) for D-optimal
//! designs. Any weights are valid; better ones only make the enumeration shorter.

/// Steps of the iteration.
const STEPS: usize = 120;

/// Weights, of sum 1, for basis rows and errors at the same points (each times its point's weight).
/// `errors` are those of any polynomial of the basis, best the minimax one; `limit` is E.
pub(super) fn weights(rows: &[Vec<f64>], errors: &[f64], limit: f64, start: Vec<f64>) -> Vec<f64> {
    let n = rows.first().map_or(0, Vec::len);
    let mut w = normalised(start);
    for _ in 0..STEPS {
        let Some(state) = State::new(rows, errors, &w) else {
            return w;
        };
        let room = limit * limit - state.residual_square;
        if room <= 1e-9 * limit * limit {
            return w;
        }
        let level = n as f64 * limit * limit / room;
        let next = rows
            .iter()
            .zip(errors)
            .zip(&w)
            .map(|((row, &e), &w)| {
                let (leverage, residual) = state.at(row, e);
                w * (leverage + n as f64 * residual * residual / room) / level
            })
            .collect();
        w = normalised(next);
    }
    w
}

fn normalised(mut w: Vec<f64>) -> Vec<f64> {
    let sum: f64 = w.iter().sum();
    if sum > 0.0 {
        w.iter_mut().for_each(|v| *v /= sum);
    }
    w
}

/// Weighted least squares of the errors.
struct State {
    /// Lower triangle of M = L L^T.
    factor: Vec<Vec<f64>>,
    solution: Vec<f64>,
    residual_square: f64,
}

impl State {
    fn new(rows: &[Vec<f64>], errors: &[f64], w: &[f64]) -> Option<State> {
        let n = rows.first()?.len();
        let mut m = vec![vec![0.0; n]; n];
        let mut right = vec![0.0; n];
        for ((row, &e), &w) in rows.iter().zip(errors).zip(w) {
            for i in 0..n {
                let v = w * row[i];
                right[i] += v * e;
                for j in 0..=i {
                    m[i][j] += v * row[j];
                }
            }
        }
        for i in 0..n {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| m[i][k] * m[j][k]).sum();
                let v = m[i][j] - known;
                if i == j {
                    if v <= 1e-13 * m[i][i] || !v.is_finite() {
                        return None;
                    }
                    m[i][i] = v.sqrt();
                } else {
                    m[i][j] = v / m[j][j];
                }
            }
        }
        let mut state = State {
            factor: m,
            solution: Vec::new(),
            residual_square: 0.0,
        };
        let mut solution = state.forward(&right);
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| state.factor[k][i] * solution[k]).sum();
            solution[i] = (solution[i] - known) / state.factor[i][i];
        }
        state.solution = solution;
        let mut sum = 0.0;
        for ((row, &e), &w) in rows.iter().zip(errors).zip(w) {
            sum += w * state.residual(row, e).powi(2);
        }
        state.residual_square = sum;
        Some(state)
    }

    fn forward(&self, right: &[f64]) -> Vec<f64> {
        let mut v = right.to_vec();
        for i in 0..v.len() {
            let known: f64 = (0..i).map(|k| self.factor[i][k] * v[k]).sum();
            v[i] = (v[i] - known) / self.factor[i][i];
        }
        v
    }

    fn residual(&self, row: &[f64], error: f64) -> f64 {
        error
            - row
                .iter()
                .zip(&self.solution)
                .map(|(a, b)| a * b)
                .sum::<f64>()
    }

    /// (leverage, residual) of a point.
    fn at(&self, row: &[f64], error: f64) -> (f64, f64) {
        let leverage = self.forward(row).iter().map(|v| v * v).sum();
        (leverage, self.residual(row, error))
    }
}
