//! Small files that ask for the whole machine.

use super::{Draw, Judged, Lab, TaskError, Watch};
use flate2::Compression;
use flate2::write::DeflateEncoder;
use hdf5_pure::mat::{Compression as Packing, MatBuilder, Options};
use std::fmt::Write as _;
use std::fs;
use std::io::Write;
use std::process::Command;

/// A file of version 7.3 with four bytes of its structure changed.
pub(super) fn damaged_mat_73(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut options = Options::default();
    options.compression = Packing::Deflate {
        level: 4,
        shuffle: draw.chance(0.5),
    };
    options.libver = hdf5_pure::LibVer::V110;
    let mut file = MatBuilder::new(options);
    let count = draw.integer(500, 2000);
    for name in ["y", "u"] {
        file.write_f64(name, &[count, 1], &draw.noise(1.0, count))?;
    }
    let whole = file.finish()?;
    fs::create_dir_all(lab.path("b"))?;
    fs::write(
        lab.path("b/experiment.toml"),
        "format = 1\nname = \"n\"\nsample_rate = 50.0\n[channels.output]\ncolumns = [\"y\"]\n[channels.input]\ncolumns = [\"u\"]\n[[records]]\nfile = \"x.mat\"\nkind = \"transient\"\nuse = \"estimation\"\n",
    )?;
    // What is not a sample is structure.
    let structure: Vec<usize> = (512..whole.len() - 4)
        .filter(|i| whole[*i..*i + 4].iter().all(|b| *b < 32) && whole[*i] > 0)
        .collect();
    let mut watch = Watch::new("refused or read, in at most 1 GiB and 5 s");
    for _ in 0..12 {
        let mut damaged = whole.clone();
        let at = structure
            .get(draw.integer(0, structure.len().max(1) - 1))
            .copied()
            .unwrap_or(600);
        damaged[at..at + 4].copy_from_slice(
            &draw
                .pick([0xffff_ffff_u32, 0x4000_0000, 0x00ff_ffff, 0x1000_0000])
                .to_le_bytes(),
        );
        fs::write(lab.path("b/x.mat"), damaged)?;
        let seconds = watch.run(lab, &["inspect", "b"])?.seconds;
        watch.check(seconds < 5.0, &format!("{seconds:.1} s for four bytes at {at}"));
    }
    Ok(watch.judged())
}

/// A model of one state over many parameters.
pub(super) fn lfr_many_parameters(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let parameters = draw.integer(5, 20);
    let range = vec!["[-1, 1]"; parameters].join(", ");
    let model = format!(
        "{{\"format\": \"lpv-model\", \"version\": 1, \"kind\": \"discrete-lfr\", \"model\": {{\"sample_time\": {}, \"range\": [{range}], \"deltas\": [], \"a\": {{\"shape\": [1, 1], \"rows\": [[0.5]]}}, \"b1\": {{\"shape\": [1, 0], \"rows\": [[]]}}, \"b2\": {{\"shape\": [1, 1], \"rows\": [[1.0]]}}, \"c1\": {{\"shape\": [0, 1], \"rows\": []}}, \"d11\": {{\"shape\": [0, 0], \"rows\": []}}, \"d12\": {{\"shape\": [0, 1], \"rows\": []}}, \"c2\": {{\"shape\": [1, 1], \"rows\": [[1.0]]}}, \"d21\": {{\"shape\": [1, 0], \"rows\": [[]]}}, \"d22\": {{\"shape\": [1, 1], \"rows\": [[0.0]]}}}}}}",
        draw.decades(1e-5, 1e2)
    );
    fs::write(lab.path("model.json"), model)?;
    let mut watch = Watch::new("converted or refused, in at most 1 GiB");
    for target in ["csv", "mat", "python"] {
        let seconds = watch
            .run(
                lab,
                &[
                    "convert",
                    "model.json",
                    "--to",
                    target,
                    "-o",
                    &format!("out.{target}"),
                ],
            )?
            .seconds;
        watch.check(seconds < 20.0, &format!("{seconds:.0} s"));
    }
    Ok(watch.judged())
}

/// Many records, many columns: times that grow with the count, not with its square.
pub(super) fn quadratic_names(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let records = 10_000;
    let mut text = "format = 1\nname = \"n\"\nsample_rate = 50.0\n[channels.output]\ncolumns = [\"y\"]\n[channels.input]\ncolumns = [\"u\"]\n".to_owned();
    for i in 0..records {
        let _ = write!(
            text,
            "[[records]]\nfile = \"q{i}.csv\"\nkind = \"transient\"\nuse = \"estimation\"\n"
        );
    }
    fs::create_dir_all(lab.path("a"))?;
    fs::write(lab.path("a/experiment.toml"), text)?;
    fs::write(lab.path("a/q0.csv"), "y,u\n1,2\n2,1\n")?;
    let columns = draw.integer(50_000, 60_000);
    let names: Vec<String> = (0..columns).map(|i| format!("c{i}")).collect();
    let row = |k: usize| {
        (0..columns)
            .map(|i| ((i * 7 + k) % 10).to_string())
            .collect::<Vec<_>>()
            .join(",")
    };
    fs::create_dir_all(lab.path("c"))?;
    fs::write(
        lab.path("c/r.csv"),
        format!("{}\n{}\n{}\n", names.join(","), row(0), row(1)),
    )?;
    let mut watch = Watch::new("10,000 records and 60,000 columns in seconds");
    let seconds = watch.run(lab, &["inspect", "a"])?.seconds;
    watch.check(seconds < 10.0, &format!("{seconds:.0} s for the records"));
    let seconds = watch.run(lab, &["new", "c/r.csv"])?.seconds;
    watch.check(seconds < 10.0, &format!("{seconds:.0} s for the columns"));
    Ok(watch.judged())
}

