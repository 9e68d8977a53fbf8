//! Text that others wrote (names, columns, paths, units, titles, commands), made harmless where it is shown.
//!
//! Everything of a user's that reaches a source, a manifest, a report or a terminal goes through [`shown`].
//! What is an identifier in the place (a prefix) is not shown but checked, and refused with the reason.

/// Where a text is going to stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A line of a comment or a string of C, Rust, TOML, CMake or make.
    Source,
    /// A terminal, JSON, HTML (which escapes its own marks besides).
    Screen,
}

/// Most characters of one text in a source; the rest is counted.
const MOST: usize = 2000;

/// Marks beyond ASCII that are no letters and common in units and titles.
const MARKS: &str = "°µ±·×²³–—…′″‰√∞≤≥≈−„“”‘’«»€§";

/// Letters by their category that show nothing: fillers.
const BLANKS: [char; 5] = ['\u{115f}', '\u{1160}', '\u{3164}', '\u{ffa0}', '\u{2800}'];

/// `text` on one line, with what could end a comment or a string, splice or reorder lines, or command a terminal
/// written as `{U+000A}`. The same text again if there is nothing of that kind in it.
///
/// Written so are, everywhere: control characters (line ends and tabs among them), marks of direction and others
/// that show nothing. In sources also: the backslash (C joins lines at it) but before an apostrophe (so a shell is
/// given one), the quotation mark, a `*` beside a `/`, a `?` after a `?` (trigraphs), `$` (make and CMake), `#` at
/// the end, and all beyond ASCII that is neither a letter, a digit nor one of a few marks of units; what is beyond
/// 2000 characters is left out and counted.
pub fn shown(text: &str, place: Place) -> String {
    let characters: Vec<char> = text.chars().collect();
    let kept = match place {
        Place::Source => characters.len().min(MOST),
        Place::Screen => characters.len(),
    };
    let mut shown = String::with_capacity(text.len());
    for (k, c) in characters[..kept].iter().enumerate() {
        let before = k.checked_sub(1).map(|b| characters[b]);
        let after = characters.get(k + 1).copied();
        let is_plain = is_visible(*c)
            && match place {
                Place::Screen => true,
                Place::Source => is_known(*c) && is_harmless(before, *c, after, k + 1 == kept),
            };
        if is_plain {
            shown.push(*c);
        } else {
            shown += &format!("{{U+{:04X}}}", u32::from(*c));
        }
    }
    if kept < characters.len() {
        shown += &format!("{{{} more characters}}", characters.len() - kept);
    }
    shown
}

/// A number nearer to 0 is told as 0, in whatever unit (convention: nothing that is told here is so small).
const TOLD_AS_ZERO_BELOW: f64 = 1e-18;

/// A number in a sentence: so many significant digits; as a power of ten only below 1e-4 and from 1e7 on, 0 where it is
/// nothing.
pub fn number(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "unknown".to_owned();
    }
    if value.abs() < TOLD_AS_ZERO_BELOW {
        return "0".to_owned();
    }
    let digits = digits.max(1);
    let scientific = format!("{value:.*e}", digits - 1);
    let (rounded, exponent) = match scientific.split_once('e') {
        Some((_, exponent)) => (
            scientific.parse().unwrap_or(value),
            exponent.parse().unwrap_or(0),
        ),
        None => (value, 0i32),
    };
    if !(-4..7).contains(&exponent) {
        return scientific;
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    format!("{rounded:.decimals$}")
}

/// [`number`] without zeros at the end of its decimals: for constants, of which nobody asks how exact they are.
pub fn constant(value: f64, digits: usize) -> String {
    let text = number(value, digits);
    let (mantissa, exponent) = match text.split_once('e') {
        Some((mantissa, exponent)) => (mantissa, format!("e{exponent}")),
        None => (text.as_str(), String::new()),
    };
    match mantissa.contains('.') {
        true => {
            mantissa
                .trim_end_matches('0')
                .trim_end_matches('.')
                .to_owned()
                + &exponent
        }
        false => text,
    }
}

