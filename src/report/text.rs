//! Numbers as people read them, and text that HTML and SVG take as text.

use crate::text::{Place, away_from_zero};

/// `value` with `digits` significant digits; as a power of ten beyond 1e-4..1e6.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = digits.max(1);
    let scientific = format!("{value:.*e}", digits - 1);
    let Some((mantissa, exponent)) = scientific.split_once('e') else {
        return minus(&scientific);
    };
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if (-4..6).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        let rounded: f64 = scientific.parse().unwrap_or(value);
        let text = format!("{rounded:.decimals$}");
        return minus(&if exponent > 3 {
            grouped_decimal(&text)
        } else {
            text
        });
    }
    minus(&format!(
        "{mantissa}\u{202f}×\u{202f}10{}",
        superscript(exponent)
    ))
}

/// A bound: as [`significant`], rounded away from 0, so that what is printed is never below what was proved.
pub fn bounding(value: f64, digits: usize) -> String {
    significant(away_from_zero(value, digits), digits)
}

/// `value` with fixed decimals.
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let text = format!("{value:.decimals$}");
    let zero = text
        .trim_start_matches('-')
        .chars()
        .all(|c| c == '0' || c == '.');
    minus(if zero {
        text.trim_start_matches('-')
    } else {
        &text
    })
}

/// Without zeros at the end of the decimals.
pub fn trimmed(number: &str) -> String {
    if !number.contains('.') || number.contains('×') {
        return number.to_owned();
    }
    number
        .trim_end_matches('0')
        .trim_end_matches('.')
        .to_owned()
}

/// Decimals that show one LSB.
pub fn decimals_of(lsb: f64) -> usize {
    if lsb.is_finite() && lsb > 0.0 {
        (-lsb.log10()).ceil().clamp(0.0, 9.0) as usize
    } else {
        6
    }
}

/// A share of `whole` in percent; a dash where there is no whole.
pub fn percent(part: f64, whole: f64) -> String {
    let share = 100.0 * part / whole;
    if whole <= 0.0 || !share.is_finite() {
        return "–".to_owned();
    }
    format!("{}\u{202f}%", significant(share, 3))
}

/// An integer in groups of three digits.
pub fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (k, c) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(c);
    }
    out
}

/// The digits before the point in groups of three.
pub fn grouped_decimal(text: &str) -> String {
    let (sign, text) = text.strip_prefix('-').map_or(("", text), |t| ("-", t));
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    let whole: Result<u64, _> = whole.parse();
    whole.map_or(text.to_owned(), |w| format!("{sign}{}{rest}", grouped(w)))
}

/// With a minus sign that is as wide as a plus.
pub fn minus(number: &str) -> String {
    number.replace('-', "−")
}

/// An integer as superscript.
pub fn superscript(value: i32) -> String {
    let digit = |c: char| match c {
        '-' => '⁻',
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        _ => '⁹',
    };
    value.to_string().chars().map(digit).collect()
}

/// Text for HTML and SVG, between tags and inside quoted attributes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // Neither XML nor HTML has a place for other control characters.
            c if c.is_control() => out.push(' '),
            // Nor has a reader one for marks that reorder or hide what is written.
            c if !crate::text::is_visible(c) => {
                out.push_str(&crate::text::shown(&c.to_string(), Place::Screen))
            }
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_are_asked_for() {
        assert_eq!(significant(161.889_277, 4), "161.9");
        assert_eq!(significant(-0.000_31, 2), "−0.00031");
        assert_eq!(significant(3.800_367e-8, 3), "3.80\u{202f}×\u{202f}10⁻⁸");
        assert_eq!(significant(9_999_999.0, 3), "1.00\u{202f}×\u{202f}10⁷");
        assert_eq!(significant(10_217.1, 3), "10\u{202f}200");
        assert_eq!(significant(-12_345.678, 7), "−12\u{202f}345.68");
        assert_eq!(significant(0.0, 3), "0");
        assert_eq!(significant(f64::NAN, 3), "–");
        assert_eq!(fixed(-0.000_01, 3), "0.000");
        assert_eq!(fixed(-1.5, 1), "−1.5");
        assert_eq!(grouped(71_377_538), "71\u{202f}377\u{202f}538");
        assert_eq!(grouped(999), "999");
        assert_eq!(percent(8.0, 0.0), "–");
        assert_eq!(percent(8.0, 160.0), "5.00\u{202f}%");
        assert_eq!(trimmed("26.20000"), "26.2");
        assert_eq!(trimmed("1000"), "1000");
        assert_eq!(decimals_of(2.44e-4), 4);
    }

    #[test]
    fn nothing_that_html_would_read_is_left() {
        assert_eq!(
            escape("<script>\"&'\u{7}"),
            "&lt;script&gt;&quot;&amp;&#39; "
        );
    }
}
