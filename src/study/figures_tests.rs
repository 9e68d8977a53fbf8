use super::*;
use crate::circuit::engine::ArithmeticKind;
use crate::design::reader;
use crate::design::word::Word;
use crate::study::measure::run;
use crate::study::retune::with_lengths;
use crate::study::scenario::Extent;
use std::time::Instant;

#[test]
#[ignore = "look"]
fn look() {
    let design = reader::read(None).expect("the default");
    let t = Instant::now();
    let plan = Plan::new(&design, Extent::SEARCH, 1).expect("a plan");
    println!(
        "plan {:?} full rate {} samples {}",
        t.elapsed(),
        plan.full_rate_dps,
        plan.samples(32)
    );
    let t = Instant::now();
    let twin = run(&design, ArithmeticKind::Float, &plan).expect("runs");
    println!("twin {:?} {:?}", t.elapsed(), whole(&plan, &twin));
    for (word, length) in [
        (Word::Adc, 16),
        (Word::Adc, 14),
        (Word::Adc, 12),
        (Word::Product, 20),
        (Word::Product, 16),
        (Word::Product, 12),
        (Word::Address, 13),
        (Word::Address, 5),
        (Word::Iterations, 16),
        (Word::DriveGain, 12),
        (Word::Decimated, 18),
        (Word::Table, 10),
        (Word::Table, 11),
        (Word::Output, 20),
        (Word::Phase, 24),
    ] {
        let t = Instant::now();
        let d = with_lengths(&design, &[(word, length)]).expect("a design");
        let t1 = t.elapsed();
        let e = crate::circuit::engine::engine(&d, ArithmeticKind::Fixed);
        drop(e);
        let t2 = t.elapsed();
        let out = run(&d, ArithmeticKind::Fixed, &plan).expect("runs");
        let t3 = t.elapsed();
        let f = added(&plan, &out, &twin);
        println!(
            "{word:?} {length}: {t1:?} {:?} {:?} {:?}: {f:?}",
            t2 - t1,
            t3 - t2,
            t.elapsed() - t3
        );
    }
}

#[test]
#[ignore = "look"]
fn look_at_costs() {
    let design = reader::read(None).expect("the default");
    for name in ["cortex-m4", "fpga"] {
        let o = crate::cost::price::Objective::of_name(name).expect("a name");
        for (word, length) in [
            (Word::Adc, 16),
            (Word::Product, 16),
            (Word::Address, 10),
            (Word::Iterations, 14),
            (Word::Decimated, 18),
        ] {
            let d = with_lengths(&design, &[(word, length)]).expect("a design");
            let t = Instant::now();
            let c = crate::cost::of_design(&d, o.target);
            println!("{word:?} {:?} {} {c:?}", t.elapsed(), c.price(&o.weights));
        }
    }
}
