//! The forms of `gyrogen approx` from the manual's text alone: plain integers, no code of the crate.

use serde_json::Value;

/// What a JSON result describes.
pub struct Evaluator {
    /// First and last code of the domain.
    pub codes: (i128, i128),
    /// Least and greatest word of the input's format.
    pub words: (i128, i128),
    input_bits: i32,
    output: Format,
    shape: Shape,
}

#[derive(Clone, Copy)]
struct Format {
    signed: bool,
    bits: u32,
    fraction_bits: i32,
}

enum Shape {
    Polynomial {
        coefficients: Vec<i128>,
        /// Fraction bits, one a coefficient.
        own: Vec<i32>,
        inner: Format,
        kind: String,
        estrin: bool,
    },
    Segments {
        kind: String,
        fraction_bits: i32,
        tables: Vec<Vec<i128>>,
        uniform: Option<u32>,
        steps: u32,
        symmetry: Option<(i128, bool)>,
        middle_bits: u32,
    },
}

fn format(text: &str) -> Format {
    let signed = !text.starts_with('U');
    let (m, n) = text
        .trim_start_matches('U')
        .trim_start_matches('Q')
        .split_once('.')
        .unwrap();
    let (m, n): (i32, i32) = (m.parse().unwrap(), n.parse().unwrap());
    Format {
        signed,
        bits: (m + n) as u32,
        fraction_bits: n,
    }
}

/// The fraction bits of every coefficient from order 0: one format for all, or one a monomial.
fn own(formats: &str, json: &Value) -> Vec<i32> {
    let count = json["coefficients"].as_array().unwrap().len();
    let each: Vec<i32> = formats
        .split(',')
        .map(|f| format(f).fraction_bits)
        .collect();
    let (step, lowest) = match json["monomials"].as_str().unwrap() {
        "all" => (1, 0),
        "odd" => (2, 1),
        _ => (2, 0),
    };
    let mut all = vec![each[0]; count];
    for (k, order) in (lowest..count).step_by(step).enumerate() {
        all[order] = each[k % each.len()];
    }
    all
}

impl Format {
    /// Half up to this many fraction bits, then saturated.
    fn cast(self, value: i128, fraction_bits: i32) -> i128 {
        let v = half_up(value, fraction_bits - self.fraction_bits);
        let (low, high) = match self.signed {
            true => (-(1i128 << (self.bits - 1)), (1i128 << (self.bits - 1)) - 1),
            false => (0, (1i128 << self.bits) - 1),
        };
        v.max(low).min(high)
    }
}

fn half_up(value: i128, dropped: i32) -> i128 {
    match dropped {
        d if d <= 0 => value << -d,
        d => (value + (1i128 << (d - 1))) >> d,
    }
}

impl Evaluator {
    pub fn of(json: &Value) -> Self {
        let text = |v: &Value| v.as_str().unwrap().to_owned();
        let number = |v: &Value| i128::from(v.as_i64().unwrap());
        let formats = &json["formats"];
        let codes = &json["input_codes"];
        let shape = match json["form"].as_str().unwrap() {
            "polynomial" => Shape::Polynomial {
                coefficients: json["coefficients"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|c| number(&c["raw"]))
                    .collect(),
                own: own(&text(&formats["coefficients"]), json),
                estrin: text(&json["evaluation"]) == "estrin",
                inner: format(&text(&formats["intermediate"])),
                kind: text(&json["monomials"]),
            },
            _ => {
                let t = &json["table"];
                let names = [
                    "table",
                    "values",
                    "corrections",
                    "a0",
                    "a1",
                    "a2",
                    "a3",
                    "a4",
                ];
                let entries = names.iter().filter_map(|n| t["entries"].get(n));
                let list = |e: &Value| e.as_array().unwrap().iter().map(number).collect();
                let s = &t["symmetry"];
                Shape::Segments {
                    kind: text(&t["kind"]),
                    fraction_bits: number(&t["fraction_bits"]) as i32,
                    tables: entries.map(list).collect(),
                    uniform: t["spacing"]["uniform"]["bits"].as_u64().map(|b| b as u32),
                    steps: t["spacing"]["power_of_two"]["steps"].as_u64().unwrap_or(0) as u32,
                    symmetry: s["about_raw"]
                        .as_i64()
                        .map(|m| (i128::from(m), s["odd"].as_bool().unwrap())),
                    middle_bits: t["middle_bits"].as_u64().unwrap_or(0) as u32,
                }
            }
        };
        Evaluator {
            codes: (number(&codes[0]), number(&codes[1])),
            words: match format(&text(&formats["input"])) {
                f if f.signed => (-(1 << (f.bits - 1)), (1 << (f.bits - 1)) - 1),
                f => (0, (1 << f.bits) - 1),
            },
            input_bits: format(&text(&formats["input"])).fraction_bits,
            output: format(&text(&formats["output"])),
            shape,
        }
    }

    pub fn input(&self, code: i128) -> f64 {
        code as f64 * f64::powi(2.0, -self.input_bits)
    }

    pub fn value(&self, word: i128) -> f64 {
        word as f64 * f64::powi(2.0, -self.output.fraction_bits)
    }

