//! Sections side by side, in coordinates that go along when poles move.
//!
//! Every section is driven by one input and has the denominator `(z-1)^2 + d1 (z-1) + d0` with the states
//! `u / den` and `(z-1) u / den`. For a pair of poles `l, l*` these are `d1 = 2 Re(1 - l)` and `d0 = |1 - l|^2`: smooth
//! functions of the pair, also where it becomes two real poles; and so are the weights of the states, since both residues
//! are divided by the same distance of the poles. Fixed integrators are a chain of `(z-1)^-k`.

use crate::PoleFit;
use lpv_core::{CoreError, Discrete, StateSpace};
use nalgebra::{DMatrix, dmatrix};
use num_complex::Complex;

type C64 = Complex<f64>;
const ONE: C64 = C64::new(1.0, 0.0);

/// Points around `z = 1` at which what the sections leave is read lie this far from it: outside of all that is stable.
const RADIUS: f64 = 3.0;

/// One or two poles with what they do to each channel.
struct Section {
    /// `(z-1)`-companion, one or two rows.
    a: DMatrix<f64>,
    /// Weights of the states, one row a channel.
    weights: DMatrix<f64>,
    poles: Vec<(C64, Vec<C64>)>,
}

impl Section {
    fn new(poles: Vec<(C64, Vec<C64>)>) -> Self {
        let channels = poles[0].1.len();
        let gap = |i: usize| ONE - poles[i].0;
        let (a, weights) = if poles.len() == 1 {
            let weights = DMatrix::from_fn(channels, 1, |c, _| poles[0].1[c].re);
            (dmatrix![-gap(0).re], weights)
        } else {
            // r / (x + g) + s / (x + h) with x = z - 1: (r + s) x + r h + s g over x^2 + (g + h) x + g h.
            let (g, h) = (gap(0), gap(1));
            let weights = DMatrix::from_fn(channels, 2, |c, state| {
                let (r, s) = (poles[0].1[c], poles[1].1[c]);
                if state == 0 { r * h + s * g } else { r + s }.re
            });
            (dmatrix![0.0, 1.0; -(g * h).re, -(g + h).re], weights)
        };
        Self { a, weights, poles }
    }

    fn response(&self, z: C64, channel: usize) -> C64 {
        self.poles.iter().map(|(pole, r)| r[channel] / (z - pole)).sum()
    }
}

impl PoleFit {
    /// The fitted model as sections side by side, one copy an input: `order * n_u` states. The fixed integrators come
    /// first, then pairs: complex ones, and real poles two by two as they follow each other, last a real pole that is left
    /// over. The delay of the settings is not part of it.
    ///
    /// Its matrices vary smoothly with the poles as long as these keep their order and each stays real or complex, and
    /// where a pair with an even number of real poles before it becomes real: then models of several positions can be
    /// interpolated entry by entry. Where coordinates do not matter, [`PoleFit::state_space`] is better conditioned.
    ///
    /// # Errors
    /// [`CoreError::NotFinite`] where two poles are equal: their residues do not exist.
    pub fn parallel_form(&self) -> Result<StateSpace<Discrete>, CoreError> {
        let (n_y, n_u) = self.channels;
        let m = self.fixed_integrators;
        let sections = self.sections();
        // What is left is sum_k c_k (z-1)^-k with the direct term c_0: its Fourier series on a circle.
        let points: Vec<C64> = (0..=m)
            .map(|i| C64::from_polar(RADIUS, std::f64::consts::TAU * i as f64 / (m + 1) as f64))
            .collect();
        let left: Vec<Vec<C64>> = points
            .iter()
            .map(|x| {
                let mut all = vec![C64::from(0.0); n_y * n_u];
                self.set_values(x + 1.0, &mut Vec::new(), &mut all);
                let by = |(channel, g): (usize, C64)| {
                    g - sections.iter().map(|s| s.response(x + 1.0, channel)).sum::<C64>()
                };
                all.into_iter().enumerate().map(by).collect()
            })
            .collect();
        let coefficient = |channel: usize, k: usize| -> f64 {
            let terms = points
                .iter()
                .zip(&left)
                .map(|(x, g)| g[channel] * x.powu(k as u32));
            (terms.sum::<C64>() / (m + 1) as f64).re
        };

        let n = self.poles.len();
        let mut a = DMatrix::identity(n * n_u, n * n_u);
        let mut b = DMatrix::zeros(n * n_u, n_u);
        let mut c = DMatrix::zeros(n_y, n * n_u);
        let mut d = DMatrix::zeros(n_y, n_u);
        for input in 0..n_u {
            let first = n * input;
            // Integrators: the last of the chain is driven.
            for k in 0..m {
                if k + 1 < m {
                    a[(first + k, first + k + 1)] += 1.0;
                } else {
                    b[(first + k, input)] = 1.0;
                }
                for output in 0..n_y {
                    c[(output, first + k)] = coefficient(n_y * input + output, m - k);
                }
            }
            // What is strictly proper has no direct term, not even of rounding.
            for output in (0..n_y).filter(|_| self.beta.nrows() > n) {
                d[(output, input)] = coefficient(n_y * input + output, 0);
            }
            let mut at = first + m;
            for section in &sections {
                let size = section.a.nrows();
                let mut block = a.view_mut((at, at), (size, size));
                block += &section.a;
                b[(at + size - 1, input)] = 1.0;
                c.view_mut((0, at), (n_y, size))
                    .copy_from(&section.weights.rows(n_y * input, n_y));
                at += size;
            }
        }
        StateSpace::new(a, b, c, d, self.clock)
    }

