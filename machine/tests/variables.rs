//! Names, literals, dumps and reports over a debug section with every kind of type, and over hostile ones.

use khz_bytecode::container::{
    Container, DebugPlace, DebugSection, DebugType, DebugVariable, ElementaryType, InitRun, LineEntry, ProgramInstance,
    Region, SourceFile, Task, TaskExtension,
};
use khz_bytecode::ids::{FunctionId, InstanceId, SlotIndex, TaskId};
use khz_bytecode::value::{BytePlace, Storage};
use khz_machine::engine::Entry;
use khz_machine::image::{Image, ImageLayout};
use khz_machine::report::{TrapReport, describe};
use khz_machine::trap::{CodePlace, Trap, TrapCode};
use khz_machine::variables::{DirectAddress, VariableError, VariableTable, VariableValue};

/// Data offsets: 16 a: ARRAY[1..2,-1..1] OF INT; 32 s: Motor; 48 text: STRING[5]; 56 wide: WSTRING[3]; 64 one of each elementary type, 8 bytes apart.
fn container() -> Container {
    let mut types: Vec<DebugType> = ElementaryType::ALL.iter().map(|ty| DebugType::Elementary(*ty)).collect();
    let id = |ty: ElementaryType| ty as u16;
    let first = types.len() as u16;
    types.push(DebugType::Array { element: id(ElementaryType::Int), stride: 2, dimensions: vec![(1, 2), (-1, 1)] });
    types.push(DebugType::Enumeration {
        name: "Color".into(),
        base: ElementaryType::Sint,
        values: vec![("Red".into(), 0), ("Green".into(), -5)],
    });
    let fields = vec![("Speed".into(), 0, id(ElementaryType::Real)), ("State".into(), 4, first + 1)];
    types.push(DebugType::Record { name: "Motor".into(), fields });
    types.push(DebugType::String { capacity: 5 });
    types.push(DebugType::WideString { capacity: 3 });
    let at = |name: &str, place, ty| DebugVariable { name: name.into(), place, ty, constant: false };
    let data = |name: &str, offset, ty| at(name, DebugPlace::Bytes(BytePlace::Data, offset), ty);
    let mut variables = vec![
        at("Count", DebugPlace::Slot(SlotIndex(1)), id(ElementaryType::Uint)),
        data("App.A", 16, first),
        data("App.S", 32, first + 2),
        data("App.Text", 48, first + 3),
        data("App.Wide", 56, first + 4),
        at("Lamp", DebugPlace::Bit(BytePlace::Output, 1, 3), id(ElementaryType::Bool)),
    ];
    types.push(DebugType::Subrange { base: ElementaryType::Int, lower: -2, upper: 5 });
    types.push(DebugType::Subrange { base: ElementaryType::Ulint, lower: i64::MAX, upper: -1 });
    types.push(DebugType::Array { element: first + 5, stride: 2, dimensions: vec![(1, 3)] });
    variables.extend([data("Step", 400, first + 5), data("High", 408, first + 6)]);
    variables.push(DebugVariable { constant: true, ..data("Fixed", 416, first + 7) });
    for (position, ty) in ElementaryType::ALL.iter().enumerate() {
        variables.push(data(&format!("all.{}", ty.name()), 64 + 8 * position as u32, id(*ty)));
    }
    let debug = DebugSection {
        files: vec![SourceFile { name: "plant.st".into(), hash: [0; 32] }],
        lines: vec![
            LineEntry { function: FunctionId(0), offset: 0, file: 0, line: 3, column: 5 },
            LineEntry { function: FunctionId(0), offset: 10, file: 0, line: 4, column: 9 },
            LineEntry { function: FunctionId(2), offset: 4, file: 0, line: 8, column: 1 },
        ],
        function_names: vec!["Main".into(), "Sub".into(), "Other".into()],
        types,
        variables,
        instance_names: vec!["App".into()],
        ..DebugSection::default()
    };
    let mut container = Container { debug: Some(debug), ..Container::default() };
    container.parameters.data_region_bytes = 512;
    container.parameters.input_image_bytes = 8;
    container.parameters.output_image_bytes = 8;
    container.parameters.memory_image_bytes = 32;
    container.types.slots = vec![Storage::I64, Storage::U16];
    container.types.init_image =
        vec![InitRun { region: Region::Data, offset: 16, repeat: 2, bytes: vec![1, 0, 0xFE, 0xFF, 3, 0] }];
    container.tasks.tasks = vec![Task { id: TaskId(7), ..Task::default() }];
    container.types.task_extensions = vec![TaskExtension { name: "Fast".into(), ..TaskExtension::default() }];
    container.tasks.instances =
        vec![ProgramInstance { id: InstanceId(9), task: TaskId(7), ..ProgramInstance::default() }];
    container
}

