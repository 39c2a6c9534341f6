//! "Did you mean ...?": the known name nearest to a misspelt one.
//!
//! Distance: optimal string alignment, the number of insertions, deletions, substitutions and swaps of neighbours
//! that turn one word into the other.

/// The candidate nearest to `word`, if it is near enough to be what was meant. One that only lacks its end, such as a
/// unit, is nearest; else a third of the word's letters, and at least two, may differ. Of equals, the first.
pub(super) fn nearest<'c>(
    word: &str,
    candidates: impl IntoIterator<Item = &'c str, IntoIter: Clone>,
) -> Option<&'c str> {
    let candidates = candidates.into_iter();
    let letters: Vec<char> = word.chars().collect();
    let limit = (letters.len() / 3).max(2);
    let lacks_end = |candidate: &&str| {
        candidate
            .strip_prefix(word)
            .is_some_and(|rest| rest.starts_with('_'))
    };
    let by_edits = || {
        candidates
            .clone()
            .filter(|candidate| candidate.chars().count().abs_diff(letters.len()) <= limit)
            .map(|candidate| {
                (
                    distance(&letters, &candidate.chars().collect::<Vec<_>>()),
                    candidate,
                )
            })
            .filter(|&(edits, candidate)| edits <= limit && edits < candidate.len())
            .min_by_key(|&(edits, _)| edits)
            .map(|(_, candidate)| candidate)
    };
    candidates.clone().find(lacks_end).or_else(by_edits)
}

/// The number of edits between `a` and `b`, by rows of the usual table; a swap looks two rows back.
fn distance(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = Vec::new();
    let mut above: Vec<usize> = (0..=b.len()).collect();
    for (i, &letter) in a.iter().enumerate() {
        let mut row = vec![i + 1; b.len() + 1];
        for (j, &other) in b.iter().enumerate() {
            let substituted = above[j] + usize::from(letter != other);
            let mut edits = substituted.min(above[j + 1] + 1).min(row[j] + 1);
            if i > 0 && j > 0 && letter == b[j - 1] && a[i - 1] == other {
                edits = edits.min(before[j - 1] + 1);
            }
            row[j + 1] = edits;
        }
        before = std::mem::replace(&mut above, row);
    }
    above[b.len()]
}

#[cfg(test)]
mod tests {
    use super::{distance, nearest};

    #[test]
    fn distances_of_known_pairs() {
        let cases = [
            ("", "", 0),
            ("", "abc", 3),
            ("abc", "", 3),
            ("kitten", "sitting", 3),
            ("heading", "haeding", 1),
            ("gate", "gates", 1),
            ("ab", "ba", 1),
            ("same", "same", 0),
        ];
        for (a, b, expected) in cases {
            let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
            assert_eq!(distance(&a, &b), expected, "{a:?} {b:?}");
            assert_eq!(distance(&b, &a), expected, "{b:?} {a:?}");
        }
    }

    #[test]
    fn only_a_near_name_is_suggested() {
        let known = ["heading_deg", "heading_sigma_deg", "id", "biases"];
        assert_eq!(nearest("headng_deg", known), Some("heading_deg"));
        assert_eq!(nearest("Heading_Deg", known), Some("heading_deg"));
        assert_eq!(nearest("bias", known), Some("biases"));
        assert_eq!(
            nearest("heading_sigma", known),
            Some("heading_sigma_deg"),
            "without its unit"
        );
        assert_eq!(nearest("temperature", known), None);
        assert_eq!(
            nearest("x", known),
            None,
            "two edits make any two-letter name: that is no likeness"
        );
        assert_eq!(nearest("", known), None);
    }
}
