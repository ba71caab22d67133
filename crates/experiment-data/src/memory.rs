//! How much memory the columns of a record may take, asked before it is taken.
//!
//! A column is 8 bytes a number in memory, whatever it was in the file: a packed column of one-byte integers grows by a
//! factor of up to 8 * 1032. Two limits hold for what is in memory of one file at a time:
//!
//! - 64 times the size of the file (of the files that stay in memory together), or 64 MiB where that is more. Measured data pack by far less; what unpacks to more is
//!   damaged or made to fill memory. A file without compression never meets this limit.
//! - Half of the memory that is free, where the system tells how much that is: the work on a record needs as much again.

use crate::RecordError;

/// Bytes that any file may fill.
pub(crate) const FREELY: u64 = 64 << 20;
/// Bytes in memory a byte of file.
pub(crate) const MOST_A_BYTE: u64 = 64;
/// Bytes of a number in memory.
const NUMBER: u64 = 8;

/// What the columns of one file have taken so far.
#[derive(Debug)]
pub(crate) struct Allowance {
    file_bytes: u64,
    taken: u64,
    /// Looked up once, when it first matters.
    free: Option<Option<u64>>,
}

impl Allowance {
    /// For a file of this size in bytes.
    pub(crate) fn new(file_bytes: u64) -> Self {
        Self {
            file_bytes,
            taken: 0,
            free: None,
        }
    }

    /// Another file, beside those before it.
    pub(crate) fn grow(&mut self, file_bytes: u64) {
        self.file_bytes = self.file_bytes.saturating_add(file_bytes);
    }

    /// Asks for a column of so many numbers, beside those before it.
    ///
    /// # Errors
    /// [`RecordError::Unpacks`], [`RecordError::Memory`].
    pub(crate) fn take(&mut self, column: &str, numbers: u64) -> Result<(), RecordError> {
        self.taken = self.taken.saturating_add(numbers.saturating_mul(NUMBER));
        if self.taken <= FREELY {
            return Ok(());
        }
        let most = self.file_bytes.saturating_mul(MOST_A_BYTE).max(FREELY);
        if self.taken > most {
            return Err(RecordError::Unpacks {
                column: column.to_owned(),
                numbers,
                bytes: self.taken,
                file_bytes: self.file_bytes,
                most,
            });
        }
        match *self.free.get_or_insert_with(free_memory) {
            Some(free) if self.taken > free / 2 => Err(RecordError::Memory {
                column: column.to_owned(),
                numbers,
                bytes: self.taken,
                free,
            }),
            _ => Ok(()),
        }
    }
}

/// Bytes that this process may still take, where the system tells: free memory of the machine, and what the limits of the
/// container and of the address space leave.
fn free_memory() -> Option<u64> {
    let read = |file: &str| std::fs::read_to_string(file).unwrap_or_default();
    let status = read("/proc/self/status");
    let less =
        |limit: Option<u64>, used: &str| Some(limit?.saturating_sub(kilobytes(&status, used).unwrap_or(0)));
    let container = [
        "/sys/fs/cgroup/memory.max",
        "/sys/fs/cgroup/memory/memory.limit_in_bytes",
    ];
    let container = container.iter().find_map(|file| read(file).trim().parse().ok());
    [
        kilobytes(&read("/proc/meminfo"), "MemAvailable"),
        less(container, "VmRSS"),
        less(address_space(&read("/proc/self/limits")), "VmSize"),
    ]
    .into_iter()
    .flatten()
    .min()
}

/// A line such as `MemAvailable:   123 kB`, in bytes.
fn kilobytes(text: &str, key: &str) -> Option<u64> {
    let value = text
        .lines()
        .find_map(|line| line.strip_prefix(key)?.strip_prefix(':'))?;
    let value: u64 = value.trim().strip_suffix("kB")?.trim().parse().ok()?;
    value.checked_mul(1024)
}

/// The soft limit of the address space, in bytes; none where there is no limit.
fn address_space(limits: &str) -> Option<u64> {
    let line = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::size::size_text;

    #[test]
    fn a_file_without_compression_meets_no_limit_of_its_size() {
        let mut allowance = Allowance::new(1 << 40);
        allowance.free = Some(None);
        for _ in 0..8 {
            allowance.take("u", 1 << 37).unwrap();
        }
        // One byte a number, stored as it is.
        let mut bytes = Allowance::new(1 << 30);
        bytes.free = Some(None);
        bytes.take("u", 1 << 30).unwrap();
    }

    #[test]
    fn the_sum_of_the_columns_counts() {
        // Two columns of 4 Mi numbers fill the 64 MiB that any file may fill; one number more is too much.
        let mut allowance = Allowance::new(1000);
        allowance.take("a", 1 << 22).unwrap();
        allowance.take("b", 1 << 22).unwrap();
        let error = allowance.take("c", 1).unwrap_err();
        assert!(
            matches!(&error, RecordError::Unpacks { column, bytes, most, .. }
                if column == "c" && *bytes == (64 << 20) + 8 && *most == 64 << 20),
            "{error}"
        );
        // Claims whose product overflows are too much as well.
        assert!(Allowance::new(u64::MAX).take("c", u64::MAX).is_err() || cfg!(not(target_os = "linux")));
        assert!(Allowance::new(10).take("c", u64::MAX).is_err());
    }

    #[test]
    fn half_of_what_is_free_may_be_taken() {
        let mut allowance = Allowance::new(1 << 40);
        allowance.free = Some(Some(1 << 30));
        allowance.take("u", 1 << 26).unwrap();
        let error = allowance.take("y", 1).unwrap_err();
        assert!(
            matches!(&error, RecordError::Memory { column, .. } if column == "y"),
            "{error}"
        );
    }

    #[test]
    fn what_the_system_says_is_read() {
        let text = "MemTotal:       100 kB\nMemAvailable:    24 kB\n";
        assert_eq!(kilobytes(text, "MemAvailable"), Some(24 * 1024));
        assert_eq!(kilobytes(text, "Mem"), None);
        assert_eq!(kilobytes("MemAvailable: x kB", "MemAvailable"), None);
        let limits = "Limit  Soft  Hard  Units\nMax address space         1048576   unlimited  bytes\n";
        assert_eq!(address_space(limits), Some(1_048_576));
        assert_eq!(
            address_space("Max address space  unlimited  unlimited  bytes"),
            None
        );
        if cfg!(target_os = "linux") {
            assert!(free_memory().is_some_and(|free| free > 0));
        }
    }

    #[test]
    fn sizes_as_people_write_them() {
        let cases = [
            (999, "999 bytes"),
            (1000, "1.0 kB"),
            (130_854, "131 kB"),
            (999_499, "999 kB"),
            (999_500, "1.0 MB"),
            (1 << 30, "1.1 GB"),
        ];
        for (bytes, text) in cases {
            assert_eq!(size_text(bytes), text);
        }
    }
}
