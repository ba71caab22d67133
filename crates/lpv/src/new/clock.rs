//! What a column of time stamps says about the samples.

use crate::signal::steps_of_counter;

/// A step that is taken as even may differ from the mean by this part.
const EVEN: f64 = 0.02;

/// Stamps that are not further from a multiple of the step are taken for that multiple.
const NEAR: f64 = 0.3;

/// What the time column of one file says; rows count from 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Clock {
    /// The step in the unit of the column.
    Even(f64),
    /// The mean step of stamps that scatter or are rounded by less than a sample.
    Jitter {
        /// The mean step.
        step: f64,
        /// Largest distance of a stamp from the even clock, in steps.
        largest: f64,
    },
    /// An even clock that leaves samples out.
    Lost {
        /// The step.
        step: f64,
        /// Rows after which samples are missing, and how many.
        gaps: Vec<(usize, usize)>,
    },
    /// No clock: the row at which this shows, where there is one.
    Uneven(Option<usize>),
}

impl Clock {
    /// The step, where there is one.
    pub(super) fn step(&self) -> Option<f64> {
        match self {
            Self::Even(step) | Self::Jitter { step, .. } | Self::Lost { step, .. } => Some(*step),
            Self::Uneven(_) => None,
        }
    }

    /// After which rows how many samples are missing.
    pub(super) fn gaps(&self) -> &[(usize, usize)] {
        match self {
            Self::Lost { gaps, .. } => gaps,
            _ => &[],
        }
    }

    /// The longest stretch without a missing sample: its first row, from 0, and the row behind its end.
    pub(super) fn longest_stretch(&self, rows: usize) -> (usize, usize) {
        let Self::Lost { gaps, .. } = self else {
            return (0, rows);
        };
        let ends = gaps.iter().map(|(row, _)| *row).chain([rows]);
        let (mut best, mut from) = ((0, 0), 0);
        for end in ends {
            if end - from > best.1 - best.0 {
                best = (from, end);
            }
            from = end;
        }
        best
    }
}

/// What a time column says. Counters that start again from zero, and midnight where the column tells the time of day, are
/// seen through.
pub(super) fn clock_of(time: &[f64], time_of_day: bool) -> Clock {
    if let Some(row) = time.iter().position(|t| !t.is_finite()) {
        return Clock::Uneven(Some(row + 1));
    }
    let steps = steps_of_counter(time, time_of_day.then_some(86_400.0));
    if steps.is_empty() {
        return Clock::Uneven(None);
    }
    let usual = lpv_numerics::statistics::median(&steps);
    if let Some(back) = steps.iter().position(|d| *d < 0.0) {
        return Clock::Uneven(Some(back + 2));
    }
    let count = steps.len() as f64;
    let mean = steps.iter().sum::<f64>() / count;
    if !(mean.is_finite() && mean > 0.0) {
        return Clock::Uneven(None);
    }
    let (step, largest) = line_through(&steps);
    let within = |part: f64| steps.iter().all(|d| (d - mean).abs() <= part * mean);
    if within(EVEN) {
        return Clock::Even(step);
    }
    // A lost sample makes a step of two, or shifts the stamps around it by half a sample.
    if within(0.45) && largest <= 0.25 {
        return Clock::Jitter { step, largest };
    }
    // Stamps that are rounded to more than a step follow the even clock to within the rounding.
    let resolution = steps
        .iter()
        .copied()
        .filter(|d| *d > 0.0)
        .fold(f64::INFINITY, f64::min);
    let on_grid = |d: &f64| (d / resolution - (d / resolution).round()).abs() < 1e-3;
    let unusual = steps
        .iter()
        .filter(|d| (*d - usual).abs() > 0.1 * resolution)
        .count();
    let rounded = resolution > 0.5 * mean && largest * step <= 0.55 * resolution && steps.iter().all(on_grid);
    // A lost sample now and then is no rounding.
    if rounded && 20 * unusual >= steps.len() {
        return Clock::Jitter { step, largest };
    }
    lost(&steps, usual).unwrap_or_else(|| {
        let worst = steps.iter().position(|d| (d - usual).abs() > NEAR * usual);
        Clock::Uneven(worst.map(|k| k + 2))
    })
}

/// The even clock next to the stamps by least squares: its step, and the largest distance of a stamp from it in steps. First
/// and last stamp alone would carry their own error over to all others.
fn line_through(steps: &[f64]) -> (f64, f64) {
    let centre = 0.5 * steps.len() as f64;
    let mut stamps = Vec::with_capacity(steps.len() + 1);
    let mut at = 0.0;
    stamps.push(at);
    stamps.extend(steps.iter().map(|d| {
        at += d;
        at
    }));
    let (mut above, mut below) = (0.0, 0.0);
    for (k, stamp) in stamps.iter().enumerate() {
        let x = k as f64 - centre;
        above += x * stamp;
        below += x * x;
    }
    let step = above / below;
    let (low, high) = stamps
        .iter()
        .enumerate()
        .map(|(k, stamp)| stamp - step * k as f64)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), r| {
            (low.min(r), high.max(r))
        });
    (step, 0.5 * (high - low) / step)
}

