//! The machine's physical parameters, unchecked and checked.

use crate::PlantError;
use crate::error::positive;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Physical parameters of the xy-table, unchecked; [`MachineParameters::check`] gives a [`Machine`].
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `carriage_mass_kg` | 12 | m1 | > 0 |
/// | `beam_mass_kg` | 20 | m2 | > 0 |
/// | `carriage_inertia_kg_m2` | 0.25 | J1 | > 0 |
/// | `beam_inertia_kg_m2` | 1.2 | J2 | > 0 |
/// | `half_beam_m` | 0.5 | L, from the centre of the beam to a motor | > 0 |
/// | `stiffness_y_n_per_m` | 622.5... | k_y, from a mode of 1.45 Hz | > 0 |
/// | `stiffness_r_n_m_per_rad` | 32.67... | k_r, from a mode of 2.00 | > 0 |
/// | `damping_y_n_s_per_m` | 2.049... | d_y, damping ratio 0.015 | > 0 |
/// | `damping_r_n_m_s_per_rad` | 0.0780... | d_r, damping ratio 0.015 | > 0 |
/// | `servo_mass_kg` | 12 | mass that the motor of x1 moves | > 0 |
/// | `half_stroke_m` | 0.3 | the carriage stays within plus and minus this | > 0 |
///
/// Time is scaled as in the paper, so a "second" is one unit of that time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MachineParameters {
    /// Carriage mass m1.
    pub carriage_mass_kg: f64,
    /// Beam mass m2.
    pub beam_mass_kg: f64,
    /// Carriage inertia J1.
    pub carriage_inertia_kg_m2: f64,
    /// Beam inertia J2.
    pub beam_inertia_kg_m2: f64,
    /// Half the distance between the linear motors, L.
    pub half_beam_m: f64,
    /// Stiffness k_y between carriage and beam, translation.
    pub stiffness_y_n_per_m: f64,
    /// Stiffness k_r between carriage and beam, rotation.
    pub stiffness_r_n_m_per_rad: f64,
    /// Damping d_y, translation.
    pub damping_y_n_s_per_m: f64,
    /// Damping d_r, rotation.
    pub damping_r_n_m_s_per_rad: f64,
    /// Mass that the motor of x1 moves.
    pub servo_mass_kg: f64,
    /// Half the stroke of x1.
    pub half_stroke_m: f64,
}

impl MachineParameters {
    /// The default masses with stiffness and damping such that at p = 0 the uncoupled modes (y, R) have these
    /// frequencies, in Hz, and this damping ratio:
    /// `k = (2 pi f)^2 mu`, `d = 2 zeta (2 pi f) mu`, with the reduced mass `mu = m1 m2 / (m1 + m2)`.
    #[must_use]
    pub fn from_modes(modes_hz: [f64; 2], damping_ratio: f64) -> Self {
        let (m1, m2, j1, j2) = (12.0, 20.0, 0.25, 1.2);
        let (mu_y, mu_r) = (m1 * m2 / (m1 + m2), j1 * j2 / (j1 + j2));
        let [w_y, w_r] = modes_hz.map(|f| TAU * f);
        Self {
            carriage_mass_kg: m1,
            beam_mass_kg: m2,
            carriage_inertia_kg_m2: j1,
            beam_inertia_kg_m2: j2,
            half_beam_m: 0.5,
            stiffness_y_n_per_m: w_y * w_y * mu_y,
            stiffness_r_n_m_per_rad: w_r * w_r * mu_r,
            damping_y_n_s_per_m: 2.0 * damping_ratio * w_y * mu_y,
            damping_r_n_m_s_per_rad: 2.0 * damping_ratio * w_r * mu_r,
            servo_mass_kg: m1,
            half_stroke_m: 0.3,
        }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`PlantError::Setting`] names the first field that is not a finite number above zero.
    pub fn check(self) -> Result<Machine, PlantError> {
        for (field, value) in [
            ("carriage_mass_kg", self.carriage_mass_kg),
            ("beam_mass_kg", self.beam_mass_kg),
            ("carriage_inertia_kg_m2", self.carriage_inertia_kg_m2),
            ("beam_inertia_kg_m2", self.beam_inertia_kg_m2),
            ("half_beam_m", self.half_beam_m),
            ("stiffness_y_n_per_m", self.stiffness_y_n_per_m),
            ("stiffness_r_n_m_per_rad", self.stiffness_r_n_m_per_rad),
            ("damping_y_n_s_per_m", self.damping_y_n_s_per_m),
            ("damping_r_n_m_s_per_rad", self.damping_r_n_m_s_per_rad),
            ("servo_mass_kg", self.servo_mass_kg),
            ("half_stroke_m", self.half_stroke_m),
        ] {
            positive(field, value)?;
        }
        Ok(Machine { parameters: self })
    }
}

impl Default for MachineParameters {
    fn default() -> Self {
        Self::from_modes([1.45, 2.0], 0.015)
    }
}

/// A machine with checked parameters: every one finite and above zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Machine {
    pub(crate) parameters: MachineParameters,
}

impl Machine {
    /// The parameters.
    pub fn parameters(&self) -> &MachineParameters {
        &self.parameters
    }

    /// `count` equidistant positions from one end of the stroke to the other; the middle alone for `count = 1`.
    pub fn positions(&self, count: usize) -> Vec<f64> {
        let h = self.parameters.half_stroke_m;
        if count == 1 {
            return vec![0.0];
        }
        // Symmetric by construction, so that the middle is 0 and not a rounding error.
        let last = count.saturating_sub(1) as f64;
        (0..count).map(|i| h * (2.0 * i as f64 - last) / last).collect()
    }

    /// Refuses positions outside the stroke, up to rounding (1e-9 of it); returns the position clamped to it.
    ///
    /// # Errors
    /// [`PlantError::Position`]; NaN is outside.
    pub fn check_position(&self, position: f64) -> Result<f64, PlantError> {
        let h = self.parameters.half_stroke_m;
        if position.abs() <= h * (1.0 + 1e-9) {
            Ok(position.clamp(-h, h))
        } else {
            Err(PlantError::Position {
                position,
                half_stroke_m: h,
            })
        }
    }
}
