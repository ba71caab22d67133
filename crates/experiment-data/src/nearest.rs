//! Names that were probably meant.

/// Candidates that are looked at: a file of more columns, or a folder of more files, is no list that anybody mistypes.
const MOST: usize = 100_000;
/// Letters that are compared: nobody reads longer names.
const LETTERS: usize = 64;

/// Up to three candidates within an edit distance that a slip of the keyboard explains, nearest first; ties keep
/// the candidates' order.
pub(crate) fn nearest<S: AsRef<str>>(name: &str, candidates: &[S]) -> Vec<String> {
    let limit = (name.chars().count() / 2).max(2);
    let name = letters(name);
    let near = |c: &str| {
        let other = letters(c);
        // At least as many letters are added or taken away.
        (name.len().abs_diff(other.len()) <= limit).then(|| distance(&name, &other))
    };
    let mut scored: Vec<(usize, &str)> = candidates
        .iter()
        .take(MOST)
        .filter_map(|c| Some((near(c.as_ref())?, c.as_ref())))
        .filter(|(d, _)| *d <= limit)
        .collect();
    scored.sort_by_key(|(d, _)| *d);
    scored.into_iter().take(3).map(|(_, c)| c.to_owned()).collect()
}

fn letters(name: &str) -> Vec<char> {
    name.chars().take(LETTERS).flat_map(char::to_lowercase).collect()
}

/// Levenshtein distance with neighbouring letters swapped counted as one.
fn distance(a: &[char], b: &[char]) -> usize {
    let mut d = vec![vec![0usize; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        d[i][0] = i;
    }
    for j in 0..=b.len() {
        d[0][j] = j;
    }
    for i in 1..=a.len() {
        for j in 1..=b.len() {
            let change = usize::from(a[i - 1] != b[j - 1]);
            d[i][j] = (d[i - 1][j] + 1)
                .min(d[i][j - 1] + 1)
                .min(d[i - 1][j - 1] + change);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                d[i][j] = d[i][j].min(d[i - 2][j - 2] + 1);
            }
        }
    }
    d[a.len()][b.len()]
}

/// "; did you mean `a` or `b`?" or nothing.
pub(crate) fn hint(nearest: &[String]) -> String {
    if nearest.is_empty() {
        return String::new();
    }
    let quoted: Vec<String> = nearest.iter().map(|n| format!("`{n}`")).collect();
    format!("; nearest: {}", quoted.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_counted_by_hand() {
        let distance = |a, b| distance(&letters(a), &letters(b));
        assert_eq!(distance("kitten", "sitting"), 3);
        assert_eq!(distance("ab", "BA"), 1);
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(nearest("sample_rat", &["name", "sample_rate"]), ["sample_rate"]);
        assert!(nearest("zzzzzz", &["name", "format"]).is_empty());
    }
}
