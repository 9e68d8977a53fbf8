//! The keys of a design, and which designs are refused.

use super::number::{CastTo, Format};

/// `[circuit.nco]`
#[derive(Clone, Debug)]
pub struct Nco {
    pub phase_bits: u32,
    pub tuning_word: i64,
    pub address_bits: u32,
    /// `address_rounding = "half_up"`, else `"floor"`.
    pub address_half_up: bool,
    pub table: Format,
}

/// `[circuit.cordic]`
#[derive(Clone, Debug)]
pub struct Cordic {
    pub iterations: u32,
    pub guard_bits: u32,
    pub width: u32,
    pub angle_bits: u32,
    pub gain_bits: u32,
}

/// `{ raw = .., shift = .. }`
#[derive(Clone, Copy, Debug)]
pub struct Gain {
    pub raw: i64,
    pub shift: u32,
}

/// `[circuit.phase_loop]`
#[derive(Clone, Debug)]
pub struct PhaseLoop {
    pub setpoint_raw: i64,
    pub proportional: Gain,
    pub integral: Gain,
    pub integrator_bits: u32,
}

/// `[circuit.amplitude_loop]`
#[derive(Clone, Debug)]
pub struct AmplitudeLoop {
    pub setpoint_raw: i64,
    pub error_shift: u32,
    pub integrator_shift: u32,
    pub initial_raw: i64,
    pub gain_bits: u32,
}

impl AmplitudeLoop {
    /// Greatest gain; the least is 0.
    pub fn greatest_gain(&self) -> i128 {
        (1i128 << (self.gain_bits - 1)) - 1
    }

    /// Greatest integrator; the least is 0.
    pub fn greatest_integrator(&self) -> i128 {
        self.greatest_gain() << self.integrator_shift
    }
}

/// `input` of `[compensation]`: what the polynomial's variable is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thermometer {
    /// The CORDIC's phase in half turns.
    Phase,
    /// What the phase loop has added to the design's tuning word for the samples of this row:
    /// (the least residue in magnitude - offset) * 2^-scale.
    TuningWord { offset_raw: i64, scale_bits: u32 },
}

/// `[compensation]`
#[derive(Clone, Debug)]
pub struct Compensation {
    pub input: Thermometer,
    pub coefficients_raw: Vec<i64>,
    pub coefficient_format: Format,
    pub accumulator: CastTo,
    /// log2 of `rate_full_scale_dps`.
    pub rate_full_scale_log2: i32,
    pub output: CastTo,
}

/// A whole design.
#[derive(Clone, Debug)]
pub struct Design {
    pub sample_rate_hz: f64,
    pub adc: Format,
    pub nco: Nco,
    pub product: CastTo,
    pub stages: u32,
    pub ratio: u32,
    pub differential_delay: u32,
    pub output: CastTo,
    pub cordic: Cordic,
    pub phase_loop: Option<PhaseLoop>,
    pub amplitude_loop: Option<AmplitudeLoop>,
    pub compensation: Option<Compensation>,
}

/// A reason why a design must be refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What the message must name.
    pub key: &'static str,
    /// The sum of bits that the message must give, for a too wide intermediate.
    pub bits: Option<u32>,
}

/// What the contract says of a design before it runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It runs.
    Accepted,
    /// It is refused for any one of these reasons.
    Refused(Vec<Refusal>),
    /// The text does not decide it (a sum of a 127-bit operand): not tested.
    Undecided,
}

/// Supported bits of an exact intermediate.
const WIDEST: u32 = 127;

impl Design {
    /// G, the least integer with 2^G >= (R M)^N.
    pub fn growth_bits(&self) -> u32 {
        let gain = u128::from(self.ratio * self.differential_delay).pow(self.stages);
        (0..).find(|&g| (1u128 << g) >= gain).expect("at most 78")
    }

    /// Bits of the sums of step 3: those of the product, one more if it is
    /// unsigned, and G.
    pub fn sum_bits(&self) -> u32 {
        self.product.format.operand_bits() + self.growth_bits()
    }

    /// Bits of the polynomial's variable, two's complement, and how many of them are fraction.
    pub fn variable(&self, compensation: &Compensation) -> (u32, u32) {
        match compensation.input {
            Thermometer::Phase => (self.cordic.angle_bits, self.cordic.angle_bits - 1),
            Thermometer::TuningWord {
                offset_raw,
                scale_bits,
            } => {
                let half = 1i128 << (self.nco.phase_bits - 1);
                let ends = [-half, half - 1].map(|end| end - i128::from(offset_raw));
                let holds = |bits: u32| {
                    let half = 1i128 << (bits - 1);
                    ends.iter().all(|end| (-half..half).contains(end))
                };
                let bits = (1..=66).find(|&bits| holds(bits)).expect("64 bits less 64");
                (bits, scale_bits)
            }
        }
    }

