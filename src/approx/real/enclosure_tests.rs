use proptest::prelude::*;

use super::interval_tests::{BITS, Real, exact, real, short};
use super::*;

fn parse(text: &str) -> Expression {
    Expression::parse(text).unwrap()
}

fn over(text: &str, low: &str, high: &str, tolerance: f64) -> Enclosure {
    Enclosure::new(&parse(text), &Domain::parse(low, high).unwrap(), tolerance).unwrap()
}

/// A random function of which the text and an evaluation that shares nothing with ours are made.
#[derive(Debug, Clone)]
enum Tree {
    X,
    Number(i32),
    Of(&'static str, Box<Tree>),
    Two(char, Box<Tree>, Box<Tree>),
    Power(Box<Tree>, i32),
}

const NAMES: [&str; 10] = [
    "sin", "cos", "tan", "asin", "acos", "atan", "sqrt", "exp", "log", "abs",
];

fn tree() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        3 => Just(Tree::X),
        1 => (-40i32..40).prop_map(Tree::Number)
    ];
    leaf.prop_recursive(4, 14, 2, |inner| {
prop_oneof![
            3 => (proptest::sample::select(&NAMES[..]), inner.clone())
                .prop_map(|(name, t)| Tree::Of(name, Box::new(t))),
            4 => (proptest::sample::select(&['+', '-', '*', '/', '^'][..]), inner.clone(), inner.clone())
                .prop_map(|(sign, a, b)| Tree::Two(sign, Box::new(a), Box::new(b))),
            1 => (inner, -3i32..5).prop_map(|(t, n)| Tree::Power(Box::new(t), n)),
        ]
    })
}

impl Tree {
    fn text(&self) -> String {
        match self {
            Tree::X => "x".to_owned(),
            Tree::Number(n) => format!("({n}/10)"),
            Tree::Of(name, t) => format!("{name}({})", t.text()),
            Tree::Two(sign, a, b) => format!("({}){sign}({})", a.text(), b.text()),
            Tree::Power(t, n) => format!("({})^{n}", t.text()),
        }
    }

    /// In 300 bits; `None` where it is undefined (or almost).
    fn value(&self, x: &Real) -> Option<Real> {
        let zero = Real::ZERO;
        let one = real(1.0).with_precision(BITS).value();
        let found = match self {
            Tree::X => x.clone(),
            Tree::Number(n) => short(real(f64::from(*n))) / short(real(10.0)),
            Tree::Of(name, t) => {
                let u = t.value(x)?;
                let beyond = u > one || u < -&one;
                match *name {
                    "sin" => u.sin(),
                    "cos" => u.cos(),
                    "tan" => u.tan(),
                    "atan" => u.atan(),
                    "exp" => u.exp(),
                    "asin" if !beyond => u.asin(),
                    "acos" if !beyond => u.acos(),
                    "sqrt" if u >= zero => dashu_float::ops::SquareRoot::sqrt(&u),
                    "log" if u > zero => u.ln(),
                    "abs" => {
                        if u < zero {
                            -u
                        } else {
                            u
                        }
                    }
                    _ => return None,
                }
            }
            Tree::Two(sign, a, b) => {
                let (a, b) = (a.value(x)?, b.value(x)?);
                match sign {
                    '+' => a + b,
                    '-' => a - b,
                    '*' => a * b,
                    '/' if b != zero => a / b,
                    '^' if a > zero => (b * a.ln()).exp(),
                    _ => return None,
                }
            }
            Tree::Power(t, n) => {
                let u = t.value(x)?;
                if *n < 0 && u == zero {
                    return None;
                }
                let power = (0..n.abs()).fold(one.clone(), |p, _| p * &u);
                if *n < 0 { one / power } else { power }
            }
        };
        // A function of 0 is exact there, which its next function refuses.
        let found = short(found);
        (found < real(1e30) && found > real(-1e30)).then_some(found)
    }
}

