//! TwinCAT's files: what is read from them, at which places, and that no XML does harm.

use khz_frontend::diagnostics::{files as rules, has_errors};
use khz_frontend::{Compilation, CompileOptions, SourceInput, check, compile};

fn source(name: &str, text: &str) -> SourceInput {
    SourceInput { name: name.to_owned(), bytes: text.as_bytes().to_vec() }
}

fn messages(found: &Compilation) -> Vec<String> {
    let line = |one: &khz_frontend::diagnostics::Diagnostic| {
        format!("{} {} {}", found.sources.place(one.span), one.code(), one.message)
    };
    found.diagnostics.iter().map(line).collect()
}

fn checked(files: &[(&str, &str)]) -> Vec<String> {
    let files: Vec<SourceInput> = files.iter().map(|(name, text)| source(name, text)).collect();
    messages(&check(&files, &CompileOptions::default()))
}

/// A block as TwinCAT writes it, with what stands in its implementation.
fn pou(declaration: &str, body: &str, more: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\r\n<TcPlcObject Version=\"1.1.0.1\" ProductVersion=\"3.1.4024.12\">\r\n  \
         <POU Name=\"FB_Üb\" Id=\"{{0b8d}}\" SpecialFunc=\"None\">\r\n    <Declaration><![CDATA[{declaration}]]></Declaration>\r\n    \
         <Implementation>\r\n      <ST><![CDATA[{body}]]></ST>\r\n    </Implementation>\r\n{more}    <LineIds Name=\"FB_Üb\">\r\n      \
         <LineId Id=\"3\" Count=\"0\" />\r\n    </LineIds>\r\n  </POU>\r\n</TcPlcObject>"
    )
}

fn wrapped(kind: &str, name: &str, declaration: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<TcPlcObject>\n  <{kind} Name=\"{name}\">\n    <Declaration><![CDATA[{declaration}]]></Declaration>\n  </{kind}>\n</TcPlcObject>\n"
    )
}

const COUNT: &str =
    "FUNCTION_BLOCK FB_Count\r\nVAR_INPUT\r\n  up : BOOL;\r\nEND_VAR\r\nVAR_OUTPUT\r\n  n : INT;\r\nEND_VAR\r\n";

#[test]
fn a_project_of_all_three_kinds_compiles() {
    let limits = wrapped(
        "GVL",
        "GVL_Limits",
        "{attribute 'qualified_only'}\nVAR_GLOBAL CONSTANT\n  MOST : INT := 7;\n  TWICE : INT := 2 * GVL_Limits.MOST;\nEND_VAR\nVAR_GLOBAL\n  n : INT;\nEND_VAR",
    );
    let plain = wrapped(
        "GVL",
        "GVL_Plain",
        "VAR_GLOBAL\n  go : BOOL;\n  n : INT;\n  list : ARRAY[0..GVL_Limits.MOST] OF INT;\nEND_VAR",
    );
    let dut = wrapped("DUT", "ST_Pair", "TYPE ST_Pair :\nSTRUCT\n  a : INT;\n  b : INT;\nEND_STRUCT\nEND_TYPE");
    let block = pou(COUNT, "IF up AND (n < GVL_Limits.MOST) THEN\r\n  n := n + 1;\r\nEND_IF // no line end", "");
    let main = pou(
        "PROGRAM MAIN\r\nVAR\r\n  c : FB_Count;\r\n  p : ST_Pair;\r\nEND_VAR\r\n",
        "c(up := go);\r\np.a := GVL_Limits.n + n;\r\nGVL_Limits.n := c.n;\r\nGVL_Plain.n := GVL_Plain.list[GVL_Limits.MOST];\r\np.b := GVL_Limits.TWICE;\r\n",
        "",
    );
    let files = [
        source("MAIN.TcPOU", &main),
        source("FB_Count.TcPOU", &block),
        source("GVL_Limits.TcGVL", &limits),
        source("gvl_plain.tcgvl", &plain),
        source("ST_Pair.TcDUT", &dut),
    ];
    let found = compile(&files, &CompileOptions::default());
    assert_eq!(messages(&found), [""; 0]);
    let container = &found.resources[0].container;
    khz_bytecode::verify::verify(container.clone()).unwrap();
    let debug = container.debug.as_ref().unwrap();
    let names: Vec<&str> = debug.variables.iter().map(|variable| variable.name.as_str()).collect();
    for name in ["GVL_Limits.n", "n", "MAIN.c", "go"] {
        assert!(names.contains(&name), "{name} in {names:?}");
    }
    assert_eq!(debug.files.len(), 5, "the XML files are the sources");
}