    pub fn run(&self, input: i128) -> i128 {
        let x = input.max(self.codes.0).min(self.codes.1);
        match &self.shape {
            Shape::Polynomial {
                coefficients,
                own,
                inner,
                kind,
                estrin,
            } => {
                let words: Vec<(i128, i32)> = coefficients
                    .iter()
                    .copied()
                    .zip(own.iter().copied())
                    .collect();
                self.polynomial(x, &words, *inner, kind, *estrin)
            }
            Shape::Segments { .. } => self.segments(x),
        }
    }

    /// `c`: each coefficient, from order 0, with its fraction bits.
    fn polynomial(
        &self,
        x: i128,
        c: &[(i128, i32)],
        inner: Format,
        kind: &str,
        estrin: bool,
    ) -> i128 {
        let n = self.input_bits;
        let (step, lowest) = match kind {
            "all" => (1, 0),
            "odd" => (2, 1),
            _ => (2, 0),
        };
        let mut words: Vec<(i128, i32)> = c.iter().copied().skip(lowest).step_by(step).collect();
        let mut v = match step {
            1 => (x, n),
            _ => (inner.cast(x * x, 2 * n), inner.fraction_bits),
        };
        // t v + c, both on the finer of the two scales: exact until the cast.
        let next = |t: (i128, i32), v: (i128, i32), c: (i128, i32)| {
            let bits = (t.1 + v.1).max(c.1);
            let product = (t.0 * v.0) << (bits - t.1 - v.1);
            let sum = product + (c.0 << (bits - c.1));
            (inner.cast(sum, bits), inner.fraction_bits)
        };
        while words.len() > 1 {
            if estrin {
                let pairs = words.chunks(2);
                words = pairs
                    .map(|pair| match *pair {
                        [low, high] => next(high, v, low),
                        [one] => one,
                        _ => unreachable!(),
                    })
                    .collect();
                v = (inner.cast(v.0 * v.0, 2 * v.1), inner.fraction_bits);
            } else {
                let (t, c) = (words.pop().unwrap(), words.pop().unwrap());
                words.push(next(t, v, c));
            }
        }
        let (t, t_bits) = words[0];
        match kind {
            "odd" => self.output.cast(t * x, t_bits + n),
            _ => self.output.cast(t, t_bits),
        }
    }

    fn segments(&self, x: i128) -> i128 {
        let Shape::Segments {
            kind,
            fraction_bits: f,
            tables,
            uniform,
            steps,
            symmetry,
            middle_bits,
        } = &self.shape
        else {
            unreachable!()
        };
        let (low, high) = self.codes;
        let (mut w, negate, reach) = match symmetry {
            Some((m, odd)) => ((x - m).abs(), *odd && x < *m, (high - m).max(m - low)),
            None => (x - low, false, high - low),
        };
        let (i, s) = match uniform {
            Some(s) => (w >> s, *s),
            None => {
                let mut width = 1;
                while reach >= 1i128 << width {
                    width += 1;
                }
                let mut e = 0;
                for k in (0..*steps).rev() {
                    let j = 1 << k;
                    if w < 1i128 << (width - j) {
                        w <<= j;
                        e += j;
                    }
                }
                (e + 1 - (w >> (width - 1)), width as u32 - 1)
            }
        };
        let i = i as usize;
        let local = s.max(1) as i32 - 1;
        let d = if s == 0 {
            0
        } else {
            w.rem_euclid(1i128 << s) - (1i128 << (s - 1))
        };
        let (sum, bits) = match kind.as_str() {
            "plain" => (tables[0][i], *f),
            "linear" => {
                let r = if s == 0 { 0 } else { d + (1i128 << (s - 1)) };
                let (a, b) = (tables[0][i], tables[0][i + 1]);
                ((a << s) + (b - a) * r, f + s as i32)
            }
            "quadratic" => {
                let [a, b, c] = [0, 1, 2].map(|k| tables[0][2 * i + k]);
                let t = half_up((a - 2 * b + c) * d, local);
                // b + ((c - a) + t) delta / 2
                ((b << (local + 1)) + (c - a + t) * d, f + local + 1)
            }
            "bipartite" => {
                let j = if d < 0 { -1 - d } else { d } as usize;
                let correction = tables[1][(i >> middle_bits) * (1 << (s - 1)) + j];
                (
                    tables[0][i] + if d < 0 { -correction } else { correction },
                    *f,
                )
            }
            _ => {
                let degree = tables.len() - 1;
                let mut t = tables[degree][i];
                for k in (1..degree).rev() {
                    t = half_up(t * d + (tables[k][i] << local), local);
                }
                (t * d + (tables[0][i] << local), f + local)
            }
        };
        self.output.cast(if negate { -sum } else { sum }, bits)
    }
}

/// FNV-1a over 64-bit words, each output followed by the number of the fault, 0.
pub fn checksum(outputs: impl Iterator<Item = i128>) -> u64 {
    let mix = |h: u64, w: u64| (h ^ w).wrapping_mul(0x100_0000_01b3);
    outputs.fold(0xcbf2_9ce4_8422_2325, |h, w| mix(mix(h, w as u64), 0))
}
