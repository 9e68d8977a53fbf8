//! The header of an NPY file, read (any that numpy writes or accepts for a plain array) and
//! written (version 1.0).

use std::io::{ErrorKind, Read};

/// The first bytes of every NPY file.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// A longer header describes no plain array.
const MAX_HEADER_BYTES: usize = 1 << 20;

/// What an NPY header says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Header {
    /// The item's type, such as `<i2`.
    pub(super) descr: String,
    /// True if the first index runs fastest.
    pub(super) fortran_order: bool,
    /// Rows, columns, and so on.
    pub(super) shape: Vec<u64>,
    /// Bytes from the file's start to the first item.
    pub(super) bytes: u64,
}

impl Header {
    /// Reads the header from a file that stands at its start and leaves it at the first item. The
    /// error says what was found; one from the system is told apart from a wrong file.
    pub(super) fn read(input: &mut impl Read) -> Result<Header, HeaderError> {
        let mut start = [0u8; 8];
        fill(input, &mut start)?;
        if !start.starts_with(MAGIC) {
            return wrong("it does not start with the NPY magic `\\x93NUMPY`");
        }
        let mut length = [0u8; 4];
        let [major, minor] = [start[6], start[7]];
        let width = match (major, minor) {
            (1, 0) => 2,
            (2 | 3, 0) => 4,
            _ => return wrong(format!("its NPY format version is {major}.{minor}")),
        };
        fill(input, &mut length[..width])?;
        let length = u32::from_le_bytes(length) as usize;
        if length > MAX_HEADER_BYTES {
            return wrong(format!("its NPY header claims {length} bytes"));
        }
        let mut bytes = vec![0; length];
        fill(input, &mut bytes)?;
        let text = match major {
            3 => match String::from_utf8(bytes) {
                Ok(text) => text,
                Err(_) => return wrong("its NPY header is no UTF-8"),
            },
            _ => bytes.into_iter().map(char::from).collect(),
        };
        let mut header = Literal::new(&text).header()?;
        header.bytes = (8 + width + length) as u64;
        Ok(header)
    }
}

/// Why a header cannot be used.
#[derive(Debug)]
pub(super) enum HeaderError {
    /// The system's reading failed.
    Io(std::io::Error),
    /// The file is not as it must be; "its NPY header ...".
    Wrong(String),
}

fn wrong<T>(message: impl Into<String>) -> Result<T, HeaderError> {
    Err(HeaderError::Wrong(message.into()))
}

fn fill(input: &mut impl Read, bytes: &mut [u8]) -> Result<(), HeaderError> {
    input.read_exact(bytes).map_err(|e| match e.kind() {
        ErrorKind::UnexpectedEof => HeaderError::Wrong("it ends inside the NPY header".into()),
        _ => HeaderError::Io(e),
    })
}

/// The Python dictionary of a header, read from front to back.
struct Literal<'a> {
    whole: &'a str,
    rest: &'a str,
}

impl<'a> Literal<'a> {
    fn new(text: &'a str) -> Self {
        Literal {
            whole: text,
            rest: text,
        }
    }

    fn header(mut self) -> Result<Header, HeaderError> {
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        self.expect('{')?;
        while !self.accept('}') {
            let key = self.string()?;
            self.expect(':')?;
            let fresh = match key {
                "descr" => descr.replace(self.string()?.to_owned()).is_none(),
                "fortran_order" => fortran_order.replace(self.boolean()?).is_none(),
                "shape" => shape.replace(self.tuple()?).is_none(),
                _ => return self.broken(&format!("has the key `{key}`")),
            };
            if !fresh {
                return self.broken(&format!("has `{key}` twice"));
            }
            if !self.accept(',') {
                self.expect('}')?;
                break;
            }
        }
        self.blanks();
        if !self.rest.is_empty() {
            return self.broken("goes on after its `}`");
        }
        match (descr, fortran_order, shape) {
            (Some(descr), Some(fortran_order), Some(shape)) => Ok(Header {
                descr,
                fortran_order,
                shape,
                bytes: 0,
            }),
            _ => self.broken("lacks one of `descr`, `fortran_order`, `shape`"),
        }
    }

    fn broken<T>(&self, how: &str) -> Result<T, HeaderError> {
        let whole: String = self.whole.trim_end().chars().take(200).collect();
        wrong(format!("its NPY header {how}: {}", whole.escape_debug()))
    }

    fn blanks(&mut self) {
        self.rest = self.rest.trim_ascii_start();
    }

    fn accept(&mut self, c: char) -> bool {
        self.blanks();
        let found = self.rest.strip_prefix(c);
        self.rest = found.unwrap_or(self.rest);
        found.is_some()
    }

    fn expect(&mut self, c: char) -> Result<(), HeaderError> {
        if self.accept(c) {
            return Ok(());
        }
        self.broken(&format!("has {} where `{c}` belongs", self.found()))
    }

    /// What stands here, for a message.
    fn found(&self) -> String {
        match self.rest.chars().next() {
            Some(c) => format!("`{}`", c.escape_debug()),
            None => "its end".to_owned(),
        }
    }

