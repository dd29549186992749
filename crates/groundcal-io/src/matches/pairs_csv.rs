//! `pairs.csv`: image_a,image_b.

use std::{collections::HashMap, path::Path};

use crate::{
    error::IoError,
    limits::MAX_PAIRS,
    matches::table::{Row, Table},
    text::{plain, some_of},
};

/// Names of images that a message shows.
const LISTED: usize = 12;

/// Reads a list of pairs: image_a,image_b, each a name of `names` (or the end of its path, or without its extension).
///
/// # Errors
/// [`IoError::File`] with the line at fault.
pub fn read_pairs(path: &Path, names: &[String]) -> Result<Vec<(usize, usize)>, IoError> {
    let table = Table::read(path)?;
    let mut known: HashMap<String, usize> = HashMap::new();
    for (i, name) in names.iter().enumerate() {
        known.entry(name.clone()).or_insert(i);
    }
    let mut pairs = Vec::new();
    let mut line_of: HashMap<(usize, usize), u64> = HashMap::new();
    table.each(|row| {
        let mut of = |column: &str| -> Result<usize, IoError> {
            let wanted = row.name(column)?;
            if let Some(found) = known.get(&wanted) {
                return Ok(*found);
            }
            let found = find(&row, &wanted, names)?;
            known.insert(wanted, found);
            Ok(found)
        };
        let (a, b) = (of("image_a")?, of("image_b")?);
        if a == b {
            return Err(row.fault(format!("a pair of {} with itself. Name two images", plain(&names[a]))));
        }
        if let Some(earlier) = line_of.insert((a.min(b), a.max(b)), row.line) {
            return Err(row.fault(format!(
                "{} and {} are a pair already in line {earlier}. Remove one of the lines",
                plain(&names[a]),
                plain(&names[b])
            )));
        }
        pairs.push((a, b));
        if pairs.len() > MAX_PAIRS {
            return Err(row.fault(format!("more than {MAX_PAIRS} pairs of images. Give fewer at a time")));
        }
        Ok(())
    })?;
    Ok(pairs)
}

/// The one image that a name means which is none of the names.
fn find(row: &Row, wanted: &str, names: &[String]) -> Result<usize, IoError> {
    let stem = |n: &str| Path::new(n).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let by_end = |n: &str| Path::new(n).ends_with(wanted) || Path::new(wanted).ends_with(n);
    let by_stem = |n: &str| stem(n) == wanted;
    let rules: [&dyn Fn(&str) -> bool; 2] = [&by_end, &by_stem];
    for rule in rules {
        let found: Vec<usize> = (0..names.len()).filter(|&i| rule(&names[i])).collect();
        match found.as_slice() {
            [] => {}
            [only] => return Ok(*only),
            [first, second, ..] => {
                let (first, second) = (plain(&names[*first]), plain(&names[*second]));
                return Err(row.fault(format!("{} may be {first} or {second}; write the whole name", plain(wanted))));
            }
        }
    }
    Err(row.fault(format!(
        "{} is none of the {} images. Write the names as the program does: {}",
        plain(wanted),
        names.len(),
        some_of(names.iter().map(String::as_str), LISTED)
    )))
}
