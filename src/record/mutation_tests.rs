//! Logs and CSVs with random damage: never a panic, and no row lost in silence. `GYROGEN_MUTATIONS=N` takes more of them,
//! `GYROGEN_SEED=S` others.

use super::thermal::{self, ThermalRecord};
use super::warning::Warning;
use super::{dataflash, dataflash_tests, ulog, ulog_tests};
use crate::design::RecordMapping;
use crate::error::Result;
use std::path::Path;

/// A generator of its own, so that a seed names a case.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }

    pub(super) fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// Bytes changed, cut out, doubled, or a number put in that is none. True if it ends earlier: a log that ends between two
/// messages is whole.
pub(super) fn damage(bytes: &mut Vec<u8>, r: &mut Random) -> bool {
    let mut cut = false;
    for _ in 0..=r.below(4) {
        let at = r.below(bytes.len());
        match r.below(6) {
            0 => {
                bytes.truncate(at.max(1));
                cut = true;
            }
            1 => {
                let end = (at + 1 + r.below(64)).min(bytes.len());
                bytes.drain(at..end);
            }
            2 => {
                let end = (at + 1 + r.below(200)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            3 => bytes[at] ^= 1 << r.below(8),
            4 => {
                let end = (at + 8).min(bytes.len());
                let fill = [0, 0xFF, 0x7F, 0x80][r.below(4)];
                bytes[at..end].fill(fill);
            }
            _ => bytes[at] = r.next() as u8,
        }
        if bytes.is_empty() {
            bytes.push(b'x');
        }
    }
    cut
}

pub(super) fn csv() -> Vec<u8> {
    let rows = (0..60).map(|k| {
        let wobble = ((k * 7919) % 101) as f64 * 1e-3;
        format!("{k},{wobble},{},{},1.0{k}\n", 20 + k, 0)
    });
    ("time_s,rate_out_dps,die_degc,rate_dps,agc\n".to_owned() + &rows.collect::<String>())
        .into_bytes()
}

/// What holds of whatever was read.
fn holds(kind: &str, seed: u64, read: Result<(ThermalRecord, Vec<Warning>)>, whole: usize) -> bool {
    let (record, warnings) = match read {
        Ok(read) => read,
        Err(e) => {
            assert_eq!(e.exit_status(), 2);
            return false;
        }
    };
    for (name, column) in &record.columns {
        assert_eq!(column.len(), record.len(), "{kind} {seed} {name}");
        assert!(
            column.iter().all(|v| !v.is_infinite()),
            "{kind} {seed} {name}"
        );
    }
    assert!(
        record.time_s.windows(2).all(|w| w[0] <= w[1]),
        "{kind} {seed}"
    );
    let told = warnings.iter().any(|w| {
        w.code.starts_with("log_") && w.code != "log_averaged"
            || w.code.starts_with("rows_")
            || [
                "wrong_times",
                "gyro_replaced",
                "record_split",
                "repeated_times",
                "faster_source",
            ]
            .contains(&w.code)
    });
    // A log loses the part of a row at each end.
    assert!(
        kind == "csv" || record.len() + 2 >= whole || told,
        "{kind} {seed}: {} rows, {warnings:?}",
        record.len()
    );
    true
}

/// The first seed, and how many from there: `usual`, unless the environment says otherwise.
pub(super) fn asked(usual: u64) -> (u64, u64) {
    let asked = |name: &str| std::env::var(name).ok().and_then(|n| n.parse().ok());
    let first = asked("GYROGEN_SEED").unwrap_or(1);
    (first, asked("GYROGEN_MUTATIONS").unwrap_or(usual))
}

#[test]
fn damage_makes_no_panic_and_costs_no_row_in_silence() {
    let (first, count) = asked(600);
    let (log, flash, text) = (ulog_tests::sound().0, dataflash_tests::sound(), csv());
    let mapping = RecordMapping::default();
    let mut read = 0;
    for seed in first..first + count {
        let mut r = Random(seed);
        let (kind, whole) = [("ulog", 20), ("flash", 20), ("csv", 60)][r.below(3)];
        let path = Path::new(kind);
        let mut bytes = match kind {
            "ulog" => log.clone(),
            "flash" => flash.clone(),
            _ => text.clone(),
        };
        let cut = damage(&mut bytes, &mut r);
        let out = match kind {
            "ulog" => ulog::read(&bytes[..], path, &mapping),
            "flash" => dataflash::read(&bytes[..], path, &mapping),
            _ => thermal::parse(&bytes, path, &mapping),
        };
        read += u64::from(holds(kind, seed, out, if cut { 0 } else { whole }));
    }
    // Damage is local: most of what is damaged can be read.
    assert!(4 * read > count, "{read} of {count}");
}
