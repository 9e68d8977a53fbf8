use std::time::Instant;

use super::*;

/// Functions with their domains.
const CASES: [(&str, &str, &str); 14] = [
    ("atan(x)/(2*pi)", "0", "1"),
    ("sin(pi*x/2)", "0", "1"),
    ("sqrt(x)", "0.25", "1"),
    ("136.82*x^2 + 242.97*x + 109.60", "-0.9", "0.2"),
    ("exp(x)", "-1", "1"),
    ("log(1+x)", "0", "1"),
    ("1/(1+x^2)", "-1", "2"),
    ("tan(x)", "0", "pi/4"),
    ("asin(x)", "0", "1"),
    ("acos(x)", "-1", "0.5"),
    ("sqrt(x)", "0", "1"),
    ("abs(x-0.3)", "0", "1"),
    ("x^2.5", "0", "1"),
    ("cos(3*x)*exp(-x^2/2) + x^3/7", "-2", "2.3"),
];

fn case(text: &str, low: &str, high: &str) -> (Expression, Domain) {
    (
        Expression::parse(text).unwrap(),
        Domain::parse(low, high).unwrap(),
    )
}

/// Coefficients of a polynomial near f: interpolation at Chebyshev nodes by Newton's differences.
fn interpolated(f: &impl Fn(f64) -> f64, low: f64, high: f64, degree: usize) -> Vec<Dyadic> {
    let n = degree + 1;
    let nodes: Vec<f64> = (0..n)
        .map(|k| {
            let angle = std::f64::consts::PI * (2 * k + 1) as f64 / (2 * n) as f64;
            0.5 * (low + high) + 0.5 * (high - low) * angle.cos()
        })
        .collect();
    let mut d: Vec<f64> = nodes.iter().map(|x| f(*x)).collect();
    for k in 1..n {
        for i in (k..n).rev() {
            d[i] = (d[i] - d[i - 1]) / (nodes[i] - nodes[i - k]);
        }
    }
    let mut p = vec![d[n - 1]];
    for i in (0..n - 1).rev() {
        p.insert(0, 0.0);
        for k in 0..p.len() - 1 {
            p[k] -= nodes[i] * p[k + 1];
        }
        p[0] += d[i];
    }
    p.iter().map(|c| Dyadic::from_f64(*c)).collect()
}

/// The largest |f - p| on many points, both in 106 bits by plain evaluation of the expression.
fn sampled(f: &Expression, p: &[Dyadic], domain: &Domain, count: usize) -> f64 {
    let (low, high) = domain.inner();
    let mut largest: f64 = 0.0;
    for k in 0..=count {
        // Dense at the ends.
        let s = 0.5 - 0.5 * (std::f64::consts::PI * k as f64 / count as f64).cos();
        let x = Interval::from((low + (high - low) * s).clamp(low, high));
        let p = p
            .iter()
            .rev()
            .fold(Interval::ZERO, |sum, c| sum * x + c.to_interval());
        largest = largest.max((f.enclosed(x) - p).mignitude());
    }
    largest
}

#[test]
fn the_supremum_is_above_every_sample_and_not_by_much() {
    for (text, low, high) in CASES {
        let (f, domain) = case(text, low, high);
        let start = Instant::now();
        let enclosure = Enclosure::new(&f, &domain, 1e-15).unwrap();
        let made = start.elapsed();
        let (a, b) = domain.inner();
        for degree in [1, 3, 5, 8, 12] {
            let p = interpolated(&|x| f.value(x), a, b, degree);
            let start = Instant::now();
            let found = enclosure.supremum(&p, a, b);
            let spent = start.elapsed();
            let seen = sampled(&f, &p, &domain, 4000);
            println!(
                "{text} [{low},{high}] {} segments {made:?}; degree {degree}: {} .. {} at {} seen {seen} {spent:?}",
                enclosure.segments().len(),
                found.lower,
                found.upper,
                found.at,
            );
            assert!(found.upper >= seen, "{text} {degree}: {found:?} {seen}");
            assert!(found.upper >= found.lower);
            let floor = 2f64.powi(-58) * enclosure.size();
            assert!(
                found.upper <= seen * 1.001 + floor,
                "{text} {degree}: {found:?} {seen}"
            );
            assert!(
                found.upper <= found.lower * 1.0001 + floor,
                "{text} {degree}: {found:?}"
            );
        }
    }
}

