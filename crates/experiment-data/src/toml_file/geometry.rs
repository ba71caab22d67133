//! The schema of `[geometry]`, which serde reads into the type of lpv-core.

use schemars::JsonSchema;

/// Motor forces from the inputs and motor coordinates from the outputs, rigid.
///
/// `F = (T_0 + p T_1 + p^2 T_2) u`, `q = C y`; rows are motors. In a bundle the sizes fit the channels; a value made by
/// hand is checked when it is written.
#[derive(JsonSchema)]
#[schemars(rename = "Geometry", deny_unknown_fields)]
#[allow(dead_code, reason = "the schema of lpv_core::Geometry, which serde reads")]
pub(super) struct GeometryTable {
    /// `[T_0]`, `[T_0, T_1]` or `[T_0, T_1, T_2]`, each n_motors x n_u, rows first.
    force_from_input: Vec<Vec<Vec<f64>>>,
    /// C, n_motors x n_y, rows first.
    motor_from_output: Vec<Vec<f64>>,
}
