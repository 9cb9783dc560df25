//! The command lines of the searches: `NUMBER… [--OPTION N]… [WORD]…`, and nothing that is not known.
//!
//! A search that runs for an hour on something else than was asked is worse than none, so every word has to mean something: a number
//! that is out of its range, an option twice, a name that no engine has or a folder that is not there is refused.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::RangeInclusive;
use std::path::PathBuf;

/// What a command line may say.
#[derive(Debug, Clone, Copy)]
pub struct Grammar<'g> {
    /// Names of the numbers that stand first, in their order. Each may be missing, from the last on.
    pub numbers: &'g [&'g str],
    /// Options with the numbers that they take.
    pub options: &'g [(&'g str, RangeInclusive<u64>)],
    /// Words that may follow.
    pub words: &'g [&'g str],
    /// Whether folders may follow.
    pub folders: bool,
}

/// What a command line says.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Line {
    /// The numbers that are there.
    pub numbers: Vec<u64>,
    /// Options by name.
    pub options: BTreeMap<String, u64>,
    /// Words, all of them known.
    pub words: Vec<String>,
    /// Folders, all of them there.
    pub folders: Vec<PathBuf>,
}

impl Grammar<'_> {
    /// Reads a command line without the program's name.
    ///
    /// # Errors
    /// The word that means nothing, in words for people.
    pub fn read(&self, line: impl IntoIterator<Item = String>) -> Result<Line, String> {
        let mut read = Line::default();
        let mut line = line.into_iter();
        while let Some(word) = line.next() {
            if let Some(name) = word.strip_prefix("--") {
                let (_, range) = (self.options.iter().find(|(known, _)| *known == name))
                    .ok_or_else(|| format!("there is no option `{word}`"))?;
                let value = line.next().ok_or_else(|| format!("`{word}` wants a number"))?;
                let number = value.parse().ok().filter(|number| range.contains(number));
                let number = number.ok_or_else(|| {
                    format!("`{word}` wants a number from {} to {}, not `{value}`", range.start(), range.end())
                })?;
                if read.options.insert(name.to_string(), number).is_some() {
                    return Err(format!("`{word}` stands twice"));
                }
            } else if let Ok(number) = word.parse() {
                if !read.words.is_empty() || !read.folders.is_empty() || read.numbers.len() == self.numbers.len() {
                    return Err(format!("the number {word} is one too many, or stands too late"));
                }
                read.numbers.push(number);
            } else if self.words.contains(&word.as_str()) {
                read.words.push(word);
            } else if self.folders && PathBuf::from(&word).is_dir() {
                read.folders.push(word.into());
            } else {
                let folder = if self.folders { ", and there is no such folder" } else { "" };
                return Err(format!("`{word}` means nothing here{folder}"));
            }
        }
        Ok(read)
    }

    /// One line that shows what may be said.
    #[must_use]
    pub fn usage(&self) -> String {
        let mut text = "arguments:".to_string();
        // A String takes everything.
        self.numbers.iter().for_each(|name| _ = write!(text, " [{name}]"));
        for (name, range) in self.options {
            let most = if *range.end() == u64::MAX { String::new() } else { range.end().to_string() };
            let _ = write!(text, " [--{name} {}..{most}]", range.start());
        }
        if !self.words.is_empty() {
            let _ = write!(text, " [{}]...", self.words.join("|"));
        }
        if self.folders { text + " [FOLDER]..." } else { text }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRAMMAR: Grammar<'_> = Grammar {
        numbers: &["FIRST", "COUNT"],
        options: &[("size", 0..=3), ("scans", 1..=u64::MAX)],
        words: &["jit"],
        folders: true,
    };

    fn read(line: &str) -> Result<Line, String> {
        GRAMMAR.read(line.split_whitespace().map(str::to_string))
    }

    #[test]
    fn what_is_known_is_read() {
        let folder = env!("CARGO_MANIFEST_DIR");
        let line = read(&format!("7 --size 3 9 jit {folder} --scans 1")).expect("a line");
        assert_eq!((&line.numbers[..], &line.words[..]), (&[7, 9][..], &["jit".to_string()][..]));
        assert_eq!(line.folders, [PathBuf::from(folder)]);
        assert_eq!((line.options["size"], line.options["scans"]), (3, 1));
        assert_eq!(read(""), Ok(Line::default()));
        assert_eq!(GRAMMAR.usage(), "arguments: [FIRST] [COUNT] [--size 0..3] [--scans 1..] [jit]... [FOLDER]...");
    }

    #[test]
    fn what_means_nothing_is_refused() {
        for line in [
            "jti",
            "ten",
            "--help",
            "-h",
            "--size 4",
            "--size",
            "--size x",
            "--size 1 --size 1",
            "--scans 0",
            "--sizes 1",
            "1 2 3",
            "jit 1",
            "-1",
            "/nowhere",
            "99999999999999999999999",
        ] {
            assert!(read(line).is_err(), "{line}");
        }
        let without_folders = Grammar { folders: false, ..GRAMMAR };
        assert!(without_folders.read([env!("CARGO_MANIFEST_DIR").to_string()]).is_err());
    }
}
