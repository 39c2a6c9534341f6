//! CSV reader that finds columns by name and collects [`Faults`] instead of stopping at the first.
//!
//! The header line is required; order of columns, further columns, spaces around fields and a
//! byte-order mark do not matter. Every number must be finite.

use std::io::Read;

use csv::{ReaderBuilder, StringRecord};

use super::fault::{Fault, Faults, MAX_FAULTS_PER_FILE};

/// A CSV file whose header has been read.
pub(crate) struct CsvTable<R> {
    file: String,
    header: Vec<String>,
    reader: csv::Reader<R>,
}

impl<R: Read> CsvTable<R> {
    /// Reads the header. `file` is the name used in faults, `example` a header that would be right.
    pub(crate) fn open(file: &str, input: R, example: &str, faults: &mut Faults) -> Option<Self> {
        let mut reader = ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(input);
        let header: Vec<String> = match reader.headers() {
            Ok(record) => record
                .iter()
                .map(|name| name.trim_start_matches('\u{feff}').to_owned())
                .collect(),
            Err(error) => {
                faults.push(Fault::in_file(
                    file,
                    error.to_string(),
                    "write it as UTF-8 text, comma separated",
                ));
                return None;
            }
        };
        if header.iter().all(String::is_empty) {
            faults.push(Fault::in_file(
                file,
                "the file is empty",
                format!("its first line is the header `{example}`"),
            ));
            return None;
        }
        for (index, name) in header.iter().enumerate() {
            if !name.is_empty() && header[..index].contains(name) {
                let fault =
                    Fault::in_file(file, "this column occurs twice", "name every column once");
                faults.push(fault.at_line(1).at_column(name));
            }
        }
        Some(Self {
            file: file.to_owned(),
            header,
            reader,
        })
    }

    /// Whether the header names this column.
    pub(crate) fn has(&self, column: &str) -> bool {
        self.header.iter().any(|name| name == column)
    }

    /// The column names, in the file's order.
    pub(crate) fn header(&self) -> &[String] {
        &self.header
    }

    /// Whether all these columns are there; a missing one is a fault that says which header was
    /// found.
    pub(crate) fn require(&self, columns: &[&str], faults: &mut Faults) -> bool {
        let missing: Vec<&str> = columns
            .iter()
            .copied()
            .filter(|column| !self.has(column))
            .collect();
        if missing.is_empty() {
            return true;
        }
        let (plural, names) = (
            if missing.len() == 1 { "" } else { "s" },
            missing.join(", "),
        );
        let problem = format!(
            "column{plural} {names} missing, the header found is `{}`",
            self.header.join(",")
        );
        let remedy = format!("the first line has to name {}", columns.join(","));
        faults.push(Fault::in_file(&self.file, problem, remedy).at_line(1));
        false
    }

    /// Parses every row; rows with a fault are left out. Gives up after [`MAX_FAULTS_PER_FILE`]
    /// faults in this file.
    pub(crate) fn rows<T>(
        mut self,
        faults: &mut Faults,
        mut parse: impl FnMut(&mut RowReader<'_>) -> Option<T>,
    ) -> Vec<T> {
        let mut rows = Vec::new();
        let mut record = StringRecord::new();
        loop {
            if faults.count_in(&self.file) >= MAX_FAULTS_PER_FILE {
                let problem = format!("reading stopped after {MAX_FAULTS_PER_FILE} faults");
                faults.push(Fault::in_file(
                    &self.file,
                    problem,
                    "there may be more below",
                ));
                return rows;
            }
            match self.reader.read_record(&mut record) {
                Ok(false) => return rows,
                Ok(true) => {
                    let line = record.position().map_or(0, csv::Position::line);
                    if record.len() != self.header.len() {
                        let problem = format!(
                            "{} fields, but the header has {}",
                            record.len(),
                            self.header.len()
                        );
                        faults.push(
                            Fault::in_file(&self.file, problem, "give every row every column")
                                .at_line(line),
                        );
                        continue;
                    }
                    let (file, header, record) = (&self.file, &self.header, &record);
                    let mut row = RowReader {
                        file,
                        header,
                        record,
                        line,
                        faults,
                        next: 0,
                    };
                    rows.extend(parse(&mut row));
                }
                Err(error) => {
                    let line = error.position().map_or(0, csv::Position::line);
                    let fault =
                        Fault::in_file(&self.file, error.to_string(), "write it as UTF-8 text")
                            .at_line(line);
                    faults.push(fault);
                    if error.is_io_error() {
                        return rows;
                    }
                }
            }
        }
    }
}

/// One row under the header. Every getter adds a fault and returns `None` when the field is not
/// what it has to be.
pub(crate) struct RowReader<'a> {
    file: &'a str,
    header: &'a [String],
    record: &'a StringRecord,
    line: u64,
    faults: &'a mut Faults,
    /// Where the next field is looked for first: rows are mostly read from left to right.
    next: usize,
}

