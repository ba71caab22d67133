//! Long work beside the interpreter: on a thread of its own, while the calling thread hands on progress and looks for signals.
//!
//! The work never calls Python, so that it waits for no lock of the interpreter, and it can be left behind: an exception of a signal
//! handler (Ctrl-C) or of the progress callback returns at once, and the work ends at its next report of progress, by an unwinding
//! that drops all that it has begun. Results are written by the calling thread, or under their name in one step.

use crate::error::{internal, to_python};
use lpv::{PipelineError, Progress};
use pyo3::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// How long a signal or a report of progress waits at most. A result does not wait.
const POLL: Duration = Duration::from_millis(50);

/// Stack of the thread: that of a main thread.
const STACK: usize = 8 << 20;

/// What the work has reported and nobody has seen: the last word of each step, in order.
#[derive(Default)]
struct Reports {
    steps: Mutex<Vec<(String, usize, usize)>>,
    left: AtomicBool,
}

/// Unwinds work that was left.
struct Left;

impl Reports {
    fn tell(&self, step: &str, done: usize, of: usize) {
        if self.left.load(Ordering::Relaxed) {
            // Without a message: nothing is wrong.
            resume_unwind(Box::new(Left));
        }
        let mut steps = self.steps.lock().unwrap_or_else(PoisonError::into_inner);
        match steps.last_mut() {
            // Threads report in any order.
            Some((last, most, parts)) if last == step && *parts == of => *most = done.max(*most),
            _ => steps.push((step.to_owned(), done, of)),
        }
    }

    fn hand_on(&self, py: Python<'_>, to: Option<&Py<PyAny>>) -> PyResult<()> {
        let steps = std::mem::take(&mut *self.steps.lock().unwrap_or_else(PoisonError::into_inner));
        let Some(to) = to else { return Ok(()) };
        for (step, done, of) in steps {
            to.call1(py, (step, done, of))?;
        }
        Ok(())
    }
}

/// Does the work, and calls `progress(step, done, of)` from the calling thread meanwhile.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(Progress<'_>) -> Result<T, PipelineError> + Send + 'static,
) -> PyResult<T> {
    let reports = Arc::new(Reports::default());
    let (send, receive) = channel();
    let heard = Arc::clone(&reports);
    std::thread::Builder::new()
        .name("lpvident".to_owned())
        .stack_size(STACK)
        .spawn(move || {
            let tell = |step: &str, done: usize, of: usize| heard.tell(step, done, of);
            // Nobody listens to work that was left.
            send.send(catch_unwind(AssertUnwindSafe(|| work(&tell)))).ok();
        })?;
    // Receivers are not shared between threads; the lock is free whenever it is asked for.
    let receive = Mutex::new(receive);
    loop {
        let got = py.detach(|| {
            let receive = receive.lock().unwrap_or_else(PoisonError::into_inner);
            receive.recv_timeout(POLL)
        });
        let heard = py.check_signals().and_then(|()| reports.hand_on(py, progress));
        if let Err(stopped) = heard {
            reports.left.store(true, Ordering::Relaxed);
            return Err(stopped);
        }
        match got {
            Ok(Ok(result)) => return result.map_err(|e| to_python(py, &e)),
            Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => return Err(internal(py)),
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}
