// {{ v.banner }}
//
// Host-side driver, not firmware; the protocol is that of the C bundle's harness.
use std::io::{BufReader, BufWriter, Read, Write, stdin, stdout};

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

type Call = fn(&[i64], &mut Vec<u64>);

{% for f in v.functions %}{% if f.tested %}fn call_{{ f.name }}(a: &[i64], out: &mut Vec<u64>) {
{% if f.faults %}    let mut fault = 0_u32;
{% endif %}    let r = {{ v.p }}::{{ f.name }}({{ f.harness_arguments }});
{% for o in f.outputs %}    out.push({{ o }});
{% endfor %}    out.push({% if f.faults %}u64::from(fault){% else %}0{% endif %});
}

{% endif %}{% endfor %}const FUNCTIONS: &[(&str, usize, Call)] = &[
{% for f in v.functions %}{% if f.tested %}    ("{{ f.name }}", {{ f.inputs.len() }}, call_{{ f.name }}),
{% endif %}{% endfor %}];

fn table(name: &str) -> Option<Vec<u64>> {
    match name {
{% for t in v.tables %}        "{{ t.name }}" => Some({{ v.p }}::{{ t.upper }}.iter().map(|v| i64::from(*v) as u64).collect()),
{% endfor %}        _ => None,
    }
}

{% if let Some(t) = v.stream %}fn stream(input: &mut impl Read, output: &mut impl Write) {
    let mut s = {{ v.p }}::{{ t.camel }}::default();
    loop {
        let a: Vec<i64> = (0..{{ t.function.inputs.len() }})
            .map_while(|_| get::<8>(input).map(i64::from_ne_bytes))
            .collect();
        if a.len() < {{ t.function.inputs.len() }} {
            break;
        }
        let r = {{ v.p }}::{{ t.function.name }}(&mut s, {{ t.function.harness_arguments }});
        put(output, &[{% for o in t.function.outputs %}{{ o }}, {% endfor %}0]);
    }
}

{% endif %}{% if v.chain %}fn chain(input: &mut impl Read, output: &mut impl Write) {
    let mut g = {{ v.p }}::Detector::new();
    while let Some(bytes) = get::<8>(input) {
        let [a, b, c, d, e, f, h, i] = bytes;
        let drive = i32::from_ne_bytes([a, b, c, d]);
        let sense = i32::from_ne_bytes([e, f, h, i]);
        if let Some(row) = g.push(drive{% if v.code != "i32" %} as {{ v.code }}{% endif %}, sense{% if v.code != "i32" %} as {{ v.code }}{% endif %}) {
            put(output, &[{% for o in v.row %}{{ o }}, {% endfor %}u64::from(g.fault)]);
        }
    }
}

{% endif %}fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mode = arguments.first().map_or("selftest", String::as_str);
    let name = arguments.get(1).map_or("", String::as_str);
    let number = |k: usize| arguments.get(k).and_then(|s| s.parse::<i64>().ok());
    let function = FUNCTIONS.iter().find(|(n, _, _)| *n == name);
    let (mut input, mut output) = (BufReader::new(stdin().lock()), BufWriter::new(stdout().lock()));
    match (mode, function) {
        ("selftest", _) => {
            let failed = {{ v.p }}::selftest();
            let verdict = if failed == 0 { "pass" } else { "FAIL" };
            println_to(&mut output, &format!("selftest: {verdict} ({failed})"));
            drop(output);
            std::process::exit(i32::from(failed != 0));
        }
        ("table", _) => match table(name) {
            Some(words) => put(&mut output, &words),
            None => std::process::exit(2),
        },
        ("call", Some((_, inputs, call))) => {
            let mut out = Vec::new();
            loop {
                let words: Vec<i64> = (0..*inputs)
                    .map_while(|_| get::<8>(&mut input).map(i64::from_ne_bytes))
                    .collect();
                if words.len() < *inputs {
                    break;
                }
                out.clear();
                call(&words, &mut out);
                put(&mut output, &out);
            }
        }
        ("range", Some((_, _, call))) => {
            let (low, count) = (number(2).unwrap_or(0), number(3).unwrap_or(0));
            let mut out = Vec::new();
            for k in 0..count {
                out.clear();
                call(&[low + k], &mut out);
                put(&mut output, &out);
            }
        }
{% if v.stream.is_some() %}        ("stream", _) => stream(&mut input, &mut output),
{% endif %}{% if v.chain %}        ("chain", _) => chain(&mut input, &mut output),
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
