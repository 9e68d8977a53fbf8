//! Which files a bundle has.

use crate::emit::views::Language;

/// What a bundle says to its user.
pub const README: &str = "README.md";
/// SHA-256 of every other file but the manifest, as `sha256sum -c` reads them.
pub const SUMS: &str = "SHA256SUMS";

/// The paths of a bundle's sources, as [`emit`](super::files::emit) gives them: of tables alone, or with code.
pub fn sources(prefix: &str, only_tables: bool, language: Language) -> Vec<String> {
    let p = prefix;
    match language {
        Language::C => {
            let mut paths = vec![format!("{p}_tables.h"), format!("{p}_tables.c")];
            if !only_tables {
                paths.extend([
                    format!("{p}_arith.h"),
                    format!("{p}.h"),
                    format!("{p}.c"),
                    format!("{p}_selftest.c"),
                    format!("test/{p}_harness.c"),
                    "Makefile".to_owned(),
                    "CMakeLists.txt".to_owned(),
                    README.to_owned(),
                    SUMS.to_owned(),
                ]);
            }
            paths
        }
        Language::Rust => {
            let mut paths = vec![
                "src/lib.rs",
                "src/selftest.rs",
                "Cargo.toml",
                "src/bin/harness.rs",
            ];
            if !only_tables {
                paths.extend(["tests/vectors.rs", README, SUMS]);
            }
            paths.into_iter().map(str::to_owned).collect()
        }
    }
}

/// The folders of a product's parts, which are those parts of a bundle as well.
pub const PARTS: [&str; 3] = ["chain", "conversion", "correction"];

/// The prefix of a part in a product of this name.
pub fn prefix_of(name: &str, part: &str) -> String {
    match part {
        "chain" => name.to_owned(),
        other => format!("{name}_{other}"),
    }
}

/// The design's name that the prefix of a bundle of this part was made of.
pub fn name_of<'a>(prefix: &'a str, part: &str) -> &'a str {
    match PARTS.contains(&part) {
        true => prefix.strip_suffix(&prefix_of("", part)).unwrap_or(prefix),
        false => prefix,
    }
}

/// The sources that a product has beside those of its parts.
pub fn of_product(prefix: &str, language: Language) -> Vec<String> {
    let own: &[&str] = match language {
        Language::C => &["Makefile", "CMakeLists.txt"],
        Language::Rust => &["Cargo.toml", "src/main.rs", "tests/parts.rs"],
    };
    let mut paths: Vec<String> = own.iter().map(|path| (*path).to_owned()).collect();
    if language == Language::C {
        paths.push(format!("test/{prefix}_all.c"));
    }
    paths.extend([README.to_owned(), SUMS.to_owned()]);
    paths
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emit::bundle::Part;
    use crate::firmware::{files, manifest};

    #[test]
    fn a_designs_name_is_read_back_from_the_prefix() {
        for part in PARTS {
            assert_eq!(name_of(&prefix_of("my_gyro", part), part), "my_gyro");
        }
        // These have the name as it is.
        for (name, part) in [("my_tables", "tables"), ("my_gyro", "all")] {
            assert_eq!(name_of(name, part), name);
        }
    }

    /// What `verify` holds a bundle against is what is emitted.
    #[test]
    fn emitted_sources_are_those_that_are_known() {
        let design = crate::design::reader::read(None).expect("the default design");
        for (part, only_tables) in [(Part::Tables, true), (Part::Compensation, false)] {
            for language in [Language::C, Language::Rust] {
                let emitted = files::emit(&design, part, language, "test").expect("emitted");
                let paths = emitted.iter().map(|f| f.path.clone());
                let mut found: Vec<String> = paths
                    .filter(|p| !p.starts_with("vectors/") && p != manifest::NAME)
                    .collect();
                let mut due = sources(&design.name, only_tables, language);
                found.sort();
                due.sort();
                assert_eq!(found, due);
            }
        }
    }
}
