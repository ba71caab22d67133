//! What a run shows on standard error while it works, where that is a terminal: the step, what moves, the time that is left.

use indicatif::{ProgressBar, ProgressStyle};
use lpv::encode::visible;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// The step that runs, its parts in all, and its bar.
static CURRENT: Mutex<Option<(String, usize, ProgressBar)>> = Mutex::new(None);

/// Shows that so many parts of a step are done; from any thread.
pub(crate) fn tell(step: &str, done: usize, of: usize) {
    let mut current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
    let same = matches!(&*current, Some((name, parts, _)) if name == step && *parts == of);
    if !same {
        if let Some((_, _, bar)) = current.take() {
            bar.finish_and_clear();
        }
        *current = Some((step.to_owned(), of, bar(step, of)));
    }
    if let Some((_, _, bar)) = current.as_ref() {
        bar.set_position(done as u64);
        if of == 0 && done > 0 {
            bar.set_message(format!("{}: {done}", visible(step)));
        }
    }
}

/// Takes the bar away and gives the name of the step that ran.
pub(crate) fn clear() -> Option<String> {
    let mut current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
    let (step, _, bar) = current.take()?;
    bar.finish_and_clear();
    Some(step)
}

fn bar(step: &str, of: usize) -> ProgressBar {
    /// Often enough to see that it runs.
    const TICK: Duration = Duration::from_millis(200);
    // What is in one piece has a clock that runs; of several pieces the time that is left follows from those that are done.
    let (bar, template) = match of {
        0 | 1 => (ProgressBar::new_spinner(), "{spinner} {msg}, {elapsed} so far"),
        _ => (
            ProgressBar::new(of as u64),
            "{spinner} {msg} {wide_bar} {pos}/{len}, {elapsed} so far, {eta} left",
        ),
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.set_message(visible(step));
    bar.enable_steady_tick(TICK);
    bar
}
