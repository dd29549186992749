//! The pages: links lead somewhere, tables are tables, JSON is JSON, commands are understood.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use serde_json::Value;

use crate::common::{groundcal, root};

/// Pages in Markdown, with their text.
fn pages() -> BTreeMap<PathBuf, String> {
    let mut found = BTreeMap::new();
    let crates = std::fs::read_dir(root().join("crates")).unwrap().map(|e| e.unwrap().path());
    for folder in crates.chain([root(), root().join("docs")]) {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "md") {
                let text = std::fs::read_to_string(&path).unwrap();
                found.insert(path.canonicalize().unwrap(), text);
            }
        }
    }
    assert!(found.len() > 10);
    found
}

/// The lines of a page, each with the language of the code block that it is in.
fn lines(text: &str) -> impl Iterator<Item = (usize, Option<&str>, &str)> {
    let mut block = None;
    text.lines().enumerate().filter_map(move |(i, line)| match (line.trim_start().strip_prefix("```"), block) {
        (Some(language), None) => {
            block = Some(language);
            None
        }
        (Some(_), Some(_)) => {
            block = None;
            None
        }
        (None, _) => Some((i + 1, block, line)),
    })
}

/// Names of the headings as links have them.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings = lines(text).filter(|(_, block, line)| block.is_none() && line.starts_with('#'));
    let mut found = BTreeSet::new();
    for (_, _, line) in headings {
        let words = line.trim_start_matches('#').trim().to_lowercase();
        let kept = words.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        let name: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
        // A heading that is there again has a number.
        let again = (1..).map(|n| format!("{name}-{n}")).find(|n| !found.contains(n)).unwrap();
        found.insert(if found.contains(&name) { again } else { name });
    }
    found
}

/// Targets of links and pictures in a line.
fn targets(line: &str) -> Vec<&str> {
    line.match_indices("](").filter_map(|(at, _)| line[at + 2..].split(')').next()).collect()
}

#[test]
fn links_lead_somewhere() {
    let pages = pages();
    let mut wrong = String::new();
    let mut count = 0;
    for (page, text) in &pages {
        for (number, block, line) in lines(text) {
            let inside =
                targets(line).into_iter().filter(|t| block.is_none() && !t.contains("://") && !t.contains("::"));
            for target in inside {
                count += 1;
                let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
                let path = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
                let known = path.canonicalize().ok();
                let there = known.as_ref().and_then(|p| pages.get(p)).map(|text| anchors(text));
                if known.is_none() || (!anchor.is_empty() && there.is_none_or(|a| !a.contains(anchor))) {
                    wrong += &format!("{}:{number}: {target}\n", page.display());
                }
            }
        }
    }
    println!("{count} links");
    assert!(wrong.is_empty() && count > 50, "{count} links\n{wrong}");
}

