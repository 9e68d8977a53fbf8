//! `gyrogen study` as a user runs it, on spaces that are small enough to be searched whole.

use crate::common::command::{good, gyrogen_here, text, told};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// Three words and 175 designs, searched whole (`exhaustive` of at least that) or not.
fn design(folder: &Path, exhaustive: u32, more: &str) -> PathBuf {
    let text = format!(
        "[study]\nwords = [\"circuit.demodulator.product\", \"circuit.cordic.iterations\", \
         \"compensation.output\"]\ntargets = [\"cortex-m4\"]\nexhaustive = {exhaustive}\n[study.ranges]\n\
         \"circuit.demodulator.product\" = [14, 20]\n\"circuit.cordic.iterations\" = [12, 16]\n\
         \"compensation.output\" = [18, 22]\n{more}"
    );
    let path = folder.join("small.toml");
    std::fs::write(&path, text).expect("writes");
    path
}

fn study(arguments: &[&str], out: &Path) -> Output {
    gyrogen_here(&[&["study"], arguments, &["--out", text(out)]].concat())
}

fn bytes(out: &Path) -> Vec<u8> {
    std::fs::read(out.join("study.json")).expect("study.json")
}

fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).expect("JSON")
}

/// The whole space by two threads: `study.json`.
fn whole() -> &'static Vec<u8> {
    static WHOLE: OnceLock<Vec<u8>> = OnceLock::new();
    WHOLE.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let file = design(folder.path(), 2000, "");
        let out = folder.path().join("out");
        let done = study(&[file.to_str().expect("UTF-8"), "--threads", "2"], &out);
        good(&done);
        assert!(!out.join("study.journal").exists());
        assert!(out.join("report.html").exists());
        // Every point's file is a design, and says what the point says.
        let result = json(&bytes(&out));
        for point in result["front"].as_array().expect("a front") {
            let path = out.join(point["design"].as_str().expect("a file"));
            let design = gyrogen::design::reader::read(Some(&path)).expect("a design");
            let lengths = &point["word_lengths"];
            assert_eq!(
                lengths["circuit.cordic.iterations"],
                design.circuit.cordic.iterations
            );
            let product = design.circuit.demodulator.product.format.bits();
            assert_eq!(lengths["circuit.demodulator.product"], product);
        }
        bytes(&out)
    })
}

fn front(study: &Value) -> Vec<(Value, Value, Value)> {
    let points = study["front"].as_array().expect("a front").iter();
    points
        .map(|p| {
            (
                p["word_lengths"].clone(),
                p["price"].clone(),
                p["merit"].clone(),
            )
        })
        .collect()
}

#[test]
fn the_search_finds_the_front_of_the_whole_space() {
    let whole = json(whole());
    assert_eq!(whole["method"], "exhaustive");
    assert!(whole["designs_simulated"].as_u64() >= Some(175));
    let folder = tempfile::tempdir().expect("a folder");
    let file = design(folder.path(), 0, "");
    let out = folder.path().join("out");
    let done = study(&[file.to_str().expect("UTF-8")], &out);
    good(&done);
    let searched = json(&bytes(&out));
    assert_eq!(searched["method"], "search");
    assert!(front(&whole).len() >= 2);
    assert_eq!(front(&searched), front(&whole));
    // Nothing on the front is beaten, and all of it was run again.
    let points = front(&whole);
    for pair in points.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        assert!(
            a.2.as_f64() > b.2.as_f64() && a.1["cortex-m4"].as_f64() < b.1["cortex-m4"].as_f64()
        );
    }
}

#[test]
fn threads_shards_and_a_kill_leave_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = design(folder.path(), 2000, "");
    let file = file.to_str().expect("UTF-8");
    let parts: Vec<PathBuf> = (1..=3)
        .map(|k| folder.path().join(format!("part{k}")))
        .collect();
    for (k, part) in parts.iter().enumerate() {
        let done = study(&[file, "--shard", &format!("{}/3", k + 1)], part);
        good(&done);
    }
    let names: Vec<&str> = parts.iter().map(|p| p.to_str().expect("UTF-8")).collect();
    let out = folder.path().join("merged");
    let some = study(&[file, "--merge", names[0], names[2]], &out);
    assert_eq!(some.status.code(), Some(2));
    assert!(told(&some).contains("2/3 is missing"));
    let all = study(
        &[
            file,
            "--threads",
            "1",
            "--merge",
            names[0],
            names[1],
            names[2],
        ],
        &out,
    );
    good(&all);
    assert!(&bytes(&out) == whole(), "merged");

    let out = folder.path().join("killed");
    let mut command = Command::new(env!("CARGO_BIN_EXE_gyrogen"));
    let mut running = command
        .args(["study", file, "--threads", "1", "--out"])
        .arg(&out)
        .spawn()
        .expect("starts");
    let journal = out.join("study.journal");
    let lines = || std::fs::read_to_string(&journal).map_or(0, |t| t.lines().count());
    while lines() < 60 && running.try_wait().expect("runs").is_none() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let _ = running.kill();
    let _ = running.wait();
    let known = lines();
    let again = study(&[file], &out);
    good(&again);
    assert!(&bytes(&out) == whole(), "resumed after {known} lines");
}

