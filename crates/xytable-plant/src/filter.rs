//! A difference equation with its memory, for one signal.

use crate::DigitalController;

/// Transposed direct form II of `B/A`.
#[derive(Debug, Clone)]
pub(crate) struct Filter {
    forward: Vec<f64>,
    back: Vec<f64>,
    memory: Vec<f64>,
}

impl Filter {
    pub(crate) fn new(controller: &DigitalController) -> Self {
        // One memory cell more than the order: the last stays zero and saves a case in the loop.
        Self {
            forward: controller.numerator().to_vec(),
            back: controller.denominator().to_vec(),
            memory: vec![0.0; controller.order() + 1],
        }
    }

    pub(crate) fn next(&mut self, e: f64) -> f64 {
        let u = self.memory[0] + self.forward[0] * e;
        for j in 1..self.forward.len() {
            self.memory[j - 1] = self.memory[j] + self.forward[j] * e - self.back[j] * u;
        }
        u
    }
}
