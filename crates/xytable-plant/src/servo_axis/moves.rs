//! Setpoints as drives make them: trapezoids of speed, moves whose acceleration has no step, sums of sines.

use std::f64::consts::{PI, TAU};

/// Setpoints along one record.
#[derive(Debug, Clone, PartialEq)]
pub enum AxisMoves {
    /// From point to point; the speed is a trapezoid.
    Trapezoids {
        /// First the start, then the ends of the moves, m.
        points_m: Vec<f64>,
        /// Time of one move with the rest after it, s.
        time_s: f64,
        /// Part of that time in which the axis rests.
        rest: f64,
        /// Part of a move in which it accelerates, and in which it brakes; at most one half.
        ramp: f64,
    },
    /// The same with ramps whose acceleration is `sin^2`.
    SCurves {
        /// First the start, then the ends of the moves, m.
        points_m: Vec<f64>,
        /// Time of one move with the rest after it, s.
        time_s: f64,
        /// Part of that time in which the axis rests.
        rest: f64,
        /// Part of a move in which it accelerates, and in which it brakes; at most one half.
        ramp: f64,
    },
    /// `sum a sin(2 pi f t)`, with a beginning at rest that fades in over a period of the slowest.
    Sines {
        /// Amplitudes, m, and frequencies, Hz.
        sines: Vec<[f64; 2]>,
    },
}

impl AxisMoves {
    /// Position, speed and acceleration at a time.
    pub fn at(&self, t: f64) -> [f64; 3] {
        match self {
            Self::Trapezoids {
                points_m,
                time_s,
                rest,
                ramp,
            } => between(points_m, (t, *time_s, *rest), |s| trapezoid(s, *ramp)),
            Self::SCurves {
                points_m,
                time_s,
                rest,
                ramp,
            } => between(points_m, (t, *time_s, *rest), |s| s_curve(s, *ramp)),
            Self::Sines { sines } => faded(sines, t),
        }
    }
}

/// A course from 0 to 1 over a time from 0 to 1, between the points.
fn between(points: &[f64], (t, time, rest): (f64, f64, f64), course: impl Fn(f64) -> [f64; 3]) -> [f64; 3] {
    let Some(last) = points.len().checked_sub(1) else {
        return [0.0; 3];
    };
    let i = (t / time).max(0.0) as usize;
    if i >= last {
        return [points[last], 0.0, 0.0];
    }
    let moving = time * (1.0 - rest);
    let s = (t - i as f64 * time) / moving;
    if s >= 1.0 {
        return [points[i + 1], 0.0, 0.0];
    }
    let way = points[i + 1] - points[i];
    let [q, v, a] = course(s);
    [points[i] + way * q, way * v / moving, way * a / (moving * moving)]
}

fn trapezoid(s: f64, ramp: f64) -> [f64; 3] {
    let top = 1.0 / (1.0 - ramp);
    let rise = top / ramp;
    if s < ramp {
        [0.5 * rise * s * s, rise * s, rise]
    } else if s < 1.0 - ramp {
        [top * (s - 0.5 * ramp), top, 0.0]
    } else {
        let left = 1.0 - s;
        [1.0 - 0.5 * rise * left * left, rise * left, -rise]
    }
}

fn s_curve(s: f64, ramp: f64) -> [f64; 3] {
    let top = 1.0 / (1.0 - ramp);
    // Integrals of `2 top / ramp sin^2(pi s / ramp)`.
    let rise = |s: f64| {
        let w = TAU / ramp;
        let a = top / ramp * (1.0 - (w * s).cos());
        let v = top / ramp * (s - (w * s).sin() / w);
        let q = top / ramp * (0.5 * s * s + ((w * s).cos() - 1.0) / (w * w));
        [q, v, a]
    };
    if s < ramp {
        rise(s)
    } else if s <= 1.0 - ramp {
        [top * (s - 0.5 * ramp), top, 0.0]
    } else {
        let [q, v, a] = rise(1.0 - s);
        [1.0 - q, v, -a]
    }
}

fn faded(sines: &[[f64; 2]], t: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for [a, f] in sines {
        let w = TAU * f;
        let (s, c) = (w * t).sin_cos();
        sum[0] += a * s;
        sum[1] += a * w * c;
        sum[2] -= a * w * w * s;
    }
    let slowest = sines.iter().map(|[_, f]| *f).fold(f64::INFINITY, f64::min);
    let w = PI * slowest;
    if w * t >= PI || !w.is_finite() {
        return sum;
    }
    let window = [
        0.5 - 0.5 * (w * t).cos(),
        0.5 * w * (w * t).sin(),
        0.5 * w * w * (w * t).cos(),
    ];
    [
        window[0] * sum[0],
        window[1] * sum[0] + window[0] * sum[1],
        window[2] * sum[0] + 2.0 * window[1] * sum[1] + window[0] * sum[2],
    ]
}
