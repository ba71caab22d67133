//! Which channels a file has, and where their values are.

use super::input::{Input, Property};
use super::malformed;
use super::path::channel_names;
use crate::RecordError;
use crate::columns::number::{Class, Number};
use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// More pieces than this have no measurement; a damaged file may claim channels in every segment.
const MOST_PIECES: usize = 1 << 22;
/// Bytes of a segment's first part.
const LEAD: u64 = 28;

/// A channel.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    pub(super) group: String,
    pub(super) name: String,
    pub(super) unit: String,
    /// Interval of its samples.
    pub(super) interval_s: Option<f64>,
    /// The first value comes so much after the start of the measurement, s.
    start_s: f64,
    /// The start of the measurement, 2^-64 s.
    started: Option<i128>,
    /// Its type in the file; none before it has values.
    kind: Option<u32>,
    is_scaled_later: bool,
    /// Number of values.
    pub(super) length: u64,
    pub(super) pieces: Vec<Piece>,
}

/// Values of a channel in one segment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    /// Of the first value.
    pub(super) offset: u64,
    /// Values a chunk.
    pub(super) count: u64,
    /// Bytes from one value to the next.
    pub(super) stride: u64,
    /// Chunks, and bytes from one to the next.
    pub(super) chunks: u64,
    pub(super) chunk_bytes: u64,
    pub(super) big_endian: bool,
}

impl Channel {
    pub(super) fn full_name(&self) -> String {
        format!("{}.{}", self.group, self.name)
    }

    /// How its numbers are stored, or what it is instead.
    pub(super) fn number(&self) -> Result<Number, String> {
        if self.is_scaled_later {
            return Err("raw values that are still to be scaled".to_owned());
        }
        let number = |class, size| {
            Ok(Number {
                class,
                size,
                big_endian: false,
            })
        };
        match self.kind {
            Some(1) => number(Class::Signed, 1),
            Some(2) => number(Class::Signed, 2),
            Some(3) => number(Class::Signed, 4),
            Some(4) => number(Class::Signed, 8),
            Some(5) => number(Class::Unsigned, 1),
            Some(6) => number(Class::Unsigned, 2),
            Some(7) => number(Class::Unsigned, 4),
            Some(8) => number(Class::Unsigned, 8),
            Some(9 | 0x19) => number(Class::Float, 4),
            Some(10 | 0x1a) => number(Class::Float, 8),
            Some(0x21) => number(Class::Logical, 1),
            Some(0x20) => Err("text".to_owned()),
            Some(0x44) => Err("dates".to_owned()),
            Some(0x08_000c | 0x10_000d) => Err("complex numbers".to_owned()),
            Some(other) => Err(format!("values of the type {other}")),
            None => Err("no values".to_owned()),
        }
    }
}

/// Bytes of a value of this type; none where it has no fixed size.
fn size_of(kind: u32) -> Option<u64> {
    Some(match kind {
        1 | 5 | 0x21 => 1,
        2 | 6 => 2,
        3 | 7 | 9 | 0x19 => 4,
        4 | 8 | 10 | 0x1a | 0x08_000c => 8,
        11 | 0x1b | 0x44 | 0x10_000d => 16,
        _ => return None,
    })
}

/// What an object has in each chunk of a segment.
#[derive(Debug, Clone, Copy)]
struct Layout {
    kind: u32,
    count: u64,
    bytes: u64,
}

/// An open file.
pub(super) struct Tdms {
    pub(super) file: File,
    pub(super) bytes: u64,
    pub(super) channels: Vec<Channel>,
    places: HashMap<String, usize>,
    /// The last layout of each channel.
    layouts: Vec<Option<Layout>>,
    /// Whether each has values in the segment at hand.
    is_active: Vec<bool>,
    pieces: usize,
}

impl Tdms {
    pub(super) fn open(path: &Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(RecordError::io("open"))?;
        let bytes = file.metadata().map_err(RecordError::io("open"))?.len();
        let mut tdms = Self {
            file,
            bytes,
            channels: Vec::new(),
            places: HashMap::new(),
            layouts: Vec::new(),
            is_active: Vec::new(),
            pieces: 0,
        };
        let mut at = 0;
        // Channels with values in the segment before, in order.
        let mut active = Vec::new();
        while at < bytes {
            at = tdms.segment(at, &mut active)?;
        }
        Ok(tdms)
    }

