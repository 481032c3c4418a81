//! Maps by prediction method, with the methods' names as keys in files.

use std::collections::BTreeMap;

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::{Evaluation, PredictionMethod};

/// Serialises a map with the names of the methods ([`PredictionMethod::name`]) as keys.
///
/// # Errors
/// Errors of the serializer.
pub fn serialize_by_method<S: Serializer, T: Serialize>(
    map: &BTreeMap<PredictionMethod, T>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(map.iter().map(|(method, value)| (method.name(), value)))
}

/// Deserialises evaluations by the names of their methods. The evaluation itself holds the number of passes.
///
/// # Errors
/// An evaluation under the name of another method.
pub(crate) fn deserialize_evaluations<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<BTreeMap<PredictionMethod, Evaluation>, D::Error> {
    let by_name = BTreeMap::<String, Evaluation>::deserialize(deserializer)?;
    by_name
        .into_iter()
        .map(|(name, evaluation)| {
            let method = evaluation.method;
            if method.name() == name {
                Ok((method, evaluation))
            } else {
                let expected = method.name();
                Err(D::Error::custom(format!(
                    "expected the evaluation of `{expected}` under its name, found it under `{name}`"
                )))
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Estimate;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Document {
        #[serde(
            serialize_with = "serialize_by_method",
            deserialize_with = "deserialize_evaluations"
        )]
        evaluations: BTreeMap<PredictionMethod, Evaluation>,
    }

    fn evaluation(method: PredictionMethod) -> Evaluation {
        Evaluation {
            method,
            one_sweep: Estimate {
                mean: 0.5,
                ci95_low: 0.25,
                ci95_high: 0.75,
                n: 4,
            },
            balanced: None,
            by_length: Vec::new(),
            fused: None,
            negative_log_likelihood: 1.0,
            expected_calibration_error: 0.25,
            brier: 0.5,
        }
    }

    #[test]
    fn evaluations_stand_in_files_by_name_in_the_order_of_names() {
        let methods = [
            PredictionMethod::Plain,
            PredictionMethod::McDropout { mc_samples: 7 },
        ];
        let document = Document {
            evaluations: methods.map(|method| (method, evaluation(method))).into(),
        };
        let text = serde_json::to_string(&document).unwrap();
        let (dropout, plain) = (text.find("\"mc_dropout\":{"), text.find("\"plain\":{"));
        assert!(dropout.is_some() && dropout < plain, "{text}");
        assert_eq!(serde_json::from_str::<Document>(&text).unwrap(), document);
        let swapped = text.replace("\"plain\":{", "\"bayes\":{");
        let error = serde_json::from_str::<Document>(&swapped).unwrap_err();
        assert!(
            error.to_string().contains("found it under `bayes`"),
            "{error}"
        );
    }
}
