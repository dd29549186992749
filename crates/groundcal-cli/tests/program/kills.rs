//! Runs that are killed at any moment: nothing of the user's is lost, nothing of two runs is mixed, the next run ends right.
//!
//! `GROUNDCAL_KILLS=500` asks for that many kills (CONTRIBUTING.md); without it a few.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus, Stdio},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use groundcal::synthetic::PointScene;
use serde_json::Value;
use tempfile::tempdir;

use crate::{
    common::*,
    rectify::{rendered, tiled, truth_json},
};

/// Kills in a run of all tests.
const KILLS: usize = 24;
/// A run that takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(120);

type Files = BTreeMap<String, Vec<u8>>;

/// Files under a folder, with their content.
fn snapshot(folder: &Path) -> Files {
    files_in(folder).into_iter().map(|name| (name.clone(), fs::read(folder.join(&name)).unwrap())).collect()
}

/// A command twice: its first run and another, whose results differ.
struct Case {
    name: &'static str,
    old: Vec<String>,
    new: Vec<String>,
}

fn case(name: &'static str, old: &[&str], new: &[&str]) -> Case {
    let words = |args: &[&str]| [name].iter().chain(args).map(|a| a.to_string()).collect();
    Case { name, old: words(old), new: words(new) }
}

const SCENE: &str = r#"
    [camera]
    image_size = [160, 120]
    fx = 120
    [[group]]
    pitch_down_deg = 50
    [[group.view]]
    file = "a.png"
    yaw_deg = 0
    centre_m = [0, 0, 1.5]
    [[group.view]]
    file = "b.jpg"
    yaw_deg = 20
    centre_m = [0.1, 0, 1.5]
"#;

/// All commands that write, on small inputs in a folder of the user's. `slow`: also the one that takes seconds.
fn cases(inputs: &Path, slow: bool) -> Vec<Case> {
    let mut scene = tiled();
    scene.camera.image_size = [320, 240];
    (scene.camera.fx, scene.camera.cx, scene.camera.cy) = (260.0, None, None);
    rendered(&scene, inputs);
    let mut second: Value = truth_json(&scene);
    second["camera"]["fx"] = 250.0.into();
    second["camera"]["fy"] = 250.0.into();
    let second = write(inputs, "second.json", second.to_string());
    let first = text(&inputs.join("calibration.json"));
    let (folder, b) = (text(inputs), text(&inputs.join("b.png")));
    let points = PointScene { matches: 60, ..PointScene::nominal(0) };
    let csv = write(inputs, "matches.csv", matches_csv(&points));
    let scene = write(inputs, "scene.toml", SCENE);
    let other = write(inputs, "other.toml", SCENE.replace("a.png", "c.png").replace("fx = 120", "fx = 110"));
    let matched = [csv.as_str(), "--image-size", "1280x960", "--method", "linear"];
    let mut all = vec![
        case("calibrate", &matched, &[&matched[..], &["--constraint", "square", "--format", "ros,colmap"]].concat()),
        case("rectify", &[&first, &folder, "--resolution", "60"], &[&second, &b, "--resolution", "70"]),
        case(
            "rectify",
            &[&first, &folder, "--mosaic", "--resolution", "60"],
            &[&second, &b, "--mosaic", "--up", "heading"],
        ),
        case("undistort", &[&first, &folder, "--maps"], &[&second, &b, "--fit", "crop"]),
        case("convert", &[&first], &[&second, "--format", "opencv,ros,nerfstudio"]),
        case("compare", &[&first, &second, &first], &[&second, &first]),
        case("plan", &["--rig", "pan-head", "--motions", "1"], &["--rig", "pan-head", "--motions", "2"]),
        case("simulate", &["noise", "--trials", "1"], &["noise", "--trials", "1", "--seed", "1"]),
        case("render", &[&scene], &[&other]),
        case("man", &[], &[]),
    ];
    if slow {
        all.push(case("experiment", &["film", "--quick"], &["film", "--quick", "--seed", "1"]));
    }
    all
}

