//! From a file or a text to a configuration, or to everything that is wrong with it.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use toml::de::DeTable;

use super::Config;
use super::fault::{ConfigFaults, Fault};
use super::section::Section;
use super::walk::Walk;

/// The size of the largest file that is read, bytes.
pub const MAX_FILE_BYTES: usize = 1 << 20;

impl Config {
    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// Every fault of the file; or one, if it cannot be read, is larger than [`MAX_FILE_BYTES`] or is not UTF-8.
    ///
    /// ```
    /// use inekf_service::config::{Config, Model};
    ///
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("car.toml");
    /// std::fs::write(&path, "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n")?;
    /// assert_eq!(Config::load(&path)?.model, Model::Imu);
    /// // A file that is not there is one fault, with its path.
    /// let missing = Config::load(folder.path().join("boat.toml")).expect_err("not there");
    /// assert!(missing.origin.ends_with("boat.toml") && missing.faults.len() == 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn load(path: impl AsRef<Path>) -> Result<Self, ConfigFaults> {
        Ok(Self::load_with_text(path)?.0)
    }

    /// The same with the text of the file.
    ///
    /// # Errors
    ///
    /// As [`Config::load`].
    ///
    /// ```
    /// use inekf_service::config::Config;
    ///
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("car.toml");
    /// std::fs::write(&path, "model = 'imu' # mine\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n")?;
    /// // To be handed out as it was written, comments and all.
    /// assert!(Config::load_with_text(&path)?.1.contains("# mine"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn load_with_text(path: impl AsRef<Path>) -> Result<(Self, String), ConfigFaults> {
        let path = path.as_ref();
        let origin = path.display().to_string();
        let text = read_text(path).map_err(|fault| ConfigFaults::new(&origin, vec![*fault]))?;
        Ok((Self::from_toml_str(&text, &origin)?, text))
    }

    /// Reads `text`; `origin_name` is what messages call it.
    ///
    /// # Errors
    ///
    /// Every fault of the text. If it is not TOML, only what is wrong with its syntax.
    ///
    /// ```
    /// use inekf_service::config::Config;
    ///
    /// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
    /// assert!(Config::from_toml_str(text, "example").is_ok());
    /// // A syntax error comes alone, for nothing behind it can be told for certain.
    /// let faults = Config::from_toml_str("model = \n", "example").expect_err("no value");
    /// assert_eq!(faults.faults.len(), 1);
    /// ```
    pub fn from_toml_str(text: &str, origin_name: &str) -> Result<Self, ConfigFaults> {
        if text.len() > MAX_FILE_BYTES {
            return Err(ConfigFaults::new(origin_name, vec![too_large()]));
        }
        let (document, syntax_errors) = DeTable::parse_recoverable(text);
        let mut walk = Walk::new(text);
        if !syntax_errors.is_empty() {
            return Err(ConfigFaults::new(
                origin_name,
                syntax_faults(&walk, &syntax_errors),
            ));
        }
        let config = Section::document(&mut walk, Some(document.get_ref()), Self::read);
        if walk.faults.is_empty() {
            Ok(config)
        } else {
            Err(ConfigFaults::new(origin_name, walk.faults))
        }
    }
}

/// The text of the file at `path`, or why there is none.
fn read_text(path: &Path) -> Result<String, Box<Fault>> {
    let bytes = read_bounded(path).map_err(|error| Box::new(Fault::of_file(unreadable(&error))))?;
    if bytes.len() > MAX_FILE_BYTES {
        return Err(Box::new(too_large()));
    }
    String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let line = 1 + error.as_bytes()[..valid]
            .iter()
            .filter(|&&byte| byte == b'\n')
            .count();
        let problem = format!(
            "the file is not UTF-8 text: the byte at offset {valid} is not part of any character"
        );
        Box::new(Fault {
            line: Some(line),
            ..Fault::of_file(problem)
        })
    })
}

/// The bytes of the file at `path`, one more than the limit at most: devices and pipes have no size to ask for.
fn read_bounded(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?
        .take(MAX_FILE_BYTES as u64 + 1)
        .read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn unreadable(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "there is no such file".to_owned(),
        io::ErrorKind::PermissionDenied => {
            "the file cannot be read: permission denied to this user".to_owned()
        }
        io::ErrorKind::IsADirectory => "this is a directory: name a file in it".to_owned(),
        _ => format!("the file cannot be read: {error}"),
    }
}

fn too_large() -> Fault {
    Fault::of_file(format!(
        "larger than {MAX_FILE_BYTES} bytes: this is no configuration"
    ))
}

/// One fault for each line that is not TOML. The parser goes on after an error, and what else it finds on the same
/// line is mostly an echo of the first.
fn syntax_faults(walk: &Walk<'_>, errors: &[toml::de::Error]) -> Vec<Fault> {
    let mut faults: BTreeMap<usize, Fault> = BTreeMap::new();
    for error in errors {
        let start = error.span().map_or(0, |span| span.start);
        let line = walk.line(start);
        faults.entry(line).or_insert_with(|| Fault {
            line: Some(line),
            value: Some(walk.line_text(line)),
            ..Fault::of_file(format!(
                "column {}: not TOML: {}",
                walk.column(start),
                error.message()
            ))
        });
    }
    faults.into_values().collect()
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::unreadable;

    #[test]
    fn the_reason_a_file_cannot_be_read_is_said_in_plain_words() {
        let said = |kind: io::ErrorKind| unreadable(&io::Error::from(kind));
        assert!(said(io::ErrorKind::PermissionDenied).contains("permission denied"));
        assert!(said(io::ErrorKind::NotFound).contains("no such file"));
        assert!(said(io::ErrorKind::IsADirectory).contains("directory"));
        assert!(
            said(io::ErrorKind::TimedOut).contains("timed out"),
            "other reasons as the system words them"
        );
    }
}
