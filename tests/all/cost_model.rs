//! The cost model against instructions that were counted: the emitted C, compiled at `-O2` for a processor, run
//! under qemu one instruction at a time. Needs the cross compilers and qemu's user mode; `.ci/run` has them.

use crate::common::command::told;
use crate::common::dice::Dice;
use gyrogen::cost::{self, Target};
use gyrogen::design::{Design, reader, template};
use gyrogen::emit::bundle::{Bundle, Part};
use gyrogen::emit::views::Language;
use gyrogen::firmware::files;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// A compiler and an emulator.
struct Machine {
    target: Target,
    compiler: &'static str,
    names: &'static str,
    flags: &'static [&'static str],
    emulator: &'static str,
}

const MACHINES: [Machine; 3] = [
    Machine {
        target: Target::CortexM4,
        compiler: "arm-none-eabi-gcc",
        names: "arm-none-eabi-nm",
        flags: &["-mcpu=cortex-m4", "-mthumb"],
        emulator: "qemu-arm-static",
    },
    Machine {
        target: Target::Rv32imc,
        compiler: "riscv64-unknown-elf-gcc",
        names: "riscv64-unknown-elf-nm",
        flags: &["-march=rv32imc", "-mabi=ilp32"],
        emulator: "qemu-riscv32-static",
    },
    Machine {
        target: Target::CortexM0,
        compiler: "arm-none-eabi-gcc",
        names: "arm-none-eabi-nm",
        flags: &["-mcpu=cortex-m0", "-mthumb"],
        emulator: "qemu-arm-static",
    },
];

/// Rows that are run.
const ROWS: u64 = 2;

/// Codes into `push` until there are rows; what does not count has names of its own.
const DRIVER: &str = r#"
#include "gyro.h"
static gyro_t g;
void *memset(void *p, int c, unsigned long n) { char *q = p; while (n--) *q++ = (char)c; return p; }
void *memcpy(void *p, const void *s, unsigned long n) { char *q = p; const char *r = s; while (n--) *q++ = *r++; return p; }
static void driver_leave(void)
{
#if defined(__arm__)
    register int r7 __asm__("r7") = 1;
    register int r0 __asm__("r0") = 0;
    __asm__ volatile("svc 0" ::"r"(r0), "r"(r7));
#else
    register int a7 __asm__("a7") = 93;
    register int a0 __asm__("a0") = 0;
    __asm__ volatile("ecall" ::"r"(a0), "r"(a7));
#endif
    for (;;) {}
}
void driver_start(void)
{
    gyro_period_out_t row;
    uint32_t x = 1u;
    int rows = 0;
    gyro_init(&g);
    while (rows < ROWS) {
        int32_t drive, sense;
        x = x * 1664525u + 1013904223u;
        drive = (int32_t)(x >> DROP) - (1 << (31 - DROP));
        x = x * 1664525u + 1013904223u;
        sense = (int32_t)(x >> DROP) - (1 << (31 - DROP));
        rows += gyro_push(&g, drive, sense, &row);
    }
    driver_leave();
}
__attribute__((naked)) void _start(void)
{
#if defined(__arm__)
    __asm__ volatile("bl driver_start");
#else
    /* The linker's relaxation addresses by gp. */
    __asm__ volatile(".option push\n.option norelax\nla gp, __global_pointer$\n.option pop\ncall driver_start");
#endif
}
"#;

/// The default with these pieces of its text changed.
fn changed(changes: &[(&str, &str)]) -> Design {
    let mut text = template::DEFAULT.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    reader::parse(&text, None).unwrap()
}

const LOOP: [(&str, &str); 5] = [
    ("#[circuit.phase_loop]", "[circuit.phase_loop]"),
    ("#setpoint_raw = -4194304", "setpoint_raw = -4194304"),
    ("#proportional = {", "proportional = {"),
    ("#integral = {", "integral = {"),
    ("#integrator_bits", "integrator_bits"),
];

