//! The reader of one table: asks for keys one by one, and notes every fault instead of stopping at the first.
//!
//! Each request names the key, its unit, its range and its default, and is the only place that does. A request
//! always answers with a usable value, the default where the document has none or a bad one: the walk goes on, and
//! the configuration is thrown away in the end if any fault was noted.

mod tables;

use std::fmt::Display;
use std::ops::RangeInclusive;

use toml::de::{DeTable, DeValue};

use super::choice::Choice;
use super::interval::Interval;
use super::suggest::nearest;
use super::walk::{KeySpec, Place, Walk, quote};

/// The default of a key that depends on other keys.
const VARIES: &str = "varies";

/// A key of the document and its value.
type Entry<'a> = (Place, &'a DeValue<'a>);

/// One table of the document, while it is read.
pub(super) struct Section<'w, 'a> {
    walk: &'w mut Walk<'a>,
    /// None if the document has no such table: every key takes its default.
    table: Option<&'a DeTable<'a>>,
    /// Dotted path of the table; empty for the whole document.
    path: String,
    /// The table's header in TOML, for the schema.
    header: String,
    /// Where the table begins, to give missing keys a line.
    start: Option<usize>,
    /// The names asked for so far.
    known: Vec<&'static str>,
}

impl<'w, 'a> Section<'w, 'a> {
    /// Reads a whole document: `table` as `read` asks for it, and the faults into `walk`. None reads a document
    /// that says nothing, not even what is required.
    pub(super) fn document<T>(
        walk: &'w mut Walk<'a>,
        table: Option<&'a DeTable<'a>>,
        read: impl FnOnce(&mut Section<'_, 'a>) -> T,
    ) -> T {
        let (path, header, known) = (String::new(), String::new(), Vec::new());
        Section {
            walk,
            table,
            path,
            header,
            start: None,
            known,
        }
        .finish(read)
    }

    /// What `read` makes of a table that says nothing: the defaults.
    pub(super) fn defaults<T>(read: impl FnOnce(&mut Section<'_, '_>) -> T) -> T {
        Section::document(&mut Walk::new(""), None, |section| read(section))
    }

    // Keys with a default ------------------------------------------------------------------------------------------

    /// A number.
    pub(super) fn float(
        &mut self,
        name: &'static str,
        unit: &'static str,
        allowed: Interval,
        default: f64,
    ) -> f64 {
        let spec = self.declare(
            name,
            Some(unit),
            format!("{default:?}"),
            allowed.to_string(),
        );
        self.read_float(&spec, allowed).unwrap_or(default)
    }

    /// A number without a unit.
    pub(super) fn ratio(&mut self, name: &'static str, allowed: Interval, default: f64) -> f64 {
        let spec = self.declare(name, None, format!("{default:?}"), allowed.to_string());
        self.read_float(&spec, allowed).unwrap_or(default)
    }

    /// Three numbers, each within `allowed`; zero by default.
    pub(super) fn vector3(
        &mut self,
        name: &'static str,
        unit: &'static str,
        allowed: Interval,
    ) -> [f64; 3] {
        let default = [0.0; 3];
        let spec = self.declare(
            name,
            Some(unit),
            format!("{default:?}"),
            each_of_three(allowed),
        );
        self.read_vector3(&spec, allowed, &[3]).unwrap_or(default)
    }

    /// A place, zero by default: as many numbers as one of `lengths` says, the rest of the three zero.
    pub(super) fn place(
        &mut self,
        name: &'static str,
        unit: &'static str,
        allowed: Interval,
        lengths: &[usize],
    ) -> [f64; 3] {
        let default = [0.0; 3];
        let range = each_of_three_or_two(allowed);
        let spec = self.declare(name, Some(unit), format!("{default:?}"), range);
        self.read_vector3(&spec, allowed, lengths)
            .unwrap_or(default)
    }

