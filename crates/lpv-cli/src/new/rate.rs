//! The sample rate from a column that tells the time.

use super::roles::unit_of;
use super::{Groups, Known};

/// What the time column of one file says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Clock {
    /// Samples per unit of the column.
    Even(f64),
    /// The mean rate of stamps that scatter by less than a quarter of a sample.
    Jitter(f64),
    /// No rate.
    Uneven,
}

/// The known rate, else the one of the time columns of all files; a question where there is none.
pub(super) fn sample_rate(
    known: &Known,
    measured: &[(String, Clock)],
    groups: &Groups,
    guesses: &mut Vec<String>,
    questions: &mut Vec<String>,
) -> Option<f64> {
    if known.sample_rate_hz.is_some() {
        return known.sample_rate_hz;
    }
    let Some(time) = &groups.time else {
        questions.push(
            "sample_rate: no column tells the time; write down the rate in Hz, or give --sample-rate"
                .to_owned(),
        );
        return None;
    };
    let mut ask = |problem: String| {
        questions.push(format!("sample_rate: {problem}; write down the rate in Hz"));
        None
    };
    let Some(scale) = seconds(time) else {
        return ask(format!("the unit of the column `{time}` is not known"));
    };
    let mut first: Option<f64> = None;
    let mut jitter = false;
    for (file, clock) in measured {
        let rate = match clock {
            Clock::Even(rate) => *rate,
            Clock::Jitter(rate) => {
                jitter = true;
                *rate
            }
            Clock::Uneven => return ask(format!("the column `{time}` does not advance evenly in {file}")),
        };
        if first.is_some_and(|f| (rate / f - 1.0).abs() > 1e-3) {
            return ask(format!(
                "{file} has another rate than the files before it; make one bundle for each rate"
            ));
        }
        first = first.or(Some(rate));
    }
    let rate = nice(first? / scale);
    let how = if jitter {
        ", the mean of stamps that scatter"
    } else {
        ""
    };
    guesses.push(format!("sample_rate = {rate} from the column `{time}`{how}"));
    Some(rate)
}

/// Seconds in the unit that the name of a time column states; seconds where it states none.
fn seconds(column: &str) -> Option<f64> {
    let unit = match unit_of(column) {
        Some(unit) => unit,
        None => match column.rsplit_once('_') {
            Some((_, end @ ("ms" | "us" | "ns" | "min"))) => end,
            _ => "s",
        },
    };
    match unit.to_lowercase().as_str() {
        "s" | "sec" | "second" | "seconds" => Some(1.0),
        "ms" => Some(1e-3),
        "us" | "µs" => Some(1e-6),
        "ns" => Some(1e-9),
        "min" => Some(60.0),
        _ => None,
    }
}

/// What a time column says.
pub(super) fn clock_of(time: &[f64]) -> Clock {
    let (Some(first), Some(last)) = (time.first(), time.last()) else {
        return Clock::Uneven;
    };
    let steps = time.len().saturating_sub(1) as f64;
    let step = (last - first) / steps;
    if !(step.is_finite() && step > 0.0) {
        return Clock::Uneven;
    }
    let steps_within = |part: f64| {
        let close = |w: &[f64]| ((w[1] - w[0]) - step).abs() <= part * step;
        time.windows(2).all(close)
    };
    let even = steps_within(0.02);
    // A lost sample makes a step of two, or shifts the stamps around it by half a sample.
    let near = |(k, t): (usize, &f64)| (t - first - step * k as f64).abs() <= 0.25 * step;
    if even {
        Clock::Even(1.0 / step)
    } else if steps_within(0.45) && time.iter().enumerate().all(near) {
        Clock::Jitter(1.0 / step)
    } else {
        Clock::Uneven
    }
}

/// A round number where the rate nearly is one.
fn nice(rate: f64) -> f64 {
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
    use super::*;

    #[test]
    fn rates_by_hand() {
        let even: Vec<f64> = (0..100).map(|k| 0.3 + 0.001 * f64::from(k)).collect();
        let Clock::Even(rate) = clock_of(&even) else {
            panic!("even")
        };
        assert_eq!(nice(rate), 1000.0);
        // Stamps of 8192 Hz rounded to milliseconds.
        let rounded: Vec<f64> = (0..8193).map(|k| (f64::from(k) / 8.192).round() * 1e-3).collect();
        assert!(matches!(clock_of(&rounded), Clock::Uneven | Clock::Jitter(_)));
        let scattered: Vec<f64> = (0..1001u32)
            .map(|k| f64::from(k) + 0.1 * f64::from(k % 3))
            .collect();
        assert!(matches!(clock_of(&scattered), Clock::Jitter(r) if (r - 1.0).abs() < 1e-3));
        let mut lost: Vec<f64> = (0..100).map(f64::from).collect();
        lost.remove(50);
        assert_eq!(clock_of(&lost), Clock::Uneven);
        for wrong in [&[0.0, 1.0, 30.0][..], &[1.0], &[2.0, 1.0, 0.0], &[]] {
            assert_eq!(clock_of(wrong), Clock::Uneven);
        }
        assert_eq!(seconds("Time [ms]"), Some(1e-3));
        assert_eq!(seconds("time_us"), Some(1e-6));
        assert_eq!(seconds("t"), Some(1.0));
        assert_eq!(seconds("time [days]"), None);
    }
}
