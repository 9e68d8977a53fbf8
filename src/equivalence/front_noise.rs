//! Predicted rms at the sample rate and behind the decimator: table, products, decimators.

use super::predicted::{DOUBTFUL, ENOUGH_WORDS, Prediction, Theory, set};
use crate::nodes::node::Node;
use crate::nodes::quantisation::{Moments, Spread};
use crate::numeric::format::{Rounding, pow2};

/// Mean square errors of a decimator's output, with what of it the table's errors make.
#[derive(Debug, Clone, Default)]
pub(super) struct Channel {
    /// White part, variance.
    pub(super) white: f64,
    /// Mean of the roundings.
    pub(super) mean: f64,
    /// Mean square of the part that the tone and the table make together.
    pub(super) following: f64,
    /// Of the white part, what may not be white.
    pub(super) doubtful: f64,
    pub(super) flags: Vec<&'static str>,
}

/// A rounding toward zero pulls words of one sign one way: its mean is that of the signs.
pub(super) fn with_sign(own: Moments, rounding: Rounding, node: Option<&Node>) -> Moments {
    let (Rounding::TowardZero, Some(node)) = (rounding, node) else {
        return own;
    };
    // Of a directed rounding: square = (1 - q)(2 - q) / 6, mean (1 - q) / 2.
    let q = (3.0 - (1.0 + 24.0 * own.square).sqrt()) / 2.0;
    let sign = -node.balance as f64 / node.count.max(1) as f64;
    Moments {
        mean: sign * (1.0 - q) / 2.0,
        ..own
    }
}

