//! The controller of the experiment.

mod fault;
mod state;

use crate::{CoreError, Discrete, StateSpace};
pub use fault::{ControllerFault, ControllerProblem};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
pub use state::ControllerState;
use state::Loop;

/// Decentralised discrete-time controller, one loop an input:
/// `u_i = sat(B_r,i / A_i r_i - B_y,i / A_i y_i)`, coefficients of `z^0, z^-1, ...`.
///
/// The injection of a record is added behind the saturation and is not part of this.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Controller {
    /// B_r, one polynomial a loop, not empty.
    pub reference_numerator: Vec<Vec<f64>>,
    /// B_y, one polynomial a loop, not empty.
    pub feedback_numerator: Vec<Vec<f64>>,
    /// A, one polynomial a loop; its first coefficient is not zero.
    pub denominator: Vec<Vec<f64>>,
    /// Saturation of |u_i| in scaled input units, above zero; none for a linear controller.
    #[serde(default)]
    pub limit: Option<f64>,
}

impl Controller {
    /// Number of loops.
    pub fn loops(&self) -> usize {
        self.denominator.len()
    }

    /// What the controller adds to the input for an error of the output: `B_y / A`, one loop an input, without the limit.
    ///
    /// # Errors
    /// As [`Controller::start`].
    pub fn feedback(&self, clock: Discrete) -> Result<StateSpace<Discrete>, CoreError> {
        self.start()?;
        let mut all: Option<StateSpace<Discrete>> = None;
        for (b, a) in self.feedback_numerator.iter().zip(&self.denominator) {
            let order = b.len().max(a.len()) - 1;
            let coefficient = |v: &[f64], k: usize| v.get(k).copied().unwrap_or(0.0) / a[0];
            let direct = coefficient(b, 0);
            // Observable canonical form: the first state is the output less the direct part.
            let shift = |i: usize, j: usize| f64::from(u8::from(j == i + 1));
            let one = StateSpace::new(
                DMatrix::from_fn(order, order, |i, j| {
                    shift(i, j) - if j == 0 { coefficient(a, i + 1) } else { 0.0 }
                }),
                DMatrix::from_fn(order, 1, |i, _| {
                    coefficient(b, i + 1) - coefficient(a, i + 1) * direct
                }),
                DMatrix::from_fn(1, order, |_, j| f64::from(u8::from(j == 0))),
                DMatrix::from_element(1, 1, direct),
                clock,
            )?;
            all = Some(match all {
                Some(before) => before.beside(&one)?,
                None => one,
            });
        }
        match all {
            Some(all) => Ok(all),
            None => Ok(StateSpace::gain(DMatrix::zeros(0, 0), clock)?),
        }
    }

    /// A controller at rest.
    ///
    /// # Errors
    /// [`CoreError::Controller`] if the polynomials are empty, not finite, not causal or not one a loop.
    pub fn start(&self) -> Result<ControllerState, CoreError> {
        let loops = self.loops();
        self.check(loops)?;
        let loops = (0..loops)
            .map(|i| {
                Loop::new(
                    &self.reference_numerator[i],
                    &self.feedback_numerator[i],
                    &self.denominator[i],
                )
            })
            .collect();
        Ok(ControllerState {
            loops,
            limit: self.limit.unwrap_or(f64::INFINITY),
        })
    }

