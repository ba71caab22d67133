//! What a run shows on standard error while it works, where that is a terminal: the step, what moves, the time that is left.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lpv::encode::visible;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The step that runs.
struct Step {
    name: String,
    /// Its parts in all; 0 where nobody knows.
    of: usize,
    begun: Instant,
    bar: ProgressBar,
}

static CURRENT: Mutex<Option<Step>> = Mutex::new(None);
static QUIET: AtomicBool = AtomicBool::new(false);
static VERBOSE: AtomicBool = AtomicBool::new(false);

/// Whether nothing is shown, and whether each step leaves a line, with or without a terminal.
pub(crate) fn set(quiet: bool, verbose: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
    VERBOSE.store(verbose, Ordering::Relaxed);
}

/// Shows that so many parts of a step are done; from any thread.
pub(crate) fn tell(name: &str, done: usize, of: usize) {
    let mut current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
    if !current.as_ref().is_some_and(|s| s.name == name && s.of == of) {
        current.take().map(Step::end);
        *current = Some(Step {
            name: name.to_owned(),
            of,
            begun: Instant::now(),
            bar: bar(name, of),
        });
    }
    if let Some(step) = current.as_ref() {
        step.bar.set_position(done as u64);
        if of == 0 && done > 0 {
            step.bar.set_message(format!("{}: {done}", visible(name)));
        }
    }
}

/// Takes the bar away and gives the name of the step that ran.
pub(crate) fn clear() -> Option<String> {
    let mut current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
    current.take().map(Step::end)
}

impl Step {
    /// Takes the bar away, tells the time where that is asked for, and gives the name.
    fn end(self) -> String {
        self.bar.finish_and_clear();
        if VERBOSE.load(Ordering::Relaxed) {
            let seconds = self.begun.elapsed().as_secs_f64();
            // Where nobody can read it, nothing is lost.
            writeln!(std::io::stderr(), "{}: {seconds:.2} s", visible(&self.name)).ok();
        }
        self.name
    }
}

fn bar(step: &str, of: usize) -> ProgressBar {
    /// Often enough to see that it runs.
    const TICK: Duration = Duration::from_millis(200);
    // What is in one piece has a clock that runs; of several pieces the time that is left follows from those that are done.
    let (bar, template) = match of {
        0 | 1 => (ProgressBar::new_spinner(), "{spinner} {msg}, {elapsed} so far"),
        _ => (
            ProgressBar::new(of as u64),
            "{spinner} {msg} {wide_bar} {percent} % ({pos}/{len}), {elapsed} so far, {eta} left",
        ),
    };
    if QUIET.load(Ordering::Relaxed) {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.set_message(visible(step));
    bar.enable_steady_tick(TICK);
    bar
}
