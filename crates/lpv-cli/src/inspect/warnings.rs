//! What deserves attention, in words, with what to do.

use super::Inspection;

/// Below this the averaged signal hardly stands out of its noise.
const LOW_SNR_DB: f64 = 10.0;

/// Places named before the rest is counted.
const PLACES: usize = 3;

/// What was seen, with what to do, and where.
#[derive(Default)]
struct Found(Vec<(String, Vec<String>)>);

impl Found {
    /// Warnings with the same words are told once, with all their places.
    fn add(&mut self, words: impl Into<String>, place: impl Into<String>) {
        let (words, place) = (words.into(), place.into());
        match self.0.iter_mut().find(|(w, _)| *w == words) {
            Some((_, places)) => places.push(place),
            None => self.0.push((words, vec![place])),
        }
    }

    fn said(self) -> Vec<String> {
        self.0
            .into_iter()
            .map(|(words, places)| {
                let more = places.len().saturating_sub(PLACES);
                let named = places[..places.len().min(PLACES)].join(", ");
                match (named.is_empty(), more) {
                    (true, _) => words,
                    (false, 0) => format!("{words} ({named})"),
                    (false, _) => format!("{words} ({named}, and {more} more)"),
                }
            })
            .collect()
    }
}

pub(super) fn warnings(i: &Inspection) -> Vec<String> {
    let transients = i.records.iter().any(|r| r.kind == "transient");
    let held_out = i.records.iter().any(|r| r.purpose == "validation");
    let mut found = Found::default();
    experiments(i, &mut found);
    channels(i, &mut found);
    let mut said = found.said();
    positions(i, &mut said);
    if !held_out {
        said.push(
            "no record has use = \"validation\": nothing is left to judge a model with; hold one out".into(),
        );
    }
    if transients && !i.controller && i.channels.iter().any(|c| c.role == "reference") {
        said.push(
            "no [controller]: moves cannot be simulated in closed loop; write down its coefficients".into(),
        );
    }
    said
}

fn experiments(i: &Inspection, found: &mut Found) {
    for e in &i.experiments {
        let at = match e.position {
            Some(p) => format!("position {p:.4}"),
            None => e.records.join(", "),
        };
        let low = e
            .lines
            .iter()
            .filter(|l| l.output_snr_db.iter().any(|s| *s < LOW_SNR_DB))
            .count();
        if low * 20 > e.lines.len() {
            found.add(
                format!("an output stands less than {LOW_SNR_DB} dB above its noise at many lines; excite them more or measure more periods"),
                format!("{at}: {low} of {}", e.lines.len()),
            );
        }
        if e.frf_deviation.median > 0.5 {
            found.add(
                "the frequency response is mostly noise; check `period`",
                format!("{at}: {:.0} % in the median", 100.0 * e.frf_deviation.median),
            );
        }
        if e.periods_used < 4 {
            found.add(
                "few steady periods leave the covariance uncertain; measure six or more",
                format!("{at}: {}", e.periods_used),
            );
        }
        if e.periods_skipped > 0 && 2 * e.periods_skipped >= e.periods_used {
            found.add(
                "many periods still show the transient; start the record later or measure longer",
                format!(
                    "{at}: {} of {}",
                    e.periods_skipped,
                    e.periods_skipped + e.periods_used
                ),
            );
        }
        if e.condition[0] > 100.0 {
            found.add(
                "the inputs are nearly dependent; use orthogonal phases in the experiments",
                format!("{at}: condition {:.0} at {:.4}", e.condition[0], e.condition[1]),
            );
        }
        if e.instrument == "inputs" && i.controller {
            found.add(
                "closed loop without a usable reference: the noise that is fed back biases the response; record the excitation",
                at.clone(),
            );
        }
        for (kind, levels) in [("odd", &e.odd_distortion), ("even", &e.even_distortion)] {
            if let Some(worst) = levels.iter().flatten().copied().reduce(f64::max)
                && worst > e.frf_deviation.median.max(1e-3)
            {
                found.add(
                    format!("{kind} nonlinear distortion above the noise of the response; a linear model cannot be better"),
                    format!(
                        "{at}: {:.2} % of the output, noise {:.2} %",
                        100.0 * worst,
                        100.0 * e.frf_deviation.median
                    ),
                );
            }
        }
    }
}

fn channels(i: &Inspection, found: &mut Found) {
    for r in &i.records {
        for c in &r.channels {
            let at = format!("{}, {}", r.name, c.name);
            if r.kind == "periodic" && c.role == "reference" && c.crest_factor > 4.0 {
                found.add(
                    "a crest factor above 4; better phases put more power into the same amplitude",
                    format!("{at}: {:.1}", c.crest_factor),
                );
            }
            if c.role == "output" && c.near_nyquist > 0.1 {
                found.add(
                    "much of the power lies above 0.8 of the Nyquist frequency; check the anti-alias filter",
                    format!("{at}: {:.0} %", 100.0 * c.near_nyquist),
                );
            }
            if let Some(step) = c.resolution
                && c.role == "output"
                && step > 0.05 * c.rms
            {
                found.add(
                    "the resolution is coarse; the noise is that of the converter",
                    format!("{at}: {step:.2e}, {:.0} % of the rms", 100.0 * step / c.rms),
                );
            }
        }
        if let Some(low) = r.explained.iter().copied().reduce(f64::min)
            && low < 0.5
        {
            found.add(
                "inputs explain less than half of an output's power linearly; disturbances, noise or nonlinearity dominate",
                format!("{}: {:.0} %", r.name, 100.0 * low),
            );
        }
    }
}

fn positions(i: &Inspection, said: &mut Vec<String>) {
    let Some(coverage) = &i.coverage else { return };
    let positions = &coverage.positions;
    let (Some(first), Some(last)) = (positions.first(), positions.last()) else {
        return;
    };
    let width = coverage.range[1] - coverage.range[0];
    if positions.len() == 1 && width > 0.0 {
        said.push("periodic records at one position only: the model cannot know how the dynamics change; measure at several".into());
        return;
    }
    let outside = (first - coverage.range[0]).max(coverage.range[1] - last);
    if outside > 0.02 * width {
        said.push(format!(
            "records move to [{:.4}, {:.4}], the periodic ones cover [{first:.4}, {last:.4}]; a model is not known beyond",
            coverage.range[0], coverage.range[1]
        ));
    }
    let even = (last - first) / (positions.len() - 1).max(1) as f64;
    if coverage.largest_gap > 1.8 * even {
        said.push(format!(
            "a gap of {:.4} between neighbouring positions, {:.1} times the mean; measure in between",
            coverage.largest_gap,
            coverage.largest_gap / even
        ));
    }
}
