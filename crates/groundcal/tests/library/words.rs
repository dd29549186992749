//! The library names no option of any front end: its remedies are values.

use std::path::{Path, PathBuf};

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn no_options_of_the_command_line_in_the_sources() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    assert!(files.len() > 50, "{} files", files.len());
    for file in files {
        let text = std::fs::read_to_string(&file).expect("text");
        for (i, line) in text.lines().enumerate() {
            let option = line.match_indices("--").any(|(at, _)| {
                let before = line[..at].chars().next_back().unwrap_or(' ');
                let after = line[at + 2..].chars().next().unwrap_or(' ');
                after.is_ascii_lowercase() && !before.is_ascii_alphanumeric() && before != '-'
            });
            assert!(!option, "{}, line {}: {line}", file.display(), i + 1);
        }
    }
}