#[test]
fn the_relative_supremum_is_above_every_sample() {
    for (text, low, high) in CASES {
        let (f, domain) = case(text, low, high);
        let enclosure = Enclosure::new(&f, &domain, 1e-15).unwrap();
        let (a, b) = domain.inner();
        let (a, b) = (a + 0.31 * (b - a), b - 0.2 * (b - a));
        let p = interpolated(&|x| f.value(x), a, b, 4);
        let Ok(found) = enclosure.supremum_relative(&p, a, b) else {
            // The magnitude and the last function have zeros there.
            assert!(
                [
                    "abs(x-0.3)",
                    "cos(3*x)*exp(-x^2/2) + x^3/7",
                    "136.82*x^2 + 242.97*x + 109.60"
                ]
                .contains(&text),
                "{text}"
            );
            continue;
        };
        let mut seen: f64 = 0.0;
        for k in 0..=3000 {
            let x = Interval::from((a + (b - a) * f64::from(k) / 3000.0).clamp(a, b));
            let q = p
                .iter()
                .rev()
                .fold(Interval::ZERO, |s, c| s * x + c.to_interval());
            let value = f.enclosed(x);
            seen = seen.max(((value - q) / value).mignitude());
        }
        assert!(
            found.upper >= seen && found.lower <= found.upper,
            "{text} {found:?} {seen}"
        );
        assert!(
            found.upper <= seen * 1.001 + 1e-16,
            "{text} {found:?} {seen}"
        );
    }
    let (f, domain) = case("cos(x)", "0", "2");
    let enclosure = Enclosure::new(&f, &domain, 1e-15).unwrap();
    let refused = enclosure.supremum_relative(&[], 0.0, 2.0).unwrap_err();
    assert!(refused.reason.contains("near x = 1.57079"), "{refused}");
}

#[test]
fn parts_of_the_domain_and_places_outside() {
    let (f, domain) = case("exp(x)", "0", "1");
    let enclosure = Enclosure::new(&f, &domain, 1e-12).unwrap();
    let line = [Dyadic::new(1, 0), Dyadic::new(1, 0)];
    for (low, high, wanted) in [
        (0.25, 0.5, 0.5f64.exp() - 1.5),
        (0.5, 0.5, 0.5f64.exp() - 1.5),
        (-3.0, 9.0, 1f64.exp() - 2.0),
    ] {
        let found = enclosure.supremum(&line, low, high);
        assert!(
            (found.upper - wanted).abs() < 1e-5 && found.lower <= wanted + 1e-15,
            "{found:?}"
        );
        assert!(found.upper >= wanted - 1e-15);
    }
    assert_eq!(enclosure.supremum(&line, 2.0, 3.0).upper, f64::INFINITY);
    assert_eq!(
        enclosure.range(2.0, 3.0),
        (f64::NEG_INFINITY, f64::INFINITY)
    );
    // A crude enclosure is refined by itself.
    let crude = Enclosure::new(&f, &domain, 1e-3).unwrap();
    let fine = interpolated(&|x| f.value(x), 0.0, 1.0, 9);
    let (one, other) = (
        crude.supremum(&fine, 0.0, 1.0),
        enclosure.supremum(&fine, 0.0, 1.0),
    );
    assert!(
        (one.upper - other.upper).abs() < 1e-4 * other.upper,
        "{one:?} {other:?}"
    );
}

#[test]
fn a_coefficient_damaged_by_one_lsb_shows() {
    let (f, domain) = case("atan(x)/(2*pi)", "0", "1");
    let enclosure = Enclosure::new(&f, &domain, 1e-15).unwrap();
    let p = interpolated(&|x| f.value(x), 0.0, 1.0, 7);
    let good = enclosure.supremum(&p, 0.0, 1.0);
    for k in 0..p.len() {
        let mut damaged = p.clone();
        let value = p[k].to_f64() + f64::powi(2.0, -15);
        damaged[k] = Dyadic::from_f64(value);
        let bad = enclosure.supremum(&damaged, 0.0, 1.0);
        assert!(bad.lower > good.upper, "{k}");
    }
}

