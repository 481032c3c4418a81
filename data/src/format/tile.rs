//! Position of a chunk among the values of a band.

use super::chunk_grid::RANK;

/// Copy of a chunk to its position in a larger box, in as few and long runs as possible.
pub(super) struct TileCopy {
    /// Extent, stride in the chunk and stride in the box, outermost first; contiguous axes are merged.
    axes: Vec<(usize, usize, usize)>,
    start: usize,
}

impl TileCopy {
    pub(super) fn new(offset: [usize; RANK], chunk: [usize; RANK], outer: [usize; RANK]) -> Self {
        let mut axes: Vec<(usize, usize, usize)> = Vec::with_capacity(RANK);
        let (mut from, mut to, mut start) = (1, 1, 0);
        for axis in (0..RANK).rev() {
            let extent = chunk[axis].min(outer[axis] - offset[axis]);
            start += offset[axis] * to;
            match axes.last_mut() {
                Some((run, f, t)) if *run * *f == from && *run * *t == to => *run *= extent,
                _ if extent == 1 => {}
                _ => axes.push((extent, from, to)),
            }
            from *= chunk[axis];
            to *= outer[axis];
        }
        axes.reverse();
        Self { axes, start }
    }

    pub(super) fn run<T: Copy, U: Copy>(
        &self,
        tile: &[T],
        out: &mut [U],
        convert: impl Fn(T) -> U + Copy,
    ) {
        copy_axes(&self.axes, tile, &mut out[self.start..], convert);
    }
}

fn copy_axes<T: Copy, U: Copy>(
    axes: &[(usize, usize, usize)],
    tile: &[T],
    out: &mut [U],
    convert: impl Fn(T) -> U + Copy,
) {
    match axes {
        [] => out[0] = convert(tile[0]),
        [(extent, 1, 1)] => {
            out[..*extent]
                .iter_mut()
                .zip(&tile[..*extent])
                .for_each(|(o, &x)| *o = convert(x));
        }
        [(extent, from, to)] => {
            let values = tile.iter().step_by(*from).take(*extent);
            out.iter_mut()
                .step_by(*to)
                .zip(values)
                .for_each(|(o, &x)| *o = convert(x));
        }
        [(extent, from, to), inner @ ..] => {
            for i in 0..*extent {
                copy_axes(inner, &tile[i * from..], &mut out[i * to..], convert);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_tile_lands_where_its_offset_says(
            chunk in prop::array::uniform5(1usize..4),
            outer in prop::array::uniform5(1usize..6),
            place in prop::array::uniform5(0usize..5),
        ) {
            let offset: [usize; RANK] = std::array::from_fn(|a| chunk[a] * (place[a] % outer[a].div_ceil(chunk[a])));
            let tile: Vec<u32> = (1..=chunk.iter().product::<usize>() as u32).collect();
            let mut out = vec![0u32; outer.iter().product()];
            TileCopy::new(offset, chunk, outer).run(&tile, &mut out, |x| x);
            for (index, &value) in out.iter().enumerate() {
                let mut rest = index;
                let mut at = [0; RANK];
                for axis in (0..RANK).rev() {
                    at[axis] = rest % outer[axis];
                    rest /= outer[axis];
                }
                let inside = (0..RANK).all(|a| at[a] >= offset[a] && at[a] < offset[a] + chunk[a]);
                let expected = if inside {
                    tile[(0..RANK).fold(0, |n, a| n * chunk[a] + at[a] - offset[a])]
                } else {
                    0
                };
                prop_assert_eq!(value, expected, "{:?}", at);
            }
        }
    }
}