fn image(container: &Container) -> Image {
    Image::new(ImageLayout::new(container, 1 << 20).unwrap(), container)
}

/// Writes `literal` to `name`: its text afterwards, or the error.
fn set(name: &str, literal: &str) -> Result<String, String> {
    let container = container();
    let (table, mut image) = (VariableTable::of(&container), image(&container));
    let variable = table.resolve(name).map_err(|error| error.to_string())?;
    let before = image.clone();
    match table.write(&mut image, &variable, literal) {
        Ok(()) => Ok(table.text(&image, &variable)),
        Err(error) => {
            assert_eq!(image.bytes(), before.bytes(), "a refused literal writes nothing");
            Err(error.to_string())
        }
    }
}

#[test]
fn paths_find_parts_in_any_case_and_keep_the_declared_spelling() {
    let container = container();
    let table = VariableTable::of(&container);
    let find = |path: &str| table.resolve(path).map(|variable| (variable.name, variable.place));
    let data = |offset| DebugPlace::Bytes(BytePlace::Data, offset);
    assert_eq!(find("app.s.SPEED"), Ok(("App.S.Speed".into(), data(32))));
    assert_eq!(find(" APP.a[ 2 , -1 ]"), Ok(("App.A[2,-1]".into(), data(22))));
    assert_eq!(find("count"), Ok(("Count".into(), DebugPlace::Slot(SlotIndex(1)))));
    assert_eq!(find("%mw3"), Ok(("%MW3".into(), DebugPlace::Bytes(BytePlace::Memory, 6))));
    for (path, message) in [
        ("nope", "there is no variable `nope`"),
        ("app", "there is no variable `app`"),
        ("", "there is no variable ``"),
        ("app.s.nope", "`App.S` has no field `nope`"),
        ("app.s.speed.x", "`App.S.Speed` has no field `x`"),
        ("app.a[3,0]", "index 3 of `App.A` is outside 1..2"),
        ("app.a[1,2]", "index 2 of `App.A` is outside -1..1"),
        ("app.a[1]", "`App.A` takes 2 indices, not `[1]`"),
        ("app.a[1,x]", "`App.A` takes 2 indices, not `[1,x]`"),
        ("app.s[1]", "`App.S` takes 0 indices, not `[1]`"),
        ("app.a[1,0", "there is no variable `app.a[1,0`"),
        ("app.a]", "there is no variable `app.a]`"),
        ("%qz1", "`%qz1` is not a direct address such as %IX0.1, %QW2 or %MD4"),
    ] {
        assert_eq!(find(path).unwrap_err().to_string(), message);
    }
    assert!(matches!(VariableTable::stripped().resolve("x"), Err(VariableError::Stripped(_))));
    assert!(VariableTable::stripped().resolve("%QX0.0").is_ok());
}

