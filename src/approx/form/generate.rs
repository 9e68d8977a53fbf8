//! The data of tables and segments, from the function.

use super::measure::Reference;
use super::piecewise::Piecewise;
use super::split::{Spacing, Split, Symmetry};
use super::table::{Bipartite, Kind, Table};
use super::{Codes, Form};
use crate::numeric::format::{Format, pow2};
use std::f64::consts::PI;

/// The most segments of a table.
pub const MOST_SEGMENTS: usize = 1 << 16;
/// The most codes of a bipartite table's domain.
pub const MOST_BIPARTITE_CODES: u128 = 1 << 18;

/// The symmetry of a function about 0 or the middle of its domain, if it has one there. Found at points:
/// what is built on it is measured against the function afterwards.
pub fn symmetry(reference: &dyn Reference, codes: Codes) -> Option<Symmetry> {
    let (a, b) = reference.domain();
    let about_raw = ((a + b) / 2.0 / codes.format.lsb()).round() as i128;
    let centre = codes.real(about_raw);
    if centre != (a + b) / 2.0 || codes.count() < 8 {
        return None;
    }
    let reach = b - centre;
    let (mut odd, mut even) = (true, true);
    for k in 0..=128 {
        // A step without common factors with the function's periods.
        let t = reach * (f64::from(k) + 0.293) / 128.5;
        let (above, r) = reference.at(centre + t);
        let (below, s) = reference.at(centre - t);
        let size = 1e-12 * above.abs() + r + s;
        odd &= (above + below).abs() <= size;
        even &= (above - below).abs() <= size;
    }
    (odd != even).then_some(Symmetry { about_raw, odd })
}

/// f at a distance from where the split begins: beyond the domain's end the mirrored side.
fn mirrored(reference: &dyn Reference, split: &Split, x: f64) -> f64 {
    let (a, b) = reference.domain();
    match split.symmetry {
        Some(s) if x > b => {
            let value = reference
                .at((2.0 * split.codes.real(s.about_raw) - x).clamp(a, b))
                .0;
            if s.odd { -value } else { value }
        }
        _ => reference.at(x.clamp(a, b)).0,
    }
}

/// Monomial coefficients of the polynomial through the points (Newton's divided differences).
fn through(points: &[(f64, f64)]) -> Vec<f64> {
    let n = points.len();
    let mut divided: Vec<f64> = points.iter().map(|p| p.1).collect();
    for k in 1..n {
        for i in (k..n).rev() {
            divided[i] = (divided[i] - divided[i - 1]) / (points[i].0 - points[i - k].0);
        }
    }
    let mut c = vec![0.0; n];
    for k in (0..n).rev() {
        for j in (1..n).rev() {
            c[j] = c[j - 1] - points[k].0 * c[j];
        }
        c[0] = divided[k] - points[k].0 * c[0];
    }
    c
}

/// Segment i's polynomial of that degree in delta, near the best one: through Chebyshev's nodes (or through
/// the ends and equal steps between them) of the codes that it has.
fn local(
    reference: &dyn Reference,
    split: &Split,
    i: usize,
    degree: usize,
    chebyshev: bool,
) -> Option<Vec<f64>> {
    let (first, last, middle, half) = split.real(i)?;
    if first == last {
        let mut c = vec![0.0; degree + 1];
        c[0] = mirrored(reference, split, first);
        return Some(c);
    }
    let node = |k: usize| {
        let along = match chebyshev {
            true => -((k as f64 + 0.5) * PI / (degree + 1) as f64).cos(),
            false => 2.0 * k as f64 / degree.max(1) as f64 - 1.0,
        };
        let x = 0.5 * (first + last) + 0.5 * (last - first) * along;
        ((x - middle) / half, mirrored(reference, split, x))
    };
    let points: Vec<(f64, f64)> = (0..=degree).map(node).collect();
    Some(through(&points))
}

fn rounded(value: f64, fraction_bits: u32) -> Option<i64> {
    let scaled = (value * pow2(fraction_bits as i32)).round_ties_even();
    (scaled.abs() < 9e15).then_some(scaled as i64)
}

/// A piecewise polynomial; `None` if a coefficient is too large for its table.
pub fn piecewise(
    reference: &dyn Reference,
    split: Split,
    degree: usize,
    output: Format,
    fraction_bits: u32,
) -> Option<Form> {
    let mut coefficients = Vec::with_capacity(split.count);
    for i in 0..split.count {
        let c = local(reference, &split, i, degree, true).unwrap_or(vec![0.0; degree + 1]);
        let c: Option<Vec<i64>> = c.iter().map(|c| rounded(*c, fraction_bits)).collect();
        coefficients.push(c?);
    }
    let form = Piecewise::new(split, output, fraction_bits, &coefficients);
    Some(Form::Piecewise(Box::new(form)))
}

/// A table; `None` if an entry is too large.
pub fn table(
    reference: &dyn Reference,
    split: Split,
    kind: Kind,
    output: Format,
    fraction_bits: u32,
) -> Option<Form> {
    let values = match kind {
        Kind::Plain => plain(reference, &split),
        Kind::Linear => linear(reference, &split),
        Kind::Quadratic => quadratic(reference, &split),
    };
    let entry = |v: &f64| match kind {
        // An entry that the output cannot hold would only be limited later.
        Kind::Plain if fraction_bits == output.fraction_bits => {
            let raw = rounded(*v, fraction_bits)?;
            let low = if split.symmetry.is_some_and(|s| s.odd) {
                -output.max_raw()
            } else {
                output.min_raw()
            };
            Some(i128::from(raw).clamp(low, output.max_raw()) as i64)
        }
        _ => rounded(*v, fraction_bits),
    };
    let entries: Option<Vec<i64>> = values.iter().map(entry).collect();
    let form = Table::new(split, kind, output, fraction_bits, entries?);
    Some(Form::Table(Box::new(form)))
}

