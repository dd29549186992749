//! How the crates are built: no circles between the files of a crate, and nothing done where it must not be.
//!
//! A file uses another where a `use` or a path in its code leads there. Its own unit tests do not count.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use crate::common::root;

/// Module path to file, of the Rust files under a folder.
type Modules = BTreeMap<Vec<String>, PathBuf>;

/// Modules, each with others that it uses.
type Uses<'a> = BTreeMap<&'a [String], BTreeSet<&'a [String]>>;

fn crates() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(root().join("crates")).unwrap().map(|e| e.unwrap().path().join("src"));
    let mut found: Vec<PathBuf> = entries.filter(|p| p.is_dir()).collect();
    found.sort();
    found
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            // Unit tests that have files of their own.
            if !path.ends_with("tests") {
                rust_files(&path, found);
            }
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

fn modules(source: &Path) -> Modules {
    let mut files = Vec::new();
    rust_files(source, &mut files);
    let name = |file: PathBuf| {
        let inside = file.strip_prefix(source).unwrap().with_extension("");
        let mut path: Vec<String> = inside.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        if path.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
            path.pop();
        }
        (path, file)
    };
    files.into_iter().map(name).collect()
}

/// The code of a file without comments and unit tests.
fn code(file: &Path) -> String {
    let text = std::fs::read_to_string(file).unwrap().replace("\r\n", "\n");
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    text.lines().map(|line| line.split("//").next().unwrap().to_string() + "\n").collect()
}

/// All paths of a `use` tree.
fn expand(tree: &str, before: &[String], found: &mut Vec<Vec<String>>) {
    let (mut depth, mut start) = (0, 0);
    let mut parts = Vec::new();
    for (i, c) in tree.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&tree[start..i]);
                start = i + 1;
            }
            _ => {}
        }
    }
    parts.push(&tree[start..]);
    for part in parts.into_iter().map(str::trim).filter(|p| !p.is_empty()) {
        let (head, group) = part.split_once('{').map_or((part, None), |(h, g)| (h, Some(g.trim_end_matches('}'))));
        let head = head.split(" as ").next().unwrap();
        let names = head.split("::").map(str::trim).filter(|n| !n.is_empty()).map(String::from);
        let path: Vec<String> = before.iter().cloned().chain(names).collect();
        match group {
            // One brace too many may have been cut off.
            Some(_) => expand(&part[part.find('{').unwrap() + 1..part.rfind('}').unwrap()], &path, found),
            None => found.push(path),
        }
    }
}

/// The paths of `use` lines, and every `a::b` in the rest of the code.
fn paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let mut rest = String::new();
    let mut tree: Option<String> = None;
    for line in code.lines() {
        let trimmed = line.trim();
        let after_pub = trimmed.strip_prefix("pub").map_or(trimmed, |r| r.split_once(' ').map_or("", |(_, r)| r));
        match (&mut tree, after_pub.strip_prefix("use ")) {
            (Some(open), _) => open.push_str(trimmed),
            (None, Some(begun)) => tree = Some(begun.to_string()),
            (None, None) => rest.push_str(&format!("{line}\n")),
        }
        if tree.as_ref().is_some_and(|t| t.ends_with(';')) {
            expand(tree.take().unwrap().trim_end_matches(';'), &[], &mut found);
        }
    }
    let of_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let words = rest.split(|c| !of_path(c)).filter(|w| w.contains("::") && !w.starts_with(':'));
    found.extend(words.map(|w| w.split("::").map(String::from).collect()));
    found
}

/// Of each module the modules it uses.
fn uses(modules: &Modules) -> Uses<'_> {
    let of_file = |(own, file): (&'_ Vec<String>, &PathBuf)| -> Vec<Vec<String>> {
        let absolute = |path: Vec<String>| {
            let ups = path.iter().take_while(|p| *p == "super").count();
            let child = |name: &String| modules.contains_key(&[own.as_slice(), std::slice::from_ref(name)].concat());
            match path[0].as_str() {
                "crate" => Some(path[1..].to_vec()),
                "self" => Some([own, &path[1..]].concat()),
                "super" => Some([&own[..own.len().checked_sub(ups)?], &path[ups..]].concat()),
                _ if child(&path[0]) => Some([own.as_slice(), &path].concat()),
                _ => None,
            }
        };
        paths(&code(file)).into_iter().filter_map(absolute).collect()
    };
    let nearest = |path: &[String]| {
        let prefixes = (1..=path.len()).rev().map(|n| &path[..n]);
        prefixes.filter_map(|p| modules.get_key_value(p)).map(|(module, _)| module.as_slice()).next()
    };
    modules
        .iter()
        .map(|(own, file)| {
            let all = of_file((own, file));
            let used = all.iter().filter_map(|p| nearest(p)).filter(|m| *m != own.as_slice()).collect();
            (own.as_slice(), used)
        })
        .collect()
}

/// The modules reached from one.
fn reached<'a>(uses: &Uses<'a>, from: &'a [String]) -> BTreeSet<&'a [String]> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(at) = open.pop() {
        open.extend(uses[at].iter().copied().filter(|next| seen.insert(*next)));
    }
    seen
}

/// Modules that lead back to themselves, with those on the way.
fn circles(modules: &Modules) -> BTreeSet<Vec<String>> {
    let uses = uses(modules);
    let all: Uses = uses.keys().map(|m| (*m, reached(&uses, m))).collect();
    let in_circle = all.keys().filter(|m| all[*m].contains(*m));
    in_circle
        .map(|m| {
            let back = all[m].iter().filter(|other| all[*other].contains(m));
            back.map(|other| other.join("::")).collect()
        })
        .collect()
}

#[test]
fn files_of_a_crate_use_each_other_in_one_direction() {
    let mut found = String::new();
    for source in crates() {
        for circle in circles(&modules(&source)) {
            found += &format!("{}: {}\n", source.display(), circle.join(", "));
        }
    }
    assert!(found.is_empty(), "circles between files; put what both need into a file below them:\n{found}");
}

#[test]
fn circles_are_seen() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("lib.rs", "mod a;\nmod b;\npub use a::A;\n");
    write("a.rs", "use crate::{\n    b::{self, B as Other},\n};\npub struct A;\n");
    write("b.rs", "pub struct B;\n#[cfg(test)]\nmod tests {\n    use crate::a::A;\n}\n");
    assert_eq!(circles(&modules(folder.path())), BTreeSet::new());
    write("b.rs", "// crate::a::A\npub struct B(pub super::a::A);\n");
    assert_eq!(circles(&modules(folder.path())), BTreeSet::from([vec!["a".to_string(), "b".to_string()]]));
}

#[test]
fn only_the_program_prints_and_pure_crates_open_no_files() {
    let printing = ["println!", "print!(", "eprintln!", "eprint!(", "dbg!", "io::stdout", "io::stderr"];
    let opening = ["std::fs", "fs::", "File::", "std::env", "std::process", "std::net"];
    let mut found = String::new();
    for source in crates() {
        let name = source.parent().unwrap().file_name().unwrap().to_string_lossy().into_owned();
        let forbidden: Vec<&str> = match name.as_str() {
            "groundcal-cli" | "groundcal-fuzz" => continue,
            "groundcal" | "groundcal-report" => printing.into_iter().chain(opening).collect(),
            _ => printing.to_vec(),
        };
        for file in modules(&source).values() {
            let text = code(file);
            for word in forbidden.iter().filter(|w| text.contains(**w)) {
                found += &format!("{}: {word}\n", file.display());
            }
        }
    }
    assert!(found.is_empty(), "not in this crate:\n{found}");
}