/// |value - centre| <= radius, with dashu's own error (it loses by cancellation) as a part of 1e-40.
fn within(value: &Real, centre: &Real, radius: f64, size: f64) -> bool {
    let off = value - centre;
    let off = if off < Real::ZERO { -off } else { off };
    off <= real(radius) + real(1e-40 * (1.0 + size))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn random_functions_lie_in_their_enclosures(
        tree in tree(),
        low in -3.0f64..3.0,
        width in 0.01f64..2.0,
        points in proptest::collection::vec(0.0f64..1.0, 12),
    ) {
        let f = parse(&tree.text());
        let domain = Domain::between(low, low + width).unwrap();
        let (a, b) = domain.inner();
        let Ok(enclosure) = Enclosure::new(&f, &domain, 1e-9) else {
            return Ok(());
        };
        let (least, largest) = enclosure.range(a, b);
        let slope = enclosure.derivative_range(1, a, b);
        let mut last: Option<(f64, Real)> = None;
        for s in points.into_iter().chain([0.0, 1.0]) {
            let x = (a + (b - a) * s).clamp(a, b);
            let Some(value) = tree.value(&short(real(x))) else { continue };
            let size = value.to_f64().value().abs();
            let (found, radius) = enclosure.at(x);
            prop_assert!(radius.is_finite());
            prop_assert!(within(&value, &real(found), radius, size), "{tree:?} at {x}: {found} +- {radius}");
            let sharp = enclosure.at_exact(&Dyadic::from_f64(x));
            prop_assert!(within(&value, &exact(sharp.middle()), sharp.radius(), size), "{tree:?} {x}");
            prop_assert!(value.to_f64().value() >= least - 1e-15 * size);
            prop_assert!(value.to_f64().value() <= largest + 1e-15 * size);
            // The mean value theorem.
            if let (Some((x0, v0)), Some((low, high))) = (&last, slope) && (x - x0).abs() > 1e-3 {
                let met = ((&value - v0) / (real(x) - real(*x0))).to_f64().value();
                // With the rounding of the values in 300 bits.
                let allowed = 1e-9 * (low.abs() + high.abs()) + 1e-40 * (1.0 + size);
                prop_assert!(low - allowed <= met && met <= high + allowed, "{tree:?} {x0} {x}");
            }
            last = Some((x, value));
        }
    }
}

#[test]
fn the_fast_value_is_within_its_radius_and_the_radius_is_small() {
    for (text, low, high, radius) in [
        ("atan(x)/(2*pi)", "0", "1", 2e-15),
        ("exp(x)", "-3", "3", 2e-14),
        ("sqrt(x)", "0", "1", 3e-15),
        ("asin(x)", "-1", "1", 4e-15),
        ("abs(x - 0.3)", "0", "1", 3e-15),
        ("136.82*x^2 + 242.97*x + 109.60", "-0.9", "0.2", 1e-12),
        ("sin(20*x)", "0", "3", 5e-15),
    ] {
        let enclosure = over(text, low, high, 1e-15);
        let f = parse(text);
        let (a, b) = enclosure.domain().inner();
        for k in 0..=3000 {
            let x = (a + (b - a) * f64::from(k) / 3000.0).clamp(a, b);
            let (found, claimed) = enclosure.at(x);
            assert!(claimed < radius, "{text} {x} {claimed}");
            let off = f.enclosed(Interval::from(x)) - Interval::from(found);
            assert!(off.magnitude() <= claimed, "{text} {x}");
        }
        assert_eq!(enclosure.at(b + 1.0).1, f64::INFINITY);
        assert_eq!(enclosure.at(a - 1e-9).1, f64::INFINITY);
        assert_eq!(enclosure.at(f64::NAN).1, f64::INFINITY);
    }
}

