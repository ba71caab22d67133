//! Fits of the default machine and of small systems made by hand.

#![allow(clippy::unwrap_used)] // helpers of tests

mod exact;
mod machine;
mod noise;
mod speed;
mod wild;
