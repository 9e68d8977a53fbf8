//! `gyrogen verify` knows what a bundle must hold, takes nothing on trust that comes with it, and waits for no
//! program without end.

use crate::common::command::{good, gyrogen, gyrogen_in, told};
use crate::common::files::copy;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// A correction's bundle in C: small, and with vectors, tables in no number and a sequence.
const DESIGN: &str = r#"
name = "tested"
[correction]
period_s = 1.0
full_scale_dps = 100.0
noise_dps = 1e-2
inputs = [{ column = "die_degc", offset = 25.0, scale = 50.0 }]
terms = [
    { kind = "product", gain_dps = 10.0, factors = [] },
    { kind = "product", gain_dps = 5.0, factors = [[0, 1]] },
    { kind = "lag", gain_dps = 1.0, input = 0, tau_s = 60.0 },
]
"#;

/// The bundle, emitted once, and its digest.
pub(crate) fn whole() -> &'static (tempfile::TempDir, String) {
    static WHOLE: OnceLock<(tempfile::TempDir, String)> = OnceLock::new();
    WHOLE.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("design.toml"), DESIGN).expect("written");
        let emitted = gyrogen(
            &["emit", "design.toml", "--lang", "c", "--out", "c"],
            folder.path(),
        );
        good(&emitted);
        let digest = told(&emitted)
            .lines()
            .find_map(|l| l.strip_prefix("digest ").map(str::to_owned));
        (folder, digest.expect("a digest"))
    })
}

/// A copy of the bundle in a folder of its own.
pub(crate) fn bundle() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path().join("c");
    copy(&whole().0.path().join("c"), &at);
    (folder, at)
}

pub(crate) fn sha256(bytes: &[u8]) -> String {
    gyrogen::digest::sha256(bytes)
}

