//! Digests of what was read and written.

use sha2::{Digest, Sha256};

/// SHA-256 in lower-case hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|b| format!("{b:02x}"))
        .collect()
}

/// A text with LF for CR LF, which git may have made of LF.
pub fn with_lf(text: &str) -> String {
    text.replace("\r\n", "\n")
}
