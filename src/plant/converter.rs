//! The ADC.

/// An ideal ADC: nearest, ties toward plus infinity, saturating.
#[derive(Debug, Clone, Copy)]
pub struct Converter {
    low: f64,
    high: f64,
}

impl Converter {
    /// Of a width.
    pub fn new(bits: u32) -> Self {
        let full_scale = f64::powi(2.0, bits as i32 - 1);
        Converter {
            low: -full_scale,
            high: full_scale - 1.0,
        }
    }

    /// What the quantiser sees of an input, LSB.
    #[inline(always)]
    pub fn analog(&self, lsb: f64) -> f64 {
        lsb
    }

    /// The code of an input in LSB. The limits are integers, so limiting first changes nothing.
    #[inline(always)]
    pub fn code(&self, lsb: f64) -> i32 {
        let limited = lsb.max(self.low).min(self.high);
        let toward_zero = limited as i32;
        // Exact: at most 52 bits are left.
        let rest = limited - f64::from(toward_zero);
        toward_zero + i32::from(rest >= 0.5) - i32::from(rest < -0.5)
    }
}
