//! The sample rate from a column that tells the time.

use super::clock::Clock;
use super::stated::Stated;
use super::time_unit::{UNITS, is_in_days, seconds, stated_unit, unit_of_stamps};

/// A step of this many seconds or more is asked about where nothing but the number says that it is in seconds: positioning
/// machines are logged faster, and in milliseconds.
pub(super) const ASKED: f64 = 0.15;

/// From here on it is taken for seconds, and the doubt is written down.
const DOUBTED: f64 = 0.02;

/// The time column, as far as it was found.
#[derive(Debug, Clone)]
pub(super) struct TimeColumn {
    pub(super) name: String,
    /// From a row of units or the kind of file, or nothing.
    pub(super) unit: String,
    pub(super) is_stamp: bool,
    /// Its first value.
    pub(super) first: f64,
    /// Another column that advances evenly, by other steps: the clock of other signals.
    pub(super) rival: Option<(String, f64)>,
    /// Another column of times with the same steps that begins so much later, as that of another device.
    pub(super) late: Option<(String, f64)>,
    /// For each file: its name and what the column says in it.
    pub(super) clocks: Vec<(String, Clock)>,
}

impl TimeColumn {
    /// The first file in which it has other steps than in the files before.
    pub(super) fn of_another_rate(&self) -> Option<&str> {
        let mut steps = self
            .clocks
            .iter()
            .filter_map(|(file, clock)| Some((file, clock.step()?)));
        let (_, first) = steps.next()?;
        let (file, _) = steps.find(|(_, step)| (step / first - 1.0).abs() > 1e-3)?;
        Some(file)
    }
}

/// What speed columns say: for one unit of time, the ratio of a speed column to the differences of a position column.
#[derive(Debug, Clone)]
pub(super) struct Physics {
    pub(super) position: String,
    pub(super) speed: String,
    /// Speed over difference a step, both as they stand in the file and in base units where both have one.
    pub(super) slope: f64,
    pub(super) units_known: bool,
}

/// A rate, or why there is none.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Rate {
    /// Samples a second, from what, and the unit of the time column.
    Found {
        hz: f64,
        how: String,
        unit: Option<&'static str>,
        /// What it is if the column is in milliseconds, where that may well be.
        or_else: Option<f64>,
    },
    /// What the user has to tell, and the rates that it may be.
    Ask { problem: String, candidates: Vec<f64> },
}

impl Rate {
    fn ask(problem: String) -> Self {
        Self::Ask {
            problem,
            candidates: Vec::new(),
        }
    }
}

/// What tells the unit of a time column besides itself.
#[derive(Debug, Clone, Default)]
pub(super) struct Hints {
    pub(super) physics: Option<Physics>,
    /// Whether this kind of file has its times in seconds.
    pub(super) in_seconds: bool,
    pub(super) stated: Vec<Stated>,
}

