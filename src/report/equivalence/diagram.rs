//! The circuit as blocks: formats, proved ranges and headroom of each word.

use crate::check::proved::Proved;
use crate::design::Design;
use crate::report::figure::{Figure, Series};
use crate::report::marks::{number, path, text};
use crate::report::svg::Svg;
use crate::report::text::{fixed, minus};
use std::fmt::Write as _;

/// Height of a line of text, px.
const LINE: f64 = 16.0;
/// Distance of blocks, px: across, and between the two rows.
const GAP: (f64, f64) = (22.0, 34.0);

/// A block with the words in it.
struct Block {
    title: &'static str,
    /// Blocks that feed it, in words.
    from: &'static str,
    /// Column and row on a wide page.
    place: (usize, usize),
    /// Class, text.
    lines: Vec<(&'static str, String)>,
}

impl Block {
    fn height(&self) -> f64 {
        LINE * (self.lines.len() as f64 + 1.0) + 16.0
    }
}

/// Title, beginnings of names of its words, what feeds it, place.
type Outline = (
    &'static str,
    &'static [&'static str],
    &'static str,
    (usize, usize),
);

/// The blocks but the ADC, in the order of the chain.
const BLOCKS: [Outline; 7] = [
    ("oscillator (NCO)", &["circuit.nco."], "", (1, 1)),
    (
        "demodulator",
        &["circuit.demodulator."],
        "ADC and NCO",
        (1, 0),
    ),
    (
        "decimator (CIC)",
        &["circuit.decimator"],
        "the demodulator",
        (2, 0),
    ),
    ("CORDIC", &["circuit.cordic"], "the decimator", (3, 0)),
    (
        "compensation",
        &["compensation."],
        "CORDIC and decimator",
        (4, 0),
    ),
    (
        "phase loop",
        &["circuit.phase_loop"],
        "CORDIC; it tunes the NCO",
        (3, 1),
    ),
    (
        "amplitude loop",
        &["circuit.amplitude_loop"],
        "CORDIC; it drives the gyro",
        (4, 1),
    ),
];

/// The figure.
pub(super) fn diagram(design: &Design, proved: &[Proved], width: f64) -> Figure {
    let adc = Block {
        title: "ADC",
        from: "",
        place: (0, 0),
        lines: vec![("boxed", format!("codes {}", design.circuit.adc.format))],
    };
    let with_words = BLOCKS.into_iter().filter_map(|(title, keys, from, place)| {
        let own = proved
            .iter()
            .filter(|p| keys.iter().any(|k| p.name.starts_with(k)));
        let lines = lines(&own.collect::<Vec<_>>());
        (!lines.is_empty()).then_some(Block {
            title,
            from,
            place,
            lines,
        })
    });
    let blocks: Vec<Block> = std::iter::once(adc).chain(with_words).collect();
    let mut svg = Svg::new(width);
    let (body, height) = if svg.is_roomy() {
        two_rows(&blocks, width)
    } else {
        one_column(&blocks, width)
    };
    svg.add_drawing(height, &body);
    svg.add_series(proved.iter().map(|p| Series {
        axes: format!("{} (raw, least and greatest)", p.format),
        class: match p.name.as_str() {
            // As the table of nodes and `check` call it; no key sets its format.
            "circuit.cordic.gain_bits" => "circuit.cordic magnitude".to_owned(),
            name => name.to_owned(),
        },
        third: "headroom_bits",
        points: vec![[
            p.range.low as f64,
            p.range.high as f64,
            p.headroom_bits().unwrap_or(f64::NAN),
        ]],
    }));
    svg.figure(
        "The circuit with its formats",
        "Each word with its format, the largest size that is proved for every ADC code and every state (raw, as a power of two), \
         and the bits that are free above it. Less than 0 bits: the proved range is wider than the format, which then saturates \
         or wraps as the design says.",
    )
}

