//! One walk over a parsed document: what every section of it shares.
//!
//! The walk holds the text (to quote values as they were written and to number lines) and gathers two lists on its
//! way: the faults found, and the keys asked for. The second is the schema: nobody writes it down twice.

use std::ops::Range;
use std::sync::OnceLock;

use super::fault::Fault;

/// A key the reader knows, as `CONFIG.md` documents it.
///
/// ```
/// use inekf_service::config::schema;
///
/// // Every key says what it accepts.
/// assert!(schema().iter().all(|key| !key.allowed.is_empty() && !key.default.is_empty()));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct KeySpec {
    /// The header of the key's table as TOML writes it: `[initial]`, `[[position_source]]`; empty for the keys
    /// before the first table.
    pub header: String,
    /// The name of the key within its table.
    pub name: &'static str,
    /// The unit; None for a number without one and for anything that is not a number.
    pub unit: Option<&'static str>,
    /// The default as TOML writes it, or `required`, or `none`, or `varies` if it depends on other keys.
    pub default: String,
    /// What the key accepts, in words.
    pub allowed: String,
}

/// Where something stands in the document: its dotted path and the bytes it spans.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// Dotted path, with indices.
    pub(super) path: String,
    /// The bytes of the key, for its line.
    pub(super) key: Range<usize>,
    /// The bytes of the value, to quote it.
    pub(super) value: Range<usize>,
}

impl Place {
    /// The item of that index within the array that stands here.
    pub(super) fn item(&self, index: usize, span: Range<usize>) -> Self {
        Self {
            path: format!("{}[{index}]", self.path),
            key: span.clone(),
            value: span,
        }
    }
}

/// The document's text and what has been found so far.
pub(super) struct Walk<'a> {
    source: &'a str,
    line_starts: Vec<usize>,
    schema: OnceLock<Vec<KeySpec>>,
    /// The faults found so far, in the order of the walk.
    pub(super) faults: Vec<Fault>,
    /// The keys asked for so far, in the order of the walk.
    pub(super) keys: Vec<KeySpec>,
}

impl<'a> Walk<'a> {
    /// A walk over `source` that has found nothing yet.
    pub(super) fn new(source: &'a str) -> Self {
        let after_newlines = source.match_indices('\n').map(|(at, _)| at + 1);
        Self {
            source,
            line_starts: std::iter::once(0).chain(after_newlines).collect(),
            schema: OnceLock::new(),
            faults: Vec::new(),
            keys: Vec::new(),
        }
    }

    /// The line, from 1, that the byte at `offset` is on.
    pub(super) fn line(&self, offset: usize) -> usize {
        self.line_starts.partition_point(|&start| start <= offset)
    }

    /// The column, from 1 and in characters, of the byte at `offset`.
    pub(super) fn column(&self, offset: usize) -> usize {
        let start = self
            .line_starts
            .get(self.line(offset) - 1)
            .copied()
            .unwrap_or(0);
        let before = self.source.get(start..offset).unwrap_or("");
        before.chars().count() + 1
    }

    /// The text of `line` (from 1), without its newline.
    pub(super) fn line_text(&self, line: usize) -> String {
        let start = self.line_starts.get(line - 1).copied().unwrap_or(0);
        let end = self
            .line_starts
            .get(line)
            .copied()
            .unwrap_or(self.source.len());
        self.written(start..end)
    }

    /// The text of `span` as it was written, shortened to one line.
    pub(super) fn written(&self, span: Range<usize>) -> String {
        quote(self.source.get(span).unwrap_or(""))
    }

    /// Notes that the value at `place` is at fault; `spec` tells its unit and range, if those are the point.
    pub(super) fn fault(&mut self, place: &Place, problem: String, spec: Option<&KeySpec>) {
        let fault = Fault {
            key: place.path.clone(),
            line: Some(self.line(place.key.start)),
            value: Some(self.written(place.value.clone())),
            problem,
            unit: spec.and_then(|spec| spec.unit),
            allowed: spec.map(|spec| spec.allowed.clone()),
        };
        self.faults.push(fault);
    }

    /// Notes that there is nothing at `path`, in the table that begins at `start`, where there should be.
    pub(super) fn absence(
        &mut self,
        path: String,
        start: Option<usize>,
        problem: String,
        spec: Option<&KeySpec>,
    ) {
        let fault = Fault {
            key: path,
            line: start.map(|start| self.line(start)),
            value: None,
            problem,
            unit: spec.and_then(|spec| spec.unit),
            allowed: spec.map(|spec| spec.allowed.clone()),
        };
        self.faults.push(fault);
    }

    /// The table that has a key called `name`, by its header, if exactly one has.
    pub(super) fn home_of(&self, name: &str) -> Option<&str> {
        let schema = self.schema.get_or_init(super::schema);
        let mut homes = schema.iter().filter(|spec| spec.name == name);
        let home = homes.next()?;
        homes.next().is_none().then_some(home.header.as_str())
    }
}

/// `text` on one line: control characters and runs of space become one space, and what is too long is cut.
pub(super) fn quote(text: &str) -> String {
    const LIMIT: usize = 60;
    let mut quoted = String::new();
    let words = text.split(|c: char| c.is_whitespace() || c.is_control());
    for word in words.filter(|word| !word.is_empty()) {
        if !quoted.is_empty() {
            quoted.push(' ');
        }
        quoted.extend(word.chars().take(LIMIT + 1));
        if quoted.chars().count() > LIMIT {
            return quoted.chars().take(LIMIT).chain("...".chars()).collect();
        }
    }
    quoted
}

#[cfg(test)]
mod tests {
    use super::{Walk, quote};

    #[test]
    fn lines_and_columns_count_from_one() {
        let walk = Walk::new("ab\n\nµm x");
        let at = |offset| (walk.line(offset), walk.column(offset));
        assert_eq!(at(0), (1, 1));
        assert_eq!(at(2), (1, 3), "the newline belongs to its line");
        assert_eq!(at(3), (2, 1));
        assert_eq!(at(4), (3, 1));
        assert_eq!(at(6), (3, 2), "µ is two bytes, one character");
        assert_eq!(at(99).0, 3, "past the end: the last line");
    }

    #[test]
    fn a_quote_is_one_short_line() {
        assert_eq!(quote("[ 1,\n\t 2 ]\u{0}"), "[ 1, 2 ]");
        assert_eq!(quote(&"x".repeat(60)), "x".repeat(60));
        assert_eq!(quote(&"x".repeat(61)), "x".repeat(60) + "...");
        assert_eq!(quote(&"ab ".repeat(500_000)).len(), 63);
    }
}
