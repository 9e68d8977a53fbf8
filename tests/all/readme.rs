//! What the README and the tour show is what the commands print, and the README's C compiles.

use crate::common::command::{gyrogen, told};
use crate::common::compiler::cc;
use std::path::Path;
use std::process::Command;

const README: &str = include_str!("../../README.md");
const TOUR: &str = include_str!("../../docs/tour.md");

/// The contents of the fenced blocks of a language, in order.
fn blocks(page: &str, language: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut rest = page;
    while let Some((_, after)) = rest.split_once("\n```") {
        let (block, next) = after.split_once("\n```").expect("a block that ends");
        let (first, text) = block.split_once('\n').unwrap_or((block, ""));
        if first == language {
            found.push(text.to_owned());
        }
        rest = next;
    }
    found
}

/// Words with one blank between them: how lines are wrapped depends on the terminal.
fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What the tool prints on stdout in a folder.
fn printed(arguments: &[&str], folder: &Path) -> String {
    let done = gyrogen(arguments, folder);
    assert!(done.status.success(), "{arguments:?}: {}", told(&done));
    String::from_utf8(done.stdout).unwrap()
}

/// Every part between lines of `...` is in what was printed, in order.
fn shows(block: &str, printed: &str) {
    let printed = words(printed);
    let mut rest = printed.as_str();
    for part in block.split("\n...\n") {
        let part = words(part);
        let at = rest.find(&part);
        let at = at.unwrap_or_else(|| panic!("the page has\n{part}\nand printed is\n{printed}"));
        rest = &rest[at + part.len()..];
    }
}

#[test]
fn printed_outputs_are_those_of_real_runs_and_the_c_compiles() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let outputs = blocks(README, "text");
    let [of_run, of_close] = outputs.as_slice() else {
        panic!(
            "{} outputs in the README, and two are known here",
            outputs.len()
        );
    };
    shows(of_run, &printed(&["run", "--out", "out"], dir));
    let close = ["close", "--record", "out/record.csv", "--out", "closed"];
    let closed = printed(&close, dir);
    shows(of_close, &closed);
    let outputs = blocks(TOUR, "text");
    let [of_close, of_equiv] = outputs.as_slice() else {
        panic!(
            "{} outputs in the tour, and two are known here",
            outputs.len()
        );
    };
    shows(of_close, &closed);
    shows(of_equiv, &printed(&["equiv", "--out", "eq"], dir));

    let c = blocks(README, "c");
    let main = "int main(void) { int32_t r; return start() && !rate_of(1, 2, &r) ? 0 : 1; }\n";
    std::fs::write(dir.join("main.c"), c.concat() + main).unwrap();
    let bundle = dir.join("out/firmware/c");
    let mut compile = cc();
    compile
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-I"])
        .arg(&bundle);
    for source in ["gyro.c", "gyro_tables.c", "gyro_selftest.c"] {
        compile.arg(bundle.join(source));
    }
    compile
        .arg(dir.join("main.c"))
        .arg("-o")
        .arg(dir.join("main"));
    assert!(compile.status().unwrap().success(), "{compile:?}");
    assert!(Command::new(dir.join("main")).status().unwrap().success());
}

#[test]
fn the_readme_is_short_and_its_links_lead_somewhere() {
    let count = README.split_whitespace().count();
    assert!(count < 1000, "{count} words");
    let mut links = 0;
    for after in README.split("](").skip(1) {
        let target = after.split([')', '#']).next().expect("a link that ends");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(target);
        assert!(path.exists(), "{target}");
        links += 1;
    }
    assert!(links > 5);
}
