//! Processes that end with this one.

use super::{Leftover, Ticket, undisturbed};
use std::io;
use std::process::{self, Command, ExitStatus, Output, Stdio};

/// A started process in a group of its own. Dropped before it has ended, it is killed with all that it started.
#[derive(Debug)]
pub struct Child {
    /// Its streams; wait with [`Child::wait`].
    pub process: process::Child,
    ended: bool,
    _ticket: Option<Ticket>,
}

/// Starts a process.
///
/// # Errors
/// A program that cannot be started.
pub fn spawn(command: &mut Command) -> io::Result<Child> {
    let mut registry = undisturbed();
    #[cfg(unix)]
    {
        // Its own group: one `kill` reaches a compiler's passes and its linker as well.
        use std::os::unix::process::CommandExt;
        command.process_group(0);
    }
    let process = command.spawn()?;
    #[cfg(unix)]
    let ticket = group(&process).map(|group| registry.register(Leftover::Group(group)));
    #[cfg(not(unix))]
    let ticket = None;
    drop(registry);
    Ok(Child {
        process,
        ended: false,
        _ticket: ticket,
    })
}

/// Starts a process without input, waits for it and takes what it prints.
///
/// # Errors
/// A program that cannot be started, or whose output cannot be read.
pub fn output(command: &mut Command) -> io::Result<Output> {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = spawn(command)?;
    let (stdout, stderr) = (child.process.stdout.take(), child.process.stderr.take());
    // Both at once, so that neither fills its pipe while the other is read.
    let reader = std::thread::spawn(move || read(stderr));
    let stdout = read(stdout);
    let stderr = reader.join().unwrap_or_else(|_| Ok(Vec::new()));
    Ok(Output {
        status: child.wait()?,
        stdout: stdout?,
        stderr: stderr?,
    })
}

fn read(stream: Option<impl io::Read>) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    if let Some(mut stream) = stream {
        stream.read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

impl Child {
    /// Waits for the end.
    ///
    /// # Errors
    /// A process that cannot be waited for.
    pub fn wait(&mut self) -> io::Result<ExitStatus> {
        let status = self.process.wait()?;
        self.ended = true;
        Ok(status)
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        if self.ended {
            return;
        }
        #[cfg(unix)]
        if let Some(group) = group(&self.process) {
            kill(group);
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[cfg(unix)]
fn group(process: &process::Child) -> Option<rustix::process::Pid> {
    rustix::process::Pid::from_raw(i32::try_from(process.id()).ok()?)
}

#[cfg(unix)]
pub(super) fn kill(group: rustix::process::Pid) {
    // It may have ended by itself.
    let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
}
