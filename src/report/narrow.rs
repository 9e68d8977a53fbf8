//! Pages put together; each cell of a table carries its column's heading, so that a narrow page can show rows as lists.

use crate::error::{InputError, Result};
use askama::Template;

/// The page as HTML.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub(super) fn rendered(page: &impl Template) -> Result<String> {
    let html = page.render();
    html.map(|html| labelled(&html))
        .map_err(|e| InputError::new(format!("the report cannot be rendered: {e}")).into())
}

/// Cells of tables with headings get them as `data-label`. What a user wrote is escaped before, so that `<` begins a tag.
fn labelled(html: &str) -> String {
    let mut out = String::with_capacity(html.len() + html.len() / 8);
    let mut rest = html;
    while let Some((before, after)) = rest.split_once("<thead>") {
        let Some((head, after)) = after.split_once("</thead>") else {
            break;
        };
        let (body, after) = after.split_once("</table>").unwrap_or((after, ""));
        out.extend([before, "<thead>", head, "</thead>"]);
        cells(&mut out, body, &headings(head));
        out.push_str("</table>");
        rest = after;
    }
    out + rest
}

/// Texts of the headings, with their units in brackets.
fn headings(head: &str) -> Vec<String> {
    let cells = head.split("<th").skip(1);
    cells
        .map(|cell| {
            let text = cell.split_once('>').map_or("", |c| c.1);
            let text = text.split("</th>").next().unwrap_or("");
            let (name, small) = text.split_once("<small>").unwrap_or((text, ""));
            match small.split("</small>").next() {
                Some("") | None => without_marks(name),
                Some(unit) => without_marks(&format!("{name} ({unit})")),
            }
        })
        .collect()
}

/// A heading as an attribute can have it: no marks, a power behind `^`.
fn without_marks(text: &str) -> String {
    let text = text.replace("<sup>", "^");
    let mut parts = text.split('<');
    let first = parts.next().unwrap_or("").to_owned();
    parts.fold(first, |text, part| {
        text + part.split_once('>').map_or("", |p| p.1)
    })
}

fn cells(out: &mut String, body: &str, headings: &[String]) {
    let mut column = 0;
    let mut rest = body;
    while let Some(at) = rest.find('<') {
        let (text, tag) = rest.split_at(at);
        out.push_str(text);
        let is = |name: &str| tag.starts_with(name) && tag[name.len()..].starts_with([' ', '>']);
        let taken = if is("<tr") {
            column = 0;
            3
        } else if is("<td") || is("<th") {
            column += 1;
            3
        } else {
            1
        };
        let (start, after) = tag.split_at(taken);
        out.push_str(start);
        let heading = headings
            .get(column.max(1) - 1)
            .filter(|h| taken == 3 && column > 0 && !h.is_empty());
        if let Some(heading) = heading.filter(|_| !is("<tr")) {
            out.push_str(" data-label=\"");
            out.push_str(heading);
            out.push('"');
        }
        rest = after;
    }
    out.push_str(rest);
}

#[cfg(test)]
mod tests {
    use super::labelled;

    #[test]
    fn cells_carry_their_headings() {
        let html = "<p>a</p><table><thead><tr><th>name</th><th class=\"n\">error<small>deg/s</small></th><th></th></tr></thead>\
                    <tbody><tr class=\"x\"><th scope=\"row\">a&lt;b<small>c</small></th><td class=\"n\">1</td><td></td></tr>\
                    <tr><td>2</td></tr></tbody></table><p>b</p>";
        let out = labelled(html);
        assert!(
            out.contains("<th data-label=\"name\" scope=\"row\">a&lt;b<small>c"),
            "{out}"
        );
        assert!(out.contains("<td data-label=\"error (deg/s)\" class=\"n\">1</td><td></td>"));
        assert!(out.contains("<tr><td data-label=\"name\">2") && out.ends_with("</table><p>b</p>"));
        let plain = "<table class=\"facts\"><tbody><tr><td>1</td></tr></tbody></table>";
        assert_eq!(labelled(plain), plain);
    }
}
