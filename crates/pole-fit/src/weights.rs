//! The lines of a fit with their weights: covariance in, inverse covariance `K` out.
//!
//! Channels of a line are numbered `c = j n_y + i` (column-major). From `dF = V G` with `E[v v^H] = C_V` and
//! `S = G^H G` follows `E[dF_ij conj dF_kl] = C_V[i,k] S[l,j]`, the matrix `S^T (x) C_V`, whose inverse is
//! `K = conj(S^-1) (x) C_V^-1`.

use crate::columns::{Columns, add_conjugate_product, add_product, blocks, real_product};
use crate::hermitian::inverse_or_diagonal;
use crate::{PoleFitError, PoleFitSettings, Weighting};
use lpv_core::{Clock, CoreError, Discrete, FrfEstimate};
use num_complex::Complex;

type C64 = Complex<f64>;
const ZERO: C64 = C64::new(0.0, 0.0);

/// Part of a diagonal that is added to it, so that a nearly singular matrix keeps a Cholesky factor.
const DIAGONAL_LIFT: f64 = 1e-12;

/// What the fit works on: lines in the band, the delay taken out.
#[derive(Debug)]
pub(crate) struct Lines {
    pub(crate) n_y: usize,
    pub(crate) n_u: usize,
    pub(crate) frequencies_hz: Vec<f64>,
    pub(crate) z: Vec<C64>,
    /// Response, a column a channel.
    pub(crate) f: Columns,
    /// Diagonal of the inverse covariance `K` (the weight), channel after channel.
    diagonal: Vec<f64>,
    /// Entries of `K` above the diagonal, a column a pair of `coupled`.
    pub(crate) coupling: Columns,
    /// `C_V` as used (smoothed, with its floor) and `S` (with its floor).
    c_v: Vec<C64>,
    s: Vec<C64>,
    /// Pairs `c < d` of channels that the weight couples on some line.
    pub(crate) coupled: Vec<(usize, usize)>,
    /// Mean weight of the channels on each line, each channel divided by its mean over the lines.
    pub(crate) profile: Vec<f64>,
    /// Complex degrees of freedom of the smoothed covariance, mean over the lines.
    pub(crate) degrees_of_freedom: f64,
    pub(crate) lines_left_out: usize,
    pub(crate) diagonal_fallbacks: usize,
}

impl Lines {
    pub(crate) fn channels(&self) -> usize {
        self.n_y * self.n_u
    }
    pub(crate) fn len(&self) -> usize {
        self.z.len()
    }

    pub(crate) fn new(
        estimate: &FrfEstimate,
        clock: Discrete,
        settings: &PoleFitSettings,
    ) -> Result<Self, PoleFitError> {
        let set = settings;
        let frf = estimate.frf();
        let (n_y, n_u) = (frf.outputs(), frf.inputs());
        for (what, n) in [
            ("outputs", n_y),
            ("inputs", n_u),
            ("lines of the response", frf.len()),
        ] {
            if n == 0 {
                return Err(PoleFitError::Empty { what });
            }
        }
        let limit = clock.nyquist_hz() * (1.0 + 1e-12);
        let (lower_hz, upper_hz) = set.band.unwrap_or((0.0, limit));
        let frequencies = frf.frequencies_hz();
        let fixed = settings.fixed_integrators() > 0;
        let one = C64::new(1.0, 0.0);
        let (index, z): (Vec<usize>, Vec<C64>) = (0..frf.len())
            .filter(|&k| (lower_hz..=upper_hz).contains(&frequencies[k]) || set.band.is_none())
            .map(|k| (k, clock.point(frequencies[k])))
            // A fixed integrator makes the model infinite at z = 1, whatever the data say.
            .filter(|&(_, z)| !(fixed && z == one))
            .unzip();
        if index.is_empty() {
            return Err(PoleFitError::EmptyBand {
                lower_hz,
                upper_hz,
                lines: frf.len(),
            });
        }
        if let Some(&k) = index.iter().find(|&&k| frequencies[k] > limit) {
            return Err(PoleFitError::Core(CoreError::Frequency {
                index: k,
                value_hz: frequencies[k],
                problem: "above the Nyquist frequency of the clock",
            }));
        }
        let mut f = Columns::zeros(index.len(), n_y * n_u);
        for (line, (&k, z)) in index.iter().zip(&z).enumerate() {
            let advance = z.powu(set.delay_samples as u32);
            for (c, v) in frf.line_slice(k).iter().enumerate() {
                f.set(line, c, v * advance);
            }
        }
        if f.parts().iter().all(|v| *v == 0.0) {
            return Err(PoleFitError::ZeroResponse);
        }
        let mut lines = Self {
            n_y,
            n_u,
            frequencies_hz: index.iter().map(|&k| frequencies[k]).collect(),
            z,
            f,
            diagonal: Vec::new(),
            coupling: Columns::zeros(index.len(), 0),
            c_v: Vec::new(),
            s: Vec::new(),
            coupled: Vec::new(),
            profile: Vec::new(),
            degrees_of_freedom: estimate.degrees_of_freedom(),
            lines_left_out: frf.len() - index.len(),
            diagonal_fallbacks: 0,
        };
        lines.smooth(estimate, &index, set.smoothing_lines);
        lines.lift(set.relative_floor);
        let needed = match set.weighting {
            Weighting::Covariance => n_y as f64 + 1.0,
            Weighting::DiagonalCovariance => 2.0,
            Weighting::Relative | Weighting::Uniform => -1.0,
        };
        if lines.degrees_of_freedom <= needed {
            return Err(PoleFitError::DegreesOfFreedom {
                found: lines.degrees_of_freedom,
                needed,
            });
        }
        lines.weigh(set.weighting);
        lines.check_range(&index)?;
        lines.summarise();
        Ok(lines)
    }

