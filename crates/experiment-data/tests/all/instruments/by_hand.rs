//! What the writers at hand do not write: byte by byte, with numbers over many decades.

use experiment_data::{look_into, read_columns};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use proptest::prelude::*;
use std::io::Write;
use std::path::PathBuf;
use tempfile::TempDir;

fn file(name: &str, bytes: &[u8]) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (dir, path)
}

/// Doubles of any size and sign.
fn doubles(length: std::ops::Range<usize>) -> impl Strategy<Value = Vec<f64>> {
    let number = (-300..300i32, -1.0..1.0f64).prop_map(|(e, m)| m * 10f64.powi(e));
    proptest::collection::vec(number, length)
}

/// Bytes of a number in the order of a TDMS segment.
fn ordered<const N: usize>(mut le: [u8; N], big_endian: bool) -> [u8; N] {
    if big_endian {
        le.reverse();
    }
    le
}

/// A TDMS segment of the channels `g.a` (doubles) and `g.b` (16 bits), `chunks` times after each other, `g.b` so much later, with an
/// interval of 1 ms.
fn tdms(a: &[f64], b: &[i16], chunks: usize, is_interleaved: bool, big_endian: bool, late: f64) -> Vec<u8> {
    let u32 = |v: usize| ordered((v as u32).to_le_bytes(), big_endian);
    let u64 = |v: usize| ordered((v as u64).to_le_bytes(), big_endian);
    let text = |t: &str| [&u32(t.len())[..], t.as_bytes()].concat();
    let rows = a.len() / chunks;
    let mut about = u32(2).to_vec();
    for (path, kind, start) in [("/'g'/'a'", 10, 7.0), ("/'g'/'b'", 2, 7.0 + late)] {
        about.extend(text(path));
        about.extend([u32(20), u32(kind), u32(1)].concat());
        about.extend(u64(rows));
        about.extend(u32(3));
        // A part of it by the instant of the start, in 2^-64 s.
        let part = 0.75 * (start - 7.0);
        let instant = (3_900_000_000_i128 << 64) + (part * 2.0_f64.powi(64)) as i128;
        about.extend([text("wf_start_time"), u32(0x44).to_vec()].concat());
        about.extend(ordered(instant.to_le_bytes(), big_endian));
        for (name, value) in [("wf_increment", 1e-3), ("wf_start_offset", start - part)] {
            about.extend(text(name));
            about.extend(u32(10));
            about.extend(ordered(f64::to_le_bytes(value), big_endian));
        }
    }
    let mut raw = Vec::new();
    for chunk in 0..chunks {
        let own = chunk * rows..(chunk + 1) * rows;
        let a = a[own.clone()]
            .iter()
            .map(|v| ordered(v.to_le_bytes(), big_endian).to_vec());
        let b = b[own]
            .iter()
            .map(|v| ordered(v.to_le_bytes(), big_endian).to_vec());
        if is_interleaved {
            raw.extend(a.zip(b).flat_map(|(a, b)| [a, b].concat()));
        } else {
            raw.extend(a.flatten().chain(b.flatten()));
        }
    }
    let toc = 0b1110 | u32::from(is_interleaved) << 5 | u32::from(big_endian) << 6;
    let mut file = b"TDSm".to_vec();
    file.extend(toc.to_le_bytes());
    file.extend(u32(4713));
    file.extend([u64(about.len() + raw.len()), u64(about.len())].concat());
    file.extend(about);
    file.extend(raw);
    file
}

/// Blocks of an MDF file behind each other.
struct Mdf(Vec<u8>);

