// {{ v.banner }}
// SPDX-License-Identifier: MIT OR Apache-2.0
//
// Host-side driver, not firmware; modes and protocol are those of the C bundle's harness:
// selftest, table NAME, call NAME, range NAME A N, every NAME, sequence, chain, long,
// check NAME FILE (vectors/NAME.csv, or the standard input), check chain, check tables, check sequence, check every,
// check long.
//
// Words of any width pass as words of 64 bits.
#![allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
// Numbers are printed as the model has them; what a state holds is set word by word.
#![allow(clippy::unreadable_literal, clippy::field_reassign_with_default)]
// The oldest compilers that take the crate have no `is_multiple_of`.
#![allow(clippy::manual_is_multiple_of)]
use std::io::{BufRead, BufReader, BufWriter, Read, Write, stdin, stdout};

fn get<const N: usize>(from: &mut impl Read) -> Option<[u8; N]> {
    let mut bytes = [0; N];
    from.read_exact(&mut bytes).ok()?;
    Some(bytes)
}

fn put(to: &mut impl Write, words: &[u64]) {
    for word in words {
        if to.write_all(&word.to_ne_bytes()).is_err() {
            std::process::exit(3);
        }
    }
}

fn mix(h: u64, word: u64) -> u64 {
    (h ^ word).wrapping_mul(0x100_0000_01b3)
}

const BASIS: u64 = 0xcbf2_9ce4_8422_2325;

/// A function: inputs and state in, outputs, state and fault out.
struct Function {
    name: &'static str,
    inputs: usize,
    outputs: usize,
    call: fn(&[i64], &mut Vec<u64>),
    /// Ends and widths of all words, where every input is run; the checksum of all records.
    domain: &'static [(i64, u64)],
    every: u64,
}

{% for f in v.tests %}fn call_{{ f.name }}(a: &[i64], out: &mut Vec<u64>) {
{% if f.inputs == 0 %}    let _ = a;
{% endif %}{% if !f.state.is_empty() %}    let mut s = {{ v.p }}::{{ f.state }}::default();
{% endif %}{% if f.faults %}    let mut fault = 0_u32;
{% endif %}{% for w in f.set %}    {{ w }};
{% endfor %}    {% if !f.result.is_empty() %}let r = {% endif %}{{ v.p }}::{{ f.name }}({{ f.arguments }});
{% for o in f.words %}    out.push({{ o }});
{% endfor %}    out.push({% if f.faults %}u64::from(fault){% else %}0{% endif %});
}

{% endfor %}const FUNCTIONS: &[Function] = &[
{% for f in v.tests %}    Function {
        name: "{{ f.name }}",
        inputs: {{ f.inputs }},
        outputs: {{ f.outputs }},
        call: call_{{ f.name }},
        domain: &[{% for d in f.domain %}({{ d[0] }}, {{ d[1] }}), {% endfor %}],
        every: {% if f.every.is_empty() %}0{% else %}{{ f.every }}{% endif %},
    },
{% endfor %}];

/// Counts through all inputs, the last one fastest; a checksum of each {{ v.every_block() }}, and one of these.
fn every(f: &Function) -> u64 {
    let mut place = vec![0_u64; f.domain.len()];
    let mut out = Vec::new();
    let (mut whole, mut h, mut count) = (BASIS, BASIS, 0_u64);
    loop {
        let words = f.domain.iter().zip(&place);
        let a: Vec<i64> = words.map(|((low, _), p)| low.wrapping_add(*p as i64)).collect();
        out.clear();
        (f.call)(&a, &mut out);
        h = out.iter().fold(h, |h, word| mix(h, *word));
        count += 1;
        let last = place.iter().zip(f.domain).rposition(|(p, (_, span))| p < span);
        if count % {{ v.every_block() }} == 0 || last.is_none() {
            whole = mix(whole, h);
            h = BASIS;
        }
        let Some(k) = last else {
            return whole;
        };
        place[k] += 1;
        place[k + 1..].fill(0);
    }
}

fn table(name: &str) -> Option<Vec<u64>> {
    match name {
{% for t in v.tables %}        "{{ t.name }}" => Some({{ v.p }}::{{ t.upper }}.iter().map(|v| i64::from(*v) as u64).collect()),
{% endfor %}        _ => None,
    }
}

