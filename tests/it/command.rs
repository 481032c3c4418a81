//! The real binary, run as a user would.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// Returns the command `tactnet` with `arguments`.
pub fn tactnet<I, S>(arguments: I) -> Command
where
    I: IntoIterator<Item = S>,
    S: AsRef<std::ffi::OsStr>,
{
    let mut command = Command::new(env!("CARGO_BIN_EXE_tactnet"));
    command.args(arguments).env_remove("RUST_LOG");
    command
}

/// Runs `command` and expects the exit code `code`.
pub fn expect(code: i32, mut command: Command) -> Output {
    let output = command.output().unwrap();
    assert_eq!(
        output.status.code(),
        Some(code),
        "{command:?}\nstdout: {}\nstderr: {}",
        stdout(&output),
        stderr(&output)
    );
    output
}

/// Runs `command`, which succeeds and prints a JSON document.
pub fn json(command: Command) -> serde_json::Value {
    serde_json::from_str(&stdout(&expect(0, command))).unwrap()
}

/// Runs `command`, which succeeds; returns its results.
pub fn output_of(command: Command) -> String {
    stdout(&expect(0, command))
}

/// Runs `command`, which succeeds; returns its messages.
pub fn messages_of(command: Command) -> String {
    stderr(&expect(0, command))
}

/// Runs `command`, which is a wrong call; returns its messages.
pub fn refusal(command: Command) -> String {
    stderr(&expect(2, command))
}

/// Asserts that a text contains words.
macro_rules! assert_says {
    ($text:expr, $words:expr) => {{
        let text = &$text;
        assert!(text.contains($words), "{text}")
    }};
}
pub(crate) use assert_says;

/// Sends a signal, such as `TERM`, to a process.
pub fn signal(name: &str, process: u32) {
    let sent = Command::new("kill")
        .args([&format!("-{name}"), &process.to_string()])
        .status();
    assert!(sent.unwrap().success());
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A folder with a small twin (`twin.h5`: 4 materials, 10 sweeps, 120 steps) and a small recipe.
pub struct Lab {
    pub folder: TempDir,
}

/// Layers of the small recipe.
pub const CONVOLUTIONS: &str = "maps = [8, 8]";
/// Layers of the small recipe of a network on spectra.
pub const SPECTRA: &str = "spectra = { bands = 6, taxel_units = 5, units = 12 }";

/// Changes to the small recipe.
#[derive(Default)]
pub struct RecipeChange {
    /// Layers; [`CONVOLUTIONS`] if empty.
    pub layers: &'static str,
    pub epochs: Option<usize>,
    pub extra_training: &'static str,
}

impl Lab {
    pub fn new() -> Self {
        let lab = Self {
            folder: TempDir::new().unwrap(),
        };
        lab.twin("twin.h5", "--materials 4 --sweeps 10 --steps 120");
        lab
    }

    /// Writes a twin with these options, which contain no spaces.
    pub fn twin(&self, name: &str, options: &str) {
        let mut twin = tactnet(["data", "twin", "--out"]);
        twin.arg(self.path(name)).args(options.split(' '));
        expect(0, twin);
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Returns `tactnet` with the words of `line`, in which `@` stands for the lab's folder: `data info @twin.h5`.
    pub fn command(&self, line: &str) -> Command {
        let folder = self.path("").display().to_string();
        let words = line.split_whitespace();
        tactnet(words.map(|word| word.replace('@', &folder)))
    }

    /// Returns the command `line` with more words, which are not divided.
    pub fn command_with(&self, line: &str, more: &[&str]) -> Command {
        let mut command = self.command(line);
        command.args(more);
        command
    }

    /// Runs the command `line`, which succeeds.
    pub fn run(&self, line: &str) -> Output {
        expect(0, self.command(line))
    }

    /// Returns what the command `line` says, which is a wrong call.
    pub fn refused(&self, line: &str) -> String {
        refusal(self.command(line))
    }

    pub fn recipe(&self, change: RecipeChange) -> PathBuf {
        let path = self.path("small.toml");
        let text = format!(
            "name = \"small\"\n\
             [network]\n{}\nhidden = 16\nkeep_probability = 0.8\n\
             [input]\nscaling = \"per-taxel\"\n\
             [training]\nepochs = {}\nbatch = 8\nlearning_rate = 0.005\nl2 = 1e-4\n\
             method = {{ kind = \"adversarial\", alpha = 0.5, epsilon = 0.1 }}\n{}\n\
             [prediction]\nmethod = {{ kind = \"mc-dropout\", runs = 20 }}\n",
            match change.layers {
                "" => CONVOLUTIONS,
                layers => layers,
            },
            change.epochs.unwrap_or(3),
            change.extra_training
        );
        std::fs::write(&path, text).unwrap();
        path
    }

    /// Writes the small recipe with this many epochs.
    pub fn recipe_for(&self, epochs: usize) -> PathBuf {
        self.recipe(RecipeChange {
            epochs: Some(epochs),
            ..RecipeChange::default()
        })
    }

    /// Returns `tactnet train` on the small twin with the small recipe, into `out`.
    pub fn train(&self, recipe: &Path, out: &str) -> Command {
        let mut command = tactnet(["train", "--data"]);
        command
            .arg(self.path("twin.h5"))
            .arg("--recipe")
            .arg(recipe)
            .arg("--out")
            .arg(self.path(out));
        command
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Returns the lines of a run's test predictions, without their head.
    pub fn prediction_rows(&self, run: &str) -> Vec<String> {
        let text = String::from_utf8(self.read(&format!("{run}/predictions_test.csv"))).unwrap();
        text.lines().skip(3).map(String::from).collect()
    }

    pub fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_slice(&self.read(name)).unwrap()
    }
}
