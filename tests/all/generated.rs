//! `generated/` holds what the default design emits: today's code must emit exactly that, so that
//! every change of the emitter shows as a difference in review.
//!
//! `GYROGEN_WRITE=1 cargo test --test all generated::` writes the folder anew.

use gyrogen::emit::bundle::Part;
use gyrogen::emit::views::Language;
use gyrogen::firmware::files;
use gyrogen::firmware::files::EmittedFile;
use std::path::{Path, PathBuf};

fn emitted(language: Language, name: &str) -> (PathBuf, Vec<EmittedFile>) {
    let design = gyrogen::design::reader::read(None).expect("the default design");
    let command = format!("gyrogen emit --lang {name} --part chain");
    let files = files::emit(&design, Part::Chain, language, &command).expect("emission");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("generated")
        .join(name);
    (folder, files)
}

fn files_under(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder)
        .expect("generated/ exists")
        .flatten()
    {
        if entry.path().is_dir() {
            found.extend(files_under(&entry.path()));
        } else {
            found.push(entry.path());
        }
    }
    found
}

fn check(language: Language, name: &str) {
    let (folder, files) = emitted(language, name);
    if std::env::var_os("GYROGEN_WRITE").is_some() {
        let _ = std::fs::remove_dir_all(&folder);
        files::write(&files, &folder).expect("generated/ can be written");
    }
    for file in &files {
        let path = folder.join(&file.path);
        let kept = std::fs::read_to_string(&path).unwrap_or_default();
        let line = kept
            .lines()
            .zip(file.text.lines())
            .position(|(a, b)| a != b);
        assert!(
            kept == file.text,
            "{} is not what today's code emits (first difference in line {:?}); if the change is meant, \
             run `GYROGEN_WRITE=1 cargo test --test all generated::` and review it",
            path.display(),
            line.map(|l| l + 1)
        );
    }
    assert_eq!(
        files_under(&folder).len(),
        files.len(),
        "files that nothing emits"
    );
}

#[test]
fn the_c_in_generated_is_what_the_default_design_emits() {
    check(Language::C, "c");
}

#[test]
fn the_rust_in_generated_is_what_the_default_design_emits() {
    check(Language::Rust, "rust");
}
