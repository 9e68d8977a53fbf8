//! The root mean square error of each node by the theory of quantisation.

/// What theory says of a node.
#[derive(Debug, Clone, Default)]
pub struct Prediction {
    /// rms of fixed - float, in the node's unit.
    pub rms: Option<f64>,
    /// rms of the node's own rounding, LSB.
    pub local_rms_lsb: Option<f64>,
    /// Conditions that do not hold.
    pub flags: Vec<&'static str>,
}