/// The rate that the time columns of all files say.
pub(super) fn rate_of(time: &TimeColumn, hints: &Hints) -> Rate {
    let name = &time.name;
    let mut first: Option<f64> = None;
    let mut scatter = 0.0f64;
    for (file, clock) in &time.clocks {
        let step = match clock {
            Clock::Uneven(row) => {
                let place = row.map_or(String::new(), |r| format!(" (row {r})"));
                return Rate::ask(format!(
                    "the column `{name}` does not advance evenly in {file}{place}; bring all signals to even steps, in MATLAB \
                     with this column as t: [t, k] = unique(t); ti = linspace(t(1), t(end), numel(t)); u = interp1(t, u(k), ti)"
                ));
            }
            Clock::Jitter { step, largest } => {
                scatter = scatter.max(*largest);
                *step
            }
            Clock::Even(step) | Clock::Lost { step, .. } => *step,
        };
        if first.is_some_and(|f| (step / f - 1.0).abs() > 1e-3) {
            return Rate::ask(another_rate(file));
        }
        first = first.or(Some(step));
    }
    let Some(step) = first else {
        return Rate::ask(format!("the column `{name}` has too few rows"));
    };
    if let Some((other, own)) = &time.rival {
        return Rate::Ask {
            problem: format!(
                "the column `{name}` has steps of {}, `{other}` of {}: which is the time of the signals?",
                nice(step),
                nice(*own)
            ),
            candidates: vec![nice(1.0 / step), nice(1.0 / own)],
        };
    }
    if let Some((other, apart)) = &time.late {
        return Rate::ask(format!(
            "`{other}` begins {} after `{name}`: the signals are not of the same instants; bring all to one clock, in MATLAB with \
             these columns as t and t2: u2 = interp1(t2, u2, t)",
            nice_size(*apart)
        ));
    }
    let found = |(unit, seconds): (&'static str, f64), why: &str| {
        let scattered = if scatter > 0.0 {
            // A sample that is late by d errs by 2 pi f d on a sine of f.
            let hz = 0.01 / (std::f64::consts::TAU * scatter * step * seconds);
            format!(
                ", the mean of stamps that scatter by up to {:.0} % of a step; where the samples scatter with them, even steps err \
                 by up to 1 % on a sine of {hz:.3} Hz",
                100.0 * scatter
            )
        } else {
            String::new()
        };
        Rate::Found {
            hz: nice(1.0 / (step * seconds)),
            how: format!("from the column `{name}`{why}{scattered}"),
            unit: Some(unit),
            or_else: None,
        }
    };
    let stated = if time.unit.is_empty() {
        stated_unit(name)
    } else {
        Some(time.unit.as_str())
    };
    if time.is_stamp {
        return found(UNITS[0], ", which tells dates or times");
    }
    if stated.is_none() && is_in_days(name, time.first, step) {
        return Rate::Found {
            hz: nice(1.0 / (86_400.0 * step)),
            how: format!("from the column `{name}`, which counts days as spreadsheets and MATLAB do"),
            unit: None,
            or_else: None,
        };
    }
    if let Some(stated) = stated {
        return match seconds(stated) {
            Some(seconds) => {
                let mut rate = found((UNITS[0].0, seconds), &format!(" in {stated}"));
                if let Rate::Found { unit, .. } = &mut rate {
                    *unit = UNITS.iter().find(|u| u.1 == seconds).map(|u| u.0);
                }
                rate
            }
            None => Rate::ask(format!("the unit `{stated}` of the column `{name}` is not known")),
        };
    }
    if let Some(unit) = unit_of_stamps(time.first) {
        return found(unit, &format!(", which counts {} since 1970", unit.0));
    }
    if hints.in_seconds {
        return found(UNITS[0], ", which this kind of file has in seconds");
    }
    if let Some((unit, what)) = unit_by_stated(&hints.stated, step) {
        return found(unit, &format!(" in {}, as {what} says", unit.0));
    }
    if let Some(physics) = hints.physics.as_ref()
        && let Some(unit) = unit_by_physics(physics, step)
    {
        return found(
            unit,
            &format!(
                " in {}: only so `{}` is the speed of `{}`",
                unit.0, physics.speed, physics.position
            ),
        );
    }
    if step < ASKED {
        let mut rate = found(UNITS[0], "");
        if let Rate::Found { unit, or_else, .. } = &mut rate
            && step >= DOUBTED
        {
            *unit = None;
            *or_else = Some(nice(1e3 / step));
        }
        return rate;
    }
    let candidates: Vec<f64> = UNITS[..2].iter().map(|u| nice(1.0 / (step * u.1))).collect();
    let number = if step == 1.0 { "samples, " } else { "" };
    Rate::Ask {
        problem: format!(
            "the column `{name}` has steps of {} and no unit: {number}seconds ({} Hz) or milliseconds ({} Hz)?",
            nice(step),
            candidates[0],
            candidates[1]
        ),
        candidates,
    }
}

/// What is said of a file whose column of times has other steps than the files before it.
pub(super) fn another_rate(file: &str) -> String {
    format!(
        "{file} has another rate than the files before it; make one bundle for each rate, of the files that have it"
    )
}

