//! Ctrl-C, and the system's request to end: what is on its way into a folder is thrown away, and the program ends with 128 and the number
//! of the signal.
//!
//! The work is asked to stop first, so that it can tidy up; what takes longer than [`GRACE`] is ended wherever it is.

use std::{
    process,
    sync::{
        Arc, LazyLock, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::Duration,
};

use groundcal_io::outputs::Abandon;
use signal_hook::consts::{SIGINT, SIGTERM};

/// Between looks at whether a signal has come.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Time for the work to stop by itself.
const GRACE: Duration = Duration::from_millis(500);
/// What an exit code of a signal is above its number.
const OF_SIGNALS: usize = 128;

/// The signal that came; 0: none.
static SIGNAL: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);
/// Results on their way.
static RUNS: Mutex<Vec<Abandon>> = Mutex::new(Vec::new());

/// The exit code, once the program was asked to end.
pub(crate) fn requested() -> Option<u8> {
    match SIGNAL.load(Ordering::Relaxed) {
        0 => None,
        signal => Some((OF_SIGNALS + signal) as u8),
    }
}

/// These results are thrown away when the program is ended.
pub(crate) fn guard(results: Abandon) {
    RUNS.lock().unwrap_or_else(PoisonError::into_inner).push(results);
}

/// From now on Ctrl-C (SIGINT) and SIGTERM end the process: files that are on their way are thrown away, and the exit code is 130 or 143.
///
/// This belongs to a program's `main`. Without it signals do what they do anyway, and what a run leaves behind goes with the next.
pub fn end_on_signals() {
    for signal in [SIGINT, SIGTERM] {
        // Where it cannot be set up, the signal ends the process without tidying up.
        let _ = signal_hook::flag::register_usize(signal, Arc::clone(&SIGNAL), signal as usize);
    }
    let watch = || {
        loop {
            thread::sleep(POLL_INTERVAL);
            if let Some(code) = requested() {
                thread::sleep(GRACE);
                // Results that are just being moved into place are waited for.
                for run in RUNS.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
                    run.now();
                }
                process::exit(i32::from(code));
            }
        }
    };
    let _ = thread::Builder::new().name("signals".into()).spawn(watch);
}
