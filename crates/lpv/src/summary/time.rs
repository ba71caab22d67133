//! Figures of fits in the time domain, and of servo axes.

use super::{mode_lines, percents};
use crate::PipelineError;
use crate::diagnose::{Value, in_units};
use crate::signal::finite;
use lpv_core::{AxisOutput, Discrete, RigidBodyAxis, StateSpace};
use lti_ident::OrderEntry;
use lti_ident::rigid_body::AxisAccount;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Figures of a fit in the time domain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TimeSummary {
    /// Number of states.
    pub states: usize,
    /// Fit percent of the simulated output on the fitted samples, by output.
    pub simulated_fit_percent: Vec<f64>,
    /// Fit percent of the one-step prediction.
    pub one_step_fit_percent: Vec<f64>,
    /// The same on samples that were not fitted.
    pub held_out: Option<HeldOut>,
    /// Modes: frequency in Hz, and damping ratio.
    pub modes: Vec<[f64; 2]>,
    /// Every order tried.
    pub orders: Vec<OrderRow>,
}

/// Fit on samples that were not fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeldOut {
    /// Their number.
    pub samples: usize,
    /// Fit percent of the simulated output, by output.
    pub simulated_fit_percent: Vec<f64>,
    /// Fit percent of the one-step prediction, by output.
    pub one_step_fit_percent: Vec<f64>,
}

/// One order of a fit in the time domain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OrderRow {
    /// Number of states.
    pub order: usize,
    /// Minimised cost.
    pub cost: f64,
    /// Fit percent of the simulated output, by output.
    pub simulated_fit_percent: Vec<f64>,
    /// Fit percent of the one-step prediction, by output.
    pub one_step_fit_percent: Vec<f64>,
    /// The cost that other data of this kind are expected to have; none where it has no value.
    pub expected_cost: Option<f64>,
}

/// One servo axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AxisSummary {
    /// The input.
    pub input: String,
    /// The output.
    pub output: String,
    /// `position` or `speed`.
    #[serde(default = "position")]
    pub output_is: String,
    /// `mass` for a position in metres, `inertia` for one in radians or of unknown unit.
    pub kind: String,
    /// Mass or inertia and its standard deviation.
    pub inertia: [f64; 2],
    /// Coefficient of viscous friction and its standard deviation.
    pub viscous: [f64; 2],
    /// Constant force and its standard deviation.
    pub offset: [f64; 2],
    /// Units of the three; the letters u and y stand for units that nobody told.
    #[serde(default)]
    pub units: [String; 3],
    /// Error of the force relative to the force, on the fitted samples, percent.
    pub relative_force_error_percent: f64,
    /// Cut-off of the filter of the position, Hz.
    pub position_cutoff_hz: f64,
    /// Condition number of the regression.
    pub condition_number: f64,
    /// Cut-off of the filter of the equations, and the frequency below which the force has its power.
    #[serde(default)]
    pub bands_hz: Option<[f64; 2]>,
}

fn position() -> String {
    "position".to_owned()
}

impl AxisSummary {
    pub(crate) fn new(
        input: &str,
        output: &str,
        [input_unit, unit]: [&str; 2],
        axis: &RigidBodyAxis,
        account: &AxisAccount,
    ) -> Self {
        let of_position = match axis.output {
            AxisOutput::Position => unit,
            AxisOutput::Speed => unit.trim_end_matches("/s"),
        };
        let templates = match axis.output {
            // A speed without a unit of a position in it.
            AxisOutput::Speed if of_position == unit => ["u s/y", "u/y", "u"],
            AxisOutput::Speed | AxisOutput::Position => ["u s^2/y", "u s/y", "u"],
        };
        let linear = ["m", "mm", "um", "µm", "nm"].contains(&of_position);
        Self {
            input: input.to_owned(),
            output: output.to_owned(),
            output_is: match axis.output {
                AxisOutput::Position => position(),
                AxisOutput::Speed => "speed".to_owned(),
            },
            kind: if linear { "mass" } else { "inertia" }.to_owned(),
            inertia: [axis.inertia, axis.inertia_deviation],
            viscous: [axis.viscous, axis.viscous_deviation],
            offset: [axis.offset, axis.offset_deviation],
            units: templates.map(|template| in_units(template, [input_unit, of_position, ""])),
            relative_force_error_percent: account.relative_force_error_percent,
            position_cutoff_hz: account.position_cutoff_hz,
            condition_number: account.condition_number,
            bands_hz: Some([
                finite(account.regression_cutoff_hz),
                finite(account.force_band_hz),
            ]),
        }
    }

