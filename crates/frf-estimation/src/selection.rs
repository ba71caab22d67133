//! Which lines carry excitation.

use crate::averages::Averages;
use crate::settings::check_lines;
use crate::{FrfError, Instrument, LineSelection};

/// Lines on either side over which the strongest one is looked for.
const NEIGHBOURS: usize = 32;
/// Amplitude relative to the strongest line of all below which a line is not excited. A reference is designed, so what
/// lies 46 dB below its strongest line is a leftover (a glitch in one sample is white); an input may be shaped by the loop
/// over many decades, and only rounding is left out.
const fn floor(instrument: Instrument) -> f64 {
    match instrument {
        Instrument::References => 5e-3,
        _ => 1e-6,
    }
}
/// Power of the averaged input over its noise that an excited line must reach (10 dB).
const LEAST_SNR: f64 = 10.0;
/// Amplitude relative to the strongest line of all (40 dB) below which a line is excited only if the outputs show it too.
const LEFTOVER: f64 = 1e-2;
/// Threshold that tells quiet lines where the settings give none.
const DEFAULT_THRESHOLD: f64 = 1e-2;

/// Lines to estimate and lines without excitation, in cycles a period; a weakly excited line is in neither.
pub(crate) struct Selection {
    pub(crate) lines: Vec<usize>,
    pub(crate) quiet: Vec<usize>,
}

/// Applies the settings to the averages.
pub(crate) fn select(averages: &Averages<'_>, instrument: Instrument) -> Result<Selection, FrfError> {
    let lines = averages.lines;
    let threshold = match averages.settings.lines {
        LineSelection::Excited { relative_threshold } => relative_threshold,
        _ => DEFAULT_THRESHOLD,
    };
    let level = levels(averages, instrument);
    let strongest = level.iter().copied().fold(0.0, f64::max);
    let strong = strong_lines(&level, threshold, floor(instrument));
    let chosen: Vec<usize> = match &averages.settings.lines {
        LineSelection::All => (1..=lines).collect(),
        LineSelection::List(list) => {
            check_lines(list, lines)?;
            list.clone()
        }
        LineSelection::Excited { .. } => {
            let (ny, nu) = (averages.layout.outputs, averages.layout.inputs);
            let share = averages.share_of_noise();
            let above = |channels: std::ops::Range<usize>, k: usize| {
                let count = channels.len() as f64;
                channels.map(|c| averages.snr(share, c, k)).sum::<f64>() >= LEAST_SNR * count
            };
            // Far below the band the outputs tell whether a line is excited or a leftover.
            let weak = |k: usize| level[k - 1] < LEFTOVER * strongest;
            let clear = |k: usize| above(ny..ny + nu, k) && (!weak(k) || above(0..ny, k));
            (1..=lines).filter(|&k| strong[k - 1] && clear(k)).collect()
        }
    };
    if chosen.is_empty() {
        return Err(FrfError::NoExcitation {
            what: match instrument {
                Instrument::References => "the reference, or the input in response to it,",
                _ => "the input",
            },
        });
    }
    let mut quiet: Vec<bool> = strong.iter().map(|s| !s).collect();
    chosen.iter().for_each(|k| quiet[k - 1] = false);
    Ok(Selection {
        lines: chosen,
        quiet: (1..=lines).filter(|k| quiet[k - 1]).collect(),
    })
}

/// Amplitude of the instrument by line. Each channel is scaled by its largest value first, so that units do not count.
fn levels(averages: &Averages<'_>, instrument: Instrument) -> Vec<f64> {
    let layout = &averages.layout;
    let channels = match instrument {
        Instrument::References => 0..layout.references,
        _ => layout.outputs..layout.outputs + layout.inputs,
    };
    let mut level = vec![0.0; averages.lines];
    for c in channels {
        let power = |k: usize| {
            let l = averages.order.place(k);
            let means = averages.experiments.iter().map(|e| match instrument {
                Instrument::References => e.reference.at(c, l),
                _ => e.signals.at(c, l),
            });
            means.map(|x| x.norm_sqr()).sum::<f64>()
        };
        let powers: Vec<f64> = (1..=averages.lines).map(power).collect();
        let largest = powers.iter().copied().fold(0.0, f64::max);
        if largest > 0.0 {
            level.iter_mut().zip(powers).for_each(|(a, p)| *a += p / largest);
        }
    }
    level.into_iter().map(f64::sqrt).collect()
}

fn strong_lines(level: &[f64], threshold: f64, floor: f64) -> Vec<bool> {
    let global = level.iter().copied().fold(0.0, f64::max);
    let local = windowed_maximum(level, NEIGHBOURS);
    let strong = |(a, m): (&f64, &f64)| *a > 0.0 && *a >= threshold * m && *a >= floor * global;
    level.iter().zip(&local).map(strong).collect()
}

/// Largest value within `half` entries on either side, whatever `half`, in three passes: a window is the end of one block of its
/// length and the beginning of the next \[vanherk1992\].
fn windowed_maximum(values: &[f64], half: usize) -> Vec<f64> {
    let width = 2 * half + 1;
    let mut padded = vec![0.0; values.len() + 2 * half];
    padded[half..half + values.len()].copy_from_slice(values);
    let (mut from_left, mut from_right) = (padded.clone(), padded);
    for (left, right) in from_left.chunks_mut(width).zip(from_right.chunks_mut(width)) {
        (1..left.len()).for_each(|i| left[i] = left[i].max(left[i - 1]));
        (1..right.len())
            .rev()
            .for_each(|i| right[i - 1] = right[i - 1].max(right[i]));
    }
    let ends = from_left[width - 1..].iter();
    from_right.iter().zip(ends).map(|(a, b)| a.max(*b)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coloured_excitation_with_gaps() {
        // Amplitude falls by 1/k over three decades; every third line is empty but for distortion 60 dB below.
        let amplitude = |k: usize| if k.is_multiple_of(3) { 1e-3 } else { 1.0 } / k as f64;
        let level: Vec<f64> = (1..=1000).map(amplitude).collect();
        let strong = strong_lines(&level, 1e-2, 1e-6);
        let weak = |k: &usize| k.is_multiple_of(3);
        assert!((1..=1000usize).all(|k| strong[k - 1] != weak(&k)));
        // A white leftover 62 dB below a band is no excitation, however far from the band.
        let band: Vec<f64> = (1..=1000).map(|k| if k < 250 { 1.0 } else { 8e-4 }).collect();
        let strong = strong_lines(&band, 1e-2, floor(Instrument::References));
        assert_eq!(strong.iter().filter(|s| **s).count(), 249);
        assert!(strong_lines(&[0.0; 4], 1e-2, 1e-6).iter().all(|s| !s));
    }

    #[test]
    fn windows_by_hand() {
        let values: Vec<f64> = (0..20u32).map(|i| f64::from(i * 7919 % 23)).collect();
        for half in [0, 1, 3, 8, 30] {
            let found = windowed_maximum(&values, half);
            assert_eq!(found.len(), values.len());
            for (i, found) in found.iter().enumerate() {
                let window = &values[i.saturating_sub(half)..(i + half + 1).min(values.len())];
                assert_eq!(*found, window.iter().copied().fold(0.0, f64::max));
            }
        }
        assert!(windowed_maximum(&[], 2).is_empty());
    }
}