    /// Hermitian parts of `C_V`, averaged over neighbours, and of `S`.
    fn smooth(&mut self, estimate: &FrfEstimate, index: &[usize], half: usize) {
        let (n, m) = (self.n_y, self.n_u);
        let count = index.len();
        let mut terms = 0;
        for k in 0..count {
            let window = &index[k.saturating_sub(half)..(k + half + 1).min(count)];
            terms += window.len();
            let start = self.c_v.len();
            self.c_v.resize(start + n * n, ZERO);
            for &l in window {
                let c = estimate.output_covariance(l);
                for j in 0..n {
                    for i in 0..n {
                        self.c_v[start + j * n + i] +=
                            (c[(i, j)] + c[(j, i)].conj()) * (0.5 / window.len() as f64);
                    }
                }
            }
            let s = estimate.input_factor(index[k]);
            for j in 0..m {
                for i in 0..m {
                    self.s.push((s[(i, j)] + s[(j, i)].conj()) * 0.5);
                }
            }
        }
        // Each line adds its own degrees of freedom to the mean.
        self.degrees_of_freedom *= terms as f64 / count as f64;
    }

    /// Floors that keep both factors positive definite on noise-free data.
    fn lift(&mut self, relative_floor: f64) {
        let (n, m) = (self.n_y, self.n_u);
        let mut floors = vec![0.0f64; self.len() * n];
        for k in 0..self.len() {
            let s = &mut self.s[k * m * m..(k + 1) * m * m];
            let mean = (0..m).map(|j| s[j * m + j].re.max(0.0)).sum::<f64>() / m as f64;
            // Where S says nothing, the response is taken to be measured by unit inputs.
            let (mean, blank) = if mean > 0.0 { (mean, false) } else { (1.0, true) };
            for j in 0..m {
                if blank {
                    s[j * m..(j + 1) * m].fill(ZERO);
                    s[j * m + j] = C64::new(1.0, 0.0);
                }
                let d = &mut s[j * m + j];
                *d = C64::new(d.re.max(0.0) + DIAGONAL_LIFT * mean, 0.0);
            }
            for i in 0..n {
                floors[k * n + i] = relative_floor.powi(2) * self.row_square(k, i) / (m as f64 * mean);
            }
        }
        let largest = floors.iter().copied().fold(0.0, f64::max);
        for k in 0..self.len() {
            for i in 0..n {
                let d = &mut self.c_v[k * n * n + i * n + i];
                let lifted = d.re.max(0.0) * (1.0 + DIAGONAL_LIFT) + floors[k * n + i];
                // An output that is zero without any noise gets the floor of the largest line.
                *d = C64::new(if lifted > 0.0 { lifted } else { largest }, 0.0);
            }
        }
    }

    /// Sum of squares of the response of an output on a line, over the inputs.
    fn row_square(&self, line: usize, output: usize) -> f64 {
        let row = (0..self.n_u).map(|j| self.f.at(line, j * self.n_y + output));
        row.map(|v| v.norm_sqr()).sum()
    }

    fn weigh(&mut self, weighting: Weighting) {
        self.diagonal = vec![0.0; self.len() * self.channels()];
        if weighting == Weighting::Covariance {
            self.weigh_by_covariance();
            return;
        }
        let (n, m, lines) = (self.n_y, self.n_u, self.len());
        for i in 0..n {
            // A row that vanishes on a line must not get an infinite weight.
            let total: f64 = (0..lines).map(|k| self.row_square(k, i)).sum();
            let least = 1e-12 * total / lines as f64;
            for k in 0..lines {
                for j in 0..m {
                    let variance = match weighting {
                        Weighting::Covariance | Weighting::DiagonalCovariance => {
                            self.c_v[(k * n + i) * n + i].re * self.s[(k * m + j) * m + j].re
                        }
                        Weighting::Relative => {
                            let square = self.row_square(k, i).max(least);
                            // A row that is zero on all lines is fitted by zero, whatever its weight.
                            if square > 0.0 { square } else { 1.0 }
                        }
                        Weighting::Uniform => 1.0,
                    };
                    self.diagonal[(j * n + i) * lines + k] = 1.0 / variance;
                }
            }
        }
    }

