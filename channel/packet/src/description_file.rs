//! Packets that are described in a TOML file instead of Rust.
//!
//! ```toml
//! project = "arm"                     # prefix of names in C and Protocol Buffers
//! include = ["geometry.toml"]         # files with further constants, enums and structs
//!
//! [[constant]]
//! name = "JOINTS"
//! value = 7
//!
//! [[enum]]
//! name = "Mode"
//! values = [{ name = "Idle", number = 0, doc = "Brakes closed." }, { name = "Moving", number = 1 }]
//!
//! [[struct]]                          # a part of others; with a `version`, a packet
//! name = "Joint"
//! fields = [
//!   { name = "position", type = "f64", unit = "rad", doc = "Angle." },
//!   { name = "torque", type = "f64", unit = "Nm" },
//! ]
//!
//! [[struct]]
//! name = "ArmState"
//! version = 1
//! doc = "State of an arm."
//! fields = [
//!   { name = "mode", type = "Mode" },
//!   { name = "samples", type = "u32" },
//!   { name = "joints", type = "Joint", shape = ["JOINTS"] },
//!   { name = "forces", type = "f32", shape = [4, 3], counted_by = "samples", unit = "N" },
//!   { name = "tool", type = "text", bytes = 16 },
//! ]
//! ```
//!
//! Fields lie as in C. Padding must be written as fields, whose names begin with `reserved`. A field's `number` in
//! recordings is its position from 1 unless it is given. Fields named by `counted_by` and padding are not recorded.

mod layouts;
mod names;
mod text;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use toml::Spanned;

use crate::description::{Choice, Description};
use layouts::Layouts;
use names::Case;
use text::FileText;

/// Error of a description file.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The description is wrong.
    #[error("{}:{line}: {reason}", path.display())]
    Wrong {
        /// Path of the file: the description or one that it includes.
        path: PathBuf,
        /// Line of the mistake, from 1.
        line: usize,
        /// Found and expected.
        reason: String,
    },
}

/// A file with its text.
#[derive(Debug)]
struct Source {
    path: PathBuf,
    text: String,
}

impl Source {
    fn line(&self, span: &Range<usize>) -> usize {
        let before = self.text.get(..span.start).unwrap_or(&self.text);
        1 + before.matches('\n').count()
    }

    /// Returns an error at a place of the file.
    fn error(&self, span: Range<usize>, reason: impl Into<String>) -> DescriptionError {
        DescriptionError::Wrong {
            path: self.path.clone(),
            line: self.line(&span),
            reason: reason.into(),
        }
    }
}

/// A value with the file that it is from.
struct Located<T> {
    source: Rc<Source>,
    value: T,
}

/// Content of a description and its included files, in the order of the definitions.
#[derive(Default)]
struct Contents {
    /// Files that are included already.
    files: Vec<PathBuf>,
    /// Place of each definition.
    defined: BTreeMap<String, String>,
    constants: Vec<(&'static str, &'static str, usize)>,
    choices: Vec<Choice>,
    structs: Vec<Located<text::StructText>>,
}

impl Description {
    /// Reads a description file with the files that it includes. The result lives as long as the process.
    ///
    /// # Errors
    /// A file cannot be read, or is wrong; the error names file and line.
    pub fn read(path: &Path) -> Result<Self, DescriptionError> {
        let text = std::fs::read_to_string(path).map_err(|source| DescriptionError::Io {
            path: path.into(),
            source,
        })?;
        let source = Rc::new(Source {
            path: path.into(),
            text,
        });
        let mut contents = Contents::default();
        let project = contents.add(&source)?;
        let Some(project) = project else {
            return Err(source.error(0..0, "expected the key `project`"));
        };
        names::check(&source, &project, Case::Snake)?;
        if project.get_ref().starts_with("tactnet") {
            let reason = "project: names of tactnet's own packets begin with `tactnet`";
            return Err(source.error(project.span(), reason));
        }
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        Ok(Self {
            project: project.into_inner().leak(),
            source: file.into_owned().leak(),
            packets: Layouts::of(&contents)?.leak(),
            constants: contents.constants.leak(),
            choices: contents.choices.leak(),
        })
    }
}

impl Contents {
    /// Adds a file after the files that it includes. Returns its project.
    fn add(&mut self, source: &Rc<Source>) -> Result<Option<Spanned<String>>, DescriptionError> {
        let file: FileText = toml::from_str(&source.text)
            .map_err(|error| source.error(error.span().unwrap_or_default(), error.message()))?;
        let whole = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.into());
        self.files.push(whole(&source.path));
        for include in file.include {
            let folder = source.path.parent().unwrap_or(Path::new(""));
            let path = folder.join(include.get_ref());
            if self.files.contains(&whole(&path)) {
                continue;
            }
            let text = std::fs::read_to_string(&path).map_err(|error| {
                source.error(
                    include.span(),
                    format!("include: {}: {error}", path.display()),
                )
            })?;
            self.add(&Rc::new(Source { path, text }))?;
        }
        for constant in file.constants {
            self.define(source, &constant.name, Case::Constant)?;
            let name = constant.name.into_inner().leak();
            self.constants
                .push((name, constant.doc.leak(), constant.value));
        }
        for choice in file.choices {
            self.define(source, &choice.name, Case::Type)?;
            self.choices.push(choice.check(source)?);
        }
        for value in file.structs {
            self.define(source, &value.name, Case::Type)?;
            self.structs.push(Located {
                source: source.clone(),
                value,
            });
        }
        Ok(file.project)
    }

    /// Checks a name, which must be new.
    fn define(
        &mut self,
        source: &Source,
        name: &Spanned<String>,
        case: Case,
    ) -> Result<(), DescriptionError> {
        names::check(source, name, case)?;
        let place = format!("{}:{}", source.path.display(), source.line(&name.span()));
        match self.defined.insert(name.get_ref().clone(), place) {
            None => Ok(()),
            Some(first) => {
                let reason = format!("`{}` is already defined in {first}", name.get_ref());
                Err(source.error(name.span(), reason))
            }
        }
    }
}
