//! What the emitted C is to a compiler: equal functions are there once, no argument overflows, a shift is one
//! instruction, and the chain links beside the correction of the same product.

use crate::common::command::{good, told};
use crate::common::compiler::cc;
use gyrogen::design::template::DEFAULT;
use gyrogen::design::{Design, reader};
use gyrogen::emit::bundle::Part;
use gyrogen::emit::views::Language;
use gyrogen::firmware::correction::{Origin, emit, prefix};
use gyrogen::firmware::files::{self, EmittedFile};
use std::path::Path;
use std::process::Command;

const STRICT: [&str; 6] = [
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-pedantic",
    "-Werror",
];

fn chain(text: &str) -> (Design, Vec<EmittedFile>) {
    let design = reader::parse(text, None).expect("a design");
    let emitted = files::emit(&design, Part::Chain, Language::C, "test").expect("a bundle");
    (design, emitted)
}

fn text<'a>(files: &'a [EmittedFile], path: &str) -> &'a str {
    &files
        .iter()
        .find(|f| f.path == path)
        .expect("the file")
        .text
}

/// Compiles in the folder; the program's name, if it is to run.
fn compile(folder: &Path, arguments: &[&str]) {
    let out = cc()
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("a C compiler");
    let said = told(&out);
    assert!(out.status.success(), "cc {arguments:?}: {said}");
}

#[test]
fn functions_that_differ_in_a_fault_that_never_comes_are_one() {
    let of = |overflow: &str| {
        let product =
            r#"product = { format = "Q2.22", rounding = "half_up", overflow = "saturate" }"#;
        let output =
            r#"output = { format = "Q2.22", rounding = "half_up", overflow = "saturate" }"#;
        let changed = |line: &str| line.replace("saturate", overflow);
        let design = DEFAULT
            .replace(product, &changed(product))
            .replace(output, &changed(output));
        assert_eq!(design.matches(&changed(product)).count(), 1);
        text(&chain(&design).1, "gyro.c").to_owned()
    };
    let (error, saturate) = (of("error"), of("saturate"));
    for name in ["demodulate", "decimate", "integrate"] {
        assert!(
            !error.contains(&format!("gyro_{name}_2")),
            "{name} is there twice"
        );
        assert!(error.contains(&format!("gyro_{name}(")));
    }
    let lines = |text: &str| text.lines().count();
    assert_eq!(lines(&error), lines(&saturate));
}

/// The ends of every parameter's type, and a little beside them.
const EXTREMES: &str = r#"
#include <stdio.h>
#include "gyro.h"
static const int32_t wide[] = { INT32_MIN, INT32_MIN + 1, -65536, -1, 0, 1, 65535, INT32_MAX - 1, INT32_MAX };
static const int16_t code[] = { INT16_MIN, INT16_MIN + 1, -1, 0, 1, INT16_MAX };
static uint32_t h;
static void mix(int32_t word) { h = (h * 31U) + (uint32_t)word; }
int main(void)
{
    static gyro_t g;
    gyro_period_out_t row;
    for (int a = 0; a < 9; ++a) {
        for (int b = 0; b < 9; ++b) {
            const gyro_cordic_out_t polar = gyro_cordic(wide[a], wide[b]);
            mix(polar.phase);
            mix(polar.magnitude);
            mix(gyro_rate(wide[a], wide[b]));
            mix(gyro_demodulate(code[a % 6], code[b % 6]));
        }
        mix(gyro_bias(wide[a]));
        gyro_init(&g);
        for (int k = 0; k < 5; ++k) {
            gyro_integrate(&g.chain.cic_drive_i, wide[a]);
            mix(gyro_amplitude_loop(&g.chain.amplitude_loop, wide[a]));
        }
        mix(gyro_decimate(&g.chain.cic_drive_i));
        for (int k = 0; k < 64; ++k) {
            if (gyro_push(&g, code[a % 6], code[(a + k) % 6], &row)) {
                mix(row.rate);
            }
        }
    }
    printf("%lu\n", (unsigned long)h);
    return 0;
}
"#;

