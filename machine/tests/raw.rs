//! Variables by their bytes.

use khz_bytecode::container::{Container, DebugPlace, DebugSection, DebugType, DebugVariable, ElementaryType};
use khz_bytecode::ids::SlotIndex;
use khz_bytecode::value::{BytePlace, Storage};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::variables::{Domain, VariableTable};

/// A variable of each kind; the last one lies outside.
fn container() -> Container {
    let types = vec![
        DebugType::Elementary(ElementaryType::Int),
        DebugType::Elementary(ElementaryType::Bool),
        DebugType::String { capacity: 3 },
        DebugType::WideString { capacity: 2 },
        DebugType::Enumeration {
            name: "Mode".into(),
            base: ElementaryType::Usint,
            values: vec![("off".into(), 0), ("on".into(), 9)],
        },
        DebugType::Subrange { base: ElementaryType::Int, lower: -5, upper: 5 },
        DebugType::Array { element: 0, stride: 2, dimensions: vec![(1, 2)] },
    ];
    let places = [
        ("int", DebugPlace::Slot(SlotIndex(1)), 0),
        ("bit", DebugPlace::Bit(BytePlace::Memory, 1, 6), 1),
        ("text", DebugPlace::Bytes(BytePlace::Data, 0), 2),
        ("wide", DebugPlace::Bytes(BytePlace::Data, 4), 3),
        ("mode", DebugPlace::Bytes(BytePlace::Data, 12), 4),
        ("range", DebugPlace::Bytes(BytePlace::Data, 14), 5),
        ("array", DebugPlace::Bytes(BytePlace::Data, 16), 6),
        ("outside", DebugPlace::Bytes(BytePlace::Data, 31), 0),
    ];
    let variable = |(name, place, ty): (&str, _, _)| DebugVariable { name: name.into(), place, ty, constant: false };
    let variables = places.into_iter().map(variable).collect();
    let mut container =
        Container { debug: Some(DebugSection { types, variables, ..DebugSection::default() }), ..Container::default() };
    container.parameters.data_region_bytes = 32;
    container.parameters.memory_image_bytes = 2;
    container.types.slots = vec![Storage::I16; 2];
    container
}

#[test]
fn values_are_written_to_their_bytes_alone() {
    let container = container();
    let layout = ImageLayout::new(&container, 1 << 20).unwrap();
    let names = VariableTable::of(&container);
    let fresh = Image::new(layout.clone(), &container);
    let cases =
        [("int", 0xFFFF_FFFF_FFFF_FFFE, "-2", 2), ("bit", 1, "TRUE", 1), ("mode", 9, "on", 1), ("range", 4, "4", 2)];
    for (name, bits, literal, size) in cases {
        let mut image = fresh.clone();
        let variable = names.resolve(name).unwrap();
        assert!(names.write_bits(&mut image, &variable, bits), "{name}");
        assert_eq!(names.text(&image, &variable), literal);
        let bytes = names.bytes_of(&layout, &variable).unwrap();
        assert_eq!(bytes.len(), size, "{name}");
        let changed: Vec<usize> =
            (0..image.bytes().len()).filter(|at| image.bytes()[*at] != fresh.bytes()[*at]).collect();
        assert!(
            !changed.is_empty() && changed.iter().all(|at| bytes.contains(at)),
            "{name}: {changed:?}, not {bytes:?}"
        );
    }
    assert_eq!(fresh.first_difference(&fresh.clone()), None);
}

#[test]
fn texts_are_cut_at_their_capacity() {
    let container = container();
    let layout = ImageLayout::new(&container, 1 << 20).unwrap();
    let names = VariableTable::of(&container);
    let mut image = Image::new(layout.clone(), &container);
    for (name, size, literal) in [("text", 4, "'abc'"), ("wide", 6, "\"ab\"")] {
        let variable = names.resolve(name).unwrap();
        assert_eq!(names.bytes_of(&layout, &variable).unwrap().len(), size);
        assert!(names.write_units(&mut image, &variable, &"abcdef".encode_utf16().collect::<Vec<_>>()));
        assert_eq!(names.text(&image, &variable), literal);
        assert!(!names.write_bits(&mut image, &variable, 1), "{name} is no number");
    }
    assert!(!names.write_units(&mut image, &names.resolve("int").unwrap(), &[65]), "a number is no text");
}

#[test]
fn what_has_no_single_value_or_no_place_is_left_alone() {
    let container = container();
    let layout = ImageLayout::new(&container, 1 << 20).unwrap();
    let names = VariableTable::of(&container);
    let mut image = Image::new(layout.clone(), &container);
    let before = image.clone();
    for name in ["array", "outside"] {
        let variable = names.resolve(name).unwrap();
        assert_eq!(names.bytes_of(&layout, &variable), None, "{name}");
        assert!(!names.write_bits(&mut image, &variable, 1), "{name}");
    }
    assert_eq!(before.bytes(), image.bytes());
    let domain = |name| names.domain(&names.resolve(name).unwrap());
    assert_eq!(domain("array"), None);
    assert_eq!(domain("mode"), Some(Domain::Values { base: ElementaryType::Usint, values: vec![0, 9] }));
    assert_eq!(domain("range"), Some(Domain::Subrange { base: ElementaryType::Int, lower: -5, upper: 5 }));
    assert_eq!(domain("wide"), Some(Domain::Text { wide: true, capacity: 2 }));
}
