//! A response as a file has it, and what is asked of the file.

use crate::description::Channels;
use crate::{RecordEntry, ResponseQuantity, Text};
use lpv_core::num_complex::Complex;
use std::path::Path;

/// What is known of the error of a measured response. Matrices are column-major, line after line.
#[derive(Debug, Clone, PartialEq)]
pub enum Spread {
    /// Nothing.
    Unknown,
    /// `E |dF_ij|^2` of each channel, above zero.
    Variance(Vec<f64>),
    /// Covariance of the columns of F one below the other, `n x n` with `n` channels, Hermitian.
    Covariance(Vec<Complex<f64>>),
    /// Coherence of each channel, above zero and up to one; of one input, with averages.
    Coherence(Vec<f64>),
}

/// A response as the file has it.
pub(crate) struct Raw {
    pub(crate) frequencies_hz: Vec<f64>,
    pub(crate) values: Vec<Complex<f64>>,
    pub(crate) spread: Spread,
    pub(crate) averages: Option<f64>,
    pub(crate) quantity: Option<ResponseQuantity>,
}

/// What is asked of a file.
pub(crate) struct Asked<'a> {
    pub(crate) path: &'a Path,
    pub(crate) entry: &'a RecordEntry,
    pub(crate) channels: &'a Channels,
    pub(crate) text: Option<&'a Text>,
}

impl Asked<'_> {
    pub(super) fn size(&self) -> (usize, usize) {
        (self.channels.output.len(), self.channels.input.len())
    }
    pub(crate) fn names(&self) -> (&[String], &[String]) {
        (&self.channels.output.columns, &self.channels.input.columns)
    }
}
