// {{ v.banner }}
// SPDX-License-Identifier: MIT OR Apache-2.0
//! All three parts together against the model, and each part's own tests.
use std::path::Path;
use std::process::Command;

#[test]
fn together() {
    let status = Command::new(env!("CARGO_BIN_EXE_check")).status();
    assert!(status.is_ok_and(|status| status.success()));
}

fn passes(part: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(part);
    let mut command = Command::new(env!("CARGO"));
    command.args(["test", "--release", "--offline", "--target-dir", "target"]);
    let status = command.current_dir(folder).status();
    assert!(status.is_ok_and(|status| status.success()), "{part}");
}
{% for part in v.parts %}
#[test]
fn {{ part }}() {
    passes("{{ part }}");
}
{% endfor %}
