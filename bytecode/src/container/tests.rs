//! Round trips, pinned bytes and hostile files.

use super::layout::{HeaderField, InstanceField, RecordField, TaskField};
use super::*;
use crate::assembler::{assemble, to_hex};
use crate::disassembler::disassemble;
use crate::ids::*;
use crate::value::*;

mod generate;
mod golden;

const EXAMPLE: &str = include_str!("../../../docs/assembly-example.kasm");

/// A container with something of most kinds, a debug section included.
fn example() -> Container {
    let debug = "debug\n resource \"R\"\n file \"a.st\"\n function \"Work\"\n type elementary DINT\n type record \"P\" \"x\" 0 0\n variable \"total\" slot total 0\n line work 0 0 3 5\nend\n";
    assemble(&format!("{EXAMPLE}{debug}")).unwrap()
}

fn small() -> Container {
    assemble(
        "global x i32\nretain s x 4\nfunction main\n const i64 7\n drop\n return\nend\ndebug\n resource \"R\"\nend",
    )
    .unwrap()
}

fn offsets<F: RecordField>() -> Vec<(usize, usize)> {
    F::ALL.iter().map(|field| (field.offset(), field.ty().bytes())).collect()
}

#[test]
fn offsets_are_those_of_the_reference_design() {
    let header = [
        (0, 4),
        (4, 2),
        (6, 1),
        (7, 1),
        (8, 32),
        (40, 32),
        (72, 32),
        (104, 32),
        (136, 4),
        (140, 4),
        (144, 4),
        (148, 4),
        (152, 4),
        (156, 4),
        (160, 4),
        (164, 4),
        (168, 4),
        (172, 4),
        (176, 4),
        (180, 4),
        (184, 4),
        (188, 4),
        (192, 2),
        (194, 2),
        (196, 2),
        (198, 2),
        (200, 4),
        (204, 4),
        (208, 4),
        (212, 2),
        (214, 2),
        (216, 2),
        (218, 2),
        (220, 2),
        (222, 2),
        (224, 2),
        (226, 2),
        (228, 2),
        (230, 2),
        (232, 2),
        (234, 2),
        (236, 4),
        (240, 4),
        (244, 12),
    ];
    assert_eq!(offsets::<HeaderField>(), header);
    assert_eq!(
        offsets::<TaskField>(),
        [(0, 2), (2, 2), (4, 1), (5, 1), (6, 8), (14, 2), (16, 8), (24, 2), (26, 2), (28, 4)]
    );
    assert_eq!(offsets::<InstanceField>(), [(0, 2), (2, 2), (4, 2), (6, 2), (8, 2), (10, 2), (12, 2), (14, 2)]);
}

#[test]
fn fields_leave_no_gap() {
    fn check<F: RecordField>() {
        let end = F::ALL.iter().fold(0, |end, field| {
            assert_eq!(field.offset(), end, "{}", field.name());
            end + field.ty().bytes()
        });
        assert_eq!(end, F::RECORD_BYTES);
    }
    check::<HeaderField>();
    check::<TaskField>();
    check::<InstanceField>();
}

#[test]
fn derived_header_fields_are_what_the_sections_hold() {
    let bytes = write(&example()).unwrap();
    let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
    assert_eq!(&bytes[..4], &[0x43, 0x4C, 0x50, 0x49]);
    assert_eq!(bytes[7], 0b110);
    assert_eq!(u16_at(196), 6, "two globals and two partitions of two slots");
    assert_eq!(u16_at(198), 5, "block instance rows");
    assert_eq!(
        u32::from_le_bytes(bytes[200..204].try_into().unwrap()),
        2 * 16 + 8,
        "blocks inside data blocks count once"
    );
    assert_eq!((u16_at(220), u16_at(222), u16_at(224)), (3, 1, 1));
    assert_eq!((u16_at(232), u16_at(234)), (2, 0xFFFF));
    assert_eq!(u16_at(226), 4);
}

#[test]
fn wide_strings_are_counted_through_arrays_and_structures() {
    let text = "type w wstring 9\narray a w 1..3\ntype s struct w a\ndata x s\ndata y w";
    let bytes = write(&assemble(text).unwrap()).unwrap();
    assert_eq!(u32::from_le_bytes(bytes[208..212].try_into().unwrap()), 20 * 5);
    assert_eq!(u16::from_le_bytes([bytes[218], bytes[219]]), 9);
}

#[test]
fn read_is_the_inverse_of_write() {
    for container in [Container::default(), small(), example()] {
        let bytes = write(&container).unwrap();
        assert_eq!(read(&bytes).unwrap(), container);
    }
}

#[test]
fn generated_containers_round_trip_through_bytes_and_text() {
    for seed in 0..300 {
        let container = generate::container(seed);
        let bytes = write(&container).unwrap();
        assert_eq!(read(&bytes).unwrap(), container, "seed {seed}");
        let _ = crate::verify::verify(container.clone());
        let text = disassemble(&container);
        match assemble(&text) {
            Ok(again) => assert_eq!(again, container, "seed {seed}\n{text}"),
            Err(error) => panic!("seed {seed}: {error}\n{text}"),
        }
    }
}