impl Theory<'_> {
    /// Mean square of a product's error but its own rounding: code * table error; and its mean.
    fn carried(&self, channel: usize) -> (f64, f64) {
        let pair = channel / 2;
        let at = self.seen.places.product + 2 * pair;
        let a2 = self.table.amplitude * self.table.amplitude;
        let (i, q) = (self.mean_square(at), self.mean_square(at + 1));
        let count = self.node(at).map_or(1, |n| n.count).max(1) as f64;
        let cross = self.activity.product_cross[pair] / count;
        // E[d^2 | theta] = m0 + mc cos 2 theta + ms sin 2 theta, from E[d^2 sin^2] = i / A^2 and so on.
        let (m0, mc, ms) = ((i + q) / a2, 2.0 * (q - i) / a2, 4.0 * cross / a2);
        let e = self.table.square[channel % 2];
        let square = (m0 * e[0] + mc * e[1] + ms * e[2]).max(0.0);
        (square, m0)
    }

    /// Own rounding of a product, in its unit.
    fn product_rounding(&self, channel: usize) -> Moments {
        let circuit = &self.design.circuit;
        let product = circuit.demodulator.product;
        let exact = circuit.adc.format.fraction_bits + circuit.nco.table.fraction_bits;
        let bits = exact as i32 - product.format.fraction_bits as i32;
        let zeros = &self.activity.code_zeros[channel / 2];
        self.table
            .product_rounding(channel % 2, zeros, product.rounding, bits)
    }

    fn rounding_is_spread(&self, channel: usize) -> bool {
        // A peak entry is 2^m - 1: its products repeat the code's bits. One entry of P / 2 is a peak.
        let structured = self.spread.places() < 32.0;
        let many = self.activity.pairs[channel / 2].count() >= ENOUGH_WORDS;
        self.product_rounding(channel).square == 0.0 || many && !structured
    }

    pub(super) fn fast(&self, all: &mut [Prediction]) {
        let places = self.seen.places;
        let nco = self.nco_flags();
        for part in 0..2 {
            set(all, places.sine + part, Some(self.table.rms(part)), &nco);
        }
        let lsb = self.design.circuit.demodulator.product.format.lsb();
        for channel in 0..4 {
            let at = places.product + channel;
            let own = self.product_rounding(channel);
            let mut flags = nco.clone();
            let spread = self.rounding_is_spread(channel);
            if !spread {
                flags.push("few_words");
            }
            let square = self.carried(channel).0 + own.square * lsb * lsb;
            set(all, at, Some(square.sqrt()), &flags);
            if let Some(p) = all.get_mut(at) {
                p.local_rms_lsb = (spread && own.square > 0.0).then(|| own.square.sqrt());
            }
        }
    }

    /// [mean I^2, mean Q^2, mean I Q] of a pair's float outputs.
    fn outputs(&self, pair: usize) -> [f64; 3] {
        let at = self.seen.places.decimator + 2 * pair;
        let count = self.node(at).map_or(1, |n| n.count).max(1) as f64;
        [
            self.mean_square(at),
            self.mean_square(at + 1),
            self.activity.output_cross[pair] / count,
        ]
    }

    /// What of a product's rounding may come through the decimator as lines, by its variance.
    ///
    /// Equal codes at equal phases round equally. With n codes at each of P phases, 1 / n of the power is in P lines (half
    /// as many if a half turn later code and entry are both the negative), and of those one or two may lie where the
    /// decimator passes them whole. A peak entry is 2^m - 1 and repeats the code's low bits: where the code spreads over
    /// less than them, the error at 2 of the P phases is one and the same.
    fn line_gain(&self, pair: usize) -> f64 {
        if self.spread == Spread::Many {
            return 0.0;
        }
        let circuit = &self.design.circuit;
        let pass = self.gain * self.gain;
        let places = self.spread.places();
        let codes = self.activity.codes_at_a_phase(pair);
        let lines = (4.0 * pass / places).max(self.noise_gain) / codes;
        let exact = circuit.adc.format.fraction_bits + circuit.nco.table.fraction_bits;
        let bits = exact as i32 - circuit.demodulator.product.format.fraction_bits as i32;
        let peaks = if codes < pow2(bits) {
            pass * (2.0 / places).powi(2)
        } else {
            0.0
        };
        lines + peaks
    }

    pub(super) fn decimators(&self, all: &mut [Prediction]) -> [Channel; 4] {
        std::array::from_fn(|channel| self.decimator(all, channel))
    }

    fn decimator(&self, all: &mut [Prediction], channel: usize) -> Channel {
        let circuit = &self.design.circuit;
        let at = self.seen.places.decimator + channel;
        let output = circuit.decimator.output;
        let product = circuit.demodulator.product.format;
        let (own_lsb, product_lsb) = (output.format.lsb(), product.lsb());
        let rounding = self.product_rounding(channel);
        let bits = product.fraction_bits as i32 + circuit.decimator.gain_bits() as i32
            - output.format.fraction_bits as i32;
        let own = Moments::of_rounding(output.rounding, bits);

        let [ii, qq, iq] = self.outputs(channel / 2);
        let amplitude = self.table.amplitude;
        let lines = &self.table.lines.square;
        let k = 2 * (channel % 2);
        let following = lines[k][k] * ii + lines[k + 1][k + 1] * qq + 2.0 * lines[k][k + 1] * iq;
        // The tone's power in the codes, from the outputs: I = A a g' / 2.
        let (_, code_square) = self.carried(channel);
        let tone = 2.0 * (ii + qq) / (amplitude * self.gain).powi(2);
        let noise = (code_square - tone).max(0.0) * self.table.square[channel % 2][0];
        let at_product = self.node(self.seen.places.product + channel);
        let quantizer = circuit.demodulator.product;
        let rounding = with_sign(rounding, quantizer.rounding, at_product);
        let own = with_sign(own, output.rounding, self.node(at));
        let product_noise = rounding.variance() * product_lsb * product_lsb;
        let doubtful = product_noise * self.line_gain(channel / 2);
        let white = (product_noise + noise) * self.noise_gain + own.variance() * own_lsb * own_lsb;
        let mean = rounding.mean * product_lsb * self.gain + own.mean * own_lsb;

        let mut flags = self.nco_flags();
        if !self.rounding_is_spread(channel) {
            flags.push("few_words");
        }
        if doubtful > DOUBTFUL * (white + following + mean * mean) {
            flags.push("carrier_lines");
        }
        let moving = self.moves(at);
        if own.square > 0.0 && !moving {
            flags.push("idle_input");
        }
        // Their product is small: a rounding's mean is at most half an LSB, of any sign beside the line's.
        let square = white + following + mean * mean;
        set(all, at, Some(square.sqrt()), &flags);
        if let Some(p) = all.get_mut(at) {
            p.local_rms_lsb = (own.square > 0.0 && moving).then(|| own.square.sqrt());
        }
        // What is doubtful here may weigh less, or more, where the errors meet.
        flags.retain(|f| !["coherent_nco", "near_coherent_nco", "carrier_lines"].contains(f));
        Channel {
            white,
            mean,
            following,
            doubtful,
            flags,
        }
    }
}
