//! The simulated axis against closed forms.

use super::*;
use std::f64::consts::{PI, TAU};

fn free() -> ServoAxis {
    ServoAxis {
        mass_kg: 2.0,
        viscous_n_s_per_m: 0.0,
        offset_n: 0.0,
        stiffness_n_per_m: 0.0,
        load: None,
        rate_hz: 100.0,
        resolution_m: 1e-9,
        drive: Drive::Open { feedforward: 1.0 },
    }
}

/// A machine that is pushed by commands only; a test gives them through [`ServoAxis::run`] with setpoints whose force they are.
fn slide(axis: &ServoAxis, effects: &[AxisEffect], points: [f64; 2]) -> Result<AxisRun, crate::PlantError> {
    let moves = AxisMoves::Trapezoids {
        points_m: vec![points[0], points[1]],
        time_s: 2.0,
        rest: 0.0,
        ramp: 0.5,
    };
    axis.run(effects, &moves, (0, 300))
}

#[test]
fn a_free_axis_that_is_pushed_arrives_where_its_setpoint_does() -> Result<(), crate::PlantError> {
    let run = slide(&free(), &[], [0.0, 0.3])?;
    assert!((run.exact[299] - 0.3).abs() < 1e-12, "{}", run.exact[299]);
    // 4 s (t / 2)^2 / 2 in the first half: a quarter of the way at a quarter of the time, squared.
    assert!((run.exact[50] - 0.3 * 0.125).abs() < 1e-12, "{}", run.exact[50]);
    Ok(())
}

#[test]
fn viscous_friction_takes_a_speed_away_exponentially() -> Result<(), crate::PlantError> {
    let axis = ServoAxis {
        viscous_n_s_per_m: 3.0,
        ..free()
    };
    let run = axis.answer(&[0.0; 201], [0.0, 1.0], 1.0)?;
    let wanted = 2.0 / 3.0 * (1.0 - (-3.0_f64 / 2.0 * 2.0).exp());
    assert!(
        (run.exact[200] - wanted).abs() < 1e-9,
        "{} {wanted}",
        run.exact[200]
    );
    Ok(())
}

#[test]
fn dry_friction_holds_below_its_breakaway_and_stops_a_slide() -> Result<(), crate::PlantError> {
    // The largest force of the move is 2 kg * 0.3 m * 4 / 4 s^2 = 0.6 N.
    for friction in [
        AxisEffect::CoulombFriction { level: 0.61 },
        AxisEffect::StribeckFriction {
            level: 0.4,
            breakaway: 0.21,
            speed: 0.1,
        },
    ] {
        let run = slide(&free(), &[friction], [0.0, 0.3])?;
        assert!(run.exact.iter().all(|q| *q == 0.0));
    }
    // 0.6 N for 1 s, then -0.6 N for 1 s, against 0.4 N: 0.05 m at 0.1 m/s^2, 0.01 m until it stops, 0.032 m back, 0.016 m until it
    // stops again, and there it stays.
    let run = slide(&free(), &[AxisEffect::CoulombFriction { level: 0.4 }], [0.0, 0.3])?;
    assert!((run.exact[120] - 0.06).abs() < 1e-9, "{}", run.exact[120]);
    assert!((run.exact[299] - 0.012).abs() < 1e-9, "{}", run.exact[299]);
    assert_eq!(run.exact[250], run.exact[299]);
    Ok(())
}

#[test]
fn a_flexure_swings_at_its_frequency_and_keeps_its_energy() -> Result<(), crate::PlantError> {
    let w = TAU * 3.0;
    let axis = ServoAxis {
        stiffness_n_per_m: 2.0 * w * w,
        ..free()
    };
    let run = axis.answer(&[0.0; 501], [0.01, 0.0], 0.2)?;
    for (k, q) in run.exact.iter().enumerate() {
        let wanted = 0.01 * (w * k as f64 / 100.0).cos();
        assert!((q - wanted).abs() < 1e-6, "{k}: {q} {wanted}");
    }
    Ok(())
}

