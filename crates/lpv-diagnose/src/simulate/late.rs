//! Commands that come late, over one part of a sample.

/// A signal over one part of a sample, known by its mean and by its first moment about the middle, both over the length.
pub(super) struct Slope {
    pub(super) mean: f64,
    pub(super) moment: f64,
}

impl Slope {
    /// The straight line with that mean and moment, at start, middle and end: what it moves in that part, it moves as far.
    pub(super) fn along(&self) -> [f64; 3] {
        [-6.0, 0.0, 6.0].map(|ahead| self.mean + ahead * self.moment)
    }
}

/// A first-order lag over one part of a sample.
pub(super) struct Lag {
    /// Length of the part over the time constant.
    rest: f64,
    /// What is left of a gap at the end of the part, its mean over the part, and its first moment.
    decay: f64,
    mean: f64,
    moment: f64,
}

impl Lag {
    /// None without a time constant.
    pub(super) fn new(lag: f64, part: f64) -> Option<Self> {
        let rest = part / lag;
        let decay = (-rest).exp();
        let mean = (1.0 - decay) / rest;
        let moment = (1.0 - decay * (1.0 + rest)) / (rest * rest) - 0.5 * mean;
        (lag > 0.0).then_some(Self {
            rest,
            decay,
            mean,
            moment,
        })
    }

    /// What follows a signal; that is a straight line with the mean and the ends of its values at start, middle and end.
    pub(super) fn follow(&self, state: &mut f64, [start, middle, end]: [f64; 3]) -> Slope {
        let (middle, rise) = ((start + 4.0 * middle + end) / 6.0, end - start);
        // It ends behind the line by what that rises in the time of the lag.
        let behind = rise / self.rest;
        let gap = *state - (middle - 0.5 * rise - behind);
        *state = middle + 0.5 * rise - behind + gap * self.decay;
        Slope {
            mean: middle - behind + gap * self.mean,
            moment: rise / 12.0 + gap * self.moment,
        }
    }
}

/// A command that is held from sample to sample, between two times counted in samples of which the later is not after the end of
/// sample `now`; `sent` knows it, none is before the first sample.
pub(super) fn delayed(sent: impl Fn(Option<usize>) -> f64, now: usize, [start, end]: [f64; 2]) -> Slope {
    let at = |t: f64| sent((t >= 0.0).then_some((t as usize).min(now)));
    // Parts are shorter than a sample: at most one change of the command lies inside.
    let late = ((end - end.floor()) / (end - start)).clamp(0.0, 1.0);
    let (before, after) = (at(start), at(end));
    let change = after - before;
    Slope {
        mean: before + late * change,
        moment: 0.5 * change * late * (1.0 - late),
    }
}