#[test]
fn a_cut_file_is_refused_at_every_length() {
    let bytes = write(&example()).unwrap();
    for end in 0..bytes.len() {
        let error = read(&bytes[..end]).unwrap_err();
        assert!(matches!(error.code, ReadCode::TooShort | ReadCode::SectionPlace), "{end}: {error}");
        let mut cut = bytes[..end].to_vec();
        reseal(&mut cut);
        assert!(read(&cut).is_err());
    }
    let mut longer = bytes;
    longer.push(0);
    assert_eq!(read(&longer).unwrap_err().code, ReadCode::TrailingBytes);
}

#[test]
fn every_flipped_bit_is_noticed() {
    let bytes = write(&small()).unwrap();
    for bit in 0..bytes.len() * 8 {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        let error = read(&flipped).expect_err("a flipped bit was not noticed");
        assert!(error.to_string().starts_with("C00"), "{error}");
    }
}

#[test]
fn a_flipped_bit_behind_fresh_hashes_is_refused_or_has_one_spelling() {
    let (mut refused, mut read_back) = (0, 0);
    for container in [small(), example()] {
        let bytes = write(&container).unwrap();
        for bit in 0..bytes.len() * 8 {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            reseal(&mut flipped);
            match read(&flipped) {
                Ok(container) => {
                    assert_eq!(write(&container).unwrap(), flipped, "bit {bit}");
                    // The verifier meets each of them without a panic, too.
                    let _ = crate::verify::verify(container.clone());
                    if bit % 16 == 0 {
                        let text = disassemble(&container);
                        assert_eq!(assemble(&text).unwrap(), container, "bit {bit}\n{text}");
                    }
                    read_back += 1;
                }
                Err(_) => refused += 1,
            }
        }
    }
    assert!(refused > 1000 && read_back > 1000, "{refused} {read_back}");
}

#[test]
fn resealing_a_sound_file_changes_nothing() {
    let bytes = write(&example()).unwrap();
    let mut again = bytes.clone();
    reseal(&mut again);
    assert_eq!(again, bytes);
}

/// The code with which a changed file is refused; `at` bytes replaced, hashes fresh again when `seal`.
fn code_of(at: usize, new: &[u8], seal: bool) -> ReadCode {
    let mut bytes = write(&small()).unwrap();
    bytes[at..at + new.len()].copy_from_slice(new);
    if seal {
        reseal(&mut bytes);
    }
    read(&bytes).unwrap_err().code
}

#[test]
fn each_rule_has_a_file_that_breaks_it() {
    let bytes = write(&small()).unwrap();
    let at =
        |field: HeaderField| u32::from_le_bytes(bytes[field.offset()..field.offset() + 4].try_into().unwrap()) as usize;
    let (types, tasks, constants, debug) = (
        at(HeaderField::TypeOffset),
        at(HeaderField::TaskOffset),
        at(HeaderField::ConstantOffset),
        at(HeaderField::DebugOffset),
    );
    // Of the only task; its count of bytes stands before it.
    let names = bytes.windows(12).position(|bytes| bytes == b"default_task").unwrap() - 4;
    for (code, at, new, seal) in [
        (ReadCode::Magic, 0, &b"\x7FELF"[..], false),
        (ReadCode::Version, 4, &[2], false),
        (ReadCode::Profile, 6, &[1], false),
        (ReadCode::Flags, 7, &[4], false),
        (ReadCode::Flags, 7, &[14], false),
        (ReadCode::SectionPlace, 152, &[1], false),
        (ReadCode::SectionPlace, 136, &[1], false),
        (ReadCode::MissingSection, 156, &[0; 4], false),
        (ReadCode::Reserved, 255, &[1], false),
        (ReadCode::ContentHash, 8, &[0, 0], false),
        (ReadCode::DebugHash, 72, &[0, 0], false),
        (ReadCode::ContentHash, 192, &[9, 9], false),
        (ReadCode::Count, 196, &[9], true),
        (ReadCode::Count, 212, &[1], true),
        (ReadCode::Table, types + 36, &[77], true),
        (ReadCode::Reserved, types + 38, &[1], true),
        (ReadCode::Value, tasks + 6 + 4, &[3], true),
        (ReadCode::Reserved, tasks + 6 + 5, &[3], true),
        (ReadCode::Reserved, tasks + 6 + 24, &[1], true),
        (ReadCode::Ends, tasks, &[9], true),
        (ReadCode::Rest, tasks + 2, &[0], true),
        (ReadCode::TooLong, names, &[0, 1, 0, 0], true),
        (ReadCode::TooMany, names, &[255, 0, 0, 0], true),
        (ReadCode::TooMany, constants, &[255, 255, 255, 255], true),
        (ReadCode::Value, constants + 4, &[3], true),
        (ReadCode::Text, debug + 4, &[0xFF], true),
    ] {
        assert_eq!(code_of(at, new, seal), code, "byte {at} := {new:?}");
    }
    assert_eq!(read(&[]).unwrap_err().code, ReadCode::TooShort);
    assert_eq!(read(b"PROGRAM main\nEND_PROGRAM").unwrap_err().code, ReadCode::Magic);
}

