//! The noise of one sample, from what does not repeat from period to period.

use lpv_core::{Record, RecordKind};

/// Sums over the periods of several records, a drift over each period (mean and slope) left out.
#[derive(Debug, Clone)]
pub(crate) struct PeriodNoise {
    period: usize,
    /// Mean period of each output of the present record, and the number of its periods.
    means: Vec<Vec<f64>>,
    count: usize,
    /// Sum of squares about the mean period, by output, and its degrees of freedom.
    sums: Vec<f64>,
    freedom: usize,
}

impl PeriodNoise {
    pub(crate) fn new(outputs: usize, period: usize) -> Self {
        Self {
            period,
            means: vec![vec![0.0; period]; outputs],
            count: 0,
            sums: vec![0.0; outputs],
            freedom: 0,
        }
    }

    /// Takes one period of all outputs.
    pub(crate) fn push<'a>(&mut self, outputs: impl Iterator<Item = &'a [f64]>) {
        let middle = (self.period as f64 - 1.0) / 2.0;
        let spread: f64 = (0..self.period).map(|t| (t as f64 - middle).powi(2)).sum();
        self.count += 1;
        for ((x, mean), sum) in outputs.zip(&mut self.means).zip(&mut self.sums) {
            let level = x.iter().sum::<f64>() / self.period as f64;
            let moment = x.iter().enumerate().map(|(t, v)| (t as f64 - middle) * v);
            let slope = moment.sum::<f64>() / spread;
            for (t, (v, mean)) in x.iter().zip(mean).enumerate() {
                let own = v - level - slope * (t as f64 - middle);
                let before = own - *mean;
                *mean += before / self.count as f64;
                *sum += before * (own - *mean);
            }
        }
    }

    /// The periods that follow are those of another record.
    pub(crate) fn end_record(&mut self) {
        self.freedom += self.period.saturating_sub(2) * self.count.saturating_sub(1);
        self.means.iter_mut().for_each(|m| m.fill(0.0));
        self.count = 0;
    }

    /// Standard deviation, by output.
    pub(crate) fn deviations(&self) -> Vec<f64> {
        let of = |sum: &f64| (sum / self.freedom.max(1) as f64).sqrt();
        self.sums.iter().map(of).collect()
    }
}

/// Of whole records of one period, without the first periods of each.
pub(crate) fn period_noise(records: &[Record], skipped: usize) -> Vec<f64> {
    let Some(Record {
        kind: RecordKind::Periodic { period },
        outputs,
        ..
    }) = records.first()
    else {
        return vec![0.0; records.first().map_or(0, |r| r.outputs.channels())];
    };
    let mut noise = PeriodNoise::new(outputs.channels(), *period);
    for record in records {
        for m in skipped..record.len() / period {
            let columns = record.outputs.columns.iter();
            noise.push(columns.map(|c| &c[m * period..(m + 1) * period]));
        }
        noise.end_record();
    }
    noise.deviations()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpv_core::Signals;

    /// A ramp through all periods is no noise; a scatter of known size is.
    #[test]
    fn drift_is_not_noise() {
        let period = 500;
        let scatter = |k: usize| ((k * 7919 + k * k * 31) % 1009) as f64 / 1009.0 - 0.5;
        let y: Vec<f64> = (0..6 * period)
            .map(|k| 0.05 * k as f64 + ((k % period) as f64 * 0.3).sin() + 0.01 * scatter(k))
            .collect();
        let record = Record {
            name: "r".into(),
            kind: RecordKind::Periodic { period },
            purpose: lpv_core::Purpose::Estimation,
            position: None,
            outputs: Signals::new(&["y"], vec![y]),
            inputs: Signals::default(),
            references: Signals::default(),
            scheduling: Signals::default(),
            auxiliary: Signals::default(),
            injection: Signals::default(),
        };
        // Uniform scatter of width 0.01 deviates by 0.01 / sqrt(12).
        let found = period_noise(&[record], 0)[0];
        assert!((found / (0.01 / 12f64.sqrt()) - 1.0).abs() < 0.1, "{found}");
    }
}
