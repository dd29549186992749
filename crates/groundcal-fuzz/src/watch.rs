//! Ends the process where an input takes too long or too much memory: its file is kept before.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

/// The longest that an input may take, in time of processors: beside other work the clock on the wall runs on.
const LONGEST: Duration = Duration::from_secs(10);
/// The longest on the wall: who waits for ever takes no time of processors.
const MAX_WAIT: Duration = Duration::from_secs(600);
/// Kilobytes of memory that the process may have.
const MAX_KB: u64 = 2_000_000;
/// Between looks.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Watches one target.
pub(crate) struct Watch {
    started: Instant,
    /// When the input at work began, microseconds after the start, plus one; 0: none is at work.
    begun: Arc<AtomicU64>,
    done: Arc<AtomicBool>,
}

impl Watch {
    /// Begins to watch; `input` is where the input at work stands.
    pub(crate) fn new(input: PathBuf, kept: PathBuf) -> Self {
        let watch = Self { started: Instant::now(), begun: Arc::default(), done: Arc::default() };
        let (begun, done, started) = (watch.begun.clone(), watch.done.clone(), watch.started);
        std::thread::spawn(move || {
            // The input seen at the last look, and the time of processors that was used before it, or at most a nap later.
            let (mut seen, mut used_before) = (0, Duration::ZERO);
            while !done.load(Ordering::Relaxed) {
                let since = begun.load(Ordering::Relaxed);
                let now = started.elapsed().as_micros() as u64;
                let waited = Duration::from_micros(now.saturating_sub(since));
                // Where the system does not say it, the wall's has to do.
                let used = processor_time().unwrap_or(started.elapsed());
                if since != seen {
                    (seen, used_before) = (since, used);
                }
                let worked = used.saturating_sub(used_before);
                if since > 0 && (worked > LONGEST || waited > MAX_WAIT) {
                    let (worked, waited) = (worked.as_secs(), waited.as_secs());
                    give_up(&input, &kept, &format!("no end after {worked} s of work in {waited} s"));
                }
                if let Some(kb) = resident_kb().filter(|kb| *kb > MAX_KB) {
                    give_up(&input, &kept, &format!("{kb} kB of memory"));
                }
                std::thread::sleep(POLL_INTERVAL);
            }
        });
        watch
    }

    pub(crate) fn begin(&self) {
        self.begun.store(1 + self.started.elapsed().as_micros() as u64, Ordering::Relaxed);
    }

    pub(crate) fn end(&self) {
        self.begun.store(0, Ordering::Relaxed);
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.done.store(true, Ordering::Relaxed);
    }
}

fn give_up(input: &Path, kept: &Path, why: &str) -> ! {
    let copied = std::fs::copy(input, kept);
    eprintln!("finding: {why}: {} ({copied:?})", kept.display());
    std::process::exit(1)
}

/// Time of processors that this process has had, where the system says it: hundredths of a second, of the program and of the system for it.
pub(crate) fn processor_time() -> Option<Duration> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name, in brackets, may hold anything.
    let after_name = stat.rsplit_once(')')?.1;
    let fields: Vec<&str> = after_name.split_whitespace().collect();
    let hundredths: u64 = fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?;
    Some(Duration::from_millis(10 * hundredths))
}

/// Memory of this process, where the system says it.
fn resident_kb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}