{% if let Some(t) = v.stream %}fn step(state: &mut {{ v.p }}::{{ t.camel }}, a: &[i64], out: &mut Vec<u64>) {
    let r = {{ v.p }}::{{ t.function.name }}(state, {{ t.function.harness_arguments }});
{% for o in t.function.outputs %}    out.push({{ o }});
{% endfor %}    out.push(0);
}

fn sequence(input: &mut impl Read, output: &mut impl Write) {
    let mut s = {{ v.p }}::{{ t.camel }}::default();
    let mut out = Vec::new();
    loop {
        let a: Vec<i64> = (0..{{ t.function.inputs.len() }})
            .map_while(|_| get::<8>(input).map(i64::from_ne_bytes))
            .collect();
        if a.len() < {{ t.function.inputs.len() }} {
            break;
        }
        out.clear();
        step(&mut s, &a, &mut out);
        put(output, &out);
    }
}

{% endif %}{% if v.chain %}fn push(g: &mut {{ v.p }}::Detector, drive: i32, sense: i32) -> Option<Vec<u64>> {
    let row = g.push(drive{% if v.code != "i32" %} as {{ v.code }}{% endif %}, sense{% if v.code != "i32" %} as {{ v.code }}{% endif %})?;
    Some(vec![{% for o in v.row %}{{ o }}, {% endfor %}u64::from(g.fault)])
}

fn chain(input: &mut impl Read, output: &mut impl Write) {
    let mut g = {{ v.p }}::Detector::new();
    while let Some(bytes) = get::<8>(input) {
        let [a, b, c, d, e, f, h, i] = bytes;
        let drive = i32::from_ne_bytes([a, b, c, d]);
        let sense = i32::from_ne_bytes([e, f, h, i]);
        if let Some(row) = push(&mut g, drive, sense) {
            put(output, &row);
        }
    }
}

{% endif %}{% if !v.long_words.is_empty() %}/// Triangles of changing amplitude beside the given frequencies, with noise and without, random words, squares.
struct Stimulus {
    x: u64,
    amplitude: u64,
    detuning: u32,
}

/// Low end, width and steps through 2^32 a call of each word.
const LONG: &[(i64, u64, u32)] = &[{% for w in v.long_words %}({{ w[0] }}, {{ w[1] }}, {{ w[2] }}), {% endfor %}];

impl Stimulus {
    fn draw(&mut self) -> u64 {
        self.x = self.x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.x
    }

    fn words(&mut self, step: u64) -> Vec<i64> {
        if step % {{ v.long_segment() }} == 0 {
            self.amplitude = self.draw() >> 48;
            self.detuning = (self.draw() >> 52) as u32;
        }
        let mut words = Vec::new();
        for (k, (low, span, rate)) in LONG.iter().enumerate() {
            let noise = self.draw() >> 32;
            let turn = (step as u32).wrapping_mul(rate.wrapping_add(self.detuning)).wrapping_add((k as u32) << 30);
            let up = turn.wrapping_mul(2);
            let triangle = u64::from(if turn >> 31 == 0 { up } else { !up });
            let scaled = ((triangle * self.amplitude) >> 16) + ((65_535 - self.amplitude) << 15);
            let most = u64::from(u32::MAX);
            let place = match (step / {{ v.long_segment() }}) % 4 {
                0 => scaled,
                1 => (scaled + (noise >> 12)).min(most),
                2 => noise,
                _ => most * u64::from(turn >> 31),
            };
            let offset = (span >> 32) * place + (((span & most) * place + most) >> 32);
            words.push(low.wrapping_add(offset as i64));
        }
        words
    }
}

