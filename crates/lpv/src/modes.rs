//! From the poles of one position to a minimal modal model.

use crate::poles::{PoleStage, upper_half};
use lpv_core::{Discrete, FrfEstimate};
use modal_fit::{ModalFit, ModalSettings, modal_fit};

/// A modal model may leave this much more than noise does.
const AT_NOISE: f64 = 1.1;

/// Degrees of freedom of the covariance that each output should have.
const FREEDOM: f64 = 10.0;

/// The modal model of several inputs and outputs, with a reason either way; none where one input or output makes the common
/// denominator minimal, or distortion limits.
pub(crate) fn modal(estimate: &FrfEstimate, clock: Discrete, poles: &mut PoleStage) -> Option<ModalFit> {
    let frf = estimate.frf();
    if frf.outputs().min(frf.inputs()) < 2 || poles.relative_error > 0.0 || poles.integrators > 2 {
        return None;
    }
    let settings = ModalSettings {
        integrators: poles.integrators,
        direct: poles.direct,
        ..ModalSettings::default()
    };
    // With ten degrees of freedom for each output the scatter of the weights costs a tenth of the accuracy.
    let enough = FREEDOM * frf.outputs() as f64 / estimate.degrees_of_freedom().max(1.0);
    let half = (0.5 * (enough - 1.0)).ceil().max(0.0) as usize;
    let smooth = estimate.averaged_covariance(half.max(poles.smoothing));
    let found = match modal_fit(&smooth, clock, &upper_half(&poles.fits[0]), &settings) {
        Ok(found) => found,
        Err(refused) => {
            poles.reasons.push(format!("no modal model: {refused}"));
            return None;
        }
    };
    let over = found.account.cost / found.account.expected_cost;
    let several = found.modes.iter().filter(|m| m.rank > 1).count();
    let ranks = match several {
        0 => "one mode shape each".to_owned(),
        _ => format!("{several} of them with more than one mode shape"),
    };
    let rigid = match found.rigid_rank {
        0 => String::new(),
        rank => format!(", rigid body of rank {rank}"),
    };
    let states = found.model.states();
    // A search that moved a pole out has left the stable denominator it began at.
    let outside = found.modes.iter().any(|m| m.pole.norm() >= 1.0);
    if outside && poles.fits[0].account.unstable_poles.is_empty() {
        poles.reasons.push(
            "no modal model: its poles leave the unit circle, those of the common denominator do not"
                .to_owned(),
        );
        return None;
    }
    if over <= AT_NOISE {
        poles.reasons.push(format!(
            "modal model: {states} states, {} poles, {ranks}{rigid}; cost {over:.3} times what noise leaves",
            found.modes.len()
        ));
        return Some(found);
    }
    poles.reasons.push(format!(
        "no modal model: with {states} states ({ranks}{rigid}) the cost is {over:.2} times what noise leaves; every input or output has its own copy of the poles"
    ));
    None
}