/// A disk of 64 KiB.
pub(super) fn simulate_full_disk(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let disk = lab.path("t");
    fs::create_dir_all(&disk)?;
    let size = format!("size={}k", draw.integer(40, 90));
    let mounted = Command::new("mount")
        .args(["-t", "tmpfs", "-o", &size, "tmpfs"])
        .arg(&disk)
        .output();
    let mut watch = Watch::new("exit 1, one message, nothing half written");
    if !mounted.is_ok_and(|m| m.status.success()) {
        let mut judged = watch.judged();
        judged.said = "skipped: no right to mount a small disk".to_owned();
        return Ok(judged);
    }
    fs::write(
        lab.path("m.toml"),
        "[multisine]\nperiod = 256\nperiods = 4\nlines = { band = { first = 1, last = 76 } }\n[positions]\ncount = 3\n",
    )?;
    let said = watch
        .run(lab, &["simulate", "--machine", "m.toml", "-o", "t/s"])
        .cloned();
    let left = fs::read_dir(disk.join("s")).map_or(0, Iterator::count);
    Command::new("umount").arg(&disk).output()?;
    let said = said?;
    watch.check(said.code == Some(1), &format!("exit {:?}", said.code));
    watch.check(left == 0, "half a bundle is left");
    watch.check(
        said.err.lines().count() <= 2 && !said.err.contains("ZipWriter"),
        "the words of a library",
    );
    Ok(watch.judged())
}

/// Records as long as the limits of the machine file allow.
pub(super) fn simulate_memory(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let periods = draw.integer(500_000, 1_000_000);
    let text = format!(
        "[multisine]\nperiod = 64\nperiods = {periods}\nlines = {{ band = {{ first = 1, last = 19 }} }}\n[positions]\ncount = 2\n[moves]\nestimation = 0\nvalidation = 0\n"
    );
    fs::write(lab.path("m.toml"), text)?;
    let mut watch = Watch::new("refused before the work, or written in at most 1 GiB");
    let code = watch
        .run(lab, &["simulate", "--machine", "m.toml", "-o", "o"])?
        .code;
    watch.check(
        code == Some(0) || !lab.path("o/records").exists(),
        "a folder is left",
    );
    fs::remove_dir_all(lab.path("o")).ok();
    Ok(watch.judged())
}

/// A deflated archive of one-byte numbers.
pub(super) fn zip_bomb(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rows = draw.integer(60_000_000, 130_000_000);
    fs::create_dir_all(lab.path("b"))?;
    let mut members = Vec::new();
    for name in ["y", "u"] {
        let mut header = format!("{{'descr': '|i1', 'fortran_order': False, 'shape': ({rows},), }}");
        while (header.len() + 11) % 64 != 0 {
            header.push(' ');
        }
        let mut start = b"\x93NUMPY\x01\x00".to_vec();
        start.extend((header.len() as u16 + 1).to_le_bytes());
        start.extend(header.bytes());
        start.push(b'\n');
        members.push((format!("{name}.npy"), start));
    }
    fs::write(lab.path("b/r.npz"), zip(&members, rows)?)?;
    fs::write(
        lab.path("b/experiment.toml"),
        "format = 1\nname = \"n\"\nsample_rate = 10.0\n[channels.output]\ncolumns = [\"y\"]\n[channels.input]\ncolumns = [\"u\"]\n[[records]]\nfile = \"r.npz\"\nkind = \"transient\"\nuse = \"estimation\"\n",
    )?;
    let mut watch = Watch::new("refused or read, in at most 1 GiB");
    watch.run(lab, &["inspect", "b"])?;
    watch.run(lab, &["new", "b/r.npz", "--force"])?;
    watch.run(lab, &["identify", "b", "-o", "m.json"])?;
    Ok(watch.judged())
}

/// An archive of members that begin so and go on with `zeros` zeros.
fn zip(members: &[(String, Vec<u8>)], zeros: usize) -> Result<Vec<u8>, TaskError> {
    let (mut out, mut central) = (Vec::new(), Vec::new());
    for (name, start) in members {
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
        let mut sum = flate2::Crc::new();
        let block = vec![0; 1 << 20];
        let mut left = zeros;
        encoder.write_all(start)?;
        sum.update(start);
        while left > 0 {
            let part = &block[..left.min(block.len())];
            encoder.write_all(part)?;
            sum.update(part);
            left -= part.len();
        }
        let packed = encoder.finish()?;
        let mut entry = Vec::new();
        for word in [20_u16, 0, 8, 0, 0] {
            entry.extend(word.to_le_bytes());
        }
        for word in [sum.sum(), packed.len() as u32, (start.len() + zeros) as u32] {
            entry.extend(word.to_le_bytes());
        }
        entry.extend((name.len() as u16).to_le_bytes());
        entry.extend(0_u16.to_le_bytes());
        let offset = out.len() as u32;
        out.extend(b"PK\x03\x04");
        out.extend(&entry);
        out.extend(name.bytes());
        out.extend(packed);
        central.extend(b"PK\x01\x02\x14\x00");
        central.extend(&entry);
        central.extend([0; 10]);
        central.extend(offset.to_le_bytes());
        central.extend(name.bytes());
    }
    let (size, offset, count) = (central.len() as u32, out.len() as u32, members.len() as u16);
    out.extend(&central);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend(count.to_le_bytes());
    out.extend(count.to_le_bytes());
    out.extend(size.to_le_bytes());
    out.extend(offset.to_le_bytes());
    out.extend([0, 0]);
    Ok(out)
}
