//! The allocator is one of the whole process: a test program of its own.
#![cfg(all(target_os = "linux", target_env = "gnu"))]
#![allow(clippy::unwrap_used)]

/// Pages mapped so far, proc_pid_stat(5).
fn faults() -> u64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    // The name of the program may hold blanks; it ends with the last bracket, and eight fields follow before this one, the tenth.
    let (_, fields) = stat.rsplit_once(") ").unwrap();
    fields.split(' ').nth(7).unwrap().parse().unwrap()
}

#[test]
fn freed_memory_serves_again() {
    const PAGES: u64 = 2048;
    // Together more than what the allocator keeps by itself after the first of them.
    let fill = || {
        drop(std::hint::black_box(
            [0; 3].map(|_| vec![1_u8; 4096 * PAGES as usize]),
        ))
    };
    let mapped = |count: usize| {
        let before = faults();
        (0..count).for_each(|_| fill());
        faults() - before
    };
    lpv_core::keep_freed_memory();
    let (first, later) = (mapped(1), mapped(10));
    // Whatever the size of a page.
    assert!(
        later < first,
        "{first} pages mapped by the first arrays, {later} by ten later ones"
    );
}
