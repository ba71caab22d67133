//! First-order lag of the amplifier.

use crate::base::Pair;
use crate::effect::{ALL, Block, Effect, EffectParameter, Family, Lines, Needs, Path, Scale};
use num_complex::Complex64 as C64;

pub(super) static EFFECTS: [Effect; 3] = [at::<0>(), at::<1>(), at::<ALL>()];

const fn at<const CHANNEL: usize>() -> Effect {
    Effect {
        name: "actuator-lag",
        family: Family::Timing,
        channel: CHANNEL,
        needs: Needs::motor(CHANNEL),
        meaning: "first-order lag between commanded and actual forces of the motors",
        parameters: &[EffectParameter {
            name: "time_constant",
            unit: "s",
            scale: Scale::NotNegative,
        }],
        extends: None,
        starts: |screen| vec![vec![1e-4 * screen.step()], vec![0.3 * screen.step()]],
        on_response: Some(Lines::short_times),
        block: |v, machine| Box::new(Late(super::of_motors(machine, CHANNEL, v[0]))),
    }
}

#[derive(Debug)]
struct Late(Pair);

impl Block for Late {
    fn lag(&self) -> Pair {
        self.0
    }

    fn respond(&self, s: C64, path: &mut Path) {
        path.command /= s * self.0[0] + 1.0;
    }
}