    /// Name, value and standard deviation, and unit of each parameter.
    pub(crate) fn parameters(&self) -> [(&str, [f64; 2], &str); 3] {
        let [of_mass, of_friction, of_offset] = self.units.each_ref().map(String::as_str);
        [
            (&self.kind, self.inertia, of_mass),
            ("viscous friction", self.viscous, of_friction),
            ("offset", self.offset, of_offset),
        ]
    }

    /// In words, where the axis does not move like a mass.
    pub(crate) fn warning(&self) -> Option<String> {
        const MISSED_PERCENT: f64 = 50.0;
        const FAR_BELOW: f64 = 10.0;
        if let Some([equations, force]) = self.bands_hz
            && self.relative_force_error_percent > 0.5 * MISSED_PERCENT
            && equations > FAR_BELOW * force
        {
            return Some(format!(
                "warning: axis {} -> {}: the {} is not to be trusted, its deviation neither: the force has its power below {force:.3} Hz, the equations are kept up to {equations:.3}, where the position shows noise, and noise makes it too small; excite with more and higher frequencies (relative force error {:.0} %)",
                self.input, self.output, self.kind, self.relative_force_error_percent
            ));
        }
        let brakes = self.viscous[0] > -2.0 * self.viscous[1];
        (self.relative_force_error_percent > MISSED_PERCENT || !brakes).then(|| {
            format!(
                "warning: axis {} -> {} does not move like a mass with viscous friction (relative force error {:.0} %, friction {:.3}); look for modes, coupling or other forces",
                self.input, self.output, self.relative_force_error_percent, self.viscous[0]
            )
        })
    }

    pub(crate) fn reason(&self) -> String {
        format!(
            "axis {} -> {}{}: derivatives of the position below {:.1} Hz, condition number {:.1}",
            self.input,
            self.output,
            match self.output_is.as_str() {
                "speed" =>
                    ", a speed that is integrated for it (the inertia is times its rate, the viscous friction times it)",
                _ => "",
            },
            self.position_cutoff_hz,
            self.condition_number
        )
    }
}

fn all_finite(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| finite(*v)).collect()
}

impl OrderRow {
    pub(crate) fn new(entry: &OrderEntry) -> Self {
        Self {
            order: entry.order,
            cost: finite(entry.cost),
            simulated_fit_percent: all_finite(&entry.simulated_fit_percent),
            one_step_fit_percent: all_finite(&entry.one_step_fit_percent),
            expected_cost: Some(entry.expected_cost).filter(|c| c.is_finite()),
        }
    }
}

impl TimeSummary {
    pub(crate) fn new(
        entry: &OrderEntry,
        orders: Vec<OrderRow>,
        held_out: Option<HeldOut>,
    ) -> Result<Self, PipelineError> {
        Ok(Self {
            states: entry.order,
            simulated_fit_percent: all_finite(&entry.simulated_fit_percent),
            one_step_fit_percent: all_finite(&entry.one_step_fit_percent),
            held_out,
            modes: modes(entry.model.model())?,
            orders,
        })
    }
}

/// Frequency and damping ratio of the complex poles of a sampled system, slowest first.
pub(crate) fn modes(system: &StateSpace<Discrete>) -> Result<Vec<[f64; 2]>, PipelineError> {
    let t = system.clock().sample_time();
    let mut modes: Vec<[f64; 2]> = system
        .poles()?
        .into_iter()
        .filter(|z| z.im > 0.0)
        .map(|z| {
            let s = z.ln() / t;
            [s.norm() / std::f64::consts::TAU, -s.re / s.norm()]
        })
        .collect();
    modes.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Ok(modes)
}

impl TimeSummary {
    pub(super) fn text(&self) -> String {
        let held_out = self.held_out.as_ref().map_or(String::new(), |h| {
            format!(
                "\nfit on {} samples held out: simulated {}, one step {}",
                h.samples,
                percents(&h.simulated_fit_percent),
                percents(&h.one_step_fit_percent)
            )
        });
        format!(
            "{} states; fit on the fitted samples: simulated {}, one step {}{held_out}\nmodes:\n{}",
            self.states,
            percents(&self.simulated_fit_percent),
            percents(&self.one_step_fit_percent),
            mode_lines(&self.modes)
        )
    }
}

impl AxisSummary {
    pub(super) fn text(&self) -> String {
        let values = self.parameters().map(|(name, [value, deviation], unit)| {
            let value = Value::new(value, deviation, unit.to_owned()).in_short();
            format!("  {name} {value} (standard deviation {deviation:.2e})")
        });
        format!(
            "axis {} -> {}{}:\n{}\n  relative force error {:.2} %",
            self.input,
            self.output,
            if self.output_is == "speed" { " (speed)" } else { "" },
            values.join("\n"),
            self.relative_force_error_percent
        )
    }
}
