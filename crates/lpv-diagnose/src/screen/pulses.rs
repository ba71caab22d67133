//! How forces and errors of the sensors show in the errors of the loop, as a quick look sees it.

use crate::base::{Base, Pair};
use crate::whiten::Whitening;
use lpv_core::{Continuous, ControllerState, Discrete, StateSpace};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64 as C64;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// White errors that follow a pulse, of a loop that is linear and at rest: a signal leaves their convolution with it.
pub(crate) struct Pulses {
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
    inputs: Spectra,
    sensors: Spectra,
    /// Outputs whose errors count.
    channels: usize,
}

/// Spectra by channel of the pulse and output, over the length of the transform; none where nothing follows.
type Spectra = [[Option<Vec<C64>>; 2]; 2];

impl Pulses {
    /// Of a machine in the loop of a controller without saturation, or of an observer, for records of so many samples at the most.
    pub(crate) fn new(
        base: &Base,
        (controller, observes): (&ControllerState, bool),
        whitening: &Whitening,
        (samples, step): (usize, f64),
    ) -> Self {
        // Twice the samples, so that nothing comes round; a multiple that transforms quickly.
        let length = (2 * samples).next_multiple_of(512);
        let mut planner = RealFftPlanner::<f64>::new();
        let (forward, inverse) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
        let at_rest = (Quick::new(base, observes, step), controller.unsaturated());
        let channels = base.channels();
        let spectra = |place: Place| -> Spectra {
            std::array::from_fn(|channel| {
                let mut white = Vec::new();
                if channel < channels {
                    whitening.apply(
                        &after_pulse(at_rest.clone(), (place, channel), samples),
                        &mut white,
                    );
                }
                std::array::from_fn(|output| {
                    let response = white.get(output * samples..(output + 1) * samples)?;
                    if response.iter().all(|w| *w == 0.0) {
                        return None;
                    }
                    let mut spectrum = transformed(&*forward, response.iter().copied());
                    // The transform there and back multiplies by the length.
                    spectrum.iter_mut().for_each(|s| *s /= length as f64);
                    Some(spectrum)
                })
            })
        };
        Self {
            inputs: spectra(Place::Input),
            sensors: spectra(Place::Sensor),
            forward,
            inverse,
            channels,
        }
    }

    /// What inputs beside those of the controller leave, output after output.
    pub(crate) fn inputs(&self, signal: &[Pair], out: &mut Vec<f64>) {
        self.follow(&self.inputs, signal, out);
    }

    /// What errors of the sensors leave, output after output.
    pub(crate) fn sensors(&self, signal: &[Pair], out: &mut Vec<f64>) {
        self.follow(&self.sensors, signal, out);
    }

    fn follow(&self, spectra: &Spectra, signal: &[Pair], out: &mut Vec<f64>) {
        let causes: [Option<Vec<C64>>; 2] = std::array::from_fn(|i| {
            let is_there = signal.iter().any(|s| s[i] != 0.0);
            is_there.then(|| transformed(&*self.forward, signal.iter().map(|s| s[i])))
        });
        for output in 0..self.channels {
            let mut sum = vec![C64::ZERO; self.forward.complex_len()];
            for (cause, spectra) in causes.iter().zip(spectra) {
                if let (Some(cause), Some(spectrum)) = (cause, &spectra[output]) {
                    let each = sum.iter_mut().zip(cause.iter().zip(spectrum));
                    each.for_each(|(sum, (a, b))| *sum += a * b);
                }
            }
            let mut white = self.inverse.make_output_vec();
            // A spectrum of real signals: only rounding could make its ends complex.
            if let Some(last) = sum.last_mut() {
                last.im = 0.0;
            }
            sum[0].im = 0.0;
            let done = self.inverse.process(&mut sum, &mut white);
            debug_assert!(done.is_ok(), "lengths are those of the plan");
            out.extend_from_slice(&white[..signal.len()]);
        }
    }
}

/// Spectrum of a signal that is continued by zeros.
fn transformed(transform: &dyn RealToComplex<f64>, signal: impl Iterator<Item = f64>) -> Vec<C64> {
    let mut padded = transform.make_input_vec();
    padded.iter_mut().zip(signal).for_each(|(p, s)| *p = s);
    let mut spectrum = transform.make_output_vec();
    let done = transform.process(&mut padded, &mut spectrum);
    debug_assert!(done.is_ok(), "lengths are those of the plan");
    spectrum
}

/// Where a pulse is added.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Input,
    Sensor,
}

/// What sensors tell after a pulse in the first sample.
fn after_pulse(
    (mut plant, mut controller): (Quick, ControllerState),
    (place, channel): (Place, usize),
    samples: usize,
) -> Vec<Pair> {
    let mut told = Vec::with_capacity(samples);
    for k in 0..samples {
        let pulse: Pair = std::array::from_fn(|i| f64::from(u8::from(k == 0 && i == channel)));
        let mut y = plant.outputs();
        let mut u = [0.0; 2];
        let mut beside = [0.0; 2];
        if place == Place::Sensor {
            (0..2).for_each(|i| y[i] += pulse[i]);
        }
        controller.step(&[0.0; 2], &y, &mut u);
        if place == Place::Input {
            beside = pulse;
        }
        told.push(y);
        plant.advance(u, beside);
    }
    told
}

