//! What the parts of a response are called in a file.

use crate::description::Channels;

/// Names of the columns of a channel.
pub(super) const RE: &str = "re";
pub(super) const IM: &str = "im";
pub(super) const MAGNITUDE: &str = "magnitude";
pub(super) const DECIBEL: &str = "dB";
pub(super) const DEGREES: &str = "deg";
pub(super) const RADIANS: &str = "rad";
pub(super) const VARIANCE: &str = "variance";
pub(super) const COHERENCE: &str = "coherence";

pub(super) fn column(output: &str, input: &str, part: &str) -> String {
    format!("{output}/{input} {part}")
}

/// The frequency in Hz, or in its place in rad/s.
pub(super) const FREQUENCY: &str = "frequency";
pub(super) const OMEGA: &str = "omega";

/// Whether a name is that of a part of a channel, in real numbers.
pub(super) fn is_part(name: &str) -> bool {
    let parts = [RE, IM, MAGNITUDE, DECIBEL, DEGREES, RADIANS];
    name.rsplit_once(' ')
        .is_some_and(|(channel, part)| channel.contains('/') && parts.contains(&part))
}

/// Names of arrays.
const ARRAYS: [&str; 7] = [
    FREQUENCY,
    OMEGA,
    "response",
    "variance",
    "covariance",
    "coherence",
    "averages",
];

/// Everything that `columns` of a response record may name: arrays, columns of channels, and channels.
pub(crate) fn names(channels: &Channels) -> Vec<String> {
    let (outputs, inputs) = (&channels.output.columns, &channels.input.columns);
    let mut names: Vec<String> = ARRAYS.map(str::to_owned).to_vec();
    names.extend(outputs.iter().chain(inputs).cloned());
    for (y, u) in outputs.iter().flat_map(|y| inputs.iter().map(move |u| (y, u))) {
        let parts = [RE, IM, MAGNITUDE, DECIBEL, DEGREES, RADIANS, VARIANCE, COHERENCE];
        names.extend(parts.map(|part| column(y, u, part)));
    }
    names
}
