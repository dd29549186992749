//! What the user names: images, folders, patterns, a CSV.

use std::{
    collections::HashSet,
    ffi::OsStr,
    path::{Path, PathBuf},
};

use glob::Pattern;

use crate::{
    error::IoError,
    names::natural_order_of_paths,
    text::{plain, shown},
};

/// File name endings taken for images in a folder.
const IMAGE_EXTENSIONS: [&str; 9] = ["jpg", "jpeg", "png", "tif", "tiff", "webp", "heic", "heif", "avif"];
/// Raw images: taken where a folder has no others, since cameras write them beside a JPEG of the same picture.
const RAW_EXTENSIONS: [&str; 8] = ["dng", "cr2", "cr3", "nef", "arw", "raf", "orf", "rw2"];

/// What the inputs turned out to be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Inputs {
    /// Image files, in order.
    Images(Vec<PathBuf>),
    /// One CSV of matches or tracks.
    Csv(PathBuf),
}

/// How folders and patterns are searched.
#[derive(Debug, Clone, Default)]
pub struct Search {
    /// Whether the folders in a folder are searched too.
    pub recursive: bool,
    /// Patterns of files to be left out of folders and of what patterns match: of names, or of paths where they have a `/`.
    pub exclude: Vec<String>,
}

/// Folders inside each other, at most: more is a mistake.
const MAX_DEPTH: usize = 64;

impl Search {
    /// The patterns, understood.
    fn excluded(&self) -> Result<Vec<(Pattern, bool)>, IoError> {
        let understood = |text: &String| {
            let wrong =
                |e: glob::PatternError| IoError::Usage(format!("{} is not a valid pattern: {}", plain(text), e.msg));
            // `train/` leaves out all that is in a folder of this name.
            let text = if text.ends_with('/') { format!("{text}**") } else { text.clone() };
            let whole = text.contains('/');
            let text = if whole && !text.starts_with('/') { format!("**/{text}") } else { text };
            Pattern::new(&text).map(|pattern| (pattern, whole)).map_err(wrong)
        };
        self.exclude.iter().map(understood).collect()
    }
}

/// Folders, patterns and files to a list of files: those of a folder or a pattern in natural order, a file named twice once.
///
/// # Errors
/// [`IoError::File`] where one does not exist or holds no image, [`IoError::Usage`] for a CSV among others.
pub fn find_inputs(inputs: &[impl AsRef<OsStr>]) -> Result<Inputs, IoError> {
    find_inputs_by(inputs, &Search::default())
}

/// The same, with folders in folders, or without some files. Files that are named one by one are taken in any case.
///
/// # Errors
/// As [`find_inputs`]; [`IoError::Usage`] for a pattern that is none, [`IoError::Input`] where everything is left out.
pub fn find_inputs_by(inputs: &[impl AsRef<OsStr>], search: &Search) -> Result<Inputs, IoError> {
    let excluded = search.excluded()?;
    let kept = |files: Vec<PathBuf>, from: &Path| -> Result<Vec<PathBuf>, IoError> {
        let found = files.len();
        let is_out =
            |path: &PathBuf| {
                let name = path.file_name().unwrap_or_default();
                excluded.iter().any(|(pattern, whole)| {
                    if *whole { pattern.matches_path(path) } else { pattern.matches_path(Path::new(name)) }
                })
            };
        let kept: Vec<PathBuf> = files.into_iter().filter(|f| !is_out(f)).collect();
        if kept.is_empty() && found > 0 {
            return Err(IoError::Input(format!("{}: all of its {found} images are excluded", shown(from))));
        }
        Ok(kept)
    };
    let mut files: Vec<PathBuf> = Vec::new();
    for input in inputs {
        let path = Path::new(input);
        let pattern = input.as_ref().to_str().filter(|text| text.contains(['*', '?', '[']));
        if path.is_dir() {
            let found = if search.recursive { images_below(path)? } else { images_in(path)? };
            files.extend(kept(found, path)?);
        } else if path.exists() {
            files.push(path.to_path_buf());
        } else if let Some(pattern) = pattern {
            files.extend(kept(matching(pattern)?, path)?);
        } else {
            // Says why it is not there.
            crate::file::check_is_file(path)?;
        }
    }
    let is_csv = |p: &PathBuf| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    match files.as_slice() {
        [only] if is_csv(only) => Ok(Inputs::Csv(only.clone())),
        _ if files.iter().any(is_csv) => {
            Err(IoError::Usage("a CSV of matches or tracks is given alone, not together with other inputs".into()))
        }
        _ => {
            // One file under two spellings is one file.
            let mut seen = HashSet::new();
            files.retain(|f| seen.insert(f.canonicalize().unwrap_or_else(|_| f.clone())));
            Ok(Inputs::Images(files))
        }
    }
}

