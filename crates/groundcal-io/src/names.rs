//! Names of images: their order, and what they are called in results.

use std::{
    cmp::Ordering,
    collections::HashMap,
    ffi::OsStr,
    path::{Path, PathBuf},
};

use crate::text::name_text;

/// Order of names in which 2 comes before 10; the order says which images are neighbours.
pub(crate) fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    let digits = |s: &str| s.len() - s.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    while let (Some(x), Some(y)) = (a_rest.chars().next(), b_rest.chars().next()) {
        let (m, n) = (digits(a_rest), digits(b_rest));
        if m > 0 && n > 0 {
            let (p, q) = (a_rest[..m].trim_start_matches('0'), b_rest[..n].trim_start_matches('0'));
            let order = p.len().cmp(&q.len()).then_with(|| p.cmp(q));
            if order != Ordering::Equal {
                return order;
            }
            (a_rest, b_rest) = (&a_rest[m..], &b_rest[n..]);
        } else if x != y {
            return x.cmp(&y);
        } else {
            (a_rest, b_rest) = (&a_rest[x.len_utf8()..], &b_rest[y.len_utf8()..]);
        }
    }
    a_rest.len().cmp(&b_rest.len()).then_with(|| a.cmp(b))
}

/// [`natural_order`] of paths; of two that read alike the bytes decide.
pub(crate) fn natural_order_of_paths(a: &Path, b: &Path) -> Ordering {
    natural_order(&a.to_string_lossy(), &b.to_string_lossy()).then_with(|| a.cmp(b))
}

/// Names by which images are known in the output: file names, or whole paths where file names repeat. Control characters and bytes
/// that are no UTF-8 are written out.
///
/// ```
/// use groundcal_io::names::image_names;
///
/// assert_eq!(image_names(&["x/1.jpg".into(), "y/2.jpg".into()]), ["1.jpg", "2.jpg"]);
/// assert_eq!(image_names(&["x/1.jpg".into(), "y/1.jpg".into()]), ["x/1.jpg", "y/1.jpg"]);
/// ```
pub fn image_names(files: &[PathBuf]) -> Vec<String> {
    let whole = |p: &PathBuf| name_text(p.as_os_str());
    let short: Vec<String> = files.iter().map(|p| p.file_name().map_or_else(|| whole(p), name_text)).collect();
    let mut count: HashMap<&str, usize> = HashMap::new();
    for name in &short {
        *count.entry(name).or_default() += 1;
    }
    files.iter().zip(&short).map(|(f, name)| if count[name.as_str()] > 1 { whole(f) } else { name.clone() }).collect()
}

/// Names for the files made of others: their stems, or whole file names where stems repeat; folders apart only by number.
pub fn stems(files: &[PathBuf]) -> Vec<String> {
    let text = |name: Option<&OsStr>| name.map_or_else(String::new, name_text);
    let mut names: Vec<String> = files.iter().map(|f| text(f.file_stem())).collect();
    for attempt in 0..2 {
        let mut count: HashMap<String, usize> = HashMap::new();
        for name in &names {
            *count.entry(name.to_lowercase()).or_default() += 1;
        }
        let mut seen: HashMap<String, usize> = HashMap::new();
        for (name, file) in names.iter_mut().zip(files) {
            if count[&name.to_lowercase()] > 1 {
                let number = seen.entry(name.to_lowercase()).or_default();
                *number += 1;
                *name =
                    if attempt == 0 { text(file.file_name()).replace('.', "_") } else { format!("{name}_{number}") };
            }
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_are_ordered_by_value() {
        let mut names = vec!["img10.jpg", "img2.jpg", "img02b.jpg", "a.jpg", "img1.jpg"];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(names, ["a.jpg", "img1.jpg", "img2.jpg", "img02b.jpg", "img10.jpg"]);
    }

    #[test]
    fn file_names_that_repeat_are_told_apart() {
        let files = [PathBuf::from("a/1.jpg"), PathBuf::from("b/1.jpg"), PathBuf::from("b/2.jpg")];
        assert_eq!(image_names(&files), ["a/1.jpg", "b/1.jpg", "2.jpg"]);
        assert_eq!(image_names(&["a/\u{1b}[2J.jpg".into()]), [r"\u{1b}[2J.jpg"]);
    }

    #[test]
    fn names_of_what_is_made_are_told_apart() {
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        assert_eq!(stems(&paths(&["x/a.jpg", "x/b.png"])), ["a", "b"]);
        assert_eq!(stems(&paths(&["x/a.jpg", "x/a.png"])), ["a_jpg", "a_png"]);
        assert_eq!(stems(&paths(&["x/a.jpg", "y/a.jpg"])), ["a_jpg_1", "a_jpg_2"]);
    }
}
