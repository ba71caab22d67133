//! A direct term of a machine that was measured in continuous time.
//!
//! Samples of such a response have `H G + (1 - H) c` with the direct term c ([`FrfEstimate::beside_direct`]). The fit gives c and needs it:
//! both are found in turn. An error d of c leaves `(1 - H) d` in the response, which is `j w T d / 2` on lines far below the sample rate, and
//! of that a fit takes at most half for a direct term.

use super::search::{Fits, Search, upper_half};
use crate::PipelineError;
use lpv_core::FrfEstimate;
use lpv_core::nalgebra::DMatrix;
use pole_fit::{NumeratorDegree, PoleFit, PoleFitSettings, fit_from};

/// Scans over orders, each beside the direct term of the one before.
const SCANS: usize = 3;

/// Change of the direct term, relative, that changes no order.
const SAME_ORDER: f64 = 0.01;

/// Fits of one order at most until fit and response agree.
const MOST_FITS: usize = 24;

/// Change of the direct term, relative, at which they do.
const AGREES: f64 = 1e-6;

impl Search<'_> {
    /// The only response, where the direct term decides what its samples are.
    pub(super) fn held(&self) -> Option<&FrfEstimate> {
        match self.estimates {
            [one] if one.is_of_held_input() => Some(one),
            _ => None,
        }
    }

    /// The fits of the structure, with the order given or scanned.
    pub(super) fn run(&mut self, reasons: &mut Vec<String>) -> Result<Fits, PipelineError> {
        let Some(one) = self.held().cloned() else {
            return self.run_as_measured(reasons);
        };
        if self.settings.numerator == NumeratorDegree::StrictlyProper {
            return self.run_as_measured(reasons);
        }
        let mut direct = DMatrix::zeros(one.frf().outputs(), one.frf().inputs());
        let mut scans = 0;
        loop {
            let estimates = [one.beside_direct(&direct)];
            let mut beside = Search {
                estimates: &estimates,
                counted: None,
                candidates: Vec::new(),
                ..*self
            };
            let mut why = Vec::new();
            let (fits, scan) = beside.run_as_measured(&mut why)?;
            let candidates = beside.candidates;
            let found = direct_term(&fits[0]);
            scans += 1;
            let last = found.as_ref().is_none_or(|found| {
                let change = (found - &direct).norm();
                scans == SCANS || change <= SAME_ORDER * found.norm()
            });
            direct = found.unwrap_or(direct);
            if last {
                self.candidates.extend(candidates);
                reasons.extend(why);
                let order = fits[0].account.order;
                let settings = PoleFitSettings {
                    order,
                    ..self.settings
                };
                let fit = self.agreed(&one, &settings, fits[0].clone());
                return Ok((vec![fit], scan));
            }
        }
    }

    /// The fit whose direct term is that of the response that it explains, from one nearby.
    pub(super) fn agreed(&self, one: &FrfEstimate, settings: &PoleFitSettings, mut fit: PoleFit) -> PoleFit {
        let mut before: Option<DMatrix<f64>> = None;
        for _ in 0..MOST_FITS {
            let Some(direct) = direct_term(&fit) else { break };
            if before.is_some_and(|b| (&direct - b).norm() <= AGREES * direct.norm()) {
                break;
            }
            match fit_from(
                &one.beside_direct(&direct),
                self.clock,
                settings,
                &upper_half(&fit),
            ) {
                Ok(next) => fit = next,
                Err(_) => break,
            }
            before = Some(direct);
        }
        fit
    }
}

fn direct_term(fit: &PoleFit) -> Option<DMatrix<f64>> {
    Some(fit.state_space().ok()?.d().clone())
}
