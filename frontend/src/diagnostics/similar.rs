//! "Did you mean …?": of known names the one that is nearest to an unknown one.

/// Longest name that is compared, in bytes.
const MAX_COMPARED: usize = 64;

/// Of the known names, each with what it stands for, the nearest to `wanted`; of equally near ones the first in the
/// alphabet. Both are compared as they are: fold their case before.
pub(crate) fn nearest<'n, T>(wanted: &str, known: impl Iterator<Item = (&'n str, T)>) -> Option<T> {
    // Every short name is near to every other one.
    let limit = (wanted.len() / 3).min(3);
    let mut best: Option<(usize, &str, T)> = None;
    for (name, what) in known {
        if let Some(distance) = edit_distance(wanted, name, limit)
            && best.as_ref().is_none_or(|found| (distance, name) < (found.0, found.1))
        {
            best = Some((distance, name, what));
        }
    }
    best.map(|(_, _, what)| what)
}

/// Letters to change to get from one name to the other, when at most `limit`.
fn edit_distance(a: &str, b: &str, limit: usize) -> Option<usize> {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len().abs_diff(b.len()) > limit || a.len() > MAX_COMPARED {
        return None;
    }
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let change = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = change.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row.last().copied().filter(|distance| *distance <= limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(wanted: &str, known: &[&'static str]) -> Option<&'static str> {
        nearest(wanted, known.iter().map(|name| (*name, *name)))
    }

    #[test]
    fn the_nearest_name_is_found_and_short_names_are_near_to_none() {
        assert_eq!(of("SPED", &["SPEND", "SPEED", "STEP"]), Some("SPEED"));
        assert_eq!(of("interval", &["intervall", "priority"]), Some("intervall"));
        assert_eq!(of("AB", &["AC"]), None);
        assert_eq!(of("MOTOR", &["VALVE"]), None);
        assert_eq!(of(&"A".repeat(90), &["A"]), None);
    }
}
