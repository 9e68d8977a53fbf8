//! The chain bit for bit, one step of the text after the other.

use std::collections::VecDeque;

use super::constants;
use super::design::{Compensation, Design, Thermometer};
use super::number::{CastTo, wrap};

/// One decimated sample.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// drive I, drive Q, sense I, sense Q.
    pub channels: [i128; 4],
    pub phase: i128,
    pub magnitude: i128,
    pub rate: Option<i128>,
    pub tuning_word: Option<i128>,
    pub gain: Option<i128>,
}

impl Row {
    /// The row as integers in the order of the columns.
    pub fn values(&self, index: usize) -> Vec<i128> {
        let mut values = vec![index as i128];
        values.extend(self.channels);
        values.extend([self.phase, self.magnitude]);
        values.extend(self.rate);
        values.extend(self.tuning_word);
        values.extend(self.gain);
        values
    }
}

/// An overflow of a cast with `overflow = "error"`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stop {
    /// 0-based ADC sample.
    pub sample: usize,
    /// Dotted key, with the channel where there is one.
    pub node: String,
    /// Raw operands; t is a raw value of the accumulator's format.
    pub operands: Vec<i128>,
    /// Where t is still c_n, "exact" and not cast: its raw value in
    /// `coefficient_format`, which serves as well for the first operand.
    pub as_coefficient: Option<i128>,
}

/// Names of the channels, in the order of the text.
pub const CHANNELS: [&str; 4] = ["drive_i", "drive_q", "sense_i", "sense_q"];

/// N integrators, and N combs with delay M.
struct Cic {
    integrators: Vec<i128>,
    combs: Vec<VecDeque<i128>>,
    bits: u32,
}

impl Cic {
    fn new(design: &Design) -> Self {
        let stages = design.stages as usize;
        let delay_line = VecDeque::from(vec![0; design.differential_delay as usize]);
        Self {
            integrators: vec![0; stages],
            combs: vec![delay_line; stages],
            bits: design.sum_bits(),
        }
    }

    fn integrate(&mut self, product: i128) {
        let mut input = product;
        for integrator in &mut self.integrators {
            *integrator = wrap(*integrator + input, self.bits);
            input = *integrator;
        }
    }

    fn comb(&mut self) -> i128 {
        let mut value = *self.integrators.last().expect("at least one stage");
        for delay_line in &mut self.combs {
            let delayed = delay_line.pop_front().expect("M values");
            delay_line.push_back(value);
            value = wrap(value - delayed, self.bits);
        }
        value
    }
}

/// The constants of CORDIC.
struct CordicConstants {
    atan: Vec<i128>,
    magnitude: i128,
}

/// Step 5: (phase, magnitude) of (drive I, drive Q).
fn cordic(design: &Design, constants: &CordicConstants, i: i128, q: i128) -> (i128, i128) {
    let cordic = &design.cordic;
    let word = |v: i128| wrap(v, cordic.width);
    let angle = |v: i128| wrap(v, cordic.angle_bits);
    let quarter_turn = 1i128 << (cordic.angle_bits - 2);
    let mut x = word(i << cordic.guard_bits);
    let mut y = word(q << cordic.guard_bits);
    let mut z = 0i128;
    if x < 0 {
        if y >= 0 {
            (x, y, z) = (y, word(-x), quarter_turn);
        } else {
            (x, y, z) = (word(-y), x, -quarter_turn);
        }
    }
    for (i, &atan) in constants.atan.iter().enumerate() {
        let (dx, dy) = (y >> i, x >> i);
        if y >= 0 {
            (x, y, z) = (word(x + dx), word(y - dy), angle(z + atan));
        } else {
            (x, y, z) = (word(x - dx), word(y + dy), angle(z - atan));
        }
    }
    let shift = cordic.guard_bits + cordic.gain_bits;
    let magnitude = (x * constants.magnitude + (1i128 << (shift - 1))) >> shift;
    (z, wrap(magnitude, 64))
}

