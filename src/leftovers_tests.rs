use super::*;
use std::process::{Command, Stdio};

#[test]
fn what_nobody_holds_is_swept_and_nothing_else() {
    let top = tempfile::tempdir().unwrap();
    let held = TemporaryFolder::new(top.path()).unwrap();
    let file = TemporaryFile::new(top.path()).unwrap();
    std::fs::create_dir(top.path().join(".gyrogen-dead.tmp")).unwrap();
    std::fs::write(top.path().join(".gyrogen-dead.tmp/x"), "").unwrap();
    std::fs::write(top.path().join(".gyrogen-dead2.tmp"), "").unwrap();
    for kept in [".gyrogen-notes", "gyrogen-x.tmp"] {
        std::fs::write(top.path().join(kept), "").unwrap();
    }
    sweep(top.path());
    let count = || std::fs::read_dir(top.path()).unwrap().count();
    assert_eq!(count(), 4);
    assert!(held.path().is_dir() && file.file.path().is_file());
    drop((held, file));
    assert_eq!(count(), 2);
}

#[cfg(unix)]
#[test]
fn what_is_made_while_others_sweep_stays() {
    let top = tempfile::tempdir().unwrap();
    let sweepers_end = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                while !sweepers_end.load(std::sync::atomic::Ordering::Relaxed) {
                    sweep(top.path());
                }
            });
        }
        let mut held = Vec::new();
        for _ in 0..400 {
            held.push((
                TemporaryFolder::new(top.path()).unwrap(),
                TemporaryFile::new(top.path()).unwrap(),
            ));
        }
        sweepers_end.store(true, std::sync::atomic::Ordering::Relaxed);
        std::thread::sleep(std::time::Duration::from_millis(50));
        let lost = held
            .iter()
            .filter(|(folder, file)| !folder.path().exists() || !file.file.path().exists())
            .count();
        assert_eq!(lost, 0);
    });
}

#[cfg(unix)]
#[test]
fn a_child_that_is_dropped_ends_with_all_that_it_started() {
    let top = tempfile::tempdir().unwrap();
    let mark = top.path().join("mark");
    let mut command = Command::new("sh");
    // The inner shell would leave a mark after a while.
    let line = format!("(sleep 2; touch {}) & echo up; wait", mark.display());
    command
        .args(["-c", &line])
        .stdin(Stdio::null())
        .stdout(Stdio::piped());
    let mut child = spawn(&mut command).unwrap();
    let mut up = [0; 3];
    let mut stdout = child.process.stdout.take().unwrap();
    std::io::Read::read_exact(&mut stdout, &mut up).unwrap();
    drop(child);
    std::thread::sleep(std::time::Duration::from_millis(2500));
    assert!(!mark.exists());
}
