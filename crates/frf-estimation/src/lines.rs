//! The estimate line by line, as many lines at a time as a register has lanes.

use crate::averages::Averages;
use crate::averages::Layout;
use crate::gain::{GainKernel, residual_covariance, response};
use crate::lanes::{ComplexLanes, Lanes, WIDEST, write_lines};
use crate::realisations::Residuals;
use crate::{FrfError, Instrument};
use num_complex::Complex;
use pulp::{Simd, WithSimd};

type C64 = Complex<f64>;
const ZERO: C64 = C64::new(0.0, 0.0);

/// Averages of some lines, column-major: `Y` (`n_y x n_e`), `U` (`n_u x n_e`), `R` (`n_r x n_e`) and the scatter of outputs and
/// inputs, summed over experiments.
pub(crate) struct LineScratch<S: Simd> {
    pub(crate) y: Vec<ComplexLanes<S>>,
    pub(crate) u: Vec<ComplexLanes<S>>,
    pub(crate) r: Vec<ComplexLanes<S>>,
    pub(crate) scatter: Vec<ComplexLanes<S>>,
}

impl<S: Simd> LineScratch<S> {
    pub(crate) fn new(simd: S, layout: &Layout) -> Self {
        let nz = layout.outputs + layout.inputs;
        let of = |numbers: usize| vec![ComplexLanes::zero(simd); numbers];
        Self {
            y: of(layout.outputs * layout.experiments),
            u: of(layout.inputs * layout.experiments),
            r: of(layout.references * layout.experiments),
            scatter: of(nz * nz),
        }
    }
}

impl Averages<'_> {
    /// Spectra and pooled scatter of some lines, at most as many as there are lanes; the last one has the lanes that are left.
    #[inline(always)]
    pub(crate) fn gather<S: Simd>(&self, simd: S, lines: &[usize], scratch: &mut LineScratch<S>) {
        let (ny, nu, nr) = (self.layout.outputs, self.layout.inputs, self.layout.references);
        let places = self.order.places(lines);
        self.scatter.gather(simd, &places, &mut scratch.scatter);
        for (e, data) in self.experiments.iter().enumerate() {
            data.signals
                .gather(simd, 0..ny, &places, &mut scratch.y[e * ny..]);
            data.signals
                .gather(simd, ny..ny + nu, &places, &mut scratch.u[e * nu..]);
            data.reference
                .gather(simd, 0..nr, &places, &mut scratch.r[e * nr..]);
        }
    }
}

/// What is estimated at each line, line after line, matrices column-major.
pub(crate) struct LineEstimates {
    /// Equation (15) where references are the instruments, else (14).
    pub(crate) values: Vec<C64>,
    /// Equation (14).
    pub(crate) direct: Vec<C64>,
    /// Covariance of the averaged outputs about `F U`.
    pub(crate) c_v: Vec<C64>,
    /// `G^H G`, weighted by the periods of the experiments.
    pub(crate) s: Vec<C64>,
    /// Condition numbers.
    pub(crate) conditions: Vec<f64>,
}

/// The work of all lines, in the registers of one kind of machine.
pub(crate) struct EachLine<'a> {
    pub(crate) averages: &'a Averages<'a>,
    pub(crate) lines: &'a [usize],
    pub(crate) instrument: Instrument,
    /// Where realisations are to be compared.
    pub(crate) residuals: Option<&'a mut Residuals>,
}

impl EachLine<'_> {
    /// Error for the first line that cannot be inverted, by the condition numbers of the plain equation and of that with instruments.
    fn check(&self, lines: &[usize], plain: &[f64], conditions: &[f64]) -> Result<(), FrfError> {
        for ((&line, plain), condition) in lines.iter().zip(plain).zip(conditions) {
            let condition = if plain.is_infinite() { *plain } else { *condition };
            if condition.is_infinite() || condition > self.averages.settings.max_condition {
                return Err(FrfError::Singular {
                    line,
                    frequency_hz: self.averages.layout.frequency_hz(line),
                    condition,
                });
            }
        }
        Ok(())
    }
}

