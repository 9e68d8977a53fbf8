//! A file of a bundle, before it is written.

/// A file of a bundle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EmittedFile {
    /// Path inside the bundle, with `/`.
    pub path: String,
    /// Contents.
    pub text: String,
}
