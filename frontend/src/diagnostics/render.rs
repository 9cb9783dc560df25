//! Diagnostics as text for people.
//!
//! ```text
//! plant.st:12:9: error[P0004]: expected `;` after this statement, found `y`
//!    12 |   x := 1
//!       |         ^
//! help: …
//! ```
//!
//! The first line is what editors and CI systems parse; cli.md promises its form. Columns count characters; a tab in the
//! excerpt becomes one space, so that carets stand where they belong whatever the terminal's tab stops are. Of a very
//! long line only the part around the place is shown.

use super::{Diagnostic, Severity};
use crate::source::{SourceFile, SourceMap, Span};
use std::fmt::Write;

/// How many characters of a line are shown at most.
const MAX_EXCERPT_CHARS: usize = 120;

/// How many characters before the place are shown of a line that is too long.
const CHARS_BEFORE_PLACE: usize = 40;

/// How the text is to look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Style {
    /// With ANSI colours. The caller knows whether this goes to a terminal.
    pub colour: bool,
}

impl Style {
    fn paint(self, colour: &str, text: &str) -> String {
        if self.colour { format!("\x1b[{colour}m{text}\x1b[0m") } else { text.to_owned() }
    }

    fn severity(self, severity: Severity) -> &'static str {
        match severity {
            Severity::Error => "1;31",
            Severity::Warning => "1;33",
            Severity::Note => "1;36",
        }
    }
}

const BOLD: &str = "1";
const DIM: &str = "2";
const HELP: &str = "1;32";

/// One diagnostic with its excerpts, ending in a line break.
pub fn render(diagnostic: &Diagnostic, sources: &SourceMap, style: Style) -> String {
    let mut out = String::new();
    let colour = style.severity(diagnostic.severity);
    let word = format!("{}[{}]", diagnostic.severity.word(), diagnostic.code());
    let place = style.paint(BOLD, &sources.place(diagnostic.span));
    put(&mut out, format_args!("{place}: {}: {}\n", style.paint(colour, &word), diagnostic.message));
    excerpt(&mut out, sources, diagnostic.span, "", style, colour);
    for (span, text) in &diagnostic.labels {
        // A label of another file needs its place; one of the same file shows its line.
        if span.file != diagnostic.span.file {
            put(&mut out, format_args!("{}:\n", style.paint(BOLD, &sources.place(*span))));
        }
        excerpt(&mut out, sources, *span, text, style, Style::default().severity(Severity::Note));
    }
    if let Some(help) = &diagnostic.help {
        put(&mut out, format_args!("{}: {help}\n", style.paint(HELP, "help")));
    }
    out
}

/// All of them, in order.
pub fn render_all(diagnostics: &[Diagnostic], sources: &SourceMap, style: Style) -> String {
    diagnostics.iter().map(|found| render(found, sources, style)).collect()
}

/// Writing to a text cannot fail.
fn put(out: &mut String, text: std::fmt::Arguments<'_>) {
    let written = out.write_fmt(text);
    debug_assert!(written.is_ok(), "a String takes everything");
}

/// The line of a span's start with carets below it.
fn excerpt(out: &mut String, sources: &SourceMap, span: Span, label: &str, style: Style, colour: &str) {
    let Some(file) = sources.file(span.file) else { return };
    let line = file.line_at(span.start);
    let text = file.shown_line(line);
    if text.trim().is_empty() && label.is_empty() {
        return;
    }
    let (shown, caret_at, carets) = window(file, line, text, span);
    let number = format!("{line:>5}");
    put(out, format_args!("{} {shown}\n", style.paint(DIM, &format!("{number} |"))));
    let gap = " ".repeat(caret_at);
    let marks = style.paint(colour, format!("{} {label}", "^".repeat(carets)).trim_end());
    put(out, format_args!("{} {gap}{marks}\n", style.paint(DIM, "      |")));
}

