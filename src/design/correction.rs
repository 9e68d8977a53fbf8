//! `[correction]` as data: what is subtracted from an averaged reading, in real numbers. [`crate::correction`] makes firmware of it.

/// A correction of averaged readings, in real numbers.
///
/// With the scaled inputs x (each held within -1 ..= 1) and the reading r, deg/s, first
/// m = r - (sum of the terms on the bias), then the true rate from m, which has the errors of the terms on
/// the rate ([`Term::ScaleBy`], [`Term::Cubic`], [`Term::Even`]) on it: r = m - sum of errors(r), r held within
/// the full scale in these, by as many substitutions from r = m as it takes ([`crate::correction::Formats::passes`]).
/// Wherever they stand in [`Plan::terms`], terms on the rate come after those on the bias.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Nominal time between readings, s.
    pub period_s: f64,
    /// What firmware reads beside the rate.
    pub inputs: Vec<Input>,
    /// Full scale of the output rate, deg/s.
    pub full_scale_dps: f64,
    /// What is corrected.
    pub terms: Vec<Term>,
}

/// An input: x = (value - offset) / scale, held within -1 ..= 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Contract name of the record's column (never `rate_out_dps`), or an auxiliary one.
    pub column: String,
    /// In the column's unit.
    pub offset: f64,
    /// In the column's unit; not 0.
    pub scale: f64,
}

/// One term. Inputs are named by their position in [`Plan::inputs`].
#[derive(Debug, Clone, PartialEq)]
pub enum Term {
    /// gain * product of x^power; without factors a constant.
    Product {
        /// deg/s.
        gain_dps: f64,
        /// (input, power); powers 1 ..= 9.
        factors: Vec<(usize, u32)>,
    },
    /// gain * (x - y), tau dy/dt = x - y, exact for an input that is linear between readings; y = x at
    /// the first reading after power-on.
    Lag {
        /// deg/s.
        gain_dps: f64,
        /// x.
        input: usize,
        /// tau, s.
        tau_s: f64,
        /// y = x at the very first reading only: the state outlives a restart, as the gyro's own
        /// temperature does that of its firmware, and goes on through the time without power
        /// ([`crate::correction::schedule`]); where nobody tells that, it counts as one period.
        kept: bool,
    },
    /// The same of c(x), the curve through equidistant knots over -1 ..= 1, linear between them.
    LagOfCurve {
        /// deg/s.
        gain_dps: f64,
        /// x.
        input: usize,
        /// c at the knots, 1.
        values: Vec<f64>,
        /// tau, s.
        tau_s: f64,
        /// As in [`Term::Lag`].
        kept: bool,
    },
    /// gain * (c(x) - c(y)), y behind x as in [`Term::Lag`], c as in [`Term::LagOfCurve`]: an effect of a
    /// temperature that lags, where a lag of c(x) would be an effect that itself lags.
    CurveOfLag {
        /// deg/s.
        gain_dps: f64,
        /// x.
        input: usize,
        /// c at the knots, 1.
        values: Vec<f64>,
        /// tau of y, s.
        tau_s: f64,
        /// As in [`Term::Lag`].
        kept: bool,
    },
    /// gain * (x now - x `rows` readings ago) / (rows * period); 0 at the first reading.
    Slope {
        /// deg/s per 1/s.
        gain_dps_s: f64,
        /// x.
        input: usize,
        /// Readings.
        rows: u32,
    },
    /// gain * exp(-t / tau), t since power-on in nominal periods.
    Decay {
        /// deg/s.
        gain_dps: f64,
        /// tau, s.
        tau_s: f64,
    },
    /// c(x) as in [`Term::LagOfCurve`], in deg/s.
    Curve {
        /// x.
        input: usize,
        /// c at the knots, deg/s.
        values_dps: Vec<f64>,
    },
    /// gain while the relay is on: on from x >= centre + gap/2, off from x < centre - gap/2, else as
    /// before; at power-on, on where x >= centre.
    Step {
        /// deg/s.
        gain_dps: f64,
        /// x.
        input: usize,
        /// In x.
        centre: f64,
        /// In x; not negative.
        gap: f64,
        /// Never off again, not even by a restart, once it was on; off before the first time.
        once: bool,
    },
    /// Error r (s0 + s1 x + s2 x^2).
    ScaleBy {
        /// x; `None`: s1 and s2 are not used.
        input: Option<usize>,
        /// 1.
        s0: f64,
        /// 1 per unit of x.
        s1: f64,
        /// 1 per unit of x^2.
        s2: f64,
    },
    /// Error ppm 1e-6 r (r / rate_max)^2.
    Cubic {
        /// Parts per million of the rate at `rate_max_dps`.
        ppm: f64,
        /// deg/s.
        rate_max_dps: f64,
    },
    /// Error ppm 1e-6 r^2 / rate_max, or with `absolute` ppm 1e-6 abs(r).
    Even {
        /// Parts per million of the rate at `rate_max_dps`.
        ppm: f64,
        /// deg/s.
        rate_max_dps: f64,
        /// abs(r) in place of r^2 / rate_max.
        absolute: bool,
    },
}

/// A plan and the noise that its words are chosen for: the table `[correction]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The plan.
    pub plan: Plan,
    /// Noise of a reading, deg/s rms.
    pub noise_dps: f64,
    /// What its firmware leaves of readings that its coefficients have not seen, deg/s rms; `None` where nobody measured it.
    pub heldout_rms_dps: Option<f64>,
}

/// The noise of a reading that words are chosen for if nothing else is said, in full scales: 1e-3 deg/s
/// at 500 deg/s.
pub const NOISE_PER_FULL_SCALE: f64 = 2e-6;