    fn weigh_by_covariance(&mut self) {
        let (n, m, lines) = (self.n_y, self.n_u, self.len());
        let pairs: Vec<(usize, usize)> = (0..n * m).flat_map(|d| (0..d).map(move |c| (c, d))).collect();
        let mut coupling = Columns::zeros(lines, pairs.len());
        let mut work = vec![ZERO; 2 * n.max(m) * n.max(m)];
        let (mut inverse, mut inverse_s) = (vec![ZERO; n * n], vec![ZERO; m * m]);
        for k in 0..lines {
            let (c_v, s) = (
                &self.c_v[k * n * n..(k + 1) * n * n],
                &self.s[k * m * m..(k + 1) * m * m],
            );
            let whole = inverse_or_diagonal(n, c_v, &mut work, &mut inverse);
            let whole_s = inverse_or_diagonal(m, s, &mut work, &mut inverse_s);
            self.diagonal_fallbacks += usize::from(!(whole && whole_s));
            let entry =
                |c: usize, d: usize| inverse_s[(d / n) * m + c / n].conj() * inverse[(d % n) * n + c % n];
            for c in 0..n * m {
                self.diagonal[c * lines + k] = entry(c, c).re;
            }
            for (s, &(c, d)) in pairs.iter().enumerate() {
                coupling.set(k, s, entry(c, d));
            }
        }
        let together = |s: &usize| coupling.whole(*s).iter().any(|v| *v != 0.0);
        let kept: Vec<usize> = (0..pairs.len()).filter(together).collect();
        self.coupled = kept.iter().map(|&s| pairs[s]).collect();
        self.coupling = if kept.len() == pairs.len() {
            coupling
        } else {
            let parts = kept.iter().flat_map(|&s| coupling.whole(s)).copied().collect();
            Columns::from_parts(lines, parts)
        };
    }

    /// Diagonal of the weight on all lines, channel after channel.
    pub(crate) fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    /// The entry of a channel on a line.
    pub(crate) fn weight(&self, line: usize, channel: usize) -> f64 {
        self.diagonal[channel * self.len() + line]
    }

    /// The weights and the weighted response must be finite numbers with room for a square.
    fn check_range(&self, index: &[usize]) -> Result<(), PoleFitError> {
        let limit = f64::MAX.powf(0.4);
        let good = |v: f64| v > 1.0 / limit && v < limit;
        for k in 0..self.len() {
            let of = |c: usize| (self.weight(k, c), self.f.at(k, c).norm_sqr());
            let channels = (0..self.channels()).map(of);
            let square: f64 = channels.clone().map(|(w, v)| w * v).sum();
            if !(channels.clone().all(|(w, _)| good(w)) && square < limit) {
                return Err(PoleFitError::Overflow {
                    what: "the weight of the response",
                    line: index[k],
                    frequency_hz: self.frequencies_hz[k],
                });
            }
        }
        Ok(())
    }

    fn summarise(&mut self) {
        let (lines, channels) = (self.len() as f64, self.channels() as f64);
        let mut profile = vec![0.0; self.len()];
        for diagonal in self.diagonal.chunks_exact(self.len()) {
            let mean = diagonal.iter().sum::<f64>() / lines;
            for (p, d) in profile.iter_mut().zip(diagonal) {
                *p += d / (mean * channels);
            }
        }
        self.profile = profile;
    }

    /// `K x` on all lines, a column a channel.
    pub(crate) fn weighted(&self, x: &Columns, out: &mut Columns) {
        for block in blocks(self.len()) {
            for c in 0..self.channels() {
                let weight = &self.diagonal[c * self.len()..][block.clone()];
                let ((re, im), (to_re, to_im)) = (x.part(c, &block), out.part_mut(c, &block));
                real_product(weight, re, to_re);
                real_product(weight, im, to_im);
            }
            for (pair, &(c, d)) in self.coupled.iter().enumerate() {
                let w = self.coupling.part(pair, &block);
                add_product(w, x.part(d, &block), out.part_mut(c, &block));
                add_conjugate_product(w, x.part(c, &block), out.part_mut(d, &block));
            }
        }
    }

    /// `C_V` and `S` of line `k`, column-major.
    pub(crate) fn factors(&self, k: usize) -> (&[C64], &[C64]) {
        let (n, m) = (self.n_y, self.n_u);
        (
            &self.c_v[k * n * n..(k + 1) * n * n],
            &self.s[k * m * m..(k + 1) * m * m],
        )
    }

    /// The covariance `S^T (x) C_V` of line `k`, column-major.
    pub(crate) fn covariance(&self, k: usize, sigma: &mut [C64]) {
        let (n, m, n_c) = (self.n_y, self.n_u, self.channels());
        let c_v = &self.c_v[k * n * n..(k + 1) * n * n];
        let s = &self.s[k * m * m..(k + 1) * m * m];
        for l in 0..m {
            for j in 0..m {
                for r in 0..n {
                    for i in 0..n {
                        sigma[(l * n + r) * n_c + j * n + i] = c_v[r * n + i] * s[j * m + l];
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
