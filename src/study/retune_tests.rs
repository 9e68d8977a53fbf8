use super::*;
use crate::design::reader;

fn default() -> Design {
    reader::read(None).expect("the default")
}

#[test]
fn the_given_lengths_give_the_given_design() {
    let design = default();
    let lengths: Vec<(Word, u32)> = Word::ALL
        .into_iter()
        .filter_map(|w| Some((w, w.length(&design)?)))
        .collect();
    assert!(lengths.len() >= 12, "{}", lengths.len());
    assert_eq!(with_lengths(&design, &lengths), Ok(design));
}

#[test]
fn what_is_raw_in_a_words_lsb_goes_with_it() {
    let design = default();
    let out = with_lengths(
        &design,
        &[
            (Word::Decimated, 21),
            (Word::Phase, 24),
            (Word::Adc, 12),
            (Word::DriveGain, 15),
        ],
    )
    .expect("a design");
    let l = out.circuit.amplitude_loop.expect("the loop");
    assert_eq!(l.setpoint_raw, 1048576 / 8);
    // Decimated: -3; drive gain: +1.
    assert_eq!((l.error_shift, l.integrator_shift), (7 - 3 + 1, 12 - 3 + 1));
    assert_eq!(l.initial_raw, 67108864 / 8);
    assert_eq!(out.circuit.cordic.width, 29);
    assert_eq!(out.circuit.nco.tuning_word, 1 << 19);
    assert_eq!(out.thermal_run.adc_noise_lsb, 1.0 / 16.0);
}
