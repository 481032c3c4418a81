//! One kernel for all matrix products: tiles in shared memory, a block of each in a unit's registers.

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;

use crate::matrix::{Layout, Matrix, Store};

/// Most cubes along one axis of a launch that every GPU takes.
const AXIS: usize = 65_535;

/// Values of a vector.
const FOUR: usize = 4;
type Quad = Vector<f32, Const<4>>;

/// Depth of a tile, and rows and columns of a unit's share of it.
const DEPTH: usize = 16;
const UNIT: usize = FOUR;

/// Sizes of a tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Tile {
    rows: usize,
    columns: usize,
}

impl Tile {
    const fn units(&self) -> usize {
        self.rows / UNIT * (self.columns / UNIT)
    }

    /// Chooses by the rows of a product. Of thirteen tiles from 16 x 128 to 128 x 128, with shares of 4 x 4 to 8 x 8, with and without loading
    /// ahead, these were the fastest or within a tenth of it for every product of TactNet-II on an H200.
    fn of(rows: usize) -> Self {
        let (rows, columns) = if rows <= 16 { (16, 128) } else { (64, 64) };
        Self { rows, columns }
    }
}

/// What a product multiplies: sizes, and the rules' own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Problem {
    pub(crate) members: usize,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) depth: usize,
    /// Parts of the depth that are summed apart, each a member of the result.
    pub(crate) parts: usize,
    pub(crate) left: Layout,
    pub(crate) right: Layout,
    pub(crate) out: Layout,
    /// Whether neighbours along the depth lie side by side in memory (else along rows or columns).
    pub(crate) left_along_depth: bool,
    pub(crate) right_along_depth: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Plan {
    problem: Problem,
    tile: Tile,
    grid_x: usize,
    tiles: usize,
    column_tiles: usize,
    part: usize,
}

/// Multiplies `left` `[rows][depth]` by `right` `[depth][columns]` into `out`, for every member.
pub(crate) fn product<L: Matrix, R: Matrix, S: Store>(
    client: &Client,
    problem: Problem,
    left: (&Handle, usize),
    right: (&Handle, usize),
    out: (&Handle, usize),
) {
    let tile = Tile::of(problem.rows);
    let column_tiles = problem.columns.div_ceil(tile.columns);
    let tiles = problem.rows.div_ceil(tile.rows) * column_tiles;
    let grid_x = tiles.min(AXIS);
    let plan = Plan {
        problem,
        tile,
        grid_x,
        tiles,
        column_tiles,
        part: problem
            .depth
            .div_ceil(problem.parts)
            .next_multiple_of(DEPTH),
    };
    let count = CubeCount::Static(
        grid_x as u32,
        tiles.div_ceil(grid_x) as u32,
        (problem.members * problem.parts) as u32,
    );
    // SAFETY: lengths are those of the buffers; every access stays inside by the rules' own bounds and the tile's.
    unsafe {
        multiply::launch_unchecked::<L, R, S>(
            client,
            count,
            CubeDim::new_1d(tile.units() as u32),
            BufferArg::from_raw_parts(left.0.clone(), left.1),
            BufferArg::from_raw_parts(right.0.clone(), right.1),
            BufferArg::from_raw_parts(out.0.clone(), out.1),
            plan,
        );
    }
}

