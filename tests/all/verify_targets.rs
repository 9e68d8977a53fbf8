//! `gyrogen verify --target`: the same bundle on other processors, under emulation where this machine can.

use crate::common::command::{good, gyrogen_in, text, told};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn gyrogen(arguments: &[&str], path: Option<&Path>) -> Output {
    let path = path.map(|p| ("PATH", text(p)));
    gyrogen_in(Path::new("."), arguments, path.as_slice())
}

fn emit(folder: &Path, language: &str) -> String {
    let out = folder.join(language).to_str().expect("a name").to_owned();
    let made = gyrogen(&["emit", "--lang", language, "--out", &out], None);
    good(&made);
    out
}

/// True if some program of each list answers.
fn is_there(programs: [&[&str]; 2]) -> bool {
    let answers = |name: &&str| {
        let run = Command::new(name).arg("--version").output();
        run.is_ok_and(|o| o.status.success())
    };
    programs.iter().all(|names| names.iter().any(answers))
}

type Tools = [&'static [&'static str]; 2];

const TARGETS: [(&str, Tools, &str); 2] = [
    (
        "cortex-m4",
        [&["arm-none-eabi-gcc"], &["qemu-arm-static", "qemu-arm"]],
        "gcc-arm-none-eabi",
    ),
    (
        "riscv32",
        [
            &["riscv64-unknown-elf-gcc", "riscv32-unknown-elf-gcc"],
            &["qemu-riscv32-static", "qemu-riscv32"],
        ],
        "gcc-riscv64-unknown-elf",
    ),
];

#[test]
fn a_bundle_holds_on_other_processors_and_damage_is_found_there() {
    let folder = tempfile::tempdir().unwrap();
    let bundle = emit(folder.path(), "c");
    let source = folder.path().join("c/gyro.c");
    let whole = std::fs::read_to_string(&source).unwrap();
    for (target, tools, package) in TARGETS {
        let arguments = ["verify", &bundle, "--target", target, "--format", "json"];
        let run = gyrogen(&arguments, None);
        if !is_there(tools) {
            println!("{target}: not on this machine");
            assert_eq!(run.status.code(), Some(2));
            assert!(told(&run).contains(package), "{}", told(&run));
            continue;
        }
        assert!(run.status.success(), "{target}: {}", told(&run));
        let json: Value = serde_json::from_slice(&run.stdout).unwrap();
        assert_eq!(json["target"], target);
        assert_eq!(json["selftest"], true);
        assert_eq!(json["holds"], true);
        assert!(json["vectors"]["compared"].as_u64().unwrap() > 10_000);
        println!("{target}: {}", json["toolchain"]);

        // One rounding constant of the bias.
        let (before, bias) = whole.split_at(whole.find("int32_t gyro_bias(").unwrap());
        let damaged = before.to_owned() + &bias.replacen("(16384)", "(16383)", 1);
        assert_ne!(damaged, whole);
        std::fs::write(&source, damaged).unwrap();
        let run = gyrogen(&arguments, None);
        assert_eq!(run.status.code(), Some(1), "{target}");
        assert!(told(&run).contains("bias (c)"), "{}", told(&run));
        std::fs::write(&source, &whole).unwrap();
    }
}

const CORRECTED: &str = r#"
name = "gyro"
[correction]
period_s = 0.2
full_scale_dps = 500.0
noise_dps = 2e-3
inputs = [{ column = "phase_rad", offset = -1.8, scale = 0.4 }]
terms = [
    { kind = "product", gain_dps = 97.2, factors = [[0, 1]] },
    { kind = "lag", gain_dps = 4.0, input = 0, tau_s = 1.0 },
]
"#;

#[test]
fn all_parts_hold_on_other_processors_and_damage_is_found_there() {
    let folder = tempfile::tempdir().unwrap();
    let [design, bundle] = ["design.toml", "all"].map(|name| {
        let path = folder.path().join(name);
        path.to_str().expect("a name").to_owned()
    });
    std::fs::write(&design, CORRECTED).unwrap();
    let part = ["emit", &design, "--part", "all", "--lang", "c"];
    let made = gyrogen(&[&part[..], &["--out", &bundle]].concat(), None);
    good(&made);
    let source = folder.path().join("all/correction/gyro_correction.c");
    let whole = std::fs::read_to_string(&source).unwrap();
    let damaged = whole.replacen(" - ", " + ", 1);
    assert_ne!(damaged, whole);
    for (target, tools, _) in TARGETS {
        if !is_there(tools) {
            println!("{target}: not on this machine");
            continue;
        }
        let arguments = ["verify", &bundle, "--target", target];
        let run = gyrogen(&arguments, None);
        assert!(run.status.success(), "{target}: {}", told(&run));
        let table = String::from_utf8_lossy(&run.stdout);
        for part in ["chain/chain", "correction/correct", "all parts together"] {
            assert!(table.contains(part), "{target}: {table}");
        }
        std::fs::write(&source, &damaged).unwrap();
        let run = gyrogen(&arguments, None);
        assert_eq!(run.status.code(), Some(1), "{target}");
        assert!(told(&run).contains("correct"), "{}", told(&run));
        std::fs::write(&source, &whole).unwrap();
    }
}

#[test]
fn what_is_missing_is_said_with_what_to_install() {
    let folder = tempfile::tempdir().unwrap();
    let (c, rust) = (emit(folder.path(), "c"), emit(folder.path(), "rust"));
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    for (target, _, package) in TARGETS {
        let run = gyrogen(&["verify", &c, "--target", target], Some(&empty));
        assert_eq!(run.status.code(), Some(2));
        let said = told(&run);
        assert!(said.contains(target) && said.contains(package), "{said}");
        assert!(!Path::new(&c).join("verify.json").exists());

        let run = gyrogen(&["verify", &rust, "--target", target], None);
        assert_eq!(run.status.code(), Some(2));
        assert!(told(&run).contains("in Rust"), "{}", told(&run));
    }
}
