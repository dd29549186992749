//! Bad inputs and what is said of them: one list, each with its exit code and words of the message.
//!
//! The files are made here ([`files`]); the list ([`list`]) is by subject. Whatever the input, the rules of [`check`] hold: no panic, no
//! control character, no name of a type of the language, no endless line; with `--json` the same error as JSON.

mod calibrations;
mod cameras;
mod files;
mod images;
mod list;
mod tables;

use std::process::{Command, Output};

use serde_json::Value;

use crate::common::files_in;
use files::Files;
use list::Case;

/// Words that stand for a fault of the program, or for the language it is written in.
const NEVER: [&str; 19] = [
    "panicked",
    ".rs:",
    "RUST_BACKTRACE",
    "f64",
    "f32",
    "usize",
    "u32",
    "u64",
    "i64",
    "struct ",
    "Some(",
    "None",
    "Ok(",
    "Err(",
    "InvalidInput",
    "InvalidOption",
    "ParseFloatError",
    "NaN px",
    "internal numerical failure",
];
/// Characters of a line of a message.
const MAX_LINE: usize = 1200;

fn run(files: &Files, case: &Case, json: bool) -> (Output, String) {
    let out = tempfile::tempdir().unwrap();
    let arguments = files.arguments(case.command, &out.path().join("out"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_groundcal"));
    command.args(arguments).current_dir(files.empty_folder()).args(json.then_some("--json"));
    let output = command.output().unwrap();
    let left = files_in(out.path());
    let of = format!("{}{}", case.command, if json { " --json" } else { "" });
    assert!(case.code == 0 || left.is_empty(), "{of} left {left:?}");
    (output, of)
}

fn check(files: &Files, case: &Case) {
    let (output, of) = run(files, case, false);
    let stdout = String::from_utf8(output.stdout).unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    let told = format!("{of}\n{stderr}{stdout}");
    assert_eq!(output.status.code(), Some(case.code), "{told}");
    if case.code != 0 {
        assert_eq!(stdout, "", "{told}");
        assert_eq!(stderr.matches("error: ").count(), 1, "one error: {told}");
    }
    // Outputs have names of this test's folder in them.
    let text = files.without_folder(&format!("{stderr}{stdout}"));
    for word in case.words {
        assert!(text.contains(word), "\"{word}\" is missing: {told}");
    }
    for word in NEVER {
        assert!(!text.contains(word), "\"{word}\": {told}");
    }
    let unseen = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
    assert!(!text.contains(unseen), "control characters: {told:?}");
    assert!(text.lines().all(|line| line.chars().count() < MAX_LINE), "endless: {told}");
    if case.code != 0 && case.has_json() {
        check_json(files, case, &stderr);
    }
}

/// The same with `--json`: the error is an object on standard output too.
fn check_json(files: &Files, case: &Case, plain: &str) {
    let (output, of) = run(files, case, true);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(case.code), "{of}\n{stderr}");
    let json: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{of}: {e}\n{stderr}"));
    let message = json["error"]["message"].as_str().unwrap_or_else(|| panic!("{of}: {json:#}"));
    assert!(stderr.ends_with(&format!("error: {message}\n")) && plain.contains(message), "{of}: {json:#}\n{stderr}");
    let code = json["error"]["code"].as_str().unwrap();
    let fits = match case.code {
        1 => code == "failed",
        2 => ["wrong_usage", "unusable_option"].contains(&code),
        4 => code == "unusable_input",
        _ => !["failed", "wrong_usage", "unusable_option", "unusable_input"].contains(&code),
    };
    assert!(fits, "{of}: {json:#}");
    let remedies = json["error"]["remedies"].as_array().unwrap();
    assert!(case.code != 3 || !remedies.is_empty(), "{of}: {json:#}");
}

#[test]
fn every_bad_input_has_its_code_and_its_words() {
    let files = Files::new();
    let cases = list::all();
    println!("{} inputs", cases.len());
    assert!(cases.len() >= 120);
    // Failures of several cases are shown together.
    let failed = std::sync::Mutex::new(Vec::new());
    let next = std::sync::atomic::AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed)) {
                    if std::panic::catch_unwind(|| check(&files, case)).is_err() {
                        failed.lock().unwrap().push(case.command);
                    }
                }
            });
        }
    });
    let failed = failed.into_inner().unwrap();
    assert!(failed.is_empty(), "{} of {} inputs: {failed:#?}", failed.len(), cases.len());
}

