//! Closing by the library.

use super::design::design;
use gyrogen::thermal::close;
use gyrogen::thermal::close::Closed;
use gyrogen::thermal::search::Effort;
use std::path::Path;

/// A record in CSV, closed with a design's text.
pub fn closed(csv: &str, text: &str) -> Closed {
    let design = design(text);
    let read = gyrogen::record::thermal::parse(csv.as_bytes(), Path::new("r.csv"), &design.record);
    let (record, warnings) = read.expect("a record");
    close::close(&record, warnings, &design, "test", Effort::default()).expect("closed")
}
