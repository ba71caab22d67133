//! Axes whose output is a speed.

use lpv_core::Discrete;

/// A position of this speed, from zero, by trapezoids. Central differences undo them: the second one of the position is `(v(k+1) - v(k-1))
/// / 2T`, exactly what the mean of two held forces does to the speed of a mass.
#[must_use]
pub fn integrated(speed: &[f64], clock: Discrete) -> Vec<f64> {
    let half = 0.5 * clock.sample_time();
    let mut position = 0.0;
    let steps = speed.windows(2).map(|v| {
        position += half * (v[0] + v[1]);
        position
    });
    speed.first().map(|_| 0.0).into_iter().chain(steps).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rigid_body::{centred, spectral};

    /// A mass under any held force: what its integrated speed is differentiated to is the force.
    #[test]
    fn trapezoids_are_undone_by_central_differences() {
        let clock = Discrete::from_rate(250.0).unwrap();
        let (t, mass) = (clock.sample_time(), 0.3);
        let force: Vec<f64> = (0..200).map(|k| ((k * k) as f64 * 0.37).sin() * 5.0).collect();
        let mut speed = vec![0.7];
        for u in &force {
            speed.push(speed[speed.len() - 1] + u * t / mass);
        }
        let position = integrated(&speed, clock);
        let held = centred(&force);
        for k in 1..force.len() {
            let second = spectral::second(&position[k - 1..k + 2], t);
            assert!((mass * second - held[k]).abs() < 1e-9, "{k}");
        }
        assert!(integrated(&[], clock).is_empty());
    }
}
