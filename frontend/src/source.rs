//! Source files: their text, and where in them something stands.
//!
//! A [`Span`] is twelve bytes (file, start, end), so every node of the tree can have one. Lines and columns are computed
//! when a message is shown, never before.
//!
//! Files come from users and so may be anything. Text is UTF-8; a file that is not is read as Latin-1 (older PLC tools
//! write that), and a note says so; what cannot be text at all is refused with a diagnostic.

use crate::diagnostics::{Diagnostic, has_errors, syntax as rules};
use crate::twincat;

/// The largest source file that is read, in bytes.
pub const MAX_FILE_BYTES: usize = 64 * 1024 * 1024;

/// The largest number of source files in one compilation.
pub const MAX_FILES: usize = 65_536;

/// The number of a file in its [`SourceMap`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FileId(pub u32);

impl FileId {
    /// The id as an index: files are numbered in the order in which they were added.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A piece of a source file: bytes `start..end` of its decoded text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span {
    /// Which file.
    pub file: FileId,
    /// Offset of the first byte.
    pub start: u32,
    /// Offset after the last byte.
    pub end: u32,
}

impl Span {
    /// The bytes `start..end` of a file.
    pub fn new(file: FileId, start: u32, end: u32) -> Self {
        Self { file, start, end }
    }

    /// The smallest span that holds both. Spans of different files cannot be joined: the first one is the result.
    #[must_use]
    pub fn to(self, other: Span) -> Span {
        if self.file != other.file {
            return self;
        }
        Span { file: self.file, start: self.start.min(other.start), end: self.end.max(other.end) }
    }

    /// The empty span at the end: where something is missing after this.
    #[must_use]
    pub fn after(self) -> Span {
        Span { start: self.end, ..self }
    }

    /// The empty span at the start.
    #[must_use]
    pub fn before(self) -> Span {
        Span { end: self.start, ..self }
    }

    /// The length in bytes.
    pub fn len(self) -> u32 {
        self.end.saturating_sub(self.start)
    }

    /// Whether it holds no byte.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }
}

/// A place as people count: both from 1, the column in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LineColumn {
    /// Line, from 1.
    pub line: u32,
    /// Column, from 1, in characters (a tab is one).
    pub column: u32,
}

/// A source file.
#[derive(Debug)]
pub struct SourceFile {
    name: String,
    text: String,
    /// Offset of the first byte of each line.
    line_starts: Vec<u32>,
    /// What people see where the text was made of something else: line for line, column for column the same.
    shown: Option<Box<SourceFile>>,
    /// The name of the global variable list that this file is.
    global_list: Option<String>,
}

impl SourceFile {
    /// The name under which messages show it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The name of the global variable list that this file is: its globals are known as `NAME.x` too.
    pub fn global_list(&self) -> Option<&str> {
        self.global_list.as_deref()
    }

    /// A line (from 1) as people see it in their editor, without its line end.
    pub fn shown_line(&self, line: u32) -> &str {
        self.shown.as_deref().unwrap_or(self).line_text(line)
    }

    /// The decoded text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// How many lines it has (at least 1).
    pub fn line_count(&self) -> u32 {
        u32::try_from(self.line_starts.len()).unwrap_or(u32::MAX)
    }

    /// The line (from 1) that holds a byte offset; an offset past the end counts as the end.
    pub fn line_at(&self, offset: u32) -> u32 {
        u32::try_from(self.line_starts.partition_point(|&start| start <= offset)).unwrap_or(u32::MAX).max(1)
    }

    /// The place of a byte offset.
    pub fn line_column(&self, offset: u32) -> LineColumn {
        let line = self.line_at(offset);
        let start = self.line_start(line) as usize;
        let mut end = (offset as usize).clamp(start, self.text.len().max(start));
        while !self.text.is_char_boundary(end) {
            end -= 1;
        }
        let before = self.text.get(start..end).unwrap_or("");
        let column = u32::try_from(before.chars().count()).unwrap_or(u32::MAX).saturating_add(1);
        LineColumn { line, column }
    }

