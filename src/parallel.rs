//! Jobs on several threads, with results that do not depend on the schedule.

/// `work` on every job by `threads` threads; results in the jobs' order.
pub fn in_parallel<J: Sync, T: Send>(
    jobs: &[J],
    threads: usize,
    said: &(dyn Fn(usize) + Sync),
    work: impl Fn(&J) -> T + Sync,
) -> Vec<T> {
    use std::sync::atomic::{AtomicUsize, Ordering};
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let one = || {
        let mut own = Vec::new();
        while let Some((k, job)) = {
            let k = next.fetch_add(1, Ordering::Relaxed);
            jobs.get(k).map(|job| (k, job))
        } {
            own.push((k, work(job)));
            said(done.fetch_add(1, Ordering::Relaxed) + 1);
        }
        own
    };
    let mut results = std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads.max(1)).map(|_| scope.spawn(one)).collect();
        let mut all = one();
        for other in others {
            match other.join() {
                Ok(part) => all.extend(part),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        all
    });
    results.sort_by_key(|(k, _)| *k);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Two jobs side by side; what they give does not depend on which ends first.
pub fn both<T: Send>(a: impl FnOnce() -> T + Send, b: impl FnOnce() -> T + Send) -> (T, T) {
    std::thread::scope(|scope| {
        let second = scope.spawn(b);
        let first = a();
        match second.join() {
            Ok(second) => (first, second),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}
