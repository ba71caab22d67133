//! The program as a user meets it: files in, files out, exit codes, messages.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]
#![allow(clippy::panic, reason = "a model of the wrong kind must fail the test")]

mod accounts;
mod bad_input;
mod browser;
mod common;
mod convert;
mod diagnose;
mod findings;
mod fleet;
mod foreign_text;
mod help;
mod identify;
mod identify_time;
mod inspect;
mod manners;
mod memory;
mod new;
mod new_files;
mod new_responses;
mod own_effects;
mod pages;
mod plane;
mod python;
mod report;
mod responses;
mod safety;
mod simulate;
mod small;
mod stopping;
mod tutorial;
mod units;
mod validate;

#[path = "../../../experiment-data/tests/all/broken/mod.rs"]
mod broken;
