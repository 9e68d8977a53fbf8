//! One number of a cost: what is to be small.

use super::{Cost, Target};

/// What each part of a cost weighs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Weights {
    /// A cycle for a row.
    pub cycle: f64,
    /// A byte of code.
    pub code_byte: f64,
    /// A byte of tables.
    pub rom_byte: f64,
    /// A byte of state.
    pub ram_byte: f64,
    /// A multiplier.
    pub multiplier_tile: f64,
    /// A bit of an adder.
    pub adder_bit: f64,
    /// A bit of selections, limits and shifters.
    pub logic_bit: f64,
    /// A bit of a register.
    pub register_bit: f64,
    /// A bit of tables.
    pub rom_bit: f64,
}

/// What is to be small, and on which processor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Objective {
    /// The processor of the cycles and bytes.
    pub target: Target,
    /// What they weigh.
    pub weights: Weights,
}

impl Objective {
    /// A microcontroller: cycles, and memory of which 32 bytes weigh as much as a cycle.
    pub fn controller(target: Target) -> Self {
        let byte = 1.0 / 32.0;
        Objective {
            target,
            weights: Weights {
                cycle: 1.0,
                code_byte: byte,
                rom_byte: byte,
                ram_byte: byte,
                ..Weights::default()
            },
        }
    }

    /// An FPGA, in lookup tables of six inputs: an adder's bit and a selection's are one, a multiplier weighs 200,
    /// a register's bit a half (there are two beside each), a table of 64 bits one.
    pub fn fabric() -> Self {
        Objective {
            target: Target::default(),
            weights: Weights {
                multiplier_tile: 200.0,
                adder_bit: 1.0,
                logic_bit: 1.0,
                register_bit: 0.5,
                rom_bit: 1.0 / 64.0,
                ..Weights::default()
            },
        }
    }

    /// The objective of a name: a target's, or `fpga`.
    pub fn of_name(name: &str) -> Option<Self> {
        match name {
            "fpga" => Some(Objective::fabric()),
            _ => Target::of_name(name).map(Objective::controller),
        }
    }
}

impl Cost {
    /// The weighted sum.
    pub fn price(&self, weights: &Weights) -> f64 {
        let (w, f) = (weights, &self.fabric);
        let terms = [
            (w.cycle, self.cycles_per_row),
            (w.code_byte, self.code_bytes),
            (w.rom_byte, self.rom_bytes),
            (w.ram_byte, self.ram_bytes),
            (w.multiplier_tile, f.multiplier_tiles),
            (w.adder_bit, f.adder_bits),
            (w.logic_bit, f.logic_bits),
            (w.register_bit, f.register_bits),
            (w.rom_bit, f.rom_bits),
        ];
        terms.iter().map(|(weight, n)| weight * *n as f64).sum()
    }
}
