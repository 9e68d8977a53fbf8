// {{ v.banner }}
// SPDX-License-Identifier: MIT OR Apache-2.0
//! The bundle's vectors, run through its test driver.
use std::process::Command;

fn passes(arguments: &[&str]) {
    let driver = env!("CARGO_BIN_EXE_harness");
    let status = Command::new(driver).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).status();
    assert!(status.is_ok_and(|status| status.success()), "{arguments:?}");
}

#[test]
fn self_test() {
    passes(&["selftest"]);
}
{% for name in v.vector_names() %}
#[test]
fn {{ name }}_vectors() {
    passes(&["check", "{{ name }}"{% for file in v.vector_files(name) %}, "{{ file }}"{% endfor %}]);
}
{% endfor %}{% if v.has_every() %}
#[test]
fn every_input() {
    passes(&["check", "every"]);
}
{% endif %}{% if !v.long_words.is_empty() %}
#[test]
fn long_run() {
    passes(&["check", "long"]);
}
{% endif %}
