//! Exact Euclidean distance transform in linear time: P. F. Felzenszwalb and D. P. Huttenlocher, Distance transforms of
//! sampled functions, Theory of Computing 8 (2012). In each dimension, the squared distance is the lower envelope of
//! parabolas.

/// Returns the squared distance, in cells, from each cell's centre to that of the nearest solid cell, or infinity if
/// there is none. Rows go along x, then y, then z. Squared distances are exact integers.
///
/// # Panics
/// Panics if `solid` does not have one entry per cell.
pub fn squared_distances(cells: [usize; 3], solid: &[bool]) -> Vec<f32> {
    let [nx, ny, nz] = cells;
    assert_eq!(solid.len(), nx * ny * nz, "an entry for each cell");
    let mut squared = vec![f32::INFINITY; solid.len()];
    if nx == 0 {
        return squared;
    }
    for (row, solid) in squared.chunks_exact_mut(nx).zip(solid.chunks_exact(nx)) {
        along_a_row(row, solid);
    }
    let mut envelope = Envelope::new(ny.max(nz));
    for slab in squared.chunks_exact_mut(nx * ny) {
        envelope.replace_all(slab, nx, ny);
    }
    envelope.replace_all(&mut squared, nx * ny, nz);
    squared
}

/// Computes the squared distance to the nearest solid cell of the same row, with one sweep in each direction.
fn along_a_row(row: &mut [f32], solid: &[bool]) {
    let mut steps = f32::INFINITY;
    for (distance, solid) in row.iter_mut().zip(solid) {
        steps = if *solid { 0.0 } else { steps + 1.0 };
        *distance = steps;
    }
    steps = f32::INFINITY;
    for (distance, solid) in row.iter_mut().zip(solid).rev() {
        steps = if *solid { 0.0 } else { steps + 1.0 };
        let nearest = distance.min(steps);
        *distance = nearest * nearest;
    }
}

/// Number of lines per block. They are adjacent in memory, which uses the cache well.
const LINES: usize = 16;

/// Lower envelope of parabolas whose vertices are the cells of a line.
struct Envelope {
    /// Block of lines, one after the other.
    block: Vec<f32>,
    values: Vec<f32>,
    /// Cells whose parabolas belong to the envelope, from left to right.
    vertices: Vec<usize>,
    /// Coordinates from which each parabola is the lowest.
    from: Vec<f64>,
}

impl Envelope {
    fn new(longest: usize) -> Self {
        Self {
            block: vec![0.0; longest * LINES],
            values: vec![0.0; longest],
            vertices: vec![0; longest],
            from: vec![0.0; longest],
        }
    }

    /// Transforms `stride` adjacent lines of `count` cells each; neighbouring cells of a line are `stride` apart.
    fn replace_all(&mut self, all: &mut [f32], stride: usize, count: usize) {
        let mut block = std::mem::take(&mut self.block);
        for first in (0..stride).step_by(LINES) {
            let lines = LINES.min(stride - first);
            for i in 0..count {
                let row = &all[i * stride + first..][..lines];
                for (line, value) in row.iter().enumerate() {
                    block[line * count + i] = *value;
                }
            }
            for line in block.chunks_exact_mut(count).take(lines) {
                self.replace(line);
            }
            for i in 0..count {
                let row = &mut all[i * stride + first..][..lines];
                for (line, value) in row.iter_mut().enumerate() {
                    *value = block[line * count + i];
                }
            }
        }
        self.block = block;
    }

    /// Replaces each value by the minimum over the line of value plus squared distance.
    fn replace(&mut self, line: &mut [f32]) {
        let values = &mut self.values[..line.len()];
        values.copy_from_slice(line);
        let mut parts = 0;
        for (q, value) in values.iter().enumerate() {
            if *value == f32::INFINITY {
                continue;
            }
            let height = f64::from(*value) + (q * q) as f64;
            let mut start = f64::NEG_INFINITY;
            while parts > 0 {
                let v = self.vertices[parts - 1];
                let other = f64::from(values[v]) + (v * v) as f64;
                start = (height - other) / (2 * (q - v)) as f64;
                if start > self.from[parts - 1] {
                    break;
                }
                parts -= 1;
                start = f64::NEG_INFINITY;
            }
            self.vertices[parts] = q;
            self.from[parts] = start;
            parts += 1;
        }
        if parts == 0 {
            return;
        }
        let mut part = 0;
        for (i, least) in line.iter_mut().enumerate() {
            while part + 1 < parts && self.from[part + 1] < i as f64 {
                part += 1;
            }
            let v = self.vertices[part];
            let away = i.abs_diff(v);
            *least = values[v] + (away * away) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn by_comparing_all(cells: [usize; 3], solid: &[bool]) -> Vec<f32> {
        let place = |i: usize| {
            [
                i % cells[0],
                i / cells[0] % cells[1],
                i / cells[0] / cells[1],
            ]
        };
        (0..solid.len())
            .map(|i| {
                let here = place(i);
                let squares = (0..solid.len()).filter(|k| solid[*k]).map(|k| {
                    let there = place(k);
                    (0..3)
                        .map(|axis| here[axis].abs_diff(there[axis]).pow(2))
                        .sum::<usize>()
                });
                squares.min().map_or(f32::INFINITY, |least| least as f32)
            })
            .collect()
    }

    proptest! {
        #[test]
        fn distances_are_those_to_the_nearest_of_all_solid_cells(
            cells in proptest::array::uniform3(1..9usize), share in 0.0..0.6f64, draws in proptest::collection::vec(0.0..1.0f64, 512),
        ) {
            let count = cells.iter().product();
            let solid: Vec<bool> = draws[..count].iter().map(|draw| *draw < share).collect();
            prop_assert_eq!(squared_distances(cells, &solid), by_comparing_all(cells, &solid));
        }
    }

    /// Golden values from `tests/golden/distances_with_scipy.py` (`scipy.ndimage.distance_transform_edt`).
    #[test]
    fn distances_are_those_of_scipy() {
        let golden: serde_json::Value = serde_json::from_str(include_str!(
            "../../../tests/golden/distances_with_scipy.json"
        ))
        .unwrap();
        let cases = golden["cases"].as_array().unwrap();
        assert!(cases.len() >= 3);
        let mut compared = 0;
        for case in cases {
            let whole = |value: &serde_json::Value| value.as_u64().unwrap() as usize;
            let cells: [usize; 3] = std::array::from_fn(|i| whole(&case["cells"][i]));
            let mut solid = vec![false; cells.iter().product()];
            for number in case["solid"].as_array().unwrap() {
                solid[whole(number)] = true;
            }
            let ours = squared_distances(cells, &solid);
            let theirs = case["distances"].as_array().unwrap();
            assert_eq!(ours.len(), theirs.len());
            for (ours, theirs) in ours.iter().zip(theirs) {
                // SciPy computes the root in double precision; this transform is exact before the root.
                let apart = (f64::from(*ours).sqrt() - theirs.as_f64().unwrap()).abs();
                assert!(apart < 1e-6, "{ours} {theirs}");
                compared += 1;
            }
        }
        assert!(compared > 3000);
    }
}