    /// Checks that there is one polynomial a loop, as many as inputs, each finite, and each denominator causal.
    ///
    /// # Errors
    /// [`ControllerFault`].
    pub fn check(&self, inputs: usize) -> Result<(), ControllerFault> {
        let lists = [
            ("reference_numerator", &self.reference_numerator),
            ("feedback_numerator", &self.feedback_numerator),
            ("denominator", &self.denominator),
        ];
        for (key, polynomials) in lists {
            let fault = |at: &[usize], problem| {
                Err(ControllerFault {
                    key,
                    at: at.to_vec(),
                    problem,
                })
            };
            if polynomials.is_empty() || polynomials.len() != inputs {
                let (expected, found) = (inputs, polynomials.len());
                return fault(&[], ControllerProblem::Loops { expected, found });
            }
            for (i, polynomial) in polynomials.iter().enumerate() {
                if polynomial.is_empty() {
                    return fault(&[i], ControllerProblem::EmptyPolynomial);
                }
                if let Some(k) = polynomial.iter().position(|c| !c.is_finite()) {
                    let value = polynomial[k];
                    return fault(&[i, k], ControllerProblem::NotFinite { value });
                }
                // Dividing by a subnormal first coefficient would overflow, which is no controller either.
                if key == "denominator" && !polynomial[0].is_normal() {
                    return fault(&[i, 0], ControllerProblem::NotCausal);
                }
            }
        }
        match self.limit {
            Some(value) if !(value.is_finite() && value > 0.0) => Err(ControllerFault {
                key: "limit",
                at: Vec::new(),
                problem: ControllerProblem::Limit { value },
            }),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Record, Signals};
    use proptest::prelude::*;

    fn one(b_r: &[f64], b_y: &[f64], a: &[f64], limit: Option<f64>) -> Controller {
        Controller {
            reference_numerator: vec![b_r.to_vec()],
            feedback_numerator: vec![b_y.to_vec()],
            denominator: vec![a.to_vec()],
            limit,
        }
    }

    /// With references at rest, the state space of the feedback and the difference equation differ in sign only.
    #[test]
    fn feedback_is_the_part_that_sees_the_output() {
        let controller = one(&[0.0, 0.3], &[0.4, -0.1, 0.2], &[2.0, -1.0, 0.3, 0.1], None);
        let clock = Discrete::new(0.1).unwrap();
        let feedback = controller.feedback(clock).unwrap();
        let e = DMatrix::from_fn(1, 30, |_, k| ((3 * k) as f64).sin());
        let rest = nalgebra::DVector::zeros(feedback.states());
        let run = feedback.simulate(&rest, &e).unwrap().outputs;
        let mut state = controller.start().unwrap();
        for k in 0..30 {
            let mut u = [0.0];
            state.step(&[0.0], &[-e[k]], &mut u);
            assert!((u[0] - run[k]).abs() < 1e-14, "{k}");
        }
    }

    #[test]
    fn integrator_by_hand() {
        // u(k) = u(k-1) + 0.5 (r(k-1) - y(k-1)), written with A = 2 - 2 z^-1.
        let mut state = one(&[0.0, 1.0], &[0.0, 1.0], &[2.0, -2.0], Some(1.2))
            .start()
            .unwrap();
        let mut seen = Vec::new();
        for (r, y) in [(1.0, 0.0), (1.0, -1.0), (1.0, 1.0), (0.0, 0.0)] {
            let mut u = [0.0];
            state.step(&[r], &[y], &mut u);
            seen.push(u[0]);
        }
        // 0, 0.5, 1.5 saturated, and 1.5 again: the state is not saturated.
        assert_eq!(seen, [0.0, 0.5, 1.2, 1.2]);
        state.reset();
        let mut u = [7.0, 8.0];
        state.step(&[1.0], &[], &mut u);
        assert_eq!(u, [0.0, 8.0]);
    }

    #[test]
    fn refuses_what_is_no_controller() {
        let text = |c: Controller| c.start().unwrap_err().to_string();
        assert!(text(one(&[1.0], &[1.0], &[0.0, 1.0], None)).contains("controller.denominator[0][0]"));
        assert!(text(one(&[], &[1.0], &[1.0], None)).contains("reference_numerator[0]: an empty polynomial"));
        assert!(text(one(&[1.0], &[f64::NAN], &[1.0], None)).contains("NaN is not a finite number"));
        assert!(text(one(&[1.0], &[1.0], &[1.0], Some(0.0))).contains("controller.limit: limit 0"));
        let mut c = one(&[1.0], &[1.0], &[1.0], None);
        c.feedback_numerator.clear();
        assert!(text(c).contains("a list of 0 polynomials for 1 inputs"));
    }

    /// A record cut out of another begins with the controller of that instant; the whole one at rest.
    #[test]
    fn a_controller_in_motion_is_found() {
        let controller = one(&[0.9, -0.5], &[1.0, -0.4, 0.2], &[1.0, -1.6, 0.7], Some(3.0));
        let wave = |k: usize, rate: f64| (rate * k as f64).sin() + 0.3 * (2.3 * rate * k as f64).cos();
        let mut state = controller.start().unwrap();
        let (mut r, mut y, mut u, mut d) = (vec![], vec![], vec![], vec![]);
        let mut states = vec![];
        for k in 0..120 {
            states.push(state.clone());
            r.push(wave(k, 0.11));
            y.push(wave(k + 7, 0.11));
            d.push(if k > 50 { 0.5 } else { 0.0 });
            let mut own = [0.0];
            state.step(&[r[k]], &[y[k]], &mut own);
            u.push(own[0] + d[k]);
        }
        assert!(u.iter().any(|u| u.abs() >= 3.0), "the limit is reached");
        let record = |from: usize| {
            let signal = |v: &[f64]| Signals::new(&["a"], vec![v[from..].to_vec()]);
            let none = || Signals::new(&[], vec![]);
            Record {
                name: "cut".to_owned(),
                kind: crate::RecordKind::Transient,
                purpose: crate::Purpose::Estimation,
                position: None,
                outputs: signal(&y),
                inputs: signal(&u),
                references: signal(&r),
                scheduling: none(),
                auxiliary: none(),
                injection: signal(&d),
            }
        };
        let at_rest = controller.start().unwrap();
        assert_eq!(at_rest.begun(&record(0)), None);
        let found = at_rest.begun(&record(40)).expect("in motion");
        for (a, b) in found.loops[0].s.iter().zip(&states[40].loops[0].s) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        // No state makes these inputs.
        let mut other = record(40);
        other.inputs.columns[0]
            .iter_mut()
            .enumerate()
            .for_each(|(k, u)| *u = f64::from(u8::from(k % 2 == 0)));
        assert_eq!(at_rest.begun(&other), None);
    }

    proptest! {
        /// The recursion equals the difference equation A u = B_r r - B_y y.
        #[test]
        fn satisfies_the_difference_equation(
            b_r in prop::collection::vec(-2.0..2.0f64, 1..5),
            b_y in prop::collection::vec(-2.0..2.0f64, 1..5),
            tail in prop::collection::vec(-0.3..0.3f64, 0..4),
            a0 in prop_oneof![0.5..2.0f64, -2.0..-0.5f64],
            signals in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 1..30),
        ) {
            let mut a = vec![a0];
            a.extend(&tail);
            let mut state = one(&b_r, &b_y, &a, None).start().unwrap();
            let mut us = Vec::new();
            for (r, y) in &signals {
                let mut u = [0.0];
                state.step(&[*r], &[*y], &mut u);
                us.push(u[0]);
            }
            let fir = |p: &[f64], x: &dyn Fn(usize) -> f64, k: usize| -> f64 {
                (0..p.len().min(k + 1)).map(|i| p[i] * x(k - i)).sum()
            };
            for k in 0..us.len() {
                let left = fir(&a, &|i| us[i], k);
                let right = fir(&b_r, &|i| signals[i].0, k) - fir(&b_y, &|i| signals[i].1, k);
                let size = us.iter().fold(1.0f64, |m, u| m.max(u.abs()));
                prop_assert!((left - right).abs() < 1e-12 * size, "{left} {right}");
            }
        }

        /// Any numbers at all: an error or a run, never a panic.
        #[test]
        fn wild_numbers_never_panic(
            lists in prop::collection::vec(prop::collection::vec(prop::collection::vec(any::<f64>(), 0..4), 0..3), 3),
            limit in prop::option::of(any::<f64>()),
            x in any::<f64>(),
        ) {
            let c = Controller {
                reference_numerator: lists[0].clone(),
                feedback_numerator: lists[1].clone(),
                denominator: lists[2].clone(),
                limit,
            };
            if let Ok(mut state) = c.start() {
                let mut u = [0.0; 2];
                state.step(&[x], &[x, x, x], &mut u);
            }
        }
    }
}
