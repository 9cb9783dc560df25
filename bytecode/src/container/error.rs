//! Why bytes are no container, and why a container has no bytes.

/// Why a container can not be written: it exceeds what the format can hold. Nothing is ever wrapped or cut.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the container can not be written: {message}")]
pub struct WriteError {
    /// What exceeds which limit.
    pub message: String,
}

impl WriteError {
    pub(super) fn new(message: impl Into<String>) -> WriteError {
        WriteError { message: message.into() }
    }
}

/// Why bytes are no container.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}: {section}, byte {offset}: {message}", code.code())]
pub struct ReadError {
    /// Which rule is broken.
    pub code: ReadCode,
    /// In which part of the file, for example `type section`.
    pub section: &'static str,
    /// Byte offset from the start of the file.
    pub offset: usize,
    /// What is wrong there.
    pub message: String,
}

macro_rules! read_codes {
    ($(($code:literal, $variant:ident, $title:literal, $text:literal)),* $(,)?) => {
        /// The rules that [`read`](super::read()) holds; codes are stable.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum ReadCode { $(#[doc = $text] $variant),* }

        impl ReadCode {
            /// Every rule, in the order of its code.
            pub const ALL: &'static [ReadCode] = &[$(ReadCode::$variant),*];

            /// Its stable code, for example `C0002`.
            #[must_use]
            pub fn code(self) -> &'static str {
                match self { $(ReadCode::$variant => $code),* }
            }

            /// The rule in a few words.
            #[must_use]
            pub fn title(self) -> &'static str {
                match self { $(ReadCode::$variant => $title),* }
            }

            /// What it means and what to do.
            #[must_use]
            pub fn explanation(self) -> &'static str {
                match self { $(ReadCode::$variant => $text),* }
            }
        }
    };
}

read_codes! {
    ("C0001", TooShort, "the file is shorter than a header", "A container begins with a header of 256 bytes. The file was cut off, or is something else."),
    ("C0002", Magic, "the file is no container", "The first four bytes of a container are 43 4C 50 49. Source files end in .st, containers in .iplc."),
    ("C0003", Version, "unknown format version", "The file says a format version that this khz does not know. Compile the sources again."),
    ("C0004", Profile, "the profile is not zero", "The profile byte of the header is reserved and must be zero."),
    ("C0005", Flags, "flags do not agree with the sections", "A flag of the header is unknown, or says that a section is there which is missing, or the other way round."),
    ("C0006", SectionPlace, "a section lies in the wrong place", "Sections follow the header one behind the other in the order of the directory, inside the file, without gap or overlap; an absent one has offset 0 and size 0. A cut file ends here."),
    ("C0007", MissingSection, "a section is missing", "Type section, task table, constant pool and code section are always there, even when they are empty."),
    ("C0008", TrailingBytes, "bytes behind the last section", "The file goes on behind its last section."),
    ("C0009", Reserved, "a reserved byte is not zero", "Reserved bytes and bits must be zero, so that a later version can give them a meaning."),
    ("C0010", ContentHash, "the content hash differs", "The SHA-256 over parameters, types, tasks, constants and code is not the one in the header: the file was changed or damaged."),
    ("C0011", DebugHash, "the debug hash differs", "The SHA-256 over the debug section is not the one in the header (zero without a debug section)."),
    ("C0012", LayoutHash, "the layout hash differs", "The SHA-256 over the memory layout, recomputed from types, slots, variables and instances, is not the one in the header."),
    ("C0013", RetainHash, "the retain hash differs", "The SHA-256 over the retain map is not the one that stands before it (zero without a retain map)."),
    ("C0014", Ends, "a section ends inside a field", "A field goes over the end of its section or table."),
    ("C0015", Rest, "bytes left over", "A section or table is longer than what it holds."),
    ("C0016", Value, "a field has no such value", "A byte that stands for one of several forms has a number that means nothing."),
    ("C0017", Table, "the tables are not in order", "Tables of a section stand in ascending order of their tags, each once, only known ones, and only those that are not empty."),
    ("C0018", Count, "a header field disagrees with the sections", "A count or size of the header is not what the sections hold."),
    ("C0019", SignatureForm, "a signature section has the wrong form", "A signature section holds a count of 1, algorithm 1 (Ed25519), a public key of 32 bytes and a signature of 64 bytes; a debug signature needs a debug section."),
    ("C0020", Signature, "a signature is wrong", "The Ed25519 signature does not belong to this content and key. A file with a wrong signature is refused even where unsigned files may run."),
    ("C0021", TooMany, "a list is longer than its section", "A count says more entries than the rest of the section has bytes."),
    ("C0022", Text, "a name is not UTF-8", "Names are UTF-8."),
    ("C0023", TooLong, "a name is too long", "The name of a task has at most 255 bytes."),
}
