//! How many pieces of work run at a time: as many as there are threads and as memory holds, so that it grows neither with the
//! bundle nor with the machine.

use super::{Job, MachineFile};

/// Memory of the jobs that run at a time, bytes; a job alone may take a little more.
const BATCH: usize = 1 << 29;
/// Bytes of a sample in the two records of a position: 2 outputs, 2 inputs, 2 references, p and a second signal.
const GRID_SAMPLE: usize = 2 * 8 * 8;
/// Bytes of a sample of a move: its setpoints, two runs of the integration, the record.
const MOVED_SAMPLE: usize = 320;

/// How many of the first jobs run together, at least one.
pub(super) fn size(jobs: &[Job], file: &MachineFile) -> usize {
    let mut bytes = 0;
    let fitting = jobs.iter().take(rayon::current_num_threads()).take_while(|job| {
        bytes += match job {
            Job::Grid { .. } => file.multisine.period * file.multisine.periods * GRID_SAMPLE,
            Job::Move { .. } => file.setpoints.samples * MOVED_SAMPLE,
        };
        bytes <= BATCH
    });
    fitting.count().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Jobs of so many samples a record that run together, of four, on as many threads.
    fn together(samples: usize) -> usize {
        let file = MachineFile {
            multisine: super::super::MultisineFile {
                period: samples / 2,
                periods: 2,
                ..Default::default()
            },
            ..MachineFile::default()
        };
        let jobs: Vec<Job> = (0..4).map(|index| Job::Grid { index, position: 0.0 }).collect();
        let threads = rayon::ThreadPoolBuilder::new().num_threads(4).build();
        threads.unwrap().install(|| size(&jobs, &file))
    }

    #[test]
    fn memory_bounds_the_jobs_at_a_time() {
        // 128 bytes a sample, 512 MiB in all: 4 Mi samples.
        assert_eq!(together(1 << 10), 4);
        assert_eq!(together(1 << 20), 4);
        assert_eq!(together((1 << 20) + 2), 3);
        assert_eq!(together(1 << 21), 2);
        assert_eq!(together(1 << 22), 1);
    }
}
