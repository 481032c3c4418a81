//! Influence of the recording blocks on an accuracy, as text.

use tactnet_pipeline::{ConfoundedAccuracy, Estimate, RandomFold};

use crate::output::counted;

/// Returns the accuracy on a random fold, which has sweeps of the same recordings in training.
pub fn random_fold_text(random: &RandomFold) -> String {
    format!(
        "sweeps of the same recordings in training: {}, {}",
        share_text(random.one_sweep),
        random.split
    )
}

/// Returns a sentence on materials that coincide with recording blocks, and the accuracy on the others.
pub fn confounded_text(found: &ConfoundedAccuracy) -> String {
    let (confounded, materials) = (found.confounded.len(), found.materials);
    let of_all = format!("{confounded} of {materials} materials were recorded in one session each");
    let accuracy = found.unconfounded_one_sweep;
    let names = found.unconfounded.join(", ");
    match (found.n_confounded, accuracy) {
        // Whole sessions are held out: such a material has no other to be tested on.
        (0, _) => format!("not tested: {of_all}; this accuracy is that of the others"),
        (_, None) => format!("{of_all}: this accuracy cannot be told from recognising the session"),
        (_, Some(accuracy)) => format!(
            "{of_all}: this accuracy cannot be told from recognising the session\n\
             materials that share their sessions with others ({names}): {} of {}",
            share_text(accuracy),
            counted(accuracy.n, "sweep")
        ),
    }
}

/// Returns a share with its interval.
pub fn share_text(estimate: Estimate) -> String {
    format!(
        "{:.1} % ({:.1} to {:.1})",
        100.0 * estimate.mean,
        100.0 * estimate.ci95_low,
        100.0 * estimate.ci95_high
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn floors(n_confounded: usize, unconfounded_one_sweep: Option<Estimate>) -> String {
        let floors =
            |range: std::ops::Range<usize>| range.map(|floor| format!("floor {floor}")).collect();
        confounded_text(&ConfoundedAccuracy {
            confounded: floors(0..8),
            n_confounded,
            materials: 10,
            unconfounded: floors(8..10),
            unconfounded_one_sweep,
        })
    }

    #[test]
    fn a_robot_with_ten_floors_of_which_eight_have_a_session_each_is_told_so() {
        let sentence = "8 of 10 materials were recorded in one session each: this accuracy cannot be told from recognising \
                        the session";
        assert_eq!(floors(160, None), sentence);
        let partly = floors(160, Some(Estimate::wilson(0.75, 40)));
        assert_eq!(
            partly,
            format!(
                "{sentence}\nmaterials that share their sessions with others (floor 8, floor 9): 75.0 % (59.8 to 85.8) of 40 sweeps"
            )
        );
        assert!(
            floors(0, Some(Estimate::wilson(0.75, 40)))
                .starts_with("not tested: 8 of 10 materials")
        );
    }

    #[test]
    fn the_number_on_random_folds_says_what_it_has_in_training() {
        let text = random_fold_text(&RandomFold {
            split: "fold 1 of 5".into(),
            n_train: 434,
            one_sweep: Estimate::wilson(0.972_222, 108),
        });
        assert!(
            text.starts_with("sweeps of the same recordings in training: 97.2 % (92."),
            "{text}"
        );
    }
}
