//! A CSV with a header: separated by commas, semicolons or tabs; decimal points or, with the latter two, decimal commas; comments.
//!
//! Rows are not kept but read again: a table of 500 MB takes little more than itself.

use std::{
    cell::Cell,
    collections::HashMap,
    path::{Path, PathBuf},
};

use csv::StringRecord;
use groundcal::{
    geometry::ImageSize,
    pairs::{PointMatch, validated},
};

use crate::{
    error::IoError,
    file,
    limits::MAX_TABLE_BYTES,
    text::{plain, printable, quoted},
};

/// Characters of a name.
const MAX_NAME: usize = 1000;

/// A table: its header, and its lines without comments.
pub(crate) struct Table {
    path: PathBuf,
    /// Names of the columns, in their order.
    pub(crate) header: Vec<String>,
    columns: HashMap<String, usize>,
    separator: u8,
    data: String,
    /// Number in the file of each line of `data`.
    lines: Vec<u32>,
    /// First lines with a decimal point and with a decimal comma.
    point_line: Cell<Option<u64>>,
    comma_line: Cell<Option<u64>>,
}

/// A row.
pub(crate) struct Row<'a> {
    table: &'a Table,
    /// Its line in the file, from 1.
    pub(crate) line: u64,
    fields: &'a StringRecord,
}

/// A line up to a comment at its end: `#` between blanks (or at the end), outside quotation marks. Names may hold a `#`.
fn without_comment(line: &str) -> &str {
    let bytes = line.as_bytes();
    let blank = |b: Option<&u8>| b.is_none_or(|b| b.is_ascii_whitespace());
    let mut inside_quotes = false;
    for (i, b) in bytes.iter().enumerate() {
        match b {
            b'"' => inside_quotes = !inside_quotes,
            b'#' if !inside_quotes && i > 0 && blank(bytes.get(i - 1)) && blank(bytes.get(i + 1)) => {
                return line[..i].trim_end();
            }
            _ => {}
        }
    }
    line
}

/// The separator of a header: a semicolon or a tab where there is one, else a comma.
fn separator_of(header: &str) -> u8 {
    [b';', b'\t'].into_iter().find(|s| header.as_bytes().contains(s)).unwrap_or(b',')
}

/// A column's name as it is compared.
fn plain_name(name: &str) -> String {
    name.trim().to_ascii_lowercase()
}

impl Table {
    /// Reads the file and its header.
    pub(crate) fn read(path: &Path) -> Result<Self, IoError> {
        let text = file::text(path, MAX_TABLE_BYTES, "Save it as UTF-8")?;
        // Comments and blank lines go first, the lines that stay keep their numbers: the CSV reader miscounts after comments.
        let mut lines = Vec::new();
        let mut data = String::with_capacity(text.len());
        let end = if text.contains('\n') { '\n' } else { '\r' };
        let mut separator = None;
        for (number, line) in (1..).zip(text.split(end)) {
            let line = without_comment(line);
            if line.trim().is_empty() || line.trim_start().starts_with('#') {
                continue;
            }
            // Spreadsheets say the separator so.
            if lines.is_empty() && separator.is_none() && line.trim().len() == 5 && line.starts_with("sep=") {
                separator = Some(line.as_bytes()[4]);
                continue;
            }
            lines.push(number);
            data.push_str(line.trim_end_matches('\r'));
            data.push('\n');
        }
        let separator = separator.unwrap_or_else(|| separator_of(data.lines().next().unwrap_or_default()));
        let mut table = Self {
            path: path.to_path_buf(),
            header: Vec::new(),
            columns: HashMap::new(),
            separator,
            data,
            lines,
            point_line: Cell::new(None),
            comma_line: Cell::new(None),
        };
        let header = table.reader().headers().map_err(|e| table.damaged(&e))?.clone();
        for (i, name) in header.iter().enumerate() {
            table.header.push(printable(name.trim()).into_owned());
            if table.columns.insert(plain_name(name), i).is_some() && !name.is_empty() {
                return Err(table.fault(format!("the column {} is there twice. Rename or remove one", plain(name))));
            }
        }
        if table.lines.len() < 2 {
            return Err(table.fault("no rows below the header".to_string()));
        }
        Ok(table)
    }

    fn fault(&self, what: String) -> IoError {
        IoError::file(&self.path, what)
    }