/// Ten designs: words, stages, rates, iterations, roundings, the phase loop.
fn designs() -> Vec<(&'static str, Design)> {
    let product = "product = { format = \"Q2.22\", rounding = \"half_up\"";
    let output = "output = { format = \"Q2.22\"";
    vec![
        ("default", changed(&[])),
        (
            "product Q2.14",
            changed(&[(
                product,
                "product = { format = \"Q2.14\", rounding = \"half_up\"",
            )]),
        ),
        (
            "two stages, ratio 64, product Q2.18 floor",
            changed(&[
                ("stages = 3", "stages = 2"),
                ("ratio = 32", "ratio = 64"),
                (
                    product,
                    "product = { format = \"Q2.18\", rounding = \"floor\"",
                ),
            ]),
        ),
        (
            "four stages, half even",
            changed(&[
                ("stages = 3", "stages = 4"),
                (
                    product,
                    "product = { format = \"Q2.20\", rounding = \"half_even\"",
                ),
            ]),
        ),
        (
            "six stages, ratio 16",
            changed(&[("stages = 3", "stages = 6"), ("ratio = 32", "ratio = 16")]),
        ),
        (
            "12-bit ADC, 12-bit table",
            changed(&[
                (
                    "[circuit.adc]\n# Format of a code, signed, 2 to 32 bits. A format string only.\nformat = \"Q1.15\"",
                    "[circuit.adc]\nformat = \"Q1.11\"",
                ),
                ("table = \"Q1.15\"", "table = \"Q1.11\""),
                ("table_address_bits = 12", "table_address_bits = 8"),
            ]),
        ),
        (
            "table Q1.23",
            changed(&[("table = \"Q1.15\"", "table = \"Q1.23\"")]),
        ),
        (
            "CORDIC of 48 bits",
            changed(&[
                ("iterations = 20", "iterations = 28"),
                ("guard_bits = 6", "guard_bits = 18"),
                ("width = 32", "width = 48"),
            ]),
        ),
        (
            "CORDIC of 12 steps, decimated Q2.16",
            changed(&[
                ("iterations = 20", "iterations = 12"),
                (output, "output = { format = \"Q2.16\""),
                ("setpoint_raw = 1048576", "setpoint_raw = 16384"),
            ]),
        ),
        ("phase loop", changed(&LOOP)),
    ]
}

/// The default with every word and size drawn anew that a key states; `None` where such a design is refused.
fn drawn(dice: &mut Dice) -> Option<(String, Design)> {
    let roundings = ["half_up", "floor", "half_even", "half_away", "toward_zero"];
    let cast = |key: &str, format: &str, dice: &mut Dice| {
        let from = format!("{key} = {{ format = \"{format}\", rounding = \"half_up\"");
        let (whole, fraction) = format.split_once('.').unwrap();
        let fraction: u32 = fraction.parse().unwrap();
        let fraction = dice.between(fraction - 10, fraction);
        let rounding = dice.one_of(&roundings);
        let to = format!("{key} = {{ format = \"{whole}.{fraction}\", rounding = \"{rounding}\"");
        (from, to)
    };
    let mut changes = vec![
        cast("product", "Q2.22", dice),
        cast("output", "Q12.12", dice),
        cast("accumulator", "Q13.27", dice),
    ];
    let mut size = |key: &str, given: u32, drawn: u32| {
        changes.push((format!("{key} = {given}"), format!("{key} = {drawn}")));
    };
    size("stages", 3, dice.between(1, 6));
    size("ratio", 32, dice.between(8, 100));
    size("differential_delay", 1, dice.between(1, 2));
    size("table_address_bits", 12, dice.between(5, 12));
    size("iterations", 20, dice.between(8, 26));
    size("angle_bits", 24, dice.between(16, 30));
    size("guard_bits", 6, dice.between(2, 8));
    let tuning = dice.one_of(&[134_217_728, 134_230_000, 120_000_001]);
    size("tuning_word", 134_217_728, tuning);
    let table = format!("table = \"Q1.{}\"", dice.between(7, 21));
    changes.push(("table = \"Q1.15\"".to_owned(), table));
    let address = dice.one_of(&["half_up", "floor"]);
    let rounding = format!("address_rounding = \"{address}\"");
    changes.push(("address_rounding = \"half_up\"".to_owned(), rounding));
    if dice.between(0, 2) == 0 {
        changes.extend(LOOP.map(|(from, to)| (from.to_owned(), to.to_owned())));
    }
    let mut text = template::DEFAULT.to_owned();
    for (from, to) in &changes {
        assert!(text.contains(from.as_str()), "{from}");
        text = text.replacen(from.as_str(), to, 1);
    }
    let design = reader::parse(&text, None).ok()?;
    let named = [0, 3, 4, 6, 10].map(|k| changes[k].1.as_str()).join(", ");
    Some((named, design))
}

/// Ten drawn designs. A seed that the model's prices were looked at with judges them no longer: take another one.
fn fresh() -> Vec<(String, Design)> {
    let seed = std::env::var("GYROGEN_COST_SEED").map_or(11, |s| s.parse().unwrap());
    let mut dice = Dice(seed);
    std::iter::repeat_with(|| drawn(&mut dice))
        .flatten()
        .take(10)
        .collect()
}

fn run(command: &mut Command) -> String {
    let out = command.output();
    let out = out.unwrap_or_else(|e| panic!("{command:?}: {e}; .ci/cross installs it"));
    let text = told(&out);
    assert!(out.status.success(), "{command:?}: {}: {text}", out.status);
    String::from_utf8_lossy(&out.stdout).into_owned()
}

