use super::*;

fn listed(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap().flatten();
    let mut names: Vec<String> = entries
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Wall times, which say by themselves that they are no user's own.
const TIMING: &[u8] = b"{\n  \"schema\": \"gyrogen.timing/1\"\n}\n";

fn bytes_of(name: &str) -> &[u8] {
    match name {
        "timing.json" => TIMING,
        name => name.as_bytes(),
    }
}

fn two(out: &Path) -> Results {
    let mut results = Results::claim(out, &["a.json"], &[]).unwrap();
    results.write("a.json", b"a").unwrap();
    results.write("deep/er/b.txt", b"b").unwrap();
    results
}

#[test]
fn nothing_appears_before_the_end_and_all_of_it_then() {
    let top = tempfile::tempdir().unwrap();
    let new = top.path().join("new/folder");
    let results = two(&new);
    assert!(!top.path().join("new").exists());
    drop(results);
    assert!(listed(top.path()).is_empty());
    // A new folder, and again over its own files.
    for _ in 0..2 {
        two(&new).finish().unwrap();
        assert_eq!(listed(top.path()), ["new"]);
        assert_eq!(listed(&new), ["a.json", "deep"]);
        assert_eq!(fs::read(new.join("deep/er/b.txt")).unwrap(), b"b");
    }
    // A folder that somebody else makes in between.
    let other = top.path().join("other");
    let results = two(&other);
    fs::create_dir(&other).unwrap();
    fs::write(other.join("kept"), "").unwrap();
    results.finish().unwrap();
    assert_eq!(listed(&other), ["a.json", "deep", "kept"]);
}

#[test]
fn a_result_of_an_earlier_run_is_taken_away_at_the_end() {
    let top = tempfile::tempdir().unwrap();
    fs::write(top.path().join("old.csv"), "x").unwrap();
    let mut results = two(top.path());
    results.remove("old.csv");
    results.remove("never.csv");
    assert!(top.path().join("old.csv").exists());
    results.finish().unwrap();
    assert_eq!(listed(top.path()), ["a.json", "deep"]);
}

#[test]
fn a_file_on_the_way_is_named_as_what_it_is() {
    let top = tempfile::tempdir().unwrap();
    let file = top.path().join("file");
    fs::write(&file, "mine").unwrap();
    for (name, said) in [
        ("file", "this is a file, and a folder is wanted"),
        ("file/sub", "cannot make the folder: `"),
        ("file/sub/deep", "cannot make the folder: `"),
    ] {
        let out = top.path().join(name);
        let error = Results::claim(&out, &[], &[]).unwrap_err().to_string();
        assert!(error.contains(&format!("{name}: error: {said}")), "{error}");
        assert!(error.contains("is a file"), "{error}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_of_the_system_is_not_said_to_be_missing() {
    for (out, what) in [
        ("/proc/results", "make the folder"),
        ("/proc/a/b", "make the folder"),
        ("/proc", "write into this folder"),
    ] {
        let error = Results::claim(Path::new(out), &[], &[]).unwrap_err();
        let error = error.to_string();
        let said = format!("{out}: error: cannot {what}: the system takes no new files in `/proc`");
        assert!(error.contains(&said), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn an_input_is_never_written_over_by_any_name() {
    let top = tempfile::tempdir().unwrap();
    let input = top.path().join("input.toml");
    fs::write(&input, "mine").unwrap();
    let out = top.path().join("out");
    fs::create_dir(&out).unwrap();
    let inputs = [input.clone()];
    let refused = |name: &str| {
        let error = Results::claim(&out, &[name], &inputs).unwrap_err();
        assert_eq!(error.exit_status(), 2);
        // A name that is known late is refused as well.
        let mut results = Results::claim(&out, &[], &inputs).unwrap();
        results.write(name, b"").unwrap_err();
    };
    refused("../input.toml");
    fs::hard_link(&input, out.join("hard")).unwrap();
    refused("hard");
    std::os::unix::fs::symlink(&input, out.join("soft")).unwrap();
    refused("soft");
    std::os::unix::fs::symlink(top.path(), out.join("up")).unwrap();
    refused("up/input.toml");
    // The side-car of a capture is read as well.
    for name in ["input.npy", "input.raw", "input.csv", "input.csv.gz"] {
        let capture = top.path().join(name);
        fs::write(&capture, "").unwrap();
        assert!(
            Results::claim(top.path(), &["input.toml"], &[capture]).is_err(),
            "{name}"
        );
    }
    let capitals = top.path().join("CAP.TOML");
    fs::write(&capitals, "mine").unwrap();
    let capture = [top.path().join("CAP.BIN")];
    assert!(Results::claim(top.path(), &["CAP.TOML"], &capture).is_err());
    assert!(Results::claim(top.path(), &["input.toml"], &[]).is_ok());
    assert_eq!(fs::read(&input).unwrap(), b"mine");
}

#[cfg(unix)]
#[test]
fn links_stay_links_and_permissions_stay() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let top = tempfile::tempdir().unwrap();
    let (out, far) = (top.path().join("out"), top.path().join("far"));
    for folder in [&out, &far] {
        fs::create_dir(folder).unwrap();
    }
    fs::write(far.join("real"), "old").unwrap();
    fs::set_permissions(far.join("real"), fs::Permissions::from_mode(0o640)).unwrap();
    symlink(far.join("real"), out.join("a.json")).unwrap();
    symlink("../far", out.join("deep")).unwrap();
    symlink("../far/missing", out.join("dangling")).unwrap();
    let mut results = two(&out);
    results.write("dangling", b"d").unwrap();
    results.finish().unwrap();
    for name in ["a.json", "deep", "dangling"] {
        let found = out.join(name).symlink_metadata().unwrap();
        assert!(found.is_symlink(), "{name}");
    }
    assert_eq!(fs::read(far.join("real")).unwrap(), b"a");
    let mode = far.join("real").metadata().unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o640);
    assert_eq!(fs::read(far.join("er/b.txt")).unwrap(), b"b");
    assert_eq!(fs::read(far.join("missing")).unwrap(), b"d");
}

#[test]
fn what_cannot_be_a_folder_is_refused_before_the_work() {
    let top = tempfile::tempdir().unwrap();
    let file = top.path().join("file");
    fs::write(&file, "kept").unwrap();
    for out in [file.clone(), file.join("below")] {
        let error = Results::claim(&out, &["a.json"], &[]).unwrap_err();
        assert_eq!(error.exit_status(), 2, "{error}");
    }
    fs::create_dir(top.path().join("a.json")).unwrap();
    assert!(Results::claim(top.path(), &["a.json"], &[]).is_err());
    assert_eq!(listed(top.path()), ["a.json", "file"]);
    assert_eq!(fs::read(&file).unwrap(), b"kept");
}

#[test]
fn a_users_own_design_is_not_taken_for_an_earlier_result() {
    let top = tempfile::tempdir().unwrap();
    let planned = ["record.csv", "design.toml", "summary.json"];
    fs::write(top.path().join("design.toml"), "mine").unwrap();
    let error = Results::claim(top.path(), &planned, &[]).unwrap_err();
    assert_eq!(error.exit_status(), 2);
    assert!(
        error.to_string().contains("no result of an earlier run"),
        "{error}"
    );
    // A report and a list of sums may be the user's as well.
    fs::remove_file(top.path().join("design.toml")).unwrap();
    fs::write(top.path().join("SHA256SUMS"), "0  holiday.jpg\n").unwrap();
    assert!(Results::claim(top.path(), &planned, &[]).is_err());
    assert_eq!(
        fs::read(top.path().join("SHA256SUMS")).unwrap(),
        b"0  holiday.jpg\n"
    );
}

#[test]
fn a_result_that_was_edited_is_not_written_over() {
    let top = tempfile::tempdir().unwrap();
    let planned = ["summary.json", "design.toml", "timing.json"];
    let write = || {
        let mut results = Results::claim(top.path(), &planned, &[])?;
        for name in planned {
            results.write(name, bytes_of(name))?;
        }
        results.finish()
    };
    write().unwrap();
    // Wall times are no result, but a file of that name may be the user's.
    fs::write(top.path().join("timing.json"), [TIMING, b"\n"].concat()).unwrap();
    write().unwrap();
    fs::write(top.path().join("timing.json"), "mine").unwrap();
    let told = write().unwrap_err().to_string();
    assert!(
        told.contains("timing.json") && told.contains("gyrogen did not write it"),
        "{told}"
    );
    fs::write(top.path().join("timing.json"), TIMING).unwrap();
    let sums = fs::read_to_string(top.path().join("SHA256SUMS")).unwrap();
    assert!(sums.contains("  summary.json\n") && !sums.contains("timing.json"));
    fs::write(top.path().join("design.toml"), "mine").unwrap();
    let told = write().unwrap_err().to_string();
    assert!(told.contains("edited since it was written"), "{told}");
    assert_eq!(fs::read(top.path().join("design.toml")).unwrap(), b"mine");
}

#[test]
fn results_of_another_command_are_not_written_over() {
    const SIMULATE: [&str; 3] = ["simulate.json", "report.html", "timing.json"];
    const CLOSE: [&str; 3] = ["closure.json", "report.html", "timing.json"];
    const EQUIV: [&str; 3] = ["equiv.json", "equiv.html", "timing.json"];
    let top = tempfile::tempdir().unwrap();
    let write = |planned: &[&str]| {
        let mut results = Results::claim(top.path(), planned, &[])?;
        for name in planned {
            let bytes = if *name == "timing.json" {
                TIMING
            } else {
                planned[0].as_bytes()
            };
            results.write(name, bytes)?;
        }
        results.finish()
    };
    write(&SIMULATE).unwrap();
    let told = write(&CLOSE).unwrap_err().to_string();
    for part in ["report.html", "simulate.json lies beside it", "--out"] {
        assert!(told.contains(part), "{told}");
    }
    assert_eq!(
        fs::read(top.path().join("report.html")).unwrap(),
        b"simulate.json"
    );
    // Its own results a command does write over, and what shares no name but the wall time's gets on with it.
    write(&SIMULATE).unwrap();
    write(&EQUIV).unwrap();
    write(&SIMULATE).unwrap();
    assert!(write(&CLOSE).is_err());
}

#[test]
fn what_is_forced_is_named_and_results_of_another_command_stay() {
    let top = tempfile::tempdir().unwrap();
    let force = |planned: &[&str]| Results::claim_forced(top.path(), planned, &[], true);
    let mut results = force(&["check.json"]).unwrap();
    assert!(results.lost().is_empty());
    results.write("check.json", b"1").unwrap();
    results.finish().unwrap();
    for name in ["check.json", "timing.json", "report.html"] {
        fs::write(top.path().join(name), "mine").unwrap();
    }
    let mut results = force(&["check.json", "timing.json", "study.json", "report.html"]).unwrap();
    assert_eq!(
        results.lost(),
        [
            "check.json (edited)",
            "timing.json (not as gyrogen wrote it)",
            "report.html (no result of an earlier run)"
        ]
    );
    for name in ["study.json", "report.html"] {
        results.write(name, b"2").unwrap();
    }
    results.finish().unwrap();
    assert_eq!(fs::read(top.path().join("report.html")).unwrap(), b"2");
    let told = force(&["closure.json", "report.html"])
        .unwrap_err()
        .to_string();
    assert!(
        told.contains("study.json lies beside it") && !told.contains("--force"),
        "{told}"
    );
    // An input is none of what is forced.
    let input = [top.path().join("study.json")];
    assert!(Results::claim_forced(top.path(), &["study.json"], &input, true).is_err());
}

#[test]
fn what_an_earlier_run_made_and_this_one_does_not_goes_unless_it_was_edited() {
    let top = tempfile::tempdir().unwrap();
    let planned = ["summary.json", "record.csv"];
    let write = |names: &[&str], inputs: &[PathBuf]| {
        let mut results = Results::claim_forced(top.path(), &planned, inputs, true).unwrap();
        results.replaces("designs/");
        for name in names {
            results.write(name, bytes_of(name)).unwrap();
        }
        results.finish().unwrap();
        fs::read_to_string(top.path().join("SHA256SUMS")).unwrap()
    };
    let all = [
        "summary.json",
        "record.csv",
        "designs/1.toml",
        "designs/2.toml",
        "other.csv",
    ];
    write(&all, &[]);
    // What no list names is the user's.
    fs::write(top.path().join("designs/mine.toml"), "mine").unwrap();
    let list = write(&["summary.json", "designs/1.toml"], &[]);
    assert_eq!(listed(&top.path().join("designs")), ["1.toml", "mine.toml"]);
    assert!(
        !list.contains("record.csv") && !list.contains("2.toml"),
        "{list}"
    );
    assert!(
        list.contains("other.csv"),
        "it is none of this command's: {list}"
    );
    assert!(!top.path().join("record.csv").exists());
    // Edited: it stays, and is no longer listed. So does an input.
    write(&all, &[]);
    fs::write(top.path().join("record.csv"), "mine").unwrap();
    let list = write(&["summary.json"], &[top.path().join("designs/1.toml")]);
    assert_eq!(fs::read(top.path().join("record.csv")).unwrap(), b"mine");
    assert!(
        !list.contains("record.csv") && list.contains("designs/1.toml"),
        "{list}"
    );
    assert_eq!(listed(&top.path().join("designs")), ["1.toml", "mine.toml"]);
    // A folder that has become empty goes with its last file.
    fs::remove_file(top.path().join("designs/mine.toml")).unwrap();
    write(&["summary.json"], &[]);
    assert_eq!(
        listed(top.path()),
        ["SHA256SUMS", "other.csv", "record.csv", "summary.json"]
    );
}
