//! The sample rate of a draft: from a time column, from what the file states, or as the user gave it.

use super::clock::Clock;
use super::rate::{self, Hints, Rate, TimeColumn, nice};
use super::time_unit;

/// What a draft says about its rate.
#[derive(Debug, Default)]
pub(super) struct Sampling {
    pub(super) hz: Option<f64>,
    /// Rates that it may be, where it is asked for or in doubt.
    pub(super) others: Vec<f64>,
    /// The unit of the time column.
    pub(super) unit: Option<String>,
    pub(super) guess: Option<String>,
    pub(super) question: Option<String>,
    /// Whether the files have several rates, which no option makes one.
    pub(super) rates_differ: bool,
}

impl Sampling {
    fn ask(question: String, others: Vec<f64>) -> Self {
        Self {
            others,
            question: Some(format!("sample_rate: {question}")),
            ..Self::default()
        }
    }
}

/// The rate, from the surest of what there is.
pub(super) fn decide(time: Option<&TimeColumn>, given_hz: Option<f64>, hints: &Hints) -> Sampling {
    let Some(time) = time else {
        return match given_hz {
            Some(hz) => Sampling {
                hz: Some(hz),
                ..Sampling::default()
            },
            None => without_time(hints),
        };
    };
    let decided = match given_hz {
        Some(hz) => given(time, hz),
        None => from_time(time, hints),
    };
    Sampling {
        rates_differ: time.of_another_rate().is_some(),
        ..decided
    }
}

fn from_time(time: &TimeColumn, hints: &Hints) -> Sampling {
    match rate::rate_of(time, hints) {
        Rate::Found {
            hz,
            how,
            unit,
            or_else,
        } => {
            let doubt = or_else.map_or(String::new(), |other| {
                format!(" if that is in seconds; {other} if it is in milliseconds")
            });
            let differs = hints.stated.iter().find(|s| (s.seconds * hz - 1.0).abs() > 0.01);
            let differs = differs.map_or(String::new(), |s| format!("; {} does not agree", s.what));
            Sampling {
                hz: Some(hz),
                others: or_else.into_iter().collect(),
                unit: unit.map(str::to_owned),
                guess: Some(format!("sample_rate = {hz} {how}{doubt}{differs}")),
                ..Sampling::default()
            }
        }
        Rate::Ask { problem, candidates } => {
            Sampling::ask(format!("{problem}; write down the rate in Hz"), candidates)
        }
    }
}

fn without_time(hints: &Hints) -> Sampling {
    let Some(first) = hints.stated.first() else {
        return Sampling::ask(
            "no column tells the time; write down the rate in Hz, or give --sample-rate".to_owned(),
            Vec::new(),
        );
    };
    let other = hints
        .stated
        .iter()
        .find(|s| (s.seconds / first.seconds - 1.0).abs() > 1e-6);
    let hz = nice(1.0 / first.seconds);
    match other {
        // A time column of such steps is asked about too.
        None if !first.has_unit && first.seconds >= rate::ASKED => {
            let candidates = vec![hz, nice(1e3 / first.seconds)];
            let question = format!(
                "{} says no unit: {} Hz, or {} Hz where it is in milliseconds or kilohertz; write down the rate in Hz, or give \
                 --sample-rate",
                first.what, candidates[0], candidates[1]
            );
            Sampling::ask(question, candidates)
        }
        None => Sampling {
            hz: Some(hz),
            guess: Some(format!("sample_rate = {hz}, as {} says", first.what)),
            ..Sampling::default()
        },
        Some(other) => {
            let candidates = vec![hz, nice(1.0 / other.seconds)];
            let question = format!(
                "{} says {} Hz, {} says {} Hz; write down the rate in Hz, or give --sample-rate",
                first.what, candidates[0], other.what, candidates[1]
            );
            Sampling::ask(question, candidates)
        }
    }
}

/// A given rate is believed, and held against the column.
fn given(time: &TimeColumn, hz: f64) -> Sampling {
    let mut sampling = Sampling {
        hz: Some(hz),
        ..Sampling::default()
    };
    if let Some(file) = time.of_another_rate() {
        sampling.question = Some(format!("sample_rate: {}", rate::another_rate(file)));
    } else if let Some(step) = time.clocks.first().and_then(|(_, clock)| clock.step()) {
        match time_unit::agreeing_unit(step, hz) {
            Some(unit) => sampling.unit = Some(unit.to_owned()),
            // The rate of another clock was given.
            None if time
                .rival
                .as_ref()
                .is_some_and(|(_, own)| time_unit::agreeing_unit(*own, hz).is_some()) => {}
            None => {
                sampling.question = Some(format!(
                    "sample_rate: {hz} Hz is given, but the column `{}` has steps of {step}; which is right?",
                    time.name
                ));
            }
        }
    } else if let Some((file, Clock::Uneven(row))) = time.clocks.first() {
        let place = row.map_or(String::new(), |r| format!(" (row {r})"));
        sampling.question = Some(format!(
            "{file}: the column `{}` does not advance evenly{place}: are samples missing?",
            time.name
        ));
    }
    sampling
}

#[cfg(test)]
mod tests {
    use super::super::stated::Stated;
    use super::*;

    fn hints(stated: &[f64], has_unit: bool) -> Hints {
        let stated = stated.iter().map(|&seconds| Stated {
            what: "`Ts`".to_owned(),
            seconds,
            has_unit,
        });
        Hints {
            stated: stated.collect(),
            ..Hints::default()
        }
    }

    #[test]
    fn a_rate_that_a_file_states() {
        for interval in [1e-6, 3.7e-4, 0.02, 4.0, 1e3] {
            for has_unit in [true, false] {
                let found = decide(None, None, &hints(&[interval, interval], has_unit));
                if has_unit || interval < 0.1 {
                    assert!((found.hz.unwrap() * interval - 1.0).abs() < 1e-5, "{interval}");
                    assert!(found.guess.is_some() && found.question.is_none());
                } else {
                    assert!(found.hz.is_none() && found.question.is_some());
                    assert!(
                        (found.others[1] * interval / 1e3 - 1.0).abs() < 1e-5,
                        "{interval}"
                    );
                }
            }
        }
        let found = decide(None, None, &hints(&[1e-3, 0.01], false));
        assert_eq!((found.hz, found.others), (None, vec![1000.0, 100.0]));
        assert!(decide(None, None, &hints(&[], false)).question.is_some());
        assert_eq!(decide(None, Some(7.0), &hints(&[1e-3], false)).hz, Some(7.0));
    }
}