    /// Pairs of complex poles, and of real ones as they follow each other.
    fn sections(&self) -> Vec<Section> {
        let mut sections = Vec::new();
        let mut alone = None;
        for pole in &self.poles[self.fixed_integrators..] {
            let with = |pole: C64| (pole, self.residues(pole));
            if pole.im > 0.0 {
                sections.push(Section::new(vec![with(*pole), with(pole.conj())]));
            } else if pole.im == 0.0 {
                match alone.take() {
                    Some(other) => sections.push(Section::new(vec![with(other), with(*pole)])),
                    None => alone = Some(*pole),
                }
            }
        }
        sections.extend(alone.map(|pole| Section::new(vec![(pole, self.residues(pole))])));
        sections
    }

    /// `B / ((z-1)^m a')` at a simple root of the denominator, a value a channel. The slope is that of the product of the
    /// roots: what rounding adds to a distance then cancels between the two poles of a section.
    fn residues(&self, pole: C64) -> Vec<C64> {
        let n = self.alpha.len() - 1;
        let below: f64 = (0..n).map(|j| self.recurrence.h[(j + 1, j)]).product();
        let leading = self.alpha[n] * self.recurrence.constant / below;
        let flexible = self.poles[self.fixed_integrators..].iter();
        let others: Vec<&C64> = flexible.filter(|other| **other != pole).collect();
        // A double pole has fewer others, and no slope.
        let leading = if others.len() + 1 == n { leading } else { 0.0 };
        let slope = others
            .iter()
            .fold(C64::from(leading), |product, other| product * (pole - *other));
        let factor = (slope * (pole - 1.0).powu(self.fixed_integrators as u32)).inv();
        self.numerators(pole).into_iter().map(|b| b * factor).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::{Integrators, NumeratorDegree, PoleFitSettings, fit};
    use lpv_core::{Discrete, Frf, FrfEstimate};
    use num_complex::Complex;
    use proptest::prelude::*;

    type C64 = Complex<f64>;

    /// Two channels by two with these poles, and as many integrators.
    fn response(poles: &[C64], integrators: usize, z: C64) -> [C64; 4] {
        let rigid: C64 = (1..=integrators as i32).map(|k| 0.01 * (z - 1.0).powi(-k)).sum();
        [0, 1, 2, 3].map(|channel| {
            let flexible = poles.iter().enumerate().map(|(i, pole)| {
                let weight = 1.0 + ((3 * i + 5 * channel) as f64).sin();
                let (r, conjugate) = (C64::new(weight, 0.3), pole.conj());
                if pole.im > 0.0 {
                    r / (z - pole) + r.conj() / (z - conjugate)
                } else {
                    r.re / (z - pole)
                }
            });
            0.05 + rigid * (1.0 + channel as f64) + flexible.sum::<C64>()
        })
    }

    fn fitted(poles: &[C64], integrators: usize) -> (crate::PoleFit, Vec<f64>) {
        let clock = Discrete::from_rate(1.0).unwrap();
        let lines: Vec<f64> = (1..200).map(|k| 0.0025 * f64::from(k)).collect();
        let point = |f: &f64| C64::from_polar(1.0, std::f64::consts::TAU * f);
        let values = lines.iter().flat_map(|f| response(poles, integrators, point(f)));
        let frf = Frf::new(lines.clone(), 2, 2, values.collect()).unwrap();
        let order: usize = poles.iter().map(|p| 1 + usize::from(p.im > 0.0)).sum();
        let settings = PoleFitSettings {
            integrators: Integrators::Fixed(integrators),
            numerator: NumeratorDegree::Proper,
            ..PoleFitSettings::new(order + integrators)
        };
        let estimate = FrfEstimate::with_unit_covariance(frf, None).unwrap();
        (fit(&estimate, clock, &settings).unwrap(), lines)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn sections_have_the_response_of_the_fit(
            radius in 0.9..0.999f64,
            angle in 0.3..1.0f64,
            gap in 0.2..1.2f64,
            real in prop::collection::vec(-0.6..0.6f64, 0..4),
            integrators in 0usize..4,
        ) {
            let mut poles = vec![C64::from_polar(radius, angle), C64::from_polar(0.97, angle + gap)];
            for (i, x) in real.iter().enumerate() {
                poles.push(C64::new(0.2 * i as f64 + 0.1 * x, 0.0));
            }
            let (found, lines) = fitted(&poles, integrators);
            let exact = found.response(&lines).unwrap();
            let form = found.parallel_form().unwrap();
            prop_assert_eq!(form.states(), 2 * (4 + real.len() + integrators));
            let own = form.frequency_response(&lines).unwrap();
            for k in 0..lines.len() {
                let (a, b) = (exact.line(k), own.line(k));
                let (error, size) = ((a - b).norm(), a.norm());
                prop_assert!(error < 1e-8 * size, "line {k}: {error:e} of {size:e}");
            }
        }
    }

    /// A single section by hand: residues r, r* of poles l, l* with `x = z - 1`.
    #[test]
    fn a_pair_by_hand() {
        let pole = C64::from_polar(0.9, 0.5);
        let (found, _) = fitted(&[pole], 0);
        let form = found.parallel_form().unwrap();
        let gap = 1.0 - pole;
        let a = form.a();
        assert!((a[(1, 0)] + gap.norm_sqr()).abs() < 1e-12);
        assert!((a[(1, 1)] - (1.0 - 2.0 * gap.re)).abs() < 1e-12);
        assert_eq!((a[(0, 0)], a[(0, 1)]), (1.0, 1.0));
        // Channel (0, 0): r = 1 + 0.3 j, numerator 2 Re(r) x + 2 Re(r (1 - l*)), direct term 0.05.
        let r = C64::new(1.0, 0.3);
        assert!((form.c()[(0, 1)] - 2.0).abs() < 1e-10);
        assert!((form.c()[(0, 0)] - 2.0 * (r * gap.conj()).re).abs() < 1e-10);
        assert!((form.d()[(0, 0)] - 0.05).abs() < 1e-10);
    }

    /// Also where two poles nearly coincide, with a direct term or without.
    #[test]
    fn nearly_double_poles_keep_the_response() {
        for square in [1e-4, 1e-6, 1e-8, 1e-10, 1e-12, -1e-8, -1e-12_f64] {
            let root = C64::new(square, 0.0).sqrt();
            let mut poles = vec![C64::from_polar(0.97, 0.9), 0.7 + root];
            if square > 0.0 {
                poles.push(0.7 - root);
            }
            let (found, lines) = fitted(&poles, 0);
            let form = found.parallel_form().unwrap().frequency_response(&lines).unwrap();
            let exact = found.response(&lines).unwrap();
            for k in 0..lines.len() {
                let (error, size) = ((form.line(k) - exact.line(k)).norm(), exact.line(k).norm());
                assert!(error < 1e-8 * size, "{square:e}, line {k}: {error:e} of {size:e}");
            }
        }
    }

    /// A pair becomes two real poles: the matrices stay close to each other.
    #[test]
    fn matrices_go_along_where_a_pair_becomes_real() {
        let of = |square: f64| {
            let root = C64::new(square, 0.0).sqrt();
            let poles = if square < 0.0 {
                vec![0.7 + root]
            } else {
                vec![0.7 + root, 0.7 - root]
            };
            fitted(&poles, 0).0.parallel_form().unwrap().a().clone()
        };
        let step = (of(-1e-4) - of(1e-4)).norm();
        // The product of the poles moves by 2e-4, in two copies; the sum not at all.
        assert!((step - 2e-4 * 2f64.sqrt()).abs() < 1e-8, "{step:e}");
    }
}
