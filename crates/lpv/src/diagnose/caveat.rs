//! What records do not show well of an effect that was named, by the names of the contract of `diagnosis.json`.

use lpv_diagnose::effect::{EffectParameter, Family, Scale};
use lpv_diagnose::{Added, Track};
use lpv_numerics::statistics::range;

/// A name of the contract, and what it means to a reader.
type Caveat = (&'static str, &'static str);

const PERIOD: Caveat = (
    "period-nearly-the-record",
    "a period takes most of a record or of its travel, so that any slow change may pass for it: longer records would tell",
);
const NO_REVERSAL: Caveat = (
    "no-reversal",
    "the held-out records never turn, and there friction is a constant force: moves there and back would tell",
);
const ALIKE: Caveat = (
    "position-and-time-grow-alike",
    "all held-out records start at one place and go one way, so that a change with the one may be a change with the other: the same stretch \
     at other times, or backwards, would tell",
);
const ONE_AMPLITUDE: Caveat = (
    "one-amplitude",
    "the held-out records have one amplitude, at which a linear effect may look the same: moves of other sizes would tell",
);
const ALL: [Caveat; 4] = [PERIOD, NO_REVERSAL, ALIKE, ONE_AMPLITUDE];

/// Effects whose form only other amplitudes show.
const OF_AMPLITUDE: [&str; 3] = ["actuator-saturation", "backlash", "cubic-stiffness"];
/// Effects that change with the position, or with time.
const OF_PLACE_OR_TIME: [&str; 6] = [
    "cable-stiffness",
    "friction-drift",
    "position-dependent-gain",
    "position-force",
    "sensor-drift",
    "stiffness-drift",
];

/// The caveats of an effect, in view of the judged records.
pub(super) fn caveats(added: &Added, tracks: &[Track]) -> Vec<String> {
    let effect = added.effect;
    let output = effect.place.first();
    let is_friction = effect.family == Family::Friction;
    let holds = |caveat: &Caveat| match *caveat {
        PERIOD => has_long_period(added, tracks),
        NO_REVERSAL => is_friction && !Track::go_both_ways(tracks, output),
        ALIKE => OF_PLACE_OR_TIME.contains(&effect.name) && Track::grow_with_time(tracks, output),
        _ => OF_AMPLITUDE.contains(&effect.name) && have_one_amplitude(tracks, output),
    };
    let names = ALL.iter().filter(|c| holds(c)).map(|(name, _)| *name);
    names.map(str::to_owned).collect()
}

/// What a caveat means.
pub(super) fn sentence(name: &str) -> &'static str {
    ALL.iter()
        .find(|(n, _)| *n == name)
        .map_or("", |(_, meaning)| meaning)
}

fn has_long_period(added: &Added, tracks: &[Track]) -> bool {
    /// Part of a record, or of its travel, that a period takes.
    const NEARLY: f64 = 0.6;
    let is_long = |(p, (value, _)): (&EffectParameter, &(f64, f64))| match p.scale {
        Scale::Wavelength => *value > NEARLY * Track::travel(tracks, 0),
        Scale::Frequency => value * Track::longest(tracks) < 1.0 / NEARLY,
        _ => false,
    };
    added.effect.parameters.iter().zip(&added.values).any(is_long)
}

/// Whether an output travels as far in every part of every record.
fn have_one_amplitude(tracks: &[Track], output: usize) -> bool {
    const PARTS: usize = 4;
    const AS_FAR: f64 = 0.9;
    let travels = tracks.iter().flat_map(|track| {
        let y: Vec<f64> = track.outputs.iter().map(|y| y[output]).collect();
        let part = track.samples.div_ceil(PARTS).max(1);
        let travels: Vec<f64> = y
            .chunks(part)
            .filter(|c| c.len() == part)
            .map(|c| {
                let (low, high) = range(c);
                high - low
            })
            .collect();
        travels
    });
    let ends = (f64::INFINITY, 0.0_f64);
    let (least, most) = travels.fold(ends, |(least, most), t| (least.min(t), most.max(t)));
    least >= AS_FAR * most
}

#[cfg(test)]
mod tests {
    use super::{ALIKE, NO_REVERSAL, ONE_AMPLITUDE, PERIOD, caveats, sentence};
    use lpv_core::{Purpose, Record, RecordKind, Signals};
    use lpv_diagnose::catalogue;
    use lpv_diagnose::{Added, Axis, Base, Explained, Track};
    use std::f64::consts::TAU;

    fn track(y: impl Fn(f64) -> f64) -> Track {
        let signals = |columns: Vec<Vec<f64>>| Signals::new(&["a"][..columns.len()], columns);
        let y: Vec<f64> = (0..4000).map(|k| y(f64::from(k) / 4000.0)).collect();
        let record = Record {
            inputs: signals(vec![vec![0.0; y.len()]]),
            references: signals(vec![y.clone()]),
            outputs: signals(vec![y]),
            ..Record::empty("move", RecordKind::Transient, Purpose::Validation)
        };
        Track::new(&record, 1e-3, 2, None).unwrap()
    }

    /// Of sizes over three decades: what a record cannot show is said, and nothing of one that shows it.
    #[test]
    fn each_where_it_holds() {
        let added = |name: &str, period: f64| {
            let effect = catalogue::all().find(|e| e.name == name).unwrap();
            Added {
                effect,
                values: effect.parameters.iter().map(|_| (period, 0.0)).collect(),
                then: Explained {
                    base: Base::Axis(Axis::new(1.0, 0.0, 0.0)),
                    effects: Vec::new(),
                },
                gain_db: 10.0,
                p_value: 0.0,
                runner_up: None,
            }
        };
        for size in [1e-3, 1e-1, 10.0] {
            let one_way = [track(|t| size * t)];
            let sine = [track(|t| size * (20.0 * TAU * t).sin())];
            let growing = [track(|t| size * t * (20.0 * TAU * t).sin())];
            let both = [sine[0].clone(), growing[0].clone()];
            // Other places at the same time.
            let apart = [one_way[0].clone(), track(|t| size * (1.0 + t))];
            for (name, tracks, expected) in [
                ("coulomb-friction", &one_way[..], vec![NO_REVERSAL]),
                ("coulomb-friction", &sine, vec![]),
                ("position-force", &one_way, vec![ALIKE]),
                ("position-force", &sine, vec![]),
                ("position-force", &apart, vec![]),
                ("friction-drift", &one_way, vec![NO_REVERSAL, ALIKE]),
                ("cubic-stiffness", &sine, vec![ONE_AMPLITUDE]),
                ("cubic-stiffness", &growing, vec![]),
                ("cubic-stiffness", &both, vec![]),
                ("cogging", &sine, vec![]),
            ] {
                let expected: Vec<&str> = expected.iter().map(|c| c.0).collect();
                assert_eq!(
                    caveats(&added(name, 0.01 * size), tracks),
                    expected,
                    "{name} {size}"
                );
            }
            let long = caveats(&added("cogging", 1.5 * size), &sine);
            assert_eq!(long, [PERIOD.0]);
            assert!(!sentence(&long[0]).is_empty());
        }
    }
}
