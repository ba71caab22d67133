//! An LFR along a moving p: the state coordinates are those of the LFR.

use super::along::{Dynamics, Transition};
use super::data::MovingRecord;
use super::flow::{Flow, Want, add_product, join, multiply};
use crate::Candidate;
use crate::frozen::{Closure, Frozen, close};
use lpv_core::{Continuous, Discrete};
use nalgebra::{DMatrix, DVector};

/// Weights of the two generators in the two exponentials of \[blanes2006\], as in `Lfr::transition`.
const WEIGHTS: [[f64; 2]; 2] = [
    [0.538_675_134_594_812_9, -0.038_675_134_594_812_88],
    [-0.038_675_134_594_812_88, 0.538_675_134_594_812_9],
];

/// A candidate with its free entries as parameters.
pub(crate) struct Fixed<'a> {
    pub(crate) candidate: &'a Candidate<Continuous>,
    pub(crate) free: Vec<(usize, usize)>,
    pub(crate) clock: Discrete,
}

impl<'a> Fixed<'a> {
    pub(crate) fn new(candidate: &'a Candidate<Continuous>, clock: Discrete) -> Self {
        Self {
            free: candidate.free_entries(),
            candidate,
            clock,
        }
    }

    fn close(&self, p: &[f64], want: Want) -> Option<Frozen> {
        let closure = match want {
            Want::Value => Closure::Value,
            Want::Derivative => Closure::Derivative,
        };
        let c = self.candidate;
        close(c.matrix(), c.shape(), &c.deltas_at(&inside(c, p)), closure)
    }
}

/// p held at the bounds of the range, as `Lfr::transition` does.
fn inside(candidate: &Candidate<Continuous>, p: &[f64]) -> Vec<f64> {
    let bounds = candidate.range().bounds();
    p.iter().zip(bounds).map(|(v, &[l, u])| v.clamp(l, u)).collect()
}

pub(crate) struct FixedStep {
    transition: Transition,
    flows: [Flow; 2],
    rows: DMatrix<f64>,
    /// `weight after_q left_i`, one `n x rows of M` matrix a term of the derivative.
    left: Vec<DMatrix<f64>>,
    /// `right_i before_q`, one `columns of M x (n + n_u)` matrix a term.
    right: Vec<DMatrix<f64>>,
    terms: usize,
    output: Option<Frozen>,
    seen: DVector<f64>,
}

impl AsRef<Transition> for FixedStep {
    fn as_ref(&self) -> &Transition {
        &self.transition
    }
}

impl Dynamics for Fixed<'_> {
    type Step = FixedStep;

    fn states(&self) -> usize {
        self.candidate.states()
    }
    fn parameters(&self) -> usize {
        self.free.len()
    }
    fn storage(&self, record: &MovingRecord) -> FixedStep {
        let (n, nu, ny) = (self.states(), record.inputs.nrows(), record.outputs.nrows());
        FixedStep {
            transition: Transition {
                ab: DMatrix::zeros(n, n + nu),
                c: DMatrix::zeros(ny, n),
            },
            flows: [Flow::default(), Flow::default()],
            rows: DMatrix::zeros(n, n + nu),
            left: Vec::new(),
            right: Vec::new(),
            terms: 0,
            output: None,
            seen: DVector::zeros(self.candidate.matrix().ncols()),
        }
    }

    fn step(&self, record: &MovingRecord, k: usize, want: Want, step: &mut FixedStep) -> Option<()> {
        let (n, t) = (self.states(), self.clock.sample_time());
        let m = self.candidate.matrix();
        let [early, late] = record.nodes.after(k);
        let ends = [self.close(early, want)?, self.close(late, want)?];
        for (flow, weights) in step.flows.iter_mut().zip(WEIGHTS) {
            let (one, other) = (ends[0].s.rows(0, n), ends[1].s.rows(0, n));
            step.rows
                .zip_zip_apply(&one, &other, |r, a, b| *r = t * (weights[0] * a + weights[1] * b));
            flow.update(&step.rows, want)?;
        }
        join(
            &step.flows[1].whole,
            &step.flows[0].whole,
            &mut step.transition.ab,
        );
        let output = self.close(record.scheduling.column(k).as_slice(), want)?;
        let outputs = output.s.nrows() - n;
        step.transition.c.copy_from(&output.s.view((n, 0), (outputs, n)));
        step.output = Some(output);
        step.terms = 0;
        if want == Want::Value {
            return Some(());
        }
        let [first, second] = &step.flows;
        let later = second.whole.columns(0, n).into_owned();
        let (nc, all) = (self.candidate.channels().len(), step.rows.ncols());
        // [I, M_ab K] and [I; K M_ba] without their unit matrices.
        let feeds = ends
            .each_ref()
            .map(|end| end.left.view((0, m.nrows() - nc), (n, nc)).into_owned());
        let sees = ends.each_ref().map(|end| end.right.rows(all, nc).into_owned());
        let mut after = DMatrix::zeros(n, n);
        let mut before = DMatrix::zeros(n, all);
        let mut whole = DMatrix::identity(all, all);
        let mut through = [DMatrix::zeros(n, nc), DMatrix::zeros(nc, all)];
        for (flow, weights, is_first) in [(first, WEIGHTS[0], true), (second, WEIGHTS[1], false)] {
            for product in flow.products() {
                if is_first {
                    multiply(&later, &product.after, &mut after);
                    before.copy_from(&product.before);
                } else {
                    after.copy_from(&product.after);
                    join(&product.before, &first.whole, &mut before);
                }
                whole.rows_mut(0, n).copy_from(&before);
                for (end, weight) in [0, 1].into_iter().zip(weights) {
                    if step.left.len() == step.terms {
                        step.left.push(DMatrix::zeros(n, m.nrows()));
                        step.right.push(DMatrix::zeros(m.ncols(), whole.ncols()));
                    }
                    let (left, right) = (&mut step.left[step.terms], &mut step.right[step.terms]);
                    let factor = product.weight * weight * t;
                    through[0].fill(0.0);
                    add_product(factor, &after, &feeds[end], &mut through[0]);
                    multiply(&sees[end], &whole, &mut through[1]);
                    left.columns_mut(0, n).zip_apply(&after, |l, a| *l = factor * a);
                    left.columns_mut(m.nrows() - nc, nc).copy_from(&through[0]);
                    right.rows_mut(0, all).copy_from(&whole);
                    right.rows_mut(all, nc).copy_from(&through[1]);
                    step.terms += 1;
                }
            }
        }
        Some(())
    }

    fn add_output(&self, step: &FixedStep, x: &DVector<f64>, sensitivity: &mut DMatrix<f64>) {
        let n = self.states();
        let Some(output) = &step.output else { return };
        let seen = output.right.columns(0, n) * x;
        let left = output.left.rows(n, sensitivity.nrows());
        for (mut column, &(r, c)) in sensitivity.column_iter_mut().zip(&self.free) {
            column.axpy(seen[c], &left.column(r), 1.0);
        }
    }

    fn force(&self, step: &mut FixedStep, signal: &DVector<f64>, sensitivity: &mut DMatrix<f64>) {
        let n = self.states();
        for (left, right) in step.left.iter().zip(&step.right).take(step.terms) {
            step.seen.gemv(1.0, right, signal, 0.0);
            let left = left.as_slice();
            for (column, &(r, c)) in sensitivity.as_mut_slice().chunks_exact_mut(n).zip(&self.free) {
                let seen = step.seen[c];
                for (out, l) in column.iter_mut().zip(&left[r * n..(r + 1) * n]) {
                    *out += seen * l;
                }
            }
        }
    }
}
