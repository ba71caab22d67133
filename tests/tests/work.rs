//! How much work there is: transforms, factorisations, bytes read. Counts do not depend on the machine that counts.
// Helpers of tests fail the test when something is wrong, as the tests themselves do.
#![allow(clippy::unwrap_used, clippy::panic)]

use experiment_data::{Bundle, RecordFormat};
use frf_estimation::{Layout, PeriodicAccumulator, PeriodicEstimate, PeriodicSettings, SkipRule};
use lpv::simulate::{MachineFile, simulate};
use lpv::{estimate_bundle, silent};
use lpv_core::{Discrete, PeriodBlock};
use lpv_ident::{RegressionSettings, RigidTerm, regress};
use obf_basis::{OrthonormalBasis, PoleSet};
use pole_fit::{Integrators, NumeratorDegree, PoleFitSettings, fit};
use xytable_plant::{
    ControllerSettings, Experiment, ExperimentSettings, Machine, MachineParameters, MultisineSettings,
    PlantError, VerifiedController,
};

const SKIPPED: usize = 2;

fn clock() -> Discrete {
    Discrete::from_rate(20.0).unwrap()
}

fn machine() -> Machine {
    MachineParameters::default().check().unwrap()
}

/// The response of the default machine at a position, from two experiments with so many periods.
fn estimate(position: f64, period: usize, periods: usize) -> PeriodicEstimate {
    let (machine, clock) = (machine(), clock());
    let controller = VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock).unwrap();
    let multisine = MultisineSettings {
        period,
        ..MultisineSettings::default()
    };
    let multisine = multisine.check().unwrap();
    let settings = ExperimentSettings {
        periods,
        seed: 5,
        ..ExperimentSettings::default()
    };
    let experiment = Experiment::new(&machine, &controller, &multisine, position, settings).unwrap();
    let layout = Layout {
        period,
        outputs: 2,
        inputs: 2,
        references: 2,
        experiments: 2,
        sample_rate_hz: 20.0,
    };
    let rule = PeriodicSettings {
        skip: SkipRule::Fixed(SKIPPED),
        ..PeriodicSettings::default()
    };
    let mut sums = PeriodicAccumulator::new(layout, &rule, Some(position.into())).unwrap();
    let mut push = |block: PeriodBlock<'_>| -> Result<(), PlantError> {
        sums.push(&block).unwrap();
        Ok(())
    };
    experiment.run(&mut push).unwrap();
    sums.finish().unwrap()
}

#[test]
fn a_signal_is_transformed_once_a_period_and_a_reference_once_an_experiment() {
    for periods in [6, 12] {
        let found = estimate(0.1, 512, periods);
        assert_eq!(found.transforms, 2 * (4 * (periods - SKIPPED) + 2));
    }
}

#[test]
fn factorisations_do_not_grow_with_the_lines() {
    let counts = [1024, 4096].map(|period| {
        let all = [-0.1, 0.0, 0.1].map(|p| estimate(p, period, 8).estimate);
        let settings = PoleFitSettings {
            integrators: Integrators::Fixed(2),
            numerator: NumeratorDegree::StrictlyProper,
            ..PoleFitSettings::new(6)
        };
        let poles = fit(&all[0], clock(), &settings).unwrap();
        let set = PoleSet::new(&machine().sampled_flexible_poles(0.0, clock()).unwrap()).unwrap();
        let basis = OrthonormalBasis::takenaka_malmquist(&set, clock()).unwrap();
        let settings = RegressionSettings {
            rigid_body: RigidTerm::diagonal(2),
            ..RegressionSettings::default()
        };
        let local = regress(&all, basis.state_space(), &settings).unwrap();
        let most = local.fits().iter().map(|f| f.factorisations).max();
        (poles.account.factorisations, most.unwrap())
    });
    let [(few, _), (many, _)] = counts;
    assert!(many <= few + 1 && few <= 8, "{few} and {many} for the poles");
    // One of the sums of products; reflections would take one a block of lines.
    assert!(counts.iter().all(|(_, of_a_position)| *of_a_position == 1));
}

/// Bytes that this process has asked files for; none where the system does not tell.
fn bytes_read() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/io").ok()?;
    text.lines().find_map(|l| l.strip_prefix("rchar: "))?.parse().ok()
}

/// Bytes of the periodic records of a simulated bundle, and those that are read for the responses at its positions.
fn bytes_for_responses(positions: usize, period: usize, periods: usize) -> Option<[u64; 2]> {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("bundle");
    let file = toml::from_str::<MachineFile>(&format!(
        "positions = {{ count = {positions} }}\nmultisine = {{ period = {period}, periods = {periods} }}\n\
         moves = {{ estimation = 0, validation = 1 }}\nsetpoints = {{ samples = 400 }}\n"
    ));
    simulate(&file.unwrap(), &[], &out, RecordFormat::Npz, &|_, _| ()).unwrap();
    let bundle = Bundle::open(&out).unwrap();
    let entries = bundle.description().records.iter();
    let periodic = entries.filter(|r| r.is_periodic());
    let size: u64 = periodic
        .map(|r| out.join(&r.file).metadata().unwrap().len())
        .sum();
    let before = bytes_read()?;
    let found = estimate_bundle(&bundle, None, &silent).unwrap();
    let read = bytes_read()? - before;
    assert_eq!(found.estimates.len(), positions);
    Some([size, read])
}

/// The other tests here read no files.
#[test]
fn the_records_of_a_bundle_are_read_once_for_their_responses_and_large_ones_three_times() {
    // Records above 64 MiB at a position are not kept in memory.
    for (case, times) in [((3, 2048, 8), 1), ((2, 1 << 15, 20), 3)] {
        let (positions, period, periods) = case;
        let Some([size, read]) = bytes_for_responses(positions, period, periods) else {
            println!("skipped: this system does not count the bytes that are read");
            return;
        };
        // One of seven columns is read before, for the position.
        let least = times * size;
        assert!(
            least <= read && 4 * read < 4 * least + size,
            "{read} bytes of {size}, {times} times"
        );
    }
}
