//! SISO controllers by rule from a bandwidth, and their digital form.

use crate::PlantError;
use crate::error::positive;
use lpv_core::linalg::eigenvalues;
use lpv_core::{Continuous, Discrete, StateSpace};
use nalgebra::{DMatrix, dmatrix};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// How a continuous controller becomes a digital one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Discretisation {
    /// Exact response to a held error signal. The default: it keeps a gain at the Nyquist frequency, so that the lines
    /// near it are excited.
    #[default]
    ZeroOrderHold,
    /// The bilinear map. It turns every zero at infinity into one at z = -1, so the controller, and with it the plant
    /// input, vanishes at the Nyquist frequency: the FRF cannot be estimated there.
    Tustin,
}

/// Lead-lag-integrator with second-order roll-off, for the plant `1/s²`; unchecked, checked by
/// [`ControllerSettings::design`].
///
/// `K(s) = g (s + w_b/a_i) / s · (1 + s a_z / w_b) / (1 + s / (a_p w_b)) · w_r² / (s² + 2 zeta w_r s + w_r²)`,
/// `w_b = 2 pi bandwidth`, `w_r = a_r w_b`, and g such that `|K(j w_b) / (j w_b)²| = 1`.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `bandwidth_hz` | 0.2 | frequency of loop gain 1, Hz | > 0 |
/// | `integrator_ratio` a_i | 8 | integrator ends this factor below the bandwidth | > 0 |
/// | `lead_zero_ratio` a_z | 3 | lead begins this factor below the bandwidth | > 0 |
/// | `lead_pole_ratio` a_p | 3 | lead ends this factor above the bandwidth | > 0 |
/// | `rolloff_ratio` a_r | 6 | roll-off begins this factor above the bandwidth | > 0 |
/// | `rolloff_damping` zeta | 0.7 | damping ratio of the roll-off | > 0 |
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ControllerSettings {
    /// Frequency at which the loop gain is 1.
    pub bandwidth_hz: f64,
    /// Bandwidth over the integrator's corner.
    pub integrator_ratio: f64,
    /// Bandwidth over the lead's zero.
    pub lead_zero_ratio: f64,
    /// Lead's pole over the bandwidth.
    pub lead_pole_ratio: f64,
    /// Roll-off frequency over the bandwidth.
    pub rolloff_ratio: f64,
    /// Damping ratio of the roll-off.
    pub rolloff_damping: f64,
}

impl Default for ControllerSettings {
    fn default() -> Self {
        Self {
            bandwidth_hz: 0.2,
            integrator_ratio: 8.0,
            lead_zero_ratio: 3.0,
            lead_pole_ratio: 3.0,
            rolloff_ratio: 6.0,
            rolloff_damping: 0.7,
        }
    }
}

impl ControllerSettings {
    /// The continuous controller: SISO, four states, strictly proper.
    ///
    /// # Errors
    /// [`PlantError::Setting`] for a field that is not a finite number above zero; [`PlantError::Core`] on overflow.
    pub fn design(&self) -> Result<StateSpace<Continuous>, PlantError> {
        for (field, value) in [
            ("bandwidth_hz", self.bandwidth_hz),
            ("integrator_ratio", self.integrator_ratio),
            ("lead_zero_ratio", self.lead_zero_ratio),
            ("lead_pole_ratio", self.lead_pole_ratio),
            ("rolloff_ratio", self.rolloff_ratio),
            ("rolloff_damping", self.rolloff_damping),
        ] {
            positive(field, value)?;
        }
        let w_b = TAU * self.bandwidth_hz;
        let (w_i, w_z) = (w_b / self.integrator_ratio, w_b / self.lead_zero_ratio);
        let (w_p, w_r) = (w_b * self.lead_pole_ratio, w_b * self.rolloff_ratio);
        let section = |a, b, c, d| StateSpace::new(a, b, c, d, Continuous);
        // Series sections keep every number of the order of a frequency; a companion form would raise them to powers.
        let integrator = section(dmatrix![0.0], dmatrix![w_i], dmatrix![1.0], dmatrix![1.0])?;
        // (1 + s/w_z) / (1 + s/w_p) = w_p/w_z + (1 - w_p/w_z) w_p / (s + w_p)
        let ratio = w_p / w_z;
        let lead = section(
            dmatrix![-w_p],
            dmatrix![w_p],
            dmatrix![1.0 - ratio],
            dmatrix![ratio],
        )?;
        let rolloff = section(
            dmatrix![0.0, w_r; -w_r, -2.0 * self.rolloff_damping * w_r],
            dmatrix![0.0; w_r],
            dmatrix![1.0, 0.0],
            dmatrix![0.0],
        )?;
        let shape = integrator.then(&lead)?.then(&rolloff)?;
        let gain = w_b * w_b / shape.frequency_response(&[self.bandwidth_hz])?.line(0)[(0, 0)].norm();
        Ok(StateSpace::new(
            shape.a().clone(),
            shape.b() * gain,
            shape.c().clone(),
            shape.d() * gain,
            Continuous,
        )?)
    }
}