/// The sine over odd powers: the quotient at 0 is that of the slopes.
#[test]
fn relative_errors_across_a_common_zero() {
    let odd = |a: f64, b: f64, c: f64| [0.0, a, 0.0, b, 0.0, c].map(Dyadic::from_f64);
    for (text, low, high, p) in [
        ("sin(x)", "0", "1", odd(1.0, -1.0 / 6.0, 1.0 / 120.0)),
        ("sin(x)", "-1", "0.5", odd(0.9995, -0.1661, 0.0081)),
        ("atan(x)/(2*pi)", "0", "1", odd(0.158, -0.047, 0.014)),
        ("exp(x) - 1", "0", "0.5", odd(1.01, 0.6, 0.1)),
    ] {
        let (f, domain) = case(text, low, high);
        let enclosure = Enclosure::new(&f, &domain, 1e-15).unwrap();
        let (a, b) = domain.inner();
        let found = enclosure.supremum_relative(&p, a, b).unwrap();
        let mut seen: f64 = 0.0;
        for k in 0..=4000 {
            let s = f64::from(k) / 4000.0;
            for x in [a + (b - a) * s, a * s.powi(6), b * s.powi(6)] {
                let x = Interval::from(x.clamp(a, b));
                let q = p
                    .iter()
                    .rev()
                    .fold(Interval::ZERO, |s, c| s * x + c.to_interval());
                let value = f.enclosed(x);
                if !value.contains_zero() {
                    seen = seen.max(((value - q) / value).mignitude());
                }
            }
        }
        println!("{text} {found:?} {seen}");
        assert!(
            found.upper >= seen && found.lower <= found.upper,
            "{text} {found:?} {seen}"
        );
        assert!(found.upper <= seen * 1.001, "{text} {found:?} {seen}");
    }
    // p does not vanish where f does.
    let (f, domain) = case("sin(x)", "0", "1");
    let enclosure = Enclosure::new(&f, &domain, 1e-15).unwrap();
    let off = [Dyadic::new(1, 20), Dyadic::new(1, 0)];
    let refused = enclosure.supremum_relative(&off, 0.0, 1.0).unwrap_err();
    assert!(refused.reason.contains("near x = 0"), "{refused}");
}

/// Parts are bounded from a polynomial's shape: never inside its true range, and exact for parabolas.
#[test]
fn the_range_of_a_short_polynomial_holds_its_values() {
    let mut state = 12345u64;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / f64::powi(2.0, 30) - 1.0
    };
    for round in 0..2000 {
        let degree = 2 + round % 5;
        let terms: Vec<f64> = (0..=degree).map(|_| next()).collect();
        let w = 0.5 + 0.4 * next();
        let (low, high) = search::range_of(&terms, w);
        let (mut least, mut largest) = (f64::INFINITY, f64::NEG_INFINITY);
        for k in 0..=1000 {
            let s = -w + 2.0 * w * f64::from(k) / 1000.0;
            let value = terms.iter().rev().fold(0.0, |sum, c| sum * s + c);
            (least, largest) = (least.min(value), largest.max(value));
        }
        let (below, above) = (low - 1e-14, high + 1e-14);
        assert!(below <= least && largest <= above, "{terms:?} {w}");
        if degree == 2 {
            assert!(least - low < 1e-5 && high - largest < 1e-5, "{terms:?} {w}");
        }
    }
}

#[test]
fn polynomials_about_a_centre_are_those_about_0() {
    let (f, domain) = case("exp(x)", "0", "1");
    let enclosure = Enclosure::new(&f, &domain, 1e-15).unwrap();
    // 1 + t + t^2/2 with t = x - 1/4: 25/32 + 3/4 x + x^2/2.
    let local = [Dyadic::new(1, 0), Dyadic::new(1, 0), Dyadic::new(1, 1)];
    let moved = [Dyadic::new(25, 5), Dyadic::new(3, 2), Dyadic::new(1, 1)];
    let one = enclosure.supremum_about(&local, Dyadic::new(1, 2), 0.0, 1.0);
    let other = enclosure.supremum(&moved, 0.0, 1.0);
    assert_eq!(one, other);
    assert!((one.upper - (1f64.exp() - 2.03125)).abs() < 1e-4, "{one:?}");
}
