// {{ v.banner }}
// SPDX-License-Identifier: MIT OR Apache-2.0

//! Host-side check, not firmware: codes -> push -> convert -> correct, {{ v.samples }} samples. Exit status 0 if all
//! words of the conversion after every row, every corrected rate and the chain's fault are the model's (by a checksum).
// Words of any width pass as words of 64 bits.
#![allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
// Numbers are printed as the model has them.
#![allow(clippy::unreadable_literal)]

fn mix(h: u64, word: u64) -> u64 {
    (h ^ word).wrapping_mul(0x100_0000_01b3)
}

/// A triangle over the ADC's range.
fn code(turn: u32) -> {{ v.code }} {
    let up = turn.wrapping_mul(2);
    let place = u64::from(if turn >> 31 == 0 { up } else { !up });
    ({{ v.code_low }} + (({{ v.code_span }} * place) >> 32) as i64) as {{ v.code }}
}

fn main() {
    let mut detector = {{ v.p }}::Detector::new();
    let mut sums = {{ v.p }}_conversion::{{ v.sums }}::default();
    let mut state = {{ v.p }}_correction::{{ v.state }}::default();
    let mut h = 0xcbf2_9ce4_8422_2325_u64;
    let mut reading = 0_u64;
    let mut turn = 0_u32;
    for _ in 0..{{ v.samples }}_u64 {
        turn = turn.wrapping_add({{ v.step }});
        let Some(row) = detector.push(code(turn), code(turn.wrapping_add({{ v.lead }}))) else {
            continue;
        };
        let words = {{ v.p }}_conversion::convert(&mut sums, 0{% for a in v.row %}, {{ a }}{% endfor %});
{% for w in v.words %}        h = mix(h, words.{{ w }} as u64);
{% endfor %}        if words.complete != 0 {
            let rate = {{ v.p }}_correction::correct(
                &mut state,
                i8::from(reading == 0),
{% for i in v.inputs %}                {% if i.own %}{{ i.argument }}{% else %}({{ i.low }} + ((reading * {{ v.stride }} + {{ i.start }}) % {{ i.count }}) as i64) as {{ i.ty }}{% endif %},
{% endfor %}                {{ v.rate }},
            );
            h = mix(h, rate as u64);
            reading += 1;
        }
    }
    h = mix(h, u64::from(detector.fault));
    std::process::exit(i32::from(h != {{ v.checksum }}));
}
