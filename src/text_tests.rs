use super::*;
use proptest::prelude::*;

/// What ends comments and strings, splices lines, commands a terminal, or reorders what is read.
const HOSTILE: [&str; 24] = [
    "*/",
    "/*",
    "//",
    "\n",
    "\r",
    "\\",
    "\\\n",
    "??/",
    "??/\n",
    "\"",
    "'",
    "`",
    "/**/",
    "*//*",
    "\u{1b}[2J",
    "\0",
    "\u{202e}",
    "\u{2066}",
    "\u{2028}",
    "\u{feff}",
    "$(rm)",
    "#",
    "\u{85}",
    "r#\"",
];

fn hostile() -> impl Strategy<Value = String> {
    let part = prop_oneof![
        3 => prop::sample::select(&HOSTILE[..]).prop_map(str::to_owned),
        1 => "[a-z */?\\\\\"']{0,5}",
        1 => any::<String>(),
    ];
    prop::collection::vec(part, 0..8).prop_map(|parts| parts.concat())
}

proptest! {
    #[test]
    fn a_bound_is_never_printed_below_itself(mantissa in -1e3f64..1e3, exponent in -30i32..12, digits in 1usize..7) {
        let value = mantissa * 10f64.powi(exponent);
        let up = away_from_zero(value, digits);
        prop_assert!(up.abs() >= value.abs() && up.abs() <= value.abs() * (1.0 + 10f64.powi(1 - digits as i32)));
        let printed: f64 = at_most(value, digits).parse().unwrap();
        prop_assert!(value.abs() < TOLD_AS_ZERO_BELOW || printed == up, "{printed} {up}");
        let column: f64 = away_from_zero_decimals(value, digits).parse().unwrap();
        let step = 10f64.powi(-(digits as i32));
        prop_assert!(column.abs() >= value.abs(), "{column} {value}");
        prop_assert!(column.abs() <= value.abs() + step * 1.001 + value.abs() * 1e-15);
    }
    #[test]
    fn in_a_source_nothing_ends_a_comment_or_a_string(text in hostile()) {
        let shown = shown(&text, Place::Source);
        prop_assert!(!shown.ends_with('\\'));
        // A shell's apostrophe joins no lines.
        let shown_else = shown.replace("\\'", "'");
        for end in ["*/", "/*", "??", "\\", "\"", "\n", "\r", "$"] {
            prop_assert!(!shown_else.contains(end), "{end:?} in {shown:?}");
        }
        prop_assert!(shown.chars().all(is_visible));
        // Again is the same: a line that is shown may be shown inside another one.
        prop_assert_eq!(super::shown(&shown, Place::Source), shown.clone());
    }

    #[test]
    fn on_a_screen_every_character_is_seen(text in hostile()) {
        prop_assert!(shown(&text, Place::Screen).chars().all(is_visible));
        prop_assert!(lines(&text, Place::Screen).chars().all(|c| c == '\n' || is_visible(c)));
        let json = json(&text);
        prop_assert!(json.chars().all(|c| c == '\n' || is_visible(c)));
        prop_assert_eq!(serde_json::from_str::<String>(&json).unwrap(), text);
    }

    #[test]
    fn plain_words_stay_as_they_are(text in "[A-Za-z0-9_ .,;:+=()<>µ°-]{0,60}") {
        prop_assert_eq!(shown(&text, Place::Source), text.clone());
        prop_assert_eq!(shown(&text, Place::Screen), text);
    }
}

#[test]
fn what_is_replaced_can_be_read() {
    assert_eq!(
        shown("supply */ int evil(void); /*", Place::Source),
        "supply {U+002A}/ int evil(void); /{U+002A}"
    );
    assert_eq!(shown("a\nb", Place::Screen), "a{U+000A}b");
    assert_eq!(shown("what??/", Place::Source), "what?{U+003F}/");
    assert_eq!(
        shown(r"'my '\''own'\'' \n\", Place::Source),
        r"'my '\''own'\'' {U+005C}n{U+005C}"
    );
    assert_eq!(shown("2 * x / y", Place::Source), "2 * x / y");
    let long = "a".repeat(2500);
    assert!(shown(&long, Place::Source).ends_with("a{500 more characters}"));
}

#[test]
fn a_number_in_a_sentence_has_its_digits_and_no_power_of_ten_where_none_is_needed() {
    assert_eq!(number(4.709e-52, 3), "0");
    assert_eq!(number(2374.3, 3), "2370");
    assert_eq!(number(26_963.2, 4), "26960");
    assert_eq!(number(1.468e-4, 3), "0.000147");
    assert_eq!(number(-0.5, 3), "-0.500");
    assert_eq!(number(9.999, 2), "10");
    assert_eq!(number(3.864e-10, 2), "3.9e-10");
    assert_eq!(number(f64::INFINITY, 3), "unknown");
}
