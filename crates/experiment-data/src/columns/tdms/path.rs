//! The paths of objects.

/// Group and channel of `/'group'/'channel'`, in which a quotation mark is written twice; none for groups and the root.
pub(super) fn channel_names(path: &str) -> Option<(String, String)> {
    let inside = path.strip_prefix("/'")?.strip_suffix('\'')?;
    let (mut parts, mut rest) = (vec![String::new()], inside);
    while !rest.is_empty() {
        let last = parts.last_mut()?;
        if let Some(behind) = rest.strip_prefix("''") {
            last.push('\'');
            rest = behind;
        } else if let Some(behind) = rest.strip_prefix("'/'") {
            parts.push(String::new());
            rest = behind;
        } else {
            let c = rest.chars().next()?;
            last.push(c);
            rest = &rest[c.len_utf8()..];
        }
    }
    let [group, name] = <[String; 2]>::try_from(parts).ok()?;
    Some((group, name))
}

#[cfg(test)]
mod tests {
    use super::channel_names;

    #[test]
    fn paths_by_hand() {
        let names = |path| channel_names(path);
        let pair = |a: &str, b: &str| Some((a.to_owned(), b.to_owned()));
        assert_eq!(names("/'g'/'c'"), pair("g", "c"));
        assert_eq!(names("/'it''s'/'a/b'"), pair("it's", "a/b"));
        for none in ["/", "/'g'", "", "/'a'/'b'/'c'", "x"] {
            assert_eq!(names(none), None);
        }
    }
}