#[test]
fn limits_are_met_by_the_cheapest_or_the_word_in_the_way_is_named() {
    let whole = json(whole());
    let points = whole["front"].as_array().expect("a front");
    let noise = |k: usize| points[k]["noise_dps_rthz"].as_f64().expect("a number");
    // Between two points of the front.
    let k = points.len() / 2;
    let limit = (noise(k - 1) * noise(k)).sqrt();
    let folder = tempfile::tempdir().expect("a folder");
    let file = design(folder.path(), 2000, "");
    let file = file.to_str().expect("UTF-8");
    let out = folder.path().join("out");
    let done = study(&[file, "--for", &format!("noise_dps_rthz<={limit}")], &out);
    good(&done);
    let result = json(&bytes(&out));
    let number = result["chosen"][0]["point"].as_u64().expect("a point") as usize;
    let chosen = &result["front"][number - 1];
    assert!(chosen["noise_dps_rthz"].as_f64() <= Some(limit));
    let steps = result["chosen"][0]["sensitivity"]
        .as_array()
        .expect("steps");
    assert_eq!(steps.len(), 6);
    let done = study(&[file, "--for", "noise_dps_rthz<=1e-9 bias_dps<=0.5"], &out);
    assert_eq!(done.status.code(), Some(1));
    let said = told(&done);
    assert!(
        said.contains("noise_dps_rthz cannot be met") && said.contains("limited by `"),
        "{said}"
    );
    for wrong in [
        "noise<=1",
        "bias_dps>=1",
        "bias_dps<=-1",
        "bias_dps<=0.1 bias_dps<=0.2",
        "",
    ] {
        let done = study(&[file, "--for", wrong], &out);
        assert_eq!(done.status.code(), Some(2), "{wrong}");
    }
}

