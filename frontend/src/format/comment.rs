//! Comments and pragmas over several lines, whose lines move with their beginning.

/// How far a tab reaches.
const TAB: usize = 4;

/// The furthest column that a line of a comment is moved to: comments in a row, each moved by those before it, would
/// otherwise go on and on.
const FURTHEST: usize = 120;

/// What counts as white space at the ends of a comment's lines.
const SPACES: [char; 5] = [' ', '\t', '\r', '\x0B', '\x0C'];

/// The column, from 0, at which byte `at` of the text stands, tabs counted as they are shown.
pub(super) fn column(text: &str, at: usize) -> usize {
    let before = text.get(..at).unwrap_or("");
    let line = before.rfind('\n').map_or(before, |end| before.get(end + 1..).unwrap_or(""));
    line.chars().fold(0, advance)
}

fn advance(column: usize, next: char) -> usize {
    if next == '\t' { (column / TAB + 1) * TAB } else { column + 1 }
}

/// Whether two comments say the same, white space at the ends of their lines apart.
pub(super) fn same(a: &str, b: &str) -> bool {
    let lines = |text| str::split(text, '\n').map(|line| line.trim_matches(SPACES));
    lines(a).eq(lines(b))
}

/// Writes a comment that stood at column `from` and now stands at column `to`. Lines after the first move along, but
/// never to the left of the margin.
pub(super) fn write(out: &mut String, comment: &str, from: impl FnOnce() -> usize, to: usize) {
    let mut lines = comment.split('\n');
    out.push_str(lines.next().unwrap_or("").trim_end_matches(SPACES));
    let mut lines = lines.peekable();
    if lines.peek().is_none() {
        return;
    }
    let from = from();
    for line in lines {
        out.push('\n');
        let line = line.trim_end_matches(SPACES);
        let inside = line.trim_start_matches(SPACES);
        if from == to || inside.is_empty() {
            out.push_str(line);
            continue;
        }
        let margin = line.get(..line.len() - inside.len()).unwrap_or("");
        let before = margin.chars().fold(0, advance);
        let column = before.saturating_add(to).saturating_sub(from).min(before.max(FURTHEST));
        out.extend(std::iter::repeat_n(' ', column));
        out.push_str(inside);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(comment: &str, from: usize, to: usize) -> String {
        let mut out = String::new();
        write(&mut out, comment, || from, to);
        out
    }

    #[test]
    fn lines_move_with_the_first_and_stop_at_the_margin() {
        assert_eq!(moved("(* a\n   b\n\n\tc *)", 0, 2), "(* a\n     b\n\n      c *)");
        assert_eq!(moved("(* a  \r\n     b *)", 6, 2), "(* a\n b *)");
        assert_eq!(moved("(* a\n b *)", 6, 2), "(* a\nb *)");
        assert_eq!(moved("(* a\n\tb *)", 2, 2), "(* a\n\tb *)", "what does not move is not touched");
        assert_eq!(moved("// a \t\r", 2, 9), "// a");
    }

    #[test]
    fn columns_count_characters_and_tabs() {
        assert_eq!(column("x\n\tä(*", "x\n\tä".len()), 5);
        assert_eq!(column("ab", 2), 2);
    }

    #[test]
    fn only_white_space_at_line_ends_is_free() {
        assert!(same("(* a\r\n  b *)", "(* a\n b *)"));
        assert!(!same("(* a b *)", "(* a  b *)"));
        assert!(!same("(* a\nb *)", "(* a b *)"));
    }
}