/// An overflow in step 6: node, operands, and c_n where it is the first of them.
type CompensationStop = (&'static str, Vec<i128>, Option<i128>);

/// Step 6: the rate, or the node and operands of an overflow.
fn compensate(
    design: &Design,
    compensation: &Compensation,
    p: i128,
    sense_i: i128,
) -> Result<i128, CompensationStop> {
    let accumulator = &compensation.accumulator;
    let fraction = i64::from(accumulator.format.n);
    let align = accumulator.format.n - compensation.coefficient_format.n;
    let mut coefficients = compensation.coefficients_raw.iter().rev();
    let last = *coefficients.next().expect("at least one coefficient");
    let mut t = i128::from(last) << align;
    let mut exact = Some(i128::from(last));
    for &c in coefficients {
        let c = i128::from(c);
        let node = "compensation.accumulator";
        let product_fraction = fraction + i64::from(design.variable(compensation).1);
        let inner = accumulator
            .cast(t * p, product_fraction)
            .map_err(|_| (node, vec![t, p], exact))?;
        t = accumulator
            .cast((c << align) + inner, fraction)
            .map_err(|_| (node, vec![c, inner], None))?;
        exact = None;
    }
    let node = "compensation.output";
    let output = &compensation.output;
    let bias = output
        .cast(t, fraction)
        .map_err(|_| (node, vec![t], exact))?;
    let scaled_fraction =
        i64::from(design.output.format.n) - i64::from(compensation.rate_full_scale_log2);
    let q = output.round(sense_i, scaled_fraction);
    output
        .overflow(q - bias)
        .map_err(|_| (node, vec![q, bias], None))
}

/// The top a bits of the phase, after the optional half step.
fn address(design: &Design, phase: u128) -> usize {
    let nco = &design.nco;
    let dropped = nco.phase_bits - nco.address_bits;
    let mut phase = phase;
    if nco.address_half_up && dropped > 0 {
        phase = (phase + (1u128 << (dropped - 1))) % (1u128 << nco.phase_bits);
    }
    (phase >> dropped) as usize
}

/// Casts the value of a channel, naming the node when it overflows.
fn cast_channel(
    cast: &CastTo,
    (value, fraction): (i128, i64),
    (sample, node, channel): (usize, &str, usize),
    operands: &[i128],
) -> Result<i128, Stop> {
    cast.cast(value, fraction).map_err(|_| Stop {
        sample,
        node: format!("{node} {}", CHANNELS[channel]),
        operands: operands.to_vec(),
        as_coefficient: None,
    })
}

/// Runs captured `(drive, sense)` codes through an accepted design.
pub fn replay(design: &Design, capture: &[(i64, i64)]) -> Result<Vec<Row>, Stop> {
    let table = constants::sine_table(design.nco.table, design.nco.address_bits);
    let constants = CordicConstants {
        atan: constants::atan_table(design.cordic.iterations, design.cordic.angle_bits),
        magnitude: constants::magnitude_constant(design.cordic.iterations, design.cordic.gain_bits),
    };
    let modulus = 1i128 << design.nco.phase_bits;
    let product_fraction = i64::from(design.adc.n + design.nco.table.n);
    let sum_fraction = i64::from(design.product.format.n + design.growth_bits());
    let given_word = i128::from(design.nco.tuning_word);

    let mut tuning_word = given_word.rem_euclid(modulus);
    let mut phase = 0i128;
    let mut filters: Vec<Cic> = CHANNELS.iter().map(|_| Cic::new(design)).collect();
    let mut loop_integrator = 0i128;
    let mut amplitude_integrator = match &design.amplitude_loop {
        Some(amplitude) => i128::from(amplitude.initial_raw),
        None => 0,
    };
    let mut rows = Vec::new();
    for (n, &(drive, sense)) in capture.iter().enumerate() {
        // 1. NCO
        phase = (phase + tuning_word) % modulus;
        let k = address(design, phase as u128);
        let sin = table[k];
        let cos = table[(k + table.len() / 4) % table.len()];
        // 2. products
        let factors = [(drive, sin), (drive, cos), (sense, sin), (sense, cos)];
        let mut products = [0i128; 4];
        for (channel, &(code, entry)) in factors.iter().enumerate() {
            let code = i128::from(code);
            products[channel] = cast_channel(
                &design.product,
                (code * entry, product_fraction),
                (n, "circuit.demodulator.product", channel),
                &[code, entry],
            )?;
        }
        // 3. integrators
        for (filter, &product) in filters.iter_mut().zip(&products) {
            filter.integrate(product);
        }
        if !(n + 1).is_multiple_of(design.ratio as usize) {
            continue;
        }
        // 4. combs
        let mut channels = [0i128; 4];
        for (channel, filter) in filters.iter_mut().enumerate() {
            let s = filter.comb();
            channels[channel] = cast_channel(
                &design.output,
                (s, sum_fraction),
                (n, "circuit.decimator.output", channel),
                &[s],
            )?;
        }
        // 5. CORDIC
        let (angle, magnitude) = cordic(design, &constants, channels[0], channels[1]);
        // 6. compensation
        let rate = match &design.compensation {
            Some(compensation) => {
                let p = match compensation.input {
                    Thermometer::Phase => angle,
                    // The word that the row's samples were mixed with: step 7 comes after.
                    Thermometer::TuningWord { offset_raw, .. } => {
                        wrap(tuning_word - given_word, design.nco.phase_bits)
                            - i128::from(offset_raw)
                    }
                };
                let result = compensate(design, compensation, p, channels[2]);
                Some(result.map_err(|(node, operands, as_coefficient)| Stop {
                    sample: n,
                    node: node.to_owned(),
                    operands,
                    as_coefficient,
                })?)
            }
            None => None,
        };
        // 7. loops, effective from the next sample
        let next_word = design.phase_loop.as_ref().map(|control| {
            let e = wrap(
                angle - i128::from(control.setpoint_raw),
                design.cordic.angle_bits,
            );
            loop_integrator = wrap(loop_integrator + e, control.integrator_bits);
            let proportional =
                (i128::from(control.proportional.raw) * e) >> control.proportional.shift;
            let integral =
                (i128::from(control.integral.raw) * loop_integrator) >> control.integral.shift;
            (given_word + proportional + integral).rem_euclid(modulus)
        });
        tuning_word = next_word.unwrap_or(tuning_word);
        let gain = design.amplitude_loop.as_ref().map(|control| {
            let ea = i128::from(control.setpoint_raw) - magnitude;
            amplitude_integrator =
                (amplitude_integrator + ea).clamp(0, control.greatest_integrator());
            let sum =
                (ea >> control.error_shift) + (amplitude_integrator >> control.integrator_shift);
            sum.clamp(0, control.greatest_gain())
        });
        rows.push(Row {
            channels,
            phase: angle,
            magnitude,
            rate,
            tuning_word: next_word,
            gain,
        });
    }
    Ok(rows)
}
