//! The main help page, with the commands in groups.

use std::fmt::Write;

use clap::Command;

/// Groups of the main help page, with their commands.
const GROUPS: [(&str, &[&str]); 4] = [
    ("Data", &["data"]),
    (
        "Train and evaluate",
        &[
            "train",
            "eval",
            "predict",
            "same",
            "enroll",
            "adapt",
            "distill",
            "regress",
            "export",
            "experiment",
        ],
    ),
    (
        "Robot",
        &[
            "demo",
            "serve",
            "dashboard",
            "channel",
            "record",
            "replay",
            "view",
            "simulate",
            "catch",
        ],
    ),
    (
        "Tools",
        &["bench", "doctor", "completions", "man", "version"],
    ),
];

/// Replaces the flat list of commands on the main help page by groups.
pub fn with_groups(command: Command) -> Command {
    let mut list = String::new();
    for (heading, names) in GROUPS {
        let _ = write!(list, "\n\n{heading}:");
        for name in names {
            if let Some(subcommand) = command.find_subcommand(name) {
                let about = subcommand.get_about().map(ToString::to_string);
                let _ = write!(list, "\n  {name:<13}{}", about.unwrap_or_default());
            }
        }
    }
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}{list}\n\nOptions:\n{{options}}{{after-help}}"
    ))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clap::CommandFactory;

    use super::*;

    #[test]
    fn every_command_is_in_one_group_and_fits_a_terminal() {
        let command = crate::Cli::command();
        let visible = command.get_subcommands().filter(|it| !it.is_hide_set());
        let visible: BTreeSet<&str> = visible.map(Command::get_name).collect();
        let listed: Vec<&str> = GROUPS
            .iter()
            .flat_map(|(_, names)| *names)
            .copied()
            .collect();
        assert_eq!(listed.iter().copied().collect::<BTreeSet<_>>(), visible);
        assert_eq!(listed.len(), visible.len(), "one group each");
        let help = with_groups(command).render_help().to_string();
        let groups = help.split("Examples:").next().unwrap();
        for line in groups.lines() {
            assert!(line.chars().count() <= 100, "{line}");
        }
    }
}
