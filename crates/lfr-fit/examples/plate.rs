//! A plate with four actuators and a payload that moves over it: 4 inputs, 4 outputs, 20 states, 2 parameters.
//!
//! A thin rectangular plate of 1 by 0.8 and unit mass is simply supported, so that it has no rigid-body modes. Its ten
//! lowest modes `sin(k pi x) sin(l pi y / 0.8)` are kept: 20 flexible states. Four forces act on it, and the displacement
//! is measured where they act. A payload of 2 % of the plate's mass sits at (p1, p2), within 0.03 of (0.46, 0.35):
//!
//! `(I + m phi(p) phi(p)^T) q'' + 2 zeta Omega q' + Omega^2 q = Phi^T u`, `y = Phi q`,
//!
//! with the shapes of the modes in phi and Phi. Nothing in this is polynomial in p. The LFR is fitted to sampled
//! responses at 16 positions of the payload and judged at 49 others.
//!
//! Run: `cargo run --release -p lfr-realize --example plate`

use lfr_fit::{FrozenData, GrowSettings, LocalSettings, RefineSettings, RigidGain, grow, local_model};
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::num_complex::Complex;
use lpv_core::{Continuous, CoreError, DeltaBlock, Discrete, Frf, SchedulingRange, StateSpace};
use std::f64::consts::PI;
use std::time::Instant;

/// Half-waves along x and y of each mode, by frequency.
const MODES: [(f64, f64); 10] = [
    (1.0, 1.0),
    (2.0, 1.0),
    (1.0, 2.0),
    (2.0, 2.0),
    (3.0, 1.0),
    (1.0, 3.0),
    (3.0, 2.0),
    (4.0, 1.0),
    (2.0, 3.0),
    (4.0, 2.0),
];
const WIDTH: f64 = 0.8;
const DAMPING: f64 = 0.02;
const PAYLOAD: f64 = 0.02;
/// Where the forces act and the displacement is measured.
const ACTUATORS: [(f64, f64); 4] = [(0.13, 0.11), (0.81, 0.17), (0.27, 0.66), (0.89, 0.61)];

/// The plate with its lowest modes.
pub(crate) struct Plate {
    /// How many.
    pub(crate) modes: usize,
}

impl Plate {
    /// Values of the modes at a point, of unit modal mass.
    fn shape(&self, x: f64, y: f64) -> DVector<f64> {
        let value = |(k, l): (f64, f64)| 2.0 * (k * PI * x).sin() * (l * PI * y / WIDTH).sin();
        DVector::from_fn(self.modes, |i, _| value(MODES[i]))
    }

    /// Natural frequencies, the lowest one at 1 Hz: proportional to `k^2 + (l / 0.8)^2` for a thin plate.
    fn omega(&self) -> DVector<f64> {
        let of = |(k, l): (f64, f64)| k * k + (l / WIDTH).powi(2);
        DVector::from_fn(self.modes, |i, _| 2.0 * PI * of(MODES[i]) / of(MODES[0]))
    }

    /// With its payload at p.
    fn at(&self, p: &[f64]) -> Result<StateSpace<Continuous>, CoreError> {
        let n = self.modes;
        let (omega, phi) = (self.omega(), self.shape(p[0], p[1]));
        let forces = DMatrix::from_columns(&ACTUATORS.map(|(x, y)| self.shape(x, y)));
        // (I + m phi phi^T)^-1, by Sherman and Morrison.
        let inverse = DMatrix::identity(n, n)
            - &phi * phi.transpose() * (PAYLOAD / (1.0 + PAYLOAD * phi.norm_squared()));
        let stiffness = DMatrix::from_diagonal(&omega.map(|w| w * w));
        let damping = DMatrix::from_diagonal(&(omega * (2.0 * DAMPING)));
        let mut a = DMatrix::zeros(2 * n, 2 * n);
        a.view_mut((0, n), (n, n)).fill_diagonal(1.0);
        a.view_mut((n, 0), (n, n)).copy_from(&(-&inverse * stiffness));
        a.view_mut((n, n), (n, n)).copy_from(&(-&inverse * damping));
        let mut b = DMatrix::zeros(2 * n, 4);
        b.rows_mut(n, n).copy_from(&(inverse * &forces));
        let mut c = DMatrix::zeros(4, 2 * n);
        c.columns_mut(0, n).copy_from(&forces.transpose());
        StateSpace::new(a, b, c, DMatrix::zeros(4, 4), Continuous)
    }
}

