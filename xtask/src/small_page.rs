//! docs/small-lfr.md: the figures of the small LFR beside their bars.

use serde_json::Value;

/// Key, what it is, bar (at most; at least for the count), how it is written.
struct Row(&'static str, &'static str, Option<f64>, fn(f64) -> String);

fn fixed(v: f64) -> String {
    format!("{v:.1}")
}
fn ratio(v: f64) -> String {
    format!("{v:.3}")
}
fn small(v: f64) -> String {
    format!("{v:.1e}")
}
fn count(v: f64) -> String {
    format!("{v:.0}")
}

const ROWS: [Row; 25] = [
    Row(
        "noise_free_5/strict_max_db",
        "noise-free, 5 deltas: strict error, dB",
        Some(-60.0),
        fixed,
    ),
    Row(
        "noise_free_5/median_db",
        "the same, median, dB",
        Some(-80.0),
        fixed,
    ),
    Row(
        "noise_free_4/strict_max_db",
        "noise-free, 4 deltas: strict error, dB",
        Some(-50.0),
        fixed,
    ),
    Row(
        "noise_free_6/strict_max_db",
        "noise-free, 6 deltas: strict error, dB",
        Some(-75.0),
        fixed,
    ),
    Row(
        "noise_free_3/strict_max_db",
        "noise-free, 3 deltas: strict error, dB",
        None,
        fixed,
    ),
    Row(
        "noisy_5/strict_max_db_band",
        "paper's noise, 5 deltas, over [0.01, 3]: strict error, dB",
        Some(-50.0),
        fixed,
    ),
    Row(
        "noisy_5/strict_max_db_nyquist",
        "the same up to Nyquist, dB",
        Some(-40.0),
        fixed,
    ),
    Row(
        "noisy_5/cramer_rao_ratio",
        "error of the frozen response over its stated deviation, median",
        Some(1.2),
        ratio,
    ),
    Row(
        "noisy_5/bound_nyquist_db",
        "Cramér-Rao bound up to Nyquist: one deviation over the response, largest over lines and positions, dB",
        None,
        fixed,
    ),
    Row(
        "noisy_5/bound_nyquist_3_db",
        "the same of the smallest exact LFR, 3 deltas, dB",
        None,
        fixed,
    ),
    Row("noisy_5/seconds", "that fit, s", None, fixed),
    Row(
        "starts/reached",
        "seeds that reach the bars of 5 deltas, restarts included",
        None,
        count,
    ),
    Row(
        "joint_reduction_loss_db",
        "joint reduction of the direct LFR to (8, 5), against the best start (below -160 dB both count as exact), dB",
        Some(1.0),
        fixed,
    ),
    Row(
        "joint_reduction/before_db",
        "strict error of the reduced LFR before it saw data again, dB",
        None,
        fixed,
    ),
    Row(
        "joint_reduction/reduced_db",
        "strict error after it was refined on the responses, dB",
        None,
        fixed,
    ),
    Row(
        "moving/closed_loop_rms/0",
        "fast back-and-forth, closed loop, y1, m",
        Some(5e-8),
        small,
    ),
    Row(
        "moving/closed_loop_rms/1",
        "the same, y2, rad",
        Some(2.5e-6),
        small,
    ),
    Row(
        "moving/frozen_only_rms/0",
        "the same of a model from frozen responses alone, y1, m",
        None,
        small,
    ),
    Row("moving/frozen_only_rms/1", "the same, y2, rad", None, small),
    Row(
        "moving/noisy_over_noise",
        "from noisy data: largest error on three unseen moves over the closed-loop output noise",
        Some(1.2),
        ratio,
    ),
    Row(
        "moving/noise_over_sensor/0",
        "closed-loop output noise over that of a sample of the sensor, y1",
        None,
        ratio,
    ),
    Row("moving/noise_over_sensor/1", "the same, y2", None, ratio),
    Row(
        "sweep/open_loop_rms/0",
        "slow sweep, open loop, y1, m",
        Some(1e-6),
        small,
    ),
    Row("sweep/open_loop_rms/1", "the same, y2, rad", None, small),
    Row(
        "seconds",
        "noise-free fit with 5 deltas, from responses to LFR, s",
        Some(3.0),
        ratio,
    ),
];