#[test]
fn direct_addresses() {
    let at = |text: &str| DirectAddress::parse(text).map(|address| (address.place, address.ty.name()));
    assert_eq!(at("%IX1.7"), Some((DebugPlace::Bit(BytePlace::Input, 1, 7), "BOOL")));
    assert_eq!(at("%q0.3"), Some((DebugPlace::Bit(BytePlace::Output, 0, 3), "BOOL")));
    assert_eq!(at("%MD4"), Some((DebugPlace::Bytes(BytePlace::Memory, 16), "DWORD")));
    assert_eq!(at("%qb4"), Some((DebugPlace::Bytes(BytePlace::Output, 4), "BYTE")));
    assert_eq!(at("%IL1"), Some((DebugPlace::Bytes(BytePlace::Input, 8), "LWORD")));
    for wrong in [
        "",
        "%",
        "%I",
        "%IX0",
        "%IX0.8",
        "%IX.1",
        "%IX0.",
        "%IW",
        "%IW-1",
        "%IW+1",
        "%XW1",
        "%MW4294967295",
        "%IX0.1.2",
        "%Iä",
    ] {
        assert_eq!(at(wrong), None, "{wrong}");
    }
}

#[test]
fn literals_enter_and_read_back() {
    for (name, literal, text) in [
        ("all.bool", "true", "TRUE"),
        ("all.bool", "BOOL#0", "FALSE"),
        ("all.sint", "-128", "-128"),
        ("all.usint", "16#fF", "255"),
        ("all.ulint", "18446744073709551615", "18446744073709551615"),
        ("all.lint", "-9223372036854775808", "-9223372036854775808"),
        ("all.word", "WORD#2#1111_0000", "240"),
        ("all.udint", "4294967295", "4294967295"),
        ("all.real", "0.1", "0.1"),
        ("all.real", "real#-1E20", "-1.0E20"),
        ("all.real", "NaN", "NaN"),
        ("all.lreal", "-Infinity", "-Infinity"),
        ("all.lreal", " 3 ", "3.0"),
        ("all.time", "time#90s", "T#1m30s"),
        ("all.ltime", "LTIME#1us", "LT#1us"),
        ("all.date", "D#2024-02-29", "D#2024-02-29"),
        ("all.date", "DATE#1969-12-31", "D#1969-12-31"),
        ("all.tod", "TIME_OF_DAY#1:02:03.5", "TOD#01:02:03.5"),
        ("all.dt", "dt#2024-02-29-12:00", "DT#2024-02-29-12:00:00"),
        ("all.ldt", "LDT#1970-01-01-00:00:00.000000001", "LDT#1970-01-01-00:00:00.000000001"),
        ("all.char", "'x'", "'x'"),
        ("all.char", "'$00'", "'$00'"),
        ("all.wchar", "\"ä\"", "\"$00E4\""),
        ("app.s.state", "green", "Green"),
        ("app.s.state", "COLOR#RED", "Red"),
        ("app.s.state", "color.green", "Green"),
        ("app.s.state", "-5", "Green"),
        ("app.s.state", "COLOR#0", "Red"),
        ("step", " -2", "-2"),
        ("step", "INT#16#5", "5"),
        ("high", "18446744073709551615", "18446744073709551615"),
        ("high", "9223372036854775807", "9223372036854775807"),
        ("app.text", "'a$'b$0A'", "'a$'b$0A'"),
        ("app.text", "'ü'", "'$FC'"),
        ("app.text", "''", "''"),
        ("app.wide", "\"a$20AC\"", "\"a$20AC\""),
        ("app.a[2,1]", "INT#-1", "-1"),
        ("count", "65535", "65535"),
        ("lamp", "1", "TRUE"),
        ("%md7", "16#FFFFFFFF", "4294967295"),
        ("%ix7.7", "1", "TRUE"),
    ] {
        assert_eq!(set(name, literal).as_deref(), Ok(text), "{name} := {literal}");
        let again = set(name, text);
        assert_eq!(again.as_deref(), Ok(text), "what is written reads back");
    }
}

