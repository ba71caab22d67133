//! Stopping: by a signal or at a time limit, in one sentence, with nothing half written.

use crate::{bars, say};
use lpv::output::Stopped;
use std::time::Duration;

/// Exit code of a program that was interrupted, as shells know it.
const INTERRUPTED: i32 = 130;

/// Ends the process on Ctrl-C and on the signal that asks a process to end. (A signal that hangs up is left alone: `nohup` counts on it.)
#[cfg(unix)]
pub(crate) fn on_signals() {
    use signal_hook::consts::{SIGINT, SIGTERM};
    // Without a handler the system ends the process, and what it leaves is removed by the next run.
    let Ok(mut signals) = signal_hook::iterator::Signals::new([SIGINT, SIGTERM]) else {
        return;
    };
    std::thread::spawn(move || {
        for signal in &mut signals {
            let by = match signal {
                SIGINT => "Ctrl-C",
                _ => "a signal to end",
            };
            end(&format!("stopped by {by}"), "", INTERRUPTED);
        }
    });
}

/// Elsewhere the system ends the process, and what it leaves is removed by the next run.
#[cfg(not(unix))]
pub(crate) fn on_signals() {}

/// Ends the process with exit code 1 if it still runs after this time.
pub(crate) fn after(limit: Option<Duration>) {
    let Some(limit) = limit else { return };
    std::thread::spawn(move || {
        std::thread::sleep(limit);
        let why = format!("stopped at the time limit of {} s", limit.as_secs_f64());
        end(&why, "; give more time with --time-limit, or fewer data", 1);
    });
}

/// Ends the process, unless its results are in their places already: then there is nothing left to stop.
fn end(why: &str, remedy: &str, code: i32) {
    let left = match lpv::output::abandon() {
        Stopped::Done => return,
        Stopped::Some => "what was finished stays, and the same command goes on after it",
        Stopped::Nothing => "no result was written",
    };
    let step = bars::clear().map_or(String::new(), |step| format!(" during the step `{step}`"));
    say(&format!("{why}{step}; {left}{remedy}"));
    std::process::exit(code);
}
