//! Programs that end after so much processor time, so that a busy machine does not decide an outcome.

use std::path::Path;
use std::process::Command;

/// A program that is ended after so many seconds of processor time. Arguments can be added.
pub fn limited(program: &Path, seconds: u32) -> Command {
    let mut command = Command::new("sh");
    let script = format!("ulimit -t {seconds}; exec \"$0\" \"$@\"");
    command.args(["-c", &script]).arg(program);
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_computes_for_ever_is_ended_and_one_that_does_not_is_not() {
        let ends = |script: &str| {
            let mut command = limited(Path::new("sh"), 1);
            command.args(["-c", script]);
            command.status().expect("a shell").success()
        };
        assert!(!ends("while :; do :; done"));
        assert!(ends("sleep 2"));
    }
}