fn long_run() -> u64 {
    let mut stimulus = Stimulus { x: {{ v.seed }}, amplitude: 0, detuning: 0 };
    let mut h = BASIS;
{% if v.chain %}    let mut g = {{ v.p }}::Detector::new();
{% for o in v.long_state() %}    h = mix(h, {{ o }});
{% endfor %}    for n in 0..{{ v.long_steps }}_u64 {
        let words = stimulus.words(n);
        if let Some(row) = push(&mut g, words[0] as i32, words[1] as i32) {
            h = row.iter().fold(h, |h, word| mix(h, *word));
        }
    }
{% else %}    let mut s = {{ v.p }}::{{ v.stream_state() }}::default();
    let mut out = Vec::new();
{% for o in v.long_state() %}    h = mix(h, {{ o }});
{% endfor %}    for n in 0..{{ v.long_steps }}_u64 {
        let mut words = vec![i64::from(n % {{ v.long_restart }} == 0)];
        words.extend(stimulus.words(n));
        out.clear();
        step(&mut s, &words, &mut out);
        h = out.iter().fold(h, |h, word| mix(h, *word));
    }
{% endif %}{% for o in v.long_state() %}    h = mix(h, {{ o }});
{% endfor %}    h
}

{% endif %}/// The words of the lines after the first, of which the first `skip` cells are text.
fn rows(input: &mut impl BufRead, skip: usize) -> Vec<Vec<u64>> {
    let mut rows = Vec::new();
    for line in input.lines().map_while(Result::ok).skip(1) {
        let word = |cell: &str| {
            let negative = cell.parse::<i64>().map(|word| word as u64);
            cell.parse::<u64>().or(negative).ok()
        };
        match line.split(',').skip(skip).map(word).collect() {
            Some(words) => rows.push(words),
            // A header, or no line of vectors: it has no words and differs from every record.
            None => rows.push(Vec::new()),
        }
    }
    rows
}

/// Of what is held against one checksum, which covers `what`.
fn by_checksum(name: &str, what: &str, good: bool) -> bool {
    println!("{name}: {}, {what} by a checksum", if good { "pass" } else { "FAIL" });
    good
}

fn verdict(name: &str, compared: u64, differing: u64) -> bool {
    let good = compared > 0 && differing == 0;
    println!("{name}: {}, {compared} compared, {differing} differ", if good { "pass" } else { "FAIL" });
    good
}

fn differs(due: &[u64], found: &[u64]) -> u64 {
    if due.len() != found.len() {
        return 1;
    }
    due.iter().zip(found).filter(|(a, b)| a != b).count() as u64
}

fn check_function(f: &Function, input: &mut impl BufRead) -> bool {
    let (mut compared, mut differing) = (0, 0);
    let mut out = Vec::new();
    for words in rows(input, 0) {
        if words.len() != f.inputs + f.outputs {
            return verdict(f.name, compared, differing + 1);
        }
        let (a, due) = words.split_at(f.inputs);
        let a: Vec<i64> = a.iter().map(|word| *word as i64).collect();
        out.clear();
        (f.call)(&a, &mut out);
        differing += differs(due, &out);
        compared += due.len() as u64;
    }
    verdict(f.name, compared, differing)
}

fn check_tables(input: &mut impl BufRead) -> bool {
    let mut due = rows(input, 1).into_iter();
    let (mut compared, mut differing) = (0, 0);
    let names: &[&str] = &[{% for t in v.tables %}"{{ t.name }}", {% endfor %}];
    for name in names {
        for (k, word) in table(name).unwrap_or_default().into_iter().enumerate() {
            differing += u64::from(due.next() != Some(vec![k as u64, word]));
            compared += 1;
        }
    }
    differing += due.count() as u64;
    names.is_empty() && differing == 0 || verdict("tables", compared, differing)
}

{% if let Some(t) = v.stream %}fn check_sequence(input: &mut impl BufRead) -> bool {
    let mut s = {{ v.p }}::{{ t.camel }}::default();
    let (mut compared, mut differing) = (0, 0);
    let mut out = Vec::new();
    for words in rows(input, 0) {
        if words.len() < {{ t.function.inputs.len() }} {
            return verdict("sequence", compared, differing + 1);
        }
        let (a, due) = words.split_at({{ t.function.inputs.len() }});
        let a: Vec<i64> = a.iter().map(|word| *word as i64).collect();
        out.clear();
        step(&mut s, &a, &mut out);
        differing += differs(due, &out);
        compared += due.len() as u64;
    }
    verdict("sequence", compared, differing)
}