    /// A whole number.
    pub(super) fn integer<T>(
        &mut self,
        name: &'static str,
        unit: Option<&'static str>,
        allowed: RangeInclusive<T>,
        default: T,
    ) -> T
    where
        T: TryFrom<i128> + PartialOrd + Display,
    {
        let range = format!("{} to {}", allowed.start(), allowed.end());
        let spec = self.declare(name, unit, default.to_string(), range);
        self.entry(name)
            .and_then(|(place, value)| self.whole_number(&place, value, &allowed, &spec))
            .unwrap_or(default)
    }

    /// `true` or `false`.
    pub(super) fn boolean(&mut self, name: &'static str, default: bool) -> bool {
        let spec = self.declare(name, None, default.to_string(), "true or false".to_owned());
        match self.entry(name) {
            None => default,
            Some((_, DeValue::Boolean(value))) => *value,
            Some((place, value)) => self
                .mistyped(&place, "true or false", value, &spec)
                .unwrap_or(default),
        }
    }

    /// One of a few names.
    pub(super) fn choice<T: Choice + Display>(&mut self, name: &'static str, default: T) -> T {
        let spec = self.declare(name, None, format!("\"{default}\""), names_of::<T>());
        self.read_choice(&spec).unwrap_or(default)
    }

    /// One of a few names, whose default depends on other keys.
    pub(super) fn varying_choice<T: Choice>(&mut self, name: &'static str, default: T) -> T {
        let spec = self.declare(name, None, VARIES.to_owned(), names_of::<T>());
        self.read_choice(&spec).unwrap_or(default)
    }

    // Keys without a default ---------------------------------------------------------------------------------------

    /// One of a few names, which the document must give. None only if a fault was noted.
    pub(super) fn required_choice<T: Choice>(&mut self, name: &'static str) -> Option<T> {
        let spec = self.declare(name, None, "required".to_owned(), names_of::<T>());
        if !self.has(name) {
            self.missing(&spec, "required, but missing");
        }
        self.read_choice(&spec)
    }

    /// One of a few names, which may be absent.
    pub(super) fn optional_choice<T: Choice>(&mut self, name: &'static str) -> Option<T> {
        let spec = self.declare(name, None, "none".to_owned(), names_of::<T>());
        self.read_choice(&spec)
    }

    /// A number, which the document must give. None only if a fault was noted.
    pub(super) fn required_ratio(&mut self, name: &'static str, allowed: Interval) -> Option<f64> {
        let spec = self.declare(name, None, "required".to_owned(), allowed.to_string());
        if !self.has(name) {
            self.missing(&spec, "required, but missing");
        }
        self.read_float(&spec, allowed)
    }

    /// A number that may be absent.
    pub(super) fn optional_float(
        &mut self,
        name: &'static str,
        unit: Option<&'static str>,
        allowed: Interval,
    ) -> Option<f64> {
        let spec = self.declare(name, unit, "none".to_owned(), allowed.to_string());
        self.read_float(&spec, allowed)
    }

    /// A number that may be absent, and then depends on other keys.
    pub(super) fn varying_float(
        &mut self,
        name: &'static str,
        unit: Option<&'static str>,
        allowed: Interval,
    ) -> Option<f64> {
        let spec = self.declare(name, unit, VARIES.to_owned(), allowed.to_string());
        self.read_float(&spec, allowed)
    }

    /// A whole number that may be absent.
    pub(super) fn optional_integer<T>(
        &mut self,
        name: &'static str,
        allowed: RangeInclusive<T>,
    ) -> Option<T>
    where
        T: TryFrom<i128> + PartialOrd + Display,
    {
        let range = format!("{} to {}", allowed.start(), allowed.end());
        let spec = self.declare(name, None, "none".to_owned(), range);
        let (place, value) = self.entry(name)?;
        self.whole_number(&place, value, &allowed, &spec)
    }

    /// A place that may be absent: as many numbers as one of `lengths` says, the rest of the three zero.
    pub(super) fn optional_place(
        &mut self,
        name: &'static str,
        unit: &'static str,
        allowed: Interval,
        lengths: &[usize],
    ) -> Option<[f64; 3]> {
        let range = each_of_three_or_two(allowed);
        let spec = self.declare(name, Some(unit), "none".to_owned(), range);
        self.read_vector3(&spec, allowed, lengths)
    }

