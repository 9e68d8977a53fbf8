//! The processors that firmware is priced for.

use serde::Serialize;

/// A processor to estimate cycles for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Target {
    /// A 64-bit processor.
    #[default]
    Host,
    /// 32 bits with a single-cycle 32 x 32 -> 64 bit multiplier.
    CortexM4,
    /// 32 bits with a 32 x 32 -> 32 bit multiplier of many cycles and none for the upper half.
    CortexM0,
    /// RV32IM.
    Riscv32,
}

impl Target {
    /// As the command line and a design file spell it.
    pub fn name(self) -> &'static str {
        match self {
            Target::Host => "host",
            Target::CortexM4 => "cortex-m4",
            Target::CortexM0 => "cortex-m0",
            Target::Riscv32 => "riscv32",
        }
    }
}
