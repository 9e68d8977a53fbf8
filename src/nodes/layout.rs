//! The nodes of a design: names, units and formats, in the order of the circuit's steps.

use super::node::{Identity, UNLIMITED};
use crate::circuit::CHANNELS;
use crate::design::Design;
use crate::numeric::format::{Format, Overflow, Quantizer, pow2};

/// Nodes that are no casts.
#[derive(Debug, Clone, Copy, Default)]
pub struct Places {
    /// Table, sine; cosine follows.
    pub sine: usize,
    /// Products by channel.
    pub product: usize,
    /// Decimators by channel.
    pub decimator: usize,
    /// CORDIC phase; magnitude follows.
    pub phase: usize,
    /// The Horner steps' first node, and how many there are.
    pub horner: Option<(usize, usize)>,
    /// Bias; the rate's input and the rate follow.
    pub bias: Option<usize>,
    /// Integral; tuning word follows.
    pub phase_loop: Option<usize>,
    /// Integrator; gain follows.
    pub amplitude_loop: Option<usize>,
}

/// Identities and where they are.
#[derive(Debug, Clone)]
pub struct Layout {
    /// In the order of the steps.
    pub identities: Vec<Identity>,
    /// Where.
    pub places: Places,
}

impl Layout {
    /// Of a design's chain.
    pub fn new(design: &Design) -> Self {
        let mut layout = Layout {
            identities: Vec::new(),
            places: Places::default(),
        };
        layout.fast(design);
        layout.slow(design);
        layout
    }

    fn push(&mut self, name: String, unit: &'static str, fraction_bits: i32, limits: (i128, i128)) {
        self.identities.push(Identity {
            name,
            unit,
            fraction_bits,
            limits,
            step: 0.25 * pow2(-fraction_bits),
        });
    }

    fn quantized(&mut self, name: String, unit: &'static str, q: Quantizer) {
        let low = match q.overflow {
            Overflow::SaturateSymmetric if q.format.signed => -q.format.max_raw(),
            _ => q.format.min_raw(),
        };
        let bits = q.format.fraction_bits as i32;
        self.push(name, unit, bits, (low, q.format.max_raw()));
    }

    fn fast(&mut self, design: &Design) {
        let circuit = &design.circuit;
        let table: Format = circuit.nco.table;
        for part in ["sine", "cosine"] {
            let limits = (-table.max_raw(), table.max_raw());
            let bits = table.fraction_bits as i32;
            self.push(format!("circuit.nco.table {part}"), "1", bits, limits);
        }
        self.places.product = self.identities.len();
        for channel in CHANNELS {
            let name = format!("circuit.demodulator.product {channel}");
            self.quantized(name, "1", circuit.demodulator.product);
        }
        self.places.decimator = self.identities.len();
        for channel in CHANNELS {
            let name = format!("circuit.decimator.output {channel}");
            self.quantized(name, "1", circuit.decimator.output);
        }
    }

    fn slow(&mut self, design: &Design) {
        let circuit = &design.circuit;
        let signed = |bits: u32| (-(1i128 << (bits - 1)), (1i128 << (bits - 1)) - 1);
        self.places.phase = self.identities.len();
        let angle = circuit.cordic.angle_bits;
        self.push(
            "circuit.cordic phase".into(),
            "turn",
            angle as i32,
            signed(angle),
        );
        if let Some(phase) = self.identities.last_mut() {
            // The CORDIC leaves an angle of up to atan(2^-(n-1)), which is mostly more than an LSB.
            let left = pow2(1 - circuit.cordic.iterations as i32) / std::f64::consts::TAU;
            phase.step = phase.step.max(0.25 * left);
        }
        let f = circuit.decimator.output.format.fraction_bits as i32;
        // What x can hold without wrapping, in the output's LSB.
        let width = (circuit.cordic.width as i32 - circuit.cordic.guard_bits as i32).max(1);
        let magnitude = signed(width as u32);
        self.push("circuit.cordic magnitude".into(), "1", f, magnitude);
        if let Some(c) = &design.compensation
            && c.input.is_of_chain()
        {
            let steps = match c.form {
                Some(_) => 0,
                None => c.coefficients_raw.len().saturating_sub(1),
            };
            self.places.horner = Some((self.identities.len(), steps));
            for k in (0..steps).rev() {
                for part in ["inner", "outer"] {
                    let name = format!("compensation.accumulator {part} {k}");
                    self.quantized(name, "deg/s", c.accumulator);
                }
            }
            self.places.bias = Some(self.identities.len());
            self.quantized("compensation.output bias".into(), "deg/s", c.output);
            let bits = c.output.format.fraction_bits as i32;
            self.push("compensation.output input".into(), "deg/s", bits, UNLIMITED);
            self.quantized("compensation.output rate".into(), "deg/s", c.output);
        }
        if let Some(l) = &circuit.phase_loop {
            self.places.phase_loop = Some(self.identities.len());
            let name = "circuit.phase_loop.integrator_bits".into();
            self.push(name, "phase LSB", 0, signed(l.integrator_bits));
            let w = circuit.nco.phase_bits;
            let limits = (0, (1i128 << w) - 1);
            self.push(
                "circuit.phase_loop tuning_word".into(),
                "turn/sample",
                w as i32,
                limits,
            );
        }
        if let Some(l) = &circuit.amplitude_loop {
            self.places.amplitude_loop = Some(self.identities.len());
            let name = "circuit.amplitude_loop integrator".into();
            self.push(name, "magnitude LSB", 0, (0, l.integrator_limit()));
            let limits = (0, l.gain_limit());
            self.push("circuit.amplitude_loop gain".into(), "gain LSB", 0, limits);
        }
    }
}
