//! All tests of the crate that go through its public functions.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

mod bound;
mod common;
mod direct;
mod grow;
mod local;
mod machine;
mod moving;
mod plate;
mod reduce;
mod refine;
