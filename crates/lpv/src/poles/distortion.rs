//! One position whose response is distorted: a relative error in the weights, and what describes the rest most shortly.

use super::search::{Fits, Search, near, over_noise, stable};
use crate::PipelineError;
use pole_fit::NumeratorDegree;

impl Search<'_> {
    /// The least cost over its expectation that the own integrators, or none and a direct term, leave with the weights as they are: much
    /// below one the relative error in them is too large.
    pub(super) fn least_over(&mut self) -> f64 {
        let own = self.structure();
        self.matched = false;
        let mut least = f64::INFINITY;
        for structure in [own, (0, NumeratorDegree::Proper)] {
            self.take(structure);
            if let Ok(found) = self.run(&mut Vec::new()) {
                least = least.min(over_noise(&found.0));
            }
        }
        self.matched = true;
        self.take(own);
        least
    }

    /// The fit of one position that describes a distorted response most shortly: with the integrators that it has, and unless they were
    /// given with fewer, or with none, since friction turns them into slow poles; and with a direct term, which takes what the amplifier
    /// does to the phase. What is found stays in the settings.
    pub(super) fn distorted(
        &mut self,
        slope: f64,
        given: Option<usize>,
        reasons: &mut Vec<String>,
    ) -> Result<Fits, PipelineError> {
        let own = self.integrators;
        let mut tried = Vec::new();
        let counts = match given {
            Some(count) => count..=count,
            None => 0..=own.max(2),
        };
        for count in counts.rev().filter(|c| *c <= own || near(*c, slope)) {
            for numerator in [NumeratorDegree::StrictlyProper, NumeratorDegree::Proper] {
                self.take((count, numerator));
                let mut why = Vec::new();
                if let Ok(found) = self.run(&mut why)
                    && stable(&found.0)
                {
                    tried.push(((count, numerator), found, why));
                }
            }
        }
        let best = tried
            .into_iter()
            .min_by(|a, b| self.length_of_all(&a.1.0).total_cmp(&self.length_of_all(&b.1.0)));
        let Some((structure, found, why)) = best else {
            // No fit has stable poles.
            self.take((given.unwrap_or(0), NumeratorDegree::Proper));
            return self.run(reasons);
        };
        self.take(structure);
        let (count, numerator) = structure;
        if count != own {
            reasons.push(format!(
                "{} instead: they describe the response most shortly",
                lpv_core::counted(count, "integrator")
            ));
        }
        if numerator == NumeratorDegree::Proper {
            reasons.push("with a direct term: what is left is smaller for it".to_owned());
        }
        reasons.extend(why);
        Ok(found)
    }
}