impl RowReader<'_> {
    /// The text of a field; empty if the column is absent or the field is.
    pub(crate) fn text(&mut self, column: &str) -> &str {
        let index = if self
            .header
            .get(self.next)
            .is_some_and(|name| name == column)
        {
            Some(self.next)
        } else {
            self.header.iter().position(|name| name == column)
        };
        let Some(index) = index else { return "" };
        self.next = index + 1;
        self.record.get(index).unwrap_or("")
    }

    /// Adds a fault at a column of this row.
    pub(crate) fn fault(
        &mut self,
        column: &str,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) {
        self.faults.push(
            Fault::in_file(self.file, problem, remedy)
                .at_line(self.line)
                .at_column(column),
        );
    }

    /// A whole number that fits `u64`: a stamp in nanoseconds.
    pub(crate) fn stamp_ns(&mut self, column: &str) -> Option<u64> {
        let stamp = self.text(column).parse().ok();
        if stamp.is_none() {
            let text = self.text(column);
            let problem = format!("`{text}` is not a whole number of nanoseconds from 0 up");
            self.fault(
                column,
                problem,
                "write the stamp as an integer, such as 1500000000 for 1.5 s",
            );
        }
        stamp
    }

    /// A stamp later than `last`, which it replaces.
    pub(crate) fn stamp_after(&mut self, column: &str, last: &mut Option<u64>) -> Option<u64> {
        let stamp = self.stamp_ns(column)?;
        if let Some(previous) = *last
            && stamp <= previous
        {
            let problem = format!("stamp {stamp} is not after {previous}, the one before");
            self.fault(
                column,
                problem,
                "sort the rows by time and leave out repeated ones",
            );
            return None;
        }
        *last = Some(stamp);
        Some(stamp)
    }

    /// A finite number.
    pub(crate) fn number(&mut self, column: &str) -> Option<f64> {
        let parsed = self.text(column).parse::<f64>();
        if let Ok(value) = parsed
            && value.is_finite()
        {
            return Some(value);
        }
        let text = self.text(column).to_owned();
        if text.is_empty() {
            self.fault(
                column,
                "the field is empty",
                "give a number, or leave the row out",
            );
        } else if parsed.is_ok() {
            self.fault(
                column,
                format!("`{text}` is not finite"),
                "leave rows without a valid measurement out",
            );
        } else {
            self.fault(
                column,
                format!("`{text}` is not a number"),
                "write a decimal such as -0.25 or 1e-3",
            );
        }
        None
    }

    /// Finite numbers from several columns; every faulty one is reported, not only the first.
    pub(crate) fn numbers<const N: usize>(&mut self, columns: [&str; N]) -> Option<[f64; N]> {
        let values = columns.map(|column| self.number(column));
        let mut numbers = [0.0; N];
        for (number, value) in numbers.iter_mut().zip(values) {
            *number = value?;
        }
        Some(numbers)
    }

    /// Standard deviations: finite, not negative.
    pub(crate) fn sigmas<const N: usize>(&mut self, columns: [&str; N]) -> Option<[f64; N]> {
        let sigmas = self.numbers(columns)?;
        let mut good = true;
        for (column, sigma) in columns.iter().zip(sigmas) {
            if sigma < 0.0 {
                self.fault(
                    column,
                    format!("{sigma:?} is negative"),
                    "a standard deviation is positive",
                );
                good = false;
            }
        }
        good.then_some(sigmas)
    }

    /// The identifier of a sensor: 0 if the column is absent or empty.
    pub(crate) fn source(&mut self) -> Option<u32> {
        let text = self.text("source").to_owned();
        if text.is_empty() {
            return Some(0);
        }
        let source = text.parse().ok();
        if source.is_none() {
            self.fault(
                "source",
                format!("`{text}` is not a source number"),
                "number the sensors 0, 1, 2, ...",
            );
        }
        source
    }

    /// Reads `columns` as a unit quaternion `[x, y, z, w]`, kept as written; a norm off 1 by over
    /// 1e-3 is a fault.
    pub(crate) fn quaternion(&mut self, columns: [&str; 4]) -> Option<[f64; 4]> {
        let q = self.numbers(columns)?;
        let norm = q.iter().map(|entry| entry * entry).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > 1e-3 {
            let problem = format!("the quaternion's norm is {norm:.6}");
            self.fault(
                columns[0],
                problem,
                "write unit quaternions (Hamilton, body to world)",
            );
            return None;
        }
        Some(q)
    }
}