    /// A text that may be absent, but not empty; `allowed` says what it is.
    pub(super) fn optional_text(
        &mut self,
        name: &'static str,
        allowed: &'static str,
    ) -> Option<String> {
        let spec = self.declare(name, None, "none".to_owned(), allowed.to_owned());
        let (place, value) = self.entry(name)?;
        match value {
            DeValue::String(text) if text.is_empty() => {
                self.fault(&place, "must not be empty", &spec)
            }
            DeValue::String(text) => Some(text.clone().into_owned()),
            other => self.mistyped(&place, "a text in quotes", other, &spec),
        }
    }

    /// Two different whole numbers, which the document must give. None only if a fault was noted.
    pub(super) fn required_pair<T>(
        &mut self,
        name: &'static str,
        allowed: RangeInclusive<T>,
    ) -> Option<[T; 2]>
    where
        T: TryFrom<i128> + PartialOrd + Display,
    {
        let range = format!(
            "2 different whole numbers, each {} to {}",
            allowed.start(),
            allowed.end()
        );
        let spec = self.declare(name, None, "required".to_owned(), range);
        if !self.has(name) {
            self.missing(&spec, "required, but missing");
        }
        let (place, value) = self.entry(name)?;
        let DeValue::Array(items) = value else {
            return self.mistyped(&place, "an array of 2 whole numbers", value, &spec);
        };
        if items.len() != 2 {
            let problem = format!("must have 2 numbers, has {}", items.len());
            return self.fault(&place, &problem, &spec);
        }
        let [first, second] = [0, 1].map(|index| {
            let item = items.get(index)?;
            let place = place.item(index, item.span());
            self.whole_number(&place, item.get_ref(), &allowed, &spec)
        });
        match (first?, second?) {
            (first, second) if first == second => {
                self.fault(&place, "must be two different numbers", &spec)
            }
            (first, second) => Some([first, second]),
        }
    }

    // Relations between keys ---------------------------------------------------------------------------------------

    /// Whether the document gives `name`, with whatever value.
    pub(super) fn has(&self, name: &str) -> bool {
        self.table.is_some_and(|table| table.contains_key(name))
    }

    /// Whether no fault has been noted of `name` or of anything within it. Of a faulty key only the default is
    /// known, and what contradicts that is no further fault.
    pub(super) fn is_sound(&self, name: &str) -> bool {
        let path = self.path_of(name);
        let within = |rest: &str| rest.is_empty() || rest.starts_with(['.', '[']);
        let mut faults = self.walk.faults.iter();
        !faults.any(|fault| fault.key.strip_prefix(&*path).is_some_and(within))
    }

    /// Refuses `name`, if it is given, for a reason that lies in another key.
    pub(super) fn refuse(&mut self, name: &str, reason: &str) {
        if let Some((place, _)) = self.entry(name) {
            self.walk.fault(&place, reason.to_owned(), None);
        }
    }

    /// Refuses each of `names` that is given.
    pub(super) fn refuse_all(&mut self, names: &[&str], reason: &str) {
        for name in names {
            self.refuse(name, reason);
        }
    }

    /// Notes a fault of `name`: of its value if it is given, else of its table, whose default is at fault.
    pub(super) fn contradict(&mut self, name: &str, problem: &str) {
        match self.entry(name) {
            Some((place, _)) => self.walk.fault(&place, problem.to_owned(), None),
            None => {
                let path = self.path_of(name);
                self.walk
                    .absence(path, self.start, problem.to_owned(), None);
            }
        }
    }

    /// Refuses this whole table, if it is given, for a reason that lies elsewhere. It is then as if it were not: what
    /// else is wrong in it does not matter.
    pub(super) fn refuse_whole(&mut self, reason: &str) {
        if self.table.take().is_some() {
            let (path, reason) = (self.path.clone(), reason.to_owned());
            self.walk.absence(path, self.start, reason, None);
        }
    }

