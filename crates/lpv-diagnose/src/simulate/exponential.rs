//! A part of a sample in which dry friction takes a speed away faster than the classical rule follows.
//!
//! With a rate L at which the speed v dies out, `v' = -L v + n` and `q' = v`: the first part is integrated exactly and the rest, n, as by the
//! classical rule, to which this one goes for L = 0 (exponential time differencing, Cox and Matthews 2002, in the form of Krogstad 2005, J. Comput. Phys.
//! 203). Any L gives the fourth order. Where friction takes all that acts, the fastest rate of a step keeps it stable: one step follows an axis that
//! sticks. Where the speed passes zero under a larger force, the speed does not follow such a rate, and only short steps serve: L is the rate where
//! a step starts, and its length is controlled.

use crate::base::Stiff;

/// Error of a step that is accepted, in units of what friction does in the part, or a part of what all other forces do.
const ACCURATE: f64 = 2e-5;
const BESIDE: f64 = 0.005;
/// Part of the speed that dies out in a part of the classical rule, and its change there in units of the speed that creeps.
const DIES: f64 = 0.05;
const CHANGES: f64 = 0.5;

/// Times the speed that creeps up to which one is slow: beyond, friction does not change.
const SLOW: f64 = 6.0;

/// Whether the classical rule does not follow in a part of time `h`: the speed dies out too fast where it starts, or may come to rest.
pub(super) fn is_stiff<const N: usize>(here: &Stiff, x: &[f64; N], rates: &[f64; N], h: f64) -> bool {
    /// Times the change of the speed in the part.
    const NEAR: f64 = 2.0;
    let (v, change) = (x[here.speed], h * rates[here.speed]);
    let may_rest = v * (v + NEAR * change) <= 0.0;
    let rate = if may_rest { here.rate_at_rest } else { here.rate };
    let is_slow = may_rest || v.abs() <= SLOW * here.creep();
    h * rate > DIES || is_slow && change.abs() > CHANGES * here.creep()
}

impl Stiff {
    /// The speed below which friction is no more than a force that grows with it.
    fn creep(&self) -> f64 {
        self.level / self.rate_at_rest
    }

    /// Whether friction takes all that acts, at a speed that creeps: there the speed goes where they are equal.
    fn sticks(&self, speed: f64, rate: f64) -> bool {
        self.holds(rate) && speed.abs() <= SLOW * self.creep()
    }

    /// Where a speed goes at once that is no more than `slow` and does not creep, if friction takes all that acts.
    fn settled(&self, speed: f64, rate: f64, slow: f64) -> Option<f64> {
        let stops = self.holds(rate) && speed.abs() <= slow && speed.abs() > SLOW * self.creep();
        stops.then(|| self.creep() * ((rate + self.taken) / self.level).atanh())
    }

    /// Whether friction takes all that acts.
    fn holds(&self, rate: f64) -> bool {
        (rate + self.taken).abs() < self.level
    }
}

/// Steps that a record of so many parts may take beside: many more than an axis does that turns in each tenth part. Where a light body shakes against
/// its friction in every part, what is left is done in one step a part.
pub(super) fn budget(parts: usize) -> usize {
    5_000 + 4 * parts
}

