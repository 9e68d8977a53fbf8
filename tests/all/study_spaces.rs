//! The search against spaces that are run whole: the same fronts, point for point, with their costs and merits. By
//! hand: `cargo test --release --test all -- --ignored --nocapture study_spaces::`.

use gyrogen::design::{Design, reader};
use gyrogen::study::bandwidth::bandwidth_hz;
use gyrogen::study::bench::Bench;
use gyrogen::study::front::Point;
use gyrogen::study::merit::Scale;
use gyrogen::study::search::{Effort, exhaust, search};
use gyrogen::study::space::Space;

fn design(words: &[(&str, u32, u32)], targets: &str, circuit: &str) -> Design {
    let names: Vec<String> = words.iter().map(|(w, _, _)| format!("\"{w}\"")).collect();
    let ranges: Vec<String> = words
        .iter()
        .map(|(w, low, high)| format!("\"{w}\" = [{low}, {high}]"))
        .collect();
    let text = format!(
        "[study]\nwords = [{}]\ntargets = [{targets}]\n[study.ranges]\n{}\n{circuit}",
        names.join(", "),
        ranges.join("\n")
    );
    reader::parse(&text, None).unwrap()
}

/// The fronts of a space, searched and run whole, and how many designs each ran.
fn fronts(design: &Design) -> [(Vec<Vec<Point>>, usize); 2] {
    let space = Space::new(design).unwrap();
    assert!(space.size() <= 20_000, "{}", space.size());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let bandwidth = bandwidth_hz(design);
    let mut bench = Bench::new(design, &space, threads, &|_| {}).unwrap();
    let given = space.given();
    bench.run(std::slice::from_ref(&given)).unwrap();
    let own = *bench.figures(&given).unwrap();
    let scale = Scale::of_instrument(design, &bench.whole, bandwidth).beside(&own);
    let found = search(&mut bench, &scale, Effort::STUDY).unwrap();
    let searched = bench.simulated();
    let whole = exhaust(&mut bench, &scale).unwrap();
    [(found, searched), (whole, bench.simulated())]
}

fn agree(design: &Design) {
    let [(found, searched), (whole, all)] = fronts(design);
    println!("{searched} designs of {all}");
    let mut missed = Vec::new();
    for (target, (found, whole)) in design.study.targets.iter().zip(found.iter().zip(&whole)) {
        let own: Vec<&Point> = whole.iter().filter(|p| !found.contains(p)).collect();
        println!(
            "{target}: {} points, {} of them not found",
            whole.len(),
            own.len()
        );
        assert!(whole.len() >= 4, "{target}: {whole:?}");
        missed.extend(own.into_iter().cloned());
    }
    assert!(missed.is_empty(), "{missed:#?}");
    assert!(searched < all, "{searched} of {all}");
}

/// Words of the fast part: 2 805 designs.
#[test]
#[ignore = "runs a space of 2 805 designs: half a minute"]
fn the_search_finds_the_front_of_converter_table_and_product() {
    let words = [
        ("circuit.adc.format", 11, 15),
        ("circuit.nco.table_address_bits", 10, 12),
        ("circuit.nco.table", 6, 16),
        ("circuit.demodulator.product", 14, 30),
    ];
    agree(&design(&words, "\"cortex-m4\", \"fpga\"", ""));
}

/// Words of the slow part: 6 912 designs.
#[test]
#[ignore = "runs a space of 6 912 designs: a minute"]
fn the_search_finds_the_front_of_vector_and_compensation() {
    let words = [
        ("circuit.decimator.output", 17, 24),
        ("circuit.cordic.iterations", 10, 18),
        ("circuit.cordic.guard_bits", 0, 3),
        ("circuit.cordic.angle_bits", 14, 19),
        ("compensation.output", 14, 17),
    ];
    agree(&design(&words, "\"rv32imc\", \"fpga\"", ""));
}

/// Words of both parts: 10 560 designs.
#[test]
#[ignore = "runs a space of 10 560 designs: two minutes"]
fn the_search_finds_the_front_of_product_vector_and_loop() {
    let words = [
        ("circuit.nco.table_address_bits", 10, 13),
        ("circuit.demodulator.product", 13, 23),
        ("circuit.cordic.iterations", 9, 18),
        ("circuit.amplitude_loop.gain_bits", 11, 16),
        ("compensation.output", 13, 16),
    ];
    agree(&design(&words, "\"cortex-m0\", \"fpga\"", ""));
}
