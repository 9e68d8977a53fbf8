//! The page of a closed capture: that of a record, with figures of codes.
//!
//! [`view`] goes over the rows once for each model and gathers what [`figures`] and [`spectrum`] draw and [`histogram`] expects;
//! [`words`] are the texts.

pub mod figures;
pub mod histogram;
pub mod spectrum;
pub mod view;
pub mod words;

#[cfg(test)]
mod page_tests;

use super::closure::{Own, page};
use crate::capture::Closed;
use crate::error::Result;
use view::View;

/// The report as one HTML file; `name` is that of the capture. The same codes give the same bytes.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub fn html(closed: &Closed, name: &str) -> Result<String> {
    let view = View::new(closed);
    let own = Own {
        finding: words::finding(&closed.closure),
        has_others: true,
        lead: words::lead(&closed.closure),
        steps: words::steps(&closed.closure),
        figures: figures::all(&view),
        emitted: None,
        diff: None,
        controls: None,
        last: Err(String::new()),
        provenance: words::provenance(closed),
    };
    page(&closed.closure, name, own)
}
