//! Results of an earlier call of the same command that new ones take the place of: what is replaced is said.

use crate::firmware::folder::Folder;
use crate::text::{Place, shown};
use serde_json::Value;
use std::path::Path;

/// Keys of a result that are the same only for the same design, measurement and limits: the text's digest (without a design
/// that of the request), the errors before anything was fitted and the limits of a study, where there are such.
const WHOSE: [&str; 3] = ["design_sha256", "before", "limits"];

/// What a result of a record or a capture is of.
pub(super) const MEASURED: &str = "measurement or design";

/// What is replaced where `json` takes the place of the result `name` in `folder`; `None` where there is none, and for
/// the same `of`. To be asked before the results are put into the folder.
pub(super) fn note(folder: &Path, name: &str, of: &str, json: &str) -> Option<String> {
    let text = Folder::open(folder).and_then(|f| f.read_text(name)).ok()?;
    let read = |text: &str| serde_json::from_str::<Value>(text).ok();
    let (earlier, new) = (read(&text)?, read(json)?);
    if WHOSE.iter().all(|key| earlier[key] == new[key]) {
        return None;
    }
    let note = format!(
        "note: {} held the results of `{}`, of another {of}: they were replaced; to keep both, give each a folder \
         of its own with --out",
        folder.display(),
        earlier["command"].as_str()?
    );
    Some(shown(&note, Place::Screen))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(command: &str, design: &str, rms: f64) -> String {
        let before = serde_json::json!({ "heldout_rms": rms });
        serde_json::json!({ "command": command, "design_sha256": design, "before": before })
            .to_string()
    }

    #[test]
    fn results_of_another_measurement_or_design_are_named() {
        let made = tempfile::tempdir().expect("a folder");
        let at = made.path();
        let earlier = result("gyrogen close --record r.csv", "0", 0.5);
        let note_of = |json: &str| note(at, "closure.json", MEASURED, json);
        assert_eq!(note_of(&earlier), None, "nothing was there");
        std::fs::write(at.join("closure.json"), &earlier).expect("written");
        let again = result("gyrogen close --record r.csv --verify", "0", 0.5);
        assert_eq!(note_of(&again), None, "the same measurement");
        for other in [
            result("gyrogen close --record r.csv", "0", 0.6),
            result("gyrogen close --record r.csv", "1", 0.5),
        ] {
            let said = note_of(&other).expect("a note");
            assert!(said.contains("`gyrogen close --record r.csv`"), "{said}");
            assert!(said.contains("--out"), "{said}");
        }
        // Without errors before a fit, as of a function: the digest decides.
        let of = |design: &str| {
            serde_json::json!({ "command": "gyrogen approx", "design_sha256": design }).to_string()
        };
        std::fs::write(at.join("approx.json"), of("0")).expect("written");
        let note_of = |json: &str| note(at, "approx.json", "request", json);
        assert_eq!(note_of(&of("0")), None, "the same request");
        let said = note_of(&of("1")).expect("a note");
        assert!(said.contains("of another request"), "{said}");
    }
}
