//! Signals and their words.

/// Signals on one clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// ADC samples per second, Hz; above 0.
    pub sample_rate_hz: f64,
    /// 0-based ADC sample at which the trace begins; sample n is at n / sample_rate_hz seconds.
    pub first_sample: u64,
    /// In the order of the file's columns.
    pub signals: Vec<Signal>,
}

/// The values of one node at its own rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Dotted key and channel, such as `circuit.decimator.output drive_i`.
    pub name: String,
    /// Unit of a value, such as `deg/s` or `2^-15`; empty = none is written.
    pub unit: String,
    /// Samples between values: 1 = each ADC sample, R = each row. Value k (from 0) belongs to
    /// sample `first_sample + (k + 1) * every - 1`.
    pub every: u32,
    /// The values.
    pub values: Values,
}

/// What a signal's values are.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Raw words of `bits` bits, 1 to 64, signed or unsigned: -2^(bits-1) ..= 2^bits - 1.
    Integer {
        /// Width of the word.
        bits: u32,
        /// Raw.
        values: Vec<i64>,
    },
    /// Reals, in the signal's unit.
    Real(Vec<f64>),
}

impl Values {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Values::Integer { values, .. } => values.len(),
            Values::Real(values) => values.len(),
        }
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Signal {
    /// `name [unit]`, or the name alone.
    pub(crate) fn title(&self) -> String {
        match self.unit.as_str() {
            "" => self.name.clone(),
            unit => format!("{} [{unit}]", self.name),
        }
    }
}