#[test]
fn motor_and_load_swing_against_each_other_at_their_resonance() -> Result<(), crate::PlantError> {
    let axis = ServoAxis {
        load: Some(Load {
            part: 0.4,
            resonance_hz: 5.0,
            damping: 0.0,
            encoders: Encoders::Both,
        }),
        ..free()
    };
    // The motor alone is given a speed by a push in the first sample: m dv = F T.
    let mut inputs = [0.0; 401];
    inputs[0] = 100.0;
    let run = axis.answer(&inputs, [0.0, 0.0], 0.5)?;
    let bend: Vec<f64> = (0..401).map(|k| run.outputs[0][k] - run.outputs[1][k]).collect();
    let crossings: Vec<f64> = (1..401)
        .filter(|k| bend[k - 1] > 0.0 && bend[*k] <= 0.0)
        .map(|k| k as f64 - bend[k] / (bend[k] - bend[k - 1]))
        .collect();
    let period = (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64 / 100.0;
    assert!((period - 0.2).abs() < 1e-3, "{period}");
    // The centre goes on at the speed that the push gave all of the mass.
    let centre = |k: usize| 0.6 * run.outputs[0][k] + 0.4 * run.outputs[1][k];
    assert!(
        (centre(400) - centre(200) - 0.5 * 2.0).abs() < 1e-6,
        "{}",
        centre(400) - centre(200)
    );
    Ok(())
}

#[test]
fn a_delay_shifts_the_answer_and_a_lag_is_late_by_its_time() -> Result<(), crate::PlantError> {
    let there = |effects: &[AxisEffect]| slide(&free(), effects, [0.0, 0.3]);
    let (clean, late) = (there(&[])?, there(&[AxisEffect::Delay { time: 0.03 }])?);
    for k in 3..300 {
        assert!((late.exact[k] - clean.exact[k - 3]).abs() < 1e-12, "{k}");
    }
    // A part of a sample: the axis begins as much later to be accelerated by 0.3 m/s^2.
    let part = there(&[AxisEffect::Delay { time: 0.005 }])?;
    let wanted = 0.15 * 0.495_f64.powi(2);
    assert!(
        (part.exact[50] - wanted).abs() < 1e-12,
        "{} {wanted}",
        part.exact[50]
    );
    let lag = there(&[AxisEffect::ActuatorLag { time_constant: 0.02 }])?;
    assert!((lag.exact[299] - 0.3).abs() < 1e-9, "{}", lag.exact[299]);
    Ok(())
}

#[test]
fn a_bristle_gives_its_level_after_its_distance() -> Result<(), crate::PlantError> {
    // Far beyond the distance it is dry friction: as much work is done.
    let slid = |effect: AxisEffect| -> Result<f64, crate::PlantError> {
        let run = free().along_with(&[effect], &[0.0; 301], [0.0, 1.0])?;
        Ok(run.exact[300])
    };
    let dry = slid(AxisEffect::CoulombFriction { level: 2.0 })?;
    // v^2 / 2 = (F / m) s.
    assert!((dry - 0.5).abs() < 1e-9, "{dry}");
    let bristle = slid(AxisEffect::Hysteresis {
        level: 2.0,
        distance: 1e-3,
    })?;
    assert!((bristle - 0.5).abs() < 5e-3, "{bristle}");
    Ok(())
}

#[test]
fn setpoints_are_integrals_of_their_accelerations() {
    let all = [
        AxisMoves::Trapezoids {
            points_m: vec![0.0, 1.0, -0.5],
            time_s: 1.3,
            rest: 0.1,
            ramp: 0.3,
        },
        AxisMoves::SCurves {
            points_m: vec![0.2, 1.0, -0.5],
            time_s: 1.3,
            rest: 0.1,
            ramp: 0.5,
        },
        AxisMoves::Sines {
            sines: vec![[0.3, 1.0], [0.1, 2.7]],
        },
    ];
    for moves in all {
        let h = 1e-5;
        let [q, v, a] = moves.at(0.0);
        assert!(v.abs() < 1e-12 && a.is_finite() && q.is_finite());
        for k in 1..200 {
            let t = 0.0131 * f64::from(k);
            let [before, now, after] = [t - h, t, t + h].map(|t| moves.at(t));
            assert!(
                ((after[0] - before[0]) / (2.0 * h) - now[1]).abs() < 1e-3,
                "{moves:?} {t}"
            );
            // A trapezoid's acceleration jumps.
            if !matches!(moves, AxisMoves::Trapezoids { .. }) {
                assert!(
                    ((after[1] - before[1]) / (2.0 * h) - now[2]).abs() < 2e-2,
                    "{moves:?} {t}"
                );
            }
        }
    }
}

/// The force that is asked for at a frequency answers with `F / (m w^2)`.
#[test]
fn a_periodic_force_moves_a_free_axis_by_its_closed_form() -> Result<(), crate::PlantError> {
    let w = TAU * 2.0;
    let effect = AxisEffect::PeriodicDisturbance {
        sine: 0.0,
        cosine: 0.4,
        frequency: 2.0,
    };
    let run = free().along_with(&[effect], &[0.0; 201], [0.0, 0.0])?;
    let wanted = |t: f64| 0.4 / (2.0 * w * w) * (1.0 - (w * t).cos());
    for k in [25, 100, 133, 200] {
        let q = run.exact[k];
        assert!((q - wanted(k as f64 / 100.0)).abs() < 1e-8, "{k}: {q}");
    }
    Ok(())
}

/// A mass that is heavier by an effect is one that is heavier: nothing is left where the mass is not known.
#[test]
fn what_a_mass_explains_does_not_show_where_the_mass_is_not_known() -> Result<(), crate::PlantError> {
    let axis = free();
    let moves = AxisMoves::SCurves {
        points_m: vec![0.0, 0.2, -0.1, 0.1],
        time_s: 1.0,
        rest: 0.2,
        ramp: 0.4,
    };
    let run = axis.run(
        &[AxisEffect::Payload {
            mass: 0.002,
            record: 0,
        }],
        &moves,
        (0, 300),
    )?;
    let runs = [run];
    let speed = axis.speed(&moves, 300);
    let known = deviation(&axis, &runs, speed, Known::Machine)?;
    let unknown = deviation(&axis, &runs, speed, Known::Nothing)?;
    assert!(unknown < 1e-2 * known && known > 1e-6, "{unknown} {known}");
    let friction = axis.run(&[AxisEffect::CoulombFriction { level: 1e-3 }], &moves, (0, 300))?;
    let shown = deviation(&axis, &[friction], speed, Known::Nothing)?;
    // F / m over the square of the frequency of the motion, within an order.
    let scale = 5e-4 / (2.0 * PI * 0.5_f64).powi(2);
    assert!(shown > 0.05 * scale && shown < 3.0 * scale, "{shown} {scale}");
    Ok(())
}

#[test]
fn a_coupling_with_play_pushes_beyond_it_and_never_pulls() {
    let play = AxisEffect::CouplingBacklash { gap: 0.2 };
    let pull = |bent: f64, rate: f64| play.pull([50.0, 2.0], [bent, rate]);
    for (bent, rate, wanted) in [
        (0.09, 3.0, 0.0),
        (-0.1, -3.0, 0.0),
        (0.3, 0.0, 10.0),
        (-0.3, 0.0, -10.0),
        (0.3, 1.0, 12.0),
        (-0.3, 1.0, -8.0),
        (0.11, -5.0, 0.0),
        (-0.11, 5.0, 0.0),
    ] {
        let found = pull(bent, rate).unwrap_or(f64::NAN);
        assert!((found - wanted).abs() < 1e-12, "{bent} {rate}: {found}");
    }
    assert_eq!(
        AxisEffect::Backlash { gap: 0.2 }.pull([50.0, 2.0], [0.3, 0.0]),
        None
    );
}
