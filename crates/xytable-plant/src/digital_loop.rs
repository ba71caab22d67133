//! The digital closed loop at constant p, two experiments at once.

use crate::DigitalController;
use crate::separation::SampledSeparation;
use pulp::{Simd, WithSimd};

/// One number of each axis and experiment: the first axis in both experiments, then the second one.
type Four = [f64; 4];

/// Both difference equations, padded to order N, 1 or more, with the plant between them.
pub(crate) struct DigitalLoop<const N: usize> {
    /// Sample time.
    t: f64,
    /// Flexible states to the next deflections, and to their next rates.
    a: [[Four; 4]; 2],
    /// The same from the inputs.
    b: [[Four; 2]; 2],
    /// Deflections to outputs.
    c: [Four; 2],
    /// B and A of each controller without A's leading one: `direct` is the coefficient of z^0.
    direct: Four,
    forward: [Four; N],
    back: [Four; N],
}

/// States of two experiments.
#[derive(Clone)]
pub(crate) struct LoopState<const N: usize> {
    position: Four,
    speed: Four,
    /// Deflections, then their rates.
    flexible: [Four; 2],
    filters: [Four; N],
}

/// One period of one experiment: references in, noise in `outputs`, replaced by the measured outputs.
pub(crate) struct ExperimentSignals<'a> {
    pub(crate) references: [&'a [f64]; 2],
    pub(crate) outputs: [&'a mut [f64]; 2],
    pub(crate) inputs: [&'a mut [f64]; 2],
}

impl<const N: usize> LoopState<N> {
    /// Everything at rest at zero.
    pub(crate) fn new() -> Self {
        let rest = [0.0; 4];
        Self {
            position: rest,
            speed: rest,
            flexible: [rest; 2],
            filters: [rest; N],
        }
    }
}

impl<const N: usize> DigitalLoop<N> {
    /// Controllers of order N or less.
    pub(crate) fn new(plant: SampledSeparation, controllers: &[DigitalController; 2]) -> Self {
        let by_axis = |[first, second]: [f64; 2]| [first, first, second, second];
        let coefficient = |of: fn(&DigitalController) -> &[f64], power: usize| {
            by_axis([0, 1].map(|axis: usize| of(&controllers[axis]).get(power).copied().unwrap_or(0.0)))
        };
        let SampledSeparation { t, a, b, c } = plant;
        Self {
            t,
            a: [0, 2].map(|r| std::array::from_fn(|j| by_axis([a[r][j], a[r + 1][j]]))),
            b: [0, 2].map(|r| std::array::from_fn(|j| by_axis([b[r][j], b[r + 1][j]]))),
            c: std::array::from_fn(|j| by_axis([c[0][j], c[1][j]])),
            direct: coefficient(DigitalController::numerator, 0),
            forward: std::array::from_fn(|j| coefficient(DigitalController::numerator, j + 1)),
            back: std::array::from_fn(|j| coefficient(DigitalController::denominator, j + 1)),
        }
    }

    /// Advances both experiments over one period. All slices have one length.
    pub(crate) fn run(&self, state: &mut LoopState<N>, experiments: &mut [ExperimentSignals<'_>; 2]) {
        pulp::Arch::new().dispatch(Period {
            model: self,
            state,
            experiments,
        });
    }
}

/// A period, in the registers of one kind of machine: the bits are the same in all.
struct Period<'a, 'b, const N: usize> {
    model: &'a DigitalLoop<N>,
    state: &'a mut LoopState<N>,
    experiments: &'a mut [ExperimentSignals<'b>; 2],
}

impl<const N: usize> WithSimd for Period<'_, '_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let DigitalLoop {
            t,
            a,
            b,
            c,
            direct,
            forward,
            back,
        } = self.model;
        let (t, half) = ([*t; 4], [0.5 * t * t; 4]);
        let LoopState {
            mut position,
            mut speed,
            mut flexible,
            mut filters,
        } = self.state.clone();
        let [one, other] = self.experiments;
        let samples = one.references[0].len();
        let [r0, r2] = one.references;
        let [r1, r3] = other.references;
        let references = [r0, r1, r2, r3].map(|r| &r[..samples]);
        let [y0, y2] = &mut one.outputs;
        let [y1, y3] = &mut other.outputs;
        let outputs = [y0, y1, y2, y3].map(|y| &mut y[..samples]);
        let [u0, u2] = &mut one.inputs;
        let [u1, u3] = &mut other.inputs;
        let inputs = [u0, u1, u2, u3].map(|u| &mut u[..samples]);
        for k in 0..samples {
            let deflections = [first(flexible[0]), second(flexible[0])];
            let rates = [first(flexible[1]), second(flexible[1])];
            // y' = z + C_e e, then the noise of (11), which the loop feeds back.
            let y = add(
                add(position, mul(c[0], deflections[0])),
                mul(c[1], deflections[1]),
            );
            let measured = add(y, std::array::from_fn(|i| outputs[i][k]));
            let e = sub(std::array::from_fn(|i| references[i][k]), measured);
            // Transposed direct form II: u = B/A e.
            let v = add(mul(*direct, e), filters[0]);
            for j in 0..N {
                let next = if j + 1 < N { filters[j + 1] } else { [0.0; 4] };
                filters[j] = sub(add(next, mul(forward[j], e)), mul(back[j], v));
            }
            for i in 0..4 {
                outputs[i][k] = measured[i];
                inputs[i][k] = v[i];
            }
            let u = [first(v), second(v)];
            for (next, (a, b)) in flexible.iter_mut().zip(a.iter().zip(b)) {
                let free = add(
                    add(mul(a[0], deflections[0]), mul(a[1], deflections[1])),
                    add(mul(a[2], rates[0]), mul(a[3], rates[1])),
                );
                *next = add(free, add(mul(b[0], u[0]), mul(b[1], u[1])));
            }
            position = add(position, add(mul(t, speed), mul(half, v)));
            speed = add(speed, mul(t, v));
        }
        *self.state = LoopState {
            position,
            speed,
            flexible,
            filters,
        };
    }
}

/// Those of the first axis, for both.
#[inline(always)]
fn first([a, b, _, _]: Four) -> Four {
    [a, b, a, b]
}

/// Those of the second axis, for both.
#[inline(always)]
fn second([_, _, a, b]: Four) -> Four {
    [a, b, a, b]
}

#[inline(always)]
fn add(a: Four, b: Four) -> Four {
    std::array::from_fn(|i| a[i] + b[i])
}

#[inline(always)]
fn sub(a: Four, b: Four) -> Four {
    std::array::from_fn(|i| a[i] - b[i])
}

#[inline(always)]
fn mul(a: Four, b: Four) -> Four {
    std::array::from_fn(|i| a[i] * b[i])
}
