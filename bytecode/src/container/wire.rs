//! The form of lists, structs and choices: one description makes writer, reader and document.
//!
//! Numbers are little-endian; a list is its count (u32) and its entries; an optional value a byte 0, or 1 and the value; a choice its number
//! (u8) and its fields; a text a list of UTF-8 bytes.

use super::error::{ReadCode, ReadError, WriteError};
use super::model::Hash;

/// A bounds-checked cursor over one section or table.
#[derive(Debug, Clone)]
pub(super) struct Input<'a> {
    section: &'static str,
    /// File offset of the first byte.
    base: usize,
    bytes: &'a [u8],
    position: usize,
}

impl<'a> Input<'a> {
    pub fn new(section: &'static str, base: usize, bytes: &'a [u8]) -> Self {
        Input { section, base, bytes, position: 0 }
    }

    /// An error at the place read next.
    pub fn error(&self, code: ReadCode, message: impl Into<String>) -> ReadError {
        let offset = self.base.saturating_add(self.position);
        ReadError { code, section: self.section, offset, message: message.into() }
    }

    fn remaining(&self) -> usize {
        self.bytes.len().saturating_sub(self.position)
    }

    pub fn take(&mut self, count: usize) -> Result<&'a [u8], ReadError> {
        let taken = self.bytes.get(self.position..).and_then(|rest| rest.get(..count));
        let taken = taken.ok_or_else(|| {
            self.error(ReadCode::Ends, format!("{count} bytes are needed here, {} are left", self.remaining()))
        })?;
        self.position += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let bytes = self.take(N)?;
        Ok(bytes.first_chunk().copied().unwrap_or([0; N]))
    }

    /// A cursor over the next `count` bytes.
    pub fn part(&mut self, count: usize) -> Result<Input<'a>, ReadError> {
        let base = self.base.saturating_add(self.position);
        let bytes = self.take(count)?;
        Ok(Input { section: self.section, base, bytes, position: 0 })
    }

    /// Everything must have been read.
    pub fn finish(&self) -> Result<(), ReadError> {
        match self.remaining() {
            0 => Ok(()),
            rest => Err(self.error(ReadCode::Rest, format!("{rest} bytes are left over"))),
        }
    }
}

/// What can stand in a section.
pub(super) trait Wire: Sized {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError>;
    fn get(input: &mut Input<'_>) -> Result<Self, ReadError>;

    /// Several in a row.
    fn put_all(all: &[Self], out: &mut Vec<u8>) -> Result<(), WriteError> {
        all.iter().try_for_each(|one| one.put(out))
    }

    /// `count` in a row. Nothing is reserved ahead, so that memory grows only with what was read.
    fn get_all(count: usize, input: &mut Input<'_>) -> Result<Vec<Self>, ReadError> {
        (0..count).map(|_| Self::get(input)).collect()
    }
}

impl Wire for u8 {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        out.push(*self);
        Ok(())
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        input.array().map(|[byte]| byte)
    }

    fn put_all(all: &[Self], out: &mut Vec<u8>) -> Result<(), WriteError> {
        out.extend_from_slice(all);
        Ok(())
    }

    fn get_all(count: usize, input: &mut Input<'_>) -> Result<Vec<Self>, ReadError> {
        input.take(count).map(<[u8]>::to_vec)
    }
}

macro_rules! wire_numbers {
    ($($ty:ty)*) => { $(
        impl Wire for $ty {
            fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
                out.extend_from_slice(&self.to_le_bytes());
                Ok(())
            }

            fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
                input.array().map(<$ty>::from_le_bytes)
            }
        }
    )* };
}
wire_numbers!(u16 u32 u64 i32 i64);

impl Wire for Hash {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        out.extend_from_slice(self);
        Ok(())
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        input.array()
    }
}

impl Wire for bool {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        u8::from(*self).put(out)
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        let error = input.error(ReadCode::Value, "a yes-or-no byte is neither 0 nor 1");
        match u8::get(input)? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(error),
        }
    }
}

impl<T: Wire> Wire for Option<T> {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        self.is_some().put(out)?;
        self.as_ref().map_or(Ok(()), |value| value.put(out))
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        bool::get(input)?.then(|| T::get(input)).transpose()
    }
}