impl Mdf {
    fn begin() -> Self {
        let mut file = b"MDF     4.10    test    ".to_vec();
        file.resize(64, 0);
        let mut file = Self(file);
        file.block("HD", &[0; 6], &[0; 32]);
        file
    }
    /// Adds a block; where it is.
    fn block(&mut self, id: &str, links: &[u64], data: &[u8]) -> u64 {
        self.0.resize(self.0.len().next_multiple_of(8), 0);
        let at = self.0.len() as u64;
        self.0.extend(format!("##{id}\0\0\0\0").bytes());
        self.0
            .extend((24 + 8 * links.len() as u64 + data.len() as u64).to_le_bytes());
        self.0.extend((links.len() as u64).to_le_bytes());
        self.0.extend(links.iter().flat_map(|l| l.to_le_bytes()));
        self.0.extend(data);
        at
    }
    /// A channel of the kind of number with its first bit, byte, and number of bits; `more` has its conversion, and the bit behind
    /// the data that tells that it is invalid.
    fn channel(
        &mut self,
        next: u64,
        name: &str,
        (kind, bit): (u8, u8),
        [byte, bits]: [u32; 2],
        more: (u64, Option<u32>),
    ) -> u64 {
        let name = self.block("TX", &[], format!("{name}\0").as_bytes());
        let mut data = vec![0, 0, kind, bit];
        for v in [byte, bits, more.1.map_or(0, |_| 2), more.1.unwrap_or(0)] {
            data.extend(v.to_le_bytes());
        }
        data.resize(72, 0);
        self.block("CN", &[next, 0, name, 0, more.0, 0, 0, 0], &data)
    }
    fn group(
        &mut self,
        next: u64,
        first: u64,
        id: u64,
        rows: usize,
        data_bytes: u32,
        invalid_bytes: u32,
    ) -> u64 {
        let mut data = [id.to_le_bytes(), (rows as u64).to_le_bytes()].concat();
        data.extend([0; 8]);
        data.extend(data_bytes.to_le_bytes());
        data.extend(invalid_bytes.to_le_bytes());
        self.block("CG", &[next, first, 0, 0, 0, 0], &data)
    }
    /// Links the first block to the storage.
    fn finish(mut self, first_group: u64, id_bytes: u8, values: u64) -> Vec<u8> {
        let storage = self.block(
            "DG",
            &[0, first_group, values, 0],
            &[id_bytes, 0, 0, 0, 0, 0, 0, 0],
        );
        self.0[88..96].copy_from_slice(&storage.to_le_bytes());
        self.0
    }
    fn packed(&mut self, plain: &[u8], columns: Option<usize>) -> u64 {
        let mut turned = plain.to_vec();
        if let Some(columns) = columns {
            let rows = plain.len() / columns;
            for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
                turned[column * rows + row] = plain[row * columns + column];
            }
        }
        let mut packer = ZlibEncoder::new(Vec::new(), Compression::default());
        packer.write_all(&turned).unwrap();
        let packed = packer.finish().unwrap();
        let mut data = b"DT".to_vec();
        data.extend([u8::from(columns.is_some()), 0]);
        data.extend((columns.unwrap_or(0) as u32).to_le_bytes());
        data.extend((plain.len() as u64).to_le_bytes());
        data.extend((packed.len() as u64).to_le_bytes());
        data.extend(packed);
        self.block("DZ", &[], &data)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn tdms_of_both_orders(
        rows in 1usize..40, chunks in 1usize..4, seed in doubles(160..161), is_interleaved: bool, big_endian: bool,
        late in prop_oneof![Just(0.0), Just(1e-6), 3e-5..3.0f64, -3.0..-3e-5f64],
    ) {
        let a = &seed[..rows * chunks];
        let b: Vec<i16> = (0..a.len()).map(|k| (k as i16).wrapping_mul(7919)).collect();
        let (_dir, path) = file("a.tdms", &tdms(a, &b, chunks, is_interleaved, big_endian, late));
        let contents = look_into(&path).unwrap();
        let is_late = contents.passed_over.iter().any(|p| p.name == "b" && p.what.contains("after `a`"));
        prop_assert_eq!(is_late, late.abs() > 2e-5);
        prop_assert_eq!(contents.columns.len(), if is_late { 1 } else { 2 });
        let found = read_columns(&path, &["a", "g.b"]).unwrap();
        prop_assert_eq!(&found[0], a);
        prop_assert_eq!(&found[1], &b.iter().map(|v| f64::from(*v)).collect::<Vec<_>>());
    }

    #[test]
    fn mdf_in_lists_of_packed_blocks(values in doubles(1..200), cut in 1usize..300, transposed: bool) {
        let mut mdf = Mdf::begin();
        let small = |k: usize| (k % 8) as u8;
        let plain: Vec<u8> = values
            .iter()
            .enumerate()
            .flat_map(|(k, v)| [&v.to_be_bytes()[..], &[small(k) << 2 | 1, u8::from(k % 3 == 1) << 5]].concat())
            .collect();
        // Blocks need not end where records end.
        let parts: Vec<u64> = plain
            .chunks(cut)
            .enumerate()
            .map(|(k, part)| match k % 2 {
                0 => mdf.packed(part, transposed.then_some(10)),
                _ => mdf.block("DT", &[], part),
            })
            .collect();
        let (first, rest) = parts.split_at(parts.len() / 2);
        let second = mdf.block("DL", &[&[0], rest].concat(), &[0; 8]);
        let list = mdf.block("DL", &[&[second], first].concat(), &[0; 8]);
        let head = mdf.block("HL", &[list], &[0; 8]);
        let mut rational = vec![2, 0, 0, 0, 0, 0, 6, 0];
        rational.resize(24, 0);
        // (3 x + 1) / 2
        rational.extend([0.0, 3.0, 1.0, 0.0, 0.0, 2.0].iter().flat_map(|v: &f64| v.to_le_bytes()));
        let rational = mdf.block("CC", &[0; 4], &rational);
        let bits = mdf.channel(0, "bits", (2, 2), [8, 3], (0, Some(5)));
        let half = mdf.channel(bits, "converted", (0, 2), [8, 3], (rational, None));
        let first = mdf.channel(half, "big", (5, 0), [0, 64], (0, None));
        let group = mdf.group(0, first, 0, values.len(), 9, 1);
        let (_dir, path) = file("a.mf4", &mdf.finish(group, 0, head));
        let found = read_columns(&path, &["big", "bits", "converted"]).unwrap();
        prop_assert_eq!(&found[0], &values);
        for (k, v) in found[1].iter().enumerate() {
            let raw = f64::from(small(k));
            // Three bits with a sign.
            let signed = if raw > 3.0 { raw - 8.0 } else { raw };
            prop_assert!(if k % 3 == 1 { v.is_nan() } else { *v == signed }, "{} {}", k, v);
            prop_assert_eq!(found[2][k], (3.0 * raw + 1.0) / 2.0);
        }
    }

