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
        if !self.has(name) {
            self.known.push(name);
            return vec![self.element(name, 0, None, read)];
        }
        let mut ids: Vec<u32> = Vec::new();
        self.tables(name, limit, |section| {
            let source = read(section);
            let id = id(&source);
            if section.is_sound("id") && ids.contains(&id) {
                let problem = format!("id {id} is taken by a table above: give each its own");
                section.contradict("id", &problem);
            }
            ids.push(id);
            source
        })
    }

    /// An array of at most `limit` tables, `[[name]]`; none by default.
    pub(in super::super) fn tables<T>(
        &mut self,
        name: &'static str,
        limit: usize,
        mut read: impl FnMut(&mut Section<'_, 'a>) -> T,
    ) -> Vec<T> {
        self.known.push(name);
        let tables = match self.entry(name) {
            None => {
                // For the schema: what such a table would hold.
                self.element(name, 0, None, read);
                return Vec::new();
            }
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
        let path = self.path_of(name);
        let mut read_so_far = Vec::new();
        for (index, item) in tables.iter().enumerate() {
            let place = Place {
                path: format!("{path}[{index}]"),
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
            let found = Some((table, item.span().start));
            read_so_far.push(self.element(name, index, found, &mut read));
        }
        read_so_far
    }

    /// Refuses the arrays of tables `names`, where they are given, without a look into them.
    pub(in super::super) fn refuse_unread(&mut self, names: &[&'static str], reason: &str) {
        self.known.extend_from_slice(names);
        self.refuse_all(names, reason);
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
}

fn holds_tables(array: &DeArray<'_>) -> bool {
    array
        .iter()
        .next()
        .is_some_and(|item| item.get_ref().is_table())
}
