//! What can be wrong with a measured frequency response.

use crate::nearest::hint;

/// What can be wrong with a measured frequency response. Lines are counted from 1.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResponseFault {
    /// A record of samples was asked of a response, or the other way round.
    #[error("kind = \"response\" is a measured frequency response and has no samples")]
    NoSamples,
    /// Something that the file does not have.
    #[error(
        "no `{name}` in the file{}, which holds {}; say where it is with columns = {{ \"{name}\" = \"...\" }}",
        hint(nearest),
        listed(present)
    )]
    Missing {
        /// Its name.
        name: String,
        /// Names that look like it.
        nearest: Vec<String>,
        /// Names in the file.
        present: Vec<String>,
    },
    /// A response without imaginary parts.
    #[error("`{name}` holds real numbers; a frequency response is complex (no magnitudes, no decibels)")]
    NotComplex {
        /// Its name.
        name: String,
    },
    /// Imaginary parts where there are none.
    #[error("`{name}` holds complex numbers; it is real")]
    Complex {
        /// Its name.
        name: String,
    },
    /// An array of another size.
    #[error("`{name}` is {found:?}; needed is {needed:?}: {meaning}")]
    Shape {
        /// Its name.
        name: String,
        /// Its shape.
        found: Vec<u64>,
        /// The shape that fits frequencies and channels.
        needed: Vec<usize>,
        /// What the indices count.
        meaning: &'static str,
    },
    /// A frequency that no line can have.
    #[error("line {line}: the frequency {value:?} Hz is {problem}")]
    Frequency {
        /// The line.
        line: usize,
        /// Its value.
        value: f64,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// No lines.
    #[error("no line above 0 Hz; a response needs frequencies")]
    NoLines,
    /// NaN or infinity.
    #[error(
        "`{name}` is NaN or infinite in line {line} ({frequency_hz} Hz), {count} in all; leave such lines out, or use `rows`"
    )]
    NotFinite {
        /// What holds it.
        name: &'static str,
        /// The first line concerned.
        line: usize,
        /// Its frequency.
        frequency_hz: f64,
        /// How many numbers.
        count: usize,
    },
    /// A channel without a response.
    #[error("the response of {channel} is zero at all lines: a dead channel or the wrong one")]
    Dead {
        /// The output or the input.
        channel: String,
    },
    /// A variance, covariance or coherence that cannot be.
    #[error("`{name}` in line {line} is {value:?}; {allowed}")]
    Spread {
        /// Which.
        name: &'static str,
        /// The line.
        line: usize,
        /// Its value.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// A coherence that says nothing of the variance.
    #[error("`coherence` tells a variance {problem}")]
    Coherence {
        /// What is missing.
        problem: &'static str,
    },
    /// Accelerations in another unit than the quantity.
    #[error(
        "`{what}` is in g and not in units of the output over s^2: write scale = [9.80665] for an output in m, and for others what their          unit makes of it"
    )]
    InGravities {
        /// The function.
        what: String,
    },
    /// The frequency unit of a struct of MATLAB's frd kind.
    #[error("`{name}` is {found}; \"Hz\" or \"rad/s\" is needed there, a factor of 6.28 hangs on it")]
    Units {
        /// Where it stands.
        name: String,
        /// What stands there.
        found: String,
    },
    /// Two statements of what the response is of.
    #[error(
        "`quantity` = \"{stated}\", but the file says {found}; correct one of them, or leave `quantity` out"
    )]
    Quantity {
        /// The description's.
        stated: &'static str,
        /// The file's.
        found: &'static str,
    },
    /// No or several functions of a universal file that are the response of a channel.
    #[error(
        "{found} frequency responses of output `{output}` over input `{input}` in the file, which has {}; name the places of channels: columns = {{ \"{output}\" = \"12+Z\", \"{input}\" = \"3-X\" }}",
        listed(present)
    )]
    Functions {
        /// How many.
        found: usize,
        /// Place of the output.
        output: String,
        /// Place of the input.
        input: String,
        /// Those of the file: response over reference.
        present: Vec<String>,
    },
    /// Functions of one response that are of displacement here and of acceleration there, or over other quantities.
    #[error(
        "the frequency responses of these channels are of different quantities; measure all outputs alike, or make a bundle of each"
    )]
    Mixed,
    /// Functions of one response at other lines.
    #[error(
        "the frequency response {what} has other lines than {first}; a response has one list of frequencies"
    )]
    Lines {
        /// The function.
        what: String,
        /// The first one.
        first: String,
    },
}

/// Names as a list; of many the first ones.
fn listed(names: &[String]) -> String {
    const MOST: usize = 12;
    let some: Vec<&str> = names.iter().take(MOST).map(String::as_str).collect();
    match names.len() {
        0 => "none".to_owned(),
        n if n > MOST => format!("{} and {} more", some.join(", "), n - MOST),
        _ => some.join(", "),
    }
}