    /// Offset of the first byte of a line (from 1); of a line that does not exist, the end of the text.
    pub fn line_start(&self, line: u32) -> u32 {
        let index = (line as usize).saturating_sub(1);
        self.line_starts.get(index).copied().unwrap_or(u32::try_from(self.text.len()).unwrap_or(u32::MAX))
    }

    /// The text of a line (from 1) without its line end.
    pub fn line_text(&self, line: u32) -> &str {
        let start = self.line_start(line) as usize;
        let end = self.line_start(line.saturating_add(1)) as usize;
        self.text.get(start..end).unwrap_or("").trim_end_matches(['\n', '\r'])
    }

    fn new(name: String, text: String) -> Self {
        let mut line_starts = vec![0];
        let ends = text.bytes().enumerate().filter(|&(_, byte)| byte == b'\n');
        line_starts.extend(ends.map(|(at, _)| u32::try_from(at + 1).unwrap_or(u32::MAX)));
        Self { name, text, line_starts, shown: None, global_list: None }
    }
}

/// All source files of one compilation, in compile order.
#[derive(Debug, Default)]
pub struct SourceMap {
    files: Vec<SourceFile>,
}

impl SourceMap {
    /// An empty map.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a file from its bytes as they are on disk.
    ///
    /// The file is always added, with an empty text if it was refused, so that diagnostics have a place. Each diagnostic
    /// that comes back is an error (the file was refused) or a note (how it was read).
    pub fn add_bytes(&mut self, name: impl Into<String>, bytes: &[u8]) -> (FileId, Vec<Diagnostic>) {
        let id = self.next_id();
        let (text, mut diagnostics) = decode(id, bytes);
        let name = name.into();
        if twincat::is_twincat(&name) && !has_errors(&diagnostics) {
            let found = twincat::structured_text(id, &text);
            diagnostics.extend(found.diagnostics);
            let mut file = SourceFile::new(name, found.text);
            file.shown = Some(Box::new(SourceFile::new(String::new(), text)));
            file.global_list = found.global_list;
            self.files.push(file);
        } else {
            self.files.push(SourceFile::new(name, text));
        }
        (id, diagnostics)
    }

    /// Adds a text that is known to be fine: tests, generated sources.
    pub fn add_text(&mut self, name: impl Into<String>, text: impl Into<String>) -> FileId {
        let id = self.next_id();
        self.files.push(SourceFile::new(name.into(), text.into()));
        id
    }

    /// The files with their ids, in the order in which they were added.
    pub fn files(&self) -> impl Iterator<Item = (FileId, &SourceFile)> {
        self.files.iter().enumerate().map(|(at, file)| (FileId(u32::try_from(at).unwrap_or(u32::MAX)), file))
    }

    /// How many files there are.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// Whether there is no file.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// The file of an id; none if the id is of another map.
    pub fn file(&self, id: FileId) -> Option<&SourceFile> {
        self.files.get(id.index())
    }

    /// The text of a span; empty if the span is of another map.
    pub fn snippet(&self, span: Span) -> &str {
        self.file(span.file).and_then(|file| file.text.get(span.start as usize..span.end as usize)).unwrap_or("")
    }

    /// The place where a span starts; line 1, column 1 if the span is of another map.
    pub fn line_column(&self, span: Span) -> LineColumn {
        self.file(span.file).map_or(LineColumn { line: 1, column: 1 }, |file| file.line_column(span.start))
    }

    /// `FILE:LINE:COLUMN` of a span's start.
    pub fn place(&self, span: Span) -> String {
        let LineColumn { line, column } = self.line_column(span);
        let name = self.file(span.file).map_or("?", SourceFile::name);
        format!("{name}:{line}:{column}")
    }

    fn next_id(&self) -> FileId {
        FileId(u32::try_from(self.files.len()).unwrap_or(u32::MAX))
    }
}

