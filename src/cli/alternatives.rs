//! The table of forms that meet a bound.

use crate::cost::function::{BYTES_A_CYCLE, FunctionCost};
use comfy_table::Table;

/// A line: form in words, cost, errors as they are shown, undominated, chosen.
pub(super) struct Line<'a> {
    pub detail: &'a str,
    pub cost: FunctionCost,
    pub errors: Vec<String>,
    pub undominated: bool,
    pub chosen: bool,
}

/// What the marks of a table mean, given undominated and chosen of each of its lines.
pub(super) fn marks(lines: impl IntoIterator<Item = (bool, bool)>) -> String {
    let mut said = format!("chosen: the least of cycles + ROM bytes / {BYTES_A_CYCLE}.");
    if lines.into_iter().any(|marked| marked == (true, false)) {
        said += " not beaten: no other form is as good or better in ROM, multiplies, adds and error at once.";
    }
    said
}

/// The table; `errors` are the titles of the errors' columns.
pub(super) fn table<'a>(errors: &[&str], lines: impl Iterator<Item = Line<'a>>) -> Table {
    let titles = [
        "form",
        "ROM, bytes",
        "multiplies",
        "adds",
        "cycles (estimate)",
    ];
    let mut all: Vec<&str> = titles.into_iter().chain(errors.iter().copied()).collect();
    all.push("");
    let mut table = super::terminal::table(&all);
    for line in lines {
        let mark = match (line.chosen, line.undominated) {
            (true, _) => "chosen",
            (false, true) => "not beaten",
            (false, false) => "",
        };
        let mut row = vec![
            line.detail.to_owned(),
            line.cost.rom_bytes.to_string(),
            line.cost.multiplies.to_string(),
            line.cost.adds.to_string(),
            line.cost.cycles.to_string(),
        ];
        row.extend(line.errors);
        row.push(mark.to_owned());
        table.add_row(row);
    }
    super::terminal::numbers(&mut table, 1..1 + 4 + errors.len());
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_marks_that_stand_in_the_table_are_explained() {
        let chosen = marks([(true, true), (false, false)]);
        assert!(chosen.starts_with("chosen: ") && !chosen.contains("not beaten"));
        assert!(marks([(true, true), (true, false)]).contains(" not beaten: no other"));
    }
}
