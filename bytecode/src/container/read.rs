//! From hostile bytes to a container.
//!
//! Order: header and directory, hashes, sections, then the header that these sections should have, field by field. So a damaged file is
//! called damaged, and whatever passes has no second spelling. Code stays bytes: the verifier decodes it.

use super::error::{ReadCode, ReadError};
use super::hashes::{content_hash_of, debug_hash_of, retain_hash};
use super::header::{header, parameters};
use super::layout::{
    FLAG_CONTENT_SIGNATURE, FLAG_DEBUG, FLAG_TYPES, FORMAT_VERSION, HEADER_BYTES, HeaderField, MAGIC, Record as Fixed,
    RecordField, Section,
};
use super::model::{Container, Hash};
use super::sections::get_types;
use super::signature::check_signatures;
use super::wire::{Input, Wire};
use super::write::SectionBytes;

/// Reads a container. It need not be sound: that is the verifier's business.
///
/// # Errors
/// The first rule of [`ReadCode`] that the bytes break, with section and offset. Never panics; memory stays in proportion to the file.
pub fn read(bytes: &[u8]) -> Result<Container, ReadError> {
    let file = File::open(bytes)?;
    file.check_hashes()?;
    let (container, retain) = file.parse()?;
    file.check_against(&container, &retain)?;
    Ok(container)
}

/// A file whose header and directory are in order.
pub(super) struct File<'a> {
    pub header: Fixed<HeaderField>,
    /// Where each section begins in the file.
    pub offsets: [usize; 7],
    pub sections: SectionBytes<'a>,
}

fn header_error(code: ReadCode, field: HeaderField, message: impl Into<String>) -> ReadError {
    ReadError { code, section: "header", offset: field.offset(), message: message.into() }
}

