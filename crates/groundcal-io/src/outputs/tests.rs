use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use super::*;
use crate::error::IoError;

/// Everything in a folder but the manifest, with its content.
fn content(folder: &Path) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.file_type().unwrap().is_dir() {
            found.extend(content(&entry.path()).into_iter().map(|(inner, text)| (format!("{name}/{inner}"), text)));
        } else if name != MANIFEST {
            found.insert(name, fs::read_to_string(entry.path()).unwrap());
        }
    }
    found
}

fn strings(names: &[&str]) -> Vec<String> {
    names.iter().map(|n| n.to_string()).collect()
}

/// Files and what is in them.
type Files = [(&'static str, &'static str)];

fn begin(folder: &Path, command: &str, files: &Files) -> Result<Outputs, IoError> {
    let names: Vec<String> = files.iter().map(|f| f.0.to_string()).collect();
    let outputs =
        Outputs::begin(&Request { folder, command, names: &names, inputs: &[], basis: None, overwrite: false })?;
    for (name, text) in files {
        outputs.write(name, text.as_bytes())?;
    }
    Ok(outputs)
}

fn run(folder: &Path, command: &str, files: &Files) -> Result<Written, IoError> {
    begin(folder, command, files)?.commit()
}

fn as_map(files: &Files) -> BTreeMap<String, String> {
    files.iter().map(|(name, text)| (name.to_string(), text.to_string())).collect()
}

#[test]
fn a_run_broken_off_anywhere_leaves_the_old_or_the_new_and_nothing_else() {
    let old: &Files = &[("a", "old a"), ("b/1", "old b"), ("c", "old c"), ("d/gone", "old d")];
    let new: &Files = &[("a", "new a"), ("b/1", "new b"), ("b/2", "added"), ("c", "old c")];
    let others: &Files = &[("other", "of another command"), ("user.txt", "mine")];
    let (mut taken_back, mut finished) = (0, 0);
    for steps in 0.. {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("user.txt"), "mine").unwrap();
        run(folder.path(), "one", old).unwrap();
        run(folder.path(), "two", &others[..1]).unwrap();
        let outputs = begin(folder.path(), "one", new).unwrap();
        let whole = outputs.commit_up_to(Some(steps)).is_ok();
        // Whatever stands there is whole.
        for (name, text) in content(folder.path()).iter().filter(|(n, _)| !n.starts_with(".groundcal-run")) {
            let known = [old, new, others].concat();
            assert!(known.iter().any(|f| f.0 == name && f.1 == text), "{steps}: {name} {text}");
        }
        // The next run of any command finishes it or takes it back.
        let next = begin(folder.path(), "three", &[]).unwrap();
        let notes = next.notes().join("\n");
        drop(next);
        let found = content(folder.path());
        let with_others =
            |files: &Files| [as_map(files), as_map(others)].into_iter().flatten().collect::<BTreeMap<_, _>>();
        if found == with_others(old) {
            taken_back += 1;
            assert_eq!(notes, "");
        } else {
            assert_eq!(found, with_others(new), "{steps}");
            finished += usize::from(!whole);
        }
        // No empty folder stays, nor what the run worked with.
        assert!(found == with_others(old) || !folder.path().join("d").exists(), "{steps}");
        // All of it is known as ours.
        run(folder.path(), "one", old).unwrap();
        assert_eq!(content(folder.path()), with_others(old));
        if whole {
            break;
        }
    }
    // Before the journal; each move, each removal, the manifest, the journal's end and what follows it.
    assert_eq!((taken_back, finished), (1, 4 + 1 + 3 - 1 + 1));
}

#[test]
fn what_the_user_did_after_a_kill_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "one", &[("a", "old"), ("b", "old"), ("c", "old")]).unwrap();
    // Broken off when a is in place.
    begin(folder.path(), "one", &[("a", "new"), ("b", "new")]).unwrap().commit_up_to(Some(2)).unwrap_err();
    fs::write(folder.path().join("b"), "mine").unwrap();
    fs::write(folder.path().join("c"), "mine").unwrap();
    let next = begin(folder.path(), "two", &[]).unwrap();
    assert!(next.notes().join("\n").contains("b was changed meanwhile and is kept"), "{:?}", next.notes());
    drop(next);
    assert_eq!(content(folder.path()), as_map(&[("a", "new"), ("b", "mine"), ("c", "mine")]));
    let message = run(folder.path(), "one", &[("b", "newer")]).unwrap_err().to_string();
    assert!(message.contains("b would be overwritten, which no run wrote, or which was changed since"), "{message}");
}

#[test]
fn files_of_earlier_runs_are_replaced_and_others_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    run(folder.path(), "one", &[("a", "1"), ("b", "1"), ("c", "1")]).unwrap();
    run(folder.path(), "two", &[("x", "1")]).unwrap();
    fs::write(path("b"), "mine").unwrap();
    let written = run(folder.path(), "one", &[("a", "2")]).unwrap();
    assert_eq!(content(folder.path()), as_map(&[("a", "2"), ("b", "mine"), ("x", "1")]));
    let notes = written.notes.join("\n");
    assert!(notes.contains("taken away, of an earlier run: c") && notes.contains("kept: b"), "{notes}");
    // Of the same length, and a link to a file of ours.
    fs::write(path("a"), "3").unwrap();
    for name in ["a", "b"] {
        let names = strings(&[name]);
        let mut request = Request {
            folder: folder.path(),
            command: "one",
            names: &names,
            inputs: &[],
            basis: None,
            overwrite: false,
        };
        assert!(matches!(Outputs::begin(&request), Err(IoError::WouldReplace { input: false, .. })), "{name}");
        request.overwrite = true;
        drop(Outputs::begin(&request).unwrap());
    }
    assert_eq!(content(folder.path()), as_map(&[("a", "3"), ("b", "mine"), ("x", "1")]));
    fs::write(path(MANIFEST), "{").unwrap();
    let message = run(folder.path(), "two", &[("x", "2")]).unwrap_err().to_string();
    assert!(message.contains("x would be overwritten"), "{message}");
}

