//! One target for a time.

use std::{
    fmt,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    time::{Duration, Instant},
};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::{
    mutate::mutated,
    seeds,
    signature::Signatures,
    targets::Target,
    watch::{Watch, processor_time},
};

/// Inputs that are kept of one target, and findings after which it ends.
const MAX_POOL: usize = 20_000;
const MAX_FINDINGS: u64 = 20;

/// A target and how it is run.
pub(crate) struct Run<'a> {
    pub(crate) target: &'a Target,
    pub(crate) seed: u64,
    pub(crate) time: Duration,
    pub(crate) folder: &'a Path,
    pub(crate) replay: Option<&'a Path>,
}

/// What came out.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    executions: u64,
    findings: u64,
}

impl Findings {
    pub(crate) fn add(&mut self, other: Findings) {
        self.executions += other.executions;
        self.findings += other.findings;
    }

    pub(crate) fn any(&self) -> bool {
        self.findings > 0
    }
}

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} executions, {} findings", self.executions, self.findings)
    }
}

/// Words that a message must not have: faults of the program, and the language it is written in. Names of types alone may be a file's.
const NEVER: [&str; 10] = [
    "internal numerical failure",
    "InvalidInput",
    "InvalidOption",
    "Some(",
    "invalid type: ",
    "expected struct",
    "expected f64",
    "expected usize",
    "expected u32",
    "expected u64",
];
/// Bytes of the longest message.
const MAX_MESSAGE: usize = 4000;

/// What is wrong with an answer, if anything.
fn fault(answer: &Result<String, String>) -> Option<String> {
    let Err(message) = answer else { return None };
    // What a file holds is quoted.
    let own: String = message.split('"').step_by(2).collect();
    if let Some(word) = NEVER.iter().find(|word| own.contains(**word)) {
        return Some(format!("\"{word}\" in the message: {message}"));
    }
    if message.contains(char::is_control) {
        return Some(format!("a control character in the message: {message:?}"));
    }
    (message.len() > MAX_MESSAGE).then(|| format!("a message of {} bytes", message.len()))
}

impl Run<'_> {
    /// Runs; every finding is printed and its input kept.
    pub(crate) fn run(&self) -> std::io::Result<Findings> {
        std::fs::create_dir_all(self.folder)?;
        // The input at work always stands in a file: a crash that ends the process leaves it there. In memory, where the system has such
        // files: some disks take milliseconds for each.
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        let place = tempfile::Builder::new().prefix("groundcal_fuzz_").tempdir_in(folder)?;
        let input = place.path().join(self.target.file_name);
        let watch = Watch::new(input.clone(), self.folder.join(format!("{}_stopped", self.target.name)));
        let mut found = Findings::default();
        let mut known = Signatures::default();
        let mut attempt = |bytes: &[u8]| -> std::io::Result<Option<String>> {
            std::fs::write(&input, bytes)?;
            watch.begin();
            let answer = catch_unwind(AssertUnwindSafe(|| (self.target.run)(&input)));
            watch.end();
            found.executions += 1;
            let what = match &answer {
                Err(_) => Some("a panic".to_string()),
                Ok(answer) => fault(answer),
            };
            if let Some(what) = what {
                found.findings += 1;
                let kept = self.folder.join(format!("{}_{}", self.target.name, found.findings));
                std::fs::write(&kept, bytes)?;
                println!("finding: {}: {what}: {}", self.target.name, kept.display());
            }
            if found.findings >= MAX_FINDINGS {
                return Err(std::io::Error::other(format!("{}: {MAX_FINDINGS} findings", self.target.name)));
            }
            Ok(answer.ok().map(|a| match a {
                Ok(text) => format!("read: {text}"),
                Err(text) => text,
            }))
        };
        if let Some(file) = self.replay {
            let answer = attempt(&std::fs::read(file)?)?;
            println!("{}", answer.unwrap_or_else(|| "a panic".into()));
            return Ok(found);
        }
        let mut pool = seeds::of(self.target)?;
        for seed in &pool {
            if let Some(answer) = attempt(seed)? {
                known.is_new(&answer, seed);
            }
        }
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed);
        let (start, used_before) = (Instant::now(), processor_time());
        while start.elapsed() < self.time {
            let [one, other] = [0; 2].map(|_| rng.random_range(0..pool.len()));
            let bytes = mutated(&mut rng, &pool[one], &pool[other], self.target.is_text);
            let Some(answer) = attempt(&bytes)? else { continue };
            if known.is_new(&answer, &bytes) && pool.len() < MAX_POOL {
                pool.push(bytes);
            }
        }
        // Beside other work it has a part of the time only.
        let worked = processor_time().zip(used_before).map(|(now, before)| now.saturating_sub(before).as_secs_f64());
        let worked = worked.map_or_else(String::new, |s| format!(", {s:.0} s of work"));
        let (name, count, seconds) = (self.target.name, known.count(), start.elapsed().as_secs_f64());
        println!("{name}: {found}, {count} signatures, {seconds:.0} s{worked}");
        Ok(found)
    }
}