/// Without the radius a segment's polynomial is off: the remainder is not decoration.
#[test]
fn a_polynomial_without_its_radius_would_be_caught() {
    let f = parse("exp(x)");
    let enclosure = over("exp(x)", "0", "3", 1e-9);
    let mut caught = 0;
    for segment in enclosure.segments() {
        let mut largest = Wide::ZERO;
        for x in [segment.place.low, segment.place.high] {
            let t = Interval::from(x) - Interval::from(segment.centre);
            let terms = segment.coefficients.iter().rev();
            let sum = terms.fold(Interval::ZERO, |sum, c| sum * t + *c);
            let off = (f.enclosed(Interval::from(x)) - sum).abs();
            assert!(off.high <= Wide::from(segment.radius));
            largest = largest.max(off.low);
        }
        caught += usize::from(largest > Wide::from(segment.radius * 0.3));
    }
    assert!(caught * 2 > enclosure.segments().len(), "{caught}");
}

#[test]
fn undefined_places_are_refused_with_the_reason() {
    for (text, low, high, at, column, reason) in [
        ("1/x", "-1", "1", 0.0, 2, "`1/x` has a pole near x = 0"),
        ("1/x", "0", "1", 0.0, 2, "has a pole near x = 0"),
        (
            "2 + x^-1",
            "-1",
            "3",
            0.0,
            6,
            "`x^-1` has a pole near x = 0",
        ),
        (
            "3/(x-0.3)",
            "0",
            "1",
            0.3,
            2,
            "`3/(x - 0.3)` has a pole near x = 0.3",
        ),
        (
            "tan(x)",
            "0",
            "2",
            std::f64::consts::FRAC_PI_2,
            1,
            "`tan(x)` has a pole near x = 1.5708",
        ),
        ("log(x)", "-1", "1", -0.5, 1, "argument must be positive"),
        ("log(x)", "0", "1", 0.0, 1, "argument must be positive"),
        (
            "1 + sqrt(x)",
            "-1",
            "1",
            -0.75,
            5,
            "argument must not be negative",
        ),
        ("asin(x)", "0", "2", 1.0, 1, "from -1 to 1"),
        ("acos(2*x)", "0", "0.6", 0.55, 1, "from -1 to 1"),
        ("x^0.5", "-1", "1", -0.75, 2, "base must not be negative"),
        ("x^-0.5", "0", "1", 0.0, 2, "has a pole near x = 0"),
        ("x^x", "0", "1", 0.0, 2, "base must be positive"),
        ("sin(x)/x", "-1", "1", 0.0, 7, "divides 0 by 0 near x = 0"),
        ("0^-1", "0", "1", 0.5, 2, "has a pole"),
        ("x*(1/0)", "0", "1", 0.5, 5, "has a pole"),
        ("exp(exp(x))", "0", "10", 10.0, 0, "cannot be bounded"),
    ] {
        let start = std::time::Instant::now();
        let refused = Enclosure::new(&parse(text), &Domain::parse(low, high).unwrap(), 1e-12);
        let Err(refused) = refused else {
            panic!("{text} was enclosed");
        };
        assert!(
            refused.reason.contains(reason),
            "{text}: {}",
            refused.reason
        );
        assert_eq!(
            refused.column_in_text,
            (column > 0).then_some(column),
            "{text}"
        );
        let near = if column == 0 { 5.0 } else { 0.3 };
        assert!((refused.at - at).abs() < near, "{text}: {}", refused.at);
        assert!(start.elapsed().as_secs_f64() < 2.0, "{text}");
        if column > 0 {
            let said = refused.in_text(text).to_string();
            assert!(said.starts_with(&format!("1:{column}: error: ")), "{said}");
        }
    }
}

