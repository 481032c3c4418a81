//! Features and a classical classifier: recipe, fit, fitted form.

pub(crate) mod fit;
pub(crate) mod fitted;
pub(crate) mod recipe;