    #[test]
    fn mdf_of_mixed_groups(values in doubles(1..100), order in proptest::collection::vec(0u8..3, 100)) {
        let mut mdf = Mdf::begin();
        let (mut records, mut a, mut b) = (Vec::new(), Vec::new(), Vec::new());
        for (v, kind) in values.iter().zip(&order) {
            records.push(*kind);
            match kind {
                0 => {
                    a.push(*v);
                    records.extend(v.to_le_bytes());
                }
                1 => {
                    b.push(f64::from(*v as f32));
                    records.extend((*v as f32).to_le_bytes());
                }
                // A text of its own length.
                _ => records.extend([3, 0, 0, 0, b'a', b'b', 0]),
            }
        }
        let values = mdf.block("DT", &[], &records);
        let first = mdf.channel(0, "a", (4, 0), [0, 64], (0, None));
        let second = mdf.channel(0, "b", (4, 0), [0, 32], (0, None));
        let mut variable = [2u64.to_le_bytes(), [0; 8]].concat();
        variable.extend([1, 0, 0, 0, 0, 0, 0, 0]);
        variable.resize(32, 0);
        let variable = mdf.block("CG", &[0; 6], &variable);
        let other = mdf.group(variable, second, 1, b.len(), 4, 0);
        let group = mdf.group(other, first, 0, a.len(), 8, 0);
        let (_dir, path) = file("a.mf4", &mdf.finish(group, 1, values));
        let found = read_columns(&path, &["b", "a"]).unwrap();
        prop_assert_eq!(&found[0], &b);
        prop_assert_eq!(&found[1], &a);
    }

    #[test]
    fn universal_files_of_all_kinds(
        values in doubles(1..50), is_double: bool, is_uneven: bool, big_endian: bool, ends_with_line: bool,
    ) {
        let kind = if is_double { 4 } else { 2 };
        let (count, spacing) = (values.len(), u8::from(!is_uneven));
        let bytes = |v: f64, double: bool| match double {
            true => ordered(v.to_le_bytes(), big_endian).to_vec(),
            false => ordered((v as f32).to_le_bytes(), big_endian).to_vec(),
        };
        let mut text = format!("    -1\n    58b{:6}{:6}{:12}{:12}{:6}{:6}{:12}{:12}\n", 1 + u8::from(big_endian), 2, 11, 0, 0, 0, 0, 0);
        text += &"NONE\n".repeat(5);
        text += "    1         0    1         0 shaker             4  -2       NONE         1   3\n";
        text += &format!("{kind:10}{count:10}{spacing:10}{:13.5}{:13.5}{:13.5}\n", 0.0, 0.25, 0.0);
        text += "        17    0    0    0 Time                 s\n        12    0    0    0 NONE                 m/s^2\n";
        text += "         0    0    0    0 NONE                 NONE\n         0    0    0    0 NONE                 NONE\n";
        let mut all = text.into_bytes();
        for (k, v) in values.iter().enumerate() {
            if is_uneven {
                all.extend(bytes(k as f64, false));
            }
            all.extend(bytes(*v, is_double));
        }
        all.extend(if ends_with_line { &b"\n    -1\n"[..] } else { b"    -1\n" });
        let (_dir, path) = file("a.unv", &all);
        let name = "acceleration shaker:4-Y";
        let found = read_columns(&path, &[name]).unwrap();
        let wanted: Vec<f64> = values.iter().map(|v| if is_double { *v } else { f64::from(*v as f32) }).collect();
        prop_assert_eq!(&found[0], &wanted);
        let contents = look_into(&path).unwrap();
        prop_assert_eq!(contents.scalars.is_empty(), is_uneven);
        prop_assert_eq!(contents.columns.last().unwrap().unit.as_str(), "m/s^2");
    }
}
