//! Work beside Python: on threads of its own, without the interpreter's lock, so that other Python threads run on.
//!
//! The thread that called waits, looks for signals (Ctrl-C) every [`POLL_INTERVAL`], tells of the progress, and asks the work to stop when
//! either raises. Nothing but this thread touches Python: the work owns what it needs.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc::{Receiver, RecvTimeoutError, channel},
    },
    thread,
    time::Duration,
};

use groundcal::{Observer, Stage, result::Warning};
use groundcal_lab::progress::Progress;
use pyo3::{exceptions::PyRuntimeError, prelude::*};

use crate::{failure::Failure, keywords::Keywords};

/// Between looks at signals.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Time for the work to stop by itself; what takes longer (an image being decoded) ends by itself later and is thrown away.
const GRACE: Duration = Duration::from_millis(100);

/// Hears of the work, on any thread.
#[derive(Default)]
pub(crate) struct Watch {
    stop: AtomicBool,
    /// Stages begun and not yet told, with their items.
    begun: Mutex<Vec<(String, u64)>>,
    /// Items of the last stage that are done.
    done: AtomicU64,
    /// What was noted of the input, for an error.
    notes: Mutex<Vec<String>>,
}

impl Watch {
    fn begun(&self, stage: String, total: u64) {
        self.begun.lock().unwrap_or_else(PoisonError::into_inner).push((stage, total));
        self.done.store(0, Ordering::Relaxed);
    }

    /// Notes on the input, which an error will have with it.
    pub(crate) fn note(&self, notes: &[String]) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(notes);
    }

    fn one_more(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }
}

/// A stage's name, stable.
fn name(stage: Stage) -> &'static str {
    match stage {
        Stage::Features => "features",
        Stage::Candidates => "candidates",
        Stage::Matching => "matching",
        Stage::Homographies => "homographies",
        Stage::Patches => "patches",
        Stage::Selection => "selection",
        Stage::Camera => "camera",
    }
}

impl Observer for Watch {
    fn begin(&self, stage: Stage, total: usize) {
        self.begun(name(stage).into(), total as u64);
    }

    fn advance(&self, _: Stage) {
        self.one_more();
    }

    fn notice(&self, warning: &Warning) {
        self.note(&[warning.message(&Keywords)]);
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

impl Progress for Watch {
    fn begin(&self, stage: &str, steps: u64) {
        self.begun(stage.into(), steps);
    }

    fn advance(&self) {
        self.one_more();
    }

    fn finish(&self) {}

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// Tells a Python function of the progress: `progress(stage, done, total)`.
struct Teller<'a, 'py> {
    function: Option<&'a Bound<'py, PyAny>>,
    /// Stage at work, its items, and how many were told to be done.
    at: Option<(String, u64, u64)>,
}

impl Teller<'_, '_> {
    fn say(&self, stage: &str, done: u64, total: u64) -> PyResult<()> {
        self.function.map_or(Ok(()), |f| f.call1((stage, done, total)).map(drop))
    }

    /// All that happened since the last time; a stage is whole when the next begins, and at the `end`.
    fn tell(&mut self, watch: &Watch, end: bool) -> PyResult<()> {
        let new = std::mem::take(&mut *watch.begun.lock().unwrap_or_else(PoisonError::into_inner));
        for (stage, total) in new {
            self.whole()?;
            self.say(&stage, 0, total)?;
            self.at = Some((stage, total, 0));
        }
        if end {
            return self.whole();
        }
        let now = watch.done.load(Ordering::Relaxed);
        match self.at.take() {
            Some((stage, total, told)) => {
                let now = now.min(total);
                let result = if now > told { self.say(&stage, now, total) } else { Ok(()) };
                self.at = Some((stage, total, now.max(told)));
                result
            }
            None => Ok(()),
        }
    }

    fn whole(&mut self) -> PyResult<()> {
        match self.at.take() {
            Some((stage, total, told)) if told < total => self.say(&stage, total, total),
            _ => Ok(()),
        }
    }
}

/// Waits without the interpreter's lock.
fn wait<T: Send>(py: Python<'_>, results: Receiver<T>, time: Duration) -> (Receiver<T>, Result<T, RecvTimeoutError>) {
    py.detach(move || {
        let result = results.recv_timeout(time);
        (results, result)
    })
}

/// Does the work on `threads` threads (`None`: one a processor). They are the work's own: a process that was forked has them too.
pub(crate) fn run<'py, T: Send + 'static>(
    py: Python<'py>,
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
    work: impl FnOnce(&Watch) -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    let fault =
        |what: String| PyRuntimeError::new_err(format!("internal fault: {what}. Please report it with the input"));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(|e| fault(format!("cannot start threads ({e})")))?;
    let watch = Arc::new(Watch::default());
    let (sender, mut results) = channel();
    let of_work = Arc::clone(&watch);
    thread::Builder::new()
        .name("groundcal".into())
        .spawn(move || {
            // Nobody listens to work that was given up.
            let _ = sender.send(pool.install(|| work(&of_work)));
        })
        .map_err(|e| fault(format!("cannot start a thread ({e})")))?;
    let mut teller = Teller { function: progress, at: None };
    loop {
        let (receiver, result) = wait(py, results, POLL_INTERVAL);
        results = receiver;
        match result {
            Ok(result) => {
                let notes = std::mem::take(&mut *watch.notes.lock().unwrap_or_else(PoisonError::into_inner));
                let value = result.map_err(|failure| failure.raise_with(py, &notes))?;
                return teller.tell(&watch, true).map(|()| value);
            }
            Err(RecvTimeoutError::Disconnected) => return Err(fault("a computation broke off".into())),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(raised) = py.check_signals().and_then(|()| teller.tell(&watch, false)) {
                    watch.stop.store(true, Ordering::Relaxed);
                    let _ = wait(py, results, GRACE);
                    return Err(raised);
                }
            }
        }
    }
}
