//! Verdicts and causes in words.

use super::{BandPlace, Basis, Cause, Run, Worth};
use std::fmt;

/// The first line.
pub(super) fn sentence(worth: Worth, basis: Basis, facts: &[Cause], causes: &[Cause]) -> String {
    let head = match worth {
        Worth::Good => "good".to_owned(),
        Worth::GoodUpTo { frequency_hz } => format!("good up to {frequency_hz:.4} Hz"),
        Worth::GoodAtRest => "good at rest, not when the position moves".to_owned(),
        Worth::Approximate => "approximate".to_owned(),
        Worth::Unjudged => "not judged".to_owned(),
        Worth::ContradictoryData => "do not use: the data contradict themselves".to_owned(),
        Worth::NotAModel => "not a model of this machine".to_owned(),
    };
    /// Causes in the first line; the others follow in the account.
    const NAMED: usize = 2;
    let (alone, causes): (Vec<&Cause>, Vec<&Cause>) = causes
        .iter()
        .partition(|c| matches!(c, Cause::UnstableAlone { .. }));
    let told: Vec<String> = match worth {
        Worth::Good => facts.iter().map(ToString::to_string).collect(),
        Worth::ContradictoryData => causes
            .iter()
            .filter(|c| matches!(c, Cause::Data { .. }))
            .take(NAMED)
            .map(ToString::to_string)
            .collect(),
        _ => causes.iter().take(NAMED).map(ToString::to_string).collect(),
    };
    let basis = match basis {
        _ if worth == Worth::ContradictoryData => "",
        Basis::HeldOut => " (held-out records)",
        Basis::Fitted => " (fitted records, none was held out)",
        Basis::Nothing => "",
    };
    let what_to_do = causes
        .iter()
        .find_map(|c| remedy(c))
        .filter(|_| worth != Worth::ContradictoryData);
    let mut line = format!("{head}: {}{basis}", told.join("; "));
    if let Some(remedy) = what_to_do {
        line += "; ";
        line += remedy;
    }
    for cause in alone {
        line += &format!("; {cause}");
    }
    line
}

/// What to do about a cause.
fn remedy(cause: &Cause) -> Option<&'static str> {
    Some(match cause {
        Cause::Band {
            place: BandPlace::Low,
            ..
        } => {
            "friction, a spring or another rigid body than the assumed one may be missing: try `integrators`, or `lpv diagnose`"
        }
        Cause::Band { .. } => "a mode may be missing: try a higher `order`, or look at `lpv inspect`",
        Cause::Record { moves: true, .. } => {
            "record moves for the fit, or see what is missing with `lpv diagnose`"
        }
        Cause::Record { .. } | Cause::Force { .. } => "see what is missing with `lpv diagnose`",
        Cause::Unstable { .. } | Cause::UnstableResponse { .. } => {
            "check input and output and their quantities, or ask for fewer states with `order`"
        }
        Cause::Between { .. } => "measure there too, and see whether the response of one position is wrong",
        Cause::Undetermined { .. } => {
            "measure at lower frequencies, or say how many integrators the machine has with `integrators`"
        }
        Cause::NoisyResponse { .. } => "check `period`, or excite more or longer",
        _ => return None,
    })
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Response {
                error_percent,
                over_noise: Some(over),
                ..
            } => write!(
                f,
                "the frozen response errs by {}, {} its noise",
                percent(*error_percent),
                times(*over)
            ),
            Self::Response {
                error_percent,
                noise_percent,
                over_noise: None,
            } => write!(
                f,
                "the frozen response errs by {} of responses that state no noise (an error of {} of each line is assumed)",
                percent(*error_percent),
                percent(*noise_percent)
            ),
            Self::Band {
                band_hz: [low, high],
                error_percent,
                over_noise,
                ..
            } => write!(
                f,
                "from {low:.4} to {high:.4} Hz the frozen response errs by {}{}",
                percent(*error_percent),
                over_noise.map_or(String::new(), |over| format!(", {} its noise", times(over)))
            ),
            Self::Between {
                positions: [from, to],
                error_percent,
                over_noise,
            } => write!(
                f,
                "between {from:.5} and {to:.5} it is expected to err by {} of the response, {} the noise",
                percent(*error_percent),
                times(*over_noise)
            ),
            Self::Undetermined { what } => {
                let [own, other] = what.integrators;
                let difference = percent(what.difference_percent);
                let (low, high) = (what.lowest_hz, what.highest_hz);
                match own == other {
                    true => write!(
                        f,
                        "not determined outside {low:.4} to {high:.4} Hz: another model explains the lines as well, and its response to a step differs by {difference} within {} s",
                        number(1.0 / low)
                    ),
                    false => write!(
                        f,
                        "not determined below {low:.4} Hz: {own} and {other} integrators explain the lines as well, and their responses to a step differ by {difference} within {} s",
                        number(1.0 / low)
                    ),
                }
            }
            Self::NoisyResponse { noise_percent } => {
                write!(
                    f,
                    "the measured response is mostly noise ({})",
                    percent(*noise_percent)
                )
            }
            Self::Record {
                record,
                output,
                run,
                error_percent,
                over_noise,
                ..
            } => {
                let run = match run {
                    Run::ClosedLoop => "in closed loop",
                    Run::OpenLoop => "simulated",
                    Run::OneStep => "predicted one step",
                };
                if !error_percent.is_finite() || over_noise.is_some_and(|over| !over.is_finite()) {
                    return write!(f, "{output} of record {record}, {run}, runs away");
                }
                write!(f, "{output} of record {record}, {run}, errs by ")?;
                match over_noise {
                    Some(over) => write!(
                        f,
                        "{} the noise ({} of its motion)",
                        times(*over),
                        percent(*error_percent)
                    ),
                    None => write!(f, "{} of its motion", percent(*error_percent)),
                }
            }
            Self::Residual {
                record,
                output,
                by_inputs_percent,
                predictable_percent,
            } => write!(
                f,
                "of the residual of {output} along {record} the inputs explain {}, its past {}",
                percent(*by_inputs_percent),
                percent(*predictable_percent)
            ),
            Self::Force {
                record,
                input,
                error_percent,
            } => write!(
                f,
                "the force that the model asks of {input} along record {record} errs by {}",
                percent(*error_percent)
            ),
            Self::UnstableAlone { radius } => write!(
                f,
                "without feedback the model is unstable (pole of magnitude {radius:.6}): where the machine is not, it is wrong"
            ),
            Self::Unstable { radius } => write!(
                f,
                "the model is unstable (pole of magnitude {radius:.6}) where the measured outputs stay bounded, and no feedback accounts for it"
            ),
            Self::UnstableResponse { radius } => write!(
                f,
                "the model is unstable (pole of magnitude {radius:.6}), and a machine that is measured in open loop is not"
            ),
            Self::NotJudged { why } => f.write_str(why),
            Self::Data { what } => f.write_str(what),
        }
    }
}

/// Three digits, whatever the size.
pub(crate) fn number(x: f64) -> String {
    match x.abs() {
        a if a >= 1e5 || (a < 1e-3 && a > 0.0) => format!("{x:.1e}"),
        a if a >= 100.0 => format!("{x:.0}"),
        a if a >= 10.0 => format!("{x:.1}"),
        a if a >= 0.1 => format!("{x:.2}"),
        _ => format!("{x:.4}"),
    }
}

pub(crate) fn percent(x: f64) -> String {
    format!("{} %", number(x))
}

pub(crate) fn times(x: f64) -> String {
    format!("{} times", number(x))
}