impl<T: Wire> Wire for Vec<T> {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        let count = u32::try_from(self.len());
        count
            .map_err(|_| WriteError::new(format!("a list of {} entries; 2^32 - 1 is the limit", self.len())))?
            .put(out)?;
        T::put_all(self, out)
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        let error = input.clone();
        let count = u32::get(input)? as usize;
        // Every entry takes at least one byte.
        if count > input.remaining() {
            let message = format!("a list of {count} entries in {} bytes", input.remaining());
            return Err(error.error(ReadCode::TooMany, message));
        }
        T::get_all(count, input)
    }
}

impl Wire for String {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        // One copy; names are short.
        self.as_bytes().to_vec().put(out)
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        let error = input.error(ReadCode::Text, "this text is not UTF-8");
        String::from_utf8(Vec::get(input)?).map_err(|_| error)
    }
}

impl<A: Wire, B: Wire> Wire for (A, B) {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        self.0.put(out)?;
        self.1.put(out)
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        Ok((A::get(input)?, B::get(input)?))
    }
}

impl<A: Wire, B: Wire, C: Wire> Wire for (A, B, C) {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        self.0.put(out)?;
        self.1.put(out)?;
        self.2.put(out)
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        Ok((A::get(input)?, B::get(input)?, C::get(input)?))
    }
}

/// Names and types of fields.
pub(crate) type FieldShapes = &'static [(&'static str, &'static str)];

/// Number, name and fields of each alternative of a choice.
pub(crate) type ChoiceShapes = &'static [(u8, &'static str, FieldShapes)];

/// For documents: what the sections are made of.
pub(crate) struct Shapes {
    /// Structs: name and fields.
    pub structs: &'static [(&'static str, FieldShapes)],
    /// Choices: name, and number, name and fields of each.
    pub choices: &'static [(&'static str, ChoiceShapes)],
    /// One byte: name, and number and name of each.
    pub bytes: Vec<(&'static str, Vec<(u8, String)>)>,
    /// Tables of a section: section, and tag, name, row and meaning of each.
    pub tables: Vec<(&'static str, TableShapes)>,
}

/// Tables: tag, name, row, meaning.
pub(crate) type TableShapes = &'static [(u16, &'static str, &'static str, &'static str)];

/// Ids are their numbers.
macro_rules! wire_ids {
    ($($ty:ident($raw:ty))*) => { $(
        impl Wire for $ty {
            fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
                self.0.put(out)
            }

            fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
                <$raw>::get(input).map($ty)
            }
        }
    )* };
}

/// Fields in their order; behind `=>` stands how many entries or bytes a list or text may have.
macro_rules! wire_structs {
    ($($ty:ident { $($field:ident: $kind:ty $(=> $limit:ident)?),* $(,)? })*) => {
        pub(super) const STRUCTS: &[(&str, super::wire::FieldShapes)] = &[$((stringify!($ty), &[$((stringify!($field), stringify!($kind))),*])),*];
        $(
            impl Wire for $ty {
                fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
                    $(
                        $(super::wire::put_limit(stringify!($field), self.$field.len(), $limit)?;)?
                        self.$field.put(out)?;
                    )*
                    Ok(())
                }

                fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
                    $(
                        $(super::wire::get_limit(stringify!($field), $limit, input)?;)?
                        let $field = <$kind>::get(input)?;
                    )*
                    Ok($ty { $($field),* })
                }
            }
        )*
    };
}

/// A list or text of `length` that may have `limit`.
pub(super) fn put_limit(field: &str, length: usize, limit: usize) -> Result<(), WriteError> {
    if length > limit {
        return Err(WriteError::new(format!("a {field} of {length} bytes; {limit} is the limit")));
    }
    Ok(())
}

/// Looks at the count of the list or text that comes next.
pub(super) fn get_limit(field: &str, limit: usize, input: &Input<'_>) -> Result<(), ReadError> {
    let count = u32::get(&mut input.clone())? as usize;
    if count > limit {
        return Err(input.error(ReadCode::TooLong, format!("a {field} of {count} bytes; {limit} is the limit")));
    }
    Ok(())
}

