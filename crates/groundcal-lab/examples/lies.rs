//! How often is the program confidently wrong? See `groundcal_lab::lies`.
//!
//! `cargo run --release -p groundcal-lab --example lies -- --scenes 2000 --seed 1`

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    sync::atomic::{AtomicUsize, Ordering},
};

use groundcal_lab::lies::{
    Family, Kind, Medium, SceneRecord, Timed, compare, csv, export, families, read_json_lines, run, schedule, table,
    to_json_lines, warnings_table,
};

const USAGE: &str = "\
options:
  --scenes N         how many (default 2000; all families in turn, one from pictures for three from points)
  --seed S           of everything (default 1)
  --family A,B       these families only
  --points-only      no pictures
  --pictures-only    nothing but pictures
  --well-specified   the families in which all holds that is assumed, in place of the others
  --threads N        default: all
  --out DIR          writes lies.jsonl, lies.csv, table.txt and times.csv there
  --compare OLD      a lies.jsonl of another version: what has changed (after the run, or with --with)
  --with NEW         compares with this file in place of a run
  --export I         writes scene I of the one family named to --out, to be looked into
  --table FILE       the table of a lies.jsonl in place of a run
  --warnings GOOD    with --table: how often each warning stands in GOOD (--well-specified) and in FILE, as docs/warnings.md has it
  --list             the families";
/// A scene that takes longer is named.
const SLOW_SECONDS: f64 = 30.0;

struct Arguments {
    scenes: usize,
    seed: u64,
    families: Vec<Family>,
    threads: Option<usize>,
    out: Option<PathBuf>,
    compare: Option<PathBuf>,
    with: Option<PathBuf>,
    export: Option<usize>,
    table: Option<PathBuf>,
    warnings: Option<PathBuf>,
    list: bool,
}

fn arguments() -> Result<Arguments, String> {
    let mut a = Arguments {
        scenes: 2000,
        seed: 1,
        families: Vec::new(),
        threads: None,
        out: None,
        compare: None,
        with: None,
        export: None,
        table: None,
        warnings: None,
        list: false,
    };
    let (mut controls, mut medium, mut names) = (false, None, None);
    let mut given = std::env::args().skip(1);
    while let Some(option) = given.next() {
        let mut value = || given.next().ok_or(format!("{option} needs a value\n{USAGE}"));
        let number = |text: String| text.parse::<usize>().map_err(|_| format!("{text} is not a number"));
        match option.as_str() {
            "--scenes" => a.scenes = number(value()?)?,
            "--seed" => a.seed = number(value()?)? as u64,
            "--family" => names = Some(value()?),
            "--points-only" => medium = Some(Medium::Points),
            "--pictures-only" => medium = Some(Medium::Pictures),
            "--well-specified" => controls = true,
            "--threads" => a.threads = Some(number(value()?)?),
            "--out" => a.out = Some(value()?.into()),
            "--compare" => a.compare = Some(value()?.into()),
            "--with" => a.with = Some(value()?.into()),
            "--table" => a.table = Some(value()?.into()),
            "--warnings" => a.warnings = Some(value()?.into()),
            "--export" => a.export = Some(number(value()?)?),
            "--list" => a.list = true,
            _ => return Err(format!("unknown option {option}\n{USAGE}")),
        }
    }
    let all = families();
    a.families = match &names {
        Some(names) => names
            .split(',')
            .map(|n| all.iter().find(|f| f.name == n).copied().ok_or(format!("no family {n}; --list names them")))
            .collect::<Result<_, _>>()?,
        None if a.list => all,
        None => all.into_iter().filter(|f| (f.kind == Kind::WellSpecified) == controls).collect(),
    };
    a.families.retain(|f| medium.is_none_or(|m| m == f.medium));
    Ok(a)
}

fn read(path: &Path) -> Result<Vec<SceneRecord>, Box<dyn std::error::Error>> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(read_json_lines(&text).map_err(|e| format!("{}: {e}", path.display()))?)
}

fn run_all(a: &Arguments) -> Result<Vec<Timed>, Box<dyn std::error::Error>> {
    if let Some(threads) = a.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    }
    // A crash is an outcome of its scene: its message is in the record.
    std::panic::set_hook(Box::new(|_| {}));
    let scenes = schedule(&a.families, a.scenes);
    let finished = AtomicUsize::new(0);
    let done = |t: &Timed| {
        let n = finished.fetch_add(1, Ordering::Relaxed) + 1;
        if n.is_multiple_of(100) {
            eprintln!("{n} of {}", scenes.len());
        }
        if t.seconds > SLOW_SECONDS {
            eprintln!("slow: {} {} took {:.0} s", t.record.family, t.record.index, t.seconds);
        }
    };
    Ok(run(&scenes, a.seed, &done))
}

fn times(all: &[Timed]) -> String {
    let mut out = String::from("family,index,seconds\n");
    for t in all {
        out += &format!("{},{},{:.3}\n", t.record.family, t.record.index, t.seconds);
    }
    out
}

fn work() -> Result<(), Box<dyn std::error::Error>> {
    let a = arguments()?;
    if a.list {
        for f in &a.families {
            println!("{:<34} {:<14} {}", f.name, f.kind.name(), f.what);
        }
        println!("{} families", a.families.len());
        return Ok(());
    }
    if let Some(index) = a.export {
        let (Some(folder), [family]) = (&a.out, a.families.as_slice()) else {
            return Err("--export needs --out and one --family".into());
        };
        return export(family, a.seed, index, folder);
    }
    if let Some(good) = &a.warnings {
        let others = a.table.as_ref().ok_or("--warnings needs --table")?;
        print!("{}", warnings_table(&read(good)?, &read(others)?));
        return Ok(());
    }
    if let Some(file) = &a.table {
        print!("{}", table(&read(file)?));
        return Ok(());
    }
    if let Some(new) = &a.with {
        let old = a.compare.as_ref().ok_or("--with needs --compare")?;
        print!("{}", compare(&read(old)?, &read(new)?));
        return Ok(());
    }
    let all = run_all(&a)?;
    let records: Vec<_> = all.iter().map(|t| t.record.clone()).collect();
    let mut text = table(&records);
    let mut slowest: Vec<&Timed> = all.iter().collect();
    slowest.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
    let total: f64 = all.iter().map(|t| t.seconds).sum();
    text += &format!("\n{total:.0} s in all scenes together; slowest:");
    for t in slowest.iter().take(5) {
        text += &format!(" {} {} {:.1} s;", t.record.family, t.record.index, t.seconds);
    }
    println!("{text}");
    if let Some(folder) = &a.out {
        std::fs::create_dir_all(folder)?;
        std::fs::write(folder.join("lies.jsonl"), to_json_lines(&records)?)?;
        std::fs::write(folder.join("lies.csv"), csv(&records))?;
        std::fs::write(folder.join("table.txt"), text)?;
        std::fs::write(folder.join("times.csv"), times(&all))?;
    }
    if let Some(old) = &a.compare {
        print!("{}", compare(&read(old)?, &records));
    }
    Ok(())
}

fn main() -> ExitCode {
    match work() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}
