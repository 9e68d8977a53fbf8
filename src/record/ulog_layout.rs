//! Where the fields of a ULog topic lie in its messages.

use super::log_bytes::Scalar;
use std::collections::BTreeMap;

/// Formats may be nested; the specification forbids circles, and no topic is this deep.
const DEEPEST: usize = 16;

/// No message is longer than its 16-bit size lets it be.
const LONGEST: usize = u16::MAX as usize;

/// What a field holds.
#[derive(Debug, Clone, PartialEq)]
enum Type {
    Number(Scalar),
    /// Another format, by name.
    Nested(String),
}

#[derive(Debug, Clone)]
struct Field {
    name: String,
    kind: Type,
    /// 1 for a field that is no array.
    count: usize,
    /// An array of one is still one: its elements are named with brackets.
    is_array: bool,
}

/// The format definitions of a log, by name.
#[derive(Debug, Default)]
pub(super) struct Definitions {
    formats: BTreeMap<String, Vec<Field>>,
}

impl Definitions {
    /// Takes a definition, `name:type field;type[n] field;`; false if it cannot be read.
    pub(super) fn define(&mut self, text: &[u8]) -> bool {
        let Some((name, fields)) = std::str::from_utf8(text)
            .ok()
            .and_then(|text| text.split_once(':'))
        else {
            return false;
        };
        let fields: Option<Vec<Field>> = fields
            .split(';')
            .filter(|field| !field.trim_end_matches('\0').is_empty())
            .map(field)
            .collect();
        match fields {
            Some(fields) if !name.is_empty() => {
                self.formats.insert(name.to_owned(), fields);
                true
            }
            _ => false,
        }
    }

    /// The layout of a topic's messages; `None` without a usable definition of it.
    pub(super) fn layout(&self, name: &str) -> Option<Layout> {
        let fields = self.formats.get(name)?;
        let mut places = BTreeMap::new();
        let (mut end, mut logged_bytes) = (0usize, 0);
        for field in fields {
            let size = self.size(&field.kind, 0)?;
            if let Type::Number(scalar) = field.kind {
                for i in 0..field.count.min(LONGEST) {
                    let name = match field.is_array {
                        true => format!("{}[{i}]", field.name),
                        false => field.name.clone(),
                    };
                    places.insert(name, (end + i * size, scalar));
                }
            }
            end = end.checked_add(size.checked_mul(field.count)?)?;
            if end > LONGEST {
                return None;
            }
            // Padding at the end is defined and not logged.
            if !field.name.starts_with("_padding") {
                logged_bytes = end;
            }
        }
        Some(Layout {
            places,
            logged_bytes,
        })
    }

    /// Bytes of one element.
    fn size(&self, kind: &Type, depth: usize) -> Option<usize> {
        match kind {
            Type::Number(scalar) => Some(scalar.size()),
            Type::Nested(_) if depth >= DEEPEST => None,
            Type::Nested(name) => self.formats.get(name)?.iter().try_fold(0usize, |sum, f| {
                let size = self.size(&f.kind, depth + 1)?.checked_mul(f.count)?;
                sum.checked_add(size).filter(|sum| *sum <= LONGEST)
            }),
        }
    }
}

/// One field of a definition.
fn field(text: &str) -> Option<Field> {
    let (kind, name) = text.trim().split_once(' ')?;
    let (kind, count) = match kind.split_once('[') {
        Some((kind, rest)) => (kind, Some(rest.strip_suffix(']')?.parse().ok()?)),
        None => (kind, None),
    };
    let number = match kind {
        "int8_t" => Some(Scalar::I8),
        "uint8_t" | "bool" | "char" => Some(Scalar::U8),
        "int16_t" => Some(Scalar::I16),
        "uint16_t" => Some(Scalar::U16),
        "int32_t" => Some(Scalar::I32),
        "uint32_t" => Some(Scalar::U32),
        "int64_t" => Some(Scalar::I64),
        "uint64_t" => Some(Scalar::U64),
        "float" => Some(Scalar::F32),
        "double" => Some(Scalar::F64),
        _ => None,
    };
    Some(Field {
        name: name.trim().to_owned(),
        kind: number.map_or_else(|| Type::Nested(kind.to_owned()), Type::Number),
        count: count.unwrap_or(1),
        is_array: count.is_some(),
    })
}

/// Where the numbers of a topic lie.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// By name, elements of arrays as `name[0]`.
    places: BTreeMap<String, (usize, Scalar)>,
    /// Bytes of a message's data.
    pub logged_bytes: usize,
}

impl Layout {
    /// Offset and type of a number.
    pub(super) fn field(&self, name: &str) -> Option<(usize, Scalar)> {
        self.places.get(name).copied()
    }

    /// us since power-on; `None` if the message has no such clock of 64 bits (PX4 writes no other)
    /// or ends before it.
    pub(super) fn time_us(&self, data: &[u8]) -> Option<u64> {
        let (offset, scalar) = self.field("timestamp")?;
        let bytes = data.get(offset..)?.first_chunk::<8>()?;
        (scalar == Scalar::U64).then(|| u64::from_le_bytes(*bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_fields_arrays_and_padding_take_their_places() {
        let mut d = Definitions::default();
        // Used before it is defined, as the specification allows.
        assert!(
            d.define(b"outer:uint64_t timestamp;inner[2] parts;float[3] v;uint8_t[4] _padding0;")
        );
        assert!(d.define(b"inner:uint16_t a;uint8_t b;uint8_t[1] _padding0;"));
        let l = d.layout("outer").unwrap();
        assert_eq!(l.field("timestamp"), Some((0, Scalar::U64)));
        // The padding of a nested format is logged.
        assert_eq!(l.field("v[0]"), Some((16, Scalar::F32)));
        assert_eq!(l.field("v[2]"), Some((24, Scalar::F32)));
        assert_eq!((l.field("v"), l.field("v[3]")), (None, None));
        assert_eq!(l.logged_bytes, 28);
        assert_eq!(d.layout("inner").unwrap().logged_bytes, 3);
    }

    #[test]
    fn a_definition_that_makes_no_sense_is_none() {
        let mut d = Definitions::default();
        for text in [
            &b"no colon"[..],
            b":float x;",
            b"a:float;",
            b"a:float[x] v;",
            b"a:float[-1] v;",
            b"a:float[3 v;",
            b"a:\xFF\xFE x;",
        ] {
            assert!(!d.define(text), "{}", String::from_utf8_lossy(text));
        }
        assert!(d.define(b"self:self x;") && d.define(b"long:double[9000] x;"));
        assert!(
            d.define(b"unknown:nothing x;") && d.define(b"huge:double[18446744073709551615] x;")
        );
        for name in ["self", "long", "unknown", "huge", "never"] {
            assert!(d.layout(name).is_none(), "{name}");
        }
    }
}
