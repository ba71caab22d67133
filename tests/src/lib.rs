//! Helpers for the tests across crates.
