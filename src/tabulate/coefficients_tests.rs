use super::*;
use crate::approx::form::polynomial::Formats;
use crate::approx::minimax::Slabs;
use crate::approx::real::{Domain, Expression};
use crate::numeric::cast::Target;

fn function(text: &str, ends: [&str; 2]) -> Function {
    let parse = |text: &str| Expression::parse_with(text, &Default::default()).unwrap();
    let domain = Domain::new(&parse(ends[0]), &parse(ends[1])).unwrap();
    Function::new(text, parse(text), domain, 1e-15).unwrap()
}

fn codes(format: Format, low: i128, high: i128) -> Codes {
    Codes { format, low, high }
}

fn formats(codes: Codes, coefficients: Format, output: Format) -> Formats {
    Formats {
        codes,
        coefficients: coefficients.into(),
        intermediate: Target::signed(40, 24),
        output,
        scheme: Default::default(),
    }
}

fn evaluation(f: &Function, formats: Formats, kind: Monomials, degree: usize) -> Evaluation {
    let zeros = vec![0; degree + 1];
    let form = Polynomial::new(formats, kind, zeros).unwrap();
    let settled = Form::Polynomial(Box::new(form)).settle().unwrap();
    Evaluation::new(f, &settled, formats, kind, degree, Weight::Absolute)
}

const CASES: [(&str, [&str; 2], Monomials, usize); 5] = [
    ("atan(x)/(2*pi)", ["0", "1"], Monomials::All, 2),
    ("sin(pi*x/2)", ["-0.9", "0.9"], Monomials::Odd, 3),
    ("cos(x)", ["-0.8", "0.8"], Monomials::Even, 2),
    ("exp(x)/4", ["-0.9", "0.3"], Monomials::All, 1),
    ("sqrt(x+0.3)", ["0", "0.5"], Monomials::All, 2),
];

/// A step through all tuples in a box around a place.
fn around(place: &[i128], reach: i128) -> Vec<Vec<i128>> {
    let mut all = vec![Vec::new()];
    for &c in place {
        let longer = all.iter().flat_map(|head: &Vec<i128>| {
            (c - reach..=c + reach).map(move |v| [head.as_slice(), &[v]].concat())
        });
        all = longer.collect();
    }
    all
}

/// Every polynomial lies in the slabs that its own total error gives: those that a proof leaves out have a
/// larger one.
#[test]
fn coefficients_are_in_the_slabs_of_their_own_error() {
    for (text, ends, kind, degree) in CASES {
        let f = function(text, ends);
        let format = Format::q(1, 9);
        let (a, b) = f.domain();
        let lsb = format.lsb();
        let codes = codes(format, (a / lsb).ceil() as i128, (b / lsb).floor() as i128);
        let formats = formats(codes, Format::q(3, 8), Format::q(2, 8));
        let path = evaluation(&f, formats, kind, degree);
        let basis = basis(kind, degree).unwrap();
        let samples = Samples::new(&f, &basis, a, b, minimax::Weight::Absolute).unwrap();
        let best = minimax::minimax(&samples).unwrap();
        let problem = Problem::new(&samples, &best, &[formats.coefficients.of(0).into()]).unwrap();
        let (mut looked_at, mut at_the_edge) = (0, 0);
        // Slabs that are narrower by this would leave some out: the test sees a wrong bound.
        let narrower = 0.1 * formats.output.lsb();
        for raw in around(&problem.rounded.raw, 3) {
            let total = path.max_error(&raw, f64::INFINITY).unwrap();
            let Slabs::Some(slabs) = path.slabs(&raw, total, 60) else {
                panic!("{text} {raw:?}: its own error is impossible");
            };
            let values = problem.values(&raw);
            for slab in slabs {
                let x = minimax::Wide::from(slab.x);
                let p = basis.value(&values, x).to_f64();
                assert!(
                    slab.low <= p && p <= slab.high,
                    "{text} {raw:?}: {p} outside {slab:?} with a total error of {total}"
                );
                looked_at += 1;
                let is_near = p < slab.low + narrower || p > slab.high - narrower;
                at_the_edge += usize::from(is_near);
            }
        }
        assert!(
            looked_at > 500 && at_the_edge > 5,
            "{text}: {looked_at} {at_the_edge}"
        );
    }
}

/// What is proved is what trying everything in a box finds.
#[test]
fn a_proved_least_error_is_that_of_trying_everything_nearby() {
    let mut proofs = 0;
    for (text, ends, kind, degree) in CASES {
        for (input, own, output) in [(8, 8, 8), (10, 9, 11), (9, 7, 7), (7, 10, 9)] {
            let f = function(text, ends);
            let request = Request {
                function: text.into(),
                parameters: Default::default(),
                domain: ends.map(str::to_owned),
                degree: Some(degree),
                monomials: Some(kind),
                input: Format::q(1, input),
                output: Format::q(2, output),
                coefficients: vec![Format::q(3, own)],
                evaluation: Default::default(),
                intermediate: None,
                form: crate::tabulate::request::Asked::Polynomial,
                bound: None,
                weight: Weight::Absolute,
                exhaustive: false,
                target: Default::default(),
                name: "approx".into(),
            };
            let (a, b) = f.domain();
            let lsb = request.input.lsb();
            let (low, high) = ((a / lsb).ceil() as i128, (b / lsb).floor() as i128);
            let codes = codes(request.input, low, high.min(request.input.max_raw()));
            let format = Format::q(3, own);
            let chosen = choose(&f, codes, &request, kind, degree, format.into(), None).unwrap();
            let formats = Formats {
                intermediate: Target::signed(62, chosen.form.formats.intermediate.fraction_bits),
                ..chosen.form.formats
            };
            let path = evaluation(&f, formats, kind, degree);
            let exponents = kind.exponents(degree);
            let taken: Vec<i128> = exponents
                .iter()
                .map(|&k| chosen.form.coefficients[k])
                .collect();
            let reach = if exponents.len() > 2 { 7 } else { 20 };
            let least = around(&taken, reach)
                .iter()
                .filter_map(|raw| path.max_error(raw, chosen.search.least_total))
                .fold(f64::INFINITY, f64::min);
            proofs += usize::from(chosen.search.proved_best);
            assert!(
                !chosen.search.proved_best || least >= chosen.search.least_total * (1.0 - 1e-9),
                "{text} {input} {own} {output}: {least} is below {}",
                chosen.search.least_total
            );
            assert!((least - chosen.search.least_total).abs() <= 1e-9 * least);
        }
    }
    println!("{proofs} of 20 proved");
    assert!(proofs >= 18);
}