/// The end of a part of time `h` from a state with its rates; `told` gives those of a state at a time of the part, 0 to 1. Takes its steps
/// from a budget.
pub(super) fn part<const N: usize>(
    mut x: [f64; N],
    mut here: ([f64; N], Stiff),
    h: f64,
    budget: &mut usize,
    told: impl Fn(&[f64; N], f64) -> ([f64; N], Stiff),
) -> [f64; N] {
    /// Steps after which the rest is done in one.
    const MOST_STEPS: usize = 80;
    /// Change of a step's length.
    const CHANGE: [f64; 2] = [0.1, 5.0];
    const SAFE: f64 = 0.8;
    /// Part of a step.
    const WRONG: f64 = 0.25;
    let (mut from, mut length) = (0.0, 1.0_f64);
    let slow = ACCURATE * here.1.level * h;
    for tried in 0.. {
        let left: f64 = 1.0 - from;
        let is_last = tried >= MOST_STEPS || *budget == 0;
        *budget = budget.saturating_sub(1);
        length = if is_last { left } else { length.min(left) };
        let (rates, at) = &here;
        if let Some(settled) = at.settled(x[at.speed], rates[at.speed], slow) {
            x[at.speed] = settled;
            here = told(&x, from);
        }
        let (end, mut off) = step(&x, &here, (from, length, h), &told);
        let (v, w) = (x[here.1.speed], end[here.1.speed]);
        // Friction that turns round in between is on the wrong side for some of the step, which its stages need not see.
        let turns = v * w < 0.0 && (w - v).abs() > here.1.creep();
        if turns {
            off = off.max(WRONG * length / ACCURATE);
        }
        if off <= 1.0 || is_last {
            if length >= left {
                return end;
            }
            x = end;
            from += length;
            here = told(&x, from);
        }
        // The difference of a third order and a fourth.
        let change = SAFE * off.cbrt().recip();
        length *= match (off <= 1.0, turns) {
            (false, true) => (v / (v - w)).max(SAFE * ACCURATE / WRONG / length).min(SAFE),
            (false, false) => change.max(CHANGE[0]),
            (true, _) => change.min(CHANGE[1]),
        };
    }
    x
}

/// One step, and its error in units of the one that is accepted.
fn step<const N: usize>(
    x: &[f64; N],
    (k1, here): &([f64; N], Stiff),
    (from, length, h): (f64, f64, f64),
    told: &impl Fn(&[f64; N], f64) -> ([f64; N], Stiff),
) -> ([f64; N], f64) {
    let (q, v) = (here.position, here.speed);
    let time = length * h;
    let along = |rates: &[f64; N], time: f64| -> [f64; N] { std::array::from_fn(|i| x[i] + time * rates[i]) };
    let sticks = here.sticks(x[v], k1[v]);
    let rate = match sticks {
        true => fastest(x, (k1, here), (from + length, time), told),
        false => here.rate,
    };
    let (half, whole) = (phi(0.5 * time * rate), phi(time * rate));
    // The rest, to the powers of the time in a step.
    let reach = |phi: &[f64; 4], time: f64, [first, second, third]: [f64; 3]| {
        let along = |k: usize| {
            let next = |k: usize| phi.get(k).copied().unwrap_or(0.0);
            next(k) * first + next(k + 1) * second + next(k + 2) * third
        };
        let speed = x[v] + time * (along(0) - rate * phi[0] * x[v]);
        (x[q] + time * (phi[0] * x[v] + time * along(1)), speed)
    };
    let rest = |x: &[f64; N], rates: &[f64; N]| rates[v] + rate * x[v];
    let n1 = rest(x, k1);
    let mut speeds = [x[v]; 5];
    let mut at = along(k1, 0.5 * time);
    (at[q], at[v]) = reach(&half, 0.5 * time, [n1, 0.0, 0.0]);
    speeds[1] = at[v];
    let (k2, second) = told(&at, from + 0.5 * length);
    let n2 = rest(&at, &k2);
    at = along(&k2, 0.5 * time);
    (at[q], at[v]) = reach(&half, 0.5 * time, [n1, 2.0 * (n2 - n1), 0.0]);
    speeds[2] = at[v];
    let (k3, third) = told(&at, from + 0.5 * length);
    let n3 = rest(&at, &k3);
    at = along(&k3, time);
    (at[q], at[v]) = reach(&whole, time, [n1, 2.0 * (n3 - n1), 0.0]);
    speeds[3] = at[v];
    let (k4, last) = told(&at, from + length);
    let n4 = rest(&at, &k4);
    let mut end: [f64; N] =
        std::array::from_fn(|i| x[i] + time / 6.0 * ((k1[i] + k4[i]) + 2.0 * (k2[i] + k3[i])));
    let middle = n2 + n3;
    (end[q], end[v]) = reach(
        &whole,
        time,
        [n1, 2.0 * middle - 3.0 * n1 - n4, 4.0 * (n1 - middle + n4)],
    );
    speeds[4] = end[v];
    // What other forces leave where friction hardly changes is no matter of this rule.
    let fast = |side: f64| speeds.iter().all(|v| side * v > SLOW * here.creep());
    let steepest = [here, &second, &third, &last]
        .iter()
        .map(|s| s.rate)
        .fold(0.0, f64::max);
    let is_smooth = steepest * time <= DIES && (end[v] - x[v]).abs() <= CHANGES * here.creep();
    if fast(1.0) || fast(-1.0) || is_smooth {
        return (end, 0.0);
    }
    // What is integrated exactly hides by how much the rest is wrong, unless the speed goes where that does not matter.
    let hidden = if sticks { 1.0 } else { 1.0 + rate * time };
    let off = hidden * ((end[v] - at[v]) * h).abs().max((end[q] - at[q]).abs());
    let others = (k1[v] + here.taken).abs();
    (end, off / (ACCURATE * (here.level + BESIDE * others) * h * h))
}

