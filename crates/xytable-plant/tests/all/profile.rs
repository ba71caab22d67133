//! Setpoints keep their bounds and arrive, whatever is asked.

use lpv_core::Discrete;
use proptest::prelude::*;
use xytable_plant::{MachineParameters, MoveLimits, PlantError, Profile, Setpoint};

const LIMITS: MoveLimits = MoveLimits {
    speed: 1.0,
    acceleration: 1.0,
    jerk: 1.0,
};

#[test]
fn durations_by_hand() {
    let duration = |distance, limits| {
        Profile::at(0.0, limits)
            .unwrap()
            .move_to(distance)
            .unwrap()
            .duration()
    };
    // Jerk alone: D = 2 J t^3, so t = 0.5 for D = 0.25, four of them.
    assert!((duration(0.25, LIMITS) - 2.0).abs() < 1e-12);
    // All bounds of 1: t_j = 1 gives speed 1 at once (t_a = 0), ramps cover 2, the cruise covers 3.
    assert!((duration(5.0, LIMITS) - 7.0).abs() < 1e-12);
    // J = 2, A = 1, no speed bound: t_j = 0.5, A (t_j + t_a)(2 t_j + t_a) = 3 for t_a = 1, so 4 t_j + 2 t_a = 4.
    let fast = MoveLimits {
        speed: 100.0,
        acceleration: 1.0,
        jerk: 2.0,
    };
    assert!((duration(3.0, fast) - 4.0).abs() < 1e-12);
    assert_eq!(duration(0.0, LIMITS), 0.0);
}

#[test]
fn patterns_visit_their_targets() {
    let machine = MachineParameters::default().check().unwrap();
    let steps = Profile::at(0.0, LIMITS)
        .unwrap()
        .steps(&[1.0, -0.5], 2.0)
        .unwrap();
    assert_eq!(steps.point(1.9).position, 0.0);
    assert_eq!(steps.end_position(), -0.5);
    let one = Profile::at(0.0, LIMITS).unwrap().move_to(1.0).unwrap().duration();
    assert_eq!(steps.point(2.0 + one + 1.0).position, 1.0);
    assert_eq!(steps.point(2.0 + one + 1.0).velocity, 0.0);
    let there = Profile::at(-0.2, LIMITS).unwrap().back_and_forth(0.2, 3).unwrap();
    assert_eq!(there.end_position(), -0.2);
    let slow = Profile::slow_sweep(&machine, 0.9, 500.0).unwrap();
    assert!((slow.duration() - 500.0).abs() < 1e-6, "{}", slow.duration());
    let sweep = Profile::sweep(&machine, 1.0, LIMITS).unwrap();
    assert_eq!((sweep.point(0.0).position, sweep.end_position()), (-0.3, 0.3));
    assert!(matches!(
        Profile::sweep(&machine, 1.1, LIMITS),
        Err(PlantError::Setting { .. })
    ));
    let clock = Discrete::from_rate(20.0).unwrap();
    let s = Setpoint::from_positions(vec![0.0, 1.0, 3.0], clock).unwrap();
    assert_eq!(s.velocity(), [20.0, 30.0, 40.0]);
    assert!(Setpoint::from_positions(vec![], clock).unwrap().is_empty());
}

proptest! {
    #[test]
    fn bounds_hold_and_the_end_is_reached(
        start in -1.0_f64..1.0,
        distance in -5.0_f64..5.0,
        exponents in prop::array::uniform3(-3.0_f64..3.0),
    ) {
        let [speed, acceleration, jerk] = exponents.map(|e| 10_f64.powf(e));
        let limits = MoveLimits { speed, acceleration, jerk };
        let target = start + distance;
        let profile = Profile::at(start, limits).unwrap().move_to(target).unwrap();
        let t = profile.duration();
        let within = |v: f64, bound: f64| v.abs() <= bound * (1.0 + 1e-6);
        let step = t / 500.0;
        let mut before = profile.point(0.0);
        prop_assert_eq!(before.position, start);
        for k in 1..=499 {
            let now = profile.point(f64::from(k) * step);
            prop_assert!(within(now.velocity, speed), "speed {} of {}", now.velocity, speed);
            prop_assert!(within(now.acceleration, acceleration), "acceleration {}", now.acceleration);
            prop_assert!(within((now.acceleration - before.acceleration) / step, jerk), "jerk");
            before = now;
        }
        // Just before the end it is there already, at rest: nothing jumps.
        let last = profile.point(t * (1.0 - 1e-12));
        let size = distance.abs() + start.abs();
        prop_assert!((last.position - target).abs() <= 1e-9 * size, "{} {}", last.position, target);
        prop_assert!(last.velocity.abs() <= 1e-6 * speed);
        prop_assert_eq!(profile.point(t).position, target);
        // No faster profile exists if one bound is active all the way: speed bounds the time from below.
        prop_assert!(t * speed >= distance.abs() * (1.0 - 1e-9));
    }

    #[test]
    fn wild_moves_never_panic(
        start in any::<f64>(), target in any::<f64>(), dwell in any::<f64>(), time in any::<f64>(),
        speed in any::<f64>(), acceleration in any::<f64>(), jerk in any::<f64>(),
    ) {
        let limits = MoveLimits { speed, acceleration, jerk };
        if let Ok(profile) = Profile::at(start, limits)
            && let Ok(profile) = profile.steps(&[target, start], dwell.abs())
        {
            let _ = profile.point(time);
            prop_assert!(profile.duration().is_finite());
            prop_assert_eq!(profile.end_position(), start);
        }
    }
}
