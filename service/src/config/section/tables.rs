//! Tables within a table: `[name]`, which there is once, and `[[name]]`, of which there are several.

use toml::de::{DeArray, DeTable, DeValue};

use super::super::walk::Place;
use super::{Section, kind_of};

impl<'a> Section<'_, 'a> {
    /// A table within this one.
    pub(in super::super) fn section<T>(
        &mut self,
        name: &'static str,
        read: impl FnOnce(&mut Section<'_, 'a>) -> T,
    ) -> T {
        self.known.push(name);
        let mut table = None;
        let mut start = None;
        match self.entry(name) {
            None => {}
            Some((place, DeValue::Table(found))) => {
                table = Some(found);
                start = Some(place.key.start);
            }
            Some((place, DeValue::Array(found))) if holds_tables(found) => {
                let remedy = format!("there is one such table: write [{name}] once");
                self.walk.fault(&place, remedy, None);
            }
            Some((place, other)) => {
                let problem = format!("must be a table, [{name}], not {}", kind_of(other));
                self.walk.fault(&place, problem, None);
            }
        }
        let (path, header) = (self.path_of(name), format!("[{name}]"));
        Section {
            walk: &mut *self.walk,
            table,
            path,
            header,
            start,
            known: Vec::new(),
        }
        .finish(read)
    }

    /// A table within this one that the document must have.
    pub(in super::super) fn required_section<T>(
        &mut self,
        name: &'static str,
        read: impl FnOnce(&mut Section<'_, 'a>) -> T,
    ) -> T {
        if self.table.is_some() && !self.has(name) {
            let problem = format!("the table [{name}] is required, but missing");
            self.walk.absence(self.path_of(name), None, problem, None);
        }
        self.section(name, read)
    }

    /// An array of at most `limit` tables, `[[name]]`. A document that does not mention it has one such table, with
    /// the defaults. `id` tells the tables apart: no two may have the same.
    pub(in super::super) fn sources<T>(
        &mut self,
        name: &'static str,
        limit: usize,
        read: impl Fn(&mut Section<'_, 'a>) -> T,
        id: impl Fn(&T) -> u32,
    ) -> Vec<T> {
        self.known.push(name);
        let tables = match self.entry(name) {
            None => return vec![self.element(name, 0, None, &read)],
            Some((_, DeValue::Array(tables))) => tables,
            Some((place, other)) => {
                let (found, remedy) = (kind_of(other), format!("write [[{name}]]"));
                self.walk.fault(
                    &place,
                    format!("must be an array of tables, not {found}: {remedy}"),
                    None,
                );
                return Vec::new();
            }
        };
        let mut sources: Vec<T> = Vec::new();
        for (index, item) in tables.iter().enumerate() {
            let path = format!("{}[{index}]", self.path_of(name));
            let place = Place {
                path,
                key: item.span(),
                value: item.span(),
            };
            if index == limit {
                let problem = format!("{} tables, but at most {limit} are possible", tables.len());
                self.walk.fault(&place, problem, None);
                break;
            }
            let DeValue::Table(table) = item.get_ref() else {
                let problem = format!("must be a table, not {}", kind_of(item.get_ref()));
                self.walk.fault(&place, problem, None);
                continue;
            };
            let known_faults = self.walk.faults.len();
            let source = self.element(name, index, Some((table, item.span().start)), &read);
            let id_path = format!("{}.id", place.path);
            let bad_id = self.walk.faults[known_faults..]
                .iter()
                .any(|fault| fault.key == id_path);
            if !bad_id && sources.iter().any(|other| id(other) == id(&source)) {
                self.duplicate_id(id_path, &place, table, id(&source));
            }
            if !bad_id {
                sources.push(source);
            }
        }
        sources
    }

    /// Reads one table of an array.
    fn element<T>(
        &mut self,
        name: &'static str,
        index: usize,
        found: Option<(&'a DeTable<'a>, usize)>,
        read: impl FnOnce(&mut Section<'_, 'a>) -> T,
    ) -> T {
        let path = format!("{}[{index}]", self.path_of(name));
        let (header, known) = (format!("[[{name}]]"), Vec::new());
        let (table, start) = found.unzip();
        Section {
            walk: &mut *self.walk,
            table,
            path,
            header,
            start,
            known,
        }
        .finish(read)
    }

    /// Notes that the table at `place` has an id that another one has.
    fn duplicate_id(&mut self, path: String, place: &Place, table: &'a DeTable<'a>, id: u32) {
        let problem = format!("id {id} is taken by a table above: give each its own");
        match table.get_key_value("id") {
            Some((key, value)) => {
                let place = Place {
                    path,
                    key: key.span(),
                    value: value.span(),
                };
                self.walk.fault(&place, problem, None);
            }
            None => self
                .walk
                .absence(path, Some(place.key.start), problem, None),
        }
    }
}

fn holds_tables(array: &DeArray<'_>) -> bool {
    array
        .iter()
        .next()
        .is_some_and(|item| item.get_ref().is_table())
}