/// The controller of the default rule for a bandwidth in Hz and the plant `1/s²`.
///
/// # Errors
/// As [`ControllerSettings::design`].
pub fn design_controller(bandwidth_hz: f64) -> Result<StateSpace<Continuous>, PlantError> {
    ControllerSettings {
        bandwidth_hz,
        ..ControllerSettings::default()
    }
    .design()
}

/// A SISO controller as difference equation: `u = B(z^-1) / A(z^-1) e`.
#[derive(Debug, Clone, PartialEq)]
pub struct DigitalController {
    numerator: Vec<f64>,
    denominator: Vec<f64>,
}

impl DigitalController {
    /// From a SISO system: A from its poles, B from A and the first values of the pulse response.
    ///
    /// # Errors
    /// [`PlantError::Length`] if the system is not SISO; [`PlantError::Core`].
    pub fn from_state_space(system: &StateSpace<Discrete>) -> Result<Self, PlantError> {
        for (what, found) in [
            ("inputs of a SISO controller", system.inputs()),
            ("outputs of a SISO controller", system.outputs()),
        ] {
            if found != 1 {
                return Err(PlantError::Length {
                    what,
                    expected: 1,
                    found,
                });
            }
        }
        let mut a = vec![num_complex::Complex::new(1.0, 0.0)];
        for pole in eigenvalues(system.a())? {
            a.push(num_complex::Complex::new(0.0, 0.0));
            for i in (1..a.len()).rev() {
                let previous = a[i - 1];
                a[i] -= pole * previous;
            }
        }
        let denominator: Vec<f64> = a.iter().map(|c| c.re).collect();
        let mut pulse = vec![system.d()[(0, 0)]];
        let mut x = system.b().clone();
        for _ in 0..system.states() {
            pulse.push((system.c() * &x)[(0, 0)]);
            x = system.a() * x;
        }
        let numerator: Vec<f64> = (0..pulse.len())
            .map(|i| (0..=i).map(|j| denominator[j] * pulse[i - j]).sum())
            .collect();
        crate::error::finite("digital controller: numerator", &numerator)?;
        crate::error::finite("digital controller: denominator", &denominator)?;
        Ok(Self {
            numerator,
            denominator,
        })
    }

    /// Coefficients of `z^0, z^-1, ...` of B.
    pub fn numerator(&self) -> &[f64] {
        &self.numerator
    }
    /// Coefficients of `z^0, z^-1, ...` of A; the first is 1.
    pub fn denominator(&self) -> &[f64] {
        &self.denominator
    }
    /// The difference equation as state space, in observer form.
    ///
    /// # Errors
    /// None beyond those of [`StateSpace::new`].
    pub fn state_space(&self, clock: Discrete) -> Result<StateSpace<Discrete>, PlantError> {
        let n = self.order();
        let direct = self.numerator[0];
        let a = DMatrix::from_fn(n, n, |i, j| match j {
            0 => -self.denominator[i + 1],
            _ => f64::from(u8::from(i + 1 == j)),
        });
        let b = DMatrix::from_fn(n, 1, |i, _| {
            self.numerator[i + 1] - self.denominator[i + 1] * direct
        });
        let c = DMatrix::from_fn(1, n, |_, j| f64::from(u8::from(j == 0)));
        Ok(StateSpace::new(a, b, c, dmatrix![direct], clock)?)
    }
    /// Order of A.
    pub fn order(&self) -> usize {
        self.denominator.len() - 1
    }
}

