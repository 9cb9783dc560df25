//! Standard function blocks (IEC 61131-3 tables 43 to 46) as Structured Text.
//!
//! Each is compiled with the program that uses it. Fields whose names start with `__` are state that no dump shows. Timers
//! read `__SYSTEM_UP_LTIME`, the time of the round, so that all of a round see one time and a second call in it sees none pass.

/// One standard function block.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StandardBlock {
    /// Its type name, in upper case.
    pub name: String,
    /// Its declaration in Structured Text.
    pub source: String,
}

/// What a template is specialised by: name suffixes and the type that stands for `{T}`.
type Forms = &'static [(&'static str, &'static str)];

struct Template {
    name: &'static str,
    forms: Forms,
    source: &'static str,
}

const PLAIN: Forms = &[("", "")];
const TIMES: Forms = &[("", "TIME"), ("_TIME", "TIME"), ("_LTIME", "LTIME")];
const COUNTS: Forms =
    &[("", "INT"), ("_INT", "INT"), ("_DINT", "DINT"), ("_LINT", "LINT"), ("_UDINT", "UDINT"), ("_ULINT", "ULINT")];

/// The templates. `{N}` is the name, `{T}` the type of the form, `{MIN}` and `{MAX}` its limits.
static TEMPLATES: &[Template] = &[
    Template {
        name: "TON",
        forms: TIMES,
        source: "FUNCTION_BLOCK {N}
VAR_INPUT IN : BOOL; PT : {T}; END_VAR
VAR_OUTPUT Q : BOOL; ET : {T}; END_VAR
VAR __running : BOOL; __start : LTIME; END_VAR
IF NOT IN THEN
  __running := FALSE; Q := FALSE; ET := {T}#0s;
ELSIF NOT __running THEN
  __running := TRUE; __start := __SYSTEM_UP_LTIME; ET := {T}#0s; Q := PT <= {T}#0s;
ELSIF NOT Q THEN
  ET := LTIME_TO_{T}(__SYSTEM_UP_LTIME - __start);
  IF ET >= PT THEN ET := PT; Q := TRUE; END_IF;
END_IF;
END_FUNCTION_BLOCK
",
    },
    Template {
        name: "TOF",
        forms: TIMES,
        source: "FUNCTION_BLOCK {N}
VAR_INPUT IN : BOOL; PT : {T}; END_VAR
VAR_OUTPUT Q : BOOL; ET : {T}; END_VAR
VAR __running : BOOL; __start : LTIME; END_VAR
IF IN THEN
  __running := FALSE; Q := TRUE; ET := {T}#0s;
ELSIF Q THEN
  IF NOT __running THEN
    __running := TRUE; __start := __SYSTEM_UP_LTIME; ET := {T}#0s;
  ELSE
    ET := LTIME_TO_{T}(__SYSTEM_UP_LTIME - __start);
  END_IF;
  IF ET >= PT THEN ET := PT; Q := FALSE; __running := FALSE; END_IF;
END_IF;
END_FUNCTION_BLOCK
",
    },
    Template {
        name: "TP",
        forms: TIMES,
        source: "FUNCTION_BLOCK {N}
VAR_INPUT IN : BOOL; PT : {T}; END_VAR
VAR_OUTPUT Q : BOOL; ET : {T}; END_VAR
VAR __last : BOOL; __done : BOOL; __start : LTIME; END_VAR
IF Q THEN
  ET := LTIME_TO_{T}(__SYSTEM_UP_LTIME - __start);
  IF ET >= PT THEN ET := PT; Q := FALSE; __done := TRUE; END_IF;
ELSIF IN AND NOT __last AND NOT __done THEN
  __start := __SYSTEM_UP_LTIME; ET := {T}#0s;
  IF PT > {T}#0s THEN Q := TRUE; ELSE __done := TRUE; END_IF;
END_IF;
IF __done AND NOT IN THEN __done := FALSE; ET := {T}#0s; END_IF;
__last := IN;
END_FUNCTION_BLOCK
",
    },
    Template {
        name: "CTU",
        forms: COUNTS,
        source: "FUNCTION_BLOCK {N}
VAR_INPUT CU : BOOL; R : BOOL; PV : {T}; END_VAR
VAR_OUTPUT Q : BOOL; CV : {T}; END_VAR
VAR __cu : BOOL; END_VAR
IF R THEN CV := 0;
ELSIF CU AND NOT __cu AND CV < {MAX} THEN CV := CV + 1;
END_IF;
__cu := CU;
Q := CV >= PV;
END_FUNCTION_BLOCK
",
    },
    Template {
        name: "CTD",
        forms: COUNTS,
        source: "FUNCTION_BLOCK {N}
VAR_INPUT CD : BOOL; LD : BOOL; PV : {T}; END_VAR
VAR_OUTPUT Q : BOOL; CV : {T}; END_VAR
VAR __cd : BOOL; END_VAR
IF LD THEN CV := PV;
ELSIF CD AND NOT __cd AND CV > {MIN} THEN CV := CV - 1;
END_IF;
__cd := CD;
Q := CV <= 0;
END_FUNCTION_BLOCK
",
    },
    Template {
        name: "CTUD",
        forms: COUNTS,
        source: "FUNCTION_BLOCK {N}
VAR_INPUT CU : BOOL; CD : BOOL; R : BOOL; LD : BOOL; PV : {T}; END_VAR
VAR_OUTPUT QU : BOOL; QD : BOOL; CV : {T}; END_VAR
VAR __cu : BOOL; __cd : BOOL; __up : BOOL; __down : BOOL; END_VAR
__up := CU AND NOT __cu;
__down := CD AND NOT __cd;
__cu := CU;
__cd := CD;
IF R THEN CV := 0;
ELSIF LD THEN CV := PV;
ELSIF __up AND NOT __down THEN
  IF CV < {MAX} THEN CV := CV + 1; END_IF;
ELSIF __down AND NOT __up THEN
  IF CV > {MIN} THEN CV := CV - 1; END_IF;
END_IF;
QU := CV >= PV;
QD := CV <= 0;
END_FUNCTION_BLOCK
",
    },
    Template {
        name: "R_TRIG",
        forms: PLAIN,
        source: "FUNCTION_BLOCK {N}
VAR_INPUT CLK : BOOL; END_VAR
VAR_OUTPUT Q : BOOL; END_VAR
VAR __last : BOOL; END_VAR
Q := CLK AND NOT __last;
__last := CLK;
END_FUNCTION_BLOCK
",
    },
    Template {
        name: "F_TRIG",
        forms: PLAIN,
        source: "FUNCTION_BLOCK {N}
VAR_INPUT CLK : BOOL; END_VAR
VAR_OUTPUT Q : BOOL; END_VAR
VAR __last : BOOL; END_VAR
Q := __last AND NOT CLK;
__last := CLK;
END_FUNCTION_BLOCK
",
    },
    Template {
        name: "SR",
        forms: PLAIN,
        source: "FUNCTION_BLOCK {N}
VAR_INPUT S1 : BOOL; R : BOOL; END_VAR
VAR_OUTPUT Q1 : BOOL; END_VAR
Q1 := S1 OR (NOT R AND Q1);
END_FUNCTION_BLOCK
",
    },
    Template {
        name: "RS",
        forms: PLAIN,
        source: "FUNCTION_BLOCK {N}
VAR_INPUT S : BOOL; R1 : BOOL; END_VAR
VAR_OUTPUT Q1 : BOOL; END_VAR
Q1 := NOT R1 AND (S OR Q1);
END_FUNCTION_BLOCK
",
    },
];