    /// Whether there is a column of this name.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.columns.contains_key(name)
    }

    fn reader(&self) -> csv::Reader<&[u8]> {
        csv::ReaderBuilder::new().trim(csv::Trim::All).delimiter(self.separator).from_reader(self.data.as_bytes())
    }

    fn line_of(&self, position: Option<&csv::Position>) -> u64 {
        let kept = position.map_or(1, csv::Position::line).max(1) as usize - 1;
        self.lines.get(kept).copied().map_or(0, u64::from)
    }

    fn damaged(&self, error: &csv::Error) -> IoError {
        match error.kind() {
            csv::ErrorKind::UnequalLengths { pos, expected_len, len } => {
                let help = if self.separator == b',' && len > expected_len {
                    " (with decimal commas, separate the columns by semicolons)"
                } else {
                    ""
                };
                let what = format!(
                    "{len} fields where the header has {expected_len} fields. Correct or remove the line{help}"
                );
                IoError::line(&self.path, self.line_of(pos.as_ref()), what)
            }
            _ => IoError::line(&self.path, self.line_of(error.position()), "no row of a CSV".to_string()),
        }
    }

    /// Calls a function with each row, until one is refused.
    pub(crate) fn each(&self, mut visit: impl FnMut(Row) -> Result<(), IoError>) -> Result<(), IoError> {
        let mut reader = self.reader();
        let mut fields = StringRecord::new();
        while reader.read_record(&mut fields).map_err(|e| self.damaged(&e))? {
            visit(Row { table: self, line: self.line_of(fields.position()), fields: &fields })?;
        }
        Ok(())
    }
}

impl Row<'_> {
    /// Refuses the row.
    pub(crate) fn fault(&self, what: impl Into<String>) -> IoError {
        IoError::line(&self.table.path, self.line, what)
    }

    fn field(&self, column: &str) -> Result<&str, IoError> {
        let at = self.table.columns.get(column);
        let at = at.ok_or_else(|| self.table.fault(format!("the column {column} is missing")))?;
        Ok(self.fields.get(*at).unwrap_or_default())
    }

    /// A name, printable and not empty.
    pub(crate) fn name(&self, column: &str) -> Result<String, IoError> {
        let text = self.field(column)?;
        if text.is_empty() {
            return Err(self.fault(format!("{column} is empty. Correct or remove the line")));
        }
        if text.len() > MAX_NAME {
            return Err(self.fault(format!("{column} is a name of {} bytes, at most {MAX_NAME} are read", text.len())));
        }
        Ok(printable(text).into_owned())
    }

    pub(crate) fn number(&self, column: &str) -> Result<f64, IoError> {
        let text = self.field(column)?;
        // A comment that stands close to its `#`.
        let text = text.split_once(" #").map_or(text, |(number, _)| number.trim_end());
        let table = self.table;
        let comma = text.matches(',').count() == 1 && !text.contains('.');
        let first = |line: &Cell<Option<u64>>| line.set(line.get().or(Some(self.line)));
        let parsed = if comma {
            first(&table.comma_line);
            text.replace(',', ".").parse()
        } else {
            if text.contains('.') {
                first(&table.point_line);
            }
            text.parse::<f64>()
        };
        if let (Some(point), Some(comma)) = (table.point_line.get(), table.comma_line.get()) {
            return Err(table.fault(format!(
                "decimal points (line {point}) and commas (line {comma}): 1,234 may be 1.234 or 1234. Write all numbers with points"
            )));
        }
        parsed.ok().filter(|v| v.is_finite()).ok_or_else(|| {
            self.fault(format!(
                "{column} is {}, which is not a finite number. Correct or remove the line",
                quoted(text)
            ))
        })
    }

    /// A point, refused with its line where the library would refuse it with a number of its own.
    pub(crate) fn point(&self, columns: [&str; 2], size: ImageSize) -> Result<[f64; 2], IoError> {
        let (x, y) = (self.number(columns[0])?, self.number(columns[1])?);
        let point = PointMatch::new([x, y], [x, y]);
        if validated(&[point], size).is_err() {
            return Err(self.fault(format!(
                "({}, {}) lies far outside an image of {size} pixels. Check the line and --image-size",
                plain(&x.to_string()),
                plain(&y.to_string())
            )));
        }
        Ok([x, y])
    }

    /// Standard deviation of a coordinate; 1 where there is no column of it.
    pub(crate) fn sigma_px(&self) -> Result<f64, IoError> {
        if !self.table.has("sigma_px") {
            return Ok(1.0);
        }
        let sigma = self.number("sigma_px")?;
        if sigma > 0.0 {
            return Ok(sigma);
        }
        Err(self.fault(format!("sigma_px is {sigma}, it must be positive")))
    }
}