/// The default with some of its text changed, and a space of 70 designs, searched whole.
/// Designs of an earlier study go and are said to; what the user wrote or edited stays.
#[test]
fn a_study_replaces_an_earlier_one_and_nothing_of_the_users() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = design(folder.path(), 2000, "");
    let file = file.to_str().expect("UTF-8");
    let out = folder.path().join("out");
    std::fs::create_dir(&out).expect("a folder");
    std::fs::write(out.join("report.html"), "mine").expect("written");
    let asked = ["--for", "bias_dps<=1"];
    let limited = |more: &[&str]| study(&[&[file], &asked[..], more].concat(), &out);
    let refused = limited(&[]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(told(&refused).contains("no result of an earlier run"));
    let own = std::fs::read_to_string(out.join("report.html"));
    assert_eq!(own.expect("there"), "mine");
    good(&study(&[file, "--force"], &out));
    let designs = || {
        let entries = std::fs::read_dir(out.join("designs")).expect("designs");
        let names = entries
            .flatten()
            .map(|e| e.file_name().into_string().expect("UTF-8"));
        let mut names: Vec<String> = names.map(|name| format!("designs/{name}")).collect();
        names.sort();
        names
    };
    let of = |key: &str| {
        let json = json(&bytes(&out));
        let front = json["front"].as_array().expect("a front").clone();
        let names = front
            .iter()
            .map(|p| p[key].as_str().expect("a file").to_owned());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    };
    let first = of("design");
    assert_eq!(designs(), first);
    // With limits the front is another one.
    let said = limited(&[]);
    good(&said);
    assert!(told(&said).contains("of another design or limits: they were replaced"));
    assert!(of("design") != first, "the test needs fronts of two sizes");
    assert_eq!(designs(), of("design"));
    // An edited design is not written over.
    let edited = out.join(&designs()[0]);
    std::fs::write(&edited, "mine").expect("written");
    let refused = limited(&[]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(told(&refused).contains("it was edited since it was written"));
    // Neither is a file that has the name of a part.
    std::fs::write(out.join("shard-1-of-9.runs"), "mine").expect("written");
    let refused = study(&[file, "--shard", "1/9"], &out);
    assert_eq!(refused.status.code(), Some(2));
    assert!(told(&refused).contains("gyrogen did not write it"));
}

fn changed(folder: &Path, changes: &[(&str, &str)]) -> PathBuf {
    let mut text = include_str!("../../src/design/default.toml").to_owned();
    let space = "[study]\nwords = [\"circuit.demodulator.product\", \"circuit.cordic.angle_bits\"]";
    let ranges = "[study.ranges]\n\"circuit.demodulator.product\" = [12, 25]\n\"circuit.cordic.angle_bits\" = [16, 24]";
    for (from, to) in changes
        .iter()
        .copied()
        .chain([("[study]", space), ("#[study.ranges]", ranges)])
    {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    let path = folder.join("changed.toml");
    std::fs::write(&path, text).expect("writes");
    path
}

/// Loops, a coarse converter and an oscillator off its grid: each study ends, every point's bounds are around its
/// figures, its start ends within the limit of the bias, and its file is a design that `check` takes.
#[test]
fn designs_with_a_phase_loop_a_coarse_converter_and_a_free_tuning_word_are_studied() {
    let with_loop = [
        ("#[circuit.phase_loop]", "[circuit.phase_loop]"),
        ("#setpoint_raw = -4194304", "setpoint_raw = -4194304"),
        ("#proportional = {", "proportional = {"),
        ("#integral = {", "integral = {"),
        ("#integrator_bits", "integrator_bits"),
    ];
    let converter = [("format = \"Q1.15\"", "format = \"Q1.11\"")];
    let free = [("tuning_word = 134217728", "tuning_word = 134230000")];
    for (what, changes) in [
        ("loop", &with_loop[..]),
        ("12 bits", &converter),
        ("free", &free),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let file = changed(folder.path(), changes);
        let out = folder.path().join("out");
        let done = study(&[file.to_str().expect("UTF-8")], &out);
        let said = told(&done);
        assert!(done.status.success(), "{what}: {said}");
        let result = json(&bytes(&out));
        // A phase loop sets the tuning word itself: there is no detuned run.
        assert_eq!(
            result["conditions"]["detuned_hz"].is_null(),
            what == "loop",
            "{what}"
        );
        let points = result["front"].as_array().expect("a front");
        assert!(
            !points.is_empty() && result["chosen"][0]["point"].is_u64(),
            "{what}"
        );
        let limit = result["limits"]["bias_dps"].as_f64().expect("a limit");
        for point in points {
            let inside = |name: &str, field: &str| {
                let ends: Vec<f64> = point["bounds"][name]
                    .as_array()
                    .expect("two")
                    .iter()
                    .filter_map(Value::as_f64)
                    .collect();
                let value = point[field].as_f64().expect("a number");
                assert!(
                    ends[0] <= value && value <= ends[1],
                    "{what}: {name} {value} {ends:?}"
                );
                ends[0].abs().max(ends[1].abs())
            };
            inside("bias_dps", "bias_error_dps");
            inside("drift_dps", "drift_residual_dps");
            inside("noise_dps_rthz", "noise_dps_rthz");
            inside("scale_factor_ppm", "scale_factor_ppm");
            let start = inside("startup_error_dps", "startup_error_dps");
            let merit = point["merit"].as_f64().expect("a number").max(1.0);
            assert!(start <= limit * merit, "{what}: {start} of {limit}");
        }
        let point = out.join(points[0]["design"].as_str().expect("a file"));
        let check = gyrogen_here(&["check", text(&point), "--samples", "20000"]);
        assert!(check.status.success(), "{what}: {}", told(&check));
    }
}

#[test]
fn a_limit_on_the_bias_is_met_by_the_cheapest_design_that_is_shown_to_meet_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = changed(folder.path(), &[]);
    let file = file.to_str().expect("UTF-8");
    let out = folder.path().join("out");
    let price = |point: &Value| point["price"]["fpga"].as_f64().expect("a price");
    let size = |point: &Value, name: &str| {
        let ends = point["bounds"][name].as_array().expect("two");
        ends.iter()
            .filter_map(Value::as_f64)
            .map(f64::abs)
            .fold(0.0, f64::max)
    };
    good(&study(&[file], &out));
    let plain = json(&bytes(&out));
    // With some room, for the bounds of two studies are not of the same number of points.
    let shown = |p: &&Value| size(p, "bias_dps").max(size(p, "startup_error_dps")) <= 0.008;
    let points = plain["front"].as_array().expect("a front").iter();
    let cheapest = points
        .filter(shown)
        .map(price)
        .fold(f64::INFINITY, f64::min);
    assert!(cheapest < price(&plain["reference"]));

    // A terminal of 100 columns has a row of a table in one line.
    let mut command = Command::new(env!("CARGO_BIN_EXE_gyrogen"));
    let limits = ["study", file, "--for", "bias_dps<=0.01", "--out"];
    let done = command
        .env("COLUMNS", "100")
        .args(limits)
        .arg(&out)
        .output()
        .expect("runs");
    good(&done);
    let said = String::from_utf8(done.stdout).expect("UTF-8");
    assert!(said.lines().all(|l| l.chars().count() <= 100), "{said}");
    let row = |first: &str| {
        let mut lines = said
            .lines()
            .map(|l| l.split_whitespace().collect::<Vec<_>>());
        lines.find(|l| l.first() == Some(&first))
    };
    let limit = ["limit", "0.0100", "-", "-", "-", "-", "1"];
    assert_eq!(row("limit").expect("a row"), limit, "{said}");
    assert_eq!(row("given").expect("a row").len(), 10, "{said}");

    let result = json(&bytes(&out));
    let chosen = result["chosen"].as_array().expect("two");
    let fpga = chosen.iter().find(|c| c["target"] == "fpga").expect("one");
    let number = fpga["point"].as_u64().expect("a point") as usize;
    let point = &result["front"][number - 1];
    assert!(price(point) <= cheapest, "{point} {cheapest}");
    assert!(size(point, "bias_dps") <= 0.01 && size(point, "startup_error_dps") <= 0.01);
    assert_eq!(result["required"][0]["can_be_met"], true);

    // What cannot be shown is told with what can: the given design's own bound at most.
    let done = study(&[file, "--for", "bias_dps<=1e-9"], &out);
    assert_eq!(done.status.code(), Some(1));
    assert!(
        told(&done).contains("bias_dps cannot be met: 1.00e-9 is required, "),
        "{}",
        told(&done)
    );
    let result = json(&bytes(&out));
    let nearest = result["chosen"][0]["nearest"].as_u64().expect("a design");
    let mark = format!("!{nearest}");
    let printed = String::from_utf8_lossy(&done.stdout);
    let marked =
        |l: &str| l.trim_start().starts_with(&mark) || l.trim_start().starts_with("!given");
    assert!(printed.lines().any(marked), "{printed}");
    // Once, though it is so of both targets, and with what would do.
    let said = told(&done);
    assert_eq!(said.matches("bias_dps cannot be met").count(), 1, "{said}");
    assert!(!printed.contains("cannot be met"), "{printed}");
    assert!(
        said.contains("As measured here, it meets `--for \"bias_dps<=")
            && said.contains("Give it a limit with a margin, such as `--for \"bias_dps<="),
        "{said}"
    );
    let best = result["required"][0]["best"].as_f64().expect("a number");
    let given = &result["reference"];
    let own = size(given, "bias_dps").max(size(given, "startup_error_dps"));
    assert!(1e-5 < best && best <= own, "{best} {own}");
    let notes = result["notes"].to_string();
    for text in [
        "dropped: the error after power-on may be as large as ",
        "The limit of the bias, 1.00e-9 deg/s, is also the limit of this error. ",
        "only where no design is chosen for a target. ",
        "as measured here, within `bias_dps<=",
    ] {
        assert!(notes.contains(text), "{notes}");
    }

    // The cheapest design of all is in a wide limit, and too noisy for the data sheet.
    let done = study(&[file, "--for", "bias_dps<=0.5"], &out);
    good(&done);
    let notes = json(&bytes(&out))["notes"].to_string();
    assert!(
        notes.contains("more than one percent worse than with the given design: ")
            && notes.contains("noise_dps_rthz 0.00")
            && notes.contains("limit it with `noise_dps_rthz<=0.00"),
        "{notes}"
    );
    assert!(!notes.contains("bias_dps"), "{notes}");
}

#[test]
fn what_cannot_be_had_is_named_with_its_word_and_what_can_is_the_cheapest() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = changed(folder.path(), &[]);
    let file = file.to_str().expect("UTF-8");
    let out = folder.path().join("out");
    let refused = |limits: &str, expected: &[&str]| {
        let done = study(&[file, "--for", limits], &out);
        let said = told(&done);
        assert_eq!(done.status.code(), Some(1), "{limits}: {said}");
        for text in expected {
            assert!(said.contains(text), "{limits}: {said}");
        }
        json(&bytes(&out))
    };
    // Of the detuned oscillator, whose table's address this study does not vary.
    let spur = refused(
        "spur_dps<=0.005",
        &[
            "spur_dps cannot be met",
            "`circuit.nco.table_address_bits` with 12, which this study does not vary",
        ],
    );
    assert_eq!(spur["required"][0]["varied"], false);
    refused(
        "rom_bytes<=5000",
        &[
            "rom_bytes cannot be met",
            "`circuit.nco.table_address_bits` with 12",
        ],
    );
    refused(
        "bandwidth_hz>=900",
        &["bandwidth_hz cannot be met", "`circuit.decimator.ratio`"],
    );
    let cycles = |result: &Value| {
        let number = result["chosen"][0]["point"].as_u64().expect("a point") as usize;
        let cost = &result["front"][number - 1]["cost"]["cortex-m4"];
        cost["cycles_per_row"].as_u64().expect("a number")
    };
    // Each by itself, but not both: fewer cycles than the cheapest of so little noise takes.
    let done = study(&[file, "--for", "noise_dps_rthz<=1.6e-4"], &out);
    assert!(done.status.success());
    let most = cycles(&json(&bytes(&out))) - 1;
    let few = format!("cycles_per_row<={most}");
    let both = refused(
        &format!("{few} noise_dps_rthz<=1.6e-4"),
        &[
            "each requirement can be met by itself",
            "times the limit of noise_dps_rthz, limited by `circuit.demodulator.product`",
        ],
    );
    assert!(
        both["required"]
            .as_array()
            .expect("two")
            .iter()
            .all(|r| r["can_be_met"] == true)
    );
    // Bytes and cycles alone: the finest design that holds them.
    let done = study(&[file, "--for", &few], &out);
    good(&done);
    let result = json(&bytes(&out));
    let chosen = &result["chosen"][0];
    assert!(
        chosen["reason"]
            .as_str()
            .expect("text")
            .starts_with("the finest point"),
        "{chosen}"
    );
    assert!(cycles(&result) <= most);
    // A met limit with the whole of the interval.
    let done = study(&[file, "--for", "noise_dps_rthz<=5e-4"], &out);
    good(&done);
    let result = json(&bytes(&out));
    let number = result["chosen"][0]["point"].as_u64().expect("a point") as usize;
    assert!(result["front"][number - 1]["bounds"]["noise_dps_rthz"][1].as_f64() <= Some(5e-4));
    // Every point says whether it could have been chosen.
    for point in result["front"].as_array().expect("points") {
        let within = point["bounds"]["noise_dps_rthz"][1].as_f64() <= Some(5e-4);
        assert_eq!(point["shown"], within, "{point}");
    }
    // Cycles of no processor.
    let path = folder.path().join("fpga.toml");
    std::fs::write(&path, "[study]\ntargets = [\"fpga\"]\n").expect("writes");
    let done = study(
        &[
            path.to_str().expect("UTF-8"),
            "--for",
            "cycles_per_row<=4000",
        ],
        &out,
    );
    let said = told(&done);
    assert!(
        done.status.code() == Some(2) && said.contains("names no processor"),
        "{said}"
    );
}

