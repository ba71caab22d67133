//! Where there are no such registers, there is no plan.

use crate::moments::{Observed, Part};
use pulp::Simd;
use std::sync::Arc;

/// None.
#[derive(Debug, Clone)]
pub(crate) enum Plan {}

impl Plan {
    pub(crate) fn new(_length: usize) -> Option<Arc<Self>> {
        None
    }

    pub(crate) fn size(&self) -> usize {
        match *self {}
    }

    pub(crate) fn transform(&self, _pair: [Centred<'_>; 2], _out: &mut [f64]) -> [f64; 2] {
        match *self {}
    }
}

/// A signal of a pair.
#[derive(Debug, Clone, Copy)]
#[allow(dead_code, reason = "there is no plan that would read them")]
pub(crate) struct Centred<'a> {
    pub(crate) signal: &'a [f64],
    pub(crate) offset: f64,
    pub(crate) scale: f64,
}

/// None.
pub(crate) struct Blocks<'a>(&'a Plan);

impl<'a> Blocks<'a> {
    pub(crate) fn new(plan: &'a Plan, _waiting: &[f64], _channels: usize, _scales: &[f64]) -> Self {
        match *plan {}
    }

    pub(crate) fn blocks(_length: usize) -> usize {
        0
    }

    pub(crate) fn place(_length: usize, k: usize) -> usize {
        k
    }
}

impl Observed for Blocks<'_> {
    fn count(&self) -> usize {
        match *self.0 {}
    }

    fn chunk<S: Simd, const COUNT: usize>(&mut self, _: S, _: usize, _: usize, _: &mut [[Part; 2]]) {
        match *self.0 {}
    }
}
