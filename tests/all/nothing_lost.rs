//! Nothing of the user's is lost: inputs are never written over, every failed write is told, an end at any moment leaves
//! nothing behind.

use crate::common::command::{APPROX, good, gyrogen_in, shell, told};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const CAPTURE: &str = "# fs_hz = 224000.0\ndrive_code,sense_code\n";

fn capture() -> String {
    let mut csv = CAPTURE.to_owned();
    for k in 0..512 {
        let turns = std::f64::consts::TAU * f64::from(k) / 32.0;
        csv += &format!("{:.0},{:.0}\n", 9000.0 * turns.cos(), 4000.0 * turns.sin());
    }
    csv
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let mut names: Vec<String> = entries
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn no_command_writes_over_its_input() {
    let top = tempfile::tempdir().expect("a folder");
    let here = top.path();
    let design = "name = \"gyro\"\n";
    let profile = "time_s,chamber_degc\n0,20\n600,40\n";
    let inputs = [
        ("design.toml", design.to_owned()),
        ("record.csv", profile.to_owned()),
        ("c.csv", capture()),
        ("counterexample.csv", capture()),
        ("manifest.json", design.to_owned()),
        ("closure.json", profile.to_owned()),
        ("timing.json", design.to_owned()),
    ];
    for (name, text) in &inputs {
        fs::write(here.join(name), text).expect("written");
    }
    fs::hard_link(here.join("c.csv"), here.join("hard.csv")).expect("a link");
    std::os::unix::fs::symlink("c.csv", here.join("soft.csv")).expect("a link");
    let before = names(here);
    let commands: [&[&str]; 14] = [
        &["run", "design.toml", "--out", "."],
        &["run", "--record", "record.csv", "--out", "."],
        &["run", "timing.json", "--out", "../{}/."],
        &["simulate", "design.toml", "--out", "."],
        &["simulate", "--profile", "record.csv", "--out", "."],
        &["replay", "--capture", "c.csv", "--out", "c.csv"],
        &["replay", "--capture", "c.csv", "--out", "./hard.csv"],
        &["replay", "--capture", "c.csv", "--out", "soft.csv"],
        &["replay", "--capture", "soft.csv", "--out", "hard.csv"],
        &[
            "replay",
            "design.toml",
            "--capture",
            "c.csv",
            "--out",
            "design.toml",
        ],
        &["equiv", "--capture", "counterexample.csv", "--out", "."],
        &["emit", "manifest.json", "--lang", "c", "--out", "."],
        &["close", "--record", "closure.json", "--out", "."],
        &[
            "close",
            "--capture",
            "c.csv",
            "--design",
            "timing.json",
            "--out",
            ".",
        ],
    ];
    let own = here
        .file_name()
        .expect("a name")
        .to_string_lossy()
        .into_owned();
    for arguments in commands {
        let arguments: Vec<String> = arguments.iter().map(|a| a.replace("{}", &own)).collect();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let out = gyrogen_in(here, &arguments, &[]);
        let said = told(&out);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(
            said.contains("would be written over this input"),
            "{arguments:?}: {said}"
        );
        for (name, text) in &inputs {
            assert_eq!(
                &fs::read_to_string(here.join(name)).expect("there"),
                text,
                "{arguments:?}"
            );
        }
        assert_eq!(names(here), before, "{arguments:?}");
    }
}

/// The user's own file in a result's place is refused, and overwritten where that is forced; a result of an earlier call is
/// written over without being asked.
#[test]
fn a_file_of_the_users_own_is_overwritten_by_force_alone() {
    let top = tempfile::tempdir().expect("a folder");
    let here = top.path();
    let commands: [(&[&str], &str); 3] = [
        (
            &["check", "--samples", "1000", "--out", "check"],
            "check/check.json",
        ),
        (
            &["check", "--samples", "1000", "--out", "wall"],
            "wall/timing.json",
        ),
        (&["man", "--out", "man"], "man/gyrogen.1"),
    ];
    for (arguments, name) in commands {
        let own = here.join(name);
        fs::create_dir_all(own.parent().expect("a folder")).expect("made");
        fs::write(&own, "mine").expect("written");
        let out = gyrogen_in(here, arguments, &[]);
        let said = told(&out);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(
            said.contains("would be written over") && said.contains("`--force`"),
            "{said}"
        );
        assert_eq!(fs::read(&own).expect("there"), b"mine", "{arguments:?}");
        let out = gyrogen_in(here, &[arguments, &["--force"]].concat(), &[]);
        good(&out);
        let said = told(&out);
        let file = own.file_name().expect("a name").to_string_lossy();
        assert!(
            said.contains(&format!("--force overwrites: {file} (")),
            "{said}"
        );
        good(&gyrogen_in(here, arguments, &[]));
        // Edited since; of wall times that is not told.
        let written = fs::read_to_string(&own).expect("there");
        fs::write(&own, format!("{written}mine\n")).expect("written");
        let out = gyrogen_in(here, arguments, &[]);
        let is_refused = out.status.code() == Some(2);
        assert_eq!(is_refused, !name.ends_with("timing.json"), "{}", told(&out));
    }
}

#[test]
fn a_link_to_nothing_stays_a_link() {
    let top = tempfile::tempdir().expect("a folder");
    fs::write(top.path().join("c.csv"), capture()).expect("written");
    std::os::unix::fs::symlink("rows.csv", top.path().join("link.csv")).expect("a link");
    let out = gyrogen_in(
        top.path(),
        &["replay", "--capture", "c.csv", "--out", "link.csv"],
        &[],
    );
    good(&out);
    assert!(
        top.path()
            .join("link.csv")
            .symlink_metadata()
            .expect("there")
            .is_symlink()
    );
    assert!(top.path().join("rows.csv").is_file());
}

/// The status of a shell's line, and what it said.
fn line_told(line: &str, folder: &Path) -> (Option<i32>, String) {
    let out = shell(line, folder);
    (out.status.code(), told(&out))
}

#[test]
fn what_cannot_be_printed_is_an_error_unless_nobody_reads() {
    let top = tempfile::tempdir().expect("a folder");
    let approx = APPROX.join(" ").replace("approx", "gyrogen approx");
    for line in [
        "gyrogen init".to_owned(),
        "gyrogen --help".to_owned(),
        format!("{approx} --format json"),
    ] {
        let (status, said) = line_told(&format!("{line} > /dev/full"), top.path());
        assert_eq!(status, Some(2), "{line}: {said}");
        assert!(said.contains("standard output"), "{line}: {said}");
        let (status, said) = line_told(&format!("{line} 2> /dev/full > /dev/null"), top.path());
        assert_eq!(status, Some(0), "{line}: {said}");
        let (status, said) = line_told(&format!("set -o pipefail; {line} | true"), top.path());
        assert_eq!(status, Some(0), "{line}: {said}");
    }
    assert_eq!(
        names(&top.path().join("gyrogen-approx")),
        [
            "SHA256SUMS",
            "approx.json",
            "c",
            "report.html",
            "rust",
            "timing.json"
        ]
    );
}

#[test]
fn a_full_disk_leaves_no_half_bundle() {
    let top = tempfile::tempdir().expect("a folder");
    let approx = APPROX.join(" ").replace("approx", "gyrogen approx");
    // What a file may hold at most stands for what a disk may; 1 KiB holds some of the bundle's files and not others.
    for (limit, out) in [(0, "new/er"), (1, "new/er"), (4, "old"), (1, "old")] {
        fs::create_dir_all(top.path().join("old")).expect("a folder");
        fs::write(top.path().join("old/approx.json"), "earlier").expect("a file");
        let line = format!("trap '' XFSZ; ulimit -f {limit}; {approx} --out {out}");
        let (status, said) = line_told(&line, top.path());
        assert_eq!(status, Some(2), "{said}");
        assert_eq!(names(top.path()), ["old"], "{limit}");
        assert_eq!(names(&top.path().join("old")), ["approx.json"], "{limit}");
        assert_eq!(
            fs::read(top.path().join("old/approx.json")).expect("there"),
            b"earlier"
        );
    }
}

/// Processes that have a text in their arguments.
fn running(text: &str) -> usize {
    let Ok(entries) = fs::read_dir("/proc") else {
        return 0;
    };
    let lines = entries
        .flatten()
        .filter_map(|e| fs::read(e.path().join("cmdline")).ok());
    lines
        .filter(|line| String::from_utf8_lossy(line).contains(text))
        .count()
}

fn waited(what: &str, is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "waited for {what}"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Ends `gyrogen equiv` by a signal while a compiler runs; its folder and the folder of its temporary files.
fn ended_by(signal: &str, top: &Path) {
    let (work, temporary) = (top.join("work"), top.join("temporary"));
    for folder in [&work, &temporary] {
        fs::create_dir_all(folder).expect("a folder");
    }
    let mut child = Command::new(env!("CARGO_BIN_EXE_gyrogen"))
        .args(["equiv", "--samples", "20000", "--out", "new/results"])
        .current_dir(&work)
        .env("TMPDIR", &temporary)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("gyrogen starts");
    let place = temporary.to_string_lossy().into_owned();
    waited("a compiler", || running(&place) > 0);
    let id = child.id().to_string();
    let sent = Command::new("kill")
        .args([signal, &id])
        .status()
        .expect("kill");
    assert!(sent.success());
    let status = child.wait().expect("an end");
    use std::os::unix::process::ExitStatusExt;
    assert!(status.signal().is_some(), "{status}");
}

#[test]
fn an_interrupt_leaves_nothing() {
    for signal in ["-INT", "-TERM"] {
        let top = tempfile::tempdir().expect("a folder");
        ended_by(signal, top.path());
        for folder in ["work", "temporary"] {
            assert!(names(&top.path().join(folder)).is_empty(), "{signal}");
        }
        let place = top.path().to_string_lossy().into_owned();
        waited("the compilers' end", || running(&place) == 0);
    }
}

#[test]
fn the_next_run_removes_what_a_kill_has_left() {
    let top = tempfile::tempdir().expect("a folder");
    ended_by("-KILL", top.path());
    let work = top.path().join("work");
    assert!(
        names(&work)
            .iter()
            .all(|name| name.starts_with(".gyrogen-") && name.ends_with(".tmp"))
    );
    let place = top.path().join("temporary").to_string_lossy().into_owned();
    waited("the compilers' end", || running(&place) == 0);
    let equiv = ["equiv", "--samples", "2000", "--out", "new/results"];
    let out = gyrogen_in(&work, &equiv, &[("TMPDIR", &place)]);
    good(&out);
    assert_eq!(names(&work), ["new"]);
    assert!(names(&top.path().join("temporary")).is_empty());
}