#[test]
fn wrong_literals_name_the_variable() {
    for (name, literal, message) in [
        ("all.sint", "128", "`all.SINT` is SINT: 128 is outside -128 to 127"),
        ("all.uint", "-1", "`all.UINT` is UINT: -1 is outside 0 to 65535"),
        ("all.int", "1.5", "`all.INT` is INT: `1.5` is not a whole number"),
        ("all.int", "DINT#1", "`all.INT` is INT: `DINT#1` is a literal of DINT"),
        ("all.int", "", "`all.INT` is INT: `` is not a whole number"),
        ("all.bool", "2", "`all.BOOL` is BOOL: `2` is neither TRUE nor FALSE"),
        ("all.real", "1e99", "`all.REAL` is REAL: 1e99 is beyond the largest number"),
        ("all.lreal", "1.0x", "`all.LREAL` is LREAL: `1.0x` is not a number"),
        ("all.time", "5", "`all.TIME` is TIME: `5` is not a duration, for example T#1m30s"),
        ("all.time", "", "`all.TIME` is TIME: `` is not a duration, for example T#1m30s"),
        ("all.time", "T#200000d", "`all.TIME` is TIME: T#200000d is beyond 292 years"),
        (
            "all.date",
            "D#2023-02-29",
            "`all.DATE` is DATE: `D#2023-02-29` is not such a moment, for example D#2024-02-29",
        ),
        ("all.tod", "D#2024-01-01", "`all.TOD` is TOD: `D#2024-01-01` is not such a moment, for example TOD#12:34:56"),
        ("all.char", "'xy'", "`all.CHAR` is CHAR: 2 characters where one is wanted"),
        ("app.s.state", "Blue", "`App.S.State` is Color: `Blue` is none of its values (Red, Green)"),
        ("app.s.state", "17", "`App.S.State` is Color: `17` is none of its values (Red, Green)"),
        ("app.s.state", "5", "`App.S.State` is Color: `5` is none of its values (Red, Green)"),
        ("step", "6", "`Step` is INT (-2..5): 6 is outside -2 to 5"),
        ("step", "-3", "`Step` is INT (-2..5): -3 is outside -2 to 5"),
        ("step", "x", "`Step` is INT (-2..5): `x` is not a whole number"),
        (
            "high",
            "5",
            "`High` is ULINT (9223372036854775807..18446744073709551615): 5 is outside 9223372036854775807 to 18446744073709551615",
        ),
        ("fixed[2]", "3", "`Fixed[2]` is a CONSTANT and can not be written"),
        ("app.text", "'123456'", "`App.Text` is STRING[5]: 6 characters are more than it can hold"),
        ("app.text", "abc", "`App.Text` is STRING[5]: a character string stands between two '"),
        ("app.text", "'€'", "`App.Text` is STRING[5]: STRING has no character `€` (Latin-1)"),
        ("app.text", "'a$00'", "`App.Text` is STRING[5]: character 0 ends a string and can not stand in it"),
        ("app.text", "'a'b'", "`App.Text` is STRING[5]: write $' for ' inside a string"),
        ("app.s", "1", "`App.S` is a structure: name one of its parts"),
        ("app.a", "1", "`App.A` is an array: name one of its parts"),
        ("%qd2", "1", "`%QD2` lies outside the memory of this program"),
    ] {
        assert_eq!(set(name, literal), Err(message.to_string()));
    }
    let escape = set("app.text", "'$Z'").unwrap_err();
    assert!(escape.starts_with("`App.Text` is STRING[5]: `$` starts an escape"), "{escape}");
    assert!(set("app.text", "'$").is_err() && set("app.text", "'$'").is_err() && set("app.text", "'").is_err());
}

#[test]
fn writes_touch_their_own_bits_only() {
    let container = container();
    let (table, mut image) = (VariableTable::of(&container), image(&container));
    image.bytes_mut().fill(0xFF);
    let layout = image.layout().clone();
    let lamp = table.resolve("lamp").unwrap();
    table.write(&mut image, &lamp, "0").unwrap();
    assert_eq!(image.bytes()[layout.output.start as usize + 1], 0xF7);
    assert_eq!(table.read(&image, &lamp), Ok(VariableValue::Bool(false)));
    let text = table.resolve("app.text").unwrap();
    table.write(&mut image, &text, "'ab'").unwrap();
    let at = layout.data.start as usize + 48;
    assert_eq!(image.bytes()[at..at + 6], [b'a', b'b', 0, 0xFF, 0xFF, 0xFF]);
    let wide = table.resolve("app.wide").unwrap();
    table.write(&mut image, &wide, "\"a\"").unwrap();
    assert_eq!(image.bytes()[at + 8..at + 14], [b'a', 0, 0, 0, 0xFF, 0xFF]);
    table.write(&mut image, &table.resolve("all.real").unwrap(), "NaN").unwrap();
    let at = layout.data.start as usize + 64 + 8 * ElementaryType::Real as usize;
    assert_eq!(image.bytes()[at..at + 5], [0, 0, 0xC0, 0xFF, 0xFF]);
}