/// A blank line inside a table makes text of the rest of it; a row that stands twice is left over from an edit.
#[test]
fn tables_are_whole_and_rows_stand_once() {
    let mut wrong = String::new();
    for (page, text) in &pages() {
        let all: Vec<(usize, &str)> =
            lines(text).filter(|(_, block, _)| block.is_none()).map(|(n, _, line)| (n, line)).collect();
        let mut seen = BTreeSet::new();
        for (i, (number, line)) in all.iter().enumerate().filter(|(_, (_, line))| line.starts_with('|')) {
            let begins = i == 0 || !all[i - 1].1.starts_with('|');
            if begins {
                seen.clear();
                if !all.get(i + 1).is_some_and(|(_, next)| next.starts_with("|---") || next.starts_with("|:--")) {
                    wrong += &format!("{}:{number}: rows without a header\n", page.display());
                }
            }
            if !seen.insert(*line) || line.contains("TODO") {
                wrong += &format!("{}:{number}: stands twice: {line}\n", page.display());
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn json_is_json() {
    for (page, text) in &pages() {
        let mut blocks: Vec<(usize, String)> = Vec::new();
        let mut last = 0;
        for (number, _, line) in lines(text).filter(|(_, block, _)| *block == Some("json")) {
            match blocks.last_mut() {
                Some((_, json)) if number == last + 1 => *json += &format!("\n{line}"),
                _ => blocks.push((number, line.to_string())),
            }
            last = number;
        }
        for (number, json) in blocks {
            let parsed = serde_json::from_str::<Value>(&json);
            assert!(parsed.is_ok(), "{}:{number}: {parsed:?}", page.display());
        }
    }
}

/// Words of a command line, quoted ones as one.
fn words(line: &str) -> Vec<String> {
    let mut found = vec![String::new()];
    let mut quote = None;
    for c in line.chars() {
        match (c, quote) {
            ('\'' | '"', None) => quote = Some(c),
            (_, Some(q)) if c == q => quote = None,
            (' ', None) => found.push(String::new()),
            _ => found.last_mut().unwrap().push(c),
        }
    }
    found.retain(|w| !w.is_empty());
    found
}

/// The arguments of a command of the program in a line, where there is one.
fn command(line: &str) -> Option<Vec<String>> {
    let line = line.trim().trim_start_matches("$ ");
    let rest = line.strip_prefix("cargo run --release -- ").or_else(|| line.strip_prefix("groundcal "))?;
    // What follows two blanks explains it; what follows these belongs to the shell.
    let rest = rest.split("  ").next()?.split([';', '|', '>', '&']).next()?.split(" # ").next()?;
    // Output begins with the version.
    Some(words(rest)).filter(|words| words.first().is_some_and(|w| w.bytes().all(|b| b.is_ascii_lowercase())))
}

/// Commands of code blocks, and of examples in the help of every command: what they name need not exist, their options must.
#[test]
fn commands_are_understood() {
    let mut all: BTreeSet<Vec<String>> = BTreeSet::new();
    for text in pages().values() {
        let code =
            lines(text).filter(|(_, block, _)| block.is_some_and(|b| ["sh", "text", "bash", "console"].contains(&b)));
        all.extend(code.filter_map(|(_, _, line)| command(line)));
        // In a sentence: `groundcal calibrate photos/ --out result/`.
        let spans =
            text.split('`').skip(1).step_by(2).filter(|span| span.starts_with("groundcal ") && !span.contains('\n'));
        let whole = |words: &Vec<String>| {
            !words.iter().any(|w| w.contains(['[', '.']) && w.contains("..") || w.starts_with('['))
        };
        all.extend(spans.filter_map(command).filter(whole).filter(|words| words.iter().any(|w| w.starts_with("--"))));
    }
    for name in ["calibrate", "render", "plan", "simulate", "experiment", "rectify", "undistort", "compare", "convert"]
    {
        let help = groundcal(&[name, "--help"]).stdout;
        let examples: Vec<_> = help.lines().filter(|l| l.starts_with("  groundcal ")).filter_map(command).collect();
        assert!(!examples.is_empty(), "{name}: {help}");
        all.extend(examples);
    }
    println!("{} commands", all.len());
    assert!(all.len() > 30);
    // Names that stand for one of several words.
    let stands_for = |words: &Vec<String>| words.iter().any(|w| ["NAME", "STUDY", "SHELL"].contains(&w.as_str()));
    let mut wrong = String::new();
    for words in all.into_iter().filter(|words| !stands_for(words)) {
        let asked: Vec<String> = words.iter().cloned().chain(["--help".to_string()]).collect();
        let run = groundcal(&asked);
        if run.code != 0 {
            wrong += &format!("{words:?}: {}", run.stderr);
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn the_checks_see_what_is_wrong() {
    assert_eq!(targets("see [a](b.md#c) and [d](#e)"), ["b.md#c", "#e"]);
    assert!(anchors("# A `b` & c\n```\n# no\n```\n## A `b` & c").iter().eq(["a-b--c", "a-b--c-1"]));
    assert_eq!(command("groundcal plan --f 9      a plan").unwrap(), ["plan", "--f", "9"]);
    assert_eq!(command("groundcal calibrate 'a b/*.png' | head").unwrap(), ["calibrate", "a b/*.png"]);
    assert!(Path::new(env!("CARGO_BIN_EXE_groundcal")).exists());
}