/// What is said of a manifest, and how it is changed.
type Damage = (&'static str, fn(&mut Value));

/// Changes the manifest and seals it again, with the files as they are.
fn reseal(at: &Path, change: impl FnOnce(&mut Value)) {
    let path = at.join("manifest.json");
    let text = std::fs::read_to_string(&path).expect("a manifest");
    let mut value: Value = serde_json::from_str(&text).expect("JSON");
    let mut sums = String::new();
    for file in value["files"].as_array_mut().expect("files") {
        let name = file["path"].as_str().expect("a path").to_owned();
        if name == "SHA256SUMS" {
            std::fs::write(at.join(&name), &sums).expect("written");
        }
        if let Ok(bytes) = std::fs::read(at.join(&name)) {
            file["sha256"] = sha256(&bytes).into();
            sums += &format!("{}  {name}\n", sha256(&bytes));
        }
    }
    change(&mut value);
    let typed: Result<gyrogen::firmware::manifest::Manifest, _> =
        serde_json::from_value(value.clone());
    let text = match typed {
        Ok(manifest) => manifest.to_json(),
        Err(_) => value.to_string(),
    };
    std::fs::write(path, text).expect("written");
}

/// `verify` fails with this status and says so.
pub(crate) fn refused(at: &Path, status: i32, text: &str) {
    let output = gyrogen(&["verify", "c"], at.parent().expect("a parent"));
    assert_eq!(
        output.status.code(),
        Some(status),
        "{text}: {}",
        told(&output)
    );
    assert!(told(&output).contains(text), "{text}: {}", told(&output));
}

#[test]
fn a_bundle_holds_against_its_digest_and_its_design() {
    let (folder, digest) = whole();
    let output = gyrogen(
        &[
            "verify",
            "c",
            "--digest",
            digest,
            "--design",
            "design.toml",
            "--out",
            ".",
        ],
        folder.path(),
    );
    good(&output);
    let json = std::fs::read_to_string(folder.path().join("verify.json")).expect("a result");
    assert!(json.contains(digest), "{json}");
    let (other, at) = bundle();
    std::fs::write(
        other.path().join("design.toml"),
        DESIGN.replace("10.0, factors", "10.1, factors"),
    )
    .expect("written");
    let output = gyrogen(&["verify", "c", "--design", "design.toml"], other.path());
    assert_eq!(output.status.code(), Some(1));
    assert!(
        told(&output).contains("files are not what the design emits: ")
            && told(&output).contains("the files are those of the manifest"),
        "{}",
        told(&output)
    );
    // A design without a correction is named, and what is wanted in its place.
    std::fs::write(other.path().join("design.toml"), "# nothing yet\n").expect("written");
    let output = gyrogen(&["verify", "c", "--design", "design.toml"], other.path());
    assert_eq!(output.status.code(), Some(2));
    for words in [
        "note: design.toml sets nothing",
        "design.toml: error: the bundle is a correction, and this design has no [correction]",
    ] {
        assert!(told(&output).contains(words), "{}", told(&output));
    }
    // Sealed again with another command, all of it is right but for the digest.
    let command = "gyrogen emit other.toml --lang c";
    let before = "gyrogen emit design.toml --lang c";
    for name in [
        "tested_correction.c",
        "tested_correction.h",
        "tested_correction_arith.h",
        "tested_correction_selftest.c",
        "tested_correction_tables.c",
        "tested_correction_tables.h",
        "test/tested_correction_harness.c",
        "Makefile",
        "CMakeLists.txt",
        "README.md",
    ] {
        let text = std::fs::read_to_string(at.join(name)).expect("a source");
        std::fs::write(at.join(name), text.replace(before, command)).expect("written");
    }
    reseal(&at, |m| m["command"] = command.into());
    let output = gyrogen(&["verify", "c"], other.path());
    good(&output);
    let output = gyrogen(&["verify", "c", "--digest", digest], other.path());
    assert_eq!(output.status.code(), Some(1));
    assert!(told(&output).contains("digest"), "{}", told(&output));
    let output = gyrogen(&["verify", "c", "--digest", "12"], other.path());
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn what_a_bundle_must_hold_is_not_read_from_its_manifest() {
    let damages: [Damage; 9] = [
        ("lacks tested_correction.c", |m| {
            m["files"] = Value::Array(Vec::new())
        }),
        ("no vectors of `correct`", |m| {
            m["functions"] = Value::Array(Vec::new())
        }),
        ("lacks `sequence`", |m| m["sequence"] = Value::Null),
        ("lacks `long_run`", |m| m["long_run"] = Value::Null),
        ("fewer than", |m| m["long_run"]["steps"] = 1.into()),
        ("comes from", |m| m["version"] = "9.9.9".into()),
        ("comes from", |m| m["design_sha256"] = "0".into()),
        ("count from 1", |m| m["functions"][0]["number"] = 7.into()),
        ("which no such bundle has", |m| {
            let files = m["files"].as_array_mut().expect("files");
            files.push(serde_json::json!({ "path": "more.c", "sha256": "" }));
        }),
    ];
    for (text, change) in damages {
        let (_folder, at) = bundle();
        reseal(&at, change);
        refused(&at, 1, text);
    }
    // Values that nothing else knows: the seal.
    let (_folder, at) = bundle();
    let path = at.join("manifest.json");
    let text = std::fs::read_to_string(&path).expect("a manifest");
    let sealed = text.find("\"seal\": \"").expect("a seal") + 9;
    std::fs::write(
        &path,
        format!("{}0000{}", &text[..sealed], &text[sealed + 4..]),
    )
    .expect("written");
    refused(&at, 1, "seal");
    // Checksums for who has no gyrogen that are those of other files.
    let (_folder, at) = bundle();
    reseal(&at, |m| {
        let files = m["files"].as_array_mut().expect("files");
        let sums = files.iter_mut().find(|f| f["path"] == "SHA256SUMS");
        sums.expect("an entry")["sha256"] = sha256(b"").into();
    });
    std::fs::write(at.join("SHA256SUMS"), "").expect("written");
    refused(&at, 1, "SHA256SUMS is not of these files");
    // Vectors cut to their header, a source that is not listed, a wrecked source that is.
    let (_folder, at) = bundle();
    for name in ["correct", "sequence"] {
        let path = at.join(format!("vectors/{name}.csv"));
        let text = std::fs::read_to_string(&path).expect("vectors");
        std::fs::write(
            &path,
            text.lines().next().expect("a header").to_owned() + "\n",
        )
        .expect("written");
    }
    reseal(&at, |_| ());
    refused(&at, 1, "nothing of `correct` was compared");
    let (_folder, at) = bundle();
    std::fs::write(at.join("extra.c"), "int extra;\n").expect("written");
    refused(&at, 1, "extra.c");
    let (_folder, at) = bundle();
    std::fs::write(at.join("tested_correction.c"), "int nothing;\n").expect("written");
    refused(&at, 1, "");
}

#[test]
fn dropped_outputs_and_states_are_noticed() {
    let (_folder, at) = bundle();
    let path = at.join("tested_correction.c");
    let text = std::fs::read_to_string(&path).expect("a source");
    let store = text
        .lines()
        .find(|l| l.trim().starts_with("s->lag_input_1 = "))
        .expect("a store");
    std::fs::write(&path, text.replace(store, "")).expect("written");
    reseal(&at, |_| ());
    refused(&at, 1, "correct (c): first difference");
}

#[test]
fn a_changed_file_is_named_also_where_it_does_not_compile() {
    let (_folder, at) = bundle();
    let path = at.join("tested_correction.c");
    let text = std::fs::read_to_string(&path).expect("a source");
    std::fs::write(&path, format!("{text}}}\n")).expect("written");
    refused(
        &at,
        1,
        "files differ from the manifest: tested_correction.c",
    );
    // The compiler's first line names the file; each fact has a line.
    let places = "\n  the changed files do not compile: tested_correction.c:";
    refused(&at, 1, places);
    refused(&at, 1, "\n  help: write the bundle again with ");
    // That alone is said of the build, and where the result is.
    let output = gyrogen(&["verify", "c"], at.parent().expect("a parent"));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        said.contains("self-test: not run: the changed files do not compile\n"),
        "{said}"
    );
    assert!(!said.contains("nothing was built"), "{said}");
    let result = Path::new("c").join("verify.json");
    assert!(
        said.contains(&format!("wrote {}\n", result.display())),
        "{said}"
    );
    let last = said.lines().last().unwrap_or("");
    assert!(
        last == "verdict: does not hold" && !said.contains("files differ"),
        "{said}"
    );
    // No file of somebody's own is there to be moved.
    let told = told(&output);
    assert!(
        !told.contains("files of your own") && told.contains("`gyrogen emit"),
        "{told}"
    );
    assert!(at.join("verify.json").is_file());
}

/// Somebody who names a file of a bundle is told the folder.
#[test]
fn a_file_of_a_bundle_is_no_bundle_and_its_folder_is_named() {
    let (folder, at) = bundle();
    std::fs::write(folder.path().join("alone.c"), "").expect("written");
    for (file, help) in [
        ("c/manifest.json", "did you mean the folder c?"),
        (
            "c/test/tested_correction_harness.c",
            "did you mean the folder c?",
        ),
        ("alone.c", "give the folder of sources"),
    ] {
        let output = gyrogen(&["verify", file], folder.path());
        let said = told(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(
            said.contains("this is a file, and `verify` takes"),
            "{said}"
        );
        assert!(
            said.contains(help) && !said.contains("no bundle is here"),
            "{said}"
        );
    }
    let output = gyrogen(&["verify", "tested_correction.c"], &at);
    let said = told(&output);
    assert!(said.contains("did you mean the folder .?"), "{said}");
    assert!(!at.join("verify.json").exists());
}

#[test]
fn manifests_that_cannot_be_are_refused_without_a_panic() {
    let damages: [Damage; 7] = [
        ("more than", |m| {
            m["functions"][0]["inputs"] = u64::MAX.into()
        }),
        ("no name", |m| {
            m["functions"][0]["name"] = "../../../etc/passwd".into()
        }),
        ("no name", |m| m["prefix"] = "-o".into()),
        ("plain path", |m| {
            m["files"][0]["path"] = "../../etc/passwd".into()
        }),
        ("its part", |m| m["part"] = "all of it".into()),
        ("its language", |m| m["language"] = "cobol".into()),
        ("control character", |m| m["command"] = "\u{1b}[2J".into()),
    ];
    for (text, change) in damages {
        let (_folder, at) = bundle();
        reseal(&at, change);
        refused(&at, 2, text);
    }
}

/// What mends a bundle names every command that writes one.
#[test]
fn a_bundle_that_is_cut_off_or_lacks_a_file_is_told_to_be_written_again() {
    let (folder, at) = bundle();
    let manifest = at.join("manifest.json");
    let text = std::fs::read_to_string(&manifest).expect("a manifest");
    let remedy =
        "the command that made it: `gyrogen run`, `close`, `emit` or `approx`, with `--force`";
    std::fs::write(&manifest, &text[..text.len() / 2]).expect("written");
    let output = gyrogen(&["verify", "c"], folder.path());
    assert_eq!(output.status.code(), Some(2), "{}", told(&output));
    assert!(told(&output).contains(remedy), "{}", told(&output));
    std::fs::write(&manifest, &text).expect("written");
    std::fs::remove_dir_all(at.join("vectors")).expect("removed");
    let output = gyrogen(&["verify", "c"], folder.path());
    assert_ne!(output.status.code(), Some(0), "{}", told(&output));
    assert!(
        !told(&output).contains("check the path"),
        "{}",
        told(&output)
    );
    assert!(told(&output).contains("vectors/"), "{}", told(&output));
}

#[cfg(unix)]
#[test]
fn links_pipes_and_endless_files_are_not_opened() {
    let link = |to: &str, at: &Path| std::os::unix::fs::symlink(to, at);
    for name in [
        "tested_correction.c",
        "vectors/correct.csv",
        "manifest.json",
    ] {
        for target in ["/dev/zero", "/etc/passwd"] {
            let (_folder, at) = bundle();
            std::fs::remove_file(at.join(name)).expect("removed");
            link(target, &at.join(name)).expect("a link");
            let output = gyrogen(&["verify", "c"], at.parent().expect("a parent"));
            assert_ne!(output.status.code(), Some(0));
            assert!(!told(&output).contains("root:"), "{}", told(&output));
        }
        let (_folder, at) = bundle();
        std::fs::remove_file(at.join(name)).expect("removed");
        let made = Command::new("mkfifo")
            .arg(at.join(name))
            .status()
            .expect("mkfifo");
        assert!(made.success());
        let started = Instant::now();
        let output = gyrogen(&["verify", "c"], at.parent().expect("a parent"));
        assert_ne!(output.status.code(), Some(0));
        assert!(started.elapsed() < Duration::from_secs(30), "{name}");
    }
    // The result replaces no file elsewhere.
    let (folder, at) = bundle();
    std::fs::write(folder.path().join("victim"), "mine").expect("written");
    link("../victim", &at.join("verify.json")).expect("a link");
    refused(&at, 2, "link");
    assert_eq!(
        std::fs::read_to_string(folder.path().join("victim")).expect("read"),
        "mine"
    );
}

/// A file in the result's place that `verify` did not write is the user's.
#[test]
fn a_result_replaces_no_file_of_the_users_own() {
    let (folder, at) = bundle();
    let own = at.join("verify.json");
    std::fs::write(&own, "mine").expect("written");
    refused(&at, 2, "gyrogen did not write it");
    assert_eq!(std::fs::read_to_string(&own).expect("read"), "mine");
    for more in [&["--force"][..], &[]] {
        good(&gyrogen(&[&["verify", "c"], more].concat(), folder.path()));
    }
}

#[test]
fn a_folder_with_the_name_of_an_option_is_a_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    copy(&whole().0.path().join("c"), &folder.path().join("-dir"));
    let output = gyrogen(&["verify", "--", "-dir"], folder.path());
    good(&output);
}

#[cfg(unix)]
#[test]
fn a_compiler_may_have_arguments_and_may_not_hang() {
    let (folder, _) = bundle();
    let here = folder.path();
    let output = gyrogen_in(here, &["verify", "c"], &[("CC", "cc -O1")]);
    good(&output);
    let output = gyrogen_in(here, &["verify", "c"], &[("CC", "/bin/false")]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        told(&output).contains("/bin/false") && !told(&output).contains("there is no compiler"),
        "{}",
        told(&output)
    );
    let slow = here.join("slow");
    std::fs::write(
        &slow,
        "[ \"$1\" = --version ] && { echo slow 1; exit; }\nsleep 100 & wait\n",
    )
    .expect("written");
    // Nothing is executable that this process has written: another test's child may still hold it open.
    let name = format!("sh {}", slow.display());
    let started = Instant::now();
    let output = gyrogen_in(
        here,
        &["verify", "c"],
        &[("CC", &name), ("GYROGEN_TIME_LIMIT", "1")],
    );
    assert_eq!(output.status.code(), Some(1));
    assert!(
        told(&output).contains("did not end within 1 s"),
        "{}",
        told(&output)
    );
    assert!(started.elapsed() < Duration::from_secs(20));
}

#[cfg(unix)]
#[test]
fn a_harness_that_hangs_or_floods_is_ended() {
    for body in ["for (;;) { }", "for (;;) { (void)puts(\"flood\"); }"] {
        let (folder, at) = bundle();
        let path = at.join("test/tested_correction_harness.c");
        let text = std::fs::read_to_string(&path).expect("a source");
        let start = text
            .find("    const char *mode = ")
            .expect("the main function");
        let damaged = format!("{}    {body}\n{}", &text[..start], &text[start..]);
        std::fs::write(&path, damaged).expect("written");
        reseal(&at, |_| ());
        let started = Instant::now();
        let output = gyrogen_in(
            folder.path(),
            &["verify", "c"],
            &[("GYROGEN_TIME_LIMIT", "5")],
        );
        assert_eq!(output.status.code(), Some(1), "{}", told(&output));
        assert!(started.elapsed() < Duration::from_secs(60));
    }
}
