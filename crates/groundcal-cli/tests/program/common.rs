//! Runs the program and looks at what it leaves behind.

use std::{
    collections::BTreeSet,
    fmt::Write,
    path::{Path, PathBuf},
    process::Command,
};

use groundcal::synthetic::PointScene;
use serde_json::Value;

/// What a run of the program gave.
pub(crate) struct Outcome {
    /// Exit code.
    pub(crate) code: i32,
    /// Standard output.
    pub(crate) stdout: String,
    /// Standard error.
    pub(crate) stderr: String,
}

impl Outcome {
    /// Standard output as JSON, of a run that has to succeed.
    pub(crate) fn json(&self) -> Value {
        assert_eq!(self.code, 0, "{}", self.stderr);
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|e| panic!("standard output is not JSON: {e}\n{}", self.stdout))
    }
}

/// The root of the repository.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A path in the repository as an argument.
pub(crate) fn at(path: &str) -> String {
    text(&root().join(path))
}

/// A path as an argument.
pub(crate) fn text(path: &Path) -> String {
    path.to_str().expect("a path in UTF-8").to_string()
}

/// `groundcal ARGS`.
pub(crate) fn groundcal<S: AsRef<str>>(args: &[S]) -> Outcome {
    let output = Command::new(env!("CARGO_BIN_EXE_groundcal"))
        .args(args.iter().map(AsRef::as_ref))
        .output()
        .expect("the program starts");
    let string = |bytes: Vec<u8>| String::from_utf8(bytes).expect("output in UTF-8");
    Outcome {
        code: output.status.code().expect("ended by itself"),
        stdout: string(output.stdout),
        stderr: string(output.stderr),
    }
}

/// `groundcal calibrate ARGS --json`.
pub(crate) fn calibrate<S: AsRef<str>>(args: &[S]) -> Outcome {
    let all: Vec<&str> = ["calibrate"].into_iter().chain(args.iter().map(AsRef::as_ref)).chain(["--json"]).collect();
    groundcal(&all)
}

/// `groundcal calibrate ARGS --json --out NEW` must end with `code`, print one message that holds all `words`, the same as JSON on
/// standard output, and write nothing.
pub(crate) fn refused<S: AsRef<str>>(args: &[S], code: i32, words: &[&str]) -> Outcome {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out");
    let mut all: Vec<String> = args.iter().map(|a| a.as_ref().to_string()).collect();
    all.extend(["--out".to_string(), text(&out)]);
    let outcome = calibrate(&all);
    assert_eq!(outcome.code, code, "exit code; stderr: {}\nstdout: {}", outcome.stderr, outcome.stdout);
    println!("{}", outcome.stderr);
    // Notes on the files may come before.
    assert_eq!(outcome.stderr.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{}", outcome.stderr);
    for word in words {
        assert!(outcome.stderr.contains(word), "\"{word}\" is missing in: {}", outcome.stderr);
    }
    // Who asks for JSON gets the error as JSON too, unless the question was not understood.
    if !outcome.stdout.is_empty() || !outcome.stderr.contains("--help") {
        let json: Value = serde_json::from_str(&outcome.stdout).expect("JSON");
        let message = json["error"]["message"].as_str().expect("a message");
        assert!(outcome.stderr.contains(message), "{message}: {}", outcome.stderr);
    }
    assert_eq!(files_in(folder.path()), BTreeSet::new(), "files are left");
    outcome
}

/// Names of everything in a folder but empty folders, with the folders inside it.
pub(crate) fn files_in(folder: &Path) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for entry in std::fs::read_dir(folder).expect("a readable folder") {
        let entry = entry.expect("a readable entry");
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().is_dir() {
            names.extend(files_in(&entry.path()).iter().map(|inner| format!("{name}/{inner}")));
        } else {
            names.insert(name);
        }
    }
    names
}

/// The list of files in every folder that runs wrote into.
pub(crate) const MANIFEST: &str = ".groundcal-manifest.json";

/// The results in a folder, which has a manifest of them.
pub(crate) fn results_in(folder: &Path) -> BTreeSet<String> {
    let mut names = files_in(folder);
    assert!(names.remove(MANIFEST), "no manifest among {names:?}");
    names
}

/// A number in the JSON, named by a pointer.
pub(crate) fn number(json: &Value, pointer: &str) -> f64 {
    json.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} is no number in {json:#}"))
}

/// A JSON file.
pub(crate) fn read_json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The motions that took part, as (from, to), in the order of the report.
pub(crate) fn used(json: &Value) -> Vec<(String, String)> {
    let name = |m: &Value, key: &str| m[key].as_str().expect("a name").to_string();
    let motions = json["motions"].as_array().expect("a list of motions").iter();
    motions.filter(|m| m["used"] == true).map(|m| (name(m, "from"), name(m, "to"))).collect()
}

/// The pairs of the first `count` attitudes of a set whose files are NNa.jpg and NNb.jpg.
pub(crate) fn a_b_pairs(count: usize) -> Vec<(String, String)> {
    (0..count).map(|i| (format!("{i:02}a.jpg"), format!("{i:02}b.jpg"))).collect()
}

/// Codes of the warnings.
pub(crate) fn warnings(json: &Value) -> Vec<&str> {
    let warnings = json["warnings"].as_array().expect("a list of warnings");
    warnings.iter().map(|w| w["code"].as_str().expect("a code")).collect()
}

/// Asserts that a camera parameter is within `tolerance` px of the truth; prints the error.
pub(crate) fn close(json: &Value, truth: &Value, parameter: &str, tolerance: f64) {
    let found = number(json, &format!("/camera/{parameter}"));
    let wanted = number(truth, &format!("/{parameter}"));
    let sigma = json["standard_deviation"][parameter].as_f64().unwrap_or(f64::NAN);
    println!("{parameter} {found:.3} +- {sigma:.3}, truth {wanted}, error {:+.3} of {tolerance:.3}", found - wanted);
    assert!((found - wanted).abs() <= tolerance, "{parameter} = {found} +- {sigma}, truth {wanted}");
}

/// A file of the given name in the folder, and its path as an argument.
pub(crate) fn write(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> String {
    let path = folder.join(name);
    std::fs::write(&path, content).expect("a writable folder");
    text(&path)
}

/// `matches.csv` of a point scene; motion i is between images mIa and mIb.
pub(crate) fn matches_csv(scene: &PointScene) -> String {
    let mut csv = "image_a,image_b,xa,ya,xb,yb,sigma_px\n".to_string();
    for (i, motion) in scene.pairs().iter().enumerate() {
        for m in &motion.matches {
            let _ = writeln!(csv, "m{i}a,m{i}b,{},{},{},{},{}", m.a.x, m.a.y, m.b.x, m.b.y, scene.sigma_px);
        }
    }
    csv
}

/// `tracks.csv` of the same points.
pub(crate) fn tracks_csv(scene: &PointScene) -> String {
    let mut csv = "image,track,x,y,sigma_px\n".to_string();
    for (i, motion) in scene.pairs().iter().enumerate() {
        for (side, second) in [("a", false), ("b", true)] {
            for (k, m) in motion.matches.iter().enumerate() {
                let p = if second { m.b } else { m.a };
                let _ = writeln!(csv, "m{i}{side},motion{i}_point{k},{},{},{}", p.x, p.y, scene.sigma_px);
            }
        }
    }
    csv
}
