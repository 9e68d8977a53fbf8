//! Programs that are ended: a compiler or harness that hangs or floods is nobody's to wait for.

use crate::error::{Error, InputError, Result};
use crate::leftovers;
use std::io::Read;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Seconds that a compiler or a run of the harness may take, unless `GYROGEN_TIME_LIMIT` says otherwise.
const SECONDS: u64 = 600;
/// Bytes of messages that are read from a compiler.
const MOST_BYTES: u64 = 1 << 20;

/// The time that a program may take.
pub fn limit() -> Duration {
    let named = std::env::var("GYROGEN_TIME_LIMIT").ok();
    let seconds = named.and_then(|text| text.parse().ok()).filter(|s| *s > 0);
    Duration::from_secs(seconds.unwrap_or(SECONDS))
}

/// What a program said.
#[derive(Debug)]
pub struct Said {
    /// How it ended.
    pub status: ExitStatus,
    /// The beginning of its output.
    pub stdout: Vec<u8>,
    /// The beginning of its messages.
    pub stderr: Vec<u8>,
}

/// Runs a program to its end and gives what it said.
///
/// # Errors
/// A program that cannot be started (exit 2); one that does not end in [`limit`], which is then ended (a check that
/// does not hold).
pub fn output(mut command: Command, what: &str) -> Result<Said> {
    let failed = |e: std::io::Error| InputError::new(format!("cannot run {what}: {e}"));
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let limit = limit();
    let until = Instant::now() + limit;
    let mut child = leftovers::spawn(&mut command).map_err(failed)?;
    let (stdout, stderr) = (child.process.stdout.take(), child.process.stderr.take());
    let (status, stdout, stderr) = std::thread::scope(|scope| {
        let stdout = scope.spawn(move || beginning(stdout));
        let stderr = scope.spawn(move || beginning(stderr));
        let status = child.wait(until);
        // What it started may hold the pipes open.
        let ended = child.end();
        let status = ended.and(status);
        (
            status,
            stdout.join().unwrap_or_default(),
            stderr.join().unwrap_or_default(),
        )
    });
    match status.map_err(failed)? {
        Some(status) => Ok(Said {
            status,
            stdout,
            stderr,
        }),
        None => Err(Error::Check(format!(
            "{what} did not end within {} s and was ended (GYROGEN_TIME_LIMIT gives another limit, in seconds)",
            limit.as_secs()
        ))),
    }
}

/// The beginning of a stream; the rest is read and dropped, so that the program can go on.
fn beginning(stream: Option<impl Read>) -> Vec<u8> {
    let mut bytes = Vec::new();
    if let Some(mut stream) = stream {
        let _ = stream.by_ref().take(MOST_BYTES).read_to_end(&mut bytes);
        let _ = std::io::copy(&mut stream, &mut std::io::sink());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_streams_are_taken() {
        let mut command = Command::new("sh");
        command.args(["-c", "echo out; echo err >&2; exit 3"]);
        let said = output(command, "the shell").unwrap();
        assert_eq!(said.stdout, b"out\n");
        assert_eq!(said.stderr, b"err\n");
        assert_eq!(said.status.code(), Some(3));
    }
}