/// Bytes to text: UTF-8 with or without a byte order mark, else Latin-1.
fn decode(file: FileId, bytes: &[u8]) -> (String, Vec<Diagnostic>) {
    let start = Span::new(file, 0, 0);
    let refuse = |message: String| (String::new(), vec![Diagnostic::new(&rules::NOT_SOURCE_TEXT, start, message)]);
    if file.index() >= MAX_FILES {
        return refuse(format!("more than {MAX_FILES} source files"));
    }
    if bytes.len() > MAX_FILE_BYTES {
        return refuse(format!("the file has {} bytes; the limit is {MAX_FILE_BYTES}", bytes.len()));
    }
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return refuse("the file is UTF-16; save it as UTF-8".to_owned());
    }
    let bytes = bytes.strip_prefix(&[0xEF, 0xBB, 0xBF]).unwrap_or(bytes);
    if let Some(at) = bytes.iter().position(|&byte| byte == 0) {
        return refuse(format!("byte {at} of the file is NUL, so this is no text"));
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => (text.to_owned(), Vec::new()),
        Err(error) => decode_latin1(start, bytes, error.valid_up_to()),
    }
}

/// Latin-1 to text, unless so many control characters say that this is a binary file.
fn decode_latin1(start: Span, bytes: &[u8], first_invalid: usize) -> (String, Vec<Diagnostic>) {
    let is_noise = |&&byte: &&u8| (byte < 0x20 && !matches!(byte, b'\t' | b'\n' | b'\r' | 0x0C)) || byte == 0x7F;
    let noise = bytes.iter().filter(is_noise).count();
    if noise.saturating_mul(50) > bytes.len() {
        let message = format!("{noise} of {} bytes are control characters, so this is no text", bytes.len());
        return (String::new(), vec![Diagnostic::new(&rules::NOT_SOURCE_TEXT, start, message)]);
    }
    let text: String = bytes.iter().map(|&byte| char::from(byte)).collect();
    let message = format!("byte {first_invalid} is not valid UTF-8; the file is read as Latin-1");
    (text, vec![Diagnostic::new(&rules::READ_AS_LATIN1, start, message)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn single(bytes: &[u8]) -> (String, Vec<&'static str>) {
        let mut map = SourceMap::new();
        let (id, diagnostics) = map.add_bytes("a.st", bytes);
        let text = map.file(id).map(|file| file.text().to_owned()).unwrap_or_default();
        (text, diagnostics.iter().map(Diagnostic::code).collect())
    }

    #[test]
    fn lines_and_columns_count_characters() {
        let mut map = SourceMap::new();
        let id = map.add_text("a.st", "ab\r\n\täöx\n");
        let at = |offset| map.place(Span::new(id, offset, offset));
        assert_eq!(at(0), "a.st:1:1");
        assert_eq!(at(4), "a.st:2:1");
        assert_eq!(at(9), "a.st:2:4", "two letters of two bytes each count as two columns");
        assert_eq!(at(11), "a.st:3:1");
        assert_eq!(at(4000), "a.st:3:1", "past the end is the end");
        assert_eq!(at(6), "a.st:2:2", "inside a character is that character");
        let file = map.file(id).expect("just added");
        assert_eq!(file.line_text(1), "ab");
        assert_eq!(file.line_text(2), "\täöx");
        assert_eq!(file.line_text(9), "");
        assert_eq!(file.line_count(), 3);
    }

    #[test]
    fn byte_order_mark_is_dropped() {
        assert_eq!(single(b"\xEF\xBB\xBFVAR"), ("VAR".to_owned(), vec![]));
    }

    #[test]
    fn latin1_is_read_with_a_note() {
        assert_eq!(single(b"(* gr\xFCn *)"), ("(* grün *)".to_owned(), vec![rules::READ_AS_LATIN1.code]));
    }

    #[test]
    fn what_is_no_text_is_refused() {
        let refused = (String::new(), vec![rules::NOT_SOURCE_TEXT.code]);
        assert_eq!(single(b"PROGRAM\0"), refused);
        assert_eq!(single(b"\xFF\xFEP\0"), refused);
        assert_eq!(single(&[0x80, 0x01, 0x02, 0x90]), refused);
    }

    #[test]
    fn spans_join_and_shrink() {
        let file = FileId(0);
        let (a, b) = (Span::new(file, 3, 5), Span::new(file, 8, 9));
        assert_eq!(b.to(a), Span::new(file, 3, 9));
        assert_eq!(a.after(), Span::new(file, 5, 5));
        assert_eq!(a.before(), Span::new(file, 3, 3));
        assert_eq!(a.to(Span::new(FileId(1), 0, 1)), a);
        assert!(a.after().is_empty());
    }
}
