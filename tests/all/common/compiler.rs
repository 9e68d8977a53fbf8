//! The C compiler.

use std::process::Command;

/// The one that `CC` names, with its arguments, or `cc`.
pub fn cc() -> Command {
    let named = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let mut words = named.split_whitespace();
    let mut command = Command::new(words.next().expect("a compiler"));
    command.args(words);
    command
}
