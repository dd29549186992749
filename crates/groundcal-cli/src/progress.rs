//! Progress on a terminal's standard error, and the time each stage took.

use std::{
    sync::Mutex,
    time::{Duration, Instant},
};

use groundcal::{
    calibrate::{Observer, Stage},
    result::Warning,
};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::{
    error::{CliError, Remark},
    interrupt, output,
    remedies::Flags,
    terminal,
};

/// Work shorter than this shows no bar.
const DISPLAY_DELAY: Duration = Duration::from_secs(1);

/// Listens to a calibration: a bar for the stage at work, the times of all, and what was noted on the way.
pub(crate) struct StageTimes {
    started: Instant,
    state: Mutex<State>,
}

struct State {
    bar: ProgressBar,
    stages: Vec<(&'static str, Instant)>,
    /// Remarks on files, which are told at once.
    noted: Vec<Remark>,
    /// What a calibration would have among its warnings.
    noticed: Vec<Warning>,
}

impl StageTimes {
    /// Begins with the reading of the input.
    pub(crate) fn new(first: &'static str) -> Self {
        let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{msg:24} [{bar:40}] {pos}/{len}") {
            bar.set_style(style.progress_chars("=> "));
        }
        let now = Instant::now();
        Self {
            started: now,
            state: Mutex::new(State { bar, stages: vec![(first, now)], noted: Vec::new(), noticed: Vec::new() }),
        }
    }

    fn with<T>(&self, action: impl FnOnce(&mut State) -> T) -> T {
        // A panic elsewhere does not make the bar unusable.
        action(&mut self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
    }

    /// A remark on the input, told at once: minutes of work may follow.
    pub(crate) fn note(&self, code: &str, message: String) {
        self.with(|state| {
            state.bar.suspend(|| output::note(&message));
            state.noted.push(Remark { code: code.into(), message });
        });
    }

    /// An error with what was noted before; what was not told yet is told.
    pub(crate) fn noted(&self, error: CliError) -> CliError {
        self.with(|state| {
            let mut notes = std::mem::take(&mut state.noted);
            for warning in std::mem::take(&mut state.noticed) {
                let message = warning.message(&Flags);
                output::note(&message);
                notes.push(Remark { code: warning.code().into(), message });
            }
            if notes.is_empty() { error } else { CliError::Noted(Box::new(error), notes) }
        })
    }

    /// Takes the bar away and gives the stages with their times; the same stage run several times is added up.
    pub(crate) fn finish(&self) -> Vec<(&'static str, Duration)> {
        let end = Instant::now();
        self.with(|state| {
            state.bar.finish_and_clear();
            let mut times: Vec<(&'static str, Duration)> = Vec::new();
            let ends = state.stages.iter().skip(1).map(|s| s.1).chain([end]);
            for ((name, start), stop) in state.stages.iter().zip(ends) {
                match times.iter_mut().find(|t| t.0 == *name) {
                    Some(t) => t.1 += stop - *start,
                    None => times.push((name, stop - *start)),
                }
            }
            times
        })
    }
}

fn label(stage: Stage) -> &'static str {
    match stage {
        Stage::Features => "detecting features",
        Stage::Matching => "matching pairs",
        Stage::Homographies => "fitting planes",
        Stage::Patches => "matching patches",
        Stage::Camera => "solving the camera",
    }
}

impl Observer for StageTimes {
    fn begin(&self, stage: Stage, total: usize) {
        self.with(|state| {
            state.stages.push((label(stage), Instant::now()));
            state.bar.set_length(total as u64);
            state.bar.set_position(0);
            state.bar.set_message(label(stage));
        });
    }

    fn advance(&self, _: Stage) {
        self.with(|state| {
            if state.bar.is_hidden() && !terminal::is_quiet() && self.started.elapsed() > DISPLAY_DELAY {
                // Draws nothing where standard error is not a terminal.
                state.bar.set_draw_target(ProgressDrawTarget::stderr());
            }
            state.bar.inc(1);
        });
    }

    fn notice(&self, warning: &Warning) {
        self.with(|state| state.noticed.push(warning.clone()));
    }

    fn stopped(&self) -> bool {
        interrupt::requested().is_some()
    }
}

/// A bar for studies and experiments; draws nothing where standard error is not a terminal.
pub(crate) struct Bar(ProgressBar);

impl Bar {
    /// A bar that looks as the template says.
    pub(crate) fn new(template: &str) -> Self {
        let target = if terminal::is_quiet() { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        Self(bar)
    }
}

impl groundcal_lab::progress::Progress for Bar {
    fn begin(&self, stage: &str, steps: u64) {
        self.0.reset();
        self.0.set_length(steps);
        self.0.set_message(stage.to_string());
    }

    fn advance(&self) {
        self.0.inc(1);
    }

    fn finish(&self) {
        self.0.finish_and_clear();
    }

    fn stopped(&self) -> bool {
        interrupt::requested().is_some()
    }
}
