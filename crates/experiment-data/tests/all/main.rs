//! All tests of the crate that go through its public functions.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests, too

mod bad_input;
mod broken;
mod common;
mod fixtures;
mod foreign_files;
mod foreign_tables;
mod instruments;
mod many;
mod odd_and_fine;
mod responses;
mod round_trips;
mod schema;
mod shared_data;
mod text_tables;
