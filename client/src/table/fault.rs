//! Faults found in a file: where, what, and how to mend it.
//!
//! A reader collects faults instead of stopping at the first, so that one run shows the user
//! everything that is wrong; after [`MAX_FAULTS_PER_FILE`] it stops reading that file, because a
//! wrong delimiter makes every line faulty.

use std::fmt;

/// After this many faults in one file the reader gives that file up.
pub const MAX_FAULTS_PER_FILE: usize = 10;

/// One fault in one file.
///
/// ```
/// use inekf_client::table::Fault;
///
/// let fault = Fault::in_file("imu.csv", "'x' is no number", "write 0.1").at_line(3).at_column("gx");
/// assert_eq!(fault.to_string(), "imu.csv line 3 gx: 'x' is no number; write 0.1");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The file's name, as the user knows it (`imu.csv`).
    pub file: String,
    /// Line in the file, counted from 1; absent when the fault concerns the whole file.
    pub line: Option<u64>,
    /// Column name, or the key in `meta.json`.
    pub column: Option<String>,
    /// What is wrong, with the offending value.
    pub problem: String,
    /// What to do about it.
    pub remedy: String,
}

impl Fault {
    /// A fault that concerns the whole file.
    ///
    /// ```
    /// use inekf_client::table::Fault;
    ///
    /// let fault = Fault::in_file("imu.csv", "it is empty", "add rows");
    /// assert_eq!(fault.to_string(), "imu.csv: it is empty; add rows");
    /// ```
    pub fn in_file(file: &str, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            file: file.to_owned(),
            line: None,
            column: None,
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }

    /// The same fault, with a column or key.
    ///
    /// ```
    /// use inekf_client::table::Fault;
    ///
    /// let fault = Fault::in_file("meta.json", "it is a list", "write a name").at_column("name");
    /// assert_eq!(fault.to_string(), "meta.json name: it is a list; write a name");
    /// ```
    #[must_use]
    pub fn at_column(mut self, column: &str) -> Self {
        self.column = Some(column.to_owned());
        self
    }

    /// The same fault, with a line.
    ///
    /// ```
    /// use inekf_client::table::Fault;
    ///
    /// let fault = Fault::in_file("imu.csv", "it has 3 fields", "write 7").at_line(12);
    /// assert_eq!(fault.to_string(), "imu.csv line 12: it has 3 fields; write 7");
    /// ```
    #[must_use]
    pub fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, " line {line}")?;
        }
        if let Some(column) = &self.column {
            write!(f, " {column}")?;
        }
        write!(f, ": {}; {}", self.problem, self.remedy)
    }
}

/// All faults found, in the order in which the files were read.
///
/// `Display` is one line (the first fault and how many follow); iterate over [`list`](Self::list)
/// to show them all.
///
/// ```
/// use inekf_client::table::{Fault, Faults};
///
/// let mut faults = Faults::new();
/// assert!(faults.is_empty());
/// faults.push(Fault::in_file("imu.csv", "it is empty", "add rows"));
/// faults.push(Fault::in_file("truth.csv", "it is empty", "add rows"));
/// // One line for an error message; the list for who wants all.
/// assert_eq!(faults.to_string(), "imu.csv: it is empty; add rows (and 1 more)");
/// assert_eq!(faults.list().len(), 2);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Faults {
    list: Vec<Fault>,
}

impl Faults {
    /// No faults yet.
    ///
    /// ```
    /// use inekf_client::table::Faults;
    ///
    /// assert_eq!(Faults::new().len(), 0);
    /// ```
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds one.
    ///
    /// ```
    /// use inekf_client::table::{Fault, Faults};
    ///
    /// let mut faults = Faults::new();
    /// faults.push(Fault::in_file("imu.csv", "it is empty", "add rows"));
    /// assert_eq!(faults.to_string(), "imu.csv: it is empty; add rows");
    /// ```
    pub fn push(&mut self, fault: Fault) {
        self.list.push(fault);
    }

    /// Every fault, in the order found.
    ///
    /// ```
    /// use inekf_client::table::{Fault, Faults};
    ///
    /// let mut faults = Faults::new();
    /// faults.push(Fault::in_file("imu.csv", "it is empty", "add rows"));
    /// faults.push(Fault::in_file("truth.csv", "it is empty", "add rows"));
    /// let files: Vec<&str> = faults.list().iter().map(|fault| fault.file.as_str()).collect();
    /// assert_eq!(files, ["imu.csv", "truth.csv"]);
    /// ```
    pub fn list(&self) -> &[Fault] {
        &self.list
    }

    /// How many faults there are.
    ///
    /// ```
    /// use inekf_client::table::{Fault, Faults};
    ///
    /// let mut faults = Faults::new();
    /// faults.push(Fault::in_file("imu.csv", "it is empty", "add rows"));
    /// assert_eq!(faults.len(), 1);
    /// ```
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether nothing is wrong.
    ///
    /// ```
    /// use inekf_client::table::Faults;
    ///
    /// assert!(Faults::new().is_empty());
    /// ```
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// How many of them concern this file.
    pub(crate) fn count_in(&self, file: &str) -> usize {
        self.list.iter().filter(|fault| fault.file == file).count()
    }
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.list.as_slice() {
            [] => f.write_str("no faults"),
            [only] => write!(f, "{only}"),
            [first, rest @ ..] => write!(f, "{first} (and {} more)", rest.len()),
        }
    }
}

impl std::error::Error for Faults {}