#[test]
fn an_overflow_is_said_first_and_a_wrong_word_in_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = include_str!("../../src/design/default.toml");
    let narrow = text.replace(
        "output = { format = \"Q12.12\"",
        "output = { format = \"Q5.12\"",
    );
    let path = folder.path().join("narrow.toml");
    std::fs::write(&path, narrow).expect("writes");
    let done = study(&[path.to_str().expect("UTF-8")], &folder.path().join("out"));
    assert_eq!(done.status.code(), Some(1));
    let said = told(&done);
    assert!(
        said.contains("overflow") && said.contains("smallest change that mends it"),
        "{said}"
    );
    let path = folder.path().join("wrong.toml");
    std::fs::write(&path, "[study]\nwords = [\"circuit.adc\"]\n").expect("writes");
    let done = study(&[path.to_str().expect("UTF-8")], &folder.path().join("out"));
    assert_eq!(done.status.code(), Some(2));
    let said = told(&done);
    assert!(said.contains("wrong.toml:2:"), "{said}");
    // A study that does not begin leaves no folder.
    let out = folder.path().join("merged");
    let parts = folder.path().to_str().expect("UTF-8");
    let done = study(&["--merge", parts], &out);
    assert_eq!(done.status.code(), Some(2));
    assert!(!out.exists());
}
