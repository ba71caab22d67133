//! Where ticks stand and what is written at them.

/// Labelled ticks, unlabelled ticks and a factor that all labels share.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Ticks {
    /// Axis coordinate (log10 of the value on a logarithmic axis) and label, ascending.
    pub(crate) major: Vec<(f64, String)>,
    /// Axis coordinate of the ticks without label, ascending.
    pub(crate) minor: Vec<f64>,
    /// The labels are to be multiplied by ten to this power.
    pub(crate) factor: Option<i32>,
}

/// A number with a true minus sign; "-0" becomes "0".
pub(crate) fn decimal(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

/// Ten to a power, as markup.
pub(crate) fn power(exponent: i32) -> String {
    let sign = if exponent < 0 { "−" } else { "" };
    format!("10^{{{sign}{}}}", exponent.unsigned_abs())
}

/// Ticks of a linear axis from `lower` to `upper`: multiples of 1, 2 or 5 times a power of ten, as close as
/// `most` ticks allow but at least three if they can be, or multiples of `step`.
pub(crate) fn linear(lower: f64, upper: f64, most: usize, step: Option<f64>) -> Ticks {
    let step = step.unwrap_or_else(|| nice_step(lower, upper, most.max(2)));
    let (first, last) = ends(lower, upper, step);
    if first.is_nan() || last.is_nan() || first > last {
        return Ticks::default();
    }
    let count = (last - first).min(200.0) as usize;
    let values: Vec<f64> = (0..=count).map(|k| (first + k as f64) * step).collect();
    let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let factor = shared_factor(largest);
    let unit = 10_f64.powi(factor.unwrap_or(0));
    let decimals = decimals_of(step / unit);
    let major = values
        .into_iter()
        .map(|v| (v, decimal(v / unit, decimals)))
        .collect();
    Ticks {
        major,
        minor: Vec::new(),
        factor,
    }
}

/// First and last multiple of a step within the ends, where a hair beyond an end still counts.
fn ends(lower: f64, upper: f64, step: f64) -> (f64, f64) {
    ((lower / step - 1e-6).ceil(), (upper / step + 1e-6).floor())
}

/// The smallest of 1, 2, 5 times a power of ten that gives at most `most` ticks. If these are fewer than three,
/// the next smaller one: an axis with one number on it has no scale.
fn nice_step(lower: f64, upper: f64, most: usize) -> f64 {
    let span = upper - lower;
    let exponent = (span / (most as f64 + 1.0)).log10().floor();
    let step = |index: usize| {
        let (mantissa, exponent) = ([1.0, 2.0, 5.0][index % 3], exponent + (index / 3) as f64);
        // Division by a whole power of ten rounds once; multiplication by 0.1 or 0.001 would round twice.
        if exponent < 0.0 {
            mantissa / 10_f64.powf(-exponent)
        } else {
            mantissa * 10_f64.powf(exponent)
        }
    };
    let count = |index: usize| {
        let (first, last) = ends(lower, upper, step(index));
        last - first + 1.0
    };
    let fitting = (0..9).find(|&index| count(index) <= most as f64).unwrap_or(8);
    if count(fitting) < 3.0 && fitting > 0 && count(fitting - 1) <= most as f64 + 2.0 {
        step(fitting - 1)
    } else {
        step(fitting)
    }
}

/// The power of ten, a multiple of three, that very small or large labels share.
fn shared_factor(largest: f64) -> Option<i32> {
    if largest == 0.0 || (1e-2..1e4).contains(&largest) {
        return None;
    }
    // Labels run from 0.5 to 500: 0.5 thousandths rather than 500 millionths.
    let exponent = (2.0 * largest * (1.0 + 1e-9)).log10().floor() as i32;
    Some(3 * exponent.div_euclid(3))
}

/// Decimals needed to tell multiples of `step` apart, at most 12.
fn decimals_of(step: f64) -> usize {
    (0..12)
        .find(|&decimals| {
            let scaled = step * 10_f64.powi(decimals);
            (scaled - scaled.round()).abs() < 1e-6 * scaled
        })
        .unwrap_or(12) as usize
}

/// Ticks of a logarithmic axis between two log10 values, at most about `most` with a label.
pub(crate) fn logarithmic(lower: f64, upper: f64, most: usize) -> Ticks {
    let most = most.max(2) as i32;
    let (first, last) = ((lower - 1e-9).ceil() as i32, (upper + 1e-9).floor() as i32);
    if last - first >= 1 {
        return decades(lower, upper, first, last, most);
    }
    let within = |mantissas: &[i32]| -> Vec<(i32, i32)> {
        let mut found = Vec::new();
        for exponent in (lower.floor() as i32)..=(upper.floor() as i32) {
            for &mantissa in mantissas {
                let at = f64::from(mantissa).log10() + f64::from(exponent);
                if at >= lower - 1e-9 && at <= upper + 1e-9 {
                    found.push((mantissa, exponent));
                }
            }
        }
        found
    };
    let place = |(mantissa, exponent): (i32, i32)| f64::from(mantissa).log10() + f64::from(exponent);
    let labelled = within(&[1, 2, 5]);
    if labelled.len() >= 2 {
        let major: Vec<_> = labelled
            .iter()
            .map(|&m| (place(m), mantissa_label(m.0, m.1)))
            .collect();
        let minor = within(&[3, 4, 6, 7, 8, 9]).into_iter().map(place).collect();
        return Ticks {
            major,
            minor,
            factor: None,
        };
    }
    // Less than a factor of about two: the decades say nothing, equal distances do.
    let mut ticks = linear(10_f64.powf(lower), 10_f64.powf(upper), most as usize, None);
    for tick in &mut ticks.major {
        tick.0 = tick.0.log10();
    }
    ticks
}

fn decades(lower: f64, upper: f64, first: i32, last: i32, most: i32) -> Ticks {
    let count = last - first + 1;
    let stride = (count + most - 1) / most;
    // Labelled decades are multiples of the stride, so that 0 is among them wherever the axis begins.
    let is_major = |k: i32| k.rem_euclid(stride) == 0;
    let major = (first..=last)
        .filter(|&k| is_major(k))
        .map(|k| (f64::from(k), power(k)))
        .collect();
    let minor = if stride > 1 {
        (first..=last).filter(|&k| !is_major(k)).map(f64::from).collect()
    } else {
        (first - 1..=last)
            .flat_map(|k| (2..=9).map(move |m| f64::from(m).log10() + f64::from(k)))
            .filter(|&at| at >= lower - 1e-9 && at <= upper + 1e-9)
            .collect()
    };
    Ticks {
        major,
        minor,
        factor: None,
    }
}

fn mantissa_label(mantissa: i32, exponent: i32) -> String {
    match (mantissa, exponent) {
        (_, -3..=-1) => decimal(
            f64::from(mantissa) * 10_f64.powi(exponent),
            exponent.unsigned_abs() as usize,
        ),
        (_, 0..=3) => decimal(f64::from(mantissa) * 10_f64.powi(exponent), 0),
        (1, _) => power(exponent),
        _ => format!("{mantissa}·{}", power(exponent)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn labels(ticks: &Ticks) -> Vec<&str> {
        ticks.major.iter().map(|(_, label)| label.as_str()).collect()
    }

    #[test]
    fn golden_linear() {
        assert_eq!(
            labels(&linear(0.0, 1.0, 6, None)),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(labels(&linear(-0.31, 0.31, 6, None)), ["−0.2", "0.0", "0.2"]);
        assert_eq!(labels(&linear(-0.31, 0.31, 4, None)), ["−0.2", "0.0", "0.2"]);
        assert_eq!(labels(&linear(-4.5, 4.5, 3, None)), ["−4", "−2", "0", "2", "4"]);
        assert_eq!(
            labels(&linear(-0.3, 0.3, 7, None)),
            ["−0.3", "−0.2", "−0.1", "0.0", "0.1", "0.2", "0.3"]
        );
        assert_eq!(
            labels(&linear(-180.0, 180.0, 9, Some(90.0))),
            ["−180", "−90", "0", "90", "180"]
        );
        assert_eq!(
            labels(&linear(0.0, 1.0, 4, Some(0.25))),
            ["0.00", "0.25", "0.50", "0.75", "1.00"]
        );
        assert_eq!(
            labels(&linear(-83.0, 12.0, 5, None)),
            ["−80", "−60", "−40", "−20", "0"]
        );
    }

    #[test]
    fn golden_linear_with_a_factor() {
        let small = linear(-1e-4, 1e-4, 5, None);
        assert_eq!(
            (labels(&small), small.factor),
            (vec!["−100", "−50", "0", "50", "100"], Some(-6))
        );
        let half = linear(0.0, 6.2e-4, 4, None);
        assert_eq!(
            (labels(&half), half.factor),
            (vec!["0.0", "0.2", "0.4", "0.6"], Some(-3))
        );
        let large = linear(0.0, 2e5, 5, None);
        assert_eq!(
            (labels(&large), large.factor),
            (vec!["0", "50", "100", "150", "200"], Some(3))
        );
    }

    #[test]
    fn golden_logarithmic() {
        let bode = logarithmic(-2.0, 1.0, 6);
        assert_eq!(labels(&bode), ["10^{−2}", "10^{−1}", "10^{0}", "10^{1}"]);
        assert_eq!(bode.minor.len(), 3 * 8);
        let wide = logarithmic(-12.0, 3.0, 6);
        assert_eq!(
            labels(&wide),
            ["10^{−12}", "10^{−9}", "10^{−6}", "10^{−3}", "10^{0}", "10^{3}"]
        );
        assert_eq!(wide.minor.len(), 10);
        assert_eq!(
            labels(&logarithmic(0.2_f64.log10(), 3_f64.log10(), 6)),
            ["0.2", "0.5", "1", "2"]
        );
        assert_eq!(
            labels(&logarithmic(2e-7_f64.log10(), 6e-7_f64.log10(), 6)),
            ["2·10^{−7}", "5·10^{−7}"]
        );
        assert_eq!(
            labels(&logarithmic(1.2_f64.log10(), 1.6_f64.log10(), 5)),
            ["1.2", "1.3", "1.4", "1.5", "1.6"]
        );
    }

    proptest! {
        #[test]
        fn ticks_lie_on_the_axis_in_order(
            centre in prop_oneof![-1e3..1e3f64, -1e200..1e200f64, Just(0.0)],
            relative in -8.0..3.0f64,
            most in 1usize..20,
        ) {
            let half = 10_f64.powf(relative) * centre.abs().max(1e-200);
            let (lower, upper) = (centre - half, centre + half);
            let ticks = linear(lower, upper, most, None);
            let slack = 1e-2 * (upper - lower);
            prop_assert!(ticks.major.len() <= most.max(2) + 2, "{} ticks", ticks.major.len());
            prop_assert!(ticks.major.iter().all(|(at, _)| *at >= lower - slack && *at <= upper + slack));
            prop_assert!(ticks.major.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 != w[1].1), "{:?}", ticks);
        }

        #[test]
        fn a_logarithmic_axis_is_never_without_labels(lower in -290.0..289.0f64, span in 1e-4..500.0f64, most in 2usize..12) {
            let upper = (lower + span).min(290.0);
            prop_assume!(upper - lower > 1e-4);
            let ticks = logarithmic(lower, upper, most);
            prop_assert!(!ticks.major.is_empty() && ticks.major.len() <= 12.max(most + 1), "{:?}", ticks);
            prop_assert!(ticks.major.windows(2).all(|w| w[0].0 < w[1].0));
            prop_assert!(ticks.major.iter().all(|t| t.0 >= lower - 1e-2 * span && t.0 <= upper + 1e-2 * span));
        }
    }
}