    /// Notes that `name` is missing from a table that is there; it must have been asked for.
    pub(super) fn demand(&mut self, name: &str, reason: &str) {
        let spec = self
            .walk
            .keys
            .iter()
            .rev()
            .find(|spec| spec.name == name)
            .cloned();
        if let Some(spec) = spec {
            self.missing(&spec, reason);
        }
    }

    // Within -------------------------------------------------------------------------------------------------------

    /// Reads the table with `read`, and then notes every key of it that was not asked for.
    fn finish<T>(mut self, read: impl FnOnce(&mut Section<'_, 'a>) -> T) -> T {
        let value = read(&mut self);
        for (key, item) in self.table.into_iter().flatten() {
            let name: &str = key.get_ref();
            if self.known.contains(&name) {
                continue;
            }
            let path = self.path_of(&quote(name));
            let place = Place {
                path,
                key: key.span(),
                value: item.span(),
            };
            let problem = self.unknown(name);
            self.walk.fault(&place, problem, None);
        }
        value
    }

    /// What to say about a key that this table does not have.
    fn unknown(&self, name: &str) -> String {
        if let Some(meant) = nearest(name, self.known.iter().copied()) {
            return format!("unknown key: did you mean {meant}?");
        }
        match self.walk.home_of(name) {
            Some("") => "unknown key: it belongs at the top, before the first table".to_owned(),
            Some(header) => format!("unknown key: it belongs in {header}"),
            None => "unknown key".to_owned(),
        }
    }

    /// Notes in the schema that the key exists.
    fn declare(
        &mut self,
        name: &'static str,
        unit: Option<&'static str>,
        default: String,
        allowed: String,
    ) -> KeySpec {
        let spec = KeySpec {
            header: self.header.clone(),
            name,
            unit,
            default,
            allowed,
        };
        self.known.push(name);
        self.walk.keys.push(spec.clone());
        spec
    }

