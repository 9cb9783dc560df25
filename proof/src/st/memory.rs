//! Where values live while a tree is run: frames of composed values, and the bytes of the process image.

use super::text::text_in;
use super::tree::{Area, At, Kind, Value};

/// Bytes of each area that the generator uses.
pub const IMAGE_BYTES: usize = 24;

/// A variable or a part of one.
#[derive(Debug, Clone)]
pub(super) struct Ref {
    /// A frame, unless it lies in the process image.
    pub frame: usize,
    /// The way through composed values.
    pub path: Vec<usize>,
    /// Its address and type, if it lies in the process image.
    pub image: Option<(At, Kind)>,
    /// Of its bits only some: the first, how many, and the type of all.
    pub part: Option<(u32, u32, Kind)>,
    /// Of a string only the character at a position from 0.
    pub unit: Option<usize>,
}

impl Ref {
    pub(super) fn frame(frame: usize) -> Ref {
        Ref { frame, path: Vec::new(), image: None, part: None, unit: None }
    }

    pub(super) fn image(at: At, kind: Kind) -> Ref {
        Ref { image: Some((at, kind)), ..Ref::frame(0) }
    }

    pub(super) fn child(&self, part: usize) -> Ref {
        let mut found = self.clone();
        found.path.push(part);
        found
    }
}

/// All that a running program can store to.
#[derive(Debug, Clone)]
pub(super) struct Memory {
    pub frames: Vec<Value>,
    /// %I, %Q, %M.
    pub image: [Vec<u8>; 3],
}

fn area(at: At) -> usize {
    match at.area {
        Area::Input => 0,
        Area::Output => 1,
        Area::Memory => 2,
    }
}

fn put(room: &mut Vec<u16>, at: usize, units: &[u16]) {
    room.resize(room.len().max(at + units.len()), 0);
    room[at..at + units.len()].copy_from_slice(units);
}

impl Memory {
    pub(super) fn new(frames: Vec<Value>) -> Memory {
        Memory { frames, image: [vec![0; IMAGE_BYTES], vec![0; IMAGE_BYTES], vec![0; IMAGE_BYTES]] }
    }

    /// The value of what lies in no process image and is no part of bits.
    pub(super) fn at(&mut self, place: &Ref) -> &mut Value {
        place.path.iter().fold(&mut self.frames[place.frame], |value, step| match value {
            Value::Many(parts) => &mut parts[*step],
            other => panic!("{other:?} has no parts"),
        })
    }

    fn whole(&mut self, place: &Ref) -> Value {
        let Some((at, kind)) = place.image else {
            return match (&*self.at(place), place.unit) {
                (Value::Str(room), Some(unit)) => Value::Int(room.get(unit).map_or(0, |unit| i128::from(*unit))),
                (Value::Str(room), None) => Value::Str(text_in(room).to_vec()),
                (value, _) => value.clone(),
            };
        };
        let bytes = &self.image[area(at)];
        if kind == Kind::Bool {
            return Value::Int(i128::from(bytes[at.byte] >> at.bit & 1));
        }
        let width = kind.bits() as usize / 8;
        let pattern = bytes[at.byte..at.byte + width].iter().rev().fold(0, |sum, byte| sum << 8 | i128::from(*byte));
        Value::Int(kind.wrap(pattern))
    }

    pub(super) fn read(&mut self, place: &Ref) -> Value {
        let value = self.whole(place);
        match place.part {
            Some((first, count, _)) => Value::Int(value.int() >> first & ((1 << count) - 1)),
            None => value,
        }
    }

    /// A string without any characters, behind its end neither.
    pub(super) fn clear_text(&mut self, place: &Ref) {
        if let Value::Str(room) = self.at(place) {
            room.fill(0);
        }
    }

    pub(super) fn write(&mut self, place: &Ref, value: Value) {
        let value = match place.part {
            Some((first, count, kind)) => {
                let mask = ((1_i128 << count) - 1) << first;
                let old = self.whole(place).int();
                Value::Int(kind.wrap(old & !mask | value.int() << first & mask))
            }
            None => value,
        };
        let Some((at, kind)) = place.image else {
            match (self.at(place), place.unit, value) {
                (Value::Str(room), Some(unit), value) => put(room, unit, &[value.int() as u16]),
                // What lies behind the 0 that ends it stays.
                (Value::Str(room), None, Value::Str(mut text)) => {
                    text.push(0);
                    put(room, 0, &text);
                }
                (found, _, value) => *found = value,
            }
            return;
        };
        let bytes = &mut self.image[area(at)];
        if kind == Kind::Bool {
            let bit = 1 << at.bit;
            bytes[at.byte] = if value.int() == 0 { bytes[at.byte] & !bit } else { bytes[at.byte] | bit };
            return;
        }
        for (shift, byte) in bytes[at.byte..].iter_mut().take(kind.bits() as usize / 8).enumerate() {
            *byte = (value.int() >> (8 * shift) & 0xFF) as u8;
        }
    }
}
