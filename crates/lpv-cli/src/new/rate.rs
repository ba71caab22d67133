//! The sample rate from a column that tells the time.

use super::{Groups, Known};

/// The known rate, else the one of the time column; a question where there is neither.
pub(super) fn sample_rate(
    known: &Known,
    measured: Option<f64>,
    groups: &Groups,
    guesses: &mut Vec<String>,
    questions: &mut Vec<String>,
) -> Option<f64> {
    if known.sample_rate_hz.is_some() {
        return known.sample_rate_hz;
    }
    match (measured, &groups.time) {
        (Some(rate), Some(time)) => {
            guesses.push(format!("sample_rate = {rate} from the column `{time}`"));
            Some(rate)
        }
        (None, Some(time)) => {
            questions.push(format!(
                "sample_rate: the column `{time}` does not advance evenly; write down the rate in Hz"
            ));
            None
        }
        _ => {
            questions.push(
                "sample_rate: no column tells the time; write down the rate in Hz, or give --sample-rate"
                    .to_owned(),
            );
            None
        }
    }
}

/// Samples per unit of an even time column, rounded where it is nearly a round number.
pub(super) fn rate_of(time: &[f64]) -> Option<f64> {
    let (first, last) = (time.first()?, time.last()?);
    let step = (last - first) / (time.len().checked_sub(1).filter(|n| *n > 0)?) as f64;
    let even = time
        .windows(2)
        .all(|w| ((w[1] - w[0]) - step).abs() <= 0.02 * step);
    if step.is_nan() || step <= 0.0 || !even {
        return None;
    }
    let rate = 1.0 / step;
    let digits = 10f64.powi(4 - rate.log10().floor() as i32);
    let round = (rate * digits).round() / digits;
    Some(if (round / rate - 1.0).abs() < 1e-5 {
        round
    } else {
        rate
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_by_hand() {
        let even: Vec<f64> = (0..100).map(|k| 0.3 + 0.001 * f64::from(k)).collect();
        assert_eq!(rate_of(&even), Some(1000.0));
        assert_eq!(rate_of(&[0.0, 1.0, 3.0]), None);
        assert_eq!(rate_of(&[1.0]), None);
        assert_eq!(rate_of(&[2.0, 1.0, 0.0]), None);
    }
}
