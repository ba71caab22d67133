//! The program as a user meets it: files in, files out, exit codes, messages.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]
#![allow(clippy::panic, reason = "a model of the wrong kind must fail the test")]

mod bad_input;
mod convert;
mod diagnose;
mod help;
mod identify;
mod identify_time;
mod inspect;
mod new;
mod python;
mod report;
mod small;
mod validate;

#[path = "../common/mod.rs"]
mod common;

#[path = "../../../experiment-data/tests/broken/mod.rs"]
mod broken;
