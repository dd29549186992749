//! Names of images: their order, and what they are called in results.

use std::{
    cmp::Ordering,
    collections::{HashMap, HashSet},
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

/// Names for the files made of others, without ending: their stems where only one has it, else whole file names, else numbered. No two are
/// one name in other letter case, and none is a reserved one.
///
/// ```
/// use groundcal_io::names::stems;
///
/// assert_eq!(stems(&["x/a.png".into(), "x/b.png".into()], &[]), ["a", "b"]);
/// assert_eq!(stems(&["x/a.png".into(), "y/a.png".into(), "x/a_png_1.png".into()], &[]), ["a_png_2", "a_png_3", "a_png_1"]);
/// ```
pub fn stems(files: &[PathBuf], reserved: &[&str]) -> Vec<String> {
    let text = |name: Option<&OsStr>| name.map_or_else(String::new, name_text);
    let of_stem = |f: &PathBuf| text(f.file_stem());
    let of_file = |f: &PathBuf| text(f.file_name()).replace('.', "_");
    let mut taken: HashSet<String> = reserved.iter().map(|r| r.to_lowercase()).collect();
    let mut names: Vec<Option<String>> = vec![None; files.len()];
    for candidate in [&of_stem as &dyn Fn(&PathBuf) -> String, &of_file] {
        let open: Vec<(usize, String)> =
            files.iter().enumerate().filter(|(i, _)| names[*i].is_none()).map(|(i, f)| (i, candidate(f))).collect();
        let mut count: HashMap<String, usize> = HashMap::new();
        for (_, name) in &open {
            *count.entry(name.to_lowercase()).or_default() += 1;
        }
        for (i, name) in open {
            if count[&name.to_lowercase()] == 1 && taken.insert(name.to_lowercase()) {
                names[i] = Some(name);
            }
        }
    }
    let mut numbers: HashMap<String, usize> = HashMap::new();
    let numbered = |(name, file): (Option<String>, &PathBuf)| {
        name.unwrap_or_else(|| {
            let base = of_file(file);
            let number = numbers.entry(base.to_lowercase()).or_default();
            loop {
                *number += 1;
                let name = format!("{base}_{number}");
                if taken.insert(name.to_lowercase()) {
                    return name;
                }
            }
        })
    };
    names.into_iter().zip(files).map(numbered).collect()
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
        let of = |names: &[&str]| stems(&names.iter().map(PathBuf::from).collect::<Vec<_>>(), &["map_x"]);
        assert_eq!(of(&["x/a.jpg", "x/b.png"]), ["a", "b"]);
        assert_eq!(of(&["x/a.jpg", "x/a.png"]), ["a_jpg", "a_png"]);
        assert_eq!(of(&["x/a.jpg", "y/a.jpg"]), ["a_jpg_1", "a_jpg_2"]);
        assert_eq!(of(&["x/a.jpg", "x/A.png", "x/a_JPG.png"]), ["a_jpg_1", "A_png", "a_JPG"]);
        assert_eq!(of(&["x/map_x.tiff", "x/MAP_X_TIFF.png"]), ["map_x_tiff_1", "MAP_X_TIFF"]);
        // Whatever the files are called.
        let parts = ["a", "A", "a_png", "a_png_1", "a_png_2", "a_png_1_png", "a.b"];
        let files: Vec<String> = ["x", "y", "z"]
            .iter()
            .flat_map(|f| parts.iter().flat_map(move |n| ["png", "PNG", "jpg"].map(|e| format!("{f}/{n}.{e}"))))
            .collect();
        let names = of(&files.iter().map(String::as_str).collect::<Vec<_>>());
        let apart: HashSet<String> = names.iter().map(|n| n.to_lowercase()).collect();
        assert_eq!(apart.len(), files.len());
    }
}