/// The image files that the inputs (files, folders, patterns) name.
///
/// # Errors
/// As [`find_inputs`]; a CSV is refused too.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # for name in ["10.jpg", "9.jpg", "notes.txt"] { std::fs::write(folder.path().join(name), "")?; }
/// let files = groundcal_io::inputs::find_images(&[folder.path()])?;
/// assert!(files[0].ends_with("9.jpg") && files[1].ends_with("10.jpg") && files.len() == 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn find_images(inputs: &[impl AsRef<OsStr>]) -> Result<Vec<PathBuf>, IoError> {
    match find_inputs(inputs)? {
        Inputs::Images(files) => Ok(files),
        Inputs::Csv(path) => Err(IoError::Usage(format!("{} is a CSV; name images or a folder of them", shown(&path)))),
    }
}

fn matching(pattern: &str) -> Result<Vec<PathBuf>, IoError> {
    let paths = glob::glob(pattern)
        .map_err(|e| IoError::Usage(format!("{} is not a valid pattern: {}", plain(pattern), e.msg)))?;
    let mut found: Vec<PathBuf> = paths.filter_map(Result::ok).filter(|p| p.is_file()).collect();
    if found.is_empty() {
        return Err(IoError::Input(format!(
            "no file matches {}. Check the pattern (quote it: 'photos/*.jpg')",
            plain(pattern)
        )));
    }
    found.sort_by(|a, b| natural_order_of_paths(a, b));
    Ok(found)
}

/// The image files of a folder and of the folders in it, but for hidden ones.
fn images_below(folder: &Path) -> Result<Vec<PathBuf>, IoError> {
    let cannot =
        |folder: &Path, e: std::io::Error| IoError::Input(format!("cannot read the folder {}: {e}", shown(folder)));
    // Links may lead back.
    let (mut seen, mut found) = (HashSet::new(), Vec::new());
    let mut folders = vec![(folder.to_path_buf(), 0)];
    while let Some((folder, depth)) = folders.pop() {
        if !seen.insert(folder.canonicalize().map_err(|e| cannot(&folder, e))?) || depth > MAX_DEPTH {
            continue;
        }
        for entry in std::fs::read_dir(&folder).map_err(|e| cannot(&folder, e))? {
            let path = entry.map_err(|e| cannot(&folder, e))?.path();
            let hidden = path.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"."));
            if path.is_dir() && !hidden {
                folders.push((path, depth + 1));
            }
        }
        if let Ok(images) = images_in(&folder) {
            found.extend(images);
        }
    }
    if found.is_empty() {
        return Err(IoError::Input(format!(
            "no images in the folder {} or the folders in it. Images end in .{}",
            shown(folder),
            IMAGE_EXTENSIONS.join(", .")
        )));
    }
    found.sort_by(|a, b| natural_order_of_paths(a, b));
    Ok(found)
}

