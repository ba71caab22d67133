//! Whether a model is right, by the truth; and whether the program's first line tells what is wrong.

use super::TaskError;
use super::machine::{C64, Linear};
use super::program::{Lab, Said, worth};
use lpv_core::nalgebra::DMatrix;
use lpv_core::{FrozenModel, Model, StateSpace};
use serde::{Deserialize, Serialize};

/// How many times the achievable error makes a model wrong.
pub(crate) const WRONG: f64 = 5.0;

/// What came out of one case.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Judged {
    /// Whether the answer is right, or the first line says what is wrong.
    pub(crate) is_right: bool,
    /// Whether a wrong model left with exit code 0 and a good word.
    pub(crate) is_silent: bool,
    /// What the program said first.
    pub(crate) said: String,
    /// What had been right.
    pub(crate) wanted: String,
    /// The command.
    pub(crate) command: String,
    /// Error of the model over the achievable one, where there is a model and a truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) error: Option<f64>,
}

/// A line without the place of the machine on which it was said: it is kept on a page.
fn without_home(line: &str) -> String {
    let places = [
        (Some(crate::root().display().to_string()), "."),
        (std::env::var("HOME").ok().filter(|h| h.len() > 1), "~"),
    ];
    places
        .into_iter()
        .fold(line.to_owned(), |line, (place, short)| match place {
            Some(place) => line.replace(&place, short),
            None => line,
        })
}

impl Judged {
    /// Of a run and what is right.
    pub(crate) fn new(is_right: bool, said: &Said, command: &str, wanted: &str) -> Self {
        Self {
            is_right,
            is_silent: false,
            said: without_home(&said.first()).chars().take(220).collect(),
            wanted: wanted.to_owned(),
            command: command.to_owned(),
            error: None,
        }
    }
    /// Both: the first that is wrong speaks.
    pub(crate) fn and(self, other: Self) -> Self {
        let silent = self.is_silent || other.is_silent;
        let error = match (self.error, other.error) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        };
        let one = if self.is_right { other } else { self };
        Self {
            is_silent: silent,
            error,
            ..one
        }
    }
}

/// A line at which a model is judged.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    /// Cycles a sample.
    pub(crate) cycles: f64,
    /// Size of the input, as the sum over a window of the record.
    pub(crate) input: f64,
    /// Deviation of the same sum of the output's noise.
    pub(crate) noise: f64,
}

/// The sampled machine at the places of its records, and what noise lets one know of it.
#[derive(Debug, Clone)]
pub(crate) struct Truth {
    /// Position and sampled machine.
    pub(crate) places: Vec<(f64, Linear)>,
    /// Sample time.
    pub(crate) h: f64,
    /// Where it is judged.
    pub(crate) lines: Vec<Line>,
    /// Parameters of a fit of the right order over the numbers that the window of the lines holds.
    pub(crate) share: f64,
}

/// Relative error of a response that no record of these lengths lets one go below.
const FLOOR: f64 = 4e-3;

/// A line counts fully where the output is so many times its noise.
const CLEAR: f64 = 10.0;

impl Truth {
    /// Root mean square over places and lines of the error of the response, relative to the response where that stands out of the noise.
    pub(crate) fn error(&self, model: &Model) -> Result<f64, TaskError> {
        let mut sum = 0.0;
        for (p, machine) in &self.places {
            let frozen = frozen(model, *p, self.h)?;
            for line in &self.lines {
                let (Some(g), Some(f)) = (frozen.response(line.cycles), machine.response(line.cycles)) else {
                    return Ok(f64::INFINITY);
                };
                if g.shape() != f.shape() {
                    return Err("the model has other channels than the machine".into());
                }
                sum += (line.input * norm(&(g - &f)) / size(line, &f)).powi(2);
            }
        }
        Ok((sum / (self.places.len() * self.lines.len()) as f64).sqrt())
    }

    /// The same error of a fit of the right order, as the noise lets one expect it.
    pub(crate) fn achievable(&self) -> f64 {
        let machine = self.places.first().map(|(_, m)| m);
        let ratios = self.lines.iter().filter_map(|line| {
            let f = machine?.response(line.cycles)?;
            Some((line.noise / size(line, &f)).powi(2))
        });
        let mean = ratios.sum::<f64>() / self.lines.len().max(1) as f64;
        (mean * self.share).sqrt().max(FLOOR)
    }
}