#[test]
fn no_argument_of_a_parameters_type_overflows() {
    let folder = tempfile::tempdir().expect("a folder");
    files::write(&chain(DEFAULT).1, folder.path()).expect("written");
    std::fs::write(folder.path().join("extremes.c"), EXTREMES).expect("written");
    let sanitizers = "-fsanitize=undefined,address";
    let arguments = [
        "-std=c99",
        "-O1",
        sanitizers,
        "-fno-sanitize-recover=all",
        "extremes.c",
        "gyro.c",
        "gyro_tables.c",
        "-o",
        "run",
    ];
    compile(folder.path(), &arguments);
    let ran = Command::new(folder.path().join("run"))
        .output()
        .expect("it runs");
    good(&ran);
}

/// The helpers of the header as functions of their own.
#[cfg(target_arch = "x86_64")]
const SHIFTS: &str = r#"
#include "gyro_arith.h"
int32_t shift_32(int32_t a);
int64_t shift_64(int64_t a);
int32_t word_32(uint32_t a);
int32_t extend_32(uint32_t a);
int32_t shift_32(int32_t a) { return gyro_asr_32(a, 8U); }
int64_t shift_64(int64_t a) { return gyro_asr_64(a, 30U); }
int32_t word_32(uint32_t a) { return gyro_word_32(a); }
int32_t extend_32(uint32_t a) { return gyro_sign_extend_32(a, UINT32_C(1) << 23U); }
"#;

#[cfg(target_arch = "x86_64")]
#[test]
fn a_portable_shift_is_one_instruction() {
    let folder = tempfile::tempdir().expect("a folder");
    files::write(&chain(DEFAULT).1, folder.path()).expect("written");
    std::fs::write(folder.path().join("shifts.c"), SHIFTS).expect("written");
    let arguments = [
        "-O2",
        "-fno-asynchronous-unwind-tables",
        "-S",
        "shifts.c",
        "-o",
        "shifts.s",
    ];
    compile(folder.path(), &arguments);
    let assembly = std::fs::read_to_string(folder.path().join("shifts.s")).expect("assembly");
    // With the move from the argument's register and the return; sign extension is two shifts.
    for (name, most) in [
        ("shift_32", 3),
        ("shift_64", 3),
        ("word_32", 2),
        ("extend_32", 4),
    ] {
        let (_, body) = assembly
            .split_once(&format!("\n{name}:\n"))
            .expect("the function");
        let (body, _) = body.split_once("\tret").expect("its end");
        let is_instruction = |line: &&str| {
            line.starts_with('\t') && !line.starts_with("\t.") && !line.contains("endbr")
        };
        let count = body.lines().filter(is_instruction).count() + 1;
        assert!(count <= most, "{name} takes {count} instructions:\n{body}");
    }
}

/// A word of the state is stored where its new value is known: compilers then add to memory.
#[test]
fn a_state_is_stored_as_soon_as_it_is_known() {
    let (_, emitted) = chain(DEFAULT);
    let source = text(&emitted, "gyro.c");
    let start = source.find("void gyro_integrate(").expect("the function");
    let body = source[start..].split("\n}").next().expect("its end");
    let lines: Vec<&str> = body.lines().map(str::trim).collect();
    for k in 0..3 {
        let store = format!("s->integrator[{k}] = new_integrator_{k};");
        let place = lines.iter().position(|l| *l == store).expect("a store");
        let made = format!("const uint64_t new_integrator_{k} = ");
        assert!(lines[place - 1].starts_with(&made), "{body}");
    }
}

const CORRECTION: &str = "[correction]\nperiod_s = 1.0\nfull_scale_dps = 100.0\nnoise_dps = 0.01\n\
    inputs = [{ column = \"die_degc\", offset = 25.0, scale = 60.0 }]\n\
    terms = [{ kind = \"lag\", gain_dps = 0.5, input = 0, tau_s = 40.0 }]\n";

