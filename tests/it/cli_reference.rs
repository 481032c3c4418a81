//! docs/cli.md is what `tactnet man --markdown` prints.

use crate::command::tactnet;

/// Only a build with all features has all commands.
#[cfg(feature = "full")]
#[test]
fn the_page_of_the_command_line_is_generated() {
    let printed = tactnet(["man", "--markdown"]).output().unwrap();
    let printed = String::from_utf8(printed.stdout).unwrap();
    let page = include_str!("../../docs/cli.md");
    let (_, generated) = page
        .split_once("<!-- tactnet man --markdown -->\n\n")
        .unwrap();
    assert!(
        printed.trim_end() == generated.trim_end(),
        "docs/cli.md differs from `tactnet man --markdown`; run tests/cli_reference.sh"
    );
}

#[test]
fn the_reference_names_every_option_with_its_default() {
    let printed = tactnet(["man", "--markdown"]).output().unwrap();
    let printed = String::from_utf8(printed.stdout).unwrap();
    for expected in [
        "## train",
        "| `--seed N` |",
        "[default: 1]",
        "tactnet train --resume",
    ] {
        assert!(printed.contains(expected), "{expected}");
    }
}
