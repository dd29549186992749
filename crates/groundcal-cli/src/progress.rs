//! Progress on standard error, as a bar or in lines, and the time each stage took.

use std::{
    sync::Mutex,
    time::{Duration, Instant},
};

use groundcal::{Observer, Stage, result::Warning};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::{
    error::{CliError, Noted, PairLeftOut, Remark},
    interrupt, output,
    remedies::Flags,
    terminal::{self, ProgressArg},
};

/// Work shorter than this shows no bar.
const DISPLAY_DELAY: Duration = Duration::from_secs(1);
/// Stages shorter than this have no line, and lines are no closer than this.
const LINE_INTERVAL: Duration = Duration::from_secs(2);
/// A bar of a stage with steps to count, and of one without.
const COUNTED: &str = "{msg:24} [{bar:40}] {pos}/{len}, {eta} left";
const UNCOUNTED: &str = "{msg:24} {spinner} {elapsed}";

/// Listens to a calibration: a bar for the stage at work, the times of all, and what was noted on the way.
pub(crate) struct StageTimes {
    started: Instant,
    state: Mutex<State>,
}

struct State {
    how: ProgressArg,
    bar: ProgressBar,
    /// Steps of the stage at work, done and in all.
    steps: (usize, usize),
    /// When the last line was written.
    last_line: Option<Instant>,
    stages: Vec<(&'static str, Instant)>,
    /// Remarks on files, which are told at once.
    noted: Vec<Remark>,
    /// What a calibration would have among its warnings.
    noticed: Vec<Warning>,
    /// What a calibration would say of its pairs.
    left_out: Vec<PairLeftOut>,
}

impl StageTimes {
    /// Begins with the reading of the input.
    pub(crate) fn new(first: &'static str) -> Self {
        let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::hidden());
        let now = Instant::now();
        let (how, steps, last_line) = (terminal::progress(), (0, 0), None);
        let (stages, noted, noticed, left_out) = (vec![(first, now)], Vec::new(), Vec::new(), Vec::new());
        Self { started: now, state: Mutex::new(State { how, bar, steps, last_line, stages, noted, noticed, left_out }) }
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
            let mut remarks = std::mem::take(&mut state.noted);
            for warning in std::mem::take(&mut state.noticed) {
                let message = warning.message(&Flags);
                output::note(&message);
                remarks.push(Remark { code: warning.code().into(), message });
            }
            let noted = Noted { remarks, left_out: std::mem::take(&mut state.left_out) };
            if noted.is_empty() { error } else { CliError::Noted(Box::new(error), noted) }
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

impl State {
    /// Shows how far the stage at work is, where it is time to.
    fn show(&mut self, started: Instant) {
        match self.how {
            ProgressArg::Bar if self.bar.is_hidden() && started.elapsed() > DISPLAY_DELAY => {
                self.bar.set_draw_target(ProgressDrawTarget::stderr());
                self.bar.tick();
            }
            ProgressArg::Plain => {
                let Some((label, begun)) = self.stages.last() else { return };
                let since = self.last_line.filter(|line| line > begun).unwrap_or(*begun);
                if since.elapsed() >= LINE_INTERVAL {
                    self.last_line = Some(Instant::now());
                    output::progress_line(&line(label, begun.elapsed(), self.steps));
                }
            }
            _ => {}
        }
    }
}

/// How far a stage is that has taken some time for some of its steps.
fn line(label: &str, taken: Duration, (done, all): (usize, usize)) -> String {
    let seconds = taken.as_secs_f64();
    if all > 1 && done > 0 {
        let left = seconds * (all.saturating_sub(done)) as f64 / done as f64;
        format!("{label}: {done} of {all}, about {left:.0} s left")
    } else {
        format!("{label}: {seconds:.0} s")
    }
}

fn label(stage: Stage) -> &'static str {
    match stage {
        Stage::Features => "detecting features",
        Stage::Candidates => "comparing images",
        Stage::Matching => "matching pairs",
        Stage::Homographies => "fitting planes",
        Stage::Patches => "matching patches",
        Stage::Selection => "selecting motions",
        Stage::Camera => "solving the camera",
    }
}

impl Observer for StageTimes {
    fn begin(&self, stage: Stage, total: usize) {
        self.with(|state| {
            state.stages.push((label(stage), Instant::now()));
            // Selected again, with finer features, what was said of the pairs is said again.
            if stage == Stage::Selection {
                state.left_out.clear();
            }
            state.steps = (0, total);
            if let Ok(style) = ProgressStyle::with_template(if total > 1 { COUNTED } else { UNCOUNTED }) {
                state.bar.set_style(style.progress_chars("=> "));
            }
            state.bar.set_length(total as u64);
            state.bar.set_position(0);
            state.bar.reset_elapsed();
            state.bar.reset_eta();
            state.bar.set_message(label(stage));
            state.show(self.started);
        });
    }

    fn advance(&self, _: Stage) {
        self.with(|state| {
            state.steps.0 += 1;
            state.show(self.started);
            state.bar.inc(1);
        });
    }

    fn pair_left_out(&self, [from, to]: [&str; 2], reason: &str) {
        let left_out = PairLeftOut { from: from.into(), to: to.into(), reason: reason.into() };
        self.with(|state| state.left_out.push(left_out));
    }

    fn notice(&self, warning: &Warning) {
        self.with(|state| state.noticed.push(warning.clone()));
    }

    fn stopped(&self) -> bool {
        // Asked in every loop of the work: a stage without steps to count is seen to go on. Who shows progress already need not wait.
        if let Ok(mut state) = self.state.try_lock() {
            state.show(self.started);
            if !state.bar.is_hidden() && state.steps.1 <= 1 {
                state.bar.tick();
            }
        }
        interrupt::requested().is_some()
    }
}

/// A bar for studies and experiments; draws nothing where standard error is not a terminal.
pub(crate) struct Bar(ProgressBar);

impl Bar {
    /// A bar that looks as the template says.
    pub(crate) fn new(template: &str) -> Self {
        // Draws nothing where standard error is not a terminal.
        let shown = terminal::progress() == ProgressArg::Bar;
        let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_how_far_the_work_is_and_what_is_left() {
        let seconds = Duration::from_secs;
        assert_eq!(line("matching pairs", seconds(4), (20, 60)), "matching pairs: 20 of 60, about 8 s left");
        assert_eq!(line("matching pairs", seconds(6), (60, 60)), "matching pairs: 60 of 60, about 0 s left");
        // Nothing to count, or nothing of it done yet.
        assert_eq!(line("solving the camera", seconds(7), (0, 1)), "solving the camera: 7 s");
        assert_eq!(line("matching pairs", seconds(3), (0, 60)), "matching pairs: 3 s");
    }
}
