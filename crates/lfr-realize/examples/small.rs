//! The xy-table as a small LFR: responses at 21 positions, poles at the middle one, and nothing else.
//!
//! For 3 to 6 deltas that reach the states alone or the outputs too: largest and median relative error over 81 positions,
//! starts, iterations and time.

use lfr_realize::{DeltaReach, FrozenData, GrowSettings, LocalSettings, RefineSettings, grow, local_model};
use lpv_core::{Continuous, DeltaBlock, Discrete, Frf};
use std::time::Instant;
use xytable_plant::{Machine, MachineParameters};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let machine = MachineParameters::default().check()?;
    let clock = Discrete::from_rate(20.0)?;
    let lines: Vec<f64> = (0..160).map(|k| (f64::from(k) + 0.5) / 16.0).collect();
    let data = FrozenData::relative(clock, &responses(&machine, clock, 21, &lines)?)?;
    let truth = responses(&machine, clock, 81, &lines)?;

    let began = Instant::now();
    let centre = data.subset(|p| p[0] == 0.0)?;
    let poles = machine.sampled_flexible_poles(0.0, clock)?;
    let local = local_model(Continuous, &centre, &poles, &LocalSettings::new().check()?)?;
    println!(
        "local model: {} flexible states, rms {:.1e}, {:.0} ms",
        local.flexible.states(),
        local.account.rms,
        1e3 * began.elapsed().as_secs_f64()
    );
    let refine = RefineSettings::new().target(1e-5);
    let (flexible, gamma) = (&local.flexible, local.gamma.as_ref());
    println!("states deltas reach     largest    median starts iterations    time");
    for (repetitions, reach) in (3..=6).flat_map(|n| [(n, DeltaReach::States), (n, DeltaReach::Outputs)]) {
        let settings = GrowSettings::new().refine(refine).reach(reach).check()?;
        let deltas = [DeltaBlock {
            parameter: 0,
            repetitions,
        }];
        let began = Instant::now();
        let grown = grow(
            flexible,
            gamma,
            &data,
            &deltas,
            &machine.scheduling_range()?,
            &settings,
        )?;
        let time = began.elapsed();
        let lfr = grown.refined.candidate.to_lfr()?;
        let mut errors = Vec::new();
        for (p, g) in &truth {
            let frozen = lfr.frozen(p)?.zero_order_hold(clock)?;
            errors.extend(frozen.frequency_response(&lines)?.relative_error(g)?);
        }
        errors.sort_by(f64::total_cmp);
        let decibel = |e: f64| 20.0 * e.log10();
        println!(
            "{:6} {:6} {:8} {:6.1} dB {:6.1} dB {:6} {:10} {:4.0} ms",
            lfr.states(),
            lfr.delta_count(),
            format!("{reach:?}"),
            decibel(errors[errors.len() - 1]),
            decibel(errors[errors.len() / 2]),
            grown.starts.len(),
            grown.starts.iter().map(|s| s.iterations).sum::<usize>(),
            1e3 * time.as_secs_f64()
        );
    }
    Ok(())
}

type Responses = Vec<(Vec<f64>, Frf)>;

fn responses(
    machine: &Machine,
    clock: Discrete,
    count: usize,
    lines: &[f64],
) -> Result<Responses, Box<dyn std::error::Error>> {
    let at = |p: f64| Ok((vec![p], machine.sampled(p, clock)?.frequency_response(lines)?));
    machine.positions(count).into_iter().map(at).collect()
}
