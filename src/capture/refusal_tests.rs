//! Captures that are refused: keys that cannot be true, columns without a signal, a tone that is elsewhere.

use super::examine::examined;
use super::synthetic_rows::{ROWS, WORDS, capture, clean, judged, meta, names, said};
use crate::record::capture_meta::CaptureMeta;
use crate::thermal::synthetic::Random;
use std::f64::consts::TAU;

#[test]
fn a_refusal_names_line_and_column() {
    let folder = std::env::temp_dir().join(format!("gyrogen_captures_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let design = crate::design::reader::parse("", None).unwrap();
    let [drive, sense] = clean(1, WORDS[1]);
    let text = |keys: &str, drive: &[i32]| {
        let rows = drive.iter().zip(&sense).map(|(d, s)| format!("{s},{d}\n"));
        format!("{keys}sense_code,drive_code\n{}", rows.collect::<String>())
    };
    let path = folder.join("a.csv");
    let refused = |text: String| {
        std::fs::write(&path, text).unwrap();
        super::close(&path, &design, "")
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    let keys = format!("# ftw = {}\n#  fs_hz =  1e-9\n", WORDS[1]);
    assert!(refused(text(&keys, &drive)).contains("a.csv:2:13: error: `fs_hz` is 1e-9 Hz"));
    let keys = "# fs_hz = 2e5\n# ftw = 1000000000 # a word\n";
    assert!(refused(text(keys, &drive)).contains("a.csv:2:9: error: `ftw` puts"));
    let keys = "# fs_hz = 2e5\n# ftw = 0\n";
    assert!(refused(text(keys, &drive)).contains("a.csv:2:9: error: the drive tone has less"));
    assert!(
        refused(text("", &vec![0; ROWS]))
            .contains("a.csv:1:12: error: the drive codes hold no tone")
    );
    std::fs::remove_dir_all(&folder).unwrap();
}

/// The refusal of a capture.
fn refused(codes: [Vec<i32>; 2], meta: CaptureMeta) -> String {
    examined(capture(codes, meta)).unwrap_err().to_string()
}

#[test]
fn columns_without_a_signal_are_refused() {
    let [drive, sense] = clean(1, WORDS[1]);
    let zero = || vec![0; ROWS];
    assert!(refused([zero(), sense], meta(WORDS[1])).contains("drive_code has no signal"));
    let message = refused([drive.clone(), zero()], meta(WORDS[1]));
    assert!(message.contains("sense_code has no signal"), "{message}");
    // At rest it may be so.
    let still = CaptureMeta {
        rate_dps: Some(0.0),
        ..meta(WORDS[1])
    };
    let (_, warnings, found) = judged([drive, zero()], still);
    assert_eq!(
        (said(&warnings), names(&found)),
        (vec!["no_signal"], vec![])
    );
}

#[test]
fn a_tone_elsewhere_than_the_tuning_word_is_refused() {
    for seed in 1..4 {
        let message = refused(clean(seed, WORDS[1]), meta(WORDS[0]));
        assert!(
            message.contains("puts the drive's tone at 1562.5 Hz"),
            "{message}"
        );
        let mut random = Random::new(seed);
        let mut noise = || {
            (0..ROWS)
                .map(|_| (900.0 * random.normal()) as i32)
                .collect()
        };
        let message = refused([noise(), noise()], meta(WORDS[0]));
        assert!(message.contains("have no tone at 1562.5 Hz"), "{message}");
    }
}

#[test]
fn keys_that_cannot_be_true_are_refused_and_unlikely_ones_said() {
    let key = |change: &dyn Fn(&mut CaptureMeta)| {
        let mut meta = meta(WORDS[1]);
        change(&mut meta);
        examined(capture(clean(1, WORDS[1]), meta))
    };
    type Change = fn(&mut CaptureMeta);
    let bad: [(&str, Change); 12] = [
        ("fs_hz", |m| m.fs_hz = Some(1e-300)),
        ("fs_hz", |m| m.fs_hz = Some(1e300)),
        ("adc_bits", |m| m.adc_bits = Some(1)),
        ("adc_bits", |m| m.adc_bits = Some(33)),
        ("drive_amplitude_codes", |m| {
            m.drive_amplitude_codes = Some(0.0)
        }),
        ("drive_amplitude_codes", |m| {
            m.drive_amplitude_codes = Some(-1500.0)
        }),
        ("drive_amplitude_codes", |m| {
            m.drive_amplitude_codes = Some(1e30)
        }),
        ("sense_codes_per_dps", |m| m.sense_codes_per_dps = Some(0.0)),
        ("sense_codes_per_dps", |m| {
            m.sense_codes_per_dps = Some(5e-9)
        }),
        ("sense_codes_per_dps", |m| {
            m.sense_codes_per_dps = Some(1e30)
        }),
        ("rate_dps", |m| m.rate_dps = Some(1e30)),
        ("sense_phase_rad", |m| m.sense_phase_rad = Some(1e30)),
    ];
    for (name, change) in bad {
        let message = key(&change).map(|_| ()).unwrap_err().to_string();
        assert!(
            message.contains(&format!("`{name}` is ")),
            "{name}: {message}"
        );
    }
    let unlikely: [(&str, Change); 3] = [
        ("sample_rate_out_of_range", |m| m.fs_hz = Some(200.0)),
        ("negative_scale", |m| m.sense_codes_per_dps = Some(-3.0)),
        ("phase_in_degrees", |m| m.sense_phase_rad = Some(0.3 + TAU)),
    ];
    for (code, change) in unlikely {
        assert_eq!(said(&key(&change).unwrap().1), [code]);
    }
}

#[test]
fn a_word_whose_phase_runs_away_is_refused() {
    // Turns over the capture, in steps of the word.
    let off = |turns: f64| WORDS[1] + (turns * 4_294_967_296.0 / ROWS as f64) as u32;
    let message = refused(clean(1, WORDS[1]), meta(off(0.05)));
    assert!(
        message.contains("runs away from that of `ftw` by -0.050 turn"),
        "{message}"
    );
    assert!(examined(capture(clean(1, WORDS[1]), meta(off(0.004)))).is_ok());
    // A phase that steps is no other frequency.
    let word = WORDS[1];
    let stepped = super::synthetic_rows::codes(1, word, |channel, row, x| {
        let angle = TAU * f64::from(word.wrapping_mul(row as u32)) / 4_294_967_296.0;
        let late = if row > ROWS / 2 { 0.2 } else { 0.0 };
        let on_time = -1500.0 * angle.cos();
        if channel == 0 {
            x - on_time - 1500.0 * (angle - late).cos()
        } else {
            x
        }
    });
    assert!(examined(capture(stepped, meta(word))).is_ok());
}

#[test]
fn codes_aligned_to_the_left_are_refused() {
    let aligned = clean(1, WORDS[1]).map(|c| c.into_iter().map(|code| code << 4).collect());
    let wider = CaptureMeta {
        adc_bits: Some(16),
        drive_amplitude_codes: Some(16.0 * 1500.0),
        sense_codes_per_dps: Some(16.0 * 3.0),
        ..meta(WORDS[1])
    };
    let message = refused(aligned, wider);
    assert!(
        message.contains("the low 4 bits of all codes are 0"),
        "{message}"
    );
    // Codes that are even by a fault of the converter are codes.
    let even = clean(1, WORDS[1]).map(|c| c.into_iter().map(|code| code & !1).collect());
    assert!(examined(capture(even, meta(WORDS[1]))).is_ok());
}
