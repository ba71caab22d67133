//! All tests of the crate that go through its public functions.

#![allow(clippy::unwrap_used, clippy::panic)]

mod constant_position;
mod effects;
mod moving;
mod multisine;
mod profile;
mod reference;
mod wild;
