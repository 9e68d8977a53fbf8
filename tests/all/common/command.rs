//! The program as a user starts it.

use std::path::Path;
use std::process::{Command, Output};

/// Runs `gyrogen` in a folder, with further variables in its environment.
pub fn gyrogen_in(folder: &Path, arguments: &[&str], environment: &[(&str, &str)]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gyrogen"));
    command.current_dir(folder).args(arguments);
    command.envs(environment.iter().copied());
    command.output().expect("the program runs")
}