/// A clock whose steps are multiples of the usual one.
fn lost(steps: &[f64], usual: f64) -> Option<Clock> {
    if usual <= 0.0 {
        return None;
    }
    // Stamps are rounded: over a pause of minutes only the mean of many steps counts the samples.
    let single: Vec<f64> = steps
        .iter()
        .copied()
        .filter(|d| (d - usual).abs() <= NEAR * usual)
        .collect();
    let usual = lpv_numerics::statistics::mean(&single);
    let mut gaps = Vec::new();
    let mut all = 0.0;
    for (k, d) in steps.iter().enumerate() {
        let times = (d / usual).round();
        // The step is known to a part in the number of rows only, and long gaps count it often.
        if times < 1.0 || (d - times * usual).abs() > (NEAR + 0.01 * times) * usual {
            return None;
        }
        all += times;
        if times > 1.0 {
            gaps.push((k + 1, times as usize - 1));
        }
    }
    let step = steps.iter().sum::<f64>() / all;
    (!gaps.is_empty() && 5 * gaps.len() <= steps.len()).then_some(Clock::Lost { step, gaps })
}

/// Whether a column counts the rows.
pub(super) fn counts_rows(x: &[f64]) -> bool {
    x.len() > 2 && (x[0] == 0.0 || x[0] == 1.0) && x.iter().enumerate().all(|(k, v)| *v == x[0] + k as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn even(rows: u32, step: f64) -> Vec<f64> {
        (0..rows).map(|k| 0.3 + step * f64::from(k)).collect()
    }

    #[test]
    fn clocks_by_hand() {
        for step in [1e-6, 1e-3, 0.1, 10.0] {
            let clock = clock_of(&even(100, step), false);
            assert!(
                matches!(clock, Clock::Even(s) if (s / step - 1.0).abs() < 1e-6),
                "{clock:?}"
            );
        }
        // Stamps of 8192 Hz rounded to milliseconds, and of 700 Hz.
        for (rate, rows) in [(8.192, 8193), (0.7, 701)] {
            let rounded: Vec<f64> = (0..rows).map(|k| (f64::from(k) / rate).round()).collect();
            let clock = clock_of(&rounded, false);
            assert!(
                matches!(clock, Clock::Jitter { step, .. } if (step * rate - 1.0).abs() < 2e-3),
                "{rate}: {clock:?}"
            );
        }
        let scattered: Vec<f64> = (0..1001u32)
            .map(|k| f64::from(k) + 0.1 * f64::from(k % 3))
            .collect();
        assert!(
            matches!(clock_of(&scattered, false), Clock::Jitter { step, .. } if (step - 1.0).abs() < 1e-3)
        );
        for wrong in [&[0.0, 1.0, 30.0, 31.3][..], &[1.0], &[2.0, 1.0, 0.0], &[]] {
            assert!(matches!(clock_of(wrong, false), Clock::Uneven(_)), "{wrong:?}");
        }
        let mut back = even(50, 1.0);
        back[20] = 3.0;
        assert_eq!(clock_of(&back, false), Clock::Uneven(Some(21)));
    }

    #[test]
    fn scattered_stamps_show_the_step_and_their_scatter() {
        for (step, scatter, rows) in [(1e-3, 0.1, 2048), (5.0, 0.2, 400), (2e-5, 0.05, 20_000)] {
            let stamps: Vec<f64> = (0..rows)
                .map(|k| step * (f64::from(k) + scatter * (2.3 * f64::from(k)).sin()))
                .collect();
            let Clock::Jitter { step: found, largest } = clock_of(&stamps, false) else {
                panic!("{step}")
            };
            assert!((found / step - 1.0).abs() < 1e-5, "{found} {step}");
            assert!((largest / scatter - 1.0).abs() < 0.02, "{largest} {scatter}");
        }
    }

    #[test]
    fn lost_samples_are_counted_where_they_are() {
        let mut time = even(1000, 5e-4);
        time.drain(700..703);
        time.remove(100);
        let clock = clock_of(&time, false);
        let Clock::Lost { step, gaps } = &clock else {
            panic!("{clock:?}")
        };
        assert!((step / 5e-4 - 1.0).abs() < 1e-9);
        assert_eq!(gaps.as_slice(), [(100, 1), (699, 3)]);
        // Seconds since 1970 are rounded to 2.4e-7; a pause of minutes between.
        for (rate, pause) in [(4000.0, 240_000), (1000.0, 600_000), (20_000.0, 200_000)] {
            let at = |k: u32| 1.7e9 + f64::from(k) / rate;
            let time: Vec<f64> = (0..3000).chain(3000 + pause..6000 + pause).map(at).collect();
            let Clock::Lost { step, gaps } = clock_of(&time, true) else {
                panic!("{rate}")
            };
            assert!((step * rate - 1.0).abs() < 1e-7, "{rate}: {step}");
            assert_eq!(gaps, [(3000, pause as usize)]);
        }
        assert_eq!(clock.longest_stretch(time.len()), (100, 699));
    }

    #[test]
    fn counters_and_days_start_again() {
        let counter: Vec<f64> = (0..1000u32)
            .map(|k| f64::from((65_000 + 100 * k) % 65_536))
            .collect();
        assert_eq!(clock_of(&counter, false), Clock::Even(100.0));
        let midnight: Vec<f64> = (0..1000u32)
            .map(|k| (86_399.0 + 0.01 * f64::from(k)) % 86_400.0)
            .collect();
        assert!(matches!(clock_of(&midnight, true), Clock::Even(_)));
        assert!(matches!(clock_of(&midnight, false), Clock::Uneven(_)));
    }

    #[test]
    fn rows_that_count() {
        assert!(counts_rows(&[1.0, 2.0, 3.0]) && counts_rows(&[0.0, 1.0, 2.0, 3.0]));
        assert!(
            !counts_rows(&[0.0, 1.0, 3.0]) && !counts_rows(&[0.0, 1.0]) && !counts_rows(&[2.0, 3.0, 4.0])
        );
    }
}