    /// The key and its value, if the document has it.
    fn entry(&self, name: &str) -> Option<Entry<'a>> {
        let (key, value) = self.table?.get_key_value(name)?;
        let place = Place {
            path: self.path_of(name),
            key: key.span(),
            value: value.span(),
        };
        Some((place, value.get_ref()))
    }

    fn path_of(&self, name: &str) -> String {
        if self.path.is_empty() {
            name.to_owned()
        } else {
            format!("{}.{name}", self.path)
        }
    }

    fn read_float(&mut self, spec: &KeySpec, allowed: Interval) -> Option<f64> {
        let (place, value) = self.entry(spec.name)?;
        self.number(&place, value, allowed, spec)
    }

    /// Numbers as many as one of `lengths`, at most 3; the rest of the vector is zero.
    fn read_vector3(
        &mut self,
        spec: &KeySpec,
        allowed: Interval,
        lengths: &[usize],
    ) -> Option<[f64; 3]> {
        let (place, value) = self.entry(spec.name)?;
        let wanted: Vec<String> = lengths.iter().map(usize::to_string).collect();
        let wanted = format!("{} numbers", wanted.join(" or "));
        let DeValue::Array(items) = value else {
            return self.mistyped(&place, &format!("an array of {wanted}"), value, spec);
        };
        if !lengths.contains(&items.len()) {
            let problem = format!("must have {wanted}, has {}", items.len());
            return self.fault(&place, &problem, spec);
        }
        let mut vector = [0.0; 3];
        let mut sound = true;
        for ((index, item), slot) in items.iter().enumerate().zip(&mut vector) {
            let place = place.item(index, item.span());
            match self.number(&place, item.get_ref(), allowed, spec) {
                Some(number) => *slot = number,
                None => sound = false,
            }
        }
        sound.then_some(vector)
    }

    fn read_choice<T: Choice>(&mut self, spec: &KeySpec) -> Option<T> {
        let (place, value) = self.entry(spec.name)?;
        let DeValue::String(name) = value else {
            return self.mistyped(&place, "a name in quotes", value, spec);
        };
        if let Some((setting, _)) = T::NAMES.iter().find(|(_, known)| *known == name.as_ref()) {
            return Some(*setting);
        }
        let known = T::NAMES.iter().map(|&(_, known)| known);
        let problem = if T::NOT_BUILT.contains(&name.as_ref()) {
            "known, but not built in this version".to_owned()
        } else if let Some(meant) = nearest(name, known.chain(T::NOT_BUILT.iter().copied())) {
            format!("unknown name: did you mean \"{meant}\"?")
        } else {
            "unknown name".to_owned()
        };
        self.fault(&place, &problem, spec)
    }

    /// A finite number within `allowed`; a whole number will do.
    fn number(
        &mut self,
        place: &Place,
        value: &DeValue<'_>,
        allowed: Interval,
        spec: &KeySpec,
    ) -> Option<f64> {
        let number = match value {
            DeValue::Float(written) => written.as_str().parse().ok(),
            // Every i128 is a finite f64; what exceeds even that is out of any range here.
            DeValue::Integer(written) => i128::from_str_radix(written.as_str(), written.radix())
                .ok()
                .map(|n| n as f64),
            other => return self.mistyped(place, "a number", other, spec),
        };
        match number {
            Some(number) if allowed.contains(number) => Some(number),
            Some(number) if !number.is_finite() => self.fault(place, "not a finite number", spec),
            _ => self.fault(place, "out of range", spec),
        }
    }

    /// A whole number within `allowed`.
    fn whole_number<T>(
        &mut self,
        place: &Place,
        value: &DeValue<'_>,
        allowed: &RangeInclusive<T>,
        spec: &KeySpec,
    ) -> Option<T>
    where
        T: TryFrom<i128> + PartialOrd + Display,
    {
        let DeValue::Integer(written) = value else {
            return self.mistyped(place, "a whole number", value, spec);
        };
        let number = i128::from_str_radix(written.as_str(), written.radix()).ok();
        match number.and_then(|number| T::try_from(number).ok()) {
            Some(number) if allowed.contains(&number) => Some(number),
            _ => self.fault(place, "out of range", spec),
        }
    }

    /// Notes a fault of a value, and answers None in its place.
    fn fault<T>(&mut self, place: &Place, problem: &str, spec: &KeySpec) -> Option<T> {
        self.walk.fault(place, problem.to_owned(), Some(spec));
        None
    }

    /// Notes that a value is not of the kind that was expected, and answers None in its place.
    fn mistyped<T>(
        &mut self,
        place: &Place,
        expected: &str,
        found: &DeValue<'_>,
        spec: &KeySpec,
    ) -> Option<T> {
        self.fault(
            place,
            &format!("must be {expected}, not {}", kind_of(found)),
            spec,
        )
    }

    /// Notes that a key is missing, unless the whole table is (which is another fault, or none).
    fn missing(&mut self, spec: &KeySpec, problem: &str) {
        if self.table.is_none() {
            return;
        }
        self.walk.absence(
            self.path_of(spec.name),
            self.start,
            problem.to_owned(),
            Some(spec),
        );
    }
}

/// What a value is, with its article.
fn kind_of(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a string",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a fractional number",
        DeValue::Boolean(_) => "a boolean",
        DeValue::Datetime(_) => "a date or time",
        DeValue::Array(_) => "an array",
        DeValue::Table(_) => "a table",
    }
}

fn each_of_three(allowed: Interval) -> String {
    format!("3 numbers, each {allowed}")
}

fn each_of_three_or_two(allowed: Interval) -> String {
    format!("3 numbers (2 in the plane), each {allowed}")
}

fn names_of<T: Choice>() -> String {
    let names: Vec<String> = T::NAMES
        .iter()
        .map(|(_, name)| format!("\"{name}\""))
        .collect();
    names.join(", ")
}
