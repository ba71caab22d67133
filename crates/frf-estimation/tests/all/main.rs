//! All tests of the crate that go through its public functions.

#![allow(clippy::unwrap_used, clippy::panic)] // A test that cannot go on has failed.

mod common;
mod distortion;
mod identities;
mod local;
mod periodic;
mod wild;
