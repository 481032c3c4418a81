//! The reference of all commands, which the book contains.

use crate::command::tactnet;

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
    assert!(!printed.contains("```sh\n\n```"), "no empty examples");
}