#[test]
fn results_of_one_basis_stay_beside_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let of = |name: &str, basis: &str| {
        let names = strings(&[name]);
        let request = Request {
            folder: folder.path(),
            command: "one",
            names: &names,
            inputs: &[],
            basis: Some(basis),
            overwrite: false,
        };
        let outputs = Outputs::begin(&request).unwrap();
        outputs.write(name, b"1").unwrap();
        outputs.commit().unwrap();
        content(folder.path()).into_keys().collect::<Vec<_>>()
    };
    assert_eq!(of("a", "camera 1"), ["a"]);
    assert_eq!(of("b", "camera 1"), ["a", "b"]);
    assert_eq!(of("c", "camera 2"), ["c"]);
}

#[cfg(unix)]
#[test]
fn inputs_are_never_replaced_whatever_they_are_called() {
    let folder = tempfile::tempdir().unwrap();
    let (photos, out) = (folder.path().join("photos"), folder.path().join("out"));
    fs::create_dir_all(&photos).unwrap();
    fs::create_dir_all(&out).unwrap();
    let photo = photos.join("a.png");
    fs::write(&photo, "photo").unwrap();
    std::os::unix::fs::symlink(&photo, out.join("link")).unwrap();
    fs::hard_link(&photo, out.join("hard")).unwrap();
    std::os::unix::fs::symlink(&photos, folder.path().join("way")).unwrap();
    for (folder_of, name) in [(out.clone(), "link"), (out, "hard"), (folder.path().join("way"), "a.png")] {
        let (names, inputs) = (strings(&[name]), [photo.clone()]);
        for overwrite in [false, true] {
            let request =
                Request { folder: &folder_of, command: "one", names: &names, inputs: &inputs, basis: None, overwrite };
            let error = Outputs::begin(&request).unwrap_err();
            assert!(matches!(error, IoError::WouldReplace { input: true, .. }), "{name}: {error}");
        }
    }
    assert_eq!(fs::read_to_string(&photo).unwrap(), "photo");
}

#[test]
fn names_and_folders_that_cannot_be_are_refused_before_anything_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |folder: &Path, names: &[&str]| {
        let names = strings(names);
        let request = Request { folder, command: "one", names: &names, inputs: &[], basis: None, overwrite: true };
        Outputs::begin(&request).unwrap_err().to_string()
    };
    let out = folder.path().join("new/out");
    assert!(refused(&out, &["a.png", "A.png"]).contains("two results"));
    for name in ["../a", "/a", "", "a/../b", MANIFEST] {
        assert!(refused(&out, &[name]).contains("is no name for a result"), "{name}");
    }
    assert!(refused(&out, &["x".repeat(300).as_str()]).contains("cannot write"));
    assert!(!folder.path().join("new").exists());
    fs::create_dir(folder.path().join("calibration.json")).unwrap();
    assert!(refused(folder.path(), &["calibration.json"]).contains("is a folder where a file"));
    fs::write(folder.path().join("tripod"), "").unwrap();
    assert!(refused(folder.path(), &["tripod/a.png"]).contains("is a file where a folder"));
    assert!(refused(&folder.path().join("tripod"), &[]).contains("is a file; name a folder"));
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("nothing", folder.path().join("link")).unwrap();
        for out in ["link", "link/out"] {
            assert!(refused(&folder.path().join(out), &[]).contains("is a link to something that does not exist"));
        }
    }
    assert!(!folder.path().join(".groundcal-run").exists());
}

#[test]
fn of_two_runs_at_once_the_second_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let first = begin(&out, "one", &[("a", "1")]).unwrap();
    let message = begin(&out, "two", &[("b", "1")]).unwrap_err().to_string();
    assert!(message.contains("another run is writing into"), "{message}");
    // It may be thrown away from another thread.
    let abandon = first.abandon();
    std::thread::spawn(move || abandon.now()).join().unwrap();
    assert!(first.write("a", b"2").is_err() && first.commit().is_err());
    assert!(!out.exists());
    run(&out, "two", &[("b", "1")]).unwrap();
}

#[test]
fn runs_that_come_and_go_at_once_leave_whole_results() {
    let folder = tempfile::tempdir().unwrap();
    let out: PathBuf = folder.path().join("out");
    let done: usize = std::thread::scope(|scope| {
        let worker = |text: &'static str| {
            let out = &out;
            scope.spawn(move || {
                let files: Vec<(&'static str, &'static str)> = vec![("a", text), ("b", text)];
                (0..40).filter(|_| run(out, "one", &files).is_ok()).count()
            })
        };
        let workers: Vec<_> = ["1", "2", "3"].into_iter().map(worker).collect();
        workers.into_iter().map(|w| w.join().unwrap()).sum()
    });
    assert!(done > 0);
    let found = content(&out);
    assert!(found.len() == 2 && found["a"] == found["b"], "{found:?}");
}
