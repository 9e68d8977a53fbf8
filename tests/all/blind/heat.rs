//! First-order lags and rates of change, each in two ways of computing.

/// tau dy/dt = x - y, exact for x constant over a step; starts in equilibrium.
pub fn lag_stepwise(x: &[f64], step_s: f64, tau_s: f64) -> Vec<f64> {
    let keep = (-step_s / tau_s).exp();
    let mut y = x.first().copied().unwrap_or(0.0);
    x.iter()
        .map(|value| {
            y = keep * y + (1.0 - keep) * value;
            y
        })
        .collect()
}

/// The same equation by Runge and Kutta's fourth-order method with x linear between steps, and as
/// many inner steps as stability asks for.
pub fn lag_runge_kutta(x: &[f64], step_s: f64, tau_s: f64) -> Vec<f64> {
    let inner = (2.0 * step_s / tau_s).ceil().max(1.0) as usize;
    let h = step_s / inner as f64;
    let mut y = x.first().copied().unwrap_or(0.0);
    let mut out = vec![y];
    for pair in x.windows(2) {
        let at = |s: f64| pair[0] + (pair[1] - pair[0]) * s;
        for k in 0..inner {
            let s = k as f64 / inner as f64;
            let half = 0.5 / inner as f64;
            let f = |s: f64, y: f64| (at(s) - y) / tau_s;
            let k1 = f(s, y);
            let k2 = f(s + half, y + 0.5 * h * k1);
            let k3 = f(s + half, y + 0.5 * h * k2);
            let k4 = f(s + 2.0 * half, y + h * k3);
            y += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        }
        out.push(y);
    }
    out
}

/// dx/dt per second by central differences.
pub fn slope(x: &[f64], step_s: f64) -> Vec<f64> {
    let last = x.len().saturating_sub(1);
    (0..x.len())
        .map(|k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(last));
            (x[b] - x[a]) / ((b - a).max(1) as f64 * step_s)
        })
        .collect()
}

/// Play (backlash) operator of half width `half`: the output moves only when the input pushes it.
pub fn play(x: &[f64], half: f64) -> Vec<f64> {
    let mut y = x.first().copied().unwrap_or(0.0);
    x.iter()
        .map(|value| {
            y = y.clamp(value - half, value + half);
            y
        })
        .collect()
}
