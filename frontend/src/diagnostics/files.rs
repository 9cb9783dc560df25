//! The table of diagnostics about files that are no plain Structured Text: khz.toml, and XML around ST: F….

use super::rules;

rules! {
    /// All rows of this table.
    table;

    NOT_TOML = "F0001" Error "this project file can not be read" {
        "khz.toml is TOML, at most 1 MiB of UTF-8. docs/projects.md shows all of it."
        in "khz.toml"
        wrong "sources = [\"src\"\n"
        right "sources = [\"src\"]\n"
    }
    UNKNOWN_KEY = "F0002" Error "a project has no such setting" {
        "A misspelt setting would have no effect, so it is refused. At the top are name, sources, libraries, dialect and [task]; in [task] are name, interval and priority."
        in "khz.toml"
        wrong "sources = [\"src\"]\n[task]\nintervall = \"T#5ms\"\n"
        right "sources = [\"src\"]\n[task]\ninterval = \"T#5ms\"\n"
    }
    WRONG_VALUE = "F0003" Error "a wrong value of a setting" {
        "`name` is an identifier, `sources` and `libraries` are lists of paths relative to khz.toml, `dialect` is \"default\" or \"iec\"; of [task], `interval` is a time such as \"T#10ms\" and `priority` a number from 0, the highest, to 65535."
        in "khz.toml"
        wrong "dialect = \"siemens\"\n"
        right "dialect = \"iec\"\n"
    }
    NO_SUCH_FILE = "F0004" Error "a path of a project leads to no source" {
        "Each entry of `sources` and `libraries` names a file, a folder with sources in it, or a pattern that matches one: `*` stands for any part of a name, `**` for any folders."
        in "khz.toml"
        wrong ""
        right ""
    }
    LIBRARY_CYCLE = "F0005" Error "a library needs itself" {
        "Libraries with a khz.toml of their own bring their libraries along. Following them must come to an end."
        in "khz.toml"
        wrong ""
        right ""
    }
    NOT_XML = "F0010" Error "this file is no XML that TwinCAT writes" {
        "The file is cut off or damaged, has a document type, or has Structured Text outside of its CDATA sections. Save it again with TwinCAT."
        in "Level.TcDUT"
        wrong "<TcPlcObject><DUT Name=\"Level\"><Declaration><![CDATA[TYPE Level : INT; END_TYPE]]></Declaration></TcPlcObject>\n"
        right "<TcPlcObject><DUT Name=\"Level\"><Declaration><![CDATA[TYPE Level : INT; END_TYPE]]></Declaration></DUT></TcPlcObject>\n"
    }
    NOT_TWINCAT = "F0011" Error "nothing of TwinCAT in this file" {
        "A .TcPOU holds a POU that declares a PROGRAM, FUNCTION or FUNCTION_BLOCK, a .TcDUT a type, a .TcGVL a list of global variables."
        in "Count.TcPOU"
        wrong "<TcPlcObject><POU Name=\"Count\"><Declaration><![CDATA[VAR n : INT; END_VAR]]></Declaration></POU></TcPlcObject>\n"
        right "<TcPlcObject><POU Name=\"Count\"><Declaration><![CDATA[PROGRAM Count VAR n : INT; END_VAR]]></Declaration><Implementation><ST><![CDATA[n := n + 1;]]></ST></Implementation></POU></TcPlcObject>\n"
    }
    OTHER_LANGUAGE = "F0012" Error "another language of the standard" {
        "Kilohertz compiles Structured Text. Ladder, function block diagrams and sequential charts have to be written in it."
        in "Count.TcPOU"
        wrong "<TcPlcObject><POU Name=\"Count\"><Declaration><![CDATA[PROGRAM Count]]></Declaration><Implementation><NWL/></Implementation></POU></TcPlcObject>\n"
        right "<TcPlcObject><POU Name=\"Count\"><Declaration><![CDATA[PROGRAM Count]]></Declaration><Implementation><ST><![CDATA[;]]></ST></Implementation></POU></TcPlcObject>\n"
    }
    PART_LATER = "F0013" Error "not of the language yet" {
        "Methods, properties, actions, transitions and interfaces are not compiled yet. Write a FUNCTION or FUNCTION_BLOCK of its own."
        in "Count.TcPOU"
        wrong "<TcPlcObject><POU Name=\"Count\"><Declaration><![CDATA[PROGRAM Count]]></Declaration><Implementation><ST><![CDATA[;]]></ST></Implementation><Action Name=\"Reset\"><Implementation><ST><![CDATA[;]]></ST></Implementation></Action></POU></TcPlcObject>\n"
        right "<TcPlcObject><POU Name=\"Count\"><Declaration><![CDATA[PROGRAM Count]]></Declaration><Implementation><ST><![CDATA[;]]></ST></Implementation></POU></TcPlcObject>\n"
    }
}
