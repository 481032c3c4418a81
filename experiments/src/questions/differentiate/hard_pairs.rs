//! The seven pairs of materials that human subjects had to tell apart (thesis, section 4.5.3).

use crate::published_confusion::TACTMAT_MATERIALS;

/// The hardest pairs for humans and for the robot, as ids of TactMat.
const HARD_PAIRS: [[usize; 2]; 7] = [
    [0, 1],
    [12, 7],
    [16, 10],
    [10, 14],
    [9, 10],
    [11, 12],
    [4, 8],
];

/// Returns the hard pairs as labels of `materials`; `None` unless these are TactMat's.
pub(crate) fn hard_pairs(materials: &[&str]) -> Option<Vec<[usize; 2]>> {
    let label = |id: usize| {
        materials
            .iter()
            .position(|name| *name == TACTMAT_MATERIALS[id])
    };
    HARD_PAIRS
        .iter()
        .map(|[a, b]| Some([label(*a)?, label(*b)?]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pairs_are_made_of_eleven_materials() {
        let mut ids: Vec<usize> = HARD_PAIRS.concat();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), 11);
        let mut names = TACTMAT_MATERIALS.to_vec();
        names.reverse();
        assert_eq!(hard_pairs(&names).unwrap()[0], [35, 34]);
        assert_eq!(hard_pairs(&names[..30]), None);
    }
}