#[test]
fn dumps() {
    let container = container();
    let (table, mut image) = (VariableTable::of(&container), image(&container));
    let mut set = |name: &str, literal: &str| table.write(&mut image, &table.resolve(name).unwrap(), literal).unwrap();
    set("app.text", "'q\"$FC$01'");
    set("app.wide", "\"$D800x\"");
    set("app.s.state", "green");
    set("all.ulint", "18446744073709551615");
    set("all.real", "NaN");
    set("all.lreal", "0.1");
    set("all.bool", "1");
    let json = table.dump_json(&image, 1000, 2);
    let start = "{\"time_us\":1000,\"rounds\":2,\"variables\":{\"Count\":0,\"App.A\":[[1,-2,3],[1,-2,3]],\
        \"App.S\":{\"Speed\":0.0,\"State\":\"Green\"},\"App.Text\":\"q\\\"ü\\u0001\",\"App.Wide\":\"\\ud800x\",\"Lamp\":false,\
        \"Step\":0,\"High\":0,\"Fixed\":[0,0,0],\"all.BOOL\":true,\"all.SINT\":0,";
    assert!(json.starts_with(start), "{json}");
    assert!(json.contains("\"all.ULINT\":18446744073709551615,"), "{json}");
    assert!(json.contains("\"all.REAL\":\"NaN\",\"all.LREAL\":0.1,\"all.TIME\":\"T#0ms\","), "{json}");
    assert!(json.contains("\"all.CHAR\":\"\\u0000\","), "{json}");
    assert!(json.ends_with("}}\n"));
    let text = table.dump_text(&image);
    let lines: Vec<_> = text.lines().collect();
    assert_eq!(lines[0], "App.A := [[1, -2, 3], [1, -2, 3]]");
    assert_eq!(lines[1], "App.S := (Speed := 0.0, State := Green)");
    assert!(lines.is_sorted() && lines.len() == 9 + ElementaryType::ALL.len());
    let leaves = table.leaves(&table.resolve("app.a").unwrap(), 4);
    let names: Vec<_> = leaves.iter().map(|leaf| leaf.name.as_str()).collect();
    assert_eq!(names, ["App.A[1,-1]", "App.A[1,0]", "App.A[1,1]", "App.A[2,-1]"]);
    assert_eq!(table.text(&image, &leaves[1]), "-2");
}

