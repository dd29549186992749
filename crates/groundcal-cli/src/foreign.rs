//! Pictures of a folder that do not belong to the others, and how to leave them out.

use std::path::{Path, PathBuf};

use groundcal::{geometry::ImageSize, vision::GrayImage};
use groundcal_io::{error::IoError, text::shown};

use crate::error::CliError;

/// Files that are named at most.
const NAMED: usize = 3;

/// The fault of a file, with how to leave the file out where the user named a folder or a pattern and not the file.
pub(crate) fn of_file(error: IoError, files: &[PathBuf], named: &[PathBuf]) -> CliError {
    match error {
        IoError::File { file, line, what } => {
            let culprit = files.iter().find(|f| shown(f) == file).filter(|f| !named.contains(f));
            let hint = culprit.map_or(String::new(), |f| format!(". Or leave it out: {}", exclude(f)));
            IoError::File { file, line, what: format!("{what}{hint}") }.into()
        }
        error => error.into(),
    }
}

/// Refuses images of several sizes, of which the fewest are foreign.
pub(crate) fn check_size(
    files: &[PathBuf],
    names: &[String],
    images: &[GrayImage],
    named: &[PathBuf],
) -> Result<(), CliError> {
    let sizes: Vec<ImageSize> = images.iter().map(GrayImage::size).collect();
    let count = |size: &ImageSize| sizes.iter().filter(|s| *s == size).count();
    let Some(usual) = sizes.iter().rev().max_by_key(|size| count(size)) else { return Ok(()) };
    let others: Vec<usize> = (0..sizes.len()).filter(|&i| sizes[i] != *usual).collect();
    let (Some(&first), Some(like)) = (others.first(), sizes.iter().position(|s| s == usual)) else { return Ok(()) };
    let usual_are = match sizes.len() - others.len() {
        1 => format!("{} is {usual}", names[like]),
        n => format!("{} and {} more are {usual}", names[like], n - 1),
    };
    let more =
        if others.len() > 1 { format!(" (and {} more are of other sizes)", others.len() - 1) } else { String::new() };
    // What was named is meant; and of halves neither is foreign.
    let found: Vec<&Path> =
        others.iter().map(|&i| files[i].as_path()).filter(|f| !named.iter().any(|n| n == f)).collect();
    let hint = match found.as_slice() {
        [] => String::new(),
        found if 2 * others.len() < sizes.len() && found.len() <= NAMED => {
            format!(
                ". Leave out what does not belong: {}",
                found.iter().map(|f| exclude(f)).collect::<Vec<_>>().join(" ")
            )
        }
        _ => ". Leave out what does not belong with --exclude PATTERN".into(),
    };
    Err(CliError::Input(format!(
        "{} is {} pixels{more}, {usual_are}: all images must come from one camera at one size{hint}",
        names[first], sizes[first]
    )))
}

/// The option, fit to be copied.
fn exclude(file: &Path) -> String {
    let name = file.file_name().map_or(String::new(), |n| shown(Path::new(n)));
    let literal: String =
        name.chars().map(|c| if matches!(c, '*' | '?' | '[') { format!("[{c}]") } else { c.into() }).collect();
    format!("--exclude '{literal}'")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fewest_are_foreign() {
        let image = |w: usize| GrayImage::from_rows(ImageSize::new(w, 2), vec![0.0; 2 * w]).unwrap();
        let of = |widths: &[usize], named: &[&str]| {
            let files: Vec<PathBuf> = (0..widths.len()).map(|i| format!("photos/{i}.jpg").into()).collect();
            let names: Vec<String> = (0..widths.len()).map(|i| format!("{i}.jpg")).collect();
            let images: Vec<GrayImage> = widths.iter().map(|w| image(*w)).collect();
            let named: Vec<PathBuf> = named.iter().map(PathBuf::from).collect();
            check_size(&files, &names, &images, &named).map_err(|e| e.to_string())
        };
        assert_eq!(of(&[4, 4, 4], &[]), Ok(()));
        let message = of(&[3, 4, 4, 4], &[]).unwrap_err();
        assert!(message.starts_with("0.jpg is 3x2 pixels, 1.jpg and 2 more are 4x2:"), "{message}");
        assert!(message.ends_with("--exclude '0.jpg'"), "{message}");
        assert!(!of(&[3, 4, 4, 4], &["photos/0.jpg"]).unwrap_err().contains("--exclude"));
        let message = of(&[3, 5, 4, 4], &[]).unwrap_err();
        assert!(message.contains("1 more") && message.ends_with("--exclude PATTERN"), "{message}");
    }

    #[test]
    fn names_with_letters_of_patterns_are_excluded_as_they_are() {
        assert_eq!(exclude(Path::new("a/b[1].jpg")), "--exclude 'b[[]1].jpg'");
        assert!(glob_matches("b[[]1].jpg", "b[1].jpg"));
    }

    fn glob_matches(pattern: &str, name: &str) -> bool {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(name), "").unwrap();
        let search = groundcal_io::inputs::Search { recursive: false, exclude: vec![pattern.into()] };
        groundcal_io::inputs::find_inputs_by(&[folder.path()], &search).is_err()
    }
}