/// The part of a line to show, where in it the carets begin and how many there are, all in characters.
fn window(file: &SourceFile, line: u32, text: &str, span: Span) -> (String, usize, usize) {
    let column = (file.line_column(span.start).column as usize).saturating_sub(1);
    let span_in_line = {
        let start = (span.start - file.line_start(line).min(span.start)) as usize;
        let end = start.saturating_add(span.len() as usize).min(text.len());
        text.get(start.min(text.len())..end).map_or(1, |part| part.chars().count())
    };
    let skipped =
        if text.chars().nth(MAX_EXCERPT_CHARS).is_some() { column.saturating_sub(CHARS_BEFORE_PLACE) } else { 0 };
    let mut rest = text.chars().skip(skipped);
    let mut shown: String = if skipped > 0 { "…".to_owned() } else { String::new() };
    shown.extend(rest.by_ref().take(MAX_EXCERPT_CHARS).map(printable));
    if rest.next().is_some() {
        shown.push('…');
    }
    let caret_at = column - skipped + usize::from(skipped > 0);
    let room = shown.chars().count().saturating_sub(caret_at);
    (shown, caret_at, span_in_line.min(room).max(1))
}

/// A character as the excerpt shows it: exactly one place wide, and no control character reaches the terminal.
fn printable(found: char) -> char {
    match found {
        '\t' => ' ',
        found if found.is_control() => '\u{FFFD}',
        found => found,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostics::syntax::EXPECTED;

    fn shown(text: &str, start: u32, end: u32) -> String {
        let mut sources = SourceMap::new();
        let file = sources.add_text("a.st", text);
        render(&Diagnostic::new(&EXPECTED, Span::new(file, start, end), "message"), &sources, Style::default())
    }

    #[test]
    fn carets_stand_below_tabs_and_letters_of_two_bytes() {
        let expected = "a.st:2:5: error[P0004]: message\n    2 |  'ä'xy\n      |     ^^\n";
        assert_eq!(shown("a\n\t'ä'xy\n", 7, 9), expected);
    }

    #[test]
    fn the_end_of_a_line_gets_one_caret() {
        assert_eq!(shown("x := 1\n", 6, 6), "a.st:1:7: error[P0004]: message\n    1 | x := 1\n      |       ^\n");
    }

    #[test]
    fn a_span_over_lines_is_marked_on_its_first() {
        assert_eq!(shown("(* a\nb *)", 0, 9), "a.st:1:1: error[P0004]: message\n    1 | (* a\n      | ^^^^\n");
    }

    #[test]
    fn long_lines_are_cut_around_the_place() {
        let text = format!("{}HERE{}", "a".repeat(10_000), "b".repeat(10_000));
        let out = shown(&text, 10_000, 10_004);
        let lines: Vec<&str> = out.lines().collect();
        assert_eq!(lines[0], "a.st:1:10001: error[P0004]: message");
        assert!(lines[1].chars().count() < 140);
        let caret = lines[2].chars().position(|found| found == '^').expect("a caret");
        assert_eq!(lines[1].chars().skip(caret).take(4).collect::<String>(), "HERE");
        assert_eq!(lines[2].matches('^').count(), 4);
    }

    #[test]
    fn an_empty_file_and_a_foreign_span_do_no_harm() {
        assert_eq!(shown("", 0, 0), "a.st:1:1: error[P0004]: message\n");
        assert!(shown("x", 500, 900).starts_with("a.st:1:2: error"));
        let stray = Diagnostic::new(&EXPECTED, Span::new(crate::source::FileId(7), 3, 4), "m");
        assert_eq!(render(&stray, &SourceMap::new(), Style::default()), "?:1:1: error[P0004]: m\n");
    }

    #[test]
    fn labels_help_and_colour() {
        let mut sources = SourceMap::new();
        let file = sources.add_text("a.st", "IF a\nEND\u{1b}");
        let found =
            Diagnostic::new(&EXPECTED, Span::new(file, 5, 8), "m").label(Span::new(file, 0, 2), "here").help("do so");
        let plain = render(&found, &sources, Style::default());
        assert_eq!(
            plain,
            "a.st:2:1: error[P0004]: m\n    2 | END\u{FFFD}\n      | ^^^\n    1 | IF a\n      | ^^ here\nhelp: do so\n"
        );
        assert!(render(&found, &sources, Style { colour: true }).contains("\x1b[1;31merror[P0004]\x1b[0m"));
    }
}