/// The unit in which the steps are an interval that the file states, and what states it.
fn unit_by_stated(stated: &[Stated], step: f64) -> Option<((&'static str, f64), &str)> {
    stated.iter().find_map(|known| {
        let agrees = |(_, s): &(&str, f64)| (step * s / known.seconds - 1.0).abs() < 0.01;
        Some((UNITS.into_iter().find(agrees)?, known.what.as_str()))
    })
}

/// The unit of time in which the speed column is the speed. Where the file does not say the units of both, millimetres and
/// metres a second look like milliseconds taken for seconds: then only a unit below seconds is believed.
fn unit_by_physics(physics: &Physics, step: f64) -> Option<(&'static str, f64)> {
    let found = UNITS
        .into_iter()
        .find(|(_, s)| (0.7..1.4).contains(&(physics.slope * step * s)))?;
    (physics.units_known || found.1 < 1.0).then_some(found)
}

/// A number of either sign, rounded.
fn nice_size(x: f64) -> f64 {
    x.signum() * nice(x.abs())
}

/// A round number where the rate nearly is one.
pub(super) fn nice(rate: f64) -> f64 {
    let digits = 10f64.powi(4 - rate.log10().floor() as i32);
    let round = (rate * digits).round() / digits;
    if (round / rate - 1.0).abs() < 1e-5 {
        round
    } else {
        rate
    }
}

#[cfg(test)]
mod tests {
    use super::super::time_unit::{agreeing_unit, is_same_step};
    use super::*;

    fn column(name: &str, unit: &str, first: f64, step: f64) -> TimeColumn {
        TimeColumn {
            name: name.to_owned(),
            unit: unit.to_owned(),
            is_stamp: false,
            first,
            rival: None,
            late: None,
            clocks: vec![("a.csv".to_owned(), Clock::Even(step))],
        }
    }

    fn hz(time: &TimeColumn, physics: Option<&Physics>, stated: &[f64]) -> Option<f64> {
        let hints = Hints {
            physics: physics.cloned(),
            in_seconds: false,
            stated: stated
                .iter()
                .map(|&seconds| Stated {
                    what: "`Ts`".into(),
                    seconds,
                    has_unit: false,
                })
                .collect(),
        };
        match rate_of(time, &hints) {
            Rate::Found { hz, .. } => Some(hz),
            Rate::Ask { .. } => None,
        }
    }

    #[test]
    fn rates_by_hand() {
        for (name, unit, first, step, rate) in [
            ("t", "", 0.0, 0.001, Some(1000.0)),
            ("t", "", 0.0, 1e-6, Some(1e6)),
            ("t [s]", "", 0.0, 10.0, Some(0.1)),
            ("Time [ms]", "", 0.0, 10.0, Some(100.0)),
            ("time_us", "", 0.0, 50.0, Some(20_000.0)),
            ("timeMs", "", 0.0, 0.5, Some(2000.0)),
            ("t", "ms", 0.0, 0.1, Some(10_000.0)),
            ("t", "days", 0.0, 1e-6, Some(11.574)),
            ("t", "moons", 0.0, 0.1, None),
            ("Date", "", 45_000.3, 0.0005 / 86_400.0, Some(2000.0)),
            ("t", "", 739_000.0, 0.01 / 86_400.0, Some(100.0)),
            ("t", "", 45_000.0, 0.001, Some(1000.0)),
            ("time", "", 0.0, 10.0, None),
            ("time", "", 0.0, 1.0, None),
            ("time", "", 0.0, 0.25, None),
            ("time", "", 0.0, 0.1, Some(10.0)),
            ("stamp", "", 1_516_615_200.0, 0.01, Some(100.0)),
            ("stamp", "", 1_516_615_200_000.0, 10.0, Some(100.0)),
            ("stamp", "", 1_516_615_200_000_000.0, 50.0, Some(20_000.0)),
        ] {
            let found = hz(&column(name, unit, first, step), None, &[]);
            let is_rate = match (found, rate) {
                (Some(a), Some(b)) => (a / b - 1.0).abs() < 1e-4,
                (a, b) => a == b,
            };
            assert!(is_rate, "{name} {step}: {found:?}");
        }
    }

    #[test]
    fn what_else_decides_the_unit() {
        let doubtful = column("time", "", 0.0, 10.0);
        let speed = |slope, units_known| Physics {
            position: "x".into(),
            speed: "v".into(),
            slope,
            units_known,
        };
        assert_eq!(hz(&doubtful, Some(&speed(100.0, false)), &[]), Some(100.0));
        // Millimetres and metres a second may look like seconds.
        assert_eq!(hz(&doubtful, Some(&speed(0.1, false)), &[]), None);
        assert_eq!(hz(&doubtful, Some(&speed(0.1, true)), &[]), Some(0.1));
        let half = column("time", "", 0.0, 0.5);
        assert_eq!(hz(&half, None, &[5e-4]), Some(2000.0));
        assert_eq!(hz(&half, None, &[0.5]), Some(2.0));
        assert_eq!(hz(&half, None, &[0.7]), None);
        assert_eq!(agreeing_unit(10.0, 100.0), Some("ms"));
        assert_eq!(agreeing_unit(10.0, 50.0), None);
        assert!(is_same_step(1e-3, 1.0) && is_same_step(5e-4, 5e-4) && !is_same_step(1e-3, 4e-3));
        let mut two = column("rec.time", "s", 0.0, 0.004);
        two.rival = Some(("data(:,1)".to_owned(), 0.001));
        assert_eq!(hz(&two, None, &[0.001]), None);
    }
}