fn command(args: &[String], out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_groundcal"));
    command.args(args).arg("--out").arg(out).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// Runs to the end; how long it took.
fn finished(args: &[String], out: &Path) -> Duration {
    let began = Instant::now();
    let output = command(args, out).stderr(Stdio::piped()).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    began.elapsed()
}

fn copied(from: &Path, to: &Path) {
    for (name, content) in snapshot(from) {
        let path = to.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
}

/// Numbers that look random, the same in every run.
struct Dice(u64);

impl Dice {
    /// From 0 to 1.
    fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// How a run is ended.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Signal {
    Kill,
    Int,
    Term,
}

fn send(child: &mut Child, signal: Signal) {
    let number = match signal {
        Signal::Kill => return child.kill().unwrap_or(()),
        Signal::Int => "-INT",
        Signal::Term => "-TERM",
    };
    let _ = Command::new("sh").args(["-c", &format!("kill {number} {}", child.id())]).stderr(Stdio::null()).status();
}

/// Waits until something is there or the run has ended.
fn wait_for(child: &mut Child, path: &Path) {
    while !path.exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_micros(20));
    }
}

fn ended(mut child: Child) -> ExitStatus {
    let began = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        assert!(began.elapsed() < PATIENCE, "it hangs");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Starts a run and ends it at some moment: anywhere, in the last part of it, or while results are moved.
fn killed(args: &[String], out: &Path, usual: Duration, dice: &mut Dice) -> (Signal, ExitStatus) {
    let signal = match dice.part() {
        p if p < 0.6 => Signal::Kill,
        p if p < 0.9 => Signal::Int,
        _ => Signal::Term,
    };
    let mut child = command(args, out).spawn().unwrap();
    let run = out.join(".groundcal-run");
    let delay = match dice.part() {
        p if p < 0.4 => usual.mul_f64(1.1 * dice.part()),
        p if p < 0.6 => {
            wait_for(&mut child, &run.join("new"));
            usual.mul_f64(0.5 * dice.part())
        }
        _ => {
            wait_for(&mut child, &run.join("journal.json"));
            Duration::from_micros((3000.0 * dice.part()) as u64)
        }
    };
    std::thread::sleep(delay);
    send(&mut child, signal);
    (signal, ended(child))
}

/// What a command writes, and how long it takes.
struct Expected {
    folder: PathBuf,
    files: Files,
    took: Duration,
}

fn expected(args: &[String], folder: PathBuf) -> Expected {
    let took = finished(args, &folder);
    let mut files = snapshot(&folder);
    files.remove(MANIFEST);
    Expected { folder, files, took }
}

/// Runs that are killed at a time: more than processors, so that they are held up anywhere.
const WORKERS: u64 = 4;

/// What became of the kills.
#[derive(Debug, Default)]
struct Tally {
    kills: usize,
    /// That left the folder for the next run to finish or to clear.
    left_behind: usize,
    old: usize,
    new: usize,
    too_late: usize,
}

impl Tally {
    fn add(&mut self, other: &Tally) {
        self.kills += other.kills;
        self.left_behind += other.left_behind;
        self.old += other.old;
        self.new += other.new;
        self.too_late += other.too_late;
    }
}

#[cfg(unix)]
fn one_kill(case: &Case, [old, new]: &[Expected; 2], inputs: &Path, dice: &mut Dice, tally: &mut Tally) {
    use std::os::unix::process::ExitStatusExt;
    let folder = tempdir().unwrap();
    let out = folder.path().join("out");
    let users: Files = [("notes.txt", "mine"), ("sub/keep.bin", "also mine"), (".hidden", "x"), ("a.png.bak", "y")]
        .map(|(name, content)| (name.to_string(), content.as_bytes().to_vec()))
        .into();
    for (name, content) in &users {
        let path = out.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    let has_old = case.name != "man";
    if has_old {
        copied(&old.folder, &out);
    }
    let inputs_before = snapshot(inputs);
    let (signal, status) = killed(&case.new, &out, new.took, dice);
    let by_signal = match signal {
        Signal::Kill => status.signal() == Some(9),
        // A process that was not yet listening is ended by the signal itself.
        Signal::Int => status.code() == Some(130) || status.signal() == Some(2),
        Signal::Term => status.code() == Some(143) || status.signal() == Some(15),
    };
    assert!(by_signal || status.success(), "{} {signal:?}: {status}", case.name);
    let told = format!("{} {signal:?} {status}", case.name);

    // The user's files are what they were, and each result is wholly old or new.
    let mut found = snapshot(&out);
    let before = found.len();
    found.retain(|name, _| !name.starts_with(".groundcal-run/") && name != MANIFEST);
    let left_behind = out.join(".groundcal-run").exists();
    assert!(before == found.len() + 1 || left_behind || !has_old, "{told}");
    assert_eq!(inputs_before, snapshot(inputs), "{told}");
    for (name, content) in &found {
        let known = [&users, &old.files, &new.files].map(|f| f.get(name));
        assert!(known.contains(&Some(content)), "{told}: {name}");
    }
    assert!(users.iter().all(|(name, content)| found.get(name) == Some(content)), "{told}");

    // Another command finishes what is left, or clears it away: the folder is that of one run.
    let next: Vec<String> = if case.name == "man" {
        vec!["convert".into(), text(&inputs.join("calibration.json"))]
    } else {
        vec!["man".into()]
    };
    let state = |with: &Files| users.iter().chain(with).map(|(n, c)| (n.clone(), c.clone())).collect::<Files>();
    let nothing = Files::new();
    let old_files = if has_old { &old.files } else { &nothing };
    if !left_behind {
        assert!(found == state(old_files) || found == state(&new.files), "{told}: mixed without a word");
    }
    let of_next = {
        let alone = tempdir().unwrap();
        finished(&next, alone.path());
        files_in(alone.path())
    };
    finished(&next, &out);
    let mut found = snapshot(&out);
    found.retain(|name, _| !of_next.contains(name));
    let is_new = found == state(&new.files);
    assert!(is_new || found == state(old_files), "{told}: mixed: {:?}", found.keys());

    // The next run of the command ends right and leaves nothing.
    finished(&case.new, &out);
    let mut found = snapshot(&out);
    found.retain(|name, _| !of_next.contains(name));
    assert_eq!(found.keys().collect::<Vec<_>>(), state(&new.files).keys().collect::<Vec<_>>(), "{told}");
    assert!(found == state(&new.files) && !out.join(".groundcal-run").exists(), "{told}");

    tally.left_behind += usize::from(left_behind);
    if by_signal {
        tally.kills += 1;
        if is_new { tally.new += 1 } else { tally.old += 1 }
    } else {
        tally.too_late += 1;
    }
}

#[cfg(unix)]
#[test]
fn killed_runs_lose_and_mix_nothing() {
    let wanted = std::env::var("GROUNDCAL_KILLS").ok().and_then(|n| n.parse().ok());
    let folder = tempdir().unwrap();
    let inputs = folder.path().join("photos");
    fs::create_dir_all(&inputs).unwrap();
    let cases = cases(&inputs, wanted.is_some());
    let ways: Vec<[Expected; 2]> = cases
        .iter()
        .enumerate()
        .map(|(i, case)| {
            let of = |args, which| expected(args, folder.path().join(format!("{which}{i}")));
            let both = [of(&case.old, "old"), of(&case.new, "new")];
            assert!(both[0].files != both[1].files || case.name == "man", "{}: two runs alike show nothing", case.name);
            both
        })
        .collect();
    let tallies: Vec<Mutex<Tally>> = cases.iter().map(|_| Mutex::default()).collect();
    let (turns, kills) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let wanted = wanted.unwrap_or(KILLS);
    std::thread::scope(|scope| {
        for worker in 0..WORKERS {
            let (cases, ways, inputs, tallies, turns, kills) = (&cases, &ways, &inputs, &tallies, &turns, &kills);
            scope.spawn(move || {
                let mut dice = Dice(worker);
                while kills.load(Ordering::Relaxed) < wanted {
                    let turn = turns.fetch_add(1, Ordering::Relaxed);
                    assert!(turn < 20 * wanted, "kills come too late: {tallies:?}");
                    let i = turn % cases.len();
                    // The one that takes seconds has half as many turns.
                    if cases[i].name == "experiment" && turn / cases.len() % 2 == 1 {
                        continue;
                    }
                    let mut tally = Tally::default();
                    one_kill(&cases[i], &ways[i], inputs, &mut dice, &mut tally);
                    kills.fetch_add(tally.kills, Ordering::Relaxed);
                    tallies[i].lock().unwrap().add(&tally);
                }
            });
        }
    });
    for (case, tally) in cases.iter().zip(&tallies) {
        println!("{:<11}{:?}", case.name, tally.lock().unwrap());
    }
    println!("{} kills, nothing lost or mixed", kills.into_inner());
}
