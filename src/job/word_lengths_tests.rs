use super::*;
use crate::design::{reader, template};
use crate::job::calibration::calibrate;
use crate::record::thermal;
use std::path::Path;

/// The default design's run, shortened to two readings at each of eight temperatures, with this product.
fn measured(product: &str) -> (WordLengths, f64) {
    let mut text = template::DEFAULT.to_owned();
    for (from, to) in [
        ("product = { format = \"Q2.22\"", product),
        ("step_k = 5.0", "step_k = 10.0"),
        ("readings_per_dwell = 3", "readings_per_dwell = 2"),
        ("samples_per_reading = 512", "samples_per_reading = 64"),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    let mut design = reader::parse(&text, None).unwrap();
    let run = OwnRun::simulate(&design).unwrap();
    let csv = run.record_csv();
    let path = Path::new("record.csv");
    let (record, _) = thermal::parse(csv.as_bytes(), path, &Default::default()).unwrap();
    let fit = calibrate(&mut design, &record, true).unwrap().fit;
    let fixed = run.fixed_dps(&design).unwrap();
    let float = run.float_dps(&design, &fit).unwrap();
    let words = WordLengths::measure(&design, &fit, &fixed, &float, Some(&run)).unwrap();
    (words, fit.heldout_rms_dps)
}

#[test]
fn a_short_product_is_named_with_what_it_does() {
    let (words, fit) = measured("product = { format = \"Q2.10\"");
    assert!((0.005..0.5).contains(&words.max_dps), "{words:?}");
    assert!(words.rms_dps <= words.max_dps && words.mean_dps.abs() <= words.rms_dps);
    let largest = words.largest.as_ref().unwrap();
    assert_eq!(largest.key, "circuit.demodulator.product");
    assert_eq!((&largest.from[..], &largest.to[..]), ("Q2.10", "Q2.18"));
    assert!(largest.left_rms_dps < 0.2 * words.rms_dps, "{words:?}");
    let sentence = words.sentence(fit);
    assert!(
        sentence.starts_with("The fit limits the result: fit "),
        "{sentence}"
    );
    let largest = "The largest part is that of circuit.demodulator.product (Q2.10). With Q2.18 the word lengths make ";
    assert!(sentence.contains(largest) && sentence.contains(" deg/s rms instead of 0."));
    // The figure of `simulate` is another one.
    let codes = "deg/s at most (measured; both had the same ADC codes: ";
    assert!(sentence.contains(codes), "{sentence}");
    let clause = words.clause(fit);
    assert!(
        clause.contains(
            " deg/s from word lengths (largest part: circuit.demodulator.product = Q2.10)"
        ),
        "{clause}"
    );
}

#[test]
fn words_of_the_default_do_less_than_a_thousandth_of_a_degree_per_second() {
    let (words, fit) = measured("product = { format = \"Q2.22\"");
    assert!(words.max_dps < 1e-3, "{words:?}");
    assert_eq!(words.covers, Covers::CircuitAndCompensation);
    assert!(words.widened.len() >= 9, "{words:?}");
    assert!(
        words
            .sentence(fit)
            .contains("word lengths of circuit and compensation")
    );
}

#[test]
fn words_that_do_more_than_the_fit_are_said_to_limit() {
    let (words, _) = measured("product = { format = \"Q2.10\"");
    let sentence = words.sentence(words.rms_dps / 2.0);
    assert!(
        sentence.starts_with("The word lengths limit the result"),
        "{sentence}"
    );
}

#[test]
fn a_record_covers_the_compensation_alone() {
    let (design, fit) = {
        let text =
            template::DEFAULT.replacen("samples_per_reading = 512", "samples_per_reading = 64", 1);
        let mut design = reader::parse(&text, None).unwrap();
        let run = OwnRun::simulate(&design).unwrap();
        let csv = run.record_csv();
        let path = Path::new("record.csv");
        let (record, _) = thermal::parse(csv.as_bytes(), path, &Default::default()).unwrap();
        let fit = calibrate(&mut design, &record, true).unwrap().fit;
        (design, fit)
    };
    let words = WordLengths::measure(&design, &fit, &[1.0, 2.5], &[1.0, 2.0], None).unwrap();
    assert_eq!(
        (words.max_dps, words.mean_dps, words.readings),
        (0.5, 0.25, 2)
    );
    assert_eq!(
        (words.largest.as_ref(), words.covers),
        (None, Covers::Compensation)
    );
    let sentence = words.sentence(1.0);
    assert!(
        sentence.contains("word lengths of the compensation ")
            && sentence.contains("a record begins after it"),
        "{sentence}"
    );
    assert!(!sentence.contains("word lengths of circuit"), "{sentence}");
    assert!(
        sentence.contains("deg/s at most (measured). "),
        "{sentence}"
    );
}
