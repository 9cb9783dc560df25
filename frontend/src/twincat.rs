//! TwinCAT's files (.TcPOU, .TcDUT, .TcGVL): Structured Text in CDATA sections, wrapped in XML.
//!
//! Each becomes a plain source text *at the same lines and columns*: what is not Structured Text turns into blanks, one for
//! each character, and line ends stay. So places in messages are places in the XML file, and nobody behind this module knows
//! where a text came from. Only the `END_…` of a POU, which TwinCAT leaves out, is put where `</POU>` stood.
//!
//! The XML is a user's: no entity is ever expanded and no document type read; depth is bounded; time and memory are linear.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::diagnostics::{Diagnostic, Rule, files as rules};
use crate::source::{FileId, Span};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::{TokenKind, lex};

/// Endings of TwinCAT's files, in lower case.
pub const ENDINGS: [&str; 4] = ["tcpou", "tcdut", "tcgvl", "tcio"];

/// How deep elements may nest. TwinCAT's own go to 8.
const MAX_DEPTH: usize = 64;

/// Objects that hold Structured Text.
const OBJECTS: [&str; 3] = ["POU", "DUT", "GVL"];

/// Parts of an object that are not of the language yet.
const LATER: [&str; 5] = ["Method", "Property", "Action", "Transition", "Itf"];

/// Whether a file's name says that it is TwinCAT's.
pub fn is_twincat(name: &str) -> bool {
    let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending);
    ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// What was found in a file.
#[derive(Debug, Default)]
pub(crate) struct Extracted {
    /// The Structured Text, at its lines and columns.
    pub text: String,
    /// What is wrong with the file around it. Spans are of `text`.
    pub diagnostics: Vec<Diagnostic>,
    /// The name of a global variable list.
    pub global_list: Option<String>,
}

/// Takes the Structured Text out of XML.
pub(crate) fn structured_text(file: FileId, xml: &str) -> Extracted {
    let mut extractor = Extractor { xml, out: String::with_capacity(xml.len()), ..Extractor::default() };
    extractor.run();
    extractor.blank(xml.len());
    let Extractor { out, mut found, list, objects, .. } = extractor;
    if objects == 0 && found.is_empty() {
        found.push((&rules::NOT_TWINCAT, 0, "there is no POU, DUT or GVL in this file".to_owned()));
    }
    let mut places = Places { xml: Cursor::new(xml), text: Cursor::new(&out) };
    found.sort_by_key(|(_, at, _)| *at);
    let diagnostics = found.into_iter().map(|(rule, at, message)| {
        let at = places.in_text(at);
        Diagnostic::new(rule, Span::new(file, at, at), message)
    });
    let diagnostics = diagnostics.collect();
    Extracted { text: out, diagnostics, global_list: list }
}

#[derive(Default)]
struct Extractor<'x> {
    xml: &'x str,
    /// What stands for `xml[..done]`.
    out: String,
    done: usize,
    /// Elements around the current place.
    path: Vec<String>,
    /// What is wrong: rule, offset in `xml`, message.
    found: Vec<(&'static Rule, usize, String)>,
    list: Option<String>,
    /// How many POUs, DUTs and GVLs there are.
    objects: usize,
    /// Depth of the element whose content is passed over.
    skipped: Option<usize>,
    /// How the current POU ends; known from its declaration.
    end: Option<&'static str>,
}

impl<'x> Extractor<'x> {
    fn run(&mut self) {
        let mut reader = Reader::from_str(self.xml);
        loop {
            let start = offset(reader.buffer_position());
            let event = match reader.read_event() {
                Ok(event) => event,
                Err(error) => {
                    let at = offset(reader.error_position());
                    self.report(&rules::NOT_XML, at, error.to_string());
                    return;
                }
            };
            let end = offset(reader.buffer_position());
            match event {
                Event::Eof => break,
                Event::Start(element) => {
                    self.open(&element, start);
                    if self.path.len() > MAX_DEPTH {
                        self.report(&rules::NOT_XML, start, format!("elements nest more than {MAX_DEPTH} deep"));
                        return;
                    }
                }
                Event::Empty(element) => {
                    self.open(&element, start);
                    self.close(start);
                }
                Event::End(_) => self.close(start),
                Event::CData(_) => self.text(start + "<![CDATA[".len(), end.saturating_sub("]]>".len())),
                Event::Text(_) | Event::GeneralRef(_) => self.loose(start, end),
                Event::DocType(_) => {
                    self.report(&rules::NOT_XML, start, "a document type is refused".to_owned());
                    return;
                }
                Event::Comment(_) | Event::Decl(_) | Event::PI(_) => {}
            }
        }
        if let Some(open) = self.path.last() {
            let message = format!("`<{open}>` has no end");
            self.report(&rules::NOT_XML, self.xml.len(), message);
        }
    }

    fn report(&mut self, rule: &'static Rule, at: usize, message: String) {
        self.found.push((rule, at.min(self.xml.len()), message));
    }

    fn open(&mut self, element: &BytesStart<'_>, start: usize) {
        let name = element.local_name().as_ref().to_owned();
        let parent = self.path.last().map_or("", String::as_str);
        let named = attribute(element, "Name").unwrap_or_default();
        if self.skipped.is_none() {
            if OBJECTS.contains(&name.as_str()) && parent == "TcPlcObject" {
                self.objects += 1;
                self.end = None;
                if name == "GVL" {
                    self.list = Some(named);
                }
            } else if LATER.contains(&name.as_str()) {
                let what = if name == "Itf" { "an INTERFACE".to_owned() } else { format!("the {name} `{named}`") };
                self.report(&rules::PART_LATER, start, format!("{what} is not of the language yet"));
                self.skipped = Some(self.path.len());
            } else if parent == "Implementation" && name != "ST" {
                let message = format!("this is written in {name}, not in Structured Text");
                self.report(&rules::OTHER_LANGUAGE, start, message);
                self.skipped = Some(self.path.len());
            }
        }
        self.path.push(name);
    }

