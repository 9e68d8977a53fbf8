//! Which mutants a source has: one token damaged on one line.

use super::Mutant;

/// Every mutant of a source: operators, constants by one, comparisons, shifts, entries of tables, lost
/// assignments and calls.
pub fn mutants(file: &str, text: &str) -> Vec<Mutant> {
    let mut all = Vec::new();
    let mut depth = 0;
    for (line, whole) in text.lines().enumerate() {
        let inside = depth > 0;
        let code = whole.split("/*").next().unwrap_or("");
        depth += code.matches('{').count();
        depth -= code.matches('}').count();
        if !inside || whole.starts_with(" *") || code.trim().is_empty() {
            continue;
        }
        let rest = &whole[code.len()..];
        all.extend(of_line(code).into_iter().map(|after| Mutant {
            file: file.to_owned(),
            line,
            before: whole.to_owned(),
            after: after + rest,
        }));
    }
    all
}

const OPERATORS: [(&str, &[&str]); 16] = [
    (" + ", &[" - "]),
    (" - ", &[" + "]),
    (" * ", &[" + "]),
    (" & ", &[" | "]),
    (" | ", &[" & "]),
    (" << ", &[" >> "]),
    (" >> ", &[" << "]),
    (" < ", &[" <= ", " >= "]),
    (" > ", &[" >= ", " <= "]),
    (" <= ", &[" < "]),
    (" >= ", &[" > "]),
    (" == ", &[" != "]),
    (" != ", &[" == "]),
    (" && ", &[" || "]),
    (" || ", &[" && "]),
    ("_add(", &["_sub("]),
];

fn of_line(code: &str) -> Vec<String> {
    let mut all = Vec::new();
    let replaced =
        |at: usize, from: usize, to: &str| format!("{}{to}{}", &code[..at], &code[at + from..]);
    for (from, to) in OPERATORS {
        for (at, _) in code.match_indices(from) {
            all.extend(to.iter().map(|to| replaced(at, from.len(), to)));
        }
    }
    for (at, _) in code.match_indices(" ? ") {
        let start = code[..at].rfind("= ").map_or(0, |k| k + 2);
        all.push(format!(
            "{}!({}){}",
            &code[..start],
            &code[start..at],
            &code[at..]
        ));
    }
    for (at, len) in numbers(code) {
        if let Ok(value) = code[at..at + len].parse::<u128>() {
            all.push(replaced(at, len, &(value + 1).to_string()));
            if value > 0 {
                all.push(replaced(at, len, &(value - 1).to_string()));
            }
        }
    }
    let trimmed = code.trim();
    let is_state =
        trimmed.starts_with("s->") || trimmed.starts_with("out.") || trimmed.starts_with("g->");
    let is_carried = trimmed.starts_with('t') && trimmed.contains(" = ");
    let is_call = !trimmed.contains('=')
        && trimmed.contains("_")
        && trimmed.ends_with(");")
        && !trimmed.starts_with("return");
    if let (true, Some((target, _))) = (trimmed.starts_with("out."), trimmed.split_once(" = ")) {
        all.push(format!("    {target} = 0;"));
    } else if (is_state && trimmed.contains(" = ")) || is_carried || is_call {
        all.push(String::new());
    }
    all
}

/// Decimal numbers that stand for themselves: in a constant macro, with a suffix, as an entry or an index.
fn numbers(code: &str) -> Vec<(usize, usize)> {
    let bytes = code.as_bytes();
    let mut all = Vec::new();
    let mut k = 0;
    while k < bytes.len() {
        if !bytes[k].is_ascii_digit() {
            k += 1;
            continue;
        }
        let start = k;
        while k < bytes.len() && bytes[k].is_ascii_digit() {
            k += 1;
        }
        let before = start.checked_sub(1).map_or(b' ', |b| bytes[b]);
        let after = bytes.get(k).copied().unwrap_or(b' ');
        let in_name =
            before.is_ascii_alphabetic() || before == b'_' || after == b'_' || after == b'x';
        // The width of an exact type is in a name; a digit that follows another name is too.
        if !in_name {
            all.push((start, k - start));
        }
    }
    all
}
