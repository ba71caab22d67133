//! What the tests share.

use lpv_diagnose::lpv_core::{ControllerState, Discrete, Purpose, Record, RecordKind, Signals};
use lpv_diagnose::observer::{self, Observer};
use lpv_diagnose::{Base, Case, Explained, Slower, Trace, TraceError, Track, begun, trace, trace_slower};

/// Records that an observer holds an axis at, the first to fit, the others to judge by.
pub(crate) struct Held {
    base: Base,
    observer: ControllerState,
    tracks: [Vec<Track>; 2],
}

impl Held {
    /// With two to fit.
    pub(crate) fn new(base: Base, records: &[Record], clock: Discrete) -> Result<Self, TraceError> {
        Self::with_judged(base, records, records.len() - 2, clock)
    }

    /// With so many to judge by.
    pub(crate) fn with_judged(
        base: Base,
        records: &[Record],
        judged: usize,
        clock: Discrete,
    ) -> Result<Self, TraceError> {
        let (fitted, judged) = records.split_at(records.len() - judged);
        let observer = Observer::new(&base, fitted, clock)?.controller.start()?;
        let tracks = |records: &[Record], first: usize| -> Result<Vec<Track>, TraceError> {
            let one = |(i, r): (usize, &Record)| {
                Ok(Track::new(r, clock.sample_time(), 2, Some(&observer))?.numbered(first + i))
            };
            records.iter().enumerate().map(one).collect()
        };
        Ok(Self {
            tracks: [tracks(fitted, 1)?, tracks(judged, 1 + fitted.len())?],
            base,
            observer,
        })
    }

    /// The base without effects.
    pub(crate) fn bare(&self) -> Explained {
        Explained {
            base: self.base.clone(),
            effects: Vec::new(),
        }
    }

    /// What is found of readings on a grid of this step; where a record begins, the model tells better than its first readings.
    pub(crate) fn look(&self, model: &Explained, step: f64, seeks_load: bool) -> Result<Trace, TraceError> {
        self.trace(&self.settled(model), step, seeks_load)
    }

    /// The same from where a model lets the records begin that is fitted along them.
    pub(crate) fn look_again(&self, model: &Explained, step: f64) -> Result<Trace, TraceError> {
        let tracks = begun(&self.case(&self.observer, step), model, &self.tracks);
        self.trace(&tracks, step, false)
    }

    fn trace(
        &self,
        [fitted, judged]: &[Vec<Track>; 2],
        step: f64,
        seeks_load: bool,
    ) -> Result<Trace, TraceError> {
        trace(&Case {
            fitted,
            judged,
            seeks_load,
            ..self.case(&self.observer, step)
        })
    }

    /// What a slower observer shows of the same records, of which `found` was seen.
    pub(crate) fn look_slower(
        &self,
        slower: &Observer,
        found: &Trace,
        step: f64,
    ) -> Result<Option<Slower>, TraceError> {
        let [fitted, judged] = self.settled(&found.model);
        let faster = Case {
            fitted: &fitted,
            judged: &judged,
            ..self.case(&self.observer, step)
        };
        let controller = slower.controller.start()?;
        Ok(trace_slower(
            &self.case(&controller, step),
            (&faster, found),
            &self.tracks,
        ))
    }

    fn settled(&self, model: &Explained) -> [Vec<Track>; 2] {
        self.tracks
            .each_ref()
            .map(|t| observer::settled(model, &self.observer, t))
    }

    fn case<'a>(&'a self, controller: &'a ControllerState, step: f64) -> Case<'a> {
        Case {
            base: &self.base,
            prior: None,
            free: None,
            controller,
            noise: [step / 12_f64.sqrt(), 0.0],
            fitted: &[],
            judged: &[],
            own: &[],
            seeks_load: false,
            on_fit: &|_, _| {},
        }
    }
}

/// A record of outputs y0, y1, ... and inputs u0, u1, ...
pub(crate) fn record(name: &str, outputs: Vec<Vec<f64>>, inputs: Vec<Vec<f64>>) -> Record {
    let names = |letter: &str, n: usize| (0..n).map(|i| format!("{letter}{i}")).collect::<Vec<_>>();
    let signals = |letter: &str, columns: Vec<Vec<f64>>| {
        let names = names(letter, columns.len());
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        Signals::new(&names, columns)
    };
    let none = || Signals::new(&[], vec![]);
    Record {
        name: name.to_owned(),
        kind: RecordKind::Transient,
        purpose: Purpose::Estimation,
        position: None,
        outputs: signals("y", outputs),
        inputs: signals("u", inputs),
        references: none(),
        scheduling: none(),
        auxiliary: none(),
        injection: none(),
    }
}

/// One step of `dx/dt = v`, `dv/dt = rate(x, v)` by the rule of the middle, in place.
pub(crate) fn middle_step(x: &mut f64, v: &mut f64, h: f64, rate: impl Fn(f64, f64) -> f64) {
    let middle = *v + 0.5 * h * rate(*x, *v);
    *v += h * rate(*x + 0.5 * h * *v, middle);
    *x += h * middle;
}