    /// Every exact intermediate that a cast takes: the cast's key and the bits,
    /// counted on the formats.
    pub fn intermediates(&self) -> Vec<Refusal> {
        let mut list = Vec::new();
        let mut add = |key, operand_bits: u32, fraction_bits: i64, to: Format| {
            // A cast to more fraction bits shifts left before it overflows.
            let left = (i64::from(to.n) - fraction_bits).max(0);
            let bits = Some(operand_bits + u32::try_from(left).expect("a small shift"));
            list.push(Refusal { key, bits });
        };
        add(
            "circuit.demodulator.product",
            self.adc.bits() + self.nco.table.bits(),
            i64::from(self.adc.n + self.nco.table.n),
            self.product.format,
        );
        add(
            "circuit.decimator.output",
            self.sum_bits(),
            i64::from(self.product.format.n + self.growth_bits()),
            self.output.format,
        );
        if let Some(compensation) = &self.compensation {
            let accumulator = compensation.accumulator.format;
            if compensation.coefficients_raw.len() > 2 {
                let (bits, fraction) = self.variable(compensation);
                add(
                    "compensation.accumulator",
                    accumulator.operand_bits() + bits,
                    i64::from(accumulator.n + fraction),
                    accumulator,
                );
            }
            add(
                "compensation.output",
                accumulator.operand_bits(),
                i64::from(accumulator.n),
                compensation.output.format,
            );
            add(
                "compensation.output",
                self.output.format.operand_bits(),
                i64::from(self.output.format.n) - i64::from(compensation.rate_full_scale_log2),
                compensation.output.format,
            );
        }
        list
    }

    /// Greatest number of bits of the `intermediates`.
    pub fn widest(&self) -> u32 {
        let all = self.intermediates();
        all.iter().filter_map(|it| it.bits).max().expect("some")
    }

    /// Whether the design is to be accepted.
    pub fn verdict(&self) -> Verdict {
        let mut reasons: Vec<Refusal> = self
            .intermediates()
            .into_iter()
            .filter(|it| it.bits > Some(WIDEST))
            .collect();
        if let Some(compensation) = &self.compensation {
            if !compensation.coefficients_fit() {
                reasons.push(Refusal {
                    key: "compensation",
                    bits: None,
                });
            }
            // q - bias and c_k + inner: the text counts no bit for a sum, and
            // the wide shift of a coefficient is under no cast of its own.
            let sum_at_the_edge = self
                .intermediates()
                .iter()
                .any(|it| it.key == "compensation.output" && it.bits == Some(WIDEST));
            let coefficient_bits = compensation.coefficient_format.operand_bits()
                + compensation
                    .accumulator
                    .format
                    .n
                    .saturating_sub(compensation.coefficient_format.n);
            // With two coefficients the only product is c_1 p, "exact": the
            // text does not say in which of the two formats it is counted.
            let only_product =
                compensation.accumulator.format.operand_bits() + self.variable(compensation).0;
            let product_at_the_edge =
                compensation.coefficients_raw.len() == 2 && only_product > WIDEST;
            let undecided = sum_at_the_edge || product_at_the_edge || coefficient_bits >= WIDEST;
            if reasons.is_empty() && undecided {
                return Verdict::Undecided;
            }
        }
        if reasons.is_empty() {
            Verdict::Accepted
        } else {
            Verdict::Refused(reasons)
        }
    }

    /// Names of the columns of `replay`, in order.
    pub fn columns(&self) -> Vec<&'static str> {
        let mut names = vec![
            "index",
            "drive_i",
            "drive_q",
            "sense_i",
            "sense_q",
            "phase",
            "magnitude",
        ];
        if self.compensation.is_some() {
            names.push("rate");
        }
        if self.phase_loop.is_some() {
            names.push("tuning_word");
        }
        if self.amplitude_loop.is_some() {
            names.push("gain");
        }
        names
    }
}

impl Compensation {
    /// False when the format has more fraction bits than the accumulator, or the
    /// accumulator cannot hold a coefficient.
    pub fn coefficients_fit(&self) -> bool {
        let (from, to) = (self.coefficient_format, self.accumulator.format);
        from.n <= to.n
            && self
                .coefficients_raw
                .iter()
                .all(|&c| to.holds(i128::from(c) << (to.n - from.n)))
    }
}