#[test]
fn tasks_have_names_without_a_debug_section_and_up_to_a_limit() {
    let mut container = assemble("task fast cyclic 5\ntask b event name \"ß 2\"\nfunction main\n return\nend").unwrap();
    assert_eq!(container.debug, None);
    assert_eq!(read(&write(&container).unwrap()).unwrap().task_names(), ["fast", "ß 2"]);
    container.types.task_extensions[1].name = "ß".repeat(127) + "x";
    assert_eq!(read(&write(&container).unwrap()).as_ref(), Ok(&container));
    container.types.task_extensions[1].name.push('x');
    assert_eq!(write(&container).unwrap_err().message, "a name of 256 bytes; 255 is the limit");
    container.types.task_extensions[1].name.clear();
    assert_eq!(container.task_names(), ["fast", "task 1"]);
}

/// A wrong hash behind a right content hash.
#[test]
fn layout_and_retain_hashes_are_recomputed() {
    use super::hashes::content_hash_of;
    let sound = write(&small()).unwrap();
    let type_offset = u32::from_le_bytes(sound[152..156].try_into().unwrap()) as usize;
    for (at, code) in [(104, ReadCode::LayoutHash), (type_offset, ReadCode::RetainHash)] {
        let mut bytes = sound.clone();
        bytes[at] ^= 1;
        let file = read::File::open(&bytes).unwrap();
        let hash = content_hash_of(&file.header, &file.sections);
        bytes[8..40].copy_from_slice(&hash);
        assert_eq!(read(&bytes).unwrap_err().code, code);
    }
}

#[test]
fn the_layout_hash_ignores_code_and_the_content_hash_ignores_debug() {
    let container = example();
    let mut other = container.clone();
    other.functions[0].code.push(0);
    other.types.retain.clear();
    assert_eq!(layout_hash(&other), layout_hash(&container));
    assert_ne!(content_hash(&other), content_hash(&container));
    let mut moved = container.clone();
    moved.types.data[0].offset += 64;
    assert_ne!(layout_hash(&moved), layout_hash(&container));
    let mut stripped = container.clone();
    strip(&mut stripped);
    assert_eq!(content_hash(&stripped), content_hash(&container));
    assert_eq!(write(&stripped).unwrap()[7], 0b100);
    assert_eq!(debug_hash(&stripped).unwrap(), [0; 32]);
}

#[test]
fn signatures_are_checked_and_wrong_ones_refused() {
    use ed25519_dalek::{Signer, SigningKey};
    let key = SigningKey::from_bytes(&[7; 32]);
    let mut container = small();
    let public = key.verifying_key().to_bytes();
    let sign = |hash: Hash| signature_section(&public, &key.sign(&hash).to_bytes());
    container.content_signature = sign(content_hash(&container).unwrap());
    container.debug_signature = sign(debug_hash(&container).unwrap());
    let bytes = write(&container).unwrap();
    assert_eq!(bytes[7], 0b111);
    assert_eq!(read(&bytes).unwrap(), container);
    for (at, code) in [(0, ReadCode::SignatureForm), (2, ReadCode::SignatureForm), (40, ReadCode::Signature)] {
        let mut wrong = bytes.clone();
        wrong[256 + at] ^= 1;
        let error = read(&wrong).unwrap_err();
        assert_eq!((error.code, error.section, error.offset), (code, "content signature section", 256));
    }
    let mut other = container.clone();
    other.parameters.max_stack_depth += 1;
    assert!(write(&other).is_err());
    let mut stripped = container.clone();
    stripped.debug = None;
    assert!(write(&stripped).unwrap_err().message.contains("debug"));
    strip(&mut stripped);
    assert_eq!(read(&write(&stripped).unwrap()).unwrap(), stripped);
}

#[test]
fn limits_are_errors_and_never_wrap() {
    let mut many = Container::default();
    many.types.slots = vec![Storage::I32; 65_536];
    assert!(write(&many).unwrap_err().message.contains("65536 slots"));
    many.types.slots.pop();
    assert_eq!(read(&write(&many).unwrap()).unwrap(), many);
    let startup = Parameters { startup_function: Some(FunctionId(0xFFFF)), ..Parameters::default() };
    assert!(write(&Container { parameters: startup, ..Container::default() }).is_err());
    let mut wide = Container::default();
    wide.types.block_instances = vec![BlockInstance { offset: 0, stride: u32::MAX, count: 2, ty: TypeId(0) }];
    assert!(write(&wide).unwrap_err().message.contains("bytes of function block instances"));
}

#[test]
fn codes_are_unique_and_explained() {
    let codes: std::collections::BTreeSet<_> = ReadCode::ALL.iter().map(|code| code.code()).collect();
    assert_eq!(codes.len(), ReadCode::ALL.len());
    assert!(ReadCode::ALL.iter().all(|code| code.explanation().ends_with('.')));
}