/// The middle of the function's range over each segment's codes.
fn plain(reference: &dyn Reference, split: &Split) -> Vec<f64> {
    let value = |i| {
        let Some((first, last, ..)) = split.real(i) else {
            return 0.0;
        };
        let samples = (0..=8).map(|k| first + (last - first) * f64::from(k) / 8.0);
        let values = samples.map(|x| mirrored(reference, split, x));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
        0.5 * (low + high)
    };
    (0..split.count).map(value).collect()
}

/// Nodes at the segments' ends, moved so that the error of the chords has both signs.
fn linear(reference: &dyn Reference, split: &Split) -> Vec<f64> {
    if split.bits == 0 {
        let mut values = plain(reference, split);
        values.push(values.last().copied().unwrap_or(0.0));
        return values;
    }
    let n = split.count;
    let mut nodes = vec![0.0; n + 1];
    let mut bulge = vec![0.0; n];
    for i in 0..n {
        let Some(c) = local(reference, split, i, 1, false) else {
            continue;
        };
        let (first, last, middle, half) = split.real(i).unwrap_or((0.0, 0.0, 0.0, 1.0));
        nodes[i] = if i == 0 { c[0] - c[1] } else { nodes[i] };
        // A node of the whole grid is the function's own value, a node beyond the codes lies on the chord.
        let inside = last + 1.5 * split.codes.format.lsb() >= middle + half;
        let own = mirrored(reference, split, middle + half);
        nodes[i + 1] = if inside { own } else { c[0] + c[1] };
        let x = 0.5 * (first + last);
        let chord = nodes[i] + (nodes[i + 1] - nodes[i]) * ((x - middle) / half + 1.0) / 2.0;
        bulge[i] = 0.5 * (mirrored(reference, split, x) - chord);
    }
    for i in 0..=n {
        let before = bulge[i.saturating_sub(1)];
        let after = bulge[i.min(n - 1)];
        nodes[i] += 0.5 * (before + after);
    }
    nodes
}

/// Nodes at the segments' ends and middles.
fn quadratic(reference: &dyn Reference, split: &Split) -> Vec<f64> {
    let mut nodes = vec![0.0; 2 * split.count + 1];
    for i in 0..split.count {
        let Some((_, last, middle, half)) = split.real(i) else {
            continue;
        };
        let whole = last + 1.5 * split.codes.format.lsb() >= middle + half;
        let points = if whole && split.bits > 0 {
            [-1.0, 0.0, 1.0].map(|d| mirrored(reference, split, middle + d * half))
        } else {
            let c = local(reference, split, i, 2, false).unwrap_or(vec![0.0; 3]);
            [-1.0, 0.0, 1.0].map(|d: f64| c[0] + d * (c[1] + d * c[2]))
        };
        if i == 0 {
            nodes[0] = points[0];
        }
        (nodes[2 * i + 1], nodes[2 * i + 2]) = (points[1], points[2]);
    }
    nodes
}

/// A bipartite table with segments of 2^`low_bits` codes, 2^`middle_bits` of which share their corrections.
pub fn bipartite(
    reference: &dyn Reference,
    codes: Codes,
    symmetry: Option<Symmetry>,
    (middle_bits, low_bits): (u32, u32),
    output: Format,
    fraction_bits: u32,
) -> Option<Form> {
    let split = Split::new(codes, symmetry, Spacing::Uniform { bits: low_bits });
    let half = 1usize << (low_bits - 1);
    let lsb = codes.format.lsb();
    let rows = (split.count >> middle_bits) + 1;
    let hull = |hull: &mut (f64, f64), v: f64| *hull = (hull.0.min(v), hull.1.max(v));
    let nothing = (f64::INFINITY, f64::NEG_INFINITY);
    let mut corrections = vec![nothing; rows * half];
    let mut values = vec![nothing; split.count];
    for i in 0..split.count {
        let Some((first, last, ..)) = split.real(i) else {
            continue;
        };
        let at = |k: usize| {
            // Beyond the last code: the function goes on as between the last two.
            let x = first + k as f64 * lsb;
            let over = ((x - last) / lsb).max(0.0);
            let end = mirrored(reference, &split, x.min(last));
            end + over * (end - mirrored(reference, &split, (last - lsb).max(first)))
        };
        for j in 0..half {
            let (above, below) = (at(half + j), at(half - 1 - j));
            hull(
                &mut corrections[(i >> middle_bits) * half + j],
                0.5 * (above - below),
            );
        }
    }
    let middle = |(low, high): &(f64, f64)| if low > high { 0.0 } else { 0.5 * (low + high) };
    let corrections: Vec<f64> = corrections.iter().map(middle).collect();
    for (i, value) in values.iter_mut().enumerate() {
        let Some((first, last, ..)) = split.real(i) else {
            continue;
        };
        let count = ((last - first) / lsb).round() as usize + 1;
        for k in 0..count {
            let d = k as i64 - half as i64;
            let j = if d < 0 { -1 - d } else { d } as usize;
            let c = corrections[(i >> middle_bits) * half + j];
            let c = if d < 0 { -c } else { c };
            hull(
                value,
                mirrored(reference, &split, first + k as f64 * lsb) - c,
            );
        }
    }
    let raw = |v: f64| rounded(v, fraction_bits);
    let values: Option<Vec<i64>> = values.iter().map(|v| raw(middle(v))).collect();
    let corrections: Option<Vec<i64>> = corrections.iter().map(|v| raw(*v)).collect();
    let tables = [values?, corrections?];
    let form = Bipartite::new(split, middle_bits, output, fraction_bits, tables);
    Some(Form::Bipartite(Box::new(form)))
}