/// How fast the speed dies out at most in a step: at its start, where it ends, or at rest in between.
fn fastest<const N: usize>(
    x: &[f64; N],
    (rates, here): (&[f64; N], &Stiff),
    (to, time): (f64, f64),
    told: &impl Fn(&[f64; N], f64) -> ([f64; N], Stiff),
) -> f64 {
    let v = x[here.speed];
    let end = v + time * phi(here.rate * time)[0] * rates[here.speed];
    if v * end <= 0.0 {
        here.rate_at_rest
    } else if end.abs() < v.abs() {
        let mut x = *x;
        x[here.speed] = end;
        here.rate.max(told(&x, to).1.rate)
    } else {
        here.rate
    }
}

/// phi_1 to phi_4 of `-z`, `phi_(k + 1) = (1 / k! - phi_k) / z`; z is no less than zero.
#[inline]
pub(super) fn phi(z: f64) -> [f64; 4] {
    /// Below it, the powers.
    const SMALL: f64 = 0.5;
    const FACTORS: [f64; 5] = [1.0, 1.0, 0.5, 1.0 / 6.0, 1.0 / 24.0];
    let mut phi = [0.0; 4];
    if z < SMALL {
        // The last one by its series, the others by it.
        let mut term = FACTORS[4];
        for k in 5..16 {
            phi[3] += term;
            term *= -z / f64::from(k);
        }
        for k in (0..3).rev() {
            phi[k] = FACTORS[k + 1] - z * phi[k + 1];
        }
    } else {
        phi[0] = -(-z).exp_m1() / z;
        for k in 1..4 {
            phi[k] = (FACTORS[k] - phi[k - 1]) / z;
        }
    }
    phi
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// `phi_k(-z)` is the integral of `exp(-z (1 - t)) t^(k - 1) / (k - 1)!` over t from 0 to 1; both sides of the series agree with it.
        #[test]
        fn phi_is_an_integral(z in 1e-3_f64..50.0) {
            let phi = phi(z);
            const PARTS: usize = 20_000;
            for (k, phi) in phi.iter().enumerate() {
                let power: f64 = (1..=k).map(|k| k as f64).product();
                let at = |t: f64| (-z * (1.0 - t)).exp() * t.powi(k as i32) / power;
                let step = 1.0 / PARTS as f64;
                let sum: f64 = (0..PARTS).map(|i| at((i as f64 + 0.5) * step) * step).sum();
                prop_assert!((phi - sum).abs() < 1e-6 * phi.abs(), "{k}: {phi} {sum}");
            }
        }
    }
}