    /// Takes in a segment; where the next one begins.
    fn segment(&mut self, at: u64, active: &mut Vec<usize>) -> Result<u64, RecordError> {
        let lead = self.part(at, LEAD)?;
        if lead.get(..4) != Some(b"TDSm") || lead.len() < LEAD as usize {
            return Err(malformed("", &format!("no segment at byte {at}")));
        }
        let toc = u32::from_le_bytes([lead[4], lead[5], lead[6], lead[7]]);
        let has = |bit: u32| toc & (1 << bit) != 0;
        let (has_description, is_new_list, has_values) = (has(1), has(2), has(3));
        let (is_interleaved, big_endian, is_daqmx) = (has(5), has(6), has(7));
        let mut input = Input::new(&lead[8..], big_endian);
        input.u32()?;
        let (next, raw) = (input.u64()?, input.u64()?);
        let start = at + LEAD;
        // A program that was stopped leaves the last length open.
        let end = if next == u64::MAX {
            self.bytes
        } else {
            start
                .checked_add(next)
                .filter(|end| *end <= self.bytes)
                .ok_or_else(|| self.too_long(at, next))?
        };
        let values = start
            .checked_add(raw)
            .filter(|v| *v <= end)
            .ok_or_else(|| self.too_long(at, raw))?;
        if has_description {
            let description = self.part(start, raw)?;
            self.description(&mut Input::new(&description, big_endian), is_new_list, active)?;
        }
        if has_values && !is_daqmx {
            self.pieces(values, end, is_interleaved, big_endian, active)?;
        }
        Ok(end)
    }

    fn too_long(&self, at: u64, claimed: u64) -> RecordError {
        let bytes = self.bytes;
        malformed(
            "",
            &format!("the segment at byte {at} claims {claimed} bytes, the file has {bytes} bytes"),
        )
    }

    /// Bytes of the file; fewer at its end.
    fn part(&mut self, at: u64, count: u64) -> Result<Vec<u8>, RecordError> {
        let mut part = Vec::new();
        let read = RecordError::io("read");
        self.file
            .seek(SeekFrom::Start(at))
            .map_err(RecordError::io("read"))?;
        (&self.file).take(count).read_to_end(&mut part).map_err(read)?;
        Ok(part)
    }

    fn description(
        &mut self,
        input: &mut Input<'_>,
        is_new_list: bool,
        active: &mut Vec<usize>,
    ) -> Result<(), RecordError> {
        if is_new_list {
            self.is_active.fill(false);
            active.clear();
        }
        for _ in 0..input.u32()? {
            let path = input.text()?;
            let place = channel_names(&path).map(|(group, name)| self.place(&path, group, name));
            let index = input.u32()?;
            // DAQmx scalers have their own layout.
            let is_daqmx = matches!(index, 0x1269 | 0x1369);
            let layout = match index {
                u32::MAX => None,
                0 => Some(place.and_then(|p| self.layouts[p]).ok_or_else(|| {
                    malformed(
                        &path,
                        "it has the layout of an earlier segment, and there is none",
                    )
                })?),
                _ if is_daqmx => {
                    let scaler_bytes = if index == 0x1269 { 20 } else { 17 };
                    daqmx(input, scaler_bytes)?;
                    None
                }
                _ => Some(layout(input, &path)?),
            };
            if let Some(place) = place {
                self.channels[place].is_scaled_later |= is_daqmx;
                if let Some(layout) = layout {
                    let known = self.channels[place].kind.get_or_insert(layout.kind);
                    if *known != layout.kind {
                        return Err(malformed(&path, "its type changes inside the file"));
                    }
                    self.layouts[place] = Some(layout);
                    if !std::mem::replace(&mut self.is_active[place], true) {
                        active.push(place);
                    }
                } else if std::mem::replace(&mut self.is_active[place], false) {
                    active.retain(|a| *a != place);
                }
            }
            for _ in 0..input.u32()? {
                let (name, value) = input.property()?;
                if let Some(place) = place {
                    self.channels[place].take_property(&name, value);
                }
            }
        }
        Ok(())
    }

