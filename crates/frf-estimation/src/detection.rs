//! Fast method: what appears at lines where nothing was put in.

use crate::averages::Averages;
use crate::gain::residual_covariance;
use crate::lanes::ComplexLanes;
use crate::lines::LineScratch;
use lpv_core::Frf;
use pulp::Scalar;

/// Levels at detection lines: lines between the lowest and the highest excited one that carry no excitation.
///
/// In closed loop a distortion of the output comes back through the controller as input at the same line. The level is
/// therefore that of `Y - F U`, with `F` interpolated linearly between the excited neighbours. Levels are root mean squares
/// over experiments, in the unit of the output's amplitude spectrum; "by line" lists hold all outputs of a line together.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectionLines {
    /// The lines, in cycles a period; odd ones show odd, even ones even nonlinearities.
    pub lines: Vec<usize>,
    /// Level of `Y - F U`, noise included, by line, then by output.
    pub output_level: Vec<f64>,
    /// Noise in it: its standard deviation as it follows from the periods, by line, then by output.
    pub output_noise: Vec<f64>,
    /// Level of the input, noise included, by line, then by input.
    pub input_level: Vec<f64>,
    /// Distortion at odd detection lines by output, noise power subtracted, relative to the root mean square of the output
    /// at excited lines; none without such lines, zero if the noise explains all.
    pub odd_relative: Option<Vec<f64>>,
    /// The same at even lines.
    pub even_relative: Option<Vec<f64>>,
}

/// Levels at the quiet lines within the excited band; none if there are none.
pub(crate) fn detect(
    averages: &Averages<'_>,
    excited: &[usize],
    quiet: &[usize],
    frf: &Frf,
) -> Option<DetectionLines> {
    let (first, last) = (*excited.first()?, *excited.last()?);
    let lines: Vec<usize> = quiet
        .iter()
        .copied()
        .filter(|k| (first..last).contains(k))
        .collect();
    if lines.is_empty() {
        return None;
    }
    let (ny, nu) = (averages.layout.outputs, averages.layout.inputs);
    let ne = averages.experiments.len() as f64;
    let simd = Scalar::new();
    let scale = averages.weights().covariance_scale;
    let mut scratch = LineScratch::new(simd, &averages.layout);
    let mut f = vec![ComplexLanes::zero(simd); ny * nu];
    let mut c = vec![ComplexLanes::zero(simd); ny * ny];
    let (mut output_level, mut output_noise, mut input_level) = (Vec::new(), Vec::new(), Vec::new());
    // Excess power and number of lines, even and odd.
    let mut excess = [vec![0.0; ny], vec![0.0; ny]];
    let mut count = [0usize; 2];
    for &k in &lines {
        let above = excited.partition_point(|&l| l < k);
        let (low, high) = (excited[above - 1], excited[above]);
        let t = (k - low) as f64 / (high - low) as f64;
        for (f, (a, b)) in f
            .iter_mut()
            .zip(frf.line_slice(above - 1).iter().zip(frf.line_slice(above)))
        {
            *f = ComplexLanes::one(a * (1.0 - t) + b * t);
        }
        averages.gather(simd, &[k], &mut scratch);
        residual_covariance(simd, &scratch.scatter, &f, ny, nu, scale, &mut c);
        count[k % 2] += 1;
        for i in 0..ny {
            let residual = |(y, u): (&[ComplexLanes<_>], &[ComplexLanes<_>])| {
                let rest = (0..nu).fold(y[i], |rest, j| rest - f[j * ny + i] * u[j]);
                rest.value().norm_sqr()
            };
            let pairs = scratch.y.chunks_exact(ny).zip(scratch.u.chunks_exact(nu));
            let power = pairs.map(residual).sum::<f64>() / ne;
            let noise = c[i * ny + i].value().re;
            output_level.push(power.sqrt());
            output_noise.push(noise.sqrt());
            excess[k % 2][i] += power - noise;
        }
        for j in 0..nu {
            let power = scratch.u.iter().skip(j).step_by(nu).map(|u| u.value().norm_sqr());
            input_level.push((power.sum::<f64>() / ne).sqrt());
        }
    }
    let mut signal = vec![0.0; ny];
    for &k in excited {
        let l = averages.order.place(k);
        for (i, s) in signal.iter_mut().enumerate() {
            let power = averages.experiments.iter().map(|e| e.signals.at(i, l).norm_sqr());
            *s += power.sum::<f64>() / (ne * excited.len() as f64);
        }
    }
    let relative = |parity: usize| {
        let level = |(e, s): (&f64, &f64)| {
            let power = (e / count[parity] as f64).max(0.0);
            if power == 0.0 { 0.0 } else { (power / s).sqrt() }
        };
        (count[parity] > 0).then(|| excess[parity].iter().zip(&signal).map(level).collect())
    };
    Some(DetectionLines {
        odd_relative: relative(1),
        even_relative: relative(0),
        lines,
        output_level,
        output_noise,
        input_level,
    })
}
