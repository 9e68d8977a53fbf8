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

    /// The target of that name; `riscv32` is another one for `rv32imc`.
    pub fn of_name(name: &str) -> Option<Target> {
        let same = |t: &Target| t.name() == name || (*t == Target::Rv32imc && name == "riscv32");
        Target::ALL.into_iter().find(same)
    }
}
