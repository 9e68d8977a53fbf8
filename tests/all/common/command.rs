//! The program as a user starts it, other programs, and what they say.

use std::path::Path;
use std::process::{Command, Output};

/// Runs `gyrogen` in a folder, with further variables in its environment.
pub fn gyrogen_in(folder: &Path, arguments: &[&str], environment: &[(&str, &str)]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gyrogen"));
    command.current_dir(folder).args(arguments);
    command.envs(environment.iter().copied());
    command.output().expect("the program runs")
}

/// Runs `gyrogen` in a folder.
pub fn gyrogen(arguments: &[&str], folder: &Path) -> Output {
    gyrogen_in(folder, arguments, &[])
}

/// Runs `gyrogen` where the tests run: to be used where every path that it is given is a whole one.
pub fn gyrogen_here(arguments: &[&str]) -> Output {
    gyrogen(arguments, Path::new("."))
}

/// Runs another program in a folder.
pub fn run(program: &str, arguments: &[&str], folder: &Path) -> Output {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output();
    output.unwrap_or_else(|e| panic!("{program}: {e}"))
}

/// What was said on stderr.
pub fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Both streams, stdout first.
pub fn all_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &told(output)
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}
