//! All tests of the crate that go through its public functions.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

mod axis;
mod common;
mod grow;
mod local;
mod machine;
mod moving;
mod plate;
mod refine;
