//! Ranges of real numbers that a key takes.

/// Which reals a key takes (never a NaN or an infinity).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Real {
    /// Every one.
    Any,
    /// Above 0.
    Positive,
    /// 0 or above.
    NotNegative,
    /// A Celsius temperature above absolute zero.
    Celsius,
    /// From the first to the second, both included.
    Within(f64, f64),
    /// Whole numbers from the first to the second, both included.
    Whole(f64, f64),
}

impl Real {
    /// True if `x`, which is finite, is one of them.
    pub fn accepts(self, x: f64) -> bool {
        match self {
            Real::Any => true,
            Real::Positive => x > 0.0,
            Real::NotNegative => x >= 0.0,
            Real::Celsius => x > -273.15,
            Real::Within(low, high) => x >= low && x <= high,
            Real::Whole(low, high) => x >= low && x <= high && x.fract() == 0.0,
        }
    }

    /// What they are, in words: "it has to be {rule}".
    pub fn rule(self) -> String {
        match self {
            Real::Any => "finite".to_owned(),
            Real::Positive => "positive".to_owned(),
            Real::NotNegative => "zero or positive".to_owned(),
            Real::Celsius => "above absolute zero, -273.15 degC".to_owned(),
            Real::Within(low, high) => format!("{low} to {high}"),
            Real::Whole(low, high) => format!("a whole number from {low} to {high}"),
        }
    }
}
