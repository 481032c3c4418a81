//! Ridge regression, with a penalty chosen by closed-form leave-one-out cross-validation.
//!
//! With the singular values `X = U diag(s) V^T` of the centred features, the coefficients are `V diag(s / (s^2 + penalty)) U^T y`, and
//! the leave-one-out residual of row `i` is its residual divided by `1 - h_i`, where `h_i = 1 / n + sum over j of U_ij^2 s_j^2 / (s_j^2 +
//! penalty)` is its leverage; `1 / n` is that of the intercept, which is not penalised (Golub, Heath & Wahba, 1979; scikit-learn's `RidgeCV`).

use faer::{Mat, Par};

use crate::{Features, ModelError};

/// Fitted ridge regression.
#[derive(Debug, Clone, PartialEq)]
pub struct RidgeRegression {
    /// `[width]`
    coefficients: Vec<f64>,
    intercept: f64,
    /// Penalty with the smallest leave-one-out residual.
    penalty: f64,
}

impl RidgeRegression {
    /// Fits to `values`, one for each row of `features`, with the penalty that has the smallest mean squared leave-one-out residual.
    ///
    /// ```
    /// use tactnet_models::{Features, RidgeRegression};
    ///
    /// let features = Features::new(1, vec![0.0, 1.0, 2.0, 3.0]);
    /// let line = RidgeRegression::fit(&features, &[1.0, 3.0, 5.0, 7.0], &[1e-9, 10.0])?;
    /// assert_eq!(line.penalty(), 1e-9);
    /// assert!((line.predict(&[4.0]) - 9.0).abs() < 1e-6);
    /// # Ok::<(), tactnet_models::ModelError>(())
    /// ```
    ///
    /// # Errors
    /// The singular value decomposition fails; no penalty gives a finite residual.
    ///
    /// # Panics
    /// If there is not one value for each row.
    pub fn fit(features: &Features, values: &[f64], penalties: &[f64]) -> Result<Self, ModelError> {
        let (rows, width) = (features.len(), features.width());
        assert_eq!(values.len(), rows, "a value for each row");
        let failed = |reason: String| ModelError::Fit {
            what: "ridge regression",
            reason,
        };
        let means: Vec<f64> = (0..width)
            .map(|column| {
                let of_column = features.rows().map(|row| f64::from(row[column]));
                of_column.sum::<f64>() / rows as f64
            })
            .collect();
        let mean = values.iter().sum::<f64>() / rows as f64;
        let centred = Mat::<f64>::from_fn(rows, width, |row, column| {
            f64::from(features.row(row)[column]) - means[column]
        });
        // With one thread, results do not depend on the number of threads.
        faer::set_global_parallelism(Par::Seq);
        let svd = centred
            .thin_svd()
            .map_err(|error| failed(format!("no singular values: {error:?}")))?;
        let (left, right) = (svd.U(), svd.V());
        let squares: Vec<f64> = svd.S().column_vector().iter().map(|s| s * s).collect();
        let projected: Vec<f64> = (0..squares.len())
            .map(|j| (0..rows).map(|i| left[(i, j)] * (values[i] - mean)).sum())
            .collect();
        let loss = |penalty: f64| -> f64 {
            let shares: Vec<f64> = squares.iter().map(|s| s / (s + penalty)).collect();
            let residual = |row: usize| {
                let (mut fitted, mut leverage) = (mean, 1.0 / rows as f64);
                for (j, share) in shares.iter().enumerate() {
                    fitted += left[(row, j)] * share * projected[j];
                    leverage += left[(row, j)].powi(2) * share;
                }
                ((values[row] - fitted) / (1.0 - leverage)).powi(2)
            };
            (0..rows).map(residual).sum()
        };
        let losses = penalties.iter().map(|penalty| (*penalty, loss(*penalty)));
        let (penalty, _) = losses
            .filter(|(_, loss)| loss.is_finite())
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .ok_or_else(|| failed("no penalty gives a finite leave-one-out residual".into()))?;
        let coefficients: Vec<f64> = (0..width)
            .map(|column| {
                let terms = squares.iter().zip(&projected).enumerate();
                let terms =
                    terms.map(|(j, (s, p))| right[(column, j)] * s.sqrt() / (s + penalty) * p);
                terms.sum()
            })
            .collect();
        let at_means: f64 = means.iter().zip(&coefficients).map(|(m, c)| m * c).sum();
        Ok(Self {
            intercept: mean - at_means,
            coefficients,
            penalty,
        })
    }

    /// Returns the penalty that was chosen.
    pub fn penalty(&self) -> f64 {
        self.penalty
    }

    /// Returns the predicted value of one row of features.
    ///
    /// # Panics
    /// If it has another width.
    pub fn predict(&self, row: &[f32]) -> f64 {
        assert_eq!(row.len(), self.coefficients.len(), "width of a row");
        let terms = row.iter().zip(&self.coefficients);
        self.intercept + terms.map(|(x, c)| f64::from(*x) * c).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    /// Golden values from `tests/golden/ridge_with_sklearn.py` (`sklearn.linear_model.RidgeCV`).
    #[test]
    fn ridge_regression_is_scikit_learns() {
        let golden = include_str!("../../tests/golden/ridge_with_sklearn.json");
        let golden: Value = serde_json::from_str(golden).unwrap();
        let numbers = |value: &Value| -> Vec<f64> {
            let all = value.as_array().unwrap().iter();
            all.map(|number| number.as_f64().unwrap()).collect()
        };
        let features = |case: &Value, name: &str| {
            let values = numbers(&case[name]).into_iter().map(|value| value as f32);
            Features::new(case["width"].as_u64().unwrap() as usize, values.collect())
        };
        for case in golden["cases"].as_array().unwrap() {
            let penalties = numbers(&case["penalties"]);
            let train = features(case, "train");
            let fit = RidgeRegression::fit(&train, &numbers(&case["values"]), &penalties).unwrap();
            assert_eq!(fit.penalty(), case["penalty"].as_f64().unwrap());
            let queries = features(case, "queries");
            for (row, expected) in queries.rows().zip(numbers(&case["predictions"])) {
                // Sums of 40 products in another order, of values up to 100.
                assert!((fit.predict(row) - expected).abs() < 1e-8, "{expected}");
            }
        }
    }
}
