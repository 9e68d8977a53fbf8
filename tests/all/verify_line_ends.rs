//! `gyrogen verify` of bundles in whose files git changed the line ends.

use crate::common::command::{gyrogen, told};
use crate::verify_foreign::{bundle, refused, sha256, whole};
use std::path::Path;

#[test]
fn other_line_ends_are_told_from_an_edited_file() {
    let (_folder, at) = bundle();
    let path = at.join("tested_correction.c");
    let text = std::fs::read_to_string(&path).expect("a source");
    std::fs::write(&path, text.replace('\n', "\r\n")).expect("written");
    refused(
        &at,
        1,
        "check failed: files differ from the manifest in their line ends alone (CR LF for LF): tested_correction.c",
    );
    refused(&at, 1, "`* -text` in .gitattributes");
}

/// Gives every file of a folder the line ends of git's `autocrlf`.
fn with_crlf(folder: &Path) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            with_crlf(&path);
        } else {
            let text = std::fs::read_to_string(&path).expect("a text");
            std::fs::write(&path, text.replace('\n', "\r\n")).expect("written");
        }
    }
}

#[test]
fn line_ends_are_all_that_is_named_of_a_bundle_that_git_converted() {
    let (_folder, at) = bundle();
    with_crlf(&at);
    let manifest = std::fs::read(at.join("manifest.json")).expect("a manifest");
    for digest in [whole().1.clone(), sha256(&manifest)] {
        let done = gyrogen(
            &["verify", "c", "--digest", &digest],
            at.parent().expect("a folder"),
        );
        let said = told(&done);
        assert_eq!(done.status.code(), Some(1), "{said}");
        assert!(said.contains("in their line ends alone"), "{said}");
        for other in ["digest is", "is not of these files"] {
            assert!(!said.contains(other), "{said}");
        }
    }
}

#[test]
fn line_ends_of_the_manifest_alone_are_no_other_bundle() {
    let (_folder, at) = bundle();
    let path = at.join("manifest.json");
    let text = std::fs::read_to_string(&path).expect("a manifest");
    std::fs::write(&path, text.replace('\n', "\r\n")).expect("written");
    let digest = whole().1.as_str();
    let done = gyrogen(
        &["verify", "c", "--digest", digest],
        at.parent().expect("a folder"),
    );
    assert!(done.status.success(), "{}", told(&done));
    let printed = String::from_utf8_lossy(&done.stdout);
    assert!(printed.contains(digest), "{printed}");
}