#[test]
fn domains_are_as_exact_as_they_were_given() {
    for (low, high, said) in [
        ("1", "0", "wrong order"),
        ("0.1", "0.1", "is empty"),
        ("pi", "pi", "is empty"),
        ("x", "1", "not a number"),
        ("0", "1/0", "not a number"),
    ] {
        let refused = Domain::parse(low, high).unwrap_err().to_string();
        assert!(refused.contains(said), "{refused}");
    }
    let quarter = Domain::parse("0", "pi/4").unwrap();
    assert!(quarter.high.radius() < 1e-31);
    let (_, inner) = Domain::parse("0", "0.3").unwrap().inner();
    assert_eq!(inner, 0.3, "the double 0.3 is below three tenths");
    let (_, inner) = Domain::parse("0", "0.1").unwrap().inner();
    assert!(inner < 0.1, "the double 0.1 is above a tenth");
    // A root that ends where a decimal domain ends.
    let root = over("sqrt(0.3 - x)", "0", "0.3", 1e-12);
    let (value, radius) = root.at(0.3);
    assert!(value.abs() + radius < 1e-8 && radius < 1e-8);
}

#[test]
fn derivatives_are_bounded_closely() {
    let e = std::f64::consts::E;
    for (text, low, high, order, wanted) in [
        ("sin(x)", 0.0, 1.0, 1, 1.0),
        ("sin(x)", 0.0, 1.0, 2, 1f64.sin()),
        ("exp(x)", 0.0, 1.0, 3, e),
        ("exp(x)", 0.0, 1.0, 0, e),
        ("atan(x)", 0.0, 1.0, 2, 0.649_519_052_838_329),
        ("sqrt(x)", 0.25, 1.0, 2, 2.0),
        ("x^5 - x", 0.0, 1.0, 4, 120.0),
        ("abs(x - 0.5)", 0.6, 1.0, 1, 1.0),
    ] {
        let enclosure = over(text, "0", "1", 1e-12);
        let found = enclosure.derivative_bound(order, low, high).unwrap();
        assert!(found >= wanted * (1.0 - 1e-14), "{text} {order}: {found}");
        assert!(found <= wanted * 1.02, "{text} {order}: {found}");
    }
    let root = over("sqrt(x)", "0", "1", 1e-12);
    assert_eq!(root.derivative_bound(1, 0.0, 1.0), None);
    assert!(root.derivative_bound(1, 0.01, 1.0).is_some());
    // A kink in the middle, where the interval is halved, and between other places.
    for (low, high) in [(-0.5, 0.5), (-0.25, 0.5), (-0.1, 0.35)] {
        let kinked = over("abs(x)", "-1", "1", 1e-9);
        for order in [1, 2, 3] {
            assert_eq!(kinked.derivative_bound(order, low, high), None);
        }
    }
    // At an end it is none.
    let smooth = over("abs(x)", "0", "1", 1e-9);
    assert_eq!(smooth.derivative_bound(1, 0.0, 1.0), Some(1.0));
    assert_eq!(smooth.derivative_bound(2, 0.0, 1.0), Some(0.0));
}

#[test]
fn polynomials_of_doubles_are_exact() {
    let c = [109.60, 242.97, 136.82];
    let domain = Domain::between(-0.9, 0.2).unwrap();
    let enclosure = Enclosure::of_polynomial(&c, &domain).unwrap();
    let p: Vec<Dyadic> = c.iter().map(|c| Dyadic::from_f64(*c)).collect();
    assert!(enclosure.supremum_over_domain(&p).upper < 1e-24);
    let (low, high) = enclosure.range(-0.9, 0.2);
    assert!((high - (109.60 + 242.97 * 0.2 + 136.82 * 0.04)).abs() < 1e-6);
    assert!((low - (109.60 - 242.97 * 242.97 / (4.0 * 136.82))).abs() < 1e-6);
    assert!(Enclosure::of_polynomial(&[f64::NAN], &domain).is_err());
    // Degree above a segment's.
    let steep: Vec<f64> = (0..20).map(|k| f64::from(k) - 9.5).collect();
    let enclosure = Enclosure::of_polynomial(&steep, &domain).unwrap();
    let p: Vec<Dyadic> = steep.iter().map(|c| Dyadic::from_f64(*c)).collect();
    let found = enclosure.supremum_over_domain(&p);
    assert!(found.upper < 1e-14, "{found:?}");
}
