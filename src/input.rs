//! Files that are read whole: nothing without an end is, and nothing beyond a stated size.

use crate::error::{Error, InputError, Result, io_error};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Most bytes of a design.
pub const MOST_OF_A_DESIGN: u64 = 1 << 24;

/// Most bytes of a record or a profile in text.
pub const MOST_OF_A_RECORD: u64 = 1 << 30;

/// Bytes that are looked at before more is read.
const CHUNK_BYTES: u64 = 1 << 20;

/// Opens a file or a pipe to read `what` from it.
///
/// # Errors
/// A path that cannot be opened; a folder; a device, which has no end.
pub fn open(path: &Path, what: &str) -> Result<File> {
    let failed = |e: &io::Error| io_error(path, &format!("read the {what}"), e);
    let file = File::open(path).map_err(|e| match (similar(path), failed(&e)) {
        (Some(other), Error::Input(e)) if !path.exists() && !other.is_dir() => {
            e.help(format!("did you mean {}?", other.display())).into()
        }
        (_, error) => error,
    })?;
    let found = file.metadata().map_err(|e| failed(&e))?;
    let refused = |kind: &str| {
        InputError::new(format!("this is a {kind}, not a {what}"))
            .in_file(path)
            .help("name a file")
    };
    if found.is_dir() {
        return Err(refused("folder").into());
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = found.file_type();
        if kind.is_char_device() || kind.is_block_device() {
            return Err(refused("device").into());
        }
    }
    Ok(file)
}

/// What lies in the same folder under nearly that name: one that differs in capitals alone, else in few letters.
pub fn similar(path: &Path) -> Option<PathBuf> {
    let folder = match path.parent()? {
        here if here == Path::new("") => Path::new("."),
        folder => folder,
    };
    let name = path.file_name()?.to_str()?;
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    let mut names: Vec<String> = entries
        .filter_map(|e| e.file_name().into_string().ok())
        .filter(|other| !other.starts_with('.'))
        .collect();
    // The order of a folder's entries is nobody's.
    names.sort();
    let known: Vec<&str> = names.iter().map(String::as_str).collect();
    // A name of a letter or two is near to any other.
    let is_short = name.split('.').next().is_none_or(|stem| stem.len() < 3);
    let near = || crate::nearest::nearest(name, &known).filter(|_| !is_short);
    let in_capitals = known.iter().find(|other| other.eq_ignore_ascii_case(name));
    let other = in_capitals.copied().or_else(near)?;
    Some(path.with_file_name(other))
}

/// The files that are there under a path, or under one that differs from it in the case of its extension alone: `CAP.TOML`
/// for `CAP.toml`.
pub fn in_any_case(path: &Path) -> Vec<PathBuf> {
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let Ok(entries) = std::fs::read_dir(folder) else {
        // A folder that may be entered and not be listed.
        let there = path.exists().then(|| path.to_path_buf());
        return there.into_iter().collect();
    };
    let is_one = |other: &Path| match (other.extension(), path.extension()) {
        (Some(a), Some(b)) => other.file_stem() == path.file_stem() && a.eq_ignore_ascii_case(b),
        _ => other.file_name() == path.file_name(),
    };
    let names = entries.flatten().map(|e| PathBuf::from(e.file_name()));
    let found = names.filter(|name| is_one(name));
    let mut found: Vec<PathBuf> = found.map(|name| path.with_file_name(name)).collect();
    // The order of a folder's entries is nobody's.
    found.sort();
    found
}

/// All bytes of a text, or as many as it takes to see that it is none (a byte 0, or what is not UTF-8).
///
/// # Errors
/// A failed read; more than `most` bytes.
pub fn text_bytes(mut input: impl Read, path: &Path, what: &str, most: u64) -> Result<Vec<u8>> {
    // A buffer that grows by doubling would take up to twice the file.
    let size = std::fs::metadata(path).map_or(0, |m| if m.is_file() { m.len() } else { 0 });
    let mut bytes = Vec::with_capacity(size.min(most) as usize + 1);
    let mut looked_at = 0;
    loop {
        let count = input
            .by_ref()
            .take(CHUNK_BYTES)
            .read_to_end(&mut bytes)
            .map_err(|e| io_error(path, &format!("read the {what}"), &e))?;
        if count == 0 || is_no_text(&bytes, &mut looked_at) {
            return Ok(bytes);
        }
        if bytes.len() as u64 > most {
            let message = format!("the {what} is larger than {} MiB", most >> 20);
            return Err(InputError::new(message)
                .in_file(path)
                .help("give a part of it, or averages of its rows")
                .into());
        }
    }
}

/// True if the bytes from `looked_at` on cannot be text; moves it to the last whole character.
fn is_no_text(bytes: &[u8], looked_at: &mut usize) -> bool {
    let new = &bytes[*looked_at..];
    match std::str::from_utf8(new) {
        Ok(_) => *looked_at = bytes.len(),
        Err(e) if e.error_len().is_some() => return true,
        Err(e) => *looked_at += e.valid_up_to(),
    }
    new.contains(&0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts what is asked of it.
    struct Endless<'a>(&'a [u8], usize);

    impl Read for Endless<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            for b in buffer.iter_mut() {
                *b = self.0[self.1 % self.0.len()];
                self.1 += 1;
            }
            Ok(buffer.len())
        }
    }

    #[test]
    fn what_is_no_text_is_not_read_to_its_end() {
        for what in [&b"\0"[..], b"1,2\n\xff", b"caf\xc3\xa9\n\xc3\n"] {
            let mut endless = Endless(what, 0);
            let read =
                text_bytes(&mut endless, Path::new("x"), "record", MOST_OF_A_RECORD).unwrap();
            assert!(read.len() as u64 <= 2 * CHUNK_BYTES);
        }
        // A character that is cut by the end of a chunk is whole in the next one.
        let long = "é".repeat(CHUNK_BYTES as usize) + "x";
        let read = text_bytes(
            &mut long[..].as_bytes(),
            Path::new("x"),
            "record",
            MOST_OF_A_RECORD,
        )
        .unwrap();
        assert_eq!(read, long.as_bytes());
    }

    #[test]
    fn what_has_no_end_is_refused_at_its_limit() {
        let error = text_bytes(Endless(b"1,2\n", 0), Path::new("x"), "design", 1 << 22);
        let error = error.unwrap_err().to_string();
        assert!(error.contains("larger than 4 MiB"), "{error}");
    }

    #[test]
    fn a_name_with_a_letter_too_many_is_shown_right() {
        let made = tempfile::tempdir().expect("a folder");
        let at = made.path();
        std::fs::write(at.join("run.csv"), "").expect("written");
        for name in ["runn.csv", "Run.CSV"] {
            assert_eq!(similar(&at.join(name)), Some(at.join("run.csv")), "{name}");
        }
        assert_eq!(similar(&at.join("elsewhere.csv")), None);
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_no_file() {
        let error = open(Path::new("/dev/zero"), "record").unwrap_err();
        assert!(
            error.to_string().contains("a device, not a record"),
            "{error}"
        );
        assert!(open(&std::env::temp_dir(), "record").is_err());
    }
}