/// What came out.
pub(crate) struct Outcome {
    /// States of the LFR.
    pub(crate) states: usize,
    /// Its deltas.
    pub(crate) deltas: usize,
    /// Rms relative error at the positions of the fit.
    pub(crate) rms: f64,
    /// Largest and median relative error of a line at positions that were not fitted, decibels.
    pub(crate) unseen_db: [f64; 2],
}

/// Responses on a grid, local model, LFR with `each` deltas a parameter, error between.
///
/// # Errors
/// Those of the library.
pub(crate) fn fit(plate: &Plate, each: usize, target: f64) -> Result<Outcome, Box<dyn std::error::Error>> {
    let highest = plate.omega().max() / (2.0 * PI);
    let clock = Discrete::from_rate(2.5 * highest)?;
    let range = SchedulingRange::new(vec![[0.43, 0.49], [0.32, 0.38]])?;
    let lines: Vec<f64> = (0..40)
        .map(|k| 1.25 * highest * (f64::from(k) + 0.5) / 40.0)
        .collect();
    let respond = |p: &[f64]| plate.at(p)?.zero_order_hold(clock)?.frequency_response(&lines);
    let on_grid = |points: usize| -> Result<Vec<(Vec<f64>, Frf)>, CoreError> {
        range
            .grid(points)
            .into_iter()
            .map(|p| Ok((p.clone(), respond(&p)?)))
            .collect()
    };
    let data = FrozenData::relative(clock, &on_grid(4)?)?;

    // The local model: poles and responses at one position near the centre.
    let near = [0.45, 0.34];
    let poles: Vec<Complex<f64>> = plate.at(&near)?.zero_order_hold(clock)?.poles()?;
    let nearest = data.subset(|p| p.iter().zip(&near).all(|(p, c)| (p - c).abs() < 1e-9))?;
    let settings = LocalSettings {
        rigid: RigidGain::Absent,
        ..LocalSettings::default()
    };
    let local = local_model(Continuous, &nearest, &poles, &settings)?;

    let deltas = [0, 1].map(|parameter| DeltaBlock {
        parameter,
        repetitions: each,
    });
    let settings = GrowSettings {
        target: Some(2.0 * target),
        start_iterations: 12,
        refine: RefineSettings {
            target,
            max_iterations: 12,
            ..RefineSettings::default()
        },
        ..GrowSettings::default()
    };
    let began = Instant::now();
    let fitted = grow(&local.flexible, None, &data, &deltas, &range, &settings)?;
    let seconds = began.elapsed().as_secs_f64();
    println!("{seconds:.1} s, {:?}", fitted.starts);
    let lfr = fitted.refined.candidate.to_lfr()?;
    let mut errors = Vec::new();
    for (p, g) in on_grid(7)?
        .iter()
        .filter(|(p, _)| data.scheduling().all(|q| q != p.as_slice()))
    {
        let own = lfr
            .frozen(p)?
            .zero_order_hold(clock)?
            .frequency_response(&lines)?;
        errors.extend(own.relative_error(g)?);
    }
    errors.sort_by(f64::total_cmp);
    Ok(Outcome {
        states: lfr.states(),
        deltas: lfr.delta_count(),
        rms: fitted.refined.account.rms,
        unseen_db: [errors.len() - 1, errors.len() / 2].map(|i| 20.0 * errors[i].log10()),
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let each = std::env::args().nth(1).map_or(Ok(4), |v| v.parse())?;
    let target = std::env::args().nth(2).map_or(Ok(2e-3), |v| v.parse())?;
    let outcome = fit(&Plate { modes: 10 }, each, target)?;
    println!(
        "{} states, {} deltas, rms {:.1e}; at positions not fitted largest {:.1} dB, median {:.1} dB",
        outcome.states, outcome.deltas, outcome.rms, outcome.unseen_db[0], outcome.unseen_db[1]
    );
    Ok(())
}