/// Instructions for a row by function: the firmware's and the compiler's library's, `init` and the driver not.
fn counted(design: &Design, machine: &Machine, folder: &Path) -> BTreeMap<String, f64> {
    let bundle = files::emit(design, Part::Chain, Language::C, "test").unwrap();
    files::write(&bundle, folder).unwrap();
    std::fs::write(folder.join("driver.c"), DRIVER).unwrap();
    let compile = |source: &str, flags: &[&str]| {
        let mut command = Command::new(machine.compiler);
        command
            .args(machine.flags)
            .args(flags)
            .args(["-ffreestanding", "-c"]);
        command.arg("-I").arg(folder).arg(folder.join(source));
        command
            .arg("-o")
            .arg(folder.join(source).with_extension("o"));
        run(&mut command);
    };
    compile("gyro.c", &["-std=c99", "-O2"]);
    compile("gyro_tables.c", &["-std=c99", "-O2"]);
    let drop = 32 - design.circuit.adc.format.bits();
    let (rows, drop) = (format!("-DROWS={ROWS}"), format!("-DDROP={drop}"));
    compile("driver.c", &["-std=gnu99", "-O1", &rows, &drop]);
    let program = folder.join("program");
    let mut link = Command::new(machine.compiler);
    link.args(machine.flags)
        .args(["-nostdlib", "-static", "-Wl,-Ttext-segment=0x20000"]);
    for object in ["driver.o", "gyro.o", "gyro_tables.o"] {
        link.arg(folder.join(object));
    }
    run(link.arg("-lgcc").arg("-o").arg(&program));
    let names = run(Command::new(machine.names).arg("-n").arg(&program));
    let mut functions: Vec<(u64, &str)> = Vec::new();
    for line in names.lines() {
        let mut words = line.split_whitespace();
        if let (Some(address), Some("t" | "T"), Some(name)) =
            (words.next(), words.next(), words.next())
            && !name.starts_with('$')
            && !name.starts_with(".L")
        {
            functions.push((u64::from_str_radix(address, 16).unwrap() & !1, name));
        }
    }
    let log = folder.join("log");
    let mut emulate = Command::new(machine.emulator);
    emulate.args(["-singlestep", "-d", "exec,nochain", "-D"]);
    run(emulate.arg(&log).arg(&program));
    let mut counts: BTreeMap<String, f64> = BTreeMap::new();
    for line in std::fs::read_to_string(&log).unwrap().lines() {
        // Trace 0: 0x7f0000000000 [00000000/00020074/00000033/ff000201]
        let Some(address) = line.split('/').nth(1) else {
            continue;
        };
        let address = u64::from_str_radix(address, 16).unwrap();
        let at = functions.partition_point(|(a, _)| *a <= address);
        let name = functions[at - 1].1;
        let is_driver = ["_start", "memset", "memcpy", "gyro_init"].contains(&name)
            || name.starts_with("driver_");
        if !is_driver {
            *counts.entry(name.to_owned()).or_default() += 1.0 / ROWS as f64;
        }
    }
    counts
}

#[test]
#[ignore = "needs the cross compilers and qemu; .ci/run runs it"]
fn predicted_instructions_are_within_15_percent_of_counted_ones() {
    within_15_percent(designs());
}

#[test]
#[ignore = "needs the cross compilers and qemu"]
fn so_they_are_of_ten_drawn_designs() {
    within_15_percent(fresh());
}

fn within_15_percent<S: std::fmt::Display>(designs: Vec<(S, Design)>) {
    let verbose = std::env::var_os("GYROGEN_COST_BY_FUNCTION").is_some();
    let mut wrong = Vec::new();
    for (name, design) in designs {
        let bundle = Bundle::new(&design, Part::Chain);
        for machine in &MACHINES {
            let folder = tempfile::tempdir().unwrap();
            let counts = counted(&design, machine, folder.path());
            let total: f64 = counts.values().sum();
            let cost = cost::of_bundle(&bundle, machine.target);
            let ratio = cost.instructions_per_row as f64 / total;
            println!(
                "{name:44} {:10} counted {total:8.1} predicted {:6} ratio {ratio:.3}",
                machine.target.name(),
                cost.instructions_per_row
            );
            if verbose {
                println!("    counted {counts:.0?}");
                println!(
                    "    predicted {:?}",
                    cost::by_function(&bundle, machine.target)
                );
            }
            if !(0.85..=1.15).contains(&ratio) {
                wrong.push(format!("{name} on {}: {ratio:.3}", machine.target.name()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
