//! What must not outlive the process: temporary files and folders, and the compilers and programs that it started.
//!
//! All of it is registered while it exists. A signal that ends the process (Ctrl-C, `kill`) kills the registered children
//! with all that they started, removes the registered paths and then ends the process as the signal does ([`on_signals`]).
//! What a `kill -9` leaves is found by the next run: each temporary file or folder is called `.gyrogen-*.tmp` and locked by
//! the process that it belongs to; a lock ends with its process, so that what can be locked belongs to nobody and is removed
//! ([`sweep`]).

mod children;
mod temporary;

pub use children::{Child, spawn};
pub use temporary::{TemporaryFile, TemporaryFolder, sweep};

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Something that is gone when the process is.
#[derive(Debug)]
enum Leftover {
    /// A file, or a folder with all that is in it.
    Path(PathBuf),
    /// A process and all that it started.
    #[cfg(unix)]
    Group(rustix::process::Pid),
}

/// All that there is now, by the number of its ticket.
#[derive(Debug, Default)]
struct Registry {
    next: u64,
    held: BTreeMap<u64, Leftover>,
}

static REGISTRY: Mutex<Registry> = Mutex::new(Registry {
    next: 0,
    held: BTreeMap::new(),
});

/// While this is held, no signal ends the process: for steps that belong together. Once a signal has come it is never
/// given again.
#[derive(Debug)]
pub struct Undisturbed(MutexGuard<'static, Registry>);

/// Waits until no other such steps are under way.
pub fn undisturbed() -> Undisturbed {
    // The map is whole whatever panicked beside it.
    Undisturbed(REGISTRY.lock().unwrap_or_else(PoisonError::into_inner))
}

impl Undisturbed {
    fn register(&mut self, what: Leftover) -> Ticket {
        let ticket = self.0.next;
        self.0.next += 1;
        self.0.held.insert(ticket, what);
        Ticket(ticket)
    }
}

/// Ends a registration when it is dropped.
#[derive(Debug)]
struct Ticket(u64);

impl Drop for Ticket {
    fn drop(&mut self) {
        undisturbed().0.held.remove(&self.0);
    }
}

/// From now on a signal that ends the process leaves nothing behind: see the module.
///
/// Without signals (another system, a process that may not start a thread) the next run removes what is left.
pub fn on_signals() {
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
        let mut wanted = vec![SIGINT, SIGTERM];
        // `nohup` has it ignored, and that it stays.
        if !hangup_is_ignored() {
            wanted.push(SIGHUP);
        }
        let Ok(mut signals) = signal_hook::iterator::Signals::new(wanted) else {
            return;
        };
        let watch = move || {
            if let Some(signal) = signals.forever().next() {
                let held = undisturbed();
                remove_all(&held.0);
                // Ends the process; the registry stays locked, so that nothing new begins before.
                let _ = signal_hook::low_level::emulate_default_handler(signal);
                std::process::exit(128 + signal);
            }
        };
        let _ = std::thread::Builder::new()
            .name("signals".to_owned())
            .spawn(watch);
    }
}

#[cfg(unix)]
fn hangup_is_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("SigIgn:"));
    let mask = line.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    // The first bit is signal 1, the hangup.
    mask.is_some_and(|mask| mask & 1 == 1)
}

#[cfg(unix)]
fn remove_all(registry: &Registry) {
    for leftover in registry.held.values() {
        if let Leftover::Group(group) = leftover {
            children::kill(*group);
        }
    }
    // A thread or a dying child may still write into a folder while it is emptied.
    const TRIES: usize = 200;
    for _ in 0..TRIES {
        let paths = registry
            .held
            .values()
            .filter_map(|leftover| match leftover {
                Leftover::Path(path) => Some(path),
                Leftover::Group(_) => None,
            });
        let left = paths.filter(|path| !is_removed(path)).count();
        if left == 0 {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Removes a file or a folder; true if nothing is there any more.
fn is_removed(path: &Path) -> bool {
    let _ = match path.symlink_metadata() {
        Err(_) => return true,
        Ok(found) if found.is_dir() => std::fs::remove_dir_all(path),
        Ok(_) => std::fs::remove_file(path),
    };
    path.symlink_metadata().is_err()
}

#[cfg(test)]
#[path = "leftovers_tests.rs"]
mod tests;