    /// `'...'` or `"..."` without escapes.
    fn string(&mut self) -> Result<&'a str, HeaderError> {
        for quote in ['\'', '"'] {
            if self.accept(quote) {
                if let Some((text, rest)) = self.rest.split_once(quote)
                    && !text.contains(['\\', '\n'])
                {
                    self.rest = rest;
                    return Ok(text);
                }
                return self.broken("has a broken string");
            }
        }
        self.broken(&format!("has {} where a string belongs", self.found()))
    }

    fn boolean(&mut self) -> Result<bool, HeaderError> {
        self.blanks();
        for (name, value) in [("True", true), ("False", false)] {
            if let Some(rest) = self.rest.strip_prefix(name) {
                self.rest = rest;
                return Ok(value);
            }
        }
        self.broken("has neither True nor False as `fortran_order`")
    }

    /// A tuple of whole numbers, each perhaps with the `L` of Python 2.
    fn tuple(&mut self) -> Result<Vec<u64>, HeaderError> {
        let mut values = Vec::new();
        self.expect('(')?;
        while !self.accept(')') {
            let digits = self
                .rest
                .find(|c: char| !c.is_ascii_digit())
                .unwrap_or(self.rest.len());
            let (number, rest) = self.rest.split_at(digits);
            let Ok(value) = number.parse() else {
                return self.broken("has a `shape` that is no tuple of whole numbers");
            };
            values.push(value);
            self.rest = rest.strip_prefix('L').unwrap_or(rest);
            if !self.accept(',') {
                if values.len() == 1 {
                    return self.broken("has a `shape` that is no tuple");
                }
                self.expect(')')?;
                break;
            }
        }
        Ok(values)
    }
}

/// A header of version 1.0 for a C-ordered array of `rows` x `columns`. Its length does not depend
/// on `rows`, so the number of rows can be put in when it is known.
pub(super) fn write(descr: &str, rows: u64, columns: usize) -> Vec<u8> {
    let dictionary = |rows: u64| {
        format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({rows}, {columns}), }}")
    };
    // The magic, version and length take 10 bytes; the end is a newline on a multiple of 64.
    let length = (10 + dictionary(u64::MAX).len() + 1).next_multiple_of(64) - 10;
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(dictionary(rows).bytes());
    bytes.resize(10 + length - 1, b' ');
    bytes.push(b'\n');
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Header, String> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([2, 0]);
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text.bytes());
        Header::read(&mut bytes.as_slice()).map_err(|e| match e {
            HeaderError::Io(e) => panic!("{e}"),
            HeaderError::Wrong(message) => message,
        })
    }

    #[test]
    fn any_spelling_that_numpy_reads_is_read() {
        for text in [
            "{'descr': '<i2', 'fortran_order': False, 'shape': (5, 2), }          \n",
            "{'descr':'<i2','fortran_order':False,'shape':(5,2)}",
            " {\"shape\": (5,2,), \"descr\": \"<i2\",\n 'fortran_order' :False , }\t\n",
            "{'shape': (5L, 2L), 'fortran_order': False, 'descr': '<i2'}\n",
        ] {
            let header = parse(text).unwrap();
            assert_eq!(
                (header.descr.as_str(), header.fortran_order, header.shape),
                ("<i2", false, vec![5, 2]),
                "{text}"
            );
            assert_eq!(header.bytes, 12 + text.len() as u64);
        }
        let rest = "'descr': '<f8', 'fortran_order': True}";
        for (shape, values) in [
            ("()", vec![]),
            ("(7,)", vec![7]),
            ("(1,2,3)", vec![1, 2, 3]),
        ] {
            assert_eq!(
                parse(&format!("{{'shape': {shape}, {rest}")).unwrap().shape,
                values
            );
        }
    }

    #[test]
    fn anything_else_is_refused_with_what_was_found() {
        for (text, says) in [
            ("", "its end where `{`"),
            ("{}", "lacks one of"),
            ("{'descr': '<i2', 'shape': (5, 2)}", "lacks one of"),
            ("{'descr': [('a', '<i2')]}", "`[` where a string"),
            ("{'descr': '<i2', 'descr': '<i2'}", "`descr` twice"),
            ("{'descr': '<i2', 'x': 1}", "the key `x`"),
            ("{'descr': '<\\x692'}", "broken string"),
            ("{'descr': '<i2}", "broken string"),
            ("{'fortran_order': 1}", "neither True nor False"),
            ("{'shape': (5)}", "no tuple"),
            ("{'shape': (-5, 2)}", "whole numbers"),
            ("{'shape': (5 2)}", "no tuple"),
            ("{'shape': (99999999999999999999, 2)}", "whole numbers"),
            (
                "{'shape': (5, 2), 'descr': '<i2', 'fortran_order': False} x",
                "goes on",
            ),
            (
                "{'shape': (5, 2), 'descr': '<i2', 'fortran_order': False",
                "where `}`",
            ),
        ] {
            let message = parse(text).unwrap_err();
            assert!(message.contains(says), "{text}: {message}");
        }
        let read = |bytes: &[u8]| format!("{:?}", Header::read(&mut &bytes[..]).unwrap_err());
        assert!(read(b"\x93NUMPY\x04\x00\x00\x00").contains("version is 4.0"));
        assert!(read(b"\x93NUMPY\x01\x01\x00\x00").contains("version is 1.1"));
        assert!(read(b"\x93NUMPY\x01\x00\x10\x00{").contains("ends inside"));
        assert!(read(b"\x93NUM").contains("ends inside"));
        assert!(read(b"\x93NUMPI\x01\x00").contains("magic"));
        assert!(read(b"\x93NUMPY\x02\x00\xff\xff\xff\xff").contains("claims 4294967295"));
    }

    #[test]
    fn a_written_header_has_one_length_for_any_number_of_rows() {
        for columns in [1, 9, 10, 1000] {
            let empty = write("<i8", 0, columns);
            for rows in [0, 1, 12345, u64::MAX] {
                let bytes = write("<i8", rows, columns);
                assert_eq!((bytes.len(), bytes.len() % 64), (empty.len(), 0));
                let header = Header::read(&mut bytes.as_slice()).unwrap();
                assert_eq!(header.shape, [rows, columns as u64]);
                assert_eq!(header.bytes, bytes.len() as u64);
            }
        }
    }
}
