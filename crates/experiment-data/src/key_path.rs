//! The way to a value inside the description: `records[3].injection.columns[0]`.

use std::fmt;

/// One step of the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// Into a table.
    Key(&'static str),
    /// Into an array, from 0.
    Index(usize),
}

/// The way from the root of the file to a value.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct KeyPath(pub(crate) Vec<Step>);

impl KeyPath {
    /// The path of a top-level key.
    pub(crate) fn key(name: &'static str) -> Self {
        Self::default().then(name)
    }
    /// One step into a table.
    #[must_use]
    pub(crate) fn then(&self, name: &'static str) -> Self {
        let mut steps = self.0.clone();
        steps.push(Step::Key(name));
        Self(steps)
    }
    /// One step into an array.
    #[must_use]
    pub(crate) fn at(&self, index: usize) -> Self {
        let mut steps = self.0.clone();
        steps.push(Step::Index(index));
        Self(steps)
    }
}

impl fmt::Display for KeyPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, step) in self.0.iter().enumerate() {
            match step {
                Step::Key(name) if i == 0 => write!(f, "{name}")?,
                Step::Key(name) => write!(f, ".{name}")?,
                Step::Index(index) => write!(f, "[{index}]")?,
            }
        }
        Ok(())
    }
}
