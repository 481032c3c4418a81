//! Parts that a build leaves out.

/// Returns, in one line, that this program was built without the cargo feature `feature`, and what builds one that has it.
pub fn left_out(feature: &str) -> String {
    format!(
        "this program was built without `{feature}`; in a checkout of the source, `cargo install --path . --features {feature}` builds one that has it"
    )
}