#[test]
fn messages_have_the_places_of_the_xml_file() {
    let text = pou("FUNCTION_BLOCK A\r\nVAR\r\n  x : INTT;\r\nEND_VAR", "(* ä *) y := 1;\r\n  IF TRUE THEN", "");
    let all = checked(&[("A.TcPOU", &text)]);
    assert_eq!(
        all,
        [
            "A.TcPOU:6:7 S0003 there is no type `INTT`",
            "A.TcPOU:9:28 S0001 `y` is not declared",
            "A.TcPOU:15:3 P0017 expected `END_IF`, found `END_FUNCTION_BLOCK`",
        ],
        "{text}"
    );
    let inputs = [source("A.TcPOU", &text)];
    let found = check(&inputs, &CompileOptions::default());
    let shown = khz_frontend::diagnostics::render::render_all(
        &found.diagnostics,
        &found.sources,
        khz_frontend::diagnostics::render::Style::default(),
    );
    assert!(shown.contains("    9 |       <ST><![CDATA[(* ä *) y := 1;"), "{shown}");
}

#[test]
fn everything_on_one_line_and_a_split_section() {
    let text = "<TcPlcObject><POU Name=\"P\"><Declaration><![CDATA[PROGRAM P VAR a : ARRAY[0..9] OF INT; b : BOOL; END_VAR]]></Declaration>\
                <Implementation><ST><![CDATA[b := a[a[1]]]]><![CDATA[>5; // end]]></ST></Implementation></POU></TcPlcObject>";
    assert_eq!(checked(&[("P.TcPOU", text)]), [""; 0]);
    let wrong = text.replace("b := a", "c := a");
    let column = wrong.find("c := a").unwrap() + 1;
    assert_eq!(checked(&[("P.TcPOU", &wrong)]), [format!("P.TcPOU:1:{column} S0001 `c` is not declared")]);
}

#[test]
fn what_is_not_compiled_yet_is_said_where_it_stands() {
    let method = "    <Method Name=\"Run\">\r\n      <Declaration><![CDATA[METHOD Run : BOOL]]></Declaration>\r\n      <Implementation>\r\n        <ST><![CDATA[nonsense]]></ST>\r\n      </Implementation>\r\n    </Method>\r\n";
    let text = pou(COUNT, "n := n + 1;", &format!("{method}{}", method.replace("Method", "Property")));
    assert_eq!(
        checked(&[("A.TcPOU", &text)]),
        [
            "A.TcPOU:15:5 F0013 the Method `Run` is not of the language yet",
            "A.TcPOU:21:5 F0013 the Property `Run` is not of the language yet",
        ]
    );
    let ladder = pou(COUNT, "", "").replace("<ST>", "<NWL>").replace("</ST>", "</NWL>");
    assert_eq!(checked(&[("A.TcPOU", &ladder)]), ["A.TcPOU:13:7 F0012 this is written in NWL, not in Structured Text"]);
    let interface = "<TcPlcObject>\n  <Itf Name=\"I_Run\">\n    <Declaration><![CDATA[INTERFACE I_Run]]></Declaration>\n  </Itf>\n</TcPlcObject>";
    assert_eq!(checked(&[("I.TcIO", interface)]), ["I.TcIO:2:3 F0013 an INTERFACE is not of the language yet"]);
}