#[test]
fn the_chain_and_the_correction_of_a_product_link() {
    let folder = tempfile::tempdir().expect("a folder");
    let (design, emitted) = chain(&format!("{DEFAULT}\n{CORRECTION}"));
    let prefix = prefix(&design.name);
    let origin = Origin {
        prefix: &prefix,
        sha256: "0",
        command: "test",
    };
    let correction = design
        .correction
        .expect("a correction")
        .compile()
        .expect("a correction");
    let correction = emit(&correction, &origin, Language::C).expect("a bundle");
    // Into one folder: no file of one is a file of the other.
    let firmware = |files: &[EmittedFile]| -> Vec<String> {
        let of = |f: &&EmittedFile| f.path.ends_with(".c") && !f.path.contains('/');
        files.iter().filter(of).map(|f| f.path.clone()).collect()
    };
    let (mut sources, more) = (firmware(&emitted), firmware(&correction));
    assert!(sources.len() == 3 && more.iter().all(|path| !sources.contains(path)));
    sources.extend(more);
    files::write(&emitted, folder.path()).expect("written");
    files::write(&correction, folder.path()).expect("written");
    let main = r#"#include "gyro.h"
#include "gyro_correction.h"
int main(void)
{
    static gyro_t g;
    static gyro_correction_state_t s;
    gyro_init(&g);
    gyro_correction_init(&s);
    (void)gyro_correction_correct(&s, 1, 0, 0);
    return (int)(gyro_selftest() + gyro_correction_selftest());
}
"#;
    std::fs::write(folder.path().join("main.c"), main).expect("written");
    let mut arguments: Vec<&str> = STRICT.to_vec();
    arguments.extend(["main.c", "-o", "run"]);
    arguments.extend(sources.iter().map(String::as_str));
    compile(folder.path(), &arguments);
    assert!(
        Command::new(folder.path().join("run"))
            .status()
            .expect("it runs")
            .success()
    );
}

/// The text between ```` ```KIND ```` and the next fence.
fn example<'a>(readme: &'a str, kind: &str) -> &'a str {
    let (_, rest) = readme
        .split_once(&format!("```{kind}\n"))
        .expect("an example");
    rest.split_once("```").expect("its end").0
}

#[test]
fn the_readmes_example_compiles_and_runs() {
    let text = format!("{DEFAULT}\n{CORRECTION}");
    let design = reader::parse(&text, None).expect("a design");
    let of_part = |part| files::emit(&design, part, Language::C, "test").expect("a bundle");
    let name = prefix(&design.name);
    let origin = Origin {
        prefix: &name,
        sha256: "0",
        command: "test",
    };
    let planned = design.correction.as_ref().expect("a correction");
    let correction = planned.compile().expect("a correction");
    let bundles = [
        of_part(Part::Chain),
        of_part(Part::Compensation),
        emit(&correction, &origin, Language::C).expect("a bundle"),
    ];
    for emitted in bundles {
        let folder = tempfile::tempdir().expect("a folder");
        files::write(&emitted, folder.path()).expect("written");
        let readme = self::text(&emitted, "README.md");
        assert!(readme.contains("SPDX-License-Identifier"));
        std::fs::write(folder.path().join("main.c"), example(readme, "c")).expect("written");
        let mut arguments: Vec<&str> = STRICT.to_vec();
        arguments.extend(["-I.", "main.c", "-o", "run"]);
        let firmware = emitted.iter().map(|f| f.path.as_str());
        arguments.extend(firmware.filter(|path| path.ends_with(".c") && !path.contains('/')));
        compile(folder.path(), &arguments);
        assert!(
            Command::new(folder.path().join("run"))
                .status()
                .expect("it runs")
                .success()
        );
    }
}

