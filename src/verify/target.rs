//! Where a bundle's code is built for and run: this machine, or a processor under emulation.
//!
//! The cross targets are compiled by a compiler for bare metal, with the processor's own instructions and without a
//! C library; `RUNTIME` has the few functions that the test driver needs. qemu's user mode executes them: the
//! instructions are the processor's, its clock and memory are not, and cycles are not counted.

use super::process;
use super::toolchain::{self, C_FLAGS, Harness};
use crate::error::{InputError, Result, io_error};
use crate::leftovers::TemporaryFolder;
use std::path::Path;
use std::process::Command;

/// Files of the test driver's runtime where there is no C library.
const RUNTIME: [(&str, &str); 5] = [
    ("runtime.c", include_str!("runtime/runtime.c")),
    ("stdio.h", include_str!("runtime/stdio.h")),
    ("stdlib.h", include_str!("runtime/stdlib.h")),
    ("string.h", include_str!("runtime/string.h")),
    ("inttypes.h", include_str!("runtime/inttypes.h")),
];

/// A processor to verify for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Target {
    /// This machine.
    #[default]
    Host,
    /// ARM Cortex-M4, Thumb-2, under emulation; C bundles only.
    CortexM4,
    /// 32-bit RISC-V (RV32IMAC), under emulation; C bundles only.
    Riscv32,
}

/// What a cross target takes.
struct Cross {
    compilers: &'static [&'static str],
    flags: &'static [&'static str],
    emulators: &'static [&'static str],
    /// Debian's packages.
    packages: &'static str,
}

impl Target {
    /// As on the command line and in `verify.json`.
    pub fn name(self) -> &'static str {
        match self {
            Target::Host => "host",
            Target::CortexM4 => "cortex-m4",
            Target::Riscv32 => "riscv32",
        }
    }

    fn cross(self) -> Option<Cross> {
        match self {
            Target::Host => None,
            Target::CortexM4 => Some(Cross {
                compilers: &["arm-none-eabi-gcc"],
                flags: &["-mcpu=cortex-m4", "-mthumb", "-Wl,-Ttext-segment=0x20000"],
                emulators: &["qemu-arm-static", "qemu-arm"],
                packages: "gcc-arm-none-eabi and qemu-user-static",
            }),
            Target::Riscv32 => Some(Cross {
                compilers: &["riscv64-unknown-elf-gcc", "riscv32-unknown-elf-gcc"],
                flags: &["-march=rv32imac", "-mabi=ilp32"],
                emulators: &["qemu-riscv32-static", "qemu-riscv32"],
                packages: "gcc-riscv64-unknown-elf and qemu-user-static",
            }),
        }
    }
}

/// Builds the driver of the C bundle in `folder` for a cross target; `None` for the host. `sources` are the bundle's paths.
///
/// # Errors
/// No compiler or emulator for the target (exit 2, with what to install); sources that do not compile (a check that does
/// not hold).
pub(super) fn build(target: Target, folder: &Path, sources: &[String]) -> Result<Option<Harness>> {
    let Some(cross) = target.cross() else {
        return Ok(None);
    };
    let compiler = first(cross.compilers, "compiler", target, cross.packages)?;
    let emulator = first(cross.emulators, "emulator", target, cross.packages)?;
    let made = TemporaryFolder::of_the_system()
        .map_err(|e| io_error(std::env::temp_dir(), "make a folder for the build", &e))?;
    for (name, text) in RUNTIME {
        crate::output::write_whole(&made.path().join(name), text.as_bytes())?;
    }
    let program = made.path().join("harness");
    let freestanding = ["-ffreestanding", "-nostdlib", "-static"];
    let mut command = Command::new(compiler);
    command.args(C_FLAGS).args(freestanding).args(cross.flags);
    command.arg("-isystem").arg(made.path());
    command.arg("-I").arg(folder);
    let c_files = sources.iter().filter(|path| path.ends_with(".c"));
    command.args(c_files.map(|path| folder.join(path)));
    command.arg(made.path().join("runtime.c"));
    command.arg("-lgcc").arg("-o").arg(&program);
    toolchain::compile(command, "the emitted C", made.path())?;
    let flags = [&C_FLAGS[..], &freestanding, cross.flags].concat();
    let toolchain = format!(
        "{}; {}; {}",
        toolchain::version(compiler),
        flags.join(" "),
        toolchain::version(emulator)
    );
    Ok(Some(Harness::emulated(emulator, program, toolchain, made)))
}

/// The first program that answers.
fn first(
    names: &'static [&'static str],
    what: &str,
    target: Target,
    packages: &str,
) -> Result<&'static str> {
    let answers = |name: &&&str| {
        let mut command = Command::new(name);
        command.arg("--version");
        process::output(command, "it").is_ok_and(|said| said.status.success())
    };
    names.iter().find(answers).copied().ok_or_else(|| {
        InputError::new(format!(
            "there is no {what} for {} (tried {})",
            target.name(),
            names.join(", ")
        ))
        .help(format!(
            "install one; Debian has it in {packages}; or verify for this machine: `--target host`"
        ))
        .into()
    })
}