/// A number, then the fields of what it stands for.
macro_rules! wire_choices {
    ($($ty:ident { $($code:literal $variant:ident $(($($item:ident: $item_kind:ty),*))? $({$($field:ident: $kind:ty),*})?),* $(,)? })*) => {
        pub(super) const CHOICES: &[(&str, super::wire::ChoiceShapes)] = &[$((stringify!($ty), &[
            $(($code, stringify!($variant), &[$($((stringify!($item), stringify!($item_kind))),*)? $($((stringify!($field), stringify!($kind))),*)?])),*
        ])),*];
        $(
            impl Wire for $ty {
                fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
                    match self {
                        $($ty::$variant $(($($item),*))? $({$($field),*})? => {
                            out.push($code);
                            $($($item.put(out)?;)*)?
                            $($($field.put(out)?;)*)?
                        })*
                    }
                    Ok(())
                }

                fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
                    let place = input.clone();
                    match u8::get(input)? {
                        $($code => {
                            $($(let $item = <$item_kind>::get(input)?;)*)?
                            $($(let $field = <$kind>::get(input)?;)*)?
                            Ok($ty::$variant $(($($item),*))? $({$($field),*})?)
                        })*
                        other => Err(place.error(ReadCode::Value, format!("{other} is no {}", stringify!($ty)))),
                    }
                }
            }
        )*
    };
}

/// One byte, one of a few.
macro_rules! wire_bytes {
    ($($ty:ident { $($variant:ident),* })*) => {
        pub(super) fn byte_shapes() -> Vec<(&'static str, Vec<(u8, String)>)> {
            vec![$((stringify!($ty), vec![$(($ty::$variant as u8, stringify!($variant).to_string())),*])),*]
        }
        $(
            impl Wire for $ty {
                fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
                    out.push(*self as u8);
                    Ok(())
                }

                fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
                    let place = input.clone();
                    let code = u8::get(input)?;
                    // The numbers of the variants stand once, in the enum.
                    $(if code == $ty::$variant as u8 { return Ok($ty::$variant); })*
                    Err(place.error(ReadCode::Value, format!("{code} is no {}", stringify!($ty))))
                }
            }
        )*
    };
}

/// The tagged tables of a section: count of tables (u32), then for each its tag (u16), flags (u16, zero), size of what follows (u32), count, rows.
macro_rules! wire_tables {
    ($section:ident $shapes:ident $put:ident $get:ident { $($tag:literal $field:ident: $row:ty = $meaning:literal;)* }) => {
        pub(super) const $shapes: super::wire::TableShapes = &[$(($tag, stringify!($field), stringify!($row), $meaning)),*];

        fn $put(section: &$section, out: &mut Vec<u8>) -> Result<(), WriteError> {
            let count: u32 = 0 $(+ u32::from(!section.$field.is_empty()))*;
            count.put(out)?;
            $(super::wire::put_table($tag, &section.$field, out)?;)*
            Ok(())
        }

        fn $get(section: &mut $section, input: &mut Input<'_>) -> Result<(), ReadError> {
            let mut last_tag = 0;
            for _ in 0..u32::get(input)? {
                let (tag, mut table) = super::wire::get_table(&mut last_tag, input)?;
                let start = table.clone();
                let empty = match tag {
                    $($tag => {
                        section.$field = Vec::get(&mut table)?;
                        section.$field.is_empty()
                    })*
                    _ => return Err(start.error(ReadCode::Table, format!("there is no table with the tag {tag} here"))),
                };
                if empty {
                    return Err(start.error(ReadCode::Table, format!("the table with the tag {tag} is empty")));
                }
                table.finish()?;
            }
            Ok(())
        }
    };
}

/// Writes one table, unless it is empty.
pub(super) fn put_table<T: Wire>(tag: u16, rows: &Vec<T>, out: &mut Vec<u8>) -> Result<(), WriteError> {
    if rows.is_empty() {
        return Ok(());
    }
    tag.put(out)?;
    0_u16.put(out)?;
    let mut body = Vec::new();
    rows.put(&mut body)?;
    body.put(out)
}

/// The next table; tags ascend.
pub(super) fn get_table<'a>(last_tag: &mut u16, input: &mut Input<'a>) -> Result<(u16, Input<'a>), ReadError> {
    let place = input.clone();
    let tag = u16::get(input)?;
    if tag <= *last_tag {
        let message = format!("the tag {tag} does not stand behind the tag {last_tag}");
        return Err(place.error(ReadCode::Table, message));
    }
    *last_tag = tag;
    let place = input.clone();
    if u16::get(input)? != 0 {
        return Err(place.error(ReadCode::Reserved, "the flags of a table are zero"));
    }
    let size = u32::get(input)? as usize;
    Ok((tag, input.part(size)?))
}

pub(super) use {wire_bytes, wire_choices, wire_ids, wire_structs, wire_tables};