    fn place(&mut self, path: &str, group: String, name: String) -> usize {
        if let Some(&place) = self.places.get(path) {
            return place;
        }
        let place = self.channels.len();
        self.places.insert(path.to_owned(), place);
        self.layouts.push(None);
        self.is_active.push(false);
        self.channels.push(Channel {
            group,
            name,
            unit: String::new(),
            interval_s: None,
            start_s: 0.0,
            started: None,
            kind: None,
            is_scaled_later: false,
            length: 0,
            pieces: Vec::new(),
        });
        place
    }

    /// Notes where the values of a segment are.
    fn pieces(
        &mut self,
        start: u64,
        end: u64,
        is_interleaved: bool,
        big_endian: bool,
        active: &[usize],
    ) -> Result<(), RecordError> {
        let layouts: Vec<(usize, Layout)> = active
            .iter()
            .filter_map(|&place| Some((place, self.layouts[place]?)))
            .collect();
        let sum =
            |f: &dyn Fn(&Layout) -> u64| layouts.iter().fold(0u64, |all, (_, l)| all.saturating_add(f(l)));
        let chunk_bytes = sum(&|l| l.bytes);
        if chunk_bytes == 0 || end <= start {
            return Ok(());
        }
        self.pieces += layouts.len();
        if self.pieces > MOST_PIECES {
            return Err(malformed("", "more pieces than any measurement has"));
        }
        let chunks = (end - start) / chunk_bytes;
        // What a stopped program has not finished is left out.
        if chunks == 0 {
            return Ok(());
        }
        let row = sum(&|l| size_of(l.kind).unwrap_or(0));
        if is_interleaved
            && layouts
                .iter()
                .any(|(_, l)| size_of(l.kind).is_none() || l.count != layouts[0].1.count)
        {
            return Err(malformed("", "interleaved channels of different lengths"));
        }
        let mut offset = start;
        for (place, layout) in layouts {
            let size = size_of(layout.kind).unwrap_or(0);
            let channel = &mut self.channels[place];
            channel.length = channel.length.saturating_add(layout.count.saturating_mul(chunks));
            channel.pieces.push(Piece {
                offset,
                count: layout.count,
                stride: if is_interleaved { row } else { size },
                chunks,
                chunk_bytes,
                big_endian,
            });
            offset += if is_interleaved { size } else { layout.bytes };
        }
        Ok(())
    }
}

impl Channel {
    /// So much later than another one begins, s.
    pub(super) fn begins_after(&self, other: &Self) -> f64 {
        const UNIT: f64 = 1.0 / (1_u128 << 64) as f64;
        let started = match (self.started, other.started) {
            (Some(own), Some(other)) => own.saturating_sub(other) as f64 * UNIT,
            _ => 0.0,
        };
        started + self.start_s - other.start_s
    }

    fn take_property(&mut self, name: &str, value: Property) {
        match (name, value) {
            ("unit_string" | "NI_UnitDescription", Property::Text(unit)) => self.unit = unit,
            ("wf_increment", Property::Number(interval)) => self.interval_s = Some(interval),
            ("wf_start_offset", Property::Number(start)) => self.start_s = start,
            ("wf_start_time", Property::Instant(start)) => self.started = Some(start),
            ("NI_Number_Of_Scales", Property::Number(scales)) => self.is_scaled_later |= scales > 0.0,
            ("NI_Scaling_Status", Property::Text(status)) if status == "unscaled" => {
                self.is_scaled_later = true;
            }
            _ => {}
        }
    }
}

fn layout(input: &mut Input<'_>, path: &str) -> Result<Layout, RecordError> {
    let (kind, dimension, count) = (input.u32()?, input.u32()?, input.u64()?);
    if dimension != 1 {
        return Err(malformed(path, "values of more than one dimension"));
    }
    let bytes = match size_of(kind) {
        Some(size) => count.checked_mul(size),
        None if kind == 0x20 => Some(input.u64()?),
        None => return Err(malformed(path, &format!("values of the unknown type {kind}"))),
    };
    let bytes = bytes.ok_or_else(|| malformed(path, "more values than can be counted"))?;
    Ok(Layout { kind, count, bytes })
}

/// Passes the layout of raw values of a measuring device.
fn daqmx(input: &mut Input<'_>, scaler_bytes: usize) -> Result<(), RecordError> {
    input.bytes(16)?;
    for _ in 0..input.u32()? {
        input.bytes(scaler_bytes)?;
    }
    for _ in 0..input.u32()? {
        input.bytes(4)?;
    }
    Ok(())
}
