//! What programs may ask of the allocator.

/// Keeps memory that was freed in the process, for the next array of the same size.
///
/// The allocator of the GNU C library maps every large block anew, and hands what is free at the end of its heap back to the system, so
/// that estimating one position after the other maps and clears the same pages each time; with several threads they wait for each other
/// meanwhile. Its thresholds grow to the largest block that was ever freed, up to 32 MiB (mallopt(3), `M_MMAP_THRESHOLD`). This frees one
/// such block that was never touched. It costs nothing, takes no memory, and does nothing elsewhere. For the start of a program; a library
/// should not call it.
pub fn keep_freed_memory() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(31 << 20)));
}
