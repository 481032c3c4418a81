//! Parsed text of a description file, before names are resolved.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;
use toml::Spanned;

use super::names::{self, Case};
use super::{DescriptionError, Source};
use crate::description::Choice;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileText {
    pub project: Option<Spanned<String>>,
    #[serde(default)]
    pub include: Vec<Spanned<String>>,
    #[serde(default, rename = "constant")]
    pub constants: Vec<ConstantText>,
    #[serde(default, rename = "enum")]
    pub choices: Vec<ChoiceText>,
    #[serde(default, rename = "struct")]
    pub structs: Vec<StructText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConstantText {
    pub name: Spanned<String>,
    pub value: usize,
    #[serde(default)]
    pub doc: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ChoiceText {
    pub name: Spanned<String>,
    #[serde(default)]
    pub doc: String,
    pub values: Vec<ValueText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ValueText {
    pub name: Spanned<String>,
    pub number: Spanned<u32>,
    #[serde(default)]
    pub doc: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StructText {
    pub name: Spanned<String>,
    /// Present for a packet.
    pub version: Option<Spanned<u32>>,
    #[serde(default)]
    pub doc: String,
    pub fields: Vec<FieldText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FieldText {
    pub name: Spanned<String>,
    pub r#type: Spanned<String>,
    /// Lengths or names of constants, the outermost first.
    #[serde(default)]
    pub shape: Vec<Spanned<toml::Value>>,
    /// Length of a text.
    pub bytes: Option<Spanned<toml::Value>>,
    #[serde(default)]
    pub doc: String,
    pub unit: Option<String>,
    pub number: Option<Spanned<u32>>,
    pub counted_by: Option<Spanned<String>>,
}

/// Returns documentation as lines; none for an empty text.
pub(super) fn lines(doc: String) -> &'static [&'static str] {
    let doc: &'static str = doc.leak();
    let lines = doc.lines().map(str::trim);
    lines
        .filter(|line| !line.is_empty())
        .collect::<Vec<_>>()
        .leak()
}

impl ChoiceText {
    /// Checks names and numbers of the values.
    pub fn check(self, source: &Source) -> Result<Choice, DescriptionError> {
        let (mut numbers, mut known) = (BTreeMap::new(), BTreeSet::new());
        let mut values = Vec::new();
        for value in self.values {
            names::check(source, &value.name, Case::Type)?;
            let number = *value.number.get_ref();
            if let Some(other) = numbers.insert(number, value.name.get_ref().clone()) {
                let reason = format!("number {number} is taken by `{other}`");
                return Err(source.error(value.number.span(), reason));
            }
            if !known.insert(value.name.get_ref().clone()) {
                let reason = format!("`{}` is there twice", value.name.get_ref());
                return Err(source.error(value.name.span(), reason));
            }
            let name: &'static str = value.name.into_inner().leak();
            values.push((name, lines(value.doc), number));
        }
        if values.is_empty() {
            return Err(source.error(self.name.span(), "expected at least one value"));
        }
        Ok(Choice {
            name: self.name.into_inner().leak(),
            docs: lines(self.doc),
            values: values.leak(),
        })
    }
}

impl FieldText {
    /// Returns the documentation with the unit.
    pub fn docs(&self) -> &'static [&'static str] {
        lines(match &self.unit {
            None => self.doc.clone(),
            Some(unit) if self.doc.is_empty() => format!("In {unit}."),
            Some(unit) => format!("{}, in {unit}.", self.doc.trim_end().trim_end_matches('.')),
        })
    }
}