/// A bias of 16 bits goes into a narrower parameter: the README has the cast that a strict compiler asks for.
#[test]
fn bias_and_rate_called_by_hand_compile_as_the_readme_says() {
    let coefficients = "coefficients_raw = [114923930, 800391448, 1415954326]";
    let small = DEFAULT.replacen(
        coefficients,
        "coefficients_raw = [1149239, 80039, 14159]",
        1,
    );
    let design = reader::parse(&small, None).expect("a design");
    let emitted = files::emit(&design, Part::Compensation, Language::C, "test").expect("a bundle");
    assert!(text(&emitted, "gyro.h").contains("gyro_rate(int32_t raw_rate, int16_t bias)"));
    let call = "gyro_rate(raw_rate, (int16_t)gyro_bias(thermometer))";
    let readme = text(&emitted, "README.md");
    assert!(readme.contains(&format!("write `{call}`")), "{readme}");
    let folder = tempfile::tempdir().expect("a folder");
    files::write(&emitted, folder.path()).expect("written");
    let main = format!(
        "#include \"gyro.h\"\nint main(void)\n{{\n    const int32_t thermometer = 5;\n    const int32_t raw_rate = 7;\n    \
         return ({call} == gyro_compensate(thermometer, raw_rate).rate) ? 0 : 1;\n}}\n"
    );
    std::fs::write(folder.path().join("main.c"), main).expect("written");
    let mut arguments: Vec<&str> = STRICT.to_vec();
    let sources = ["main.c", "gyro.c", "gyro_tables.c", "-o", "run"];
    arguments.extend(sources);
    compile(folder.path(), &arguments);
    let ran = Command::new(folder.path().join("run")).status();
    assert!(ran.expect("it runs").success());
    // Where the types agree there is nothing to cast.
    let (_, whole) = chain(DEFAULT);
    assert!(!text(&whole, "README.md").contains("The cast loses nothing"));
}

/// The README has no empty section, and says of each function what an input outside its range comes to.
#[test]
fn the_readme_says_what_there_is() {
    let design = reader::parse(DEFAULT, None).expect("a design");
    let of_part = |part| files::emit(&design, part, Language::C, "test").expect("a bundle");
    let (whole, compensation) = (of_part(Part::Chain), of_part(Part::Compensation));
    let (whole, compensation) = (text(&whole, "README.md"), text(&compensation, "README.md"));
    assert!(whole.contains("\n## Memory\n") && whole.contains("; every entry of the tables."));
    assert!(!compensation.contains("## Memory") && !compensation.contains("of the tables"));
    let clamped = "an input outside its range is clamped to it";
    assert_eq!(
        compensation.matches(clamped).count(),
        3,
        "bias, rate, compensate"
    );
    let wrong = "an input outside its range is not clamped";
    let (_, integrate) = whole.split_once("\n- `integrate`: ").expect("the function");
    let (integrate, _) = integrate.split_once("\n\n").expect("its end");
    assert!(integrate.contains(wrong), "{integrate}");
    for readme in [whole, compensation] {
        assert!(!readme.contains("nothing is promised"));
        let (_, checked) = readme
            .split_once("\n## What was checked")
            .expect("the section");
        assert!(!checked.contains(";\n"), "{checked}");
        let prefix = "Every name begins with `gyro_`";
        assert_eq!(readme.matches(prefix).count(), 1);
    }
}

/// GCC takes the sum of an unsigned word and of a short parameter's bits for one of signed words.
#[test]
fn a_short_product_in_a_sum_of_32_bits_compiles_without_a_warning() {
    for bits in [10, 12, 13, 14] {
        let to = format!("product = {{ format = \"Q2.{bits}\"");
        let text = DEFAULT.replacen("product = { format = \"Q2.22\"", &to, 1);
        let (_, files) = chain(&text);
        let source = self::text(&files, "gyro.c");
        assert!(
            source.contains("_integrate(gyro_cic_t *s, int16_t product)"),
            "{bits}"
        );
        let folder = tempfile::tempdir().expect("a folder");
        gyrogen::firmware::files::write(&files, folder.path()).expect("written");
        compile(
            folder.path(),
            &[
                "-std=c99",
                "-O2",
                "-Wall",
                "-Wextra",
                "-Wconversion",
                "-Wshadow",
                "-pedantic",
                "-Werror",
                "-c",
                "gyro.c",
            ],
        );
    }
}
