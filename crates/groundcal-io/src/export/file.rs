//! One file of an export: below the formats, which make them, and their table, which collects them.

/// A file to write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    /// Its name.
    pub name: &'static str,
    /// Its content.
    pub content: String,
}

impl File {
    pub(crate) fn new(name: &'static str, content: String) -> Self {
        Self { name, content }
    }
}
