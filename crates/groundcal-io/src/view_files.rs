//! Which image file belongs to which view of a calibration.

use std::{
    collections::HashMap,
    ffi::OsStr,
    path::{Path, PathBuf},
};

use crate::{
    error::IoError,
    names::image_names,
    text::{name_text, shown},
};

/// Files found for views.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewFiles {
    /// For each view its file, where there is one.
    pub files: Vec<Option<PathBuf>>,
    /// Names of files that belong to no view.
    pub others: Vec<String>,
}

impl ViewFiles {
    /// Names of the views without a file.
    pub fn missing<'a>(&self, images: &[&'a str]) -> Vec<&'a str> {
        images.iter().zip(&self.files).filter(|(_, f)| f.is_none()).map(|(image, _)| *image).collect()
    }
}

/// Looks for the images of views in a folder and in the current one.
pub fn look_beside(images: &[&str], folder: Option<&Path>) -> ViewFiles {
    let folders: Vec<&Path> = folder.into_iter().chain([Path::new("")]).collect();
    // Looked at once, and only where a name asks for it.
    let any_written_out = images.iter().any(|image| image.contains('\\'));
    let listed = |f: &&Path| if any_written_out { written_out(f) } else { HashMap::new() };
    let written_out: Vec<HashMap<String, PathBuf>> = folders.iter().map(listed).collect();
    let place = |image: &&str| {
        let mut places = folders.iter().map(|f| f.join(image)).zip(&written_out);
        places.find_map(|(path, others)| if path.is_file() { Some(path) } else { others.get(*image).cloned() })
    };
    ViewFiles { files: images.iter().map(place).collect(), others: Vec::new() }
}

/// The files of a folder whose names, being no UTF-8 or having control characters, are written out (`\xff`), by what is written.
fn written_out(folder: &Path) -> HashMap<String, PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let paths = std::fs::read_dir(folder).into_iter().flatten().filter_map(|e| Some(e.ok()?.path()));
    let named = paths.filter_map(|p| Some((name_text(p.file_name()?), p)));
    named.filter(|(name, path)| path.file_name().is_some_and(|n| n != name.as_str()) && path.is_file()).collect()
}

/// Gives each view the file whose path ends in the view's name, or else the file of that name. Names are compared as they are shown.
///
/// # Errors
/// [`IoError::Input`] where two files may be one view's.
pub fn match_files(images: &[&str], files: &[PathBuf]) -> Result<ViewFiles, IoError> {
    let mut taken = vec![false; files.len()];
    let mut found = Vec::with_capacity(images.len());
    let shown_as: Vec<PathBuf> = files.iter().map(|f| name_text(f.as_os_str()).into()).collect();
    // Few of many files have a view's name.
    let mut named: HashMap<Option<&OsStr>, Vec<usize>> = HashMap::new();
    for (i, file) in shown_as.iter().enumerate() {
        named.entry(file.file_name()).or_default().push(i);
    }
    for image in images {
        let name = Path::new(image);
        let alike = named.get(&name.file_name()).map_or(&[][..], Vec::as_slice);
        let mut of_view: Vec<usize> = alike.iter().copied().filter(|&i| shown_as[i].ends_with(name)).collect();
        if of_view.is_empty() {
            of_view = alike.to_vec();
        }
        match of_view[..] {
            [] => found.push(None),
            [only] => {
                taken[only] = true;
                found.push(Some(files[only].clone()));
            }
            [first, second, ..] => {
                return Err(IoError::Input(format!(
                    "{image} may be {} or {}. Name one of them",
                    shown(&files[first]),
                    shown(&files[second])
                )));
            }
        }
    }
    let left = files.iter().zip(&taken).filter(|(_, t)| !**t);
    let others = left.flat_map(|(f, _)| image_names(std::slice::from_ref(f))).collect();
    Ok(ViewFiles { files: found, others })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_find_their_files_by_path_or_by_name() {
        let files: Vec<PathBuf> = ["x/a.jpg", "y/a.jpg", "y/b.jpg", "y/c.jpg"].map(PathBuf::from).to_vec();
        let found = match_files(&["x/a.jpg", "old/b.jpg", "d.jpg"], &files).unwrap();
        assert_eq!(found.files, [Some(files[0].clone()), Some(files[2].clone()), None]);
        assert_eq!(found.others, ["a.jpg", "c.jpg"]);
        assert_eq!(found.missing(&["x/a.jpg", "old/b.jpg", "d.jpg"]), ["d.jpg"]);
        #[cfg(unix)]
        {
            use std::os::unix::ffi::OsStrExt;
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join(OsStr::from_bytes(b"a\xff.jpg"));
            assert_eq!(match_files(&[r"a\xff.jpg"], std::slice::from_ref(&file)).unwrap().files, [Some(file.clone())]);
            std::fs::write(&file, "").unwrap();
            assert_eq!(look_beside(&[r"a\xff.jpg", "b.jpg"], Some(folder.path())).files, [Some(file), None]);
        }
        let message = match_files(&["a.jpg"], &files).unwrap_err().to_string();
        assert!(message.contains("x/a.jpg") && message.contains("y/a.jpg"), "{message}");
    }
}