#[test]
fn names_of_lists_are_looked_up_and_variables_go_before_them() {
    let one = wrapped("GVL", "One", "{attribute 'qualified_only'}\nVAR_GLOBAL\n  speed : INT;\nEND_VAR");
    let two =
        wrapped("GVL", "Two", "{attribute 'qualified_only'}\nVAR_GLOBAL\n  speed : INT;\n  Speed : INT;\nEND_VAR");
    let text = "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a := speed;\n  a := One.sped;\n  a := Two.speed;\nEND_PROGRAM\n";
    assert_eq!(
        checked(&[("p.st", text), ("One.TcGVL", &one), ("Two.TcGVL", &two)]),
        [
            "p.st:5:8 S0001 `speed` is not declared",
            "p.st:6:12 S0008 this global variable list has no variable `sped`",
            "Two.TcGVL:7:3 S0002 `Speed` is declared twice",
        ]
    );
    let bare = wrapped("GVL", "Bare", "VAR_GLOBAL\n  speed : INT;\nEND_VAR");
    let text = "PROGRAM p\nVAR\n  One : Pair;\n  a : INT;\nEND_VAR\n  a := One.x + speed;\nEND_PROGRAM\nTYPE\n  Pair : STRUCT\n    x : INT;\n  END_STRUCT;\nEND_TYPE\n";
    assert_eq!(checked(&[("p.st", text), ("One.TcGVL", &one), ("Bare.TcGVL", &bare)]), [""; 0]);
    assert_eq!(
        checked(&[("Bare.TcGVL", &bare), ("b.TcGVL", &bare.replace("Bare", "Other"))]),
        ["b.TcGVL:5:3 S0002 `speed` is declared twice"]
    );
}

#[test]
fn hostile_xml_is_refused_in_bounded_time() {
    let laughs =
        "<!DOCTYPE a [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;&a;&a;\">]><TcPlcObject><GVL Name=\"&b;\"/></TcPlcObject>";
    assert_eq!(checked(&[("a.TcGVL", laughs)]), ["a.TcGVL:1:1 F0010 a document type is refused"]);
    let deep = "<a>".repeat(200_000);
    assert_eq!(checked(&[("a.TcDUT", &deep)]), ["a.TcDUT:1:193 F0010 elements nest more than 64 deep"]);
    let entity =
        "<TcPlcObject><DUT Name=\"x\"><Declaration>TYPE x : INT; &lt; END_TYPE</Declaration></DUT></TcPlcObject>";
    assert!(checked(&[("a.TcDUT", entity)])[0].contains("F0010 Structured Text stands in a CDATA section"));
    for text in
        ["", "x", "\u{FEFF}<?xml version=\"1.0\"?>", "<TcPlcObject/>", "<x>&#0;</x>", "<TcPlcObject><POU Name=\"é"]
    {
        let all = checked(&[("a.TcPOU", text)]);
        assert!(!all.is_empty() || text.is_empty(), "{text}");
    }
}

#[test]
fn a_file_cut_off_or_changed_anywhere_is_refused_and_does_no_harm() {
    let whole = pou(COUNT, "IF up THEN n := n + 1; END_IF;\r\n", "");
    for (end, _) in whole.char_indices().filter(|(end, _)| *end > 0) {
        let found = check(&[source("A.TcPOU", &whole[..end])], &CompileOptions::default());
        assert!(has_errors(&found.diagnostics), "cut off after {end} bytes");
    }
    let characters: Vec<char> = whole.chars().collect();
    for at in 0..characters.len() {
        for new in ['<', '&', '\0'] {
            let mut changed = characters.clone();
            changed[at] = new;
            let changed: String = changed.into_iter().collect();
            let found = check(&[source("A.TcPOU", &changed)], &CompileOptions::default());
            for one in &found.diagnostics {
                assert!(found.sources.place(one.span).starts_with("A.TcPOU:"), "{:?}", one.message);
            }
        }
    }
}

#[test]
fn every_rule_is_broken_by_its_wrong_example_and_kept_by_its_right_one() {
    for rule in rules::TABLE.iter().filter(|rule| rule.file != "khz.toml") {
        let codes: Vec<&str> = check(&[source(rule.file, rule.wrong)], &CompileOptions::default())
            .diagnostics
            .iter()
            .map(khz_frontend::diagnostics::Diagnostic::code)
            .collect();
        assert_eq!(codes, [rule.code]);
        assert_eq!(checked(&[(rule.file, rule.right)]), [""; 0], "{}", rule.code);
    }
}
