//! Files that no list names and that say by themselves what wrote them: a user's own file of such a name is told apart.

use crate::digest::sha256;

/// How a name ends, and how a file of that name begins that gyrogen wrote.
const BEGINNINGS: [(&str, &str); 4] = [
    ("timing.json", "{\n  \"schema\": \"gyrogen.timing/"),
    ("verify.json", "{\n  \"schema\": \"gyrogen.verify/"),
    (".journal", "gyrogen.study.journal/"),
    (".runs", "gyrogen.study.shard/"),
];

/// How the name of a manual page ends; its last line holds the digest of the others.
const PAGE: &str = ".1";

/// A comment of troff, before the digest.
const SEAL: &str = ".\\\" SHA-256 of the lines above: ";

/// Whether gyrogen wrote these bytes, and for a sealed file whether they are as it wrote them; `None` for a name of
/// which the bytes do not tell.
pub fn is_own(name: &str, bytes: &[u8]) -> Option<bool> {
    if name.ends_with(PAGE) {
        let text = String::from_utf8_lossy(bytes);
        return Some(text.rfind(SEAL).is_some_and(|end| {
            let above = text.get(..end).unwrap_or_default();
            text == sealed(above)
        }));
    }
    let (_, beginning) = BEGINNINGS.iter().find(|(end, _)| name.ends_with(end))?;
    Some(bytes.starts_with(beginning.as_bytes()))
}

/// A manual page with the digest that tells whether it was edited.
pub fn sealed(page: &str) -> String {
    format!("{page}{SEAL}{}\n", sha256(page.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_known_by_its_beginning_and_a_page_by_its_digest() {
        let timing = b"{\n  \"schema\": \"gyrogen.timing/1\",\n}";
        assert_eq!(is_own("timing.json", timing), Some(true));
        assert_eq!(is_own("verify.json", timing), Some(false));
        assert_eq!(is_own("report.html", timing), None);
        let page = sealed(".TH gyrogen 1\n");
        assert_eq!(is_own("gyrogen.1", page.as_bytes()), Some(true));
        for edited in [
            page.replace(".TH", ".SH"),
            page.clone() + "mine\n",
            "mine".to_owned(),
        ] {
            assert_eq!(
                is_own("gyrogen.1", edited.as_bytes()),
                Some(false),
                "{edited}"
            );
        }
    }
}
