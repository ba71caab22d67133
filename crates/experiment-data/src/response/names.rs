//! What the parts of a response are called in a file.

use crate::description::Channels;

/// Names of the columns of a channel.
pub(super) const RE: &str = "re";
pub(super) const IM: &str = "im";
pub(super) const VARIANCE: &str = "variance";
pub(super) const COHERENCE: &str = "coherence";

pub(super) fn column(output: &str, input: &str, part: &str) -> String {
    format!("{output}/{input} {part}")
}

/// Names of arrays.
const ARRAYS: [&str; 6] = [
    "frequency",
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
        let parts = [RE, IM, VARIANCE, COHERENCE];
        names.extend(parts.map(|part| column(y, u, part)));
    }
    names
}
