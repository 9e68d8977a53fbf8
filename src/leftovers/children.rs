//! Processes that end with this one.

use super::{Leftover, Ticket, undisturbed};
use std::io;
use std::process::{self, Command, ExitStatus};
use std::time::{Duration, Instant};

/// So often is looked whether a process has ended.
const LOOK: Duration = Duration::from_millis(2);

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

impl Child {
    /// Waits for the end, at most until `until`; `None`: it was ended.
    ///
    /// # Errors
    /// A process that cannot be waited for.
    pub fn wait(&mut self, until: Instant) -> io::Result<Option<ExitStatus>> {
        loop {
            if let Some(status) = self.process.try_wait()? {
                self.ended = true;
                return Ok(Some(status));
            }
            if Instant::now() >= until {
                self.end()?;
                return Ok(None);
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Ends it with all that it started.
    ///
    /// # Errors
    /// A process that cannot be waited for.
    pub fn end(&mut self) -> io::Result<()> {
        #[cfg(unix)]
        if let Some(group) = group(&self.process) {
            kill(group);
        }
        // It may have ended by itself.
        let _ = self.process.kill();
        self.process.wait()?;
        self.ended = true;
        Ok(())
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        if !self.ended {
            // Nobody is left to be told.
            let _ = self.end();
        }
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