/// The digital form of a continuous controller.
///
/// # Errors
/// [`PlantError::Core`] on overflow, or where Tustin's map does not exist.
pub fn discretise(
    controller: &StateSpace<Continuous>,
    clock: Discrete,
    how: Discretisation,
) -> Result<StateSpace<Discrete>, PlantError> {
    Ok(match how {
        Discretisation::ZeroOrderHold => controller.zero_order_hold(clock)?,
        Discretisation::Tustin => controller.tustin(clock)?,
    })
}

/// Both loops side by side, `diag(K_1, K_2)`.
pub(crate) fn diagonal<K: lpv_core::Clock>(pair: &[StateSpace<K>; 2]) -> Result<StateSpace<K>, PlantError> {
    Ok(pair[0].beside(&pair[1])?)
}

/// Closed loop matrix of a plant without feed-through and a controller under negative feedback.
pub(crate) fn closed_loop_matrix<K: lpv_core::Clock>(
    plant: &StateSpace<K>,
    controller: &StateSpace<K>,
) -> Result<DMatrix<f64>, PlantError> {
    let a = plant.a() - plant.b() * controller.d() * plant.c();
    Ok(lpv_core::linalg::from_blocks(&[
        &[&a, &(plant.b() * controller.c())],
        &[&(-controller.b() * plant.c()), controller.a()],
    ])?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex;

    #[test]
    fn loop_gain_is_one_at_the_bandwidth() {
        let k = design_controller(0.2).unwrap();
        let f = k.frequency_response(&[0.2]).unwrap().line(0)[(0, 0)];
        assert!((f.norm() / (TAU * 0.2).powi(2) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn difference_equation_has_the_response_of_the_state_space() {
        let clock = Discrete::from_rate(20.0).unwrap();
        for how in [Discretisation::ZeroOrderHold, Discretisation::Tustin] {
            let k = discretise(&design_controller(0.2).unwrap(), clock, how).unwrap();
            let d = DigitalController::from_state_space(&k).unwrap();
            assert_eq!(d.order(), 4);
            let at = |c: &[f64], z: Complex<f64>| {
                c.iter()
                    .enumerate()
                    .map(|(i, v)| z.powi(-(i as i32)) * v)
                    .sum::<Complex<f64>>()
            };
            let frequencies = [0.01, 0.2, 1.0, 5.0, 9.9];
            let frf = k.frequency_response(&frequencies).unwrap();
            for (i, f) in frequencies.iter().enumerate() {
                let z = Complex::from_polar(1.0, TAU * f / 20.0);
                let ours = at(d.numerator(), z) / at(d.denominator(), z);
                let truth = frf.line(i)[(0, 0)];
                assert!(
                    (ours - truth).norm() < 1e-9 * truth.norm(),
                    "{how:?} {f}: {ours} {truth}"
                );
            }
            let again = d
                .state_space(clock)
                .unwrap()
                .frequency_response(&frequencies)
                .unwrap();
            assert!(again.relative_error(&frf).unwrap().iter().all(|e| *e < 1e-9));
        }
    }

    #[test]
    fn only_tustin_is_silent_at_nyquist() {
        let clock = Discrete::from_rate(20.0).unwrap();
        let gain = |how| {
            let k = discretise(&design_controller(0.2).unwrap(), clock, how).unwrap();
            k.frequency_response(&[10.0]).unwrap().line(0)[(0, 0)].norm()
        };
        assert!(gain(Discretisation::Tustin) < 1e-12);
        assert!(gain(Discretisation::ZeroOrderHold) > 1e-2);
    }
}