    fn close(&mut self, start: usize) {
        if self.path.pop().as_deref() == Some("POU")
            && self.skipped.is_none()
            && let Some(end) = self.end.take()
        {
            self.blank(start);
            self.out.push('\n');
            // On the line of `</POU>`, where a line ends before it; a comment without an end of line can not swallow it.
            let line = self.out.trim_end_matches([' ', '\n']).len();
            if self.out.get(line..).is_some_and(|blanks| blanks.matches('\n').count() > 1) {
                self.out.pop();
            }
            self.out.push_str(end);
            self.swallow(end.len());
        }
        if self.skipped.is_some_and(|depth| self.path.len() <= depth) {
            self.skipped = None;
        }
    }

    /// Leaves out up to `count` characters of markup, but no line end: something else was written in their place.
    fn swallow(&mut self, count: usize) {
        let rest = self.xml.get(self.done..).unwrap_or("");
        let gone: usize = rest.chars().take(count).take_while(|c| !matches!(c, '\r' | '\n')).map(char::len_utf8).sum();
        self.done += gone;
    }

    /// Where in an object Structured Text stands: its declaration or its implementation.
    fn is_code(&self) -> bool {
        if self.skipped.is_some() {
            return false;
        }
        let path: Vec<&str> = self.path.iter().map(String::as_str).collect();
        match path.as_slice() {
            [_, object, "Declaration"] => OBJECTS.contains(object),
            [_, "POU", "Implementation", "ST"] => true,
            _ => false,
        }
    }

    /// A CDATA section.
    fn text(&mut self, start: usize, end: usize) {
        if !self.is_code() {
            return;
        }
        let Some(text) = self.xml.get(start..end) else { return };
        if self.end.is_none()
            && let [_, object, declaration] = self.path.as_slice()
            && (object.as_str(), declaration.as_str()) == ("POU", "Declaration")
        {
            self.end = end_of(text);
            if self.end.is_none() {
                let message = "this declares no PROGRAM, FUNCTION or FUNCTION_BLOCK".to_owned();
                self.report(&rules::NOT_TWINCAT, start, message);
                return;
            }
        }
        self.blank(start);
        self.out.push_str(text);
        self.done = end;
    }

    /// Text that is in no CDATA section: TwinCAT writes none but white space.
    fn loose(&mut self, start: usize, end: usize) {
        let blank = self.xml.get(start..end).is_none_or(|text| text.trim().is_empty());
        if !blank && self.is_code() {
            self.report(&rules::NOT_XML, start, "Structured Text stands in a CDATA section".to_owned());
        }
    }

    /// Puts a blank for each character up to an offset.
    fn blank(&mut self, to: usize) {
        let Some(markup) = self.xml.get(self.done..to) else { return };
        self.out.extend(markup.chars().map(|c| if matches!(c, '\r' | '\n') { c } else { ' ' }));
        self.done = to;
    }
}

fn offset(position: u64) -> usize {
    usize::try_from(position).unwrap_or(usize::MAX)
}

fn attribute(element: &BytesStart<'_>, name: &str) -> Option<String> {
    let found = element.try_get_attribute(name).ok()??;
    Some(found.value.into_owned())
}

/// What ends the POU that a text declares.
fn end_of(declaration: &str) -> Option<&'static str> {
    lex(declaration).into_iter().find_map(|token| match token.kind {
        TokenKind::Keyword(Keyword::Program) => Some("END_PROGRAM"),
        TokenKind::Keyword(Keyword::Function) => Some("END_FUNCTION"),
        TokenKind::Keyword(Keyword::FunctionBlock) => Some("END_FUNCTION_BLOCK"),
        _ => None,
    })
}

/// A place that moves through a text, counting lines and columns.
struct Cursor<'t> {
    text: &'t str,
    at: usize,
    line: usize,
    column: usize,
}

impl<'t> Cursor<'t> {
    fn new(text: &'t str) -> Self {
        Cursor { text, at: 0, line: 0, column: 0 }
    }

    /// Moves on while `go` says so of the place.
    fn advance(&mut self, go: impl Fn(&Self, char) -> bool) {
        while let Some(next) = self.text.get(self.at..).and_then(|rest| rest.chars().next()) {
            if !go(self, next) {
                break;
            }
            self.at += next.len_utf8();
            (self.line, self.column) = if next == '\n' { (self.line + 1, 0) } else { (self.line, self.column + 1) };
        }
    }
}

/// The same places in the XML and in the text made of it.
struct Places<'t> {
    xml: Cursor<'t>,
    text: Cursor<'t>,
}

impl Places<'_> {
    /// The offset in the text at the line and column of an offset in the XML; offsets ascend from call to call.
    fn in_text(&mut self, at: usize) -> u32 {
        self.xml.advance(|cursor, _| cursor.at < at);
        let (line, column) = (self.xml.line, self.xml.column);
        self.text.advance(|cursor, next| {
            cursor.line < line || (cursor.line == line && cursor.column < column && next != '\n')
        });
        u32::try_from(self.text.at).unwrap_or(u32::MAX)
    }
}