fn norm(m: &DMatrix<C64>) -> f64 {
    m.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt()
}

/// The output at a line, or what of it stands out.
fn size(line: &Line, f: &DMatrix<C64>) -> f64 {
    (line.input * norm(f)).hypot(CLEAR * line.noise)
}

/// A model at one position, sampled; by this bench's own rules from the matrices of the file.
pub(crate) fn frozen(model: &Model, p: f64, h: f64) -> Result<Linear, TaskError> {
    fn matrices<K>(s: &StateSpace<K>) -> Linear
    where
        K: lpv_core::Clock,
    {
        Linear {
            a: s.a().clone(),
            b: s.b().clone(),
            c: s.c().clone(),
            d: s.d().clone(),
        }
    }
    Ok(match model.frozen(&[p])? {
        FrozenModel::Discrete(s) => matrices(&s),
        FrozenModel::Continuous(s) => matrices(&s).sampled(h),
    })
}

/// What a first line may say.
#[derive(Debug, Clone, Default)]
pub(crate) struct Words {
    /// Each a list of alternatives in lower case; one of each must be there: `[["repeat", "is held"], ["y"]]`.
    cause: Vec<Vec<String>>,
    /// Whether the word that the model is only an approximation is cause enough: where its size is what is wrong.
    approximate: bool,
}

impl Words {
    /// Words of the cause.
    pub(crate) fn cause(cause: &[&[&str]]) -> Self {
        let owned = |any: &&[&str]| any.iter().map(|w| w.to_lowercase()).collect();
        Self {
            cause: cause.iter().map(owned).collect(),
            approximate: false,
        }
    }
    /// Or that the model is no more than an approximation.
    pub(crate) fn or_approximate(mut self) -> Self {
        self.approximate = true;
        self
    }
    /// Where nothing may be said because the answer can be right.
    pub(crate) fn none() -> Self {
        Self::default()
    }
    /// Whether a line says it.
    pub(crate) fn told(&self, line: &str) -> bool {
        let line = line.to_lowercase();
        !self.cause.is_empty()
            && self
                .cause
                .iter()
                .all(|any| any.iter().any(|w| line.contains(w.as_str())))
    }
}

impl Lab {
    /// Runs `lpv identify BUNDLE -o m.json ARGUMENTS` and judges the model by the truth, the first line by its words.
    pub(crate) fn identify(
        &self,
        bundle: &str,
        truth: Option<&Truth>,
        arguments: &[&str],
        words: &Words,
        wanted: &str,
    ) -> Result<Judged, TaskError> {
        let all = [&["identify", bundle, "-o", "m.json"], arguments].concat();
        std::fs::remove_file(self.path("m.json")).ok();
        let said = self.run(&all)?;
        let command = format!("lpv {}", all.join(" "));
        let model = lpv::ModelFile::read(&self.path("m.json")).ok();
        let ratio = match (&model, truth) {
            // Other channels than the machine's: as wrong as can be.
            (Some(file), Some(truth)) => {
                Some(truth.error(&file.model).unwrap_or(f64::INFINITY) / truth.achievable())
            }
            _ => None,
        };
        let worth = worth(&self.json("m.json"));
        let is_bad = ratio.is_some_and(|r| r.is_nan() || r > WRONG);
        let is_good = matches!(worth.as_str(), "" | "good");
        let refused =
            matches!(said.code, Some(3)) || ["not-a-model", "contradictory-data"].contains(&worth.as_str());
        let told = words.told(&said.first());
        let is_right = said.is_orderly()
            && (told
                || ratio.is_some_and(|r| r <= WRONG && !refused)
                || (is_bad && (refused || (words.approximate && worth == "approximate"))));
        let mut judged = Judged::new(is_right, &said, &command, wanted);
        judged.error = ratio.map(|r| if r.is_finite() { r } else { f64::MAX });
        judged.is_silent = said.code == Some(0) && is_bad && is_good && !told;
        Ok(judged)
    }
}
