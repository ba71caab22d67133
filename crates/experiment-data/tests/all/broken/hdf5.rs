//! Checksums of HDF5 files that a test has changed.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

/// Writes the checksum of every object header anew, so that a change is met behind it.
pub fn reseal(file: &mut [u8]) {
    let starts: Vec<usize> = (0..file.len().saturating_sub(16))
        .filter(|&at| &file[at..at + 4] == b"OHDR")
        .collect();
    for start in starts {
        let flags = file[start + 5];
        let mut at = start + 6;
        at += if flags & 0x20 == 0 { 0 } else { 16 };
        at += if flags & 0x10 == 0 { 0 } else { 4 };
        let width = 1 << (flags & 3);
        let Some(size) = file.get(at..at + width) else {
            continue;
        };
        let size = size
            .iter()
            .rev()
            .fold(0usize, |sum, b| sum << 8 | usize::from(*b));
        let Some(end) = at.checked_add(width).and_then(|at| at.checked_add(size)) else {
            continue;
        };
        if end.checked_add(4).is_some_and(|last| last <= file.len()) {
            let sum = lookup3(&file[start..end]);
            file[end..end + 4].copy_from_slice(&sum.to_le_bytes());
        }
    }
}

/// Bob Jenkins' lookup3 with the start value 0, as HDF5 uses it.
fn lookup3(data: &[u8]) -> u32 {
    let start = 0xdead_beef_u32.wrapping_add(data.len() as u32);
    let (mut a, mut b, mut c) = (start, start, start);
    let word = |part: &[u8], k: usize| {
        let bytes: [u8; 4] = std::array::from_fn(|i| part.get(4 * k + i).copied().unwrap_or(0));
        u32::from_le_bytes(bytes)
    };
    let blocks = data.len().saturating_sub(1) / 12;
    for part in data.chunks(12).take(blocks) {
        a = a.wrapping_add(word(part, 0));
        b = b.wrapping_add(word(part, 1));
        c = c.wrapping_add(word(part, 2));
        for (turn, order) in [(4, 0), (6, 1), (8, 2), (16, 0), (19, 1), (4, 2)] {
            let (x, y, z) = match order {
                0 => (&mut a, &mut c, b),
                1 => (&mut b, &mut a, c),
                _ => (&mut c, &mut b, a),
            };
            *x = x.wrapping_sub(*y) ^ y.rotate_left(turn);
            *y = y.wrapping_add(z);
        }
    }
    let rest = &data[12 * blocks..];
    if rest.is_empty() {
        return c;
    }
    a = a.wrapping_add(word(rest, 0));
    b = b.wrapping_add(word(rest, 1));
    c = c.wrapping_add(word(rest, 2));
    for (x, y, turn) in [
        (2, 1, 14),
        (0, 2, 11),
        (1, 0, 25),
        (2, 1, 16),
        (0, 2, 4),
        (1, 0, 14),
        (2, 1, 24),
    ] {
        let mut all = [a, b, c];
        all[x] = (all[x] ^ all[y]).wrapping_sub(u32::rotate_left(all[y], turn));
        [a, b, c] = all;
    }
    c
}