{% endif %}{% if v.chain %}/// Reads chain_input.csv and then chain_output.csv.
fn check_chain(input: &mut impl BufRead) -> bool {
    let mut g = {{ v.p }}::Detector::new();
    let lines = rows(input, 0);
    let inputs = lines.iter().take_while(|words| words.len() == 2);
    let found: Vec<Vec<u64>> =
        inputs.clone().filter_map(|w| push(&mut g, w[0] as i64 as i32, w[1] as i64 as i32)).collect();
    // The second header has no words.
    let due: Vec<&Vec<u64>> = lines.iter().skip(inputs.count() + 1).collect();
    let mut differing = u64::from(due.len() != found.len());
    let mut compared = 0;
    for (due, found) in due.iter().zip(&found) {
        differing += differs(due, found);
        compared += found.len() as u64;
    }
    verdict("chain", compared, differing)
}

{% endif %}fn check(name: &str, input: &mut impl BufRead) -> bool {
    if let Some(f) = FUNCTIONS.iter().find(|f| f.name == name) {
        return check_function(f, input);
    }
    match name {
        "every" => {
            let exhausted = FUNCTIONS.iter().filter(|f| !f.domain.is_empty());
            exhausted.map(|f| by_checksum(f.name, "every input", every(f) == f.every)).fold(true, |all, good| all && good)
        }
        "tables" => check_tables(input),
{% if v.stream.is_some() %}        "sequence" => check_sequence(input),
{% endif %}{% if v.chain %}        "chain" => check_chain(input),
{% endif %}{% if !v.long_words.is_empty() %}        "long" => by_checksum("long", "a run of {{ v.long_steps }} {% if v.chain %}samples{% else %}calls{% endif %}", long_run() == {{ v.long_checksum }}),
{% endif %}        _ => false,
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mode = arguments.first().map_or("selftest", String::as_str);
    let name = arguments.get(1).map_or("", String::as_str);
    let number = |k: usize| arguments.get(k).and_then(|s| s.parse::<i64>().ok());
    let function = FUNCTIONS.iter().find(|f| f.name == name);
    let (mut input, mut output) = (BufReader::new(stdin().lock()), BufWriter::new(stdout().lock()));
    match (mode, function) {
        ("selftest", _) => {
            let failed = {{ v.p }}::selftest();
            let verdict = if failed == 0 { "pass" } else { "FAIL" };
            println_to(&mut output, &format!("selftest: {verdict} ({failed})"));
            drop(output);
            std::process::exit(i32::from(failed != 0));
        }
        ("check", _) => {
            drop(output);
            let files = arguments.iter().skip(2).map(std::fs::read);
            let files: std::io::Result<Vec<Vec<u8>>> = files.collect();
            let good = match files {
                Ok(files) if files.is_empty() => check(name, &mut input),
                Ok(files) => check(name, &mut files.concat().as_slice()),
                Err(why) => {
                    println!("{name}: FAIL, {why}");
                    false
                }
            };
            std::process::exit(i32::from(!good));
        }
        ("table", _) => match table(name) {
            Some(words) => put(&mut output, &words),
            None => std::process::exit(2),
        },
        ("call", Some(f)) => {
            let mut out = Vec::new();
            loop {
                let words: Vec<i64> = (0..f.inputs)
                    .map_while(|_| get::<8>(&mut input).map(i64::from_ne_bytes))
                    .collect();
                if words.len() < f.inputs {
                    break;
                }
                out.clear();
                (f.call)(&words, &mut out);
                put(&mut output, &out);
            }
        }
        ("range", Some(f)) if f.inputs == 1 => {
            let (low, count) = (number(2).unwrap_or(0), number(3).unwrap_or(0));
            let mut out = Vec::new();
            for k in 0..count {
                out.clear();
                (f.call)(&[low.wrapping_add(k)], &mut out);
                put(&mut output, &out);
            }
        }
        ("every", Some(f)) if !f.domain.is_empty() => put(&mut output, &[every(f)]),
{% if v.stream.is_some() %}        ("sequence", _) => sequence(&mut input, &mut output),
{% endif %}{% if v.chain %}        ("chain", _) => chain(&mut input, &mut output),
{% endif %}{% if !v.long_words.is_empty() %}        ("long", _) => put(&mut output, &[long_run()]),
{% endif %}        _ => {
            eprintln!("unknown mode or function");
            std::process::exit(2);
        }
    }
}

fn println_to(to: &mut impl Write, line: &str) {
    if writeln!(to, "{line}").is_err() {
        std::process::exit(3);
    }
}
