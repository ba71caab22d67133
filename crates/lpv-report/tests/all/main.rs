//! All tests of the crate that go through its public functions.

mod figures;
mod page;
