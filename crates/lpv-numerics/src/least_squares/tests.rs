use super::*;
use nalgebra::{dmatrix, dvector};

/// Rosenbrock's valley: `r = (1 - a, 10 (b - a^2))`.
struct Valley {
    iterations: usize,
}

impl Search for Valley {
    type Point = DVector<f64>;
    type Linear = Quadratic;
    type Error = std::convert::Infallible;

    fn cost(&self, x: &DVector<f64>) -> f64 {
        residual(x).norm_squared()
    }

    fn ended(&mut self, _: &DVector<f64>, history: &[f64], _: &mut f64) -> Option<StopReason> {
        if history.last().is_some_and(|cost| *cost < 1e-28) {
            return Some(StopReason::TargetReached);
        }
        (history.len() > self.iterations).then_some(StopReason::IterationLimit)
    }

    fn linearise(&mut self, x: &mut DVector<f64>) -> Result<ControlFlow<StopReason, Quadratic>, Self::Error> {
        let jacobian = dmatrix![-1.0, 0.0; -20.0 * x[0], 10.0];
        let none = DMatrix::zeros(2, 0);
        Ok(ControlFlow::Continue(Quadratic::new(
            &jacobian,
            &residual(x),
            &none,
        )))
    }

    fn trial(&mut self, x: &DVector<f64>, linear: &Quadratic, damping: f64) -> Trial<DVector<f64>> {
        linear.step(damping).map_or(Trial::Refused, |step| Trial::To {
            point: x + &linear.map * step.y,
            predicted: step.predicted,
        })
    }
}

fn residual(x: &DVector<f64>) -> DVector<f64> {
    dvector![1.0 - x[0], 10.0 * (x[1] - x[0] * x[0])]
}

#[test]
fn the_valley_is_followed_by_every_rule_of_damping() {
    for (after_descent, after_refusal) in [
        (AfterDescent::Nielsen, AfterRefusal::Doubling),
        (AfterDescent::Divide(6.0), AfterRefusal::Multiply(4.0)),
    ] {
        let rule = Damping {
            start: 1e-3,
            least: 1e-15,
            most: 1e6,
            attempts: usize::MAX,
            after_descent,
            after_refusal,
        };
        let found = minimise(&mut Valley { iterations: 100 }, dvector![-1.2, 1.0], &rule).unwrap();
        assert_eq!(found.stop, StopReason::TargetReached);
        assert!((found.point - dvector![1.0, 1.0]).amax() < 1e-13);
        assert!(
            found.history.windows(2).all(|h| h[1] < h[0]),
            "{:?}",
            found.history
        );
        let few = minimise(&mut Valley { iterations: 3 }, dvector![-1.2, 1.0], &rule).unwrap();
        assert_eq!((few.stop, few.history.len()), (StopReason::IterationLimit, 4));
    }
}

#[test]
fn a_direction_of_the_coordinates_is_left_alone() {
    // The residual knows a + b alone; its tangent is (1, -1).
    let jacobian = dmatrix![1.0, 1.0; 2.0, 2.0; 0.0, 0.0];
    let near = Quadratic::new(&jacobian, &dvector![1.0, 1.0, 5.0], &dmatrix![1.0; -1.0]);
    assert_eq!(near.map.ncols(), 1);
    let step = near.step(0.0).unwrap();
    let moved = &near.map * &step.y;
    assert!((moved - dvector![-0.3, -0.3]).amax() < 1e-14);
    assert!((step.predicted - 1.8).abs() < 1e-14 && (near.decrease() - 1.8).abs() < 1e-14);
    // The Jacobian along the one unit direction has a square of two.
    let bend = step.correction(&dvector![1.0]).unwrap();
    assert!((bend[0] + 0.25).abs() < 1e-12, "{bend}");
}

#[test]
fn without_a_step_that_descends_it_says_so() {
    struct Up;
    impl Search for Up {
        type Point = f64;
        type Linear = ();
        type Error = ();
        fn cost(&self, x: &f64) -> f64 {
            *x
        }
        fn ended(&mut self, _: &f64, _: &[f64], _: &mut f64) -> Option<StopReason> {
            None
        }
        fn linearise(&mut self, _: &mut f64) -> Result<ControlFlow<StopReason, ()>, ()> {
            Ok(ControlFlow::Continue(()))
        }
        fn trial(&mut self, x: &f64, (): &(), damping: f64) -> Trial<f64> {
            if damping > 1.0 {
                return Trial::Refused;
            }
            Trial::To {
                point: x + damping,
                predicted: 1.0,
            }
        }
    }
    let rule = Damping {
        start: 0.1,
        least: 1e-9,
        most: 100.0,
        attempts: usize::MAX,
        after_descent: AfterDescent::Divide(10.0),
        after_refusal: AfterRefusal::Multiply(10.0),
    };
    let found = minimise(&mut Up, 3.0, &rule).unwrap();
    // 0.1, 1, 10 and 100.
    assert_eq!(
        (found.stop, found.point, found.trials),
        (StopReason::NoDescent, 3.0, 4)
    );
}
