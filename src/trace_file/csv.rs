//! A trace as CSV: `sample,time_s,NAME [UNIT],...`, one row for each sample at which a signal has a
//! value; a signal without one there has an empty cell. Signals of one rate and length leave none.

use super::merge::Merge;
use super::{Sink, Trace, Values};
use crate::error::Result;
use crate::output::write_failed;
use std::path::Path;

pub(super) fn write(trace: &Trace, path: &Path) -> Result<()> {
    let mut sink = Sink::open(path)?;
    let titles = trace.signals.iter().map(|s| s.title());
    let header = ["sample".to_owned(), "time_s".to_owned()].into_iter();
    // Names may hold what CSV has to escape; numbers never do.
    let mut escaped = ::csv::Writer::from_writer(Vec::new());
    escaped
        .write_record(header.chain(titles))
        .map_err(|e| write_failed(path, &e.into()))?;
    let escaped = escaped.into_inner();
    sink.buffer = escaped.map_err(|e| write_failed(path, e.error()))?;
    let mut merge = Merge::new(trace);
    while let Some((sample, here)) = merge.next() {
        sink.integer(sample);
        sink.text(",");
        sink.real(sample as f64 / trace.sample_rate_hz);
        for (signal, k) in trace.signals.iter().zip(here) {
            sink.text(",");
            let Some(k) = *k else { continue };
            match &signal.values {
                Values::Integer { values, .. } => values.get(k).map(|v| sink.integer(*v)),
                Values::Real(values) => values.get(k).map(|v| sink.real(*v)),
            };
        }
        sink.text("\n");
        sink.pass_on()?;
    }
    sink.finish()
}