/// A debug section whose types would give more values than there are atoms, or point outside.
#[test]
fn a_hostile_debug_section_costs_little() {
    let mut container = container();
    let debug = container.debug.as_mut().unwrap();
    debug.types = vec![DebugType::Elementary(ElementaryType::Byte), DebugType::String { capacity: 60_000 }];
    for deep in 1..100_u16 {
        let part = |name: &str| (name.to_string(), 0, deep);
        debug.types.push(DebugType::Record { name: "R".into(), fields: vec![part("a"), part("b"), part("c")] });
    }
    let all = (i32::MIN, i32::MAX);
    let empty = debug.types.len() as u16;
    debug.types.push(DebugType::Record { name: "E".into(), fields: vec![] });
    debug.types.push(DebugType::Array { element: empty, stride: 0, dimensions: vec![all, all, all] });
    debug.types.push(DebugType::Array { element: empty + 1, stride: 0, dimensions: vec![all, (5, 1)] });
    debug.types.push(DebugType::Array { element: empty + 2, stride: u32::MAX, dimensions: vec![] });
    debug.types.push(DebugType::Array { element: 60_000, stride: 1, dimensions: vec![(0, 3)] });
    debug.types.push(DebugType::Record { name: "Self".into(), fields: vec![("me".into(), 0, empty + 5)] });
    let places = [
        DebugPlace::Bytes(BytePlace::Data, 16),
        DebugPlace::Bytes(BytePlace::Data, u32::MAX),
        DebugPlace::Slot(SlotIndex(u16::MAX)),
        DebugPlace::Slot(SlotIndex(0)),
        DebugPlace::Bit(BytePlace::Input, 9, 200),
        DebugPlace::Bytes(BytePlace::Frame, 0),
    ];
    let types = [0, 1, 50, 100, empty, empty + 1, empty + 2, empty + 3, empty + 4, empty + 5, u16::MAX];
    let pairs = types.iter().flat_map(|ty| places.iter().map(move |place| (*ty, *place)));
    debug.variables = pairs
        .enumerate()
        .map(|(at, (ty, place))| DebugVariable { name: format!("v{at}"), place, ty, constant: false })
        .collect();
    let (table, mut image) = (VariableTable::of(&container), image(&container));
    assert!(table.dump_json(&image, 0, 0).len() < 20 << 20);
    assert!(table.dump_text(&image).len() < 20 << 20);
    for variable in table.variables().collect::<Vec<_>>() {
        let _ = (table.read(&image, &variable), table.write(&mut image, &variable, "1"), table.type_name(&variable));
        assert!(table.leaves(&variable, 100).len() <= 100);
        for step in [".a.b.c", "[0]", "[-2147483648,2147483647,0]", "[0,1]"] {
            let _ = table.resolve(&format!("{}{step}", variable.name));
        }
        let endless = format!("{}{}", variable.name, ".me".repeat(100_000));
        assert!(table.resolve(&endless).is_err());
    }
}

#[test]
fn traps_are_reported_by_place_and_name() {
    let mut container = container();
    let place = |function, offset| CodePlace { function: FunctionId(function), offset };
    let mut trap = Trap::new(TrapCode::ArrayIndex, place(0, 12), [11, 1, 10]);
    trap.push_caller(place(2, 3));
    let report = TrapReport::new(&trap, Entry::Instance(0), &container);
    assert_eq!(
        report.to_json(),
        "{\"trap\":\"array index\",\"task\":\"Fast\",\"instance\":\"App\",\"function\":\"Main\",\"file\":\"plant.st\",\"line\":4,\
         \"column\":9,\"values\":{\"index\":11,\"lower\":1,\"upper\":10}}"
    );
    let text = report.to_string();
    assert!(text.starts_with("plant.st:4:9: trap *array index*: "), "{text}");
    for part in [
        "index = 11, lower = 1, upper = 10",
        "in Main, program instance App, task Fast",
        "called from offset 3 in Other",
    ] {
        assert!(text.contains(part), "{part} in {text}");
    }
    let lines = [
        (0, 0, Some(3)),
        (0, 9, Some(3)),
        (0, 10, Some(4)),
        (1, 50, None),
        (2, 3, None),
        (2, 4, Some(8)),
        (9, 0, None),
    ];
    for (function, offset, line) in lines {
        let described = describe(place(function, offset), &container);
        assert_eq!(described.source.map(|source| source.line), line, "{function} {offset}");
    }
    container.debug = None;
    let report = TrapReport::new(&trap, Entry::Instance(0), &container);
    assert_eq!((report.task.as_deref(), report.instance.as_deref()), (Some("Fast"), Some("instance 9")));
    assert!(report.to_string().contains("offset 12 in function 0"), "{report}");
    assert!(report.to_json().contains("\"file\":null,\"line\":null,\"column\":null,\"offset\":12,"));
    container.types.task_extensions.clear();
    let nameless = TrapReport::new(&trap, Entry::Instance(0), &container);
    assert_eq!(nameless.task.as_deref(), Some("task 7"));
    let early = TrapReport::new(&Trap::new(TrapCode::Watchdog, place(0, 0), [0; 3]), Entry::Init, &container);
    assert!(
        early.to_json().contains("\"task\":null,\"instance\":null,") && early.to_json().ends_with("\"values\":{}}")
    );
}
