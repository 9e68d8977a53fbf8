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

/// Runs a line of a shell in a folder, in which `gyrogen` is the program.
pub fn shell(line: &str, folder: &Path) -> Output {
    let program = Path::new(env!("CARGO_BIN_EXE_gyrogen"));
    let own = program.parent().expect("a folder").display();
    let path = std::env::var("PATH").unwrap_or_default();
    let mut command = Command::new("bash");
    command.args(["-c", line]).current_dir(folder);
    command.env("PATH", format!("{own}:{path}"));
    command.output().expect("a shell")
}

/// Runs another program in a folder.
pub fn run(program: &str, arguments: &[&str], folder: &Path) -> Output {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output();
    output.unwrap_or_else(|e| panic!("{program}: {e}"))
}

/// Fails with what was said if the program did.
pub fn good(output: &Output) {
    assert!(output.status.success(), "{}", told(output));
}

/// What was said on stderr.
pub fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Both streams, stdout first.
pub fn all_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &told(output)
}

/// A small call of `approx`.
pub const APPROX: [&str; 11] = [
    "approx",
    "--function=-x^2",
    "--domain=-1,1",
    "--input",
    "Q1.9",
    "--output",
    "Q2.10",
    "--degree",
    "2",
    "--coefficients",
    "Q2.14",
];

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}