impl<'a> File<'a> {
    pub fn open(bytes: &'a [u8]) -> Result<File<'a>, ReadError> {
        if bytes.len() < HEADER_BYTES {
            let message = format!("the file has {} bytes; a header has {HEADER_BYTES}", bytes.len());
            // What begins like something else is called that, however short it is.
            let other = bytes.len() >= 4 && !bytes.starts_with(&MAGIC.to_le_bytes());
            let code = if other { ReadCode::Magic } else { ReadCode::TooShort };
            return Err(ReadError { code, section: "header", offset: bytes.len(), message });
        }
        let header = Fixed::of(bytes);
        check_identification(&header)?;
        let mut file = File { header, offsets: [0; 7], sections: [&[]; 7] };
        file.open_sections(bytes)?;
        file.check_flags()?;
        Ok(file)
    }

    fn open_sections(&mut self, bytes: &'a [u8]) -> Result<(), ReadError> {
        let mut expected = HEADER_BYTES;
        let places = self.offsets.iter_mut().zip(&mut self.sections);
        for (section, (offset, body)) in Section::ALL.into_iter().zip(places) {
            let start = self.header.get_u32(section.offset_field()) as usize;
            let size = self.header.get_u32(section.size_field()) as usize;
            let error = |code, message| Err(header_error(code, section.offset_field(), message));
            let name = section.name();
            *offset = start;
            if size == 0 {
                if section.is_required() {
                    return error(ReadCode::MissingSection, format!("the {name} is missing"));
                }
                if start != 0 {
                    return error(ReadCode::SectionPlace, format!("the absent {name} has the offset {start}, not 0"));
                }
                continue;
            }
            if start != expected {
                let message = format!("the {name} begins at {start}, not at {expected} behind what comes before it");
                return error(ReadCode::SectionPlace, message);
            }
            let Some(found) = bytes.get(start..).and_then(|rest| rest.get(..size)) else {
                let message = format!("the {name} has {size} bytes from {start} on; the file has {}", bytes.len());
                return error(ReadCode::SectionPlace, message);
            };
            *body = found;
            expected = start + size;
        }
        if bytes.len() > expected {
            let message = format!("{} bytes lie behind the last section", bytes.len() - expected);
            return Err(ReadError { code: ReadCode::TrailingBytes, section: "file", offset: expected, message });
        }
        Ok(())
    }

    fn check_flags(&self) -> Result<(), ReadError> {
        let [signature, _, .., debug] = &self.sections;
        let mut expected = FLAG_TYPES;
        expected |= if signature.is_empty() { 0 } else { FLAG_CONTENT_SIGNATURE };
        expected |= if debug.is_empty() { 0 } else { FLAG_DEBUG };
        let flags = self.header.get(HeaderField::Flags);
        if flags == u64::from(expected) {
            return Ok(());
        }
        let message = format!("the flags are {flags:#04x}; the sections ask for {expected:#04x}");
        Err(header_error(ReadCode::Flags, HeaderField::Flags, message))
    }

    fn check_hashes(&self) -> Result<(), ReadError> {
        if content_hash_of(&self.header, &self.sections) != self.header.get_hash(HeaderField::ContentHash) {
            let message = "the content is not the one that was hashed: the file was changed or damaged";
            return Err(header_error(ReadCode::ContentHash, HeaderField::ContentHash, message));
        }
        let debug = self.sections.last().copied().unwrap_or_default();
        if debug_hash_of(debug) != self.header.get_hash(HeaderField::DebugHash) {
            let message = "the debug section is not the one that was hashed";
            return Err(header_error(ReadCode::DebugHash, HeaderField::DebugHash, message));
        }
        Ok(())
    }

    /// The sections as a container, and the hash that stands before its retain map. Hashes are not held against anything here.
    pub fn parse(&self) -> Result<(Container, Hash), ReadError> {
        let [content_signature, debug_signature, ..] = self.sections;
        let (types, retain) = self.section(Section::Type, get_types)?;
        let debug = if self.sections.last().is_some_and(|bytes| !bytes.is_empty()) {
            Some(self.section(Section::Debug, Wire::get)?)
        } else {
            None
        };
        let container = Container {
            parameters: parameters(&self.header),
            source_hash: self.header.get_hash(HeaderField::SourceHash),
            content_signature: content_signature.to_vec(),
            debug_signature: debug_signature.to_vec(),
            types,
            tasks: self.section(Section::Task, Wire::get)?,
            constants: self.section(Section::Constant, Wire::get)?,
            functions: self.section(Section::Code, Wire::get)?,
            debug,
        };
        Ok((container, retain))
    }

    fn section<T>(
        &self,
        section: Section,
        get: impl FnOnce(&mut Input<'_>) -> Result<T, ReadError>,
    ) -> Result<T, ReadError> {
        let bytes = self.sections.get(section as usize).copied().unwrap_or_default();
        let offset = self.offsets.get(section as usize).copied().unwrap_or_default();
        let mut input = Input::new(section.name(), offset, bytes);
        let value = get(&mut input)?;
        input.finish()?;
        Ok(value)
    }

    fn check_against(&self, container: &Container, retain: &Hash) -> Result<(), ReadError> {
        let of_sections = header(container, &self.sections);
        let expected =
            of_sections.map_err(|error| header_error(ReadCode::Count, HeaderField::NumVariables, error.message))?;
        // The content hash was checked; it covers the others and would hide which of them differs.
        for field in HeaderField::ALL.iter().filter(|field| **field != HeaderField::ContentHash) {
            if self.header.slice(*field) != expected.slice(*field) {
                return Err(disagreement(*field, &self.header, &expected));
            }
        }
        let of_map = retain_hash(&container.types);
        if of_map.as_ref() != Ok(retain) {
            let offset = self.offsets.get(Section::Type as usize).copied().unwrap_or_default();
            let message = "the retain map is not the one that was hashed".to_string();
            return Err(ReadError { code: ReadCode::RetainHash, section: Section::Type.name(), offset, message });
        }
        let signatures = check_signatures(&self.header, &container.content_signature, &container.debug_signature);
        signatures.map_err(|((section, code), message)| {
            let offset = self.offsets.get(section as usize).copied().unwrap_or_default();
            ReadError { code, section: section.name(), offset, message }
        })
    }
}

fn check_identification(header: &Fixed<HeaderField>) -> Result<(), ReadError> {
    let magic = header.get_u32(HeaderField::Magic);
    if magic != MAGIC {
        let message = format!("the file begins with {magic:#010x}, not with {MAGIC:#010x}");
        return Err(header_error(ReadCode::Magic, HeaderField::Magic, message));
    }
    let version = header.get_u16(HeaderField::Version);
    if version != FORMAT_VERSION {
        let message = format!("format version {version}; this khz knows {FORMAT_VERSION}");
        return Err(header_error(ReadCode::Version, HeaderField::Version, message));
    }
    let profile = header.get(HeaderField::Profile);
    if profile != 0 {
        return Err(header_error(ReadCode::Profile, HeaderField::Profile, format!("the profile is {profile}, not 0")));
    }
    match header.nonzero_reserved() {
        None => Ok(()),
        Some(field) => Err(header_error(ReadCode::Reserved, field, "reserved bytes of the header are not zero")),
    }
}

fn disagreement(field: HeaderField, found: &Fixed<HeaderField>, expected: &Fixed<HeaderField>) -> ReadError {
    match field {
        HeaderField::LayoutHash => {
            header_error(ReadCode::LayoutHash, field, "the memory layout is not the one that was hashed")
        }
        _ => {
            let message =
                format!("`{}` is {}; the sections say {}", field.name(), found.get(field), expected.get(field));
            header_error(ReadCode::Count, field, message)
        }
    }
}