fn number(value: &Value, path: &str) -> Option<f64> {
    value.pointer(&format!("/{path}")).and_then(Value::as_f64)
}

pub(crate) fn page(metrics: &Value) -> String {
    let small = &metrics["lfr_small"];
    let mut text = String::from(INTRODUCTION);
    text += "| `lfr_small.` | figure | value | bar |\n|---|---|---|---|\n";
    for Row(path, what, bar, show) in &ROWS {
        let value = number(small, path);
        let shown = value.map_or("not measured".to_owned(), show);
        let all = (*path == "starts/reached")
            .then(|| number(small, "starts/of"))
            .flatten();
        let verdict = |met: bool| if met { "met" } else { "MISSED" };
        let judged = match (bar, value, all) {
            (Some(bar), Some(value), _) => format!("at most {bar:?}: {}", verdict(value <= *bar)),
            (None, Some(value), Some(all)) => format!("all {all}: {}", verdict(value >= all)),
            _ => String::new(),
        };
        text += &format!("| `{}` | {what} | {shown} | {judged} |\n", path.replace('/', "."));
    }
    text += MACHINES;
    text += "| machine | 4 deltas, dB | 5 deltas, dB | median, dB | 6 deltas, dB | seeds | back-and-forth, m, rad | sweep, open loop, m |\n|---|---|---|---|---|---|---|---|\n";
    for machine in small["machines"].as_array().into_iter().flatten() {
        let show = |path: &str, with: fn(f64) -> String| {
            number(machine, path).map_or("not measured".to_owned(), with)
        };
        text += &format!(
            "| {} | {} | {} | {} | {} | {} of {} | {}, {} | {} |\n",
            machine["name"].as_str().unwrap_or(""),
            show("noise_free_4/strict_max_db", fixed),
            show("noise_free_5/strict_max_db", fixed),
            show("noise_free_5/median_db", fixed),
            show("noise_free_6/strict_max_db", fixed),
            show("starts/reached", count),
            show("starts/of", count),
            show("moving/closed_loop_rms/0", self::small),
            show("moving/closed_loop_rms/1", self::small),
            show("sweep/open_loop_rms/0", self::small),
        );
    }
    text + END
}

const INTRODUCTION: &str = "# The small LFR

Written by `cargo xtask small --bless`; without `--bless` the same page and `metrics.json` go to `target/small`. All settings are the
defaults of the library.

The paper needs 36 states and 34 deltas, and its strict frozen error stays near the n-width cost of the basis, about -14 dB. Here the same
machine gets 8 states, 4 of them its rigid body and exact, and 3 to 6 deltas, from the same responses. Strict: the largest relative error over
160 lines up to Nyquist and 81 positions, of which 21 were measured.

";

const MACHINES: &str = "
## Three other machines

Other masses, modes and damping, 11 positions instead of 21; noise-free responses and moves.

";

const END: &str = "
## What it says

- A continuous-time LFR behind a zero-order hold can be exact, a discrete-time one of this size cannot: the exponential of a matrix that is affine in
  p is not rational in p. With deltas that reach the outputs too, three are enough for the frozen responses of this machine.
- Frozen responses do not fix the state coordinates. The model from constant positions alone is wrong by tens of micrometres along a fast
  back-and-forth, and right to less than the noise once the records along a moving p have said how its basis turns. Parameter-independent coordinates
  need a fourth delta: one between state and forces, one at the outputs, two at the accelerations.
- From noisy responses no model of this kind can be right to -40 dB up to Nyquist: the response has a zero there, what the noise leaves open does not, and
  the Cramér-Rao bound itself lies where the table says, for the smallest LFR that is exact too. Over [0.01, 3] the bound leaves room.
- What turns must be given enough freedom: with polynomials of degree 3 in G(p) the records of machine-plain seem explained to within 1.3
  times the noise, and no LFR of the right structure is found from there; with degree 5 it is found, on all machines tried.
- Along a fast back-and-forth such a machine is unstable in open loop (its stiffness is modulated near twice a mode); compare models there in closed
  loop. The machine's own model with noisy inputs runs away alike.
";
