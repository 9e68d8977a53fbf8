//! The bank of blind records, checked by itself: `tests/blind`.
//!
//! `GYROGEN_BLIND_DUMP=DIR cargo test --release --test blind_bank dump` writes `GYROGEN_BLIND_COUNT` (20) records of each
//! class, as CSV with the truth beside them; `GYROGEN_SEED` (1) is the first seed.

mod blind;

use blind::Scenario;

#[test]
fn smoke() {
    let started = std::time::Instant::now();
    for (name, s) in blind::dump::bank(20, 1) {
        let r = std::panic::catch_unwind(|| blind::make(&s));
        match r {
            Ok(r) => println!("{name} attempts {} ratios {:?} closest {:?} alt {}", r.truth.attempts, r.truth.ratios, r.truth.closest, r.truth.alternatives.len()),
            Err(_) => println!("{name} FAILED"),
        }
    }
    println!("{:?}", started.elapsed());
    let _ = Scenario::single("thermal_lag", 1);
}
