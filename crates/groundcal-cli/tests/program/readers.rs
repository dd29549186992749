//! A Python with the packages of other programs' readers, in a virtual environment that is made once and kept.

use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

use crate::common::text;

/// Packages, and the modules they bring.
const PACKAGES: [(&str, &str); 5] = [
    ("numpy", "numpy"),
    ("opencv-python-headless", "cv2"),
    ("PyYAML", "yaml"),
    ("pycolmap", "pycolmap"),
    ("jsonschema", "jsonschema"),
];

fn works(program: &Path, args: &[&str]) -> Result<(), String> {
    match Command::new(program).args(args).output() {
        Ok(o) if o.status.success() => Ok(()),
        Ok(o) => Err(String::from_utf8_lossy(&o.stderr).into_owned()),
        Err(e) => Err(e.to_string()),
    }
}

fn imports(python: &Path, module: &str) -> Result<(), String> {
    works(python, &["-c", &format!("import {module}")])
}

/// The Python that has these modules; nothing, and a line why, where there is none.
pub(crate) fn python(modules: &[&str]) -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let made = PYTHON.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("readers");
        let python = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
        if works(&python, &["--version"]).is_err() {
            works(Path::new("python3"), &["-m", "venv", "--clear", &text(&folder)])?;
        }
        for (package, module) in PACKAGES {
            if imports(&python, module).is_err() {
                // What is missing in the end is seen below.
                let _ = works(&python, &["-m", "pip", "install", "-q", package]);
            }
        }
        Ok(python)
    });
    let ready = made.as_ref().map_err(String::clone).and_then(|python| {
        modules.iter().try_for_each(|module| imports(python, module))?;
        Ok(python.as_path())
    });
    match ready {
        Ok(python) => Some(python),
        Err(why) => {
            println!(
                "skipped: no Python with {} here: {}",
                modules.join(", "),
                why.trim().lines().last().unwrap_or("")
            );
            None
        }
    }
}
