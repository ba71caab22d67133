//! All tests of the crate that go through its public functions.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

mod bound;
#[path = "../../../lfr-fit/tests/all/common/mod.rs"]
mod common;
mod direct;
mod exact;
mod reduce;