/// Without the kind of file that only some systems have.
#[cfg(unix)]
#[test]
fn names_that_are_no_utf8_are_names_to_every_command() {
    use std::{
        ffi::{OsStr, OsString},
        os::unix::ffi::OsStrExt,
    };
    let files = Files::new();
    let folder = tempfile::tempdir().unwrap();
    let named = |name: &[u8], like: &str| {
        let path = folder.path().join(OsStr::from_bytes(name));
        std::fs::copy(files.path(like), &path).unwrap();
        path.into_os_string()
    };
    let camera = named(b"c\xff.yaml", "good.yaml");
    let calibration = named(b"k\xff.json", "view.json");
    let text = std::fs::read_to_string(&calibration).unwrap();
    std::fs::write(&calibration, text.replace("a.png", r"a\\xff.png")).unwrap();
    let table = named(b"m\xff.csv", "good.csv");
    let image = named(b"a\xff.png", "a.png");
    let scene = named(b"s\xff.toml", "scene.toml");
    let out = |n: usize| folder.path().join(OsStr::from_bytes(format!("o{n}").as_bytes())).into_os_string();
    let absent = folder.path().join(OsStr::from_bytes(b"absent\xff\x1b[2J.png")).into_os_string();
    let word = OsString::from;
    let runs: Vec<(Vec<OsString>, i32, &str)> = vec![
        (vec![word("compare"), camera.clone(), camera.clone()], 0, r"c\xff.yaml"),
        (vec![word("convert"), camera.clone(), word("--out"), out(1)], 0, "camera_opencv.yaml"),
        (vec![word("undistort"), camera.clone(), image.clone(), word("--out"), out(2)], 0, "camera_undistorted.json"),
        (vec![word("rectify"), calibration.clone(), image.clone(), word("--out"), out(3)], 0, "_floor.png"),
        (vec![word("plan"), word("--after"), calibration.clone(), word("--motions"), word("1")], 0, "f"),
        (vec![word("render"), scene, word("--out"), out(4)], 0, ""),
        (vec![word("calibrate"), table, word("--image-size"), word("1280x960")], 0, "fx"),
        (vec![word("calibrate"), image, files.path("a.png").into()], 3, "nothing moved"),
        (vec![word("calibrate"), absent.clone()], 4, r"absent\xff\u{1b}[2J.png does not exist"),
        (vec![word("compare"), camera.clone(), absent.clone()], 4, r"absent\xff\u{1b}[2J.png: does not exist"),
        (vec![word("convert"), absent.clone(), word("--out"), out(5)], 4, r"absent\xff\u{1b}[2J.png: does not exist"),
        (vec![word("undistort"), absent.clone(), word("--maps"), word("--out"), out(5)], 4, r"absent\xff"),
        (vec![word("undistort"), camera, absent.clone(), word("--out"), out(5)], 4, r"absent\xff"),
        (vec![word("rectify"), absent.clone(), word("--out"), out(5)], 4, r"absent\xff"),
        (vec![word("rectify"), calibration, absent.clone(), word("--out"), out(5)], 4, r"absent\xff"),
        (vec![word("plan"), word("--after"), absent.clone()], 4, r"absent\xff"),
        (vec![word("render"), absent, word("--out"), out(5)], 4, r"absent\xff"),
    ];
    for (arguments, code, words) in runs {
        let output = Command::new(env!("CARGO_BIN_EXE_groundcal")).args(&arguments).output().unwrap();
        let text = String::from_utf8([output.stderr, output.stdout].concat()).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}\n{text}");
        assert!(text.contains(words.trim_end_matches(" does not exist")), "{arguments:?}: {words}\n{text}");
        assert!(!text.contains('\u{1b}'), "{text:?}");
    }
}