impl WithSimd for EachLine<'_> {
    type Output = Result<LineEstimates, FrfError>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> Self::Output {
        let averages = self.averages;
        let Layout {
            outputs: ny,
            inputs: nu,
            experiments: ne,
            ..
        } = averages.layout;
        let weights = averages.weights();
        let mut shares = Vec::with_capacity(ne);
        for share in &weights.experiment {
            shares.push(Lanes::splat(simd, *share));
        }
        let with_references = self.instrument == Instrument::References;
        // With as many experiments as inputs the instruments cancel.
        let differ = with_references && ne > nu;
        let of = |numbers: usize| vec![ZERO; self.lines.len() * numbers];
        let mut found = LineEstimates {
            values: of(ny * nu),
            direct: if differ { of(ny * nu) } else { Vec::new() },
            c_v: of(ny * ny),
            s: of(nu * nu),
            conditions: Vec::with_capacity(self.lines.len()),
        };
        let mut kernel = GainKernel::new(simd, nu, ne);
        let mut scratch = LineScratch::new(simd, &averages.layout);
        let mut f = vec![ComplexLanes::zero(simd); ny * nu];
        let mut c = vec![ComplexLanes::zero(simd); ny * ny];
        let mut s = vec![ComplexLanes::zero(simd); nu * nu];
        for (chunk, lines) in self.lines.chunks(S::F64_LANES).enumerate() {
            let own = |numbers: usize| {
                let first = chunk * S::F64_LANES * numbers;
                first..first + lines.len() * numbers
            };
            averages.gather(simd, lines, &mut scratch);
            let mut plain = [1.0; WIDEST];
            if differ {
                plain = kernel.compute(&scratch.u, None);
                response(simd, &scratch.y, kernel.gain(), ny, ne, &mut f);
                write_lines(&f, &mut found.direct[own(ny * nu)]);
            }
            let conditions = kernel.compute(&scratch.u, with_references.then_some(scratch.r.as_slice()));
            self.check(lines, &plain, &conditions)?;
            found.conditions.extend_from_slice(&conditions[..lines.len()]);
            let g = kernel.gain();
            response(simd, &scratch.y, g, ny, ne, &mut f);
            let scale = weights.covariance_scale;
            residual_covariance(simd, &scratch.scatter, &f, ny, nu, scale, &mut c);
            for j in 0..nu {
                for i in 0..nu {
                    let mut sum = ComplexLanes::zero(simd);
                    for e in 0..ne {
                        sum += g[i * ne + e].conj() * g[j * ne + e] * shares[e];
                    }
                    s[j * nu + i] = sum;
                }
            }
            write_lines(&f, &mut found.values[own(ny * nu)]);
            write_lines(&c, &mut found.c_v[own(ny * ny)]);
            write_lines(&s, &mut found.s[own(nu * nu)]);
            if let Some(residuals) = &mut self.residuals {
                let by_line = |numbers: &[ComplexLanes<S>]| {
                    let mut all = vec![ZERO; numbers.len() * lines.len()];
                    write_lines(numbers, &mut all);
                    all
                };
                let (y, u, g) = (by_line(&scratch.y), by_line(&scratch.u), by_line(g));
                let lines = y.chunks_exact(ny * ne).zip(u.chunks_exact(nu * ne));
                let lines = lines.zip(g.chunks_exact(ne * nu));
                let fits = found.values[own(ny * nu)].chunks_exact(ny * nu);
                let fits = fits.zip(found.c_v[own(ny * ny)].chunks_exact(ny * ny));
                for (((y, u), g), (f, c)) in lines.zip(fits) {
                    residuals.push([y, u], f, g, c);
                }
            }
        }
        if !differ {
            found.direct = found.values.clone();
        }
        Ok(found)
    }
}
