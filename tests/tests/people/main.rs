//! What people do with the programs beside running them: other languages, other tools' formats, looking at it, and
//! every command that the documentation prints.

mod documents;
mod exchange;
mod languages;
mod monitor;
mod supervisor;
mod two_hosts;
