//! Overrides of recipe fields as `FIELD=VALUE`, and compatibility with former recipe layouts.

use toml::{Table, Value};

/// Fields of a recipe outside its question.
pub(crate) const FIELDS: [&str; 15] = [
    "name", "title", "expects", "takes", "data", "models", "levels", "steps", "rate_hz", "seed",
    "epochs", "device", "question", "variants", "search",
];
/// Fields of the question that former recipes contain at the top level.
const OF_QUESTION: [&str; 8] = [
    "folds", "repeats", "split", "probes", "groups", "splits", "shots", "methods",
];
/// Fields of the question that former recipes contain in `study`.
const OF_STUDY: [&str; 2] = ["new_materials", "scratch_folds"];

/// Converts a recipe to the current layout: moves `study` and the question's fields into `question`. The default kind
/// is a cross-validation.
pub(crate) fn current_shape(recipe: &mut Table) {
    for older in ["runs", "study"].into_iter().chain(OF_QUESTION) {
        if let Some(value) = recipe.remove(older) {
            // This cannot fail: `question` is a table, or parsing the recipe reports it.
            let _ = set_field(recipe, older, value);
        }
    }
    let question = recipe
        .entry("question")
        .or_insert_with(|| Value::Table(Table::new()));
    if let Value::Table(question) = question {
        question
            .entry("kind")
            .or_insert_with(|| Value::String("crossval".into()));
    }
}

/// Sets a field by its path or former name. A name that is not a field of the recipe is set in its question.
///
/// # Errors
/// A path through a value that is not a table.
pub(crate) fn set_field(recipe: &mut Table, path: &str, value: Value) -> Result<(), String> {
    let first = path.split('.').next().unwrap_or(path);
    match (path, value) {
        ("runs", value) => set(recipe, "question.repeats", value),
        ("study", Value::Table(study)) => {
            if let Some(Value::Table(question)) = recipe.get_mut("question") {
                let same = study
                    .get("kind")
                    .is_none_or(|kind| question.get("kind") == Some(kind));
                // Drop the fields of another question.
                question.retain(|field, _| same && !OF_STUDY.contains(&field));
            }
            study
                .into_iter()
                .try_for_each(|(field, value)| set(recipe, &format!("question.{field}"), value))
        }
        (path, value) if path.starts_with("study.") => {
            set(recipe, &path.replacen("study", "question", 1), value)
        }
        (path, value) if FIELDS.contains(&first) || path.is_empty() => set(recipe, path, value),
        (path, value) => set(recipe, &format!("question.{path}"), value),
    }
}

/// Parses a TOML value, or a bare word as a string. Text that starts like a list, a table or a quoted string must be
/// valid TOML.
pub(crate) fn parse_value(text: &str) -> Result<Value, String> {
    match format!("value = {text}").parse::<Table>() {
        Ok(mut table) => Ok(table
            .remove("value")
            .unwrap_or_else(|| Value::String(text.into()))),
        Err(error) if text.starts_with(['[', '{', '"', '\'']) => Err(error.message().into()),
        Err(_) => Ok(Value::String(text.into())),
    }
}

/// Sets a field by its path (`training.learning_rate`) and creates missing tables.
pub(crate) fn set(table: &mut Table, path: &str, value: Value) -> Result<(), String> {
    match path.split_once('.') {
        None if path.is_empty() => Err("a setting needs a name before `=`".into()),
        None => {
            table.insert(path.into(), value);
            Ok(())
        }
        Some((first, rest)) => match table
            .entry(first)
            .or_insert_with(|| Value::Table(Table::new()))
        {
            Value::Table(inner) => set(inner, rest, value),
            other => Err(format!("`{first}` is {}, not a table", other.type_str())),
        },
    }
}
