//! The order of rooms in `ARCHITECTURE.md` against what the sources import.

mod imports;
mod rooms;

use imports::imports;
use std::collections::BTreeSet;
use std::path::Path;

/// The search of thermal causes, whose steps call each other: a circle that is known, and to be cut.
const EXCEPTION: &str = "thermal/search/";

/// The files below a folder of the package, with their texts.
fn sources(folder: &str) -> Vec<(String, String)> {
    fn walk(folder: &Path, below: &str, found: &mut Vec<(String, String)>) {
        let mut entries: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().path())
            .collect();
        entries.sort();
        for path in entries {
            let name = format!("{below}{}", path.file_name().unwrap().to_str().unwrap());
            if path.is_dir() {
                walk(&path, &format!("{name}/"), found);
            } else if name.ends_with(".rs") {
                found.push((name, std::fs::read_to_string(&path).unwrap()));
            }
        }
    }
    let mut found = Vec::new();
    walk(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join(folder),
        "",
        &mut found,
    );
    found
}

/// The rooms in their order: the first cells of the table below the heading.
fn order() -> Vec<String> {
    let text = include_str!("../../ARCHITECTURE.md");
    let (_, section) = text.split_once("\n## The order of rooms\n").unwrap();
    let section = section.split("\n## ").next().unwrap();
    let cells = section.lines().filter_map(|l| l.strip_prefix("| `"));
    let rooms = cells.flat_map(|l| l.split(" | ").next().unwrap().split(", "));
    rooms.map(|r| r.trim_matches('`').to_owned()).collect()
}

#[test]
fn imports_go_one_way_between_rooms() {
    let (sources, order) = (sources("src"), order());
    let built = sources
        .iter()
        .filter(|(path, _)| !path.ends_with("_tests.rs"));
    let there: BTreeSet<&str> = built.map(|(path, _)| rooms::room(path)).collect();
    let listed: BTreeSet<&str> = order.iter().map(String::as_str).collect();
    assert_eq!(there, listed, "the rooms, and those in ARCHITECTURE.md");
    assert_eq!(listed.len(), order.len(), "a room is listed twice");
    let found = imports(&sources);
    assert!(found.len() > 2000, "{} imports were read", found.len());
    let wrong = rooms::against_the_order(&found, &order);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn circles_inside_a_room_are_small() {
    let wrong = rooms::circles(&imports(&sources("src")), EXCEPTION);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_command_line_is_parsed_in_its_room_alone() {
    let elsewhere: Vec<String> = sources("src")
        .into_iter()
        .filter(|(path, text)| !path.starts_with("cli/") && text.contains("clap::"))
        .map(|(path, _)| path)
        .collect();
    assert_eq!(elsewhere, [""; 0]);
}

#[test]
fn who_judges_shares_no_code_with_what_is_judged() {
    for folder in ["oracle", "blind", "blind_capture"] {
        let sources = sources(&format!("tests/all/{folder}"));
        assert!(!sources.is_empty(), "{folder}");
        for (path, text) in sources {
            let code = text.lines().filter(|l| !l.trim_start().starts_with("//"));
            let code = code.collect::<Vec<_>>().join("\n");
            let code = code.replace("crate::rng::Rng", "");
            for shared in ["gyrogen::", "crate::", "super::super", "#[path"] {
                assert!(!code.contains(shared), "{folder}/{path}: {shared}");
            }
        }
    }
}

fn made(files: &[(&str, &str)]) -> Vec<(String, String)> {
    files
        .iter()
        .map(|(p, t)| ((*p).to_owned(), (*t).to_owned()))
        .collect()
}

#[test]
fn an_import_turned_round_is_seen_with_its_line() {
    let order = ["low", "high"].map(str::to_owned);
    for text in [
        "//! Low.\n\nuse crate::high::Thing;\n",
        "use crate::low;\n\nfn f() -> crate::high::Thing { low::g() }\n",
        "mod inside {\n    fn f() {\n        println!(\"{}\", super::super::high::g());\n    }\n}\n",
    ] {
        let sources = made(&[("low.rs", text), ("high.rs", "pub struct Thing;\n")]);
        let wrong = rooms::against_the_order(&imports(&sources), &order);
        assert_eq!(wrong.len(), 1, "{text}: {wrong:?}");
        assert!(
            wrong[0].starts_with("src/low.rs:3: low imports high"),
            "{wrong:?}"
        );
    }
    let sources = made(&[
        (
            "low.rs",
            "#[cfg(test)]\nmod tests {\n    use crate::high::Thing;\n}\n",
        ),
        ("high.rs", "use crate::low::g;\n"),
    ]);
    assert!(rooms::against_the_order(&imports(&sources), &order).is_empty());
}

#[test]
fn a_circle_is_seen_through_re_exports() {
    let part = |to: &str| format!("use super::{to}::F;\npub struct F;\n");
    let (a, b, c) = (part("b"), part("c"), part("d"));
    let files = [
        (
            "room/mod.rs",
            "pub mod a;\npub mod b;\npub mod c;\npub mod d;\npub use a::F;\n",
        ),
        ("room/a.rs", &a),
        ("room/b.rs", &b),
        ("room/c.rs", &c),
        ("room/d.rs", "use super::F as Of;\npub struct F;\n"),
    ];
    let wrong = rooms::circles(&imports(&made(&files)), "search/");
    assert_eq!(wrong.len(), 1, "{wrong:?}");
    assert!(
        wrong[0].starts_with("4 files")
            && wrong[0].contains("src/room/d.rs:1: room::F (room/a.rs)")
    );
    assert!(rooms::circles(&imports(&made(&files)), "room/").is_empty());
    let open = [
        files[0],
        files[1],
        files[2],
        files[3],
        ("room/d.rs", "pub struct F;\n"),
    ];
    assert!(rooms::circles(&imports(&made(&open)), "search/").is_empty());
}