/// "1 segment", "2 segments".
pub fn counted(count: u64, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

/// A bound in a sentence: [`number`], rounded away from 0, so that what is printed is never below what was proved.
pub fn at_most(value: f64, digits: usize) -> String {
    number(away_from_zero(value, digits), digits)
}

/// The nearest number of so many significant digits that is not nearer to 0 than `value`.
pub fn away_from_zero(value: f64, digits: usize) -> f64 {
    let decimals = digits.max(1) - 1;
    let scientific = format!("{:.decimals$e}", value.abs());
    let read = |text: &str| text.parse::<f64>().unwrap_or(value.abs());
    if !value.is_finite() || read(&scientific) >= value.abs() {
        return if value.is_finite() {
            read(&scientific).copysign(value)
        } else {
            value
        };
    }
    let Some((mantissa, exponent)) = scientific.split_once('e') else {
        return value;
    };
    let last: u128 = mantissa.replace('.', "").parse().unwrap_or(0);
    let exponent = exponent.parse::<i64>().unwrap_or(0) - decimals as i64;
    read(&format!("{}e{exponent}", last + 1)).copysign(value)
}

/// The nearest number of so many decimals that is not nearer to 0 than `value`: for columns of a table.
pub fn away_from_zero_decimals(value: f64, decimals: usize) -> String {
    let nearest = format!("{:.decimals$}", value.abs());
    let sign = if value < 0.0 { "-" } else { "" };
    match nearest.parse::<f64>() {
        Ok(below) if below < value.abs() => {
            let mut step = 10f64.powi(decimals as i32).recip();
            loop {
                let above = format!("{:.decimals$}", below + step);
                // Of a large value the last decimals are beyond what a number holds, and one step may be none.
                if above.parse().is_ok_and(|above: f64| above >= value.abs()) || !step.is_finite() {
                    return format!("{sign}{above}");
                }
                step *= 2.0;
            }
        }
        _ => format!("{sign}{nearest}"),
    }
}

/// [`shown`] line by line: of a text that has lines of its own.
pub fn lines(text: &str, place: Place) -> String {
    let lines: Vec<String> = text.split('\n').map(|line| shown(line, place)).collect();
    lines.join("\n")
}

/// Indented JSON with a final newline, in which every character is seen: others stand as JSON's escapes.
pub fn json<T: serde::Serialize>(value: &T) -> String {
    // Structures of strings and finite numbers always have a JSON form.
    let plain = serde_json::to_string_pretty(value).unwrap_or_default() + "\n";
    let mut units = [0; 2];
    let mut json = String::with_capacity(plain.len());
    for c in plain.chars() {
        if c == '\n' || is_visible(c) {
            json.push(c);
        } else {
            let escapes = c.encode_utf16(&mut units).iter();
            json.extend(escapes.map(|unit| format!("\\u{unit:04x}")));
        }
    }
    json
}

/// It is seen, and where it is written: no control, no mark of direction, no blank without a width.
pub fn is_visible(c: char) -> bool {
    !c.is_control()
        && !BLANKS.contains(&c)
        && !matches!(c,
            '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}'
            | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{fe00}'..='\u{fe0f}' | '\u{feff}'
            | '\u{fff0}'..='\u{fffb}' | '\u{fffe}' | '\u{ffff}' | '\u{e0000}'..='\u{e0fff}')
}

/// It has a meaning in a sentence or a unit.
fn is_known(c: char) -> bool {
    c.is_ascii() || c.is_alphanumeric() || MARKS.contains(c)
}

/// It ends no comment and no string, whatever stands around the text.
fn is_harmless(before: Option<char>, c: char, after: Option<char>, last: bool) -> bool {
    match c {
        // The command that a file records is quoted for a shell, and stays one in a banner.
        '\\' => after == Some('\'') && !last,
        '"' | '$' => false,
        '*' => before != Some('/') && after != Some('/'),
        // `/` is kept: a star beside it is not.
        '?' => before != Some('?'),
        '#' => !last,
        _ => true,
    }
}

#[cfg(test)]
#[path = "text_tests.rs"]
mod tests;
