//! The digital closed loop at constant p, several experiments as lanes of one batch.

use crate::DigitalController;
use crate::separation::SampledSeparation;

/// Both difference equations, padded to order N, with the plant between them.
pub(crate) struct DigitalLoop<const N: usize> {
    plant: SampledSeparation,
    /// B and A of each controller without A's leading one: `direct` is the coefficient of z^0.
    direct: [f64; 2],
    forward: [[f64; N]; 2],
    back: [[f64; N]; 2],
}

/// States of L experiments, innermost index the lane, so that the compiler computes the lanes together.
#[derive(Clone)]
pub(crate) struct LoopState<const N: usize, const L: usize> {
    position: [[f64; L]; 2],
    speed: [[f64; L]; 2],
    flexible: [[f64; L]; 4],
    filters: [[[f64; L]; N]; 2],
}

/// One period of one experiment: references in, noise in `outputs`, replaced by the measured outputs.
pub(crate) struct LaneSignals<'a> {
    pub(crate) references: [&'a [f64]; 2],
    pub(crate) outputs: [&'a mut [f64]; 2],
    pub(crate) inputs: [&'a mut [f64]; 2],
}

impl<const N: usize, const L: usize> LoopState<N, L> {
    /// Everything at rest at zero.
    pub(crate) fn new() -> Self {
        Self {
            position: [[0.0; L]; 2],
            speed: [[0.0; L]; 2],
            flexible: [[0.0; L]; 4],
            filters: [[[0.0; L]; N]; 2],
        }
    }
}

impl<const N: usize> DigitalLoop<N> {
    /// Controllers of order N or less.
    pub(crate) fn new(plant: SampledSeparation, controllers: &[DigitalController; 2]) -> Self {
        let pad = |c: &[f64]| std::array::from_fn(|i| c.get(i + 1).copied().unwrap_or(0.0));
        Self {
            plant,
            direct: [0, 1].map(|i: usize| controllers[i].numerator().first().copied().unwrap_or(0.0)),
            forward: [0, 1].map(|i: usize| pad(controllers[i].numerator())),
            back: [0, 1].map(|i: usize| pad(controllers[i].denominator())),
        }
    }

    /// Advances all lanes over one period. All slices have one length.
    pub(crate) fn run<const L: usize>(&self, state: &mut LoopState<N, L>, lanes: &mut [LaneSignals<'_>; L]) {
        let samples = lanes.iter().map(|l| l.references[0].len()).min().unwrap_or(0);
        let LoopState {
            mut position,
            mut speed,
            mut flexible,
            mut filters,
        } = state.clone();
        let SampledSeparation { t, a, b, c } = self.plant;
        let half = 0.5 * t * t;
        for k in 0..samples {
            let mut u = [[0.0; L]; 2];
            for i in 0..2 {
                for lane in 0..L {
                    // y' = z + C_e e, then the noise of (11), which the loop feeds back.
                    let y = position[i][lane] + c[i][0] * flexible[0][lane] + c[i][1] * flexible[1][lane];
                    let signals = &mut lanes[lane];
                    let measured = y + signals.outputs[i][k];
                    signals.outputs[i][k] = measured;
                    let e = signals.references[i][k] - measured;
                    // Transposed direct form II: u = B/A e.
                    let v = self.direct[i] * e + if N > 0 { filters[i][0][lane] } else { 0.0 };
                    for j in 0..N {
                        let next = if j + 1 < N { filters[i][j + 1][lane] } else { 0.0 };
                        filters[i][j][lane] = next + self.forward[i][j] * e - self.back[i][j] * v;
                    }
                    signals.inputs[i][k] = v;
                    u[i][lane] = v;
                }
            }
            let mut next = [[0.0; L]; 4];
            for row in 0..4 {
                for lane in 0..L {
                    let free = (a[row][0] * flexible[0][lane] + a[row][1] * flexible[1][lane])
                        + (a[row][2] * flexible[2][lane] + a[row][3] * flexible[3][lane]);
                    next[row][lane] = free + (b[row][0] * u[0][lane] + b[row][1] * u[1][lane]);
                }
            }
            flexible = next;
            for i in 0..2 {
                for lane in 0..L {
                    position[i][lane] += t * speed[i][lane] + half * u[i][lane];
                    speed[i][lane] += t * u[i][lane];
                }
            }
        }
        *state = LoopState {
            position,
            speed,
            flexible,
            filters,
        };
    }
}
