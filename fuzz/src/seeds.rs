//! Small inputs to start from, each a correct file of its kind.

use experiment_data::mat::{Array, Value, write_values};
use experiment_data::{BundleWriter, Description, RecordFormat};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use hdf5_pure::LibVer;
use hdf5_pure::mat::{Compression as Packing, MatBuilder, Options};
use lpv_core::{Purpose, Record, RecordKind, Signals};
use npyz::WriterBuilder;
use npyz::npz::NpzWriter;
use npyz::zip::CompressionMethod;
use npyz::zip::write::FileOptions;
use std::io::{Cursor, Write};
use std::path::Path;

/// Writes a seed.
pub(crate) fn put(folder: &Path, target: &str, name: &str, bytes: &[u8]) {
    let place = folder.join(target);
    std::fs::create_dir_all(&place).expect("a folder");
    std::fs::write(place.join(name), bytes).expect("a seed");
}

/// Writes the seeds of all targets, a folder each.
pub fn write(folder: &Path) {
    let put = |target: &str, name: &str, bytes: &[u8]| put(folder, target, name, bytes);
    let y: Vec<f64> = (0..12).map(|k| f64::from(k).sin()).collect();
    put("csv", "plain", b"y,u,p\n1,2,3\n-1.5e-3,0.25,3\n2,1,3\n");
    put(
        "csv",
        "quoted",
        b"\xef\xbb\xbf\"y\",\"u, 1\"\r\n1,2\r\n\r\n \"3\" , 4\r\n",
    );
    put("csv", "german", b"Zeit;y;u\n0,0;1,5;2\n0,1;2,5;3\n");
    put("csv", "tabs", b"time\ty\tu\n0\t1\t2\n1\t3\t4\n");
    put(
        "csv",
        "preamble",
        b"# logger 3\n# rate 1000\ny,u\n[m],[N]\n1,2\n3,4\n",
    );

    for (name, method) in [
        ("stored", CompressionMethod::Stored),
        ("packed", CompressionMethod::Deflated),
    ] {
        put("npz", name, &npz(&y, method));
    }

    let array = |shape: &[u64], data: &[f64]| {
        Value::Array(Array {
            shape: shape.to_vec(),
            data: data.to_vec(),
        })
    };
    let mat = write_values(&[
        ("y".to_owned(), array(&[12, 1], &y)),
        ("u".to_owned(), array(&[1, 12], &y)),
        ("m".to_owned(), array(&[6, 2], &y)),
        ("note".to_owned(), Value::Text("text".to_owned())),
        (
            "s".to_owned(),
            Value::Struct(vec![("a".to_owned(), array(&[12, 1], &y))]),
        ),
    ])
    .expect("values");
    put("mat", "plain", &mat);
    put("mat", "packed", &packed(&mat));

    for (name, compression) in [
        ("plain", Packing::None),
        (
            "packed",
            Packing::Deflate {
                level: 6,
                shuffle: true,
            },
        ),
    ] {
        let mut options = Options::default();
        options.compression = compression;
        options.libver = LibVer::V110;
        let mut file = MatBuilder::new(options);
        file.write_f64("y", &[12, 1], &y).expect("a variable");
        file.write_u8("u", &[12, 1], &[3; 12]).expect("a variable");
        put("mat73", name, &file.finish().expect("a file"));
    }

    put("parquet", "plain", &parquet(folder));
    put("description", "periodic", DESCRIPTION.as_bytes());
}

const DESCRIPTION: &str = "format = 1\nname = 'n'\nsample_rate = 10.0\n\
[channels.output]\ncolumns = ['y']\nunits = ['m']\nscale = [2.0]\n[channels.input]\ncolumns = ['u']\n\
[channels.reference]\ncolumns = ['r']\n[channels.scheduling]\ncolumns = ['p']\n\
[controller]\nreference_numerator = [1.0]\nfeedback_numerator = [[1.0, 0.5]]\ndenominator = [1.0, -0.5]\nlimit = 5.0\n\
[[records]]\nfile = 'a.csv'\nkind = 'periodic'\nperiod = 8\nuse = 'estimation'\nposition = 0.5\n\
[[records]]\nfile = 'b.csv'\nkind = 'transient'\nuse = 'validation'\n[records.injection]\ncolumns = ['r']\n";

fn npz(y: &[f64], method: CompressionMethod) -> Vec<u8> {
    let mut npz = NpzWriter::new(Cursor::new(Vec::new()));
    let options = FileOptions::default().compression_method(method);
    let mut array = npz
        .array::<f64>("y", options)
        .expect("an array")
        .default_dtype()
        .shape(&[y.len() as u64])
        .begin_nd()
        .expect("an array");
    array.extend(y.iter().copied()).expect("numbers");
    array.finish().expect("an array");
    let mut array = npz
        .array::<u8>("u", options)
        .expect("an array")
        .default_dtype()
        .shape(&[y.len() as u64])
        .begin_nd()
        .expect("an array");
    array.extend((0..y.len()).map(|k| k as u8)).expect("numbers");
    array.finish().expect("an array");
    npz.zip_writer().finish().expect("an archive").into_inner()
}

/// Every element of a level 5 file packed.
fn packed(plain: &[u8]) -> Vec<u8> {
    let mut out = plain[..128].to_vec();
    let mut at = 128;
    while at + 8 <= plain.len() {
        let bytes = u32::from_le_bytes([plain[at + 4], plain[at + 5], plain[at + 6], plain[at + 7]]) as usize;
        let mut packer = ZlibEncoder::new(Vec::new(), Compression::default());
        packer.write_all(&plain[at..at + 8 + bytes]).expect("memory");
        let element = packer.finish().expect("memory");
        out.extend(15u32.to_le_bytes());
        out.extend((element.len() as u32).to_le_bytes());
        out.extend(element);
        at += 8 + bytes.next_multiple_of(8);
    }
    out
}

/// A record as this project writes it.
fn parquet(folder: &Path) -> Vec<u8> {
    let folder = folder.join("bundle");
    let description = Description::new("n", 10.0, &["y"], &["u"]);
    let mut writer = BundleWriter::create(&folder, description, RecordFormat::Parquet).expect("a bundle");
    let signal = |phase: f64| (0..40).map(|k| (phase + f64::from(k)).sin()).collect();
    let record = Record {
        name: "r".to_owned(),
        kind: RecordKind::Transient,
        purpose: Purpose::Estimation,
        position: None,
        outputs: Signals::new(&["y"], vec![signal(0.0)]),
        inputs: Signals::new(&["u"], vec![signal(1.0)]),
        references: Signals::default(),
        scheduling: Signals::default(),
        auxiliary: Signals::default(),
        injection: Signals::default(),
    };
    writer.write(&record).expect("a record");
    writer.finish().expect("a bundle");
    let bytes = std::fs::read(folder.join("records/r.parquet")).expect("a record");
    std::fs::remove_dir_all(folder).expect("the bundle is gone");
    bytes
}