/// The image files of a folder, in natural order.
pub(crate) fn images_in(folder: &Path) -> Result<Vec<PathBuf>, IoError> {
    let cannot = |e: std::io::Error| IoError::Input(format!("cannot read the folder {}: {e}", shown(folder)));
    let (mut found, mut raw, mut others) = (Vec::new(), Vec::new(), 0);
    for entry in std::fs::read_dir(folder).map_err(cannot)? {
        let path = entry.map_err(cannot)?.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let hidden = path.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"."));
        let file = path.is_file() && !hidden;
        if file && IMAGE_EXTENSIONS.contains(&extension.as_str()) {
            found.push(path);
        } else if file && RAW_EXTENSIONS.contains(&extension.as_str()) {
            raw.push(path);
        } else {
            others += 1;
        }
    }
    if found.is_empty() {
        found = raw;
    }
    if found.is_empty() {
        return Err(IoError::Input(format!(
            "no images in the folder {} ({others} other entries). Images end in .{}; folders inside it are searched with --recursive",
            shown(folder),
            IMAGE_EXTENSIONS.join(", .")
        )));
    }
    found.sort_by(|a, b| natural_order_of_paths(a, b));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raw_images_beside_others_are_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let touch = |name: &str| std::fs::write(folder.path().join(name), "").unwrap();
        touch("1.DNG");
        assert_eq!(find_images(&[folder.path()]).unwrap().len(), 1);
        touch("1.jpg");
        let found = find_images(&[folder.path()]).unwrap();
        assert!(found.len() == 1 && found[0].ends_with("1.jpg"), "{found:?}");
    }

    #[test]
    fn folders_in_folders_are_searched_and_files_left_out() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.jpg", "a/2.jpg", "a/10.jpg", "a/thumb_2.jpg", "a/deep/c.png", ".hidden/d.jpg", "notes/x.txt"] {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink(folder.path(), folder.path().join("a/loop")).unwrap();
        let of = |recursive: bool, exclude: &[&str]| {
            let search = Search { recursive, exclude: exclude.iter().map(|e| e.to_string()).collect() };
            match find_inputs_by(&[folder.path()], &search) {
                Ok(Inputs::Images(files)) => {
                    let name = |f: &PathBuf| f.strip_prefix(folder.path()).unwrap().to_str().unwrap().to_string();
                    Ok(files.iter().map(name).collect::<Vec<_>>())
                }
                Ok(other) => panic!("{other:?}"),
                Err(e) => Err(e.to_string()),
            }
        };
        assert_eq!(of(false, &[]).unwrap(), ["b.jpg"]);
        assert_eq!(of(true, &[]).unwrap(), ["a/2.jpg", "a/10.jpg", "a/deep/c.png", "a/thumb_2.jpg", "b.jpg"]);
        assert_eq!(of(true, &["thumb_*", "*.png"]).unwrap(), ["a/2.jpg", "a/10.jpg", "b.jpg"]);
        assert_eq!(of(true, &["a/"]).unwrap(), ["b.jpg"]);
        assert_eq!(of(true, &["a/deep/*"]).unwrap(), ["a/2.jpg", "a/10.jpg", "a/thumb_2.jpg", "b.jpg"]);
        assert!(of(false, &["*"]).unwrap_err().contains("all of its 1 images are excluded"));
        assert!(of(false, &["[a"]).unwrap_err().contains("not a valid pattern"));
        // A file named by itself is wanted.
        let file = folder.path().join("b.jpg");
        let search = Search { recursive: false, exclude: vec!["*".into()] };
        assert_eq!(find_inputs_by(&[&file], &search).unwrap(), Inputs::Images(vec![file]));
    }

    #[test]
    fn what_is_not_there_is_said() {
        let message = find_images(&["no/such\u{1b}]folder"]).unwrap_err().to_string();
        assert!(message.contains("does not exist") && !message.contains('\u{1b}'), "{message}");
        assert!(find_images(&["no/such/*.jpg"]).unwrap_err().to_string().contains("no file matches"));
        assert!(find_images(&["no/such/[.jpg"]).unwrap_err().to_string().contains("not a valid pattern"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_name_that_is_no_utf8_is_a_name() {
        use std::os::unix::ffi::OsStrExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(OsStr::from_bytes(b"a\xff.jpg"));
        std::fs::write(&path, "").unwrap();
        assert_eq!(find_images(&[folder.path()]).unwrap(), std::slice::from_ref(&path));
        assert_eq!(find_images(&[&path]).unwrap(), [path]);
    }
}
