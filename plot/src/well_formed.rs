//! Check of generated XML, for tests.

/// Panics unless every element of `xml` is closed in order, every attribute is quoted and every `&` begins an entity.
pub(crate) fn assert_well_formed(xml: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = xml;
    while let Some(at) = rest.find('<') {
        assert_text(&rest[..at]);
        let end = at
            + rest[at..]
                .find('>')
                .unwrap_or_else(|| panic!("no end: {}", &rest[at..]));
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "</{name}> in {xml}");
            continue;
        }
        let content = tag.trim_end_matches('/');
        let (name, attributes) = content.split_once(' ').unwrap_or((content, ""));
        assert_attributes(attributes);
        if !tag.ends_with('/') {
            open.push(name);
        }
    }
    assert_text(rest);
    assert!(open.is_empty(), "{open:?} stay open in {xml}");
}

fn assert_attributes(attributes: &str) {
    let mut rest = attributes.trim();
    while !rest.is_empty() {
        let (name, value) = rest
            .split_once("=\"")
            .unwrap_or_else(|| panic!("unquoted: {rest}"));
        assert!(!name.contains(['"', ' ']), "attribute {name}");
        let (value, after) = value
            .split_once('"')
            .unwrap_or_else(|| panic!("not closed: {rest}"));
        assert_text(value);
        rest = after.trim_start();
    }
}

fn assert_text(text: &str) {
    for entity in text.split('&').skip(1) {
        let known = ["amp;", "lt;", "gt;", "quot;", "#39;"];
        assert!(
            known.iter().any(|name| entity.starts_with(name)),
            "&{entity}"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_found() {
        assert_well_formed("<g a=\"1\" b=\"x y\"><c/>a &amp; b</g>");
        for fault in [
            "<g>",
            "<g></h>",
            "</g>",
            "<g a=1/>",
            "a & b",
            "<a><b></a></b>",
        ] {
            assert!(
                std::panic::catch_unwind(|| assert_well_formed(fault)).is_err(),
                "{fault}"
            );
        }
    }
}
