//! The processors that firmware is priced for.

use serde::Serialize;

/// A processor to estimate instructions and cycles for.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Target {
    /// A 64-bit processor.
    #[default]
    Host,
    /// ARMv7E-M: 32 bits with a single-cycle 32 x 32 to 64 bit multiplier.
    CortexM4,
    /// ARMv6-M: 32 bits with a 32-cycle 32 x 32 to 32 bit multiplier and none for the upper half.
    CortexM0,
    /// The same with the single-cycle multiplier.
    CortexM0Fast,
    /// 32-bit RISC-V with multiplication and compressed instructions, as Ibex executes it.
    Rv32imc,
    /// A 16-bit signal processor.
    Dsp16,
}

impl Target {
    /// All of them.
    pub const ALL: [Target; 6] = [
        Target::Host,
        Target::CortexM4,
        Target::CortexM0,
        Target::CortexM0Fast,
        Target::Rv32imc,
        Target::Dsp16,
    ];

    /// As the command line and a design file spell it.
    pub fn name(self) -> &'static str {
        match self {
            Target::Host => "host",
            Target::CortexM4 => "cortex-m4",
            Target::CortexM0 => "cortex-m0",
            Target::CortexM0Fast => "cortex-m0-fast",
            Target::Rv32imc => "rv32imc",
            Target::Dsp16 => "dsp16",
        }
    }

    /// Every name that is taken with its target: that of [`Target::name`], and `riscv32` for `rv32imc`.
    pub fn named() -> impl Iterator<Item = (&'static str, Target)> {
        let named = Target::ALL.into_iter().map(|t| (t.name(), t));
        named.chain([("riscv32", Target::Rv32imc)])
    }

    /// The target of that name.
    pub fn of_name(name: &str) -> Option<Target> {
        Target::named().find(|(n, _)| *n == name).map(|(_, t)| t)
    }
}