#[cube(launch_unchecked)]
fn multiply<L: Matrix, R: Matrix, S: Store>(
    left: &[f32],
    right: &[f32],
    out: &mut [f32],
    #[comptime] plan: Plan,
) {
    let p = comptime!(plan.problem);
    let t = comptime!(plan.tile);
    let units = comptime!(t.units());
    // Tiles hold vectors of four rows or columns; one more in each line keeps units on memory banks of their own.
    let (rows, columns) = comptime!((t.rows / FOUR, t.columns / FOUR));
    let (pitch_l, pitch_r) = comptime!((rows + 1, columns + 1));
    let (loads_l, loads_r) = comptime!((
        (rows * DEPTH).div_ceil(units),
        (columns * DEPTH).div_ceil(units)
    ));
    let mut tile_l = Shared::<[Quad]>::new_slice(comptime!(DEPTH * pitch_l));
    let mut tile_r = Shared::<[Quad]>::new_slice(comptime!(DEPTH * pitch_r));
    let mut sums = Array::<Quad>::new(UNIT);

    let tile = CUBE_POS_Y as usize * plan.grid_x + CUBE_POS_X as usize;
    if tile >= plan.tiles {
        terminate!();
    }
    let first_row = tile / plan.column_tiles * t.rows;
    let first_column = tile % plan.column_tiles * t.columns;
    let member = CUBE_POS_Z as usize / p.parts;
    let begin = CUBE_POS_Z as usize % p.parts * plan.part;
    let end = (begin + plan.part).min(p.depth);
    let unit = UNIT_POS as usize;
    let unit_column = unit % columns;
    let unit_row = unit / columns;

    #[unroll]
    for i in 0..UNIT {
        sums[i] = Quad::new(0.0f32);
    }

    let mut at = begin;
    while at < end {
        #[unroll]
        for i in 0..loads_l {
            let e = unit + i * units;
            let (k, row) = split(e, rows, p.left_along_depth);
            if comptime!((i + 1) * units <= rows * DEPTH) || e < comptime!(rows * DEPTH) {
                let first = first_row + row * FOUR;
                tile_l[k * pitch_l + row] = rows_at::<L>(left, member, first, at + k, end, p);
            }
        }
        #[unroll]
        for i in 0..loads_r {
            let e = unit + i * units;
            let (k, column) = split(e, columns, p.right_along_depth);
            if comptime!((i + 1) * units <= columns * DEPTH) || e < comptime!(columns * DEPTH) {
                let first = first_column + column * FOUR;
                tile_r[k * pitch_r + column] =
                    columns_at::<R>(right, member, at + k, first, end, p);
            }
        }
        sync_cube();
        for k in 0..DEPTH {
            let from_l = tile_l[k * pitch_l + unit_row];
            let from_r = tile_r[k * pitch_r + unit_column];
            #[unroll]
            for i in 0..UNIT {
                sums[i] += Quad::new(from_l.extract(i)) * from_r;
            }
        }
        sync_cube();
        at += DEPTH;
    }

    #[unroll]
    for i in 0..UNIT {
        let row = first_row + unit_row * UNIT + i;
        #[unroll]
        for j in 0..UNIT {
            let column = first_column + unit_column * UNIT + j;
            if row < p.rows && column < p.columns {
                let value = sums[i].extract(j);
                S::put(out, CUBE_POS_Z as usize, row, column, value, p.out);
            }
        }
    }
}

/// Four rows of one column of the left side; zeros beyond its edges.
#[cube]
fn rows_at<L: Matrix>(
    left: &[f32],
    member: usize,
    row: usize,
    k: usize,
    end: usize,
    #[comptime] p: Problem,
) -> Quad {
    let mut quad = Quad::new(0.0f32);
    if k < end {
        #[unroll]
        for j in 0..FOUR {
            if row + j < p.rows {
                quad.insert(j, L::at(left, member, row + j, k, p.left));
            }
        }
    }
    quad
}

/// Four columns of one row of the right side; zeros beyond its edges.
#[cube]
fn columns_at<R: Matrix>(
    right: &[f32],
    member: usize,
    k: usize,
    column: usize,
    end: usize,
    #[comptime] p: Problem,
) -> Quad {
    let mut quad = Quad::new(0.0f32);
    if k < end {
        #[unroll]
        for j in 0..FOUR {
            if column + j < p.columns {
                quad.insert(j, R::at(right, member, k, column + j, p.right));
            }
        }
    }
    quad
}

/// Entry `e` of a tile as `(depth, other index)`.
#[cube]
fn split(e: usize, #[comptime] others: usize, #[comptime] along_depth: bool) -> (usize, usize) {
    if along_depth {
        (e % DEPTH, e / DEPTH)
    } else {
        (e / others, e % others)
    }
}
