//! Which axis of a gyro with three an autopilot's log is read for.

/// An axis of a gyro with three.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum LogAxis {
    /// The first.
    X,
    /// The second.
    Y,
    /// The third.
    #[default]
    Z,
}

impl LogAxis {
    /// 0, 1 or 2.
    pub fn index(self) -> usize {
        match self {
            LogAxis::X => 0,
            LogAxis::Y => 1,
            LogAxis::Z => 2,
        }
    }

    /// `x`, `y` or `z`.
    pub fn name(self) -> &'static str {
        ["x", "y", "z"][self.index()]
    }
}
