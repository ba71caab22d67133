//! What a long piece of work tells while it runs.

/// Called with the name of the step, the parts done and the parts in all, 0 where nobody knows how many there are; from any thread.
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);

/// Tells nobody.
pub fn silent(_step: &str, _done: usize, _of: usize) {}

/// A step in one piece.
pub(crate) fn begin(progress: Progress<'_>, step: &str) {
    progress(step, 0, 0);
}

/// Counts the parts of one step from many threads.
pub(crate) struct Counter<'a> {
    step: &'a str,
    of: usize,
    done: std::sync::atomic::AtomicUsize,
    progress: Progress<'a>,
}

impl<'a> Counter<'a> {
    pub(crate) fn new(progress: Progress<'a>, step: &'a str, of: usize) -> Self {
        progress(step, 0, of);
        Self {
            step,
            of,
            done: 0.into(),
            progress,
        }
    }
    pub(crate) fn one(&self) {
        let done = self.done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
        (self.progress)(self.step, done, self.of);
    }
}
