//! What a closure adds to the design that it started from.

use crate::design::Design;
use crate::output::name_of;
use similar::{DiffOp, TextDiff};

/// Lines of context around a change.
const CONTEXT: usize = 3;

/// From how many lines on a run of added ones is folded on a page, and how many of each end it shows.
const LONG: usize = 40;
const SHOWN: usize = 10;

/// Characters of a line that a page shows.
const WIDEST: usize = 160;

/// The design that was given, or the embedded default, beside the one that is written. Line endings do not count.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DesignDiff {
    /// A unified diff, for `patch`; empty if nothing differs.
    pub unified: String,
    /// Lines in the new one alone.
    pub added: usize,
    /// Lines with others in their place.
    pub changed: usize,
    /// Lines in the old one alone.
    pub removed: usize,
}

/// A line of a diff as a page shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// Class: `added`, `removed`, `place`, `folded` or none.
    pub class: &'static str,
    /// As it stands in the diff.
    pub text: String,
}

impl DesignDiff {
    /// From a design to a text.
    pub fn of(design: &Design, text: &str) -> Self {
        let old = match &design.source.path {
            Some(path) => name_of(path),
            None => "the embedded default".to_owned(),
        };
        Self::between(&old, &design.source.text, text)
    }

    fn between(name: &str, old: &str, new: &str) -> Self {
        let (before, after): (Vec<&str>, Vec<&str>) =
            (old.lines().collect(), new.lines().collect());
        let diff = TextDiff::from_slices(&before, &after);
        let (mut added, mut changed, mut removed) = (0, 0, 0);
        for op in diff.ops() {
            match *op {
                DiffOp::Insert { new_len, .. } => added += new_len,
                DiffOp::Delete { old_len, .. } => removed += old_len,
                DiffOp::Replace {
                    old_len, new_len, ..
                } => {
                    changed += old_len.min(new_len);
                    added += new_len.saturating_sub(old_len);
                    removed += old_len.saturating_sub(new_len);
                }
                DiffOp::Equal { .. } => {}
            }
        }
        let mut unified = String::new();
        if added + changed + removed > 0 {
            unified = diff
                .unified_diff()
                .context_radius(CONTEXT)
                .header(name, "design.toml")
                .to_string();
        }
        DesignDiff {
            unified,
            added,
            changed,
            removed,
        }
    }

    /// How much differs.
    pub fn sentence(&self) -> String {
        let lines = if self.added == 1 { "line" } else { "lines" };
        let removed = match self.removed {
            0 => String::new(),
            removed => format!(", {removed} removed"),
        };
        format!(
            "design.toml: {} {lines} added, {} changed{removed} (design.diff)",
            self.added, self.changed
        )
    }

    /// For a page: long runs of added lines folded, long lines cut.
    pub fn lines(&self) -> Vec<Line> {
        // The first two name the files.
        let all: Vec<Line> = self.unified.lines().skip(2).map(line).collect();
        let mut out = Vec::new();
        for run in all.chunk_by(|a, b| a.class == "added" && b.class == "added") {
            let hidden = run.len().saturating_sub(2 * SHOWN);
            if run.len() < LONG {
                out.extend_from_slice(run);
                continue;
            }
            out.extend(run.iter().take(SHOWN).cloned());
            out.push(Line {
                class: "folded",
                text: format!("\u{2026} {hidden} lines"),
            });
            out.extend(run.iter().skip(SHOWN + hidden).cloned());
        }
        out
    }
}

fn line(text: &str) -> Line {
    let class = match text.chars().next() {
        Some('+') => "added",
        Some('-') => "removed",
        Some('@') => "place",
        _ => "",
    };
    let count = text.chars().count();
    let text = if count > WIDEST {
        let start: String = text.chars().take(WIDEST).collect();
        format!("{start} \u{2026} {} characters", count - WIDEST)
    } else {
        text.to_owned()
    };
    Line { class, text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_counted_as_they_were_meant() {
        let old = "a = 1\r\nb = 2\r\nc = 3\r\nd = 4\r\n";
        let d = DesignDiff::between("my.toml", old, "a = 1\nb = 5\nc = 3\nd = 4\ne = 6\nf = 7");
        assert_eq!((d.added, d.changed, d.removed), (2, 1, 0));
        assert_eq!(
            d.unified,
            "--- my.toml\n+++ design.toml\n@@ -1,4 +1,6 @@\n a = 1\n-b = 2\n+b = 5\n c = 3\n d = 4\n+e = 6\n+f = 7\n"
        );
        assert_eq!(
            d.sentence(),
            "design.toml: 2 lines added, 1 changed (design.diff)"
        );
        let none = DesignDiff::between("my.toml", old, "a = 1\nb = 2\nc = 3\nd = 4\n");
        assert!(none.unified.is_empty() && none.lines().is_empty());
        let fewer = DesignDiff::between("x", old, "a = 1\n");
        assert_eq!((fewer.added, fewer.changed, fewer.removed), (0, 0, 3));
        assert!(fewer.sentence().contains("3 removed"));
    }

    #[test]
    fn long_runs_and_long_lines_are_folded_on_the_page_alone() {
        let run: String = (0..60).map(|k| format!("{k}\n")).collect();
        let wide = "x".repeat(500);
        let d = DesignDiff::between("x", "a\n", &format!("a\n{run}b {wide}\n"));
        assert_eq!(d.added, 61);
        assert!(d.unified.contains("+10\n") && d.unified.contains(&wide));
        let lines = d.lines();
        let texts: Vec<&str> = lines.iter().map(|l| l.text.as_str()).collect();
        assert!(texts.contains(&"… 41 lines") && texts.contains(&"+9") && !texts.contains(&"+10"));
        assert_eq!(
            lines.iter().filter(|l| l.class == "added").count(),
            2 * SHOWN
        );
        assert!(texts.iter().all(|t| t.chars().count() < 200));
        assert!(texts.last().is_some_and(|t| t.ends_with("characters")));
    }
}
