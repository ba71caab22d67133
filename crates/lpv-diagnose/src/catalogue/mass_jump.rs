//! A mass that changes at an instant.

use super::since::{self, Since};
use crate::base::Forces;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};
use crate::screen::Screen;

pub(super) static EFFECT: Effect = Effect {
    name: "mass-jump",
    family: Family::Structure,
    place: Place::Motor(0),
    needs: Needs::Axis,
    meaning: "mass that is there from a time of a record on, or of every record, as where a load is taken up or put down",
    parameters: &[
        EffectParameter {
            name: "mass",
            unit: "u s^2/y",
            scale: Scale::Linear,
        },
        since::BEGINS,
        since::RECORD,
    ],
    extends: None,
    starts: &|screen, _| since::begins(screen, since::inertia),
    on_response: None,
    block: &|v, _, _| more(v[0], Since::new(v[1], v[2])),
};

/// Whether a mass of these values shows apart from one that is there all the time: the axis accelerates before it changes, and after.
pub(super) fn is_apart(values: &[f64], screen: &Screen<'_>) -> bool {
    /// Part of the squared acceleration that each side has at the least.
    const SIDE: f64 = 0.03;
    let &[_, begins, record] = values else { return true };
    let since = Since::new(begins, record);
    let (mut before, mut all) = (0.0, 0.0);
    for (track, motions) in screen.tracks.iter().zip(&screen.motions) {
        if since.is_in(track) {
            let square = |k: usize| since::inertia(motions, k, track.step).powi(2);
            let first = (begins / track.step).clamp(0.0, motions.len() as f64) as usize;
            before += (0..first).map(square).sum::<f64>();
            all += (0..motions.len()).map(square).sum::<f64>();
        }
    }
    before >= SIDE * all && before <= (1.0 - SIDE) * all
}

/// A mass from a time on.
pub(super) fn more(mass: f64, since: Since) -> Box<dyn Block> {
    Box::new(More { mass, since })
}

#[derive(Debug)]
struct More {
    mass: f64,
    since: Since,
}

impl Block for More {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.mass += self.mass * self.since.part(at);
    }
}