/// Lowest and highest value of the integer types that counters have.
fn limits(ty: &str) -> (&'static str, &'static str) {
    match ty {
        "INT" => ("-32768", "32767"),
        "DINT" => ("-2147483648", "2147483647"),
        "LINT" => ("-9223372036854775808", "9223372036854775807"),
        "UDINT" => ("0", "4294967295"),
        "ULINT" => ("0", "18446744073709551615"),
        _ => ("0", "0"),
    }
}

/// Every standard function block, in a fixed order.
pub fn all() -> impl Iterator<Item = StandardBlock> {
    TEMPLATES.iter().flat_map(|template| {
        template.forms.iter().map(|(suffix, ty)| {
            let name = format!("{}{suffix}", template.name);
            let (min, max) = limits(ty);
            let source = template.source.replace("{N}", &name).replace("{T}", ty);
            StandardBlock { source: source.replace("{MIN}", min).replace("{MAX}", max), name }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_is_specialised() {
        let names: Vec<String> = all().map(|block| block.name).collect();
        for wanted in ["TON", "TON_LTIME", "TOF", "TP", "CTU", "CTU_DINT", "CTUD_ULINT", "R_TRIG", "F_TRIG", "SR", "RS"]
        {
            assert!(names.iter().any(|name| name == wanted), "{wanted}");
        }
        for block in all() {
            assert!(!block.source.contains('{'), "{}", block.source);
        }
    }
}