/// A machine as a quick look sees it.
#[derive(Debug, Clone)]
enum Quick {
    /// Double integrators.
    Rigid {
        /// Inverse of the mass behind an input: one where the decoupling makes it one.
        mobility: f64,
        step: f64,
        position: Pair,
        speed: Pair,
    },
    /// A model in the middle of the range, sampled.
    Sampled {
        model: StateSpace<Discrete>,
        state: DVector<f64>,
        /// Whether what an observer gives has inputs of its own, after the others.
        is_apart: bool,
    },
}

impl Quick {
    fn new(base: &Base, observes: bool, step: f64) -> Self {
        let rigid = |mobility| Self::Rigid {
            mobility,
            step,
            position: [0.0; 2],
            speed: [0.0; 2],
        };
        let model = match base {
            Base::XyTable(_) => return rigid(1.0),
            Base::Axis(axis) if axis.load().is_none() => return rigid(1.0 / axis.mass()),
            Base::Axis(axis) => Discrete::new(step).and_then(|clock| {
                let [a, b, c] = base.frozen(0.0)?;
                // The correction of an observer moves motor and load alike.
                let both = 1.0 / axis.mass();
                let b = DMatrix::from_columns(&[
                    b.column(0).into_owned(),
                    DVector::from_vec(vec![0.0, both, 0.0, both]),
                ]);
                let direct = DMatrix::zeros(c.nrows(), b.ncols());
                StateSpace::new(a, b, c, direct, Continuous)?.zero_order_hold(clock)
            }),
            Base::Lpv(lpv) => Discrete::new(step).and_then(|clock| lpv.sampled(clock)),
        };
        match model {
            Ok(model) => Self::Sampled {
                state: DVector::zeros(model.states()),
                model,
                is_apart: observes && matches!(base, Base::Axis(_)),
            },
            // Numbers of a base are finite.
            Err(_) => rigid(1.0),
        }
    }

    fn outputs(&self) -> Pair {
        match self {
            Self::Rigid { position, .. } => *position,
            Self::Sampled { model, state, .. } => std::array::from_fn(|i| match i < model.outputs() {
                true => model
                    .c()
                    .row(i)
                    .iter()
                    .zip(state.iter())
                    .map(|(c, x)| c * x)
                    .sum(),
                false => 0.0,
            }),
        }
    }

    /// Inputs of the controller, and those beside it.
    fn advance(&mut self, controlled: Pair, beside: Pair) {
        let u = [0, 1].map(|i: usize| controlled[i] + beside[i]);
        match self {
            Self::Rigid {
                mobility,
                step: t,
                position,
                speed,
            } => {
                for i in 0..2 {
                    let a = u[i] * *mobility;
                    position[i] += *t * speed[i] + 0.5 * *t * *t * a;
                    speed[i] += *t * a;
                }
            }
            Self::Sampled {
                model,
                state,
                is_apart,
            } => {
                let mut next = model.a() * &*state;
                let u = if *is_apart { [beside[0], controlled[0]] } else { u };
                for (u, column) in u.iter().zip(model.b().column_iter()) {
                    next.axpy(*u, &column, 1.0);
                }
                *state = next;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Place, Pulses};
    use crate::whiten::Whitening;
    use crate::{Axis, Base, Pair};
    use lpv_core::Controller;

    /// A signal leaves what the loop does to it sample by sample; and the saturation of the controller has no part in it.
    #[test]
    fn a_convolution_is_the_recursion() -> Result<(), Box<dyn std::error::Error>> {
        let (mass, step, samples) = (80.0, 1e-3, 700);
        let base = Base::Axis(Axis::new(mass, 200.0, -3.0));
        let controller = Controller {
            reference_numerator: vec![vec![1.2e6]],
            feedback_numerator: vec![vec![5.2e6, 0.0, -4.0e6]],
            denominator: vec![vec![1.0]],
            limit: Some(1e-3),
        }
        .start()?;
        let noise: Vec<Pair> = (0..samples)
            .map(|k| [(1.7 * k as f64).sin() + (0.3 * k as f64).cos(), 0.0])
            .collect();
        let whitening = Whitening::new(&[noise], 1, 4);
        let pulses = Pulses::new(&base, (&controller, false), &whitening, (samples, step));
        for place in [Place::Input, Place::Sensor] {
            let signal: Vec<Pair> = (0..samples - 50)
                .map(|k| [(0.02 * k as f64).sin() * (1.0 + (0.4 * k as f64).cos()), 0.0])
                .collect();
            let mut found = Vec::new();
            match place {
                Place::Input => pulses.inputs(&signal, &mut found),
                Place::Sensor => pulses.sensors(&signal, &mut found),
            }
            // The loop by hand: a mass at rest, a controller of two samples of the past.
            let (mut x, mut v) = (0.0, 0.0);
            let mut past = [0.0; 2];
            let mut told: Vec<Pair> = Vec::new();
            for s in &signal {
                let y = x + if place == Place::Sensor { s[0] } else { 0.0 };
                let u = 4.0e6 * past[1] - 5.2e6 * y + if place == Place::Input { s[0] } else { 0.0 };
                told.push([y, 0.0]);
                past = [y, past[0]];
                x += step * v + 0.5 * step * step * u / mass;
                v += step * u / mass;
            }
            let mut wanted = Vec::new();
            whitening.apply(&told, &mut wanted);
            assert_eq!(found.len(), wanted.len());
            let size = wanted.iter().fold(0.0, |a: f64, w| a.max(w.abs()));
            for (a, b) in found.iter().zip(&wanted) {
                assert!((a - b).abs() < 1e-10 * size, "{place:?}: {a} {b}");
            }
        }
        Ok(())
    }
}