/// Words that are alike in format and range are one.
fn lines(words: &[&Proved]) -> Vec<(&'static str, String)> {
    let mut out: Vec<(&'static str, String)> = Vec::new();
    let mut last: Option<&Proved> = None;
    for word in words {
        if last.is_some_and(|l| {
            (&l.format, l.range) == (&word.format, word.range) && part(l) == part(word)
        }) {
            continue;
        }
        last = Some(word);
        out.push(("boxed", format!("{} {}", part(word), word.format)));
        let size = word
            .range
            .low
            .unsigned_abs()
            .max(word.range.high.unsigned_abs());
        let bits = (size.max(1) as f64).log2();
        match (word.by_design, word.headroom_bits()) {
            (Some(by_design), _) => {
                let what = by_design.split(':').next().unwrap_or("");
                out.push(("boxed soft", format!("{what} by design")));
            }
            (None, Some(free)) => {
                let class = if free < 0.0 {
                    "boxed bound-text"
                } else {
                    "boxed soft"
                };
                out.push((
                    class,
                    minus(&format!(
                        "≤ 2^{}, {} bits free",
                        fixed(bits, 1),
                        fixed(free, 2)
                    )),
                ));
            }
            (None, None) => out.push(("boxed soft", "always 0".to_owned())),
        }
    }
    out
}

/// What a word is called inside its block: the last part of the key, without the channel.
fn part(word: &Proved) -> &str {
    const CHANNELS: [&str; 4] = [" drive_i", " drive_q", " sense_i", " sense_q"];
    let name = CHANNELS
        .iter()
        .find_map(|c| word.name.strip_suffix(c))
        .unwrap_or(&word.name);
    match name.rsplit(['.', ' ']).next().unwrap_or(name) {
        "phase_bits" => "phase",
        "sine" | "cosine" => "table",
        "width" => "x and y",
        "gain_bits" => "magnitude",
        other => other,
    }
}

/// A block at a place; gives its commands.
fn drawn(block: &Block, (x, y): (f64, f64), (w, h): (f64, f64), with_source: bool) -> String {
    let corner = format!(
        "M{} {}h{}v{}h-{}z",
        number(x),
        number(y),
        number(w),
        number(h),
        number(w)
    );
    let mut out = path("box", &corner);
    let title = match (with_source, block.from) {
        (true, from) if !from.is_empty() => format!("{}, from {from}", block.title),
        _ => block.title.to_owned(),
    };
    out += &text("box-title", (x + 9.0, y + 19.0), "start", &title);
    for (k, (class, line)) in block.lines.iter().enumerate() {
        let down = y + 19.0 + LINE * (k as f64 + 1.0);
        out += &text(class, (x + 9.0, down), "start", line);
    }
    out
}

/// An arrow along the corners.
fn arrow(corners: &[(f64, f64)]) -> String {
    let mut d = String::new();
    for (k, (x, y)) in corners.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(
            d,
            "{}{} {}",
            if k == 0 { "M" } else { "L" },
            number(*x),
            number(*y)
        );
    }
    if let [.., from, to] = corners {
        let (dx, dy) = ((to.0 - from.0).signum(), (to.1 - from.1).signum());
        let (dx, dy) = if from.0 == to.0 { (0.0, dy) } else { (dx, 0.0) };
        for side in [-1.0, 1.0] {
            let (x, y) = (
                to.0 - 6.0 * dx + 4.0 * side * dy,
                to.1 - 6.0 * dy + 4.0 * side * dx,
            );
            let _ = write!(
                d,
                "M{} {}L{} {}",
                number(x),
                number(y),
                number(to.0),
                number(to.1)
            );
        }
    }
    path("arrow", &d)
}

/// The chain above, the oscillator and the loops below.
fn two_rows(blocks: &[Block], width: f64) -> (String, f64) {
    let columns = 5.0;
    let w = (width - 2.0 - (columns - 1.0) * GAP.0) / columns;
    let height = |row: usize| {
        let own = blocks.iter().filter(|b| b.place.1 == row);
        own.map(Block::height).fold(0.0, f64::max)
    };
    let (upper, lower) = (height(0), height(1));
    let x = |column: usize| 1.0 + column as f64 * (w + GAP.0);
    let second = 4.0 + upper + GAP.1;
    let mut out = String::new();
    let has = |place: (usize, usize)| blocks.iter().any(|b| b.place == place);
    for block in blocks {
        let (column, row) = block.place;
        let (y, h) = if row == 0 {
            (4.0, upper)
        } else {
            (second, lower)
        };
        out += &drawn(block, (x(column), y), (w, h), false);
        if row == 0 && column > 0 {
            out += &arrow(&[(x(column) - GAP.0, 34.0), (x(column), 34.0)]);
        }
    }
    let middle = second + 0.5 * lower;
    if has((1, 1)) {
        let at = x(1) + 0.5 * w;
        out += &arrow(&[(at, second), (at, 4.0 + upper)]);
    }
    if has((3, 1)) {
        let at = x(3) + 0.5 * w;
        out += &arrow(&[(at, 4.0 + upper), (at, second)]);
        out += &arrow(&[(x(3), middle), (x(1) + w, middle)]);
    }
    if has((4, 1)) {
        let at = x(4) - 0.5 * GAP.0;
        let from = 4.0 + upper - 14.0;
        out += &arrow(&[
            (x(4) - GAP.0, from),
            (at, from),
            (at, middle),
            (x(4), middle),
        ]);
    }
    (out, second + lower + 4.0)
}

/// One below the other; a title says what feeds a block.
fn one_column(blocks: &[Block], width: f64) -> (String, f64) {
    let mut y = 4.0;
    let mut out = String::new();
    for block in blocks {
        out += &drawn(block, (1.0, y), (width - 2.0, block.height()), true);
        y += block.height() + 10.0;
    }
    (out, y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_magnitude_is_called_as_in_the_table_of_nodes() {
        let design = crate::design::reader::read(None).expect("the default");
        let proved = crate::check::proved::nodes(&design, &crate::circuit::engine::trace(&design));
        let numbers = diagram(&design, &proved, 960.0).numbers();
        let named = |name: &str| numbers.iter().any(|row| row[1] == name);
        assert!(named("circuit.cordic magnitude") && !named("circuit.cordic.gain_bits"));
    }
}
