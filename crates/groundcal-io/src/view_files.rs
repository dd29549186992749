//! Which image file belongs to which view of a calibration.

use std::path::{Path, PathBuf};

use crate::{error::IoError, names::image_names, text::shown};

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
    let place = |image: &&str| {
        let places = folder.iter().map(|f| f.join(image)).chain([PathBuf::from(image)]);
        places.into_iter().find(|f| f.is_file())
    };
    ViewFiles { files: images.iter().map(place).collect(), others: Vec::new() }
}

/// Gives each view the file whose path ends in the view's name, or else the file of that name.
///
/// # Errors
/// [`IoError::Input`] where two files may be one view's.
pub fn match_files(images: &[&str], files: &[PathBuf]) -> Result<ViewFiles, IoError> {
    let mut taken = vec![false; files.len()];
    let mut found = Vec::with_capacity(images.len());
    for image in images {
        let name = Path::new(image);
        let mut of_view: Vec<usize> = (0..files.len()).filter(|&i| files[i].ends_with(name)).collect();
        if of_view.is_empty() {
            of_view = (0..files.len()).filter(|&i| files[i].file_name() == name.file_name()).collect();
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
        let message = match_files(&["a.jpg"], &files).unwrap_err().to_string();
        assert!(message.contains("x/a.jpg") && message.contains("y/a.jpg"), "{message}");
    }
}
