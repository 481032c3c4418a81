//! `--set FIELD=VALUE`, and the fields that recipes had before a question had fields of its own.

use toml::{Table, Value};

/// Fields of a recipe beside its question's.
pub(crate) const FIELDS: [&str; 15] = [
    "name", "title", "expects", "takes", "data", "models", "levels", "steps", "rate_hz", "seed",
    "epochs", "device", "question", "variants", "search",
];
/// Fields of the question that stood beside it in older recipes.
const OF_QUESTION: [&str; 8] = [
    "folds", "repeats", "split", "probes", "groups", "splits", "shots", "methods",
];
/// Fields of the question that `study` has held.
const OF_STUDY: [&str; 2] = ["new_materials", "scratch_folds"];

/// Brings a recipe into its present shape: `study` and what belongs to the question go into `question`; without a kind it is a
/// cross-validation.
pub(crate) fn current_shape(recipe: &mut Table) {
    for older in ["runs", "study"].into_iter().chain(OF_QUESTION) {
        if let Some(value) = recipe.remove(older) {
            // A field of a question cannot fail to be set: `question` is a table or is refused when the recipe is read.
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

/// Sets a field of a recipe in its present shape, by its path or by its older name; what is no field of the recipe is one of its question.
///
/// # Errors
/// A path that leads through something that is no table.
pub(crate) fn set_field(recipe: &mut Table, path: &str, value: Value) -> Result<(), String> {
    let first = path.split('.').next().unwrap_or(path);
    match (path, value) {
        ("runs", value) => set(recipe, "question.repeats", value),
        ("study", Value::Table(study)) => {
            if let Some(Value::Table(question)) = recipe.get_mut("question") {
                let same = study
                    .get("kind")
                    .is_none_or(|kind| question.get("kind") == Some(kind));
                // Fields of another question mean nothing to this one.
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

/// TOML, or a bare word as a string; what begins like a list, a table or a quoted string must be one.
pub(crate) fn parse_value(text: &str) -> Result<Value, String> {
    match format!("value = {text}").parse::<Table>() {
        Ok(mut table) => Ok(table
            .remove("value")
            .unwrap_or_else(|| Value::String(text.into()))),
        Err(error) if text.starts_with(['[', '{', '"', '\'']) => Err(error.message().into()),
        Err(_) => Ok(Value::String(text.into())),
    }
}

/// Sets a field by its path (`training.learning_rate`), making tables on the way.
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
