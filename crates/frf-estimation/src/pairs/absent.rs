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

    pub(crate) fn transform(&self, _signals: [&[f64]; 2], _offsets: [f64; 2], _out: &mut [f64]) -> bool {
        match *self {}
    }
}

/// None.
pub(crate) struct Blocks(Plan);

impl Blocks {
    pub(crate) fn new(plan: &Plan, _waiting: &[f64], _channels: usize, _count: usize) -> Self {
        match *plan {}
    }

    pub(crate) fn blocks(_length: usize) -> usize {
        0
    }

    pub(crate) fn place(_length: usize, k: usize) -> usize {
        k
    }
}

impl Observed for Blocks {
    fn count(&self) -> usize {
        match self.0 {}
    }

    fn chunk<S: Simd, const COUNT: usize>(&mut self, _: S, _: usize, _: usize, _: &mut [[Part; 2]]) {
        match self.0 {}
    }
}
