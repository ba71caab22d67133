//! First-order lag of the amplifier.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Lines, Needs, Path, Place, Scale};
use num_complex::Complex64 as C64;

pub(super) static EFFECTS: [Effect; 3] = [at(Place::Motor(0)), at(Place::Motor(1)), at(Place::AllMotors)];

const fn at(place: Place) -> Effect {
    Effect {
        name: "actuator-lag",
        family: Family::Timing,
        place,
        needs: Needs::of(place),
        meaning: "first-order lag between commanded and actual forces of the motors",
        parameters: &[EffectParameter {
            name: "time_constant",
            unit: "s",
            scale: Scale::NotNegative,
        }],
        extends: None,
        starts: &|screen, _| vec![vec![1e-4 * screen.step()], vec![0.3 * screen.step()]],
        on_response: Some(Lines::short_times),
        block: &|v, machine, place| Box::new(Late(super::of_motors(machine, place, v[0]))),
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
